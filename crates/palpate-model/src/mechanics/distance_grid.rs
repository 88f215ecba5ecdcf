//! A signed distance sampled on a lattice and continued by cubic B-splines: what a moving obstacle is.
//!
//! The spline passes through the samples and has continuous second derivatives. Newton's method and the adjoint need these: a trilinear
//! distance has kinks at every face of the lattice. Prefilter: one tridiagonal solve (1, 4, 1)/6 along each line of each axis (Unser,
//! *IEEE Signal Processing Magazine* 16(6), 1999), with natural ends.

use crate::shape::Shape;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Lattice points beyond the shape's box on every side: the spline's support, room for the contact law, and for what its natural ends spoil, a
/// quarter of it a point.
const MARGIN: usize = 6;

/// Most samples of a lattice: 32 MB.
pub const MOST_SAMPLES: usize = 4_000_000;

/// A distance with its derivatives at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// Signed distance [m], negative inside.
    pub value: f64,
    /// Its gradient; of length one where the distance is exact.
    pub gradient: DVec3,
    /// Its second derivatives [1/m].
    pub hessian: DMat3,
}

/// A sampled signed distance.
#[derive(Clone, PartialEq)]
pub struct DistanceGrid {
    /// Place of the first sample [m].
    origin: DVec3,
    /// Distance of samples [m].
    spacing: f64,
    /// Samples along every axis.
    counts: [usize; 3],
    /// Coefficients of the spline [m] `[z, y, x]`, x fastest.
    coefficients: Vec<f64>,
}

impl std::fmt::Debug for DistanceGrid {
    /// Without the coefficients.
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "DistanceGrid {{ origin: {}, spacing: {}, counts: {:?} }}", self.origin, self.spacing, self.counts)
    }
}

impl DistanceGrid {
    /// Samples along every axis that a shape takes at a spacing [m].
    pub fn counts(shape: &dyn Shape, spacing: f64) -> [usize; 3] {
        let (low, high) = shape.bounds();
        ((high - low) / spacing).to_array().map(|n| n.ceil() as usize + 1 + 2 * MARGIN)
    }

    /// Samples a shape at a spacing [m].
    pub fn new(shape: &dyn Shape, spacing: f64) -> DistanceGrid {
        let (low, high) = shape.bounds();
        let counts = DistanceGrid::counts(shape, spacing);
        let [nx, ny, nz] = counts;
        // The lattice lies around the box's middle.
        let reach = DVec3::from_array(counts.map(|n| (n - 1) as f64)) * (0.5 * spacing);
        let origin = 0.5 * (low + high) - reach;
        let at = |k: usize| origin + spacing * DVec3::new((k % nx) as f64, (k / nx % ny) as f64, (k / (nx * ny)) as f64);
        let mut coefficients: Vec<f64> = (0..nx * ny * nz).into_par_iter().map(|k| shape.signed_distance(at(k))).collect();
        for (axis, stride) in [1, nx, nx * ny].into_iter().enumerate() {
            prefilter(&mut coefficients, counts[axis], stride);
        }
        DistanceGrid { origin, spacing, counts, coefficients }
    }

    /// Distance of samples [m].
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Place of the first sample [m], samples along every axis, and the spline's coefficients [m] `[z, y, x]`, x fastest.
    pub fn lattice(&self) -> (DVec3, [usize; 3], &[f64]) {
        (self.origin, self.counts, &self.coefficients)
    }

    /// Lowest and highest place where the spline is defined [m].
    pub fn domain(&self) -> (DVec3, DVec3) {
        let last = DVec3::from_array(self.counts.map(|n| (n - 2) as f64));
        (self.origin + DVec3::splat(self.spacing), self.origin + self.spacing * last)
    }

    /// Distance and derivatives at a place [m]; beyond the lattice the distance to it is added, and no curvature is known.
    pub fn at(&self, place: DVec3) -> Distance {
        let (low, high) = self.domain();
        let inside = place.clamp(low, high);
        let d = self.within(inside);
        let beyond = (place - inside).length();
        if beyond == 0.0 {
            return d;
        }
        Distance { value: d.value + beyond, gradient: (place - inside) / beyond, hessian: DMat3::ZERO }
    }

