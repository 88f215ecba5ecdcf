//! Plans of bodies that are made of tetrahedra.

use super::{PlanError, error};
use crate::cutcells::build::SUBDIVISIONS;
use crate::cutcells::clamp_edge::Edge;
use crate::cutcells::cut::ClipBox;
use crate::mechanics::lame::lame;
use crate::plan::ClampSite;
use crate::scene::{BodySource, Clamp, ClampRegion, Object, Resolution, Scene};
use crate::shape::{Shape, shape_of};
use crate::space::body::Body;
use crate::space::kept_volume::KeptVolume;
use crate::space::points::TetMesh;
use crate::space::stencil::Stencil;
use crate::space::stuffing::{StuffingError, stuff};
use crate::space::tets::EDGES;
use glam::{DAffine3, DVec3};
use std::sync::Arc;

/// Stiffness of a held node's spring over that of its share of the body: it gives way by a hundred-millionth of what the body is strained, which
/// leaves clamped nodes of bodies as large as a hand within a nanometre of their path; and block-Jacobi takes the difference in size away again.
pub const HELD: f64 = 1e8;

/// Cells in the box around a shape whose volume is measured.
const REFERENCE_CELLS: f64 = 1e5;

/// The tetrahedra that a shape is filled with, placed in the world, and how its volume was kept.
///
/// # Errors
/// The edge is too fine or too coarse; the object has no edge to go by.
pub fn made(object: &Object) -> Result<(TetMesh, KeptVolume), PlanError> {
    let Resolution::Edge(edge) = object.resolution else {
        return Err(error("object.edge_length", "is missing: how fine are the tetrahedra to be?".into()));
    };
    // In the shape's own frame: its faces lie along the lattice there, and the mesh does not depend on the pose.
    let shape = shape_of(&Object { pose: DAffine3::IDENTITY, ..object.clone() });
    let fault = |e: StuffingError| error("object.edge_length", e.to_string());
    let mut mesh = stuff(shape.as_ref(), edge).map_err(fault)?;
    // Cut cells know the volume of what is inside, also of a surface that passes through itself.
    let (low, high) = shape.bounds();
    let h = reference(low, high, edge);
    let cells = Body::build(shape.as_ref(), h, 0.0, SUBDIVISIONS).map_err(|e| error("object.edge_length", e.to_string()))?;
    let kept = mesh.keep_volume(cells.volume);
    Ok((mesh.transformed(&object.pose), kept))
}

/// Edge of the cells that measure the volume between two corners [m]: finer than the tetrahedra, as far as that costs little.
pub fn reference(low: DVec3, high: DVec3, edge: f64) -> f64 {
    (0.5 * edge).max(((high - low).element_product() / REFERENCE_CELLS).cbrt()).min((high - low).min_element())
}

/// Refuses what only cut cells have.
pub(super) fn refuse_what_needs_cells(scene: &Scene) -> Result<(), PlanError> {
    let Some(i) = scene.effects.iter().position(|e| e.law().needs_cells()) else { return Ok(()) };
    let message = format!(
        "\"{}\" moves the edge of what is held within cells, and of tetrahedra and points whole nodes are held: change the clamp's box",
        scene.effects[i].law().kind
    );
    Err(error(format!("effect.{i}.kind"), message))
}

/// The nodes inside a clamp's box or of its group, each held by a stiff spring.
pub(super) fn clamp_site(
    i: usize,
    clamp: &Clamp,
    scene: &Scene,
    body: &Body,
    shape: &Arc<dyn Shape>,
) -> Result<ClampSite, PlanError> {
    let (held, region) = match &clamp.region {
        ClampRegion::Box { min, max, object_frame } => {
            let to_frame = if *object_frame { scene.object.pose.inverse() } else { DAffine3::IDENTITY };
            let region = ClipBox { to_frame, min: *min, max: *max };
            let held = inside(&region, body);
            if held.is_empty() {
                let (lo, hi) = body.corners;
                let message = format!(
                    "the box from {min} to {max} m holds no node of the body, which lies between {lo} and {hi} m (world); move or enlarge \
                     the box"
                );
                return Err(error(format!("clamp.{i}.box"), message));
            }
            (held, region)
        }
        ClampRegion::Group(name) => {
            let mut held = group(name, scene).map_err(|message| error(format!("clamp.{i}.group"), message))?;
            held.sort_unstable();
            hold_middles(&mut held, body);
            let places = || held.iter().map(|n| body.nodes[*n as usize]);
            let (min, max) = (places().fold(DVec3::INFINITY, DVec3::min), places().fold(DVec3::NEG_INFINITY, DVec3::max));
            (held, ClipBox { to_frame: DAffine3::IDENTITY, min, max })
        }
    };
    let (lambda, mu) = lame(scene.material.youngs_modulus, scene.material.poisson_ratio);
    let spring = |volume: f64| HELD * (lambda + 2.0 * mu) * volume / body.length.powi(2);
    let nodes: Vec<(u32, f64)> = held.into_iter().map(|n| (n, spring(body.node_volume[n as usize]))).collect();
    let edge = Arc::new(Edge::new(shape.clone(), SUBDIVISIONS, region, Vec::new()));
    let areas = areas(body, &nodes);
    Ok(ClampSite { cells: Vec::new(), nodes, areas, motion: clamp.motion.clone(), edge })
}

