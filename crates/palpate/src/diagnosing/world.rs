//! The world as it is known: what free numbers may be at all. A fit that needs another one says that its model is wrong.

use super::hypothesis::Prepared;
use palpate_diagnose::{Model, Strange, stated};
use palpate_fit::{AtBound, Chart};
use palpate_model::params::{Transform, unit_behind};
use palpate_model::plan::Physics;

/// Gravity on Earth, and a standard deviation that is kind to rigs out of plumb and clocks out of tune [m/s²].
const GRAVITY: (f64, f64) = (9.81, 0.1);
/// A scene whose own gravity is further off is not of this Earth, and says so.
const EARTHLY: f64 = 0.5;
/// Standard deviations that a number at its bound counts: the recording asks for what its scene excludes.
const BOUND: f64 = 2.0;

/// What is strange about a model's values.
pub(super) fn strange(ready: &Prepared, model: &Model, corrected: &[f64]) -> Vec<Strange> {
    let mut out: Vec<Strange> = Vec::new();
    let freed = |end: &str| ready.names.iter().any(|n| n.path.starts_with(end));
    if freed("world.gravity") {
        let mut sizes: Vec<f64> = Vec::new();
        for (s, e) in ready.experiments.iter().enumerate() {
            let found = Physics::new(&e.plan.layout, &ready.theta(s, corrected)).gravity.length();
            if (e.scene.gravity.length() - GRAVITY.0).abs() < EARTHLY && !sizes.contains(&found) {
                sizes.push(found);
            }
        }
        // What the readings leave open of it says nothing against the model.
        let of = ready.names.iter().zip(&model.errors).filter(|(n, _)| n.path.starts_with("world.gravity"));
        let open = of.filter_map(|(_, e)| *e).map(|e| e * e).sum::<f64>();
        out.extend(sizes.into_iter().map(|found| {
            let deviations = (found - GRAVITY.0).abs() / (GRAVITY.1.powi(2) + open).sqrt();
            let what = format!(
                "gravity of {found:.2} m/s², which is {deviations:.0} standard deviations from the {} m/s² of the Earth",
                GRAVITY.0
            );
            Strange { path: "world.gravity".into(), what, deviations }
        }));
    }
    for ((n, f), v) in ready.names.iter().zip(&ready.free).zip(&model.values).take(ready.given) {
        let chart = Chart::new(f.transform, f.typical, f.bounds.0, f.bounds.1).ok();
        let Some(bound) = chart.and_then(|c| c.at_bound(*v)) else { continue };
        // A logarithm that ends at its lowest value says that there is none of it.
        let none = bound == AtBound::Lower && f.transform == Transform::Log;
        let side = if bound == AtBound::Lower { "lower" } else { "upper" };
        out.push(Strange {
            path: n.label(),
            what: format!("{} at its {side} bound of {}{}", n.label(), stated(*v, None), unit_behind(&f.unit)),
            deviations: if none { 0.0 } else { BOUND },
        });
    }
    out
}
