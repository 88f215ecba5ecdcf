//! The side that a camera saw: where the line of sight towards it leaves the deformed body.
//!
//! A point behind a thin part's middle lies nearest to its back. Called unmatched, it costs a whole band at once; matched with the back, it
//! draws the body the wrong way. It is a point of the front, and its residual is how far the front lies towards the camera.
//!
//! The place is looked for in the point's own cell, continued beyond its faces: x(ξ) = p − t s with φ(ξ) = 0 for the line of sight s. For a
//! change of corners du and of the point dp, G·(dp − s dt − Σ Nᵢ(ξ) duᵢ) = 0 with the world gradient G of φ, so that r = −t has the
//! derivatives of a [`Pullback`] with gradient −G / (G·s).

use crate::cutcells::grid::shape_functions;
use crate::cutcells::pullback::{ITERATIONS, Pullback, TURNED_AWAY, jacobian};
use glam::DVec3;

/// Steps of the search per cell.
pub const PER_CELL: f64 = 4.0;
/// Most steps: bands are a few cells wide.
pub const MOST: usize = 64;
/// Iterations of the root: intervals halve where Newton's step leaves them.
pub const ROOT: usize = 40;
/// A cell continued so far (in its own size) means nothing any more.
pub const FAR: f64 = 8.0;

/// A line of sight through a deformed cell with corners `x` [m].
pub struct Sight<'a> {
    /// Corners of the cell.
    pub x: &'a [DVec3; 8],
    /// The observed point [m].
    pub point: DVec3,
    /// Direction from the camera to the point, of length one.
    pub direction: DVec3,
}

