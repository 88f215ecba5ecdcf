//! A guard against inversion beyond what corotation can follow.
//!
//! With signed stretches s₁ ≥ s₂ ≥ |s₃| the rotation of F jumps where s₂ + s₃ = 0: a cell inverted as far along one axis as it is
//! stretched along another. The strain energy of the mean deformation stays continuous there, that of bending and of damping does
//! not, and a potential that jumps has no stationary point to find. So the distance from that set,
//! `d = (s₁+s₂)(s₂+s₃)(s₃+s₁) / (s₁+s₂+s₃)²`, is kept positive by a barrier: energy `STRENGTH · E · V · ln³(START/d)` for
//! d < START, else nothing; twice continuously differentiable (in the manner of Li et al., Incremental Potential Contact, ACM Trans.
//! Graph. 39(4), 2020). Cells at rest have d = 8/9, cells flattened to nothing 1/2: no state that the material law makes sense for
//! is touched.
//!
//! With i = tr S, n = |F|² and j = det F: d = ½ (i − n/i) − j/i².

use super::{CellPose, M24};
use crate::cutcells::grid::SIGNS;
use crate::mechanics::rotation::{axial, cross_matrix};
use glam::{DMat3, DVec3};

/// Distance d below which the barrier acts: stretches (1, 1, −0.6).
pub const START: f64 = 0.15;
/// Factor of the energy: cells of a torus that its own weight crushes come to rest at d of about 0.1.
pub const STRENGTH: f64 = 0.1;

/// A cell close to the jump.
#[derive(Clone, Copy, Debug)]
pub struct Guard {
    /// Energy over E V [-].
    pub energy: f64,
    // First and second derivative of the energy by d.
    slope: f64,
    bend: f64,
    r: DMat3,
    f: DMat3,
    cofactor: DMat3,
    g_inv: DMat3,
    // i, n and j.
    invariants: [f64; 3],
    scale: f64,
}

impl CellPose {
    /// The guard of this cell, where it acts.
    #[inline(always)]
    pub fn guard(&self) -> Option<Guard> {
        let (d, invariants) = self.distance_and_invariants();
        if d >= START { None } else { Some(self.guard_at(d, invariants)) }
    }

    /// Distance d of this cell from the jump of its rotation; 8/9 at rest.
    pub fn distance(&self) -> f64 {
        self.distance_and_invariants().0
    }

    #[inline(always)]
    fn distance_and_invariants(&self) -> (f64, [f64; 3]) {
        let s = &self.polar.s;
        let i = s.x_axis.x + s.y_axis.y + s.z_axis.z;
        let n = s.x_axis.length_squared() + s.y_axis.length_squared() + s.z_axis.length_squared();
        let j = s.determinant();
        let d = 0.5 * (i - n / i) - j / (i * i);
        (d, [i, n, j])
    }

    #[cold]
    fn guard_at(&self, d: f64, invariants: [f64; 3]) -> Guard {
        let depth = (START / d).ln();
        let f = self.polar.r * self.polar.s;
        Guard {
            // Rounding may leave d ≤ 0 on the set itself: no energy is high enough.
            energy: if d > 0.0 { STRENGTH * depth.powi(3) } else { f64::INFINITY },
            slope: -3.0 * STRENGTH * depth * depth / d,
            bend: 3.0 * STRENGTH * depth * (2.0 + depth) / (d * d),
            r: self.polar.r,
            f,
            cofactor: cofactor(f),
            g_inv: self.polar.g_inv,
            invariants,
            scale: self.scale,
        }
    }
}

impl Guard {
    /// ∂d/∂F.
    fn gradient(&self) -> DMat3 {
        let [i, n, j] = self.invariants;
        self.r * (0.5 * (1.0 + n / (i * i)) + 2.0 * j / (i * i * i)) - self.f * (1.0 / i) - self.cofactor * (1.0 / (i * i))
    }

    /// World-frame forces on the corners over E V [1/m].
    pub fn force(&self) -> [DVec3; 8] {
        self.corners(&(self.gradient() * self.slope))
    }

