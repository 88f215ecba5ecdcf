//! Order in time: a beam that a clamp swings, in the schemes' steps against steps of an eighth of the shortest.

use super::report::{Requirement, Row};
use super::scenes;
use glam::{DQuat, DVec3};
use palpate_engine::Snapshot;
use palpate_model::materials::ALL;
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::plan::scheme;
use palpate_model::scene::{Analytic, Clamp, Time};

/// Time after which states are compared [s]: about a period of the slowest bending.
const END: f64 = 0.24;

/// A clamp that starts and ends without a jerk: sin⁴ of a half turn, in samples closer than any step.
fn motion() -> RigidMotion {
    let times: Vec<f64> = (0..=4096).map(|k| f64::from(k) * END / 4096.0).collect();
    let part = |t: &f64| (std::f64::consts::PI * t / END).sin().powi(4);
    let axis = DVec3::new(0.2, 1.0, 0.3).normalize();
    RigidMotion {
        translations: times.iter().map(|t| part(t) * DVec3::new(0.002, 0.004, 0.01)).collect(),
        rotations: times.iter().map(|t| DQuat::from_axis_angle(axis, 0.3 * part(t))).collect(),
        times,
    }
}

fn last(model: usize, time: Time) -> Result<Snapshot, String> {
    let shape = Analytic::Box { min: DVec3::new(0.0, -0.011, -0.012), max: DVec3::new(0.113, 0.012, 0.011) };
    let mut s = scenes::body(shape, 0.016);
    s.material.model = &ALL[model];
    s.material.youngs_modulus = 5e4;
    s.clamps = vec![Clamp { motion: Some(motion()), ..Clamp::still(DVec3::splat(-1.0), DVec3::new(0.033, 1.0, 1.0)) }];
    s.time = time;
    // Far below the smallest error that is compared.
    s.solver.tolerance = 1e-11;
    Ok(scenes::end(&s)?.1)
}

/// The study.
///
/// # Errors
/// The beam cannot be simulated.
pub fn run() -> Result<Vec<Row>, String> {
    let with = |name: &str, theta: f64, steps: usize| Time {
        step: END / steps as f64,
        steps,
        start: 0.0,
        theta,
        open: None,
        scheme: scheme::find(name).unwrap_or(scheme::theta()),
    };
    let mut rows = Vec::new();
    for model in [0, 1] {
        let exact = last(model, with("tr-bdf2", 0.5, 1024))?;
        let mut cases: Vec<(&str, f64, [f64; 2])> = vec![("theta", 0.5, [1.85, 2.15]), ("theta", 0.6, [0.8, 1.25])];
        cases.extend(scheme::ALL.iter().filter(|s| s.name != "theta").map(|s| (s.name, 0.5, [1.8, 2.15])));
        for (name, theta, [least, most]) in cases {
            let error = |steps: usize| {
                let end = last(model, with(name, theta, steps))?;
                let squares = end.displacement.iter().zip(&exact.displacement).map(|(a, b)| a.distance_squared(*b));
                Ok::<f64, String>(squares.sum::<f64>().sqrt())
            };
            let order = (error(64)? / error(128)?).log2();
            let stated = if name == "theta" { format!(" {theta}") } else { String::new() };
            let what = format!("{}, {name}{stated}: order, 64 to 128 steps", ALL[model].name);
            let source = if theta == 0.6 { "one" } else { "two" };
            rows.push(Row::new(what, Requirement::Between { least, most }, order, "", source));
        }
    }
    Ok(rows)
}
