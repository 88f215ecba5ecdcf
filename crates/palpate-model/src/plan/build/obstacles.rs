//! Whether obstacles begin outside the body.

use super::{PlanError, error};
use crate::effects::obstacle::{KIND, OFFSET, STIFFNESS};
use crate::scene::Scene;
use crate::shape::Shape;
use crate::space::body::Body;
use glam::DVec3;

/// How far an obstacle may reach into the body at the start, in cells: what rounding, a sampled distance and a scan's error make.
const OVERLAP: f64 = 1.0;

/// Refuses obstacles that begin inside the body: contact pushes out through the nearest side, which may be the wrong one.
///
/// Both ways are looked at: patches of the body in the obstacle, and places of the obstacle's surface in the body, so that neither can
/// hide between the samples of the other.
pub(super) fn check_apart(scene: &Scene, time: f64, body: &Body, shape: &dyn Shape) -> Result<(), PlanError> {
    let obstacles = scene.effects.iter().filter(|e| e.law().kind == KIND).enumerate();
    for (i, effect) in obstacles.filter(|(_, e)| e.values[STIFFNESS] != Some(0.0)) {
        let Some(moving) = &effect.moving else { continue };
        let Some(obstacle) = &moving.shape else {
            return Err(error(format!("obstacle.{i}"), "has no shape; give `mesh` or `shape`".into()));
        };
        let (r, b) = moving.motion.at(time);
        let b = b + DVec3::from_array([0, 1, 2].map(|a| effect.values[OFFSET + a].unwrap_or_default()));
        let within = body.patches.iter().map(|p| -obstacle.distance.at(r.transpose() * (p.point - b)).value);
        let (patches, deepest) = deep(within);
        let (low, high) = shape.bounds();
        let places = obstacle.surface.vertices.iter().map(|p| r * *p + b);
        let near = places.filter(|p| p.cmpge(low).all() && p.cmple(high).all());
        let (places, reach) = deep(near.map(|p| -shape.signed_distance(p)));
        let (depth, allowed) = (deepest.max(reach), OVERLAP * body.length);
        if depth > allowed {
            let key = if moving.motion.times.is_empty() { "pose" } else { "motion" };
            let message = format!(
                "at the start, {time} s, obstacle and body overlap by {depth:.4} m ({patches} of {} pieces of the body's surface lie in the \
                 obstacle, {places} of {} places of the obstacle's surface in the body); allowed is one cell, {allowed:.4} m: let the \
                 obstacle begin outside and move in",
                body.patches.len(),
                obstacle.surface.vertices.len()
            );
            return Err(error(format!("obstacle.{i}.{key}"), message));
        }
    }
    Ok(())
}

/// How many depths are positive, and the largest.
fn deep(depths: impl Iterator<Item = f64>) -> (usize, f64) {
    depths.filter(|d| *d > 0.0).fold((0, 0.0), |(n, most), d| (n + 1, d.max(most)))
}
