//! A block that spins freely: what schemes take from it.

use super::report::{Requirement, Row};
use super::scenes;
use glam::DVec3;
use palpate_engine::Snapshot;
use palpate_model::plan::Plan;
use palpate_model::scene::{Analytic, Time};

/// Turns.
const TURNS: usize = 10;
/// Steps a turn.
const STEPS: usize = 100;

fn momentum(plan: &Plan, s: &Snapshot) -> f64 {
    let of = |i: usize| plan.body.node_volume[i] * (plan.body.nodes[i] + s.displacement[i]).cross(s.velocity[i]);
    (0..s.velocity.len()).map(of).sum::<DVec3>().length()
}

/// Mean kinetic energy over a turn, per density.
fn energy(plan: &Plan, turn: &[Snapshot]) -> f64 {
    let of = |s: &Snapshot| s.velocity.iter().zip(&plan.body.node_volume).map(|(v, w)| 0.5 * w * v.length_squared()).sum::<f64>();
    turn.iter().map(of).sum::<f64>() / turn.len() as f64
}

/// Parts of angular momentum and of kinetic energy that are lost in all turns.
fn lost(time: Time) -> Result<[f64; 2], String> {
    let half = DVec3::new(0.03, 0.02, 0.01);
    let mut s = scenes::body(Analytic::Box { min: -half, max: half }, 0.01);
    // About the axis of the largest moment, the stable one, at 30 rad/s: strains of a per cent.
    s.initial.angular_velocity = DVec3::new(0.0, 0.0, 30.0);
    let step = std::f64::consts::TAU / 30.0 / STEPS as f64;
    s.time = Time { step, steps: TURNS * STEPS, ..time };
    let plan = scenes::plan(&s)?;
    let all = scenes::states(&plan)?;
    let part = |first: f64, last: f64| 1.0 - last / first;
    let n = all.len();
    Ok([
        part(momentum(&plan, &all[0]), momentum(&plan, &all[n - 1])),
        part(energy(&plan, &all[..STEPS]), energy(&plan, &all[n - STEPS..])),
    ])
}

/// The study.
///
/// # Errors
/// The block cannot be simulated.
pub fn run() -> Result<Vec<Row>, String> {
    let default = scenes::steps(1.0, 1);
    let half = Time::weighted(0.5);
    let mut rows = Vec::new();
    for (name, time) in [(format!("default scheme ({})", default.scheme.name), default), ("θ = ½".into(), half)] {
        let [momentum, energy] = lost(time)?;
        let row = |what: &str, x: f64| {
            let requirement = Requirement::Between { least: -0.005, most: 0.005 };
            Row::new(format!("{name}: {what} lost in {TURNS} turns"), requirement, x, "", "free rotation keeps both")
        };
        rows.push(row("angular momentum", momentum));
        rows.push(row("kinetic energy", energy));
    }
    Ok(rows)
}
