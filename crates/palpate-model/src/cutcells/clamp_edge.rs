//! What a clamp holds when its edges move: moments of its box, grown along the body by a shift, as a function of the shift.
//!
//! The integrals are those of the plan itself ([`crate::cutcells::cut`]), exact for the body's piecewise flat surface. So each is a piecewise cubic of
//! the shift, smooth but where a face of the box passes a face of the lattice, and there the sum over cells is smooth.

use crate::cutcells::build::world_cell;
use crate::cutcells::cut::{ClipBox, HeldMoments, Lattice, Pieces};
use crate::cutcells::held::Pins;
use crate::plan::ClampCell;
use crate::shape::Shape;
use crate::space::body::Body;
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

/// Difference in shift that derivatives are taken over, in cells: cubics leave 1e-10 of their size, rounding as much.
const STEP: f64 = 1e-5;
/// A face of the box cuts through the body if the body goes on beyond it for more than this, in cells.
const BEYOND: f64 = 0.5;

/// The edges of one clamp. What it finds out about the body it keeps; a plan of which no edge moves never asks.
#[derive(Clone)]
pub struct Edge {
    shape: Arc<dyn Shape>,
    subdivisions: usize,
    region: ClipBox,
    /// Cells merged into neighbours, as in the body's parts.
    merged: Vec<([usize; 3], u32)>,
    moving: OnceLock<[bool; 6]>,
    sources: OnceLock<Vec<Source>>,
}

/// A lattice cell and the cell of the body that its integrals belong to.
#[derive(Clone)]
struct Source {
    cell: u32,
    from: [i64; 3],
    basis: [i64; 3],
    middle: DVec3,
    /// No other source belongs to the same cell.
    alone: bool,
    pieces: OnceLock<Pieces>,
}

/// One cell of the held region.
#[derive(Clone, Debug)]
pub struct Held {
    /// What is held.
    pub now: ClampCell,
    /// The same with the edge a step and two steps further out, and the step [m]; `None` away from the edge.
    pub near: Option<(Box<[ClampCell; 2]>, f64)>,
}

/// Derivative of second order from a value and those one and two steps further. It never looks back: there a face of the body may
/// drop out of the box at once.
pub fn slope(now: f64, next: f64, second: f64, step: f64) -> f64 {
    (4.0 * next - 3.0 * now - second) / (2.0 * step)
}

/// Sets the pins of what is held, now and with the edge further out.
fn pin(body: &Body, held: &mut [Held], step: f64) {
    fn at(h: &Held, i: usize) -> &ClampCell {
        match (&h.near, i) {
            (Some((further, _)), 1..) => &further[i - 1],
            _ => &h.now,
        }
    }
    let pins = [0, 1, 2].map(|i| Pins::new(body, held.iter().map(|h| at(h, i))));
    for h in held.iter_mut() {
        let [now, next, second] = [0, 1, 2].map(|i| pins[i].of(body, h.now.cell));
        h.now.pins = now;
        // Pins change in cells, too, that only neighbour one that the edge is near to.
        if h.near.is_none() && (next != now || second != now) {
            h.near = Some((Box::new([h.now.clone(), h.now.clone()]), step));
        }
        if let Some((further, _)) = &mut h.near {
            (further[0].pins, further[1].pins) = (next, second);
        }
    }
}

impl Edge {
    /// The edges of a box.
    pub(crate) fn new(shape: Arc<dyn Shape>, subdivisions: usize, region: ClipBox, merged: Vec<([usize; 3], u32)>) -> Edge {
        Edge { shape, subdivisions, region, merged, moving: OnceLock::new(), sources: OnceLock::new() }
    }

    /// The cells held when the edge is moved by `shift` [m], in increasing order; `own` are those held at 0.
    pub fn cells(&self, body: &Body, own: &[ClampCell], shift: f64) -> Vec<Held> {
        let h = body.cut().grid.h;
        let step = STEP * h;
        // Half a cell's diagonal, with a little slack for rounding: beyond it a face cannot reach the cell.
        let radius = 0.5 * 3f64.sqrt() * h * 1.01;
        let regions = [shift, shift + step, shift + 2.0 * step].map(|s| self.grown(h, s));
        let stated = |cell: u32| ClampCell::find(own, cell);
        let one = |source: &Source| {
            if regions[2].misses(source.middle, radius) {
                return None;
            }
            let near = self.near(h, source.middle, shift, radius);
            if source.alone && !near && !self.near(h, source.middle, 0.0, radius) && stated(source.cell).is_some() {
                return Some((source.cell, None));
            }
            let pieces = source.pieces.get_or_init(|| self.pieces(h, source));
            let moments = |region: &ClipBox| pieces.held(h, source.from, source.basis, region);
            let now = moments(&regions[0]);
            let [next, second] = if near { [1, 2].map(|i| moments(&regions[i])) } else { [now.clone(), now.clone()] };
            Some((source.cell, Some(([now, next, second], near))))
        };
        let found: Vec<_> = self.sources(body).par_iter().filter_map(one).collect();
        // A cell with a neighbour's sliver has two sources. Cells that no face is near to keep what the plan says.
        let mut all: BTreeMap<u32, Option<([HeldMoments; 3], bool)>> = BTreeMap::new();
        for (cell, moments) in found {
            match (all.entry(cell).or_insert(None), moments) {
                (Some((sum, near)), Some((m, n))) => {
                    sum.iter_mut().zip(&m).for_each(|(s, m)| *s += m);
                    *near |= n;
                }
                (empty, moments) => *empty = moments.or(empty.take()),
            }
        }
        let finish = |(cell, moments): (u32, Option<([HeldMoments; 3], bool)>)| {
            let Some(([now, next, second], near)) = moments else {
                return stated(cell).map(|c| Held { now: c.clone(), near: None });
            };
            let make = |m: HeldMoments| ClampCell::new(body, cell, &m);
            // An edge that does not move leaves everything as the plan says, to the last bit.
            let unmoved = || stated(cell).cloned().unwrap_or_else(|| make(HeldMoments::default()));
            let now = if shift == 0.0 { unmoved() } else { make(now) };
            let near = near.then(|| (Box::new([make(next), make(second)]), step));
            Some(Held { now, near })
        };
        let mut held: Vec<Held> = all.into_iter().filter_map(finish).collect();
        pin(body, &mut held, step);
        held
    }