impl Sight<'_> {
    /// Place ξ on the line `t` [m] before the point, from a place nearby; `None` where the continued cell folds.
    fn at(&self, t: f64, mut xi: DVec3) -> Option<DVec3> {
        let goal = self.point - t * self.direction;
        for _ in 0..ITERATIONS {
            let n = shape_functions(xi);
            let r = (0..8).fold(-goal, |r, i| r + n[i] * self.x[i]);
            let j = jacobian(self.x, xi);
            if j.determinant() <= 0.0 {
                return None;
            }
            let step = j.inverse() * r;
            xi -= step;
            if !xi.is_finite() || (xi - 0.5).abs().max_element() >= FAR {
                return None;
            }
            if step.abs().max_element() < 1e-13 {
                return Some(xi);
            }
        }
        Some(xi)
    }

    /// The side of a point that lies nearest to a hidden one, at `place`: that one where `way` [m] towards the camera leads out of the body
    /// or cannot be told, or the front is seen at a grazing angle, where a small error of the body is a long way; else the front, as
    /// [`Sight::front`] says.
    pub fn side(
        &self,
        place: Pullback,
        way: f64,
        sizes: (f64, f64),
        distance: impl Fn(DVec3) -> Option<(f64, DVec3)>,
    ) -> Option<Pullback> {
        match self.at(way, place.xi).filter(|xi| distance(*xi).is_some_and(|d| d.0 < 0.0)) {
            Some(start) => {
                let front = self.front((way, start), sizes, distance)?;
                // Its gradient is G / |G·s|.
                let grazes = front.gradient.length() * TURNED_AWAY > 1.0;
                Some(if grazes { place } else { front })
            }
            None => Some(place),
        }
    }

    /// Where the body ends on the way to the camera, from a place inside it that lies `from` [m] before the point; `None` beyond `band` [m], or
    /// where that cannot be said. `distance` is φ [m] with its derivative by ξ, `None` where it is not known; `h` is the cells' size [m].
    pub fn front(
        &self,
        (from, start): (f64, DVec3),
        (h, band): (f64, f64),
        distance: impl Fn(DVec3) -> Option<(f64, DVec3)>,
    ) -> Option<Pullback> {
        let (mut inside, mut xi) = (from, start);
        let mut outside = None;
        for _ in 0..MOST {
            let t = inside + h / PER_CELL;
            let next = self.at(t, xi)?;
            if distance(next)?.0 >= 0.0 {
                outside = Some(t);
                break;
            }
            if t >= band {
                return None;
            }
            (inside, xi) = (t, next);
        }
        let mut beyond = outside?;
        let mut t = 0.5 * (inside + beyond);
        for _ in 0..ROOT {
            xi = self.at(t, xi)?;
            let (phi, by_xi) = distance(xi)?;
            if phi < 0.0 {
                inside = t;
            } else {
                beyond = t;
            }
            let gradient = jacobian(self.x, xi).inverse().transpose() * by_xi;
            let slope = gradient.dot(self.direction);
            let newton = t + phi / slope;
            let settled = (newton - t).abs() < 1e-14 * h;
            if settled || beyond - inside < 1e-15 * h {
                let faces = slope < 0.0 && t < band;
                return faces.then(|| Pullback { xi, phi: -t, gradient: gradient / -slope });
            }
            t = if newton > inside && newton < beyond { newton } else { 0.5 * (inside + beyond) };
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutcells::grid::CORNERS;

    /// A bent cell, and the distance of a tilted plane through it.
    fn cell() -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let c = DVec3::from_array(CORNERS[i].map(f64::from));
            c + 0.1 * DVec3::new(c.y * c.z, 0.5 * c.x, c.x * c.y)
        })
    }

    fn plane(xi: DVec3) -> Option<(f64, DVec3)> {
        let n = DVec3::new(0.3, -0.2, 0.9);
        // Curved, so that the root is not that of one Newton step.
        Some((n.dot(xi) - 0.6 + 0.1 * xi.x * xi.z, n + 0.1 * DVec3::new(xi.z, 0.0, xi.x)))
    }

    fn looked(x: &[DVec3; 8], point: DVec3) -> Pullback {
        let direction = DVec3::new(0.2, 0.1, -1.0).normalize();
        let sight = Sight { x, point, direction };
        let start = sight.at(0.0, DVec3::splat(0.5)).unwrap();
        sight.front((0.0, start), (1.0, 4.0), plane).unwrap()
    }

    #[test]
    fn the_front_lies_on_the_line_of_sight_and_on_the_surface() {
        let (x, p) = (cell(), DVec3::new(0.4, 0.5, 0.2));
        let found = looked(&x, p);
        assert!(plane(found.xi).unwrap().0.abs() < 1e-13);
        let n = shape_functions(found.xi);
        let place: DVec3 = (0..8).map(|i| n[i] * x[i]).sum();
        let way = p - place;
        assert!((way.length() + found.phi).abs() < 1e-12 && found.phi < 0.0, "{way} {}", found.phi);
        assert!(way.normalize().dot(DVec3::new(0.2, 0.1, -1.0).normalize()) > 1.0 - 1e-12);
    }

    #[test]
    fn derivatives_by_corners_and_point_match_central_differences() {
        let (x, p) = (cell(), DVec3::new(0.4, 0.5, 0.2));
        let found = looked(&x, p);
        let n = shape_functions(found.xi);
        let d = 1e-6;
        for a in 0..3 {
            for i in 0..8 {
                let at = |s: f64| {
                    let mut y = x;
                    y[i][a] += s * d;
                    looked(&y, p).phi
                };
                let slope = (at(1.0) - at(-1.0)) / (2.0 * d);
                // Differences of second order with steps of 1e-6 and values good to 1e-14.
                assert!((slope + n[i] * found.gradient[a]).abs() < 1e-8, "corner {i} axis {a}");
            }
            let at = |s: f64| looked(&x, p + s * d * DVec3::AXES[a]).phi;
            let slope = (at(1.0) - at(-1.0)) / (2.0 * d);
            assert!((slope - found.gradient[a]).abs() < 1e-8, "point, axis {a}");
        }
    }

    #[test]
    fn the_side_is_kept_where_the_way_leads_out_of_the_body() {
        let (x, point) = (cell(), DVec3::new(0.4, 0.5, 0.2));
        let direction = DVec3::new(0.2, 0.1, -1.0).normalize();
        let (sight, front) = (Sight { x: &x, point, direction }, looked(&x, point));
        let place = Pullback { xi: sight.at(0.0, DVec3::splat(0.5)).unwrap(), phi: -0.1, gradient: DVec3::NEG_Z };
        let side = |way: f64| sight.side(place, way, (1.0, 4.0), plane).unwrap();
        assert_eq!(side(1.01 * -front.phi), place);
        // A root good to 1e-14 of a cell, from another start.
        let found = side(0.99 * -front.phi);
        assert!((found.phi - front.phi).abs() < 1e-12 && (found.xi - front.xi).length() < 1e-12);
    }

    #[test]
    fn a_front_beyond_the_band_is_none() {
        let (x, point) = (cell(), DVec3::new(0.4, 0.5, 0.2));
        let sight = Sight { x: &x, point, direction: DVec3::NEG_Z };
        let start = sight.at(0.0, DVec3::splat(0.5)).unwrap();
        assert!(sight.front((0.0, start), (1.0, 0.2), plane).is_none());
        assert!(sight.front((0.0, start), (1.0, 4.0), |_| None).is_none());
    }

    #[test]
    fn a_front_at_a_grazing_angle_leaves_the_hidden_side() {
        let (x, point) = (cell(), DVec3::new(0.45, 0.55, 0.6));
        let hidden = |sight: &Sight| Pullback { xi: sight.at(0.0, DVec3::splat(0.5)).unwrap(), phi: -0.01, gradient: DVec3::X };
        let side = |direction: DVec3| {
            let sight = Sight { x: &x, point, direction: direction.normalize() };
            let place = hidden(&sight);
            assert!(plane(place.xi).unwrap().0 < 0.0, "the point is inside");
            (place, sight.side(place, 0.0, (1.0, 4.0), plane).unwrap())
        };
        let (place, grazing) = side(DVec3::new(0.9, 0.1, -0.4));
        assert_eq!(grazing, place);
        let (place, steep) = side(DVec3::new(0.2, 0.1, -1.0));
        assert!(steep != place && steep.phi < 0.0 && steep.gradient.length() < 1.0 / TURNED_AWAY);
    }
}
