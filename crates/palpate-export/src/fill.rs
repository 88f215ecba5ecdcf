//! From a shape to the tetrahedra that other programs get.
//!
//! palpate's own cells are cut by the surface, and no other program has such elements. So the shape is filled by isosurface stuffing, which
//! bounds angles and keeps the volume ([`palpate_model::space::stuffing`]). Before it each axis is stretched piece by piece, so that the sides of
//! the box around the body, and faces of clamps, are planes of the lattice: a block keeps its edges and its exact section, and a clamp holds
//! whole planes of nodes. What clamps hold stays in the mesh, held node by node. Were it cut off, the edge between the cut and the surface would be
//! rounded, and just the outermost fibres, which bear bending, would not be held: a round bar of four cells then sags an eighth too far.

use glam::{DAffine3, DVec3};
use palpate_model::cutcells::build::{BodyError, SUBDIVISIONS};
use palpate_model::cutcells::cut::ClipBox;
use palpate_model::plan::build::reference;
use palpate_model::shape::{Shape, TriMesh};
use palpate_model::space::body::Body;
use palpate_model::space::kept_volume::KeptVolume;
use palpate_model::space::points::TetMesh;
use palpate_model::space::stuffing::{StuffingError, stuff};

/// Planes of a lattice that would lie closer than this part of an edge become one: thinner layers would be flat elements.
const CLOSEST: f64 = 0.02;
/// How far from a clamp's region a node may lie that it holds, in edges: places on the surface are found to better than that.
const ON: f64 = 1e-3;

/// A shape filled with tetrahedra.
#[derive(Clone, Debug)]
pub struct Filled {
    /// The tetrahedra, in the frame of the shape.
    pub mesh: TetMesh,
    /// Nodes that each clamp holds, increasing.
    pub held: Vec<Vec<u32>>,
    /// How its volume was kept.
    pub kept: KeptVolume,
    /// Volume of the shape [m³].
    pub volume: f64,
}

/// Why a shape cannot be filled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FillError {
    /// The edge is too fine or too coarse.
    #[error(transparent)]
    Stuffing(#[from] StuffingError),
    /// The volume cannot be measured.
    #[error(transparent)]
    Volume(#[from] BodyError),
    /// Clamps hold the whole body.
    #[error("clamps hold the whole body: nothing is left that deforms")]
    Nothing,
}

/// Distance from a box [m], negative inside.
fn distance(region: &ClipBox, p: DVec3) -> f64 {
    let d = region.distances(p);
    let out = DVec3::new(d[0].max(d[3]), d[1].max(d[4]), d[2].max(d[5]));
    out.max(DVec3::ZERO).length() + out.max_element().min(0.0)
}

/// Corners of a clamp's box in the shape's frame, where its faces lie along the axes there.
fn along_axes(region: &ClipBox) -> Option<(DVec3, DVec3)> {
    let turn = region.to_frame.matrix3;
    let straight = turn.abs_diff_eq(glam::DMat3::IDENTITY, 1e-12);
    straight.then(|| (region.min - region.to_frame.translation, region.max - region.to_frame.translation))
}

/// An axis that is stretched piece by piece: places [m] and how many edges there are up to each.
#[derive(Debug)]
struct Axis(Vec<(f64, f64)>);

impl Axis {
    fn new(low: f64, high: f64, between: impl Iterator<Item = f64>, edge: f64) -> Axis {
        let apart = CLOSEST * edge.min(high - low);
        let mut inner: Vec<f64> = between.filter(|x| *x > low + apart && *x < high - apart).collect();
        inner.sort_by(f64::total_cmp);
        inner.dedup_by(|b, a| *b - *a < apart);
        let mut knots = vec![(low, 0.0)];
        for x in inner.into_iter().chain([high]) {
            let (last, count) = knots[knots.len() - 1];
            knots.push((x, count + ((x - last) / edge - 1e-6).ceil().max(1.0)));
        }
        Axis(knots)
    }

    /// From edges to a place [m]; beyond the ends as in the last piece.
    fn place(&self, t: f64) -> f64 {
        let k = self.0.iter().skip(1).position(|k| t <= k.1).unwrap_or(self.0.len() - 2);
        let [(a, s), (b, e)] = [self.0[k], self.0[k + 1]];
        a + (t - s) * (b - a) / (e - s)
    }

    /// Edges from one end to the other.
    fn count(&self) -> f64 {
        self.0[self.0.len() - 1].1
    }
}

/// A shape in coordinates in which edges of the lattice are one.
#[derive(Debug)]
struct Stretched<'a> {
    shape: &'a dyn Shape,
    axes: [Axis; 3],
}