    /// The spline's value and derivatives in its domain.
    fn within(&self, place: DVec3) -> Distance {
        let local = (place - self.origin) / self.spacing;
        let [nx, ny, _] = self.counts;
        let mut first = [0; 3];
        let mut weights = [[[0.0; 4]; 3]; 3];
        for a in 0..3 {
            let cell = (local[a].floor() as usize).clamp(1, self.counts[a] - 3);
            first[a] = cell - 1;
            weights[a] = basis(local[a] - cell as f64);
        }
        let [x, y, z] = &weights;
        let (mut value, mut g, mut pure, mut mixed) = (0.0, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for k in 0..4 {
            for j in 0..4 {
                let row = first[0] + nx * (first[1] + j + ny * (first[2] + k));
                let c = &self.coefficients[row..row + 4];
                let [s0, s1, s2] = [0, 1, 2].map(|d| (0..4).map(|i| x[d][i] * c[i]).sum::<f64>());
                value += z[0][k] * y[0][j] * s0;
                g += DVec3::new(z[0][k] * y[0][j] * s1, z[0][k] * y[1][j] * s0, z[1][k] * y[0][j] * s0);
                pure += DVec3::new(z[0][k] * y[0][j] * s2, z[0][k] * y[2][j] * s0, z[2][k] * y[0][j] * s0);
                // By y and z, z and x, x and y.
                mixed += DVec3::new(z[1][k] * y[1][j] * s0, z[1][k] * y[0][j] * s1, z[0][k] * y[1][j] * s1);
            }
        }
        let hessian = DMat3::from_cols(
            DVec3::new(pure.x, mixed.z, mixed.y),
            DVec3::new(mixed.z, pure.y, mixed.x),
            DVec3::new(mixed.y, mixed.x, pure.z),
        );
        let h = self.spacing;
        Distance { value, gradient: g / h, hessian: hessian * (1.0 / (h * h)) }
    }
}

/// Values of the four cubic B-splines that do not vanish at `t` in [0, 1], and their first and second derivatives.
fn basis(t: f64) -> [[f64; 4]; 3] {
    let (t2, t3, r) = (t * t, t * t * t, 1.0 - t);
    [
        [r * r * r / 6.0, (3.0 * t3 - 6.0 * t2 + 4.0) / 6.0, (-3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0) / 6.0, t3 / 6.0],
        [-0.5 * r * r, 1.5 * t2 - 2.0 * t, -1.5 * t2 + t + 0.5, 0.5 * t2],
        [r, 3.0 * t - 2.0, 1.0 - 3.0 * t, t],
    ]
}

/// Samples into coefficients along one axis of `n` points, `stride` apart.
fn prefilter(values: &mut [f64], n: usize, stride: usize) {
    // Natural ends: the first and the last coefficient are the samples. Thomas' algorithm on c₋ + 4c + c₊ = 6f in between.
    let mut factor = vec![0.0; n];
    for k in 1..n - 1 {
        factor[k] = 1.0 / (4.0 - factor[k - 1]);
    }
    let block = n * stride;
    values.par_chunks_mut(block).for_each(|part| {
        for start in 0..stride {
            let at = |k: usize| start + k * stride;
            for k in 1..n - 1 {
                part[at(k)] = (6.0 * part[at(k)] - part[at(k - 1)]) * factor[k];
            }
            for k in (1..n - 1).rev() {
                part[at(k)] -= factor[k] * part[at(k + 1)];
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::rotation::tests::Noise;
    use crate::scene::Analytic;
    use crate::shape::Placed;
    use glam::DAffine3;

    const RADIUS: f64 = 0.05;

    fn ball() -> DistanceGrid {
        let shape = Placed::new(Analytic::Ball { radius: RADIUS, center: DVec3::new(0.01, -0.02, 0.03) }, DAffine3::IDENTITY);
        DistanceGrid::new(&shape, RADIUS / 16.0)
    }

    #[test]
    fn a_ball_is_a_ball() {
        let (grid, center, mut noise) = (ball(), DVec3::new(0.01, -0.02, 0.03), Noise(5));
        for _ in 0..500 {
            let n = noise.vector(1.0).normalize();
            let r = RADIUS * noise.uniform(0.8, 1.1);
            let d = grid.at(center + r * n);
            // A cubic spline errs by some h⁴/r³ of a distance r from the middle, h = R/16: 2e-5 R; a power less for each derivative.
            assert!((d.value - (r - RADIUS)).abs() < 2e-5 * RADIUS, "{} {}", d.value, r - RADIUS);
            assert!((d.gradient - n).length() < 1e-3);
            let exact = (DMat3::IDENTITY - DMat3::from_cols(n * n.x, n * n.y, n * n.z)) * (1.0 / r);
            let off = (0..3).map(|c| (d.hessian.col(c) - exact.col(c)).length()).fold(0.0, f64::max);
            assert!(off < 0.05 / RADIUS, "{off}");
        }
        // Far away it is farther than the lattice reaches.
        assert!(grid.at(center + DVec3::X).value > 0.9);
    }

    #[test]
    fn derivatives_are_those_of_the_value() {
        let (grid, mut noise) = (ball(), Noise(6));
        let (low, high) = grid.domain();
        for _ in 0..200 {
            let t = DVec3::new(noise.uniform(0.0, 1.0), noise.uniform(0.0, 1.0), noise.uniform(0.0, 1.0));
            let (x, e) = (low + t * (high - low), 1e-4 * grid.spacing());
            let d = grid.at(x);
            for a in 0..3 {
                let step = DVec3::AXES[a] * e;
                let (up, down) = (grid.at(x + step), grid.at(x - step));
                // Third derivatives of a cubic jump between cells: an error of e/h.
                assert!(((up.value - down.value) / (2.0 * e) - d.gradient[a]).abs() < 1e-6);
                assert!(((up.gradient - down.gradient) / (2.0 * e) - d.hessian.col(a)).length() < 2e-4 / grid.spacing());
            }
        }
    }
}