    /// P b_k of every corner.
    fn corners(&self, p: &DMat3) -> [DVec3; 8] {
        SIGNS.map(|s| *p * (DVec3::from_array(s) * self.scale))
    }

    /// Change of the stress over E V for a change `a` of F; with `convex` only its positive semi-definite part.
    fn rate(&self, a: &DMat3, convex: bool) -> DMat3 {
        let gradient = self.gradient();
        let main = gradient * (self.bend * inner(&gradient, a));
        if convex {
            return main;
        }
        let [i, n, j] = self.invariants;
        let (di, dn, dj) = (inner(&self.r, a), 2.0 * inner(&self.f, a), inner(&self.cofactor, a));
        let (i2, i3, i4) = (i * i, i * i * i, i * i * i * i);
        let turn = self.r * cross_matrix(self.g_inv * axial(self.r.transpose() * *a));
        let by_i = (-n / i3 - 6.0 * j / i4) * di + 0.5 * dn / i2 + 2.0 * dj / i3;
        let second = self.r * by_i + turn * (0.5 * (1.0 + n / i2) + 2.0 * j / i3) + self.f * (di / i2) - *a * (1.0 / i)
            + self.cofactor * (2.0 * di / i3)
            - cofactor_rate(&self.f, a) * (1.0 / i2);
        main + second * self.slope
    }

    /// Adds `factor` (E V) times the second derivative by the corners, world frame, all 24 × 24 numbers.
    pub fn add_hessian(&self, factor: f64, convex: bool, out: &mut M24) {
        for k in 0..8 {
            let b = DVec3::from_array(SIGNS[k]) * self.scale;
            for c in 0..3 {
                let e = DVec3::AXES[c] * factor;
                let rate = self.rate(&DMat3::from_cols(e * b.x, e * b.y, e * b.z), convex);
                for (l, f) in self.corners(&rate).iter().enumerate() {
                    for r in 0..3 {
                        out[24 * (3 * l + r) + 3 * k + c] += f[r];
                    }
                }
            }
        }
    }
}

fn inner(a: &DMat3, b: &DMat3) -> f64 {
    a.x_axis.dot(b.x_axis) + a.y_axis.dot(b.y_axis) + a.z_axis.dot(b.z_axis)
}

/// Derivative of det F by F.
fn cofactor(f: DMat3) -> DMat3 {
    let (a, b, c) = (f.x_axis, f.y_axis, f.z_axis);
    DMat3::from_cols(b.cross(c), c.cross(a), a.cross(b))
}