/// What a compliant layer holds of a node within the body, over its volume and times the length of an element: as of cells, whose held volume gives
/// way by 20 ℓ/h.
const WITHIN: f64 = 20.0;

/// Area of the held surface, which are the patches whose nodes are all held, that each node stands for [m²].
fn areas(body: &Body, held: &[(u32, f64)]) -> Vec<f64> {
    let place = |n: &u32| held.binary_search_by_key(n, |h| h.0).ok();
    let mut areas = vec![0.0; held.len()];
    for (patch, s) in body.pieces() {
        let Some(places) = s.nodes.iter().map(place).collect::<Option<Vec<usize>>>() else { continue };
        // Functions of second degree are negative at some corners, and springs must not be.
        let whole: f64 = s.value.iter().map(|w| w.max(0.0)).sum();
        places.iter().zip(s.value).for_each(|(k, w)| areas[*k] += patch.area * w.max(0.0) / whole);
    }
    let within = |n: u32| WITHIN * body.node_volume[n as usize] / body.length;
    areas.iter().zip(held).map(|(a, h)| if *a > 0.0 { *a } else { within(h.0) }).collect()
}

/// The nodes of a body inside a box.
fn inside(region: &ClipBox, body: &Body) -> Vec<u32> {
    // Nodes on the box's face count, also after rounding.
    let slack = DVec3::splat(1e-9 * body.length);
    let inside = |x: &DVec3| {
        let x = region.to_frame.transform_point3(*x);
        x.cmpge(region.min - slack).all() && x.cmple(region.max + slack).all()
    };
    (0u32..).zip(&body.nodes).filter(|(_, x)| inside(x)).map(|(n, _)| n).collect()
}

/// Adds the nodes in the middle of edges that have both ends among the corners held, in order.
fn hold_middles(held: &mut Vec<u32>, body: &Body) {
    let has = |n: u32| held.binary_search(&n).is_ok();
    let middle = |s: Stencil| {
        let own = s.nodes.to_vec();
        let of = move |k: usize| own.get(4 + k).map(|m| (own[EDGES[k][0]], own[EDGES[k][1]], *m));
        (0..EDGES.len()).filter_map(of).collect::<Vec<_>>()
    };
    let middles: Vec<u32> =
        body.points.means().flat_map(middle).filter(|(a, b, _)| has(*a) && has(*b)).map(|(.., m)| m).collect();
    held.extend(middles);
    held.sort_unstable();
    held.dedup();
}

/// The corners of a named group of the body's volume mesh, or why there are none.
fn group(name: &str, scene: &Scene) -> Result<Vec<u32>, String> {
    let BodySource::Tetrahedra { path, mesh, .. } = &scene.object.source else {
        let of =
            if scene.object.is_of_points() { "this body is one of points" } else { "the tetrahedra of this body are made here" };
        return Err(format!("names a group of a volume mesh, and {of}: give a box"));
    };
    let file = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    match mesh.groups.get(name) {
        Some(nodes) if nodes.is_empty() => {
            Err(format!("\"{name}\" of {file} holds no node of the body, only nodes that no tetrahedron has"))
        }
        Some(nodes) => Ok(nodes.clone()),
        None if mesh.groups.is_empty() => Err(format!(
            "\"{name}\" is no group of {file}, which has none: name groups where the mesh is made (in Gmsh: Physical Surface), or give a box"
        )),
        None => {
            let known: Vec<String> = mesh.groups.iter().map(|(n, of)| format!("\"{n}\" ({} nodes)", of.len())).collect();
            Err(format!("\"{name}\" is no group of {file}; it has {}", known.join(", ")))
        }
    }
}
