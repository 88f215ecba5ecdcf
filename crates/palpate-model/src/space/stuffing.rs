//! Tetrahedra that fill a shape: isosurface stuffing (Labelle & Shewchuk, ACM Trans. Graph. 26(3), 57, 2007).
//!
//! A body-centred cubic lattice covers the shape; every tetrahedron of it has two long edges (the lattice's edge) and four short ones (√3/2 of
//! it). Where the surface crosses an edge close to a vertex, the vertex is moved there; other crossings cut tetrahedra into one to three. With
//! the fractions of edges below, the authors give dihedral angles between 10.7° and 164.8° for any surface; on one that the lattice resolves
//! they are above 18°. Edges and corners of a shape that the lattice does not meet are rounded, which takes volume:
//! [`TetMesh::keep_volume`] gives it back.

mod lattice;

pub(crate) use lattice::fitted;

use crate::shape::Shape;
use crate::space::points::TetMesh;
use glam::{DVec3, IVec3};
use lattice::{Lattice, MOST_POINTS};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};

/// Fractions of a long and of a short edge within which a vertex is moved to the surface.
const WARP: [f64; 2] = [0.24999, 0.41189];
/// Steps of a search along an edge: each takes a digit at least, and four are enough for a mesh.
const SEARCH: usize = 8;

/// Why a shape cannot be filled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StuffingError {
    /// The lattice would be huge.
    #[error(
        "{edge} m gives a lattice of {points:.1e} points, at most {MOST_POINTS:e} are allowed; use {suggestion:.2e} m or more"
    )]
    TooFine {
        /// Edge of the lattice [m].
        edge: f64,
        /// Points of the lattice.
        points: f64,
        /// An edge that fits [m].
        suggestion: f64,
    },
    /// Cubes through the shortest side are many along the others.
    #[error(
        "tetrahedra are at most as long as the body is thin, {least} m: a lattice of {points:.1e} points, at most {MOST_POINTS:e} are allowed; \
         use discretisation = \"cells\", or a volume_mesh"
    )]
    TooThin {
        /// The shortest side [m].
        least: f64,
        /// Points of the coarsest lattice.
        points: f64,
    },
    /// No point of the lattice lies inside.
    #[error("{edge} m is too large: no tetrahedron fits into the body; use {suggestion:.2e} m or less")]
    TooCoarse {
        /// Edge of the lattice [m].
        edge: f64,
        /// A quarter of the box's shortest side [m].
        suggestion: f64,
    },
    /// Thin parts fall off.
    #[error(
        "{edge} m is too large: parts with {:.2} % of the volume hang together with the rest by no face; use a smaller one, so that thin \
         parts are met",
        100.0 * lost
    )]
    Torn {
        /// Edge of the lattice [m].
        edge: f64,
        /// Share of the volume that is not in the largest part.
        lost: f64,
    },
}

/// Share of the volume that may fall off in crumbs.
const CRUMBS: f64 = 0.002;

/// Signs of points and places where the surface crosses edges.
struct Surface<'a> {
    lattice: &'a Lattice,
    /// 1 inside, −1 outside, 0 on the surface, of every point.
    sign: Vec<i8>,
    /// Share of the way from the first (lower) to the second point of an edge where it is crossed.
    cuts: HashMap<(u32, u32), f64>,
    /// Where points were moved to.
    moved: HashMap<u32, DVec3>,
}

