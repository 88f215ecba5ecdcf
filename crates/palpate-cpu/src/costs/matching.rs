//! Which place of the deformed body an observed point is: sparse surface inversion on a spatial hash of each frame's points.
//!
//! The points of a frame never move, so they are hashed once; each deformed cell asks for the points in its bounding box. A frame
//! costs points + band cells, not points × cells: a point meets the few cells whose boxes hold it, however many there are.

use crate::terms::elastic_cells::Corners;
use glam::DVec3;
use palpate_model::cutcells::band_lookup::BandLookup;
use palpate_model::cutcells::front::Sight;
use palpate_model::cutcells::grid::shape_functions;
use palpate_model::cutcells::pullback::{NOISE_REACH, Pullback, TURNED_AWAY, pull_back};
use palpate_model::observation::{Camera, ObservedPoint};
use palpate_model::space::body::Body;
use rayon::prelude::*;

/// Points sorted by the hash of the cube they lie in.
#[derive(Clone, Debug, Default)]
pub struct PointHash {
    edge: f64,
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl PointHash {
    /// Hashes points into cubes of an edge [m].
    pub fn new(points: &[ObservedPoint], edge: f64) -> PointHash {
        let slots = points.len().next_power_of_two().max(16);
        let mut hash = PointHash { edge, starts: vec![0; slots + 1], order: vec![0; points.len()] };
        let slot: Vec<usize> = points.iter().map(|p| hash.slot((p.position / edge).floor().as_i64vec3().to_array())).collect();
        for &s in &slot {
            hash.starts[s + 1] += 1;
        }
        for s in 0..slots {
            hash.starts[s + 1] += hash.starts[s];
        }
        let mut next = hash.starts.clone();
        for (p, &s) in slot.iter().enumerate() {
            hash.order[next[s] as usize] = p as u32;
            next[s] += 1;
        }
        hash
    }

    fn slot(&self, cube: [i64; 3]) -> usize {
        let mixed = cube[0].wrapping_mul(73_856_093) ^ cube[1].wrapping_mul(19_349_663) ^ cube[2].wrapping_mul(83_492_791);
        mixed as usize & (self.starts.len() - 2)
    }

    /// Calls `found` with every point that may lie in a box (and perhaps some that do not, or one twice).
    fn visit(&self, min: DVec3, max: DVec3, mut found: impl FnMut(u32)) {
        let lo = (min / self.edge).floor().as_i64vec3();
        let hi = (max / self.edge).floor().as_i64vec3();
        let span = (hi - lo + 1).as_dvec3();
        if span.x * span.y * span.z > self.starts.len() as f64 {
            // A cell blown up beyond all measure: look at every point once instead of at every empty cube.
            self.order.iter().for_each(|&p| found(p));
            return;
        }
        for z in lo.z..=hi.z {
            for y in lo.y..=hi.y {
                for x in lo.x..=hi.x {
                    let s = self.slot([x, y, z]);
                    self.order[self.starts[s] as usize..self.starts[s + 1] as usize].iter().for_each(|&p| found(p));
                }
            }
        }
    }
}

/// An observed point's place in the band.
#[derive(Clone, Copy, Debug)]
pub struct Match {
    /// Number of the observed point.
    pub point: u32,
    /// Number of the band cell.
    pub cell: u32,
    /// Place, distance and gradient.
    pub place: Pullback,
}

impl Match {
    /// Extended nodes and shape functions of the place.
    pub fn stencil<'a>(&self, body: &'a Body) -> (&'a [u32; 8], [f64; 8]) {
        (&body.band.cells[self.cell as usize].nodes, shape_functions(self.place.xi))
    }
}

/// Displacements of all extended nodes `[N + M]`: those of the body, then those extended to the band.
pub fn extend(body: &Body, u: &[DVec3]) -> Vec<DVec3> {
    let band = &body.band;
    let mut all = Vec::with_capacity(u.len() + band.nodes.len());
    all.extend_from_slice(u);
    all.par_extend((0..band.nodes.len()).into_par_iter().with_min_len(1024).map(|p| {
        let row = band.rows[p] as usize..band.rows[p + 1] as usize;
        let mut sum = DVec3::ZERO;
        for (c, v) in band.columns[row.clone()].iter().zip(&band.values[row]) {
            sum += *v * u[*c as usize];
        }
        sum
    }));
    all
}

/// Transpose of [`extend`]: folds a gradient on the extended nodes back onto the body.
pub fn extend_transposed(body: &Body, extended: &[DVec3]) -> Vec<DVec3> {
    let n = body.nodes.len();
    let band = &body.band;
    let mut out = extended[..n].to_vec();
    for p in 0..band.nodes.len() {
        let g = extended[n + p];
        if g != DVec3::ZERO {
            for k in band.rows[p] as usize..band.rows[p + 1] as usize {
                out[band.columns[k] as usize] += band.values[k] * g;
            }
        }
    }
    out
}

/// Points of a frame.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// The points, as a member's measurement effects understand them.
    pub points: &'a [ObservedPoint],
    /// The cameras, likewise.
    pub cameras: &'a [Camera],
    /// Both as the recording has them: lines of sight along which a front is looked for do not depend on any parameter.
    pub recorded: (&'a [ObservedPoint], &'a [Camera]),
}

