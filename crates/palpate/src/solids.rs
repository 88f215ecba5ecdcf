//! Obstacles as they stand at a time, and how far they reach into a body.

use glam::{DMat3, DVec3};
use palpate_engine::Snapshot;
use palpate_model::effects::obstacle::{OFFSET, STIFFNESS};
use palpate_model::mechanics::normal::carried;
use palpate_model::plan::{Physics, Plan};
use palpate_model::shape::TriMesh;
use palpate_model::space::body::Patch;
use palpate_model::space::stencil::{Stencil, Stencils};
use rayon::prelude::*;

/// How far an obstacle may reach into the body without a warning, in elements.
const REACH: f64 = 0.5;
/// Most states that are looked at: every place of the obstacle is compared with every piece of the body's surface.
const LOOKS: usize = 20;

/// Surfaces of a plan's obstacles at a time on the recording's clock [s], in the world [m].
pub fn obstacles(plan: &Plan, time: f64) -> Vec<TriMesh> {
    let physics = Physics::new(&plan.layout, &plan.theta);
    let mut all = Vec::new();
    for (moving, numbers) in plan.moving.iter().zip(&physics.effects) {
        let Some((moving, shape)) = moving.as_ref().and_then(|m| Some((m, m.shape.as_ref()?))) else { continue };
        let (r, b) = moving.motion.at(time);
        let away = b + DVec3::from_slice(&numbers[OFFSET..OFFSET + 3]);
        let vertices = shape.surface.vertices.iter().map(|p| r * *p + away).collect();
        // What has no stiffness does nothing, and is not shown.
        if numbers[STIFFNESS] > 0.0 {
            all.push(TriMesh { vertices, triangles: shape.surface.triangles.clone() });
        }
    }
    all
}

/// A warning where an obstacle reaches far into the body: contact acts at the body's own patches, and what is finer may slip between them.
pub fn intrusion(plan: &Plan, start: f64, states: &[(usize, Snapshot)]) -> Option<String> {
    plan.moving.iter().flatten().find(|m| m.shape.is_some())?;
    let points: Vec<DVec3> = plan.body.patches.iter().map(|p| p.point).collect();
    let frames = plan.body.followers(&points).stencils;
    let mut worst: Option<(f64, f64, usize)> = None;
    // Some of many states tell as much.
    for (_, state) in states.iter().step_by(states.len().div_ceil(LOOKS).max(1)) {
        let time = start + state.time;
        for (number, solid) in obstacles(plan, time).iter().enumerate() {
            let depth = deepest(plan, &frames, solid, &state.displacement);
            if worst.is_none_or(|w| depth > w.0) {
                worst = Some((depth, time, number));
            }
        }
    }
    let (depth, time, number) = worst.filter(|w| w.0 > REACH * plan.body.length)?;
    Some(format!(
        "obstacle {number} reaches {depth:.4} m into the body at {time} s, more than {REACH} cells ({:.4} m): it is soft, or it slips between the pieces \
         of the body's surface that it is compared with; give a larger stiffness, smaller cells or shorter steps",
        REACH * plan.body.length
    ))
}

/// Depth of the deepest of a surface's vertices in a deformed body [m], from the nearest piece of the body's surface and its normal.
fn deepest(plan: &Plan, frames: &Stencils, solid: &TriMesh, u: &[DVec3]) -> f64 {
    let turned = |(p, s): (&Patch, Stencil)| {
        (p.point + s.at(u), carried(p.normal, DMat3::IDENTITY + s.gradient_of(u)).normalize_or_zero())
    };
    let pieces: Vec<(DVec3, DVec3)> = plan.body.patches.iter().zip(frames.iter()).map(turned).collect();
    let (low, high) = pieces.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), (p, _)| (l.min(*p), h.max(*p)));
    let near = solid.vertices.par_iter().filter(|v| v.cmpge(low).all() && v.cmple(high).all());
    let depth = |v: &DVec3| {
        let nearest = pieces.iter().min_by(|a, b| a.0.distance_squared(*v).total_cmp(&b.0.distance_squared(*v)));
        nearest.map_or(0.0, |(p, n)| (*p - *v).dot(*n).max(0.0))
    };
    near.map(depth).reduce(|| 0.0, f64::max)
}