impl Stretched<'_> {
    fn place(&self, t: DVec3) -> DVec3 {
        DVec3::new(self.axes[0].place(t.x), self.axes[1].place(t.y), self.axes[2].place(t.z))
    }
}

impl Shape for Stretched<'_> {
    /// Not a distance here, but of the same sign, and zero on the surface: all that is asked for.
    fn signed_distance(&self, t: DVec3) -> f64 {
        self.shape.signed_distance(self.place(t))
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        (DVec3::ZERO, DVec3::new(self.axes[0].count(), self.axes[1].count(), self.axes[2].count()))
    }

    fn surface(&self, edge: f64) -> TriMesh {
        self.shape.surface(edge)
    }
}

/// Fills a shape with tetrahedra whose longest edges are at most about `edge` [m], and says which nodes clamps hold. Clamps are given in the
/// shape's frame. Same input, same bits.
///
/// # Errors
/// The edge is too fine or too coarse for the shape, or clamps hold all of it.
pub fn fill(shape: &dyn Shape, clamps: &[ClipBox], edge: f64) -> Result<Filled, FillError> {
    let (low, high) = shape.bounds();
    let faces: Vec<(DVec3, DVec3)> = clamps.iter().filter_map(along_axes).collect();
    let axis = |a: usize| Axis::new(low[a], high[a], faces.iter().flat_map(|f| [f.0[a], f.1[a]]), edge);
    let stretched = Stretched { shape, axes: [axis(0), axis(1), axis(2)] };
    let mut mesh = stuff(&stretched, 1.0).map_err(|e| in_metres(e, edge))?;
    mesh.nodes.iter_mut().for_each(|x| *x = stretched.place(*x));
    let on = |c: &ClipBox| (0..mesh.nodes.len() as u32).filter(|n| distance(c, mesh.nodes[*n as usize]) <= ON * edge).collect();
    let held: Vec<Vec<u32>> = clamps.iter().map(on).collect();
    let mut free = vec![true; mesh.nodes.len()];
    held.iter().flatten().for_each(|n| free[*n as usize] = false);
    if !free.contains(&true) {
        return Err(FillError::Nothing);
    }
    // As for bodies of tetrahedra within palpate: cut cells know the volume of what is inside.
    let volume = Body::build(shape, reference(low, high, edge), 0.0, SUBDIVISIONS)?.volume;
    let kept = mesh.keep_volume(volume);
    Ok(Filled { mesh, held, kept, volume })
}

/// An error of the stretched lattice, whose edge is one, in metres.
fn in_metres(e: StuffingError, h: f64) -> FillError {
    FillError::Stuffing(match e {
        StuffingError::TooFine { points, suggestion, .. } => {
            StuffingError::TooFine { edge: h, points, suggestion: suggestion * h }
        }
        StuffingError::TooThin { least, points } => StuffingError::TooThin { least: least * h, points },
        StuffingError::TooCoarse { suggestion, .. } => StuffingError::TooCoarse { edge: h, suggestion: suggestion * h },
        StuffingError::Torn { lost, .. } => StuffingError::Torn { edge: h, lost },
    })
}

/// A clamp's region of the world in the frame of a shape that a pose places there.
pub fn in_frame(region: &ClipBox, pose: &DAffine3) -> ClipBox {
    ClipBox { to_frame: region.to_frame * *pose, ..*region }
}

#[cfg(test)]
#[path = "fill_tests.rs"]
mod tests;
