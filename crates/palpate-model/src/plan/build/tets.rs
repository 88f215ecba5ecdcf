//! Plans of bodies that are made of tetrahedra.

use super::{PlanError, error};
use crate::cutcells::build::SUBDIVISIONS;
use crate::cutcells::clamp_edge::Edge;
use crate::cutcells::cut::ClipBox;
use crate::effects::Site;
use crate::mechanics::lame::lame;
use crate::observation::Observation;
use crate::plan::ClampSite;
use crate::scene::{Clamp, Scene};
use crate::shape::Shape;
use crate::space::body::Body;
use glam::{DAffine3, DVec3};
use std::sync::Arc;

/// Stiffness of a held node's spring over that of its share of the body: it gives way by a millionth of what the body is strained, and
/// block-Jacobi takes the difference in size away again.
pub const HELD: f64 = 1e6;

/// Refuses what only cut cells have.
pub(super) fn refuse_what_needs_cells(scene: &Scene) -> Result<(), PlanError> {
    for (i, effect) in scene.effects.iter().enumerate() {
        if matches!(effect.law().site, Site::Cells(_) | Site::Rest(_) | Site::Clamps(_) | Site::Edges(_)) {
            let message = format!("\"{}\" acts on cells of a lattice, and this body is made of tetrahedra", effect.law().kind);
            return Err(error(format!("effect.{i}.kind"), message));
        }
    }
    Ok(())
}

/// Depth points are looked up in the lattice around a body, which one of tetrahedra does not have.
pub(super) fn refuse_depth(body: &Body, observation: &Observation) -> Result<(), PlanError> {
    let seen = observation.frames.iter().any(|f| !f.points.is_empty());
    if seen && !body.points.is_empty() {
        let message = "a body of tetrahedra cannot be compared with depth points yet; use a surface mesh, or markers and tracks";
        return Err(error("object.volume_mesh", message.into()));
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
    Ok(ClampSite { cells: Vec::new(), nodes, motion: clamp.motion.clone(), edge })
}
