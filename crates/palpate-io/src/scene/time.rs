//! `[time]`: when states are computed, and how.

use crate::document::Table;
use crate::error::{InputError, number};
use glam::DVec3;
use palpate_model::plan::scheme::{self, QUASI_STATIC, Scheme};
use palpate_model::scene::{Initial, InitialShape, Time};

/// More steps than this are a slip of units, not a simulation.
const MOST_STEPS: f64 = 1e6;

/// The clock of a scene that starts as `initial` says.
pub(super) fn time(root: &Table, initial: &Initial) -> Result<Time, InputError> {
    let t = root.optional_table("time")?.ok_or_else(|| root.missing("time", "a table [time] with step and duration"))?;
    match t.optional_choice("mode", &[("dynamic", false), ("quasi-static", true)])? {
        Some(true) => sequence(root, &t, initial),
        _ => motion(&t, initial.state),
    }
}

/// A sequence of equilibria. Without a clock its states are when the recording's frames, or rows of loads, are.
fn sequence(root: &Table, t: &Table, initial: &Initial) -> Result<Time, InputError> {
    for key in ["scheme", "theta"] {
        if t.has(key) {
            return Err(
                t.error(key, "belongs to mode = \"dynamic\"; in a quasi-static sequence nothing depends on how time passes")
            );
        }
    }
    let moves = [("velocity", initial.velocity), ("angular_velocity", initial.angular_velocity)];
    if let Some((key, _)) = moves.iter().find(|(_, v)| *v != DVec3::ZERO) {
        let at = root.optional_table("initial")?;
        let text = "has no meaning in a quasi-static sequence, which has no inertia; leave it out";
        return Err(at.map_or_else(|| root.error("initial", text), |i| i.error(key, text)));
    }
    let step = t.f64_where("step", |x| x >= SHORTEST_STEP, "is not allowed: must be > 0, and at least 1e-9 (s)")?;
    let duration = t.f64_where("duration", |x| x >= 0.0, "is not allowed: must be ≥ 0 (s)")?;
    let steps = t.optional_count("steps", 0..=MOST_STEPS as u64)?;
    let count = match (step, duration, steps) {
        (_, Some(_), Some(_)) => return Err(t.error("steps", "duration and steps exclude each other; give one")),
        (None, None, None) => 0.0,
        (None, _, _) => {
            return Err(t.missing("step", "a number > 0 (s), or neither of step, duration and steps: one state a frame"));
        }
        (Some(_), None, None) => return Err(t.missing("duration", "duration (s) or steps")),
        (Some(step), Some(duration), None) => (duration / step).round(),
        (Some(_), None, Some(steps)) => steps as f64,
    };
    if count > MOST_STEPS {
        return Err(t.error("step", format!("asks for {} states, at most {MOST_STEPS:.0} are allowed", number(count))));
    }
    Ok(Time {
        step: step.unwrap_or(1.0),
        steps: count as usize,
        start: t.optional_f64("start")?.unwrap_or(0.0),
        scheme: &QUASI_STATIC,
        ..Time::default()
    })
}

/// A motion, or a single equilibrium.
fn motion(t: &Table, state: InitialShape) -> Result<Time, InputError> {
    let step = t.f64_where("step", |x| x >= SHORTEST_STEP, "is not allowed: must be > 0, and at least 1e-9 (s)")?;
    let duration = t.f64_where("duration", |x| x >= 0.0, "is not allowed: must be ≥ 0 (s)")?;
    let steps = t.optional_count("steps", 0..=MOST_STEPS as u64)?;
    let mut open = None;
    let (key, count) = match (duration, steps) {
        (Some(_), Some(_)) => return Err(t.error("steps", "duration and steps exclude each other; give one")),
        (None, None) => return Err(t.missing("duration", "duration (s) or steps")),
        (None, Some(n)) => ("steps", n as f64),
        (Some(0.0), None) => ("duration", 0.0),
        (Some(d), None) => {
            open = step.is_none().then_some(d);
            let step = step.unwrap_or(d);
            let n = (d / step).round();
            if n < 1.0 {
                return Err(t.error("duration", format!("{} s is shorter than half a step ({} s)", number(d), number(step))));
            }
            ("duration", n)
        }
    };
    if count > MOST_STEPS {
        return Err(
            t.error(key, format!("asks for {} steps, at most {MOST_STEPS:.0} are allowed; is step in seconds?", number(count)))
        );
    }
    if count == 0.0 && state == InitialShape::Given {
        return Err(
            t.error(key, "0 leaves nothing to compute: a shape that is given as the equilibrium (object.state) needs steps")
        );
    }
    if count == 0.0 && state != InitialShape::StaticEquilibrium {
        return Err(t.error(key, "0 needs initial.state = \"static-equilibrium\" (a static problem)"));
    }
    // A static problem has no step; any positive length serves.
    let given = step.or((count == 0.0).then_some(1.0)).or(open);
    let step = given.ok_or_else(|| t.missing("step", "a number > 0 (s), or duration instead of steps"))?;
    let theta = t.f64_where("theta", |x| (0.5..1.0).contains(&x), "is not allowed: must lie in [0.5, 1)")?;
    let schemes: Vec<(&str, &'static Scheme)> = scheme::ALL.iter().map(|s| (s.name, s)).collect();
    // Who states θ means its scheme.
    let unstated = if theta.is_some() { scheme::theta() } else { Time::default().scheme };
    let scheme = t.optional_choice("scheme", &schemes)?.unwrap_or(unstated);
    if theta.is_some() && !scheme.leaves_theta_open() {
        return Err(t.error("theta", format!("belongs to scheme = \"theta\"; \"{}\" has none", scheme.name)));
    }
    let default = Time::default();
    Ok(Time {
        step,
        steps: count as usize,
        start: t.optional_f64("start")?.unwrap_or(0.0),
        theta: theta.unwrap_or(default.theta),
        scheme,
        open,
    })
}

/// Shortest time step [s]: the fastest waves need a thousand times as long to cross the smallest cells, and forces overflow long before zero.
const SHORTEST_STEP: f64 = 1e-9;
