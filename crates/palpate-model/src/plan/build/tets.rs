//! Plans of bodies that are made of tetrahedra.

use super::{PlanError, error};
use crate::cutcells::build::SUBDIVISIONS;
use crate::cutcells::clamp_edge::Edge;
use crate::cutcells::cut::ClipBox;
use crate::effects::Site;
use crate::mechanics::lame::lame;
use crate::plan::ClampSite;
use crate::scene::{Clamp, Scene};
use crate::shape::Shape;
use crate::space::body::Body;
use glam::{DAffine3, DVec3};
use std::sync::Arc;

/// Stiffness of a held node's spring over that of its share of the body: it gives way by a hundred-millionth of what the body is strained, which
/// leaves clamped nodes of bodies as large as a hand within a nanometre of their path; and block-Jacobi takes the difference in size away again.
pub const HELD: f64 = 1e8;

/// Refuses what only cut cells have.
pub(super) fn refuse_what_needs_cells(scene: &Scene) -> Result<(), PlanError> {
    for (i, effect) in scene.effects.iter().enumerate() {
        let why = match effect.law().site {
            Site::Edges(_) => {
                "moves the edge of what is held within cells, and of a body of tetrahedra whole nodes are held: change the clamp's box"
            }
            Site::Rest(_) => "acts on cells of a lattice, and this body is made of tetrahedra",
            _ => continue,
        };
        {
            let message = format!("\"{}\" {why}", effect.law().kind);
            return Err(error(format!("effect.{i}.kind"), message));
        }
    }
    Ok(())
}

/// The nodes inside a clamp's box, each held by a stiff spring.
pub(super) fn clamp_site(
    i: usize,
    clamp: &Clamp,
    scene: &Scene,
    body: &Body,
    shape: &Arc<dyn Shape>,
) -> Result<ClampSite, PlanError> {
    let to_frame = if clamp.object_frame { scene.object.pose.inverse() } else { DAffine3::IDENTITY };
    // Nodes on the box's face count, also after rounding.
    let slack = DVec3::splat(1e-9 * body.length);
    let inside = |x: &DVec3| {
        let x = to_frame.transform_point3(*x);
        x.cmpge(clamp.min - slack).all() && x.cmple(clamp.max + slack).all()
    };
    let (lambda, mu) = lame(scene.material.youngs_modulus, scene.material.poisson_ratio);
    let spring = |volume: f64| HELD * (lambda + 2.0 * mu) * volume / body.length.powi(2);
    let nodes: Vec<(u32, f64)> = (0u32..)
        .zip(body.nodes.iter().zip(&body.node_volume))
        .filter(|(_, (x, _))| inside(x))
        .map(|(n, (_, v))| (n, spring(*v)))
        .collect();
    if nodes.is_empty() {
        let (lo, hi) = body.corners;
        return Err(error(
            format!("clamp.{i}.box"),
            format!(
                "the box from {} to {} m holds no node of the body, which lies between {lo} and {hi} m (world); move or enlarge the box",
                clamp.min, clamp.max
            ),
        ));
    }
    let region = ClipBox { to_frame, min: clamp.min, max: clamp.max };
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