/// Matches a frame's points with the deformed band (extended displacements `u`). Of all cells that hold a point, those whose
/// surface faces its camera come first (all do without a line of sight); then the smallest |φ| wins, then the lowest cell number. A point nearest to a hidden side keeps
/// it where a visible one is near (`noise` [m] of a reading), and belongs to the front otherwise, up to the `band` [m]. Ordered by point.
pub fn match_points(
    body: &Body,
    u: &[DVec3],
    hash: &PointHash,
    seen: Seen,
    lookup: &BandLookup,
    (band, noise): (f64, f64),
) -> Vec<Match> {
    let n = body.nodes.len();
    let rest = |a: u32| if (a as usize) < n { body.nodes[a as usize] } else { body.band.nodes[a as usize - n] };
    let corners = |nodes: &[u32; 8]| -> Corners { nodes.map(|a| rest(a) + u[a as usize]) };
    let line = |(points, cameras): (&[ObservedPoint], &[Camera]), p: u32| {
        let seen = &points[p as usize];
        cameras[seen.camera as usize].line(seen.position)
    };
    let moved = (seen.points, seen.cameras);
    let candidates: Vec<Vec<(bool, Match)>> = body
        .band
        .cells
        .par_iter()
        .with_min_len(256)
        .enumerate()
        .map(|(c, cell)| {
            let x = corners(&cell.nodes);
            let min = x.iter().copied().fold(x[0], DVec3::min);
            let max = x.iter().copied().fold(x[0], DVec3::max);
            let mut found = Vec::new();
            hash.visit(min, max, |p| {
                let point = seen.points[p as usize].position;
                if point.cmplt(min).any() || point.cmpgt(max).any() {
                    return;
                }
                if let Some(place) = pull_back(&x, &cell.sdf, point) {
                    let faces = place.gradient.dot(line(moved, p)) <= TURNED_AWAY * place.gradient.length();
                    found.push((faces, Match { point: p, cell: c as u32, place }));
                }
            });
            found
        })
        .collect();
    let mut best: Vec<Option<(bool, Match)>> = vec![None; seen.points.len()];
    for (faces, m) in candidates.into_iter().flatten() {
        let slot = &mut best[m.point as usize];
        if slot.is_none_or(|(f, b)| (faces && !f) || (faces == f && m.place.phi.abs() < b.place.phi.abs())) {
            *slot = Some((faces, m));
        }
    }
    let side = |best: Option<(bool, Match)>| {
        let (faces, m) = best?;
        if faces {
            return Some(m);
        }
        let cell = &body.band.cells[m.cell as usize];
        let grid = &body.band.grid;
        let (x, lowest) = (corners(&cell.nodes), grid.position(cell.lattice));
        let distance = |xi: DVec3| lookup.distance(&body.band, lowest + grid.h * xi);
        let way = 1.5 * m.place.phi.abs() + NOISE_REACH * noise;
        let sight = Sight { x: &x, point: seen.points[m.point as usize].position, direction: line(seen.recorded, m.point) };
        let place = sight.side(m.place, way, (grid.h, band), distance)?;
        Some(Match { place, ..m })
    };
    best.into_par_iter().with_min_len(1024).filter_map(side).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_model::cutcells::build::SUBDIVISIONS;
    use palpate_model::scene::Analytic;
    use palpate_model::shape::Placed;

    /// Cells of the band, and how many points they are handed and how many lie in their boxes, over the number of points.
    fn asked(h: f64, band: f64) -> (usize, f64, f64) {
        let shape = Placed::new(Analytic::Ball { radius: 0.1, center: DVec3::new(1e-3, 2e-3, 3e-3) }, glam::DAffine3::IDENTITY);
        let body = Body::build(&shape, h, band * h, SUBDIVISIONS).unwrap();
        // Two thousand places spread evenly over the ball (golden angle).
        let place = |k: usize| {
            let (z, turn) = (1.0 - (k as f64 + 0.5) / 1000.0, 2.399_963 * k as f64);
            DVec3::new(1e-3, 2e-3, 3e-3)
                + 0.1 * DVec3::new((1.0 - z * z).sqrt() * turn.cos(), (1.0 - z * z).sqrt() * turn.sin(), z)
        };
        let points: Vec<ObservedPoint> = (0..2000).map(|k| ObservedPoint { position: place(k), camera: 0 }).collect();
        let hash = PointHash::new(&points, h);
        let n = body.nodes.len();
        let rest = |a: u32| if (a as usize) < n { body.nodes[a as usize] } else { body.band.nodes[a as usize - n] };
        let (mut handed, mut held) = (0usize, 0usize);
        for cell in &body.band.cells {
            let x = cell.nodes.map(rest);
            let (min, max) = (x.into_iter().fold(x[0], DVec3::min), x.into_iter().fold(x[0], DVec3::max));
            hash.visit(min, max, |p| {
                handed += 1;
                let at = points[p as usize].position;
                held += usize::from(at.cmpge(min).all() && at.cmple(max).all());
            });
        }
        (body.band.cells.len(), handed as f64 / 2000.0, held as f64 / 2000.0)
    }

    #[test]
    fn a_point_is_asked_for_by_as_many_cells_however_many_there_are() {
        let sizes: Vec<_> = [0.03, 0.015, 0.0075].iter().map(|&h| asked(h, 4.0)).collect();
        println!("cells of the band, points handed and held per point: {sizes:?}");
        assert!(sizes[2].0 > 6 * sizes[0].0, "many more cells: {sizes:?}");
        for (cells, handed, held) in &sizes {
            // What is inverted by Newton's method: the one cell of the rest shape that holds a point, two on a face between them.
            assert!((held - 1.0).abs() < 0.01, "{sizes:?}");
            // What is only compared with a box: the cubes that a cell looks into, empty or not, share slots with others.
            assert!(handed * 2000.0 < 12.0 * (2000 + cells) as f64, "points + cells, not points × cells: {sizes:?}");
        }
    }
}
