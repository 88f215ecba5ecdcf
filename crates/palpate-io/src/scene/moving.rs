//! `[[obstacle]]` and `[[load]] kind = "jet"`: rigid things beside the body that move as a file says.

use super::motion::read_motion;
use super::object::{pose, surface};
use crate::document::Table;
use crate::error::{InputError, number};
use glam::DVec3;
use palpate_model::effects::moving::Moving;
use palpate_model::effects::{self, Effect, jet, obstacle};
use palpate_model::mechanics::distance_grid::{DistanceGrid, MOST_SAMPLES};
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::scene::{Object, Resolution};
use palpate_model::shape::shape_of;
use std::sync::Arc;

/// Keys of a load that only jets have.
pub(super) const JET_KEYS: [&str; 5] = ["motion", "axis", "offset", "thrust", "spread"];
/// Samples of an obstacle's distance along its longest side, where the scene does not say: a ball's surface is then exact to 1e-6 of its size.
const SAMPLES: f64 = 64.0;

/// Obstacles become effects, appended to `effects`.
pub(super) fn obstacles(root: &Table, effects: &mut Vec<Effect>, warnings: &mut Vec<String>) -> Result<(), InputError> {
    for t in root.tables("obstacle")? {
        effects.push(obstacle(&t, warnings)?);
    }
    Ok(())
}

fn obstacle(t: &Table, warnings: &mut Vec<String>) -> Result<Effect, InputError> {
    let (source, extent) = match (t.has("mesh"), t.has("shape")) {
        (true, true) => return Err(t.error("shape", "mesh and shape exclude each other; give one")),
        _ => surface(t, warnings)?.ok_or_else(|| t.missing("mesh", "mesh = \"FILE\" or shape = { … }"))?,
    };
    let shape = shape_of(&Object { source, pose: pose(t)?, resolution: Resolution::Own });
    let (low, high) = shape.bounds();
    let spacing = t.f64_where("cell_size", |x| x > 0.0, "is not allowed: must be > 0 (m)")?;
    let spacing = spacing.unwrap_or((high - low).max_element() / SAMPLES);
    let samples = DistanceGrid::counts(shape.as_ref(), spacing).iter().map(|n| *n as f64).product::<f64>();
    if samples > MOST_SAMPLES as f64 {
        let message = format!(
            "{} m makes {} samples of the obstacle's distance, which is {} m long; at most {MOST_SAMPLES} are allowed",
            number(spacing),
            number(samples),
            number(extent.max_element())
        );
        return Err(t.error("cell_size", message));
    }
    let thin = (high - low).min_element();
    if thin < 2.0 * spacing {
        let message = format!(
            "the obstacle is {} m thin and its distance is sampled every {} m, which does not see it; give a smaller cell_size",
            number(thin),
            number(spacing)
        );
        return Err(t.error("cell_size", message));
    }
    let stiffness = t.f64_where("stiffness", |x| (0.0..=1e15).contains(&x), "is not allowed: must lie in [0, 1e15] (Pa/m)")?;
    let wanted = "a number ≥ 0 (Pa/m), pressure over penetration; a plane has 20 · youngs_modulus / cell_size";
    let stiffness = stiffness.ok_or_else(|| t.missing("stiffness", wanted))?;
    let offset = t.optional_vec3("offset")?.unwrap_or_default();
    let moving = Moving::obstacle(shape.as_ref(), spacing, motion(t)?);
    Ok(effect(obstacle::KIND, &[stiffness, offset.x, offset.y, offset.z], moving))
}

/// A jet.
pub(super) fn jet(t: &Table) -> Result<Effect, InputError> {
    for key in ["forces", "total", "index", "places", "times", "rate", "start", "factor"] {
        if t.has(key) {
            return Err(t.error(key, "belongs to kind = \"file\""));
        }
    }
    let thrust = t.f64_where("thrust", |x| (0.0..=1e6).contains(&x), "is not allowed: must lie in [0, 1e6] (N)")?;
    let wanted = "a number ≥ 0 (N): the air's density times velocity² times the nozzle's area";
    let thrust = thrust.ok_or_else(|| t.missing("thrust", wanted))?;
    let spread = t.f64_where("spread", |x| (1e-3..=10.0).contains(&x), "is not allowed: must lie in [0.001, 10]")?;
    let axis = t.optional_vec3("axis")?.unwrap_or(DVec3::Z);
    // Shorter than this, the direction is rounding noise.
    if axis.length() < 1e-12 {
        return Err(t.error("axis", "has no length; give the direction that the jet blows along, in the nozzle's coordinates"));
    }
    let offset = t.optional_vec3("offset")?.unwrap_or_default();
    let moving = Moving::nozzle(axis, motion(t)?);
    Ok(effect(jet::KIND, &[thrust, spread.unwrap_or(0.1), offset.x, offset.y, offset.z], moving))
}

/// `motion`, or none: it stands where its own coordinates are.
fn motion(t: &Table) -> Result<RigidMotion, InputError> {
    Ok(t.optional_file("motion")?.as_deref().map(read_motion).transpose()?.unwrap_or_default())
}

fn effect(kind: &str, values: &[f64], moving: Moving) -> Effect {
    let law = effects::find(kind).expect("the law is in the table");
    Effect { values: values.iter().copied().map(Some).collect(), moving: Some(Arc::new(moving)), ..Effect::absent(law) }
}