    /// The box with its moving faces shifted outwards.
    fn grown(&self, h: f64, shift: f64) -> ClipBox {
        let moving = self.moving(h);
        let by = |f: usize| if moving[f] { shift } else { 0.0 };
        ClipBox {
            min: self.region.min - DVec3::new(by(0), by(1), by(2)),
            max: self.region.max + DVec3::new(by(3), by(4), by(5)),
            ..self.region
        }
    }

    /// True if a moving face may pass within `radius` of a point.
    fn near(&self, h: f64, p: DVec3, shift: f64, radius: f64) -> bool {
        let moving = self.moving(h);
        self.region.distances(p).iter().zip(moving).any(|(d, m)| *m && (d - shift).abs() <= radius)
    }

    /// Which faces of the box cut through the body: those beyond which it goes on.
    fn moving(&self, h: f64) -> &[bool; 6] {
        self.moving.get_or_init(|| {
            let to_world = self.region.to_frame.inverse();
            let (low, high) = self.shape.bounds();
            let corners: [DVec3; 8] = std::array::from_fn(|i| {
                let at = |a: usize| if i >> a & 1 == 0 { low[a] } else { high[a] };
                self.region.to_frame.transform_point3(DVec3::new(at(0), at(1), at(2)))
            });
            let bounds = corners.into_iter().fold((corners[0], corners[0]), |(a, b), c| (a.min(c), b.max(c)));
            let (from, to) = (self.region.min.max(bounds.0), self.region.max.min(bounds.1));
            std::array::from_fn(|face| {
                let axis = face % 3;
                let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
                let beyond = BEYOND * h;
                let place = if face < 3 { self.region.min[axis] - beyond } else { self.region.max[axis] + beyond };
                let inside = place > bounds.0[axis] && place < bounds.1[axis];
                if !inside || from[b] > to[b] || from[c] > to[c] {
                    return false;
                }
                // Points every half cell, at most 200 a side.
                let count = |a: usize| ((to[a] - from[a]) / (0.5 * h)).ceil().clamp(1.0, 200.0) as usize;
                let (m, n) = (count(b), count(c));
                (0..m * n).any(|i| {
                    let mut p = DVec3::splat(place);
                    p[b] = from[b] + (to[b] - from[b]) * ((i % m) as f64 + 0.5) / m as f64;
                    p[c] = from[c] + (to[c] - from[c]) * ((i / m) as f64 + 0.5) / n as f64;
                    self.shape.signed_distance(to_world.transform_point3(p)) < 0.0
                })
            })
        })
    }

    fn sources(&self, body: &Body) -> &[Source] {
        self.sources.get_or_init(|| {
            let source = |from: [usize; 3], cell: u32| Source {
                cell,
                from: world_cell(&body.cut().grid, from),
                basis: world_cell(&body.cut().grid, body.cells()[cell as usize].lattice),
                middle: body.cut().grid.position(from) + 0.5 * body.cut().grid.h,
                alone: !self.merged.iter().any(|m| m.1 == cell),
                pieces: OnceLock::new(),
            };
            let cells = body.cells().iter().enumerate().map(|(n, c)| source(c.lattice, n as u32));
            cells.chain(self.merged.iter().map(|(from, to)| source(*from, *to))).collect()
        })
    }

    fn pieces(&self, h: f64, source: &Source) -> Pieces {
        let distance = |p: DVec3| self.shape.signed_distance(p);
        let lattice = Lattice { distance: &distance, h, subdivisions: self.subdivisions };
        // Only cells away from the surface take the short way: a full one may still have surface on its faces.
        let deep = distance(source.middle) < -0.5 * 3f64.sqrt() * h * 1.01;
        Pieces::of(&lattice, source.from, deep)
    }
}