impl Surface<'_> {
    fn find<'a>(lattice: &'a Lattice, shape: &dyn Shape) -> Surface<'a> {
        let depth = |x: DVec3| -shape.signed_distance(x);
        let depths: Vec<f64> =
            (0..lattice.points() as u32).into_par_iter().map(|n| depth(lattice.place(lattice.coordinates(n)))).collect();
        let sign: Vec<i8> = depths
            .iter()
            .map(|d| {
                if *d > 0.0 {
                    1
                } else if *d < 0.0 {
                    -1
                } else {
                    0
                }
            })
            .collect();
        let crossed: Vec<((u32, u32), f64)> = (0..sign.len() as u32)
            .into_par_iter()
            .flat_map_iter(|n| {
                let (p, sign, depths) = (lattice.coordinates(n), &sign, &depths);
                Lattice::ways().filter_map(move |(way, _)| {
                    let m = lattice.number(p + way).filter(|m| n < *m)?;
                    (sign[n as usize] * sign[m as usize] < 0).then(|| {
                        let (a, b) = (lattice.place(p), lattice.place(p + way));
                        let at = crossing(|t| depth(a.lerp(b, t)), depths[n as usize], depths[m as usize]);
                        ((n, m), at)
                    })
                })
            })
            .collect();
        Surface { lattice, sign, cuts: crossed.into_iter().collect(), moved: HashMap::new() }
    }

    /// Where the edge from one point to another is crossed, as a share of the way.
    fn cut(&self, from: u32, to: u32) -> Option<f64> {
        match from < to {
            true => self.cuts.get(&(from, to)).copied(),
            false => self.cuts.get(&(to, from)).map(|t| 1.0 - t),
        }
    }

    /// Moves points that the surface passes close by onto it, one after another: crossings of their edges are gone with the first.
    fn warp(&mut self) {
        for n in 0..self.sign.len() as u32 {
            let own = self.sign[n as usize];
            if own == 0 {
                continue;
            }
            let p = self.lattice.coordinates(n);
            let near = Lattice::ways().filter_map(|(way, kind)| {
                let m = self.lattice.number(p + way).filter(|m| self.sign[*m as usize] * own < 0)?;
                let share = self.cut(n, m).filter(|s| *s < WARP[kind])?;
                Some(share * self.lattice.half * way.as_dvec3())
            });
            let nearest = near.min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
            if let Some(step) = nearest {
                self.moved.insert(n, self.lattice.place(p) + step);
                self.sign[n as usize] = 0;
            }
        }
    }
}

/// Where a function with these values at 0 and 1, of opposite signs, is zero (regula falsi, Illinois variant).
fn crossing(f: impl Fn(f64) -> f64, at_0: f64, at_1: f64) -> f64 {
    let ((mut a, mut fa), (mut b, mut fb)) = ((0.0, at_0), (1.0, at_1));
    let mut t = a - fa * (b - a) / (fb - fa);
    for _ in 0..SEARCH {
        let ft = f(t);
        if ft * fb < 0.0 {
            (a, fa) = (b, fb);
        } else {
            fa *= 0.5;
        }
        (b, fb) = (t, ft);
        if fb == 0.0 {
            break;
        }
        t = a - fa * (b - a) / (fb - fa);
    }
    t.clamp(0.0, 1.0)
}

/// A node of the mesh: a point of the lattice, or where an edge is crossed.
type Node = (u32, u32);

/// Nodes and tetrahedra in the order in which they are found.
struct Filling<'a, 'b> {
    surface: &'a Surface<'b>,
    number: HashMap<Node, u32>,
    mesh: TetMesh,
}

impl Filling<'_, '_> {
    fn point(&mut self, n: u32) -> u32 {
        self.node((n, n))
    }

    /// The node between a point inside and one outside.
    fn between(&mut self, a: u32, b: u32) -> u32 {
        self.node((a.min(b), a.max(b)))
    }

    fn node(&mut self, node: Node) -> u32 {
        let (surface, mesh) = (self.surface, &mut self.mesh);
        let lattice = surface.lattice;
        *self.number.entry(node).or_insert_with(|| {
            let at = |n: u32| lattice.place(lattice.coordinates(n));
            let (a, b) = node;
            let place = match a == b {
                true => surface.moved.get(&a).copied().unwrap_or_else(|| at(a)),
                false => at(a).lerp(at(b), surface.cut(a, b).unwrap_or(0.5)),
            };
            mesh.nodes.push(place);
            mesh.nodes.len() as u32 - 1
        })
    }

    fn push(&mut self, t: [u32; 4]) {
        let turned = self.mesh.nodes_turn(t);
        self.mesh.tets.push(if turned { [t[0], t[1], t[3], t[2]] } else { t });
    }