fn cofactor_rate(f: &DMat3, d: &DMat3) -> DMat3 {
    let (a, b, c) = (f.x_axis, f.y_axis, f.z_axis);
    let (da, db, dc) = (d.x_axis, d.y_axis, d.z_axis);
    DMat3::from_cols(db.cross(c) + b.cross(dc), dc.cross(a) + c.cross(da), da.cross(b) + a.cross(db))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::rotation::tests::Noise;

    const H: f64 = 0.13;

    fn corners(f: DMat3) -> [DVec3; 8] {
        SIGNS.map(|s| f * DVec3::from_array(s) * (0.5 * H))
    }

    fn moved(x: &[DVec3; 8], d: &[DVec3; 8], t: f64) -> [DVec3; 8] {
        std::array::from_fn(|i| x[i] + d[i] * t)
    }

    fn dot(a: &[DVec3; 8], b: &[DVec3; 8]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
    }

    /// A turned cell with these signed stretches.
    fn cell(noise: &mut Noise, s: [f64; 3]) -> [DVec3; 8] {
        let v = noise.rotation();
        corners(noise.rotation() * (v.transpose() * DMat3::from_diagonal(DVec3::from_array(s)) * v))
    }

    #[test]
    fn distance_is_that_of_the_signed_stretches_and_sound_cells_are_left_alone() {
        let mut noise = Noise(4);
        for s in [[1.0, 1.0, 1.0], [2.0, 0.5, 0.4], [1.0, 1.0, 0.0], [1.0, 1.0, -0.5], [0.3, 0.3, 0.3]] {
            assert!(CellPose::new(&cell(&mut noise, s), H).guard().is_none(), "{s:?}");
        }
        for s in [[1.2f64, 1.0, -0.8], [1.0, 0.3, -0.25], [1.0, 1.0, -0.9999], [0.1, 0.1, 0.1]] {
            let d = (s[0] + s[1]) * (s[1] + s[2]) * (s[2] + s[0]) / (s[0] + s[1] + s[2]).powi(2);
            let guard = CellPose::new(&cell(&mut noise, s), H).guard().unwrap_or_else(|| panic!("{s:?} is not guarded"));
            let expected = STRENGTH * (START / d).ln().powi(3);
            // Rounding of d, 1e-16, over the smallest d here, 2e-8.
            assert!((guard.energy / expected - 1.0).abs() < 1e-7, "{s:?}: {} {expected}", guard.energy);
        }
    }

    #[test]
    fn force_and_hessian_match_central_differences() {
        let mut noise = Noise(5);
        for trial in 0..200 {
            let b = noise.uniform(0.3, 1.0);
            let gap = noise.uniform(0.05, 0.12);
            let a = noise.uniform(1.0, 1.5);
            let x = cell(&mut noise, [a, b, gap - b]);
            let d: [DVec3; 8] = std::array::from_fn(|_| noise.vector(H));
            let at = |t: f64| CellPose::new(&moved(&x, &d, t), H).guard().expect("guarded");
            let t = 1e-6;
            let slope = (at(t).energy - at(-t).energy) / (2.0 * t);
            let exact = dot(&at(0.0).force(), &d);
            let size = dot(&at(0.0).force(), &at(0.0).force()).sqrt() * H;
            // Truncation (t/gap)² and rounding 1e-16/t, each against the gap's own scale.
            assert!((slope - exact).abs() < 1e-7 * size.max(1.0), "{trial}: {slope} {exact}");
            let mut h = [0.0; 576];
            at(0.0).add_hessian(1.0, false, &mut h);
            let asymmetry = (0..576).map(|k| (h[k] - h[24 * (k % 24) + k / 24]).abs()).fold(0.0, f64::max);
            let largest = h.iter().fold(0.0f64, |a, b| a.max(b.abs()));
            assert!(asymmetry < 1e-12 * largest, "{trial}: {asymmetry} of {largest}");
            let (up, down) = (at(t).force(), at(-t).force());
            let mut convex = [0.0; 576];
            at(0.0).add_hessian(1.0, true, &mut convex);
            let (mut curvature, mut worst) = (0.0, 0.0f64);
            for r in 0..24 {
                let row: f64 = (0..24).map(|c| h[24 * r + c] * d[c / 3][c % 3]).sum();
                let difference = (up[r / 3][r % 3] - down[r / 3][r % 3]) / (2.0 * t);
                worst = worst.max((row - difference).abs());
                curvature += (0..24).map(|c| d[r / 3][r % 3] * convex[24 * r + c] * d[c / 3][c % 3]).sum::<f64>();
            }
            assert!(worst < 1e-6 * largest * H, "{trial}: {worst} of {largest}");
            assert!(curvature >= -1e-12 * largest, "{trial}: {curvature}");
        }
    }

    #[test]
    fn energy_grows_without_bound_on_both_sides_of_the_jump() {
        let at =
            |s: f64| CellPose::new(&corners(DMat3::from_diagonal(DVec3::new(1.0, 0.8, s))), H).guard().map_or(0.0, |g| g.energy);
        for side in [-1.0, 1.0] {
            let walk: Vec<f64> = [0.1, 1e-2, 1e-4, 1e-8].iter().map(|gap| at(-0.8 + side * gap)).collect();
            assert!(walk.windows(2).all(|w| w[1] > w[0]) && walk[3] > 300.0, "{walk:?}");
        }
    }
}
