//! Boxes that lie along the surface: of a smooth one they are flat, where boxes along the axes are as thick as they are wide.
//!
//! A point at a distance d from a surface asks every box that comes closer than d. Along the axes these are all within √(d ε) of its foot for boxes
//! of size ε; along the surface only those next to it. Gottschalk, Lin, Manocha, "OBBTree", 1996, fit boxes by covariances; the mean normal of some
//! neighbouring triangles is cheaper and as good.

use super::mesh::{ALONE, Node};
use glam::DVec3;
use rayon::prelude::*;

/// Nodes with more triangles than this keep their box along the axes alone: they are not flat, and there are few of them.
const MOST: u32 = 256;

/// Squares of axes that were rounded to single precision are no more than this above one in sum.
const ROUNDED: f64 = 1.0 - 1e-6;

/// Part of the coordinates by which boxes are larger: far more than double precision rounds, far less than triangles are large.
const SLACK: f64 = 1e-9;

/// A box along its own axes, in single precision: fifteen numbers, in one line of the cache.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Turned {
    /// Unit vectors, right-angled but for rounding; zeros where there is no box.
    axes: [[f32; 3]; 3],
    low: [f32; 3],
    high: [f32; 3],
}

impl Turned {
    /// Around triangles, about an origin that is near to them.
    fn around(corners: &[[DVec3; 3]], origin: DVec3) -> Turned {
        let sum: DVec3 = corners.iter().map(|c| (c[1] - c[0]).cross(c[2] - c[0])).sum();
        let normal = sum.normalize_or(DVec3::Z);
        let across = normal.any_orthonormal_vector();
        let axes = [normal, across, normal.cross(across)].map(|a| a.to_array().map(|x| x as f32));
        let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
        let mut largest: f64 = 0.0;
        for p in corners.iter().flatten() {
            let p = *p - origin;
            largest = largest.max(p.abs().max_element());
            for (e, a) in ends.iter_mut().zip(axes) {
                let x = along(a, p);
                *e = [e[0].min(x), e[1].max(x)];
            }
        }
        // Rounded outward, and beyond what a point's own sums round, so that everything stays inside.
        let slack = SLACK * largest;
        let (low, high) = (ends.map(|e| ((e[0] - slack) as f32).next_down()), ends.map(|e| ((e[1] + slack) as f32).next_up()));
        Turned { axes, low, high }
    }

    /// True for a box.
    pub fn is_there(&self) -> bool {
        self.axes[0] != [0.0; 3]
    }

    /// No more than the square of the distance of a point, counted from the origin, from what is inside [m²].
    pub fn gap(&self, p: DVec3) -> f64 {
        let mut sum = 0.0;
        for k in 0..3 {
            let x = along(self.axes[k], p);
            let outside = (f64::from(self.low[k]) - x).max(x - f64::from(self.high[k])).max(0.0);
            sum += outside * outside;
        }
        sum * ROUNDED
    }
}

fn along(axis: [f32; 3], p: DVec3) -> f64 {
    f64::from(axis[0]) * p.x + f64::from(axis[1]) * p.y + f64::from(axis[2]) * p.z
}

/// The boxes of all nodes over these triangles, which are in the tree's order.
pub(super) fn turned(corners: &[[DVec3; 3]], tree: &[Node], origin: DVec3) -> Vec<Turned> {
    let of = |n: &Node| match n.range.1 - n.range.0 {
        count if count > MOST => Turned::default(),
        _ => Turned::around(&corners[n.range.0 as usize..n.range.1 as usize], origin),
    };
    tree.par_iter().with_min_len(ALONE as usize).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_point_of_a_triangle_is_nearer_than_its_box_says() {
        let place = |k: usize| {
            let t = k as f64;
            DVec3::new((t * 0.618_034).fract(), (t * 0.754_877).fract(), (t * 0.569_84).fract()) - 0.5
        };
        let origin = DVec3::new(10.0, -3.0, 7.0);
        let mut flat = 0;
        for k in 0..2000 {
            // Small triangles as scans have them, one in ten without area, far from the world's origin.
            let at = origin + place(k);
            let size = [1e-3, 0.1, 0.0][k % 10 / 4];
            let corners: Vec<[DVec3; 3]> =
                (0..1 + k % 4).map(|j| [0, 1, 2].map(|i| at + size * place(7 * k + 3 * j + i))).collect();
            let turned = Turned::around(&corners, origin);
            assert!(turned.is_there());
            let asked = origin + 3.0 * place(k + 5000);
            for c in corners.iter().flatten() {
                let true_one = c.distance_squared(asked);
                assert!(turned.gap(asked - origin) <= true_one, "{k}: {} {true_one}", turned.gap(asked - origin));
                assert!(turned.gap(*c - origin) == 0.0);
            }
            if corners.len() == 1 && size > 0.0 {
                // A single triangle's box has no thickness but what rounding gives it.
                flat += usize::from(f64::from(turned.high[0] - turned.low[0]) < 1e-5 * size);
            }
        }
        assert!(flat > 100, "{flat}");
    }
}