    /// Where the diagonal of a cut face begins: of inside points a and b and an outside one m, whose triangle has one long edge.
    fn begins_at(&self, a: u32, b: u32, m: u32) -> u32 {
        let at = |n: u32| self.surface.lattice.coordinates(n);
        let long = |p: u32, q: u32| (at(p).x ^ at(q).x) & 1 == 0;
        if long(a, b) {
            // Both crossed edges are short: neighbours must choose alike, so one of two classes of points is preferred.
            let even = |n: u32| (at(n) >> 1i32).element_sum() & 1 == 0;
            if even(a) { a } else { b }
        } else if long(a, m) {
            b
        } else {
            a
        }
    }

    /// Fills the inside part of a tetrahedron of the lattice.
    fn fill(&mut self, v: [u32; 4]) {
        let of = |s: i8| v.iter().copied().filter(|n| self.surface.sign[*n as usize] == s).collect::<Vec<u32>>();
        let (inside, outside, on) = (of(1), of(-1), of(0));
        match (&inside[..], &outside[..], &on[..]) {
            ([], ..) => {}
            (_, [], _) => {
                let t = v.map(|n| self.point(n));
                self.push(t);
            }
            (&[p], ..) => {
                let t = v.map(|n| if outside.contains(&n) { self.between(p, n) } else { self.point(n) });
                self.push(t);
            }
            (&[p, q], &[m], &[z]) => {
                let first = self.begins_at(p, q, m);
                let (first, other) = if first == p { (p, q) } else { (q, p) };
                let [a, b, z] = [first, other, z].map(|n| self.point(n));
                let (ca, cb) = (self.between(first, m), self.between(other, m));
                self.push([a, b, cb, z]);
                self.push([a, cb, ca, z]);
            }
            (&[p, q], &[m, n], _) => {
                let (top, bottom) = (
                    [self.point(p), self.between(p, m), self.between(p, n)],
                    [self.point(q), self.between(q, m), self.between(q, n)],
                );
                let one = self.begins_at(p, q, m) == p;
                let two = self.begins_at(p, q, n) == q;
                // The quadrilateral on the surface is this tetrahedron's alone: its shorter diagonal, unless that turns around the prism.
                let x = |n: u32| self.mesh.nodes[n as usize];
                let shorter = (x(top[1]) - x(bottom[2])).length() <= (x(top[2]) - x(bottom[1])).length();
                let free = if one == two { !one } else { shorter };
                self.prism(top, bottom, [one, free, two]);
            }
            (&[p, q, r], &[m], _) => {
                let (top, bottom) = ([p, q, r].map(|n| self.point(n)), [p, q, r].map(|n| self.between(n, m)));
                let starts = [(p, q), (q, r), (r, p)].map(|(a, b)| self.begins_at(a, b, m) == a);
                self.prism(top, bottom, starts);
            }
            _ => {}
        }
    }

    /// Three tetrahedra of a prism; `starts[i]` says that the diagonal of the side between corners i and i + 1 begins at top i, and else at
    /// top i + 1. They never all turn the same way.
    fn prism(&mut self, top: [u32; 3], bottom: [u32; 3], starts: [bool; 3]) {
        debug_assert!(!(starts[0] == starts[1] && starts[1] == starts[2]));
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            // Both diagonals beside corner i begin at its top, or both end at its bottom.
            let both = match (starts[i], starts[k]) {
                (true, false) => Some((top, bottom)),
                (false, true) => Some((bottom, top)),
                _ => None,
            };
            let Some((a, b)) = both else { continue };
            self.push([a[i], b[0], b[1], b[2]]);
            // The diagonal of the side opposite.
            let from_top = starts[j];
            let near_is_top = a == top;
            if from_top == near_is_top {
                self.push([a[i], a[j], a[k], b[k]]);
                self.push([a[i], a[j], b[k], b[j]]);
            } else {
                self.push([a[i], a[j], a[k], b[j]]);
                self.push([a[i], a[k], b[k], b[j]]);
            }
            return;
        }
    }
}

