//! The body-centred cubic lattice that covers a shape.

use super::StuffingError;
use glam::{DVec3, IVec3};

/// Most points of a lattice: nine million tetrahedra of a body that fills its box.
pub(super) const MOST_POINTS: f64 = 1.5e6;
/// More cubes than fit through the shortest side of any box with so many points.
const MOST_THROUGH: u32 = 91;

/// Corners (even coordinates) and centres (odd ones) of cubes, in halves of an edge.
pub(super) struct Lattice {
    origin: DVec3,
    /// Half of the long edge [m].
    pub(super) half: f64,
    /// Corners along each axis.
    pub(super) size: IVec3,
}

/// The edge of cubes that meet the shortest side of a box whole, at most the one asked for [m].
pub(crate) fn fitted(span: DVec3, edge: f64) -> f64 {
    let least = span.min_element();
    least / (least / edge - 1e-9).ceil().max(1.0)
}

impl Lattice {
    /// A lattice around a box, with one cube to spare; its shortest side is met by whole cubes.
    ///
    /// # Errors
    /// It has too many points.
    pub(super) fn around(lo: DVec3, hi: DVec3, edge: f64) -> Result<Lattice, StuffingError> {
        let span = hi - lo;
        let points_of = |edge: f64| 2.0 * (span / fitted(span, edge) + 3.0).element_product();
        let (points, least) = (points_of(edge), span.min_element());
        if points.is_nan() || points > MOST_POINTS {
            // Half a cube fewer than the most that fit through the shortest side, so that the number may be rounded.
            let fits = (1..=MOST_THROUGH).rev().map(|k| least / (f64::from(k) - 0.5)).find(|e| points_of(*e) <= MOST_POINTS);
            return Err(match fits {
                Some(suggestion) => StuffingError::TooFine { edge, points, suggestion },
                None => StuffingError::TooThin { least, points: points_of(least) },
            });
        }
        let edge = fitted(span, edge);
        let cubes = (span / edge - 1e-9).ceil().max(DVec3::ONE);
        Ok(Lattice { origin: lo - edge, half: 0.5 * edge, size: cubes.as_ivec3() + 3 })
    }

    /// Number of corners.
    pub(super) fn corners(&self) -> usize {
        self.size.x as usize * self.size.y as usize * self.size.z as usize
    }

    /// Number of points.
    pub(super) fn points(&self) -> usize {
        let c = self.size - 1;
        self.corners() + c.x as usize * c.y as usize * c.z as usize
    }

    /// Number of a point, where the lattice has it.
    pub(super) fn number(&self, p: IVec3) -> Option<u32> {
        let odd = p.x & 1;
        let (q, size) = (p >> 1i32, self.size - odd);
        let inside = q.cmpge(IVec3::ZERO).all() && q.cmplt(size).all();
        let n = || q.x as usize + size.x as usize * (q.y as usize + size.y as usize * q.z as usize);
        inside.then(|| (n() + if odd == 1 { self.corners() } else { 0 }) as u32)
    }

    /// Coordinates of a point.
    pub(super) fn coordinates(&self, number: u32) -> IVec3 {
        let (n, odd) = match (number as usize).checked_sub(self.corners()) {
            Some(n) => (n, 1),
            None => (number as usize, 0),
        };
        let (x, y) = ((self.size.x - odd) as usize, (self.size.y - odd) as usize);
        2 * IVec3::new((n % x) as i32, (n / x % y) as i32, (n / (x * y)) as i32) + odd
    }

    /// Place of a point [m].
    pub(super) fn place(&self, p: IVec3) -> DVec3 {
        self.origin + self.half * p.as_dvec3()
    }

    /// Ways from a point to its neighbours: six long edges, then eight short ones.
    pub(super) fn ways() -> impl Iterator<Item = (IVec3, usize)> {
        let long = IVec3::AXES.into_iter().flat_map(|a| [(2 * a, 0), (-2 * a, 0)]);
        let short = (0..8).map(|k| (IVec3::new((k & 1) * 2 - 1, (k >> 1 & 1) * 2 - 1, (k >> 2) * 2 - 1), 1));
        long.chain(short)
    }
}
