//! Pulling an observed point back into the rest shape: which place of a deformed cell it is, and how far that place is
//! from the rest surface (sparse surface constraint; Weiss et al. 2020, section 5.1).

use crate::cutcells::distances::{Distances, interpolate};
use crate::cutcells::grid::{shape_functions, shape_gradients};
use glam::{DMat3, DVec3};

/// A surface that is turned away from the camera by more than this (cosine between its outward normal and the line of sight)
/// cannot have been seen. Not zero: normals at the silhouette and along edges are uncertain.
pub const TURNED_AWAY: f64 = 0.3;
/// Next to a sharp edge noise puts points closest to the side that the camera does not see; calling them unmatched would make the
/// cost jump by a whole band. Such a point lies near a visible side as well: going towards the camera by `1.5 |φ|` and so many
/// standard deviations of the noise leaves the body. Inside a thin part, near its back, it does not: then it belongs to the front
/// ([`crate::cutcells::front`]).
pub const NOISE_REACH: f64 = 4.0;

/// Most steps of Newton's method for a place: five reach rounding for corners displaced by up to 0.4 h, and convergence is quadratic;
/// twelve cover strong shear.
pub const ITERATIONS: usize = 12;

/// Local coordinates ξ of world point `p` in the trilinear cell with corners `x`, by Newton's method; `None` when `p` is not in
/// the cell (beyond a slack of 1e-9 of its size, so that no gap opens between neighbours) or the cell is folded.
pub fn invert_trilinear(x: &[DVec3; 8], p: DVec3) -> Option<DVec3> {
    let size = (x[7] - x[0]).abs().max_element().max((x[6] - x[1]).abs().max_element());
    let mut xi = DVec3::splat(0.5);
    for _ in 0..ITERATIONS {
        let n = shape_functions(xi);
        let mut r = -p;
        for i in 0..8 {
            r += n[i] * x[i];
        }
        let jacobian = jacobian(x, xi);
        let det = jacobian.determinant();
        if det.abs() <= 1e-12 * size * size * size {
            return None;
        }
        let step = jacobian.inverse() * r;
        xi -= step;
        if (xi - 0.5).abs().max_element() > 1.5 {
            return None;
        }
        if step.abs().max_element() < 1e-13 {
            break;
        }
    }
    let slack = 1e-9;
    if xi.min_element() < -slack || xi.max_element() > 1.0 + slack {
        return None;
    }
    // A folded cell maps several places to one point; only the unfolded part means something.
    (jacobian(x, xi).determinant() > 0.0).then_some(xi)
}

/// ∂x/∂ξ of a trilinear cell with corners `x` [m].
pub fn jacobian(x: &[DVec3; 8], xi: DVec3) -> DMat3 {
    let g = shape_gradients(xi);
    let mut j = DMat3::ZERO;
    for i in 0..8 {
        j.x_axis += g[i].x * x[i];
        j.y_axis += g[i].y * x[i];
        j.z_axis += g[i].z * x[i];
    }
    j
}

/// Where an observed point lies in a deformed cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pullback {
    /// Local coordinates.
    pub xi: DVec3,
    /// Signed distance from the rest surface [m].
    pub phi: f64,
    /// World gradient G of the deformed signed distance; ∂φ/∂x_i = −N_i(ξ) G.
    pub gradient: DVec3,
}

/// Pulls a point back through a deformed cell; `None` when the point is not in it.
pub fn pull_back(x: &[DVec3; 8], sdf: &Distances, p: DVec3) -> Option<Pullback> {
    let xi = invert_trilinear(x, p)?;
    let (phi, by_xi) = interpolate(sdf, xi);
    Some(Pullback { xi, phi, gradient: jacobian(x, xi).inverse().transpose() * by_xi })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutcells::distances::{STEPS, place};
    use crate::cutcells::grid::CORNERS;

    fn deformed(seed: u64) -> [DVec3; 8] {
        let mut s = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut next = move || {
            s ^= s << 13;
            s ^= s >> 7;
            s ^= s << 17;
            (s >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let turn = DMat3::from_rotation_z(3.0 * next()) * DMat3::from_rotation_x(3.0 * next());
        std::array::from_fn(|i| turn * (DVec3::from_array(CORNERS[i].map(f64::from)) + 0.5 * DVec3::new(next(), next(), next())))
    }

    fn sdf() -> Distances {
        std::array::from_fn(|k| {
            let p = DVec3::from_array(place(k).map(|x| x as f64)) / STEPS as f64;
            (p - DVec3::new(-0.7, 0.1, 0.3)).length() - 1.0
        })
    }

    #[test]
    fn inversion_finds_the_place() {
        for seed in 1..200 {
            let x = deformed(seed);
            let xi = DVec3::new(0.2, 0.7, 0.9 * (seed as f64 / 200.0));
            let n = shape_functions(xi);
            let p: DVec3 = (0..8).map(|i| n[i] * x[i]).sum();
            assert!((invert_trilinear(&x, p).unwrap() - xi).length() < 1e-10);
        }
    }

    #[test]
    fn derivative_by_corners_matches_central_differences() {
        for seed in 1..50 {
            let x = deformed(seed);
            let n = shape_functions(DVec3::new(0.3, 0.6, 0.4));
            let p: DVec3 = (0..8).map(|i| n[i] * x[i]).sum();
            let base = pull_back(&x, &sdf(), p).unwrap();
            let weights = shape_functions(base.xi);
            for i in 0..8 {
                for a in 0..3 {
                    let d = 1e-6;
                    let moved = |s: f64| {
                        let mut y = x;
                        y[i][a] += s * d;
                        pull_back(&y, &sdf(), p).unwrap().phi
                    };
                    let fd = (moved(1.0) - moved(-1.0)) / (2.0 * d);
                    assert!((fd + weights[i] * base.gradient[a]).abs() < 1e-8);
                }
            }
        }
    }
}