impl TetMesh {
    /// True where the fourth node lies on the side from which the first three turn clockwise.
    fn nodes_turn(&self, t: [u32; 4]) -> bool {
        self.six_volumes(t) < 0.0
    }

    /// Parts that hang together by faces: the number of every tetrahedron's part.
    fn parts_by_faces(&self) -> Vec<usize> {
        let mut beside: BTreeMap<[u32; 3], Vec<usize>> = BTreeMap::new();
        for (e, t) in self.tets.iter().enumerate() {
            for f in TetMesh::FACES {
                let mut face = f.map(|i| t[i]);
                face.sort_unstable();
                beside.entry(face).or_default().push(e);
            }
        }
        let mut part = vec![usize::MAX; self.tets.len()];
        let mut parts = 0;
        for e in 0..part.len() {
            if part[e] != usize::MAX {
                continue;
            }
            let mut open = vec![e];
            part[e] = parts;
            while let Some(e) = open.pop() {
                for f in TetMesh::FACES {
                    let mut face = f.map(|i| self.tets[e][i]);
                    face.sort_unstable();
                    for other in &beside[&face] {
                        if part[*other] == usize::MAX {
                            part[*other] = parts;
                            open.push(*other);
                        }
                    }
                }
            }
            parts += 1;
        }
        part
    }
}

/// Fills a shape with tetrahedra whose longest edges are about `edge` [m]. Same input, same bits, whatever the number of threads.
///
/// # Errors
/// The lattice is too fine to be held, or too coarse for the shape's thin parts.
pub fn stuff(shape: &dyn Shape, edge: f64) -> Result<TetMesh, StuffingError> {
    let (lo, hi) = shape.bounds();
    let span = hi - lo;
    let lattice = Lattice::around(lo, hi, edge)?;
    let mut surface = Surface::find(&lattice, shape);
    surface.warp();
    let mut filling = Filling { surface: &surface, number: HashMap::new(), mesh: TetMesh::default() };
    let inner = lattice.size - 1;
    for n in 0..inner.x * inner.y * inner.z {
        let c = 2 * IVec3::new(n % inner.x, n / inner.x % inner.y, n / (inner.x * inner.y)) + 1;
        for d in 0..3 {
            let [d, u, w] = [0, 1, 2].map(|k| IVec3::AXES[(d + k) % 3]);
            let ring = [-u - w, u - w, u + w, w - u].map(|r| lattice.number(c + d + r));
            let ends = [lattice.number(c), lattice.number(c + 2 * d)];
            for k in 0..4 {
                if let (Some(a), Some(b), Some(p), Some(q)) = (ends[0], ends[1], ring[k], ring[(k + 1) % 4]) {
                    filling.fill([a, b, p, q]);
                }
            }
        }
    }
    whole(filling.mesh, edge, span)
}

/// The largest part of a mesh, where the others are crumbs.
fn whole(mut mesh: TetMesh, edge: f64, span: DVec3) -> Result<TetMesh, StuffingError> {
    if mesh.tets.is_empty() {
        return Err(StuffingError::TooCoarse { edge, suggestion: 0.25 * span.min_element() });
    }
    let part = mesh.parts_by_faces();
    let mut volumes = vec![0.0; part.iter().max().map_or(0, |m| m + 1)];
    mesh.tets.iter().zip(&part).for_each(|(t, p)| volumes[*p] += mesh.six_volumes(*t));
    let all: f64 = volumes.iter().sum();
    let largest = (0..volumes.len()).fold(0, |m, k| if volumes[k] > volumes[m] { k } else { m });
    let lost = 1.0 - volumes[largest] / all;
    if lost > CRUMBS {
        return Err(StuffingError::Torn { edge, lost });
    }
    let kept = mesh.tets.iter().zip(&part).filter(|(_, p)| **p == largest).map(|(t, _)| *t).collect();
    mesh.tets = kept;
    Ok(mesh.without_orphans())
}

#[cfg(test)]
#[path = "stuffing_tests.rs"]
mod tests;
