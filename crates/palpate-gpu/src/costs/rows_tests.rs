//! Single residuals and their derivatives against the CPU backend.

use super::rollout_tests::{assert_agreement, seen, watched};
use super::tests::{ball_plan, ball_plan_with};
use crate::GpuBackend;
use crate::tests::scenes::{ball, device};
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, Linearised, ParamBatch, Request, Rollout, Source, Wanted};
use palpate_model::effects::{ALL, Effect, Unstated, find};
use palpate_model::observation::Sensor;
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;

/// Numbers that differ, over what they may be: distances by a thousandth of the noise (rounding is 1e-7 of a cell), places by as much
/// of a cell, derivatives by a thousandth of the largest of their column.
pub(crate) fn apart(a: &Linearised, b: &Linearised, plan: &Plan) -> [f64; 3] {
    let q = b.directions.len();
    assert_eq!((a.rows.residuals.len(), a.rows.sensitivity.len()), (b.rows.residuals.len(), b.rows.sensitivity.len()));
    let mut worst = [0.0f64; 3];
    for (x, y) in a.rows.residuals.iter().zip(&b.rows.residuals) {
        assert_eq!((x.frame, x.source, x.noise), (y.frame, y.source, y.noise));
        let value = match (x.value, y.value) {
            (Some(a), Some(b)) => (a - b).abs() / y.noise,
            (None, None) => 0.0,
            _ => f64::INFINITY,
        };
        let kind = (x.weight - y.weight).abs().max((x.along_sight - y.along_sight).abs()).max((x.by_place - y.by_place).length());
        worst[0] = worst[0].max(value).max(kind);
        worst[1] = worst[1].max((x.rest - y.rest).length() / plan.body.length);
    }
    for k in 0..q {
        let column = |l: &Linearised| -> Vec<f64> { l.rows.sensitivity.iter().skip(k).step_by(q).copied().collect() };
        let (x, y) = (column(a), column(b));
        let size = y.iter().fold(1e-12, |m: f64, v| m.max(v.abs()));
        worst[2] = x.iter().zip(&y).map(|(x, y)| (x - y).abs() / size).fold(worst[2], f64::max);
    }
    worst
}

#[test]
fn rows_are_those_of_the_cpu_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    let mut scene = ball(0.03);
    scene.time.steps = 2;
    scene.observation = watched();
    let (first, second) = (seen(&scene), ball_plan());
    for plan in [first, second] {
        let keys = [ParamKey::YoungsModulus, ParamKey::Gravity(2), ParamKey::TimeStart];
        let directions = keys.map(|k| plan.layout.index(k));
        let mut cpu = Rollout::new(CpuBackend, &plan, 1).unwrap_or_else(|e| panic!("{e}"));
        let right = cpu.linearise(&plan.theta, &directions).unwrap_or_else(|e| panic!("{e}"));
        let mut rollout = Rollout::new(GpuBackend::on(gpu.clone()), &plan, 1).unwrap_or_else(|e| panic!("{e}"));
        let mut linearise = |theta: &[f64]| rollout.linearise(theta, &directions).unwrap_or_else(|e| panic!("{e}"));
        let found = linearise(&plan.theta);
        let kinds = |f: fn(&Source) -> bool| found.rows.residuals.iter().filter(|r| f(&r.source)).count();
        let [points, markers] = [kinds(|s| s.is_depth()), kinds(|s| matches!(s.sensor, Sensor::Marker(_)))];
        let d = apart(&found, &right, &plan);
        println!("{points} points, {markers} coordinates of markers: {d:?}");
        assert!(d.iter().all(|d| *d < 1e-3), "{d:?}");
        let mut wrong = plan.theta.clone();
        wrong[directions[1]] *= 1.01;
        let d = apart(&linearise(&wrong), &right, &plan);
        assert!(d.iter().any(|d| *d > 1e-3), "{d:?}");
        // Without directions there are residuals alone.
        let bare = rollout.linearise(&plan.theta, &[]).unwrap_or_else(|e| panic!("{e}"));
        assert!(bare.rows.residuals == found.rows.residuals && bare.rows.sensitivity.is_empty());
    }
}

#[test]
fn markers_that_sit_elsewhere_are_those_of_the_cpu() {
    let Some(gpu) = device(None) else { return };
    let mut effect = Effect::absent(find("marker-offset").unwrap_or_default());
    for (value, v) in effect.values.iter_mut().zip([1.0, 4e-3, -6e-3, 5e-3]) {
        *value = Some(v);
    }
    let plan = ball_plan_with(vec![effect]);
    let own = |k: &ParamKey| match *k {
        ParamKey::Effect { slot, .. } => slot > 0,
        ParamKey::YoungsModulus => true,
        _ => false,
    };
    let directions: Vec<usize> = (0..plan.layout.len()).filter(|p| own(&plan.layout.keys[*p])).collect();
    let request = Request { gradient: Wanted::All, sensitivities: directions.clone() };
    // The second member's marker sits elsewhere again.
    let mut other = plan.theta.clone();
    other[directions[1]] += 0.01;
    let rows = ParamBatch::from_rows(&[plan.theta.clone(), other]);
    let mut cpu = Rollout::new(CpuBackend, &plan, 2).unwrap_or_else(|e| panic!("{e}"));
    let right = cpu.evaluate(&rows, &request);
    let mut rollout = Rollout::new(GpuBackend::on(gpu), &plan, 2).unwrap_or_else(|e| panic!("{e}"));
    let found = rollout.evaluate(&rows, &request);
    for (a, b) in found.iter().zip(&right) {
        assert!(b.failure.is_none() && b.matched > 100, "{b:?}");
        assert_agreement(a, b, &directions);
    }
    let lin = cpu.linearise(&plan.theta, &directions).unwrap_or_else(|e| panic!("{e}"));
    let rows = rollout.linearise(&plan.theta, &directions).unwrap_or_else(|e| panic!("{e}"));
    let d = apart(&rows, &lin, &plan);
    assert!(d.iter().all(|d| *d < 1e-3), "{d:?}");
    // One percent more in every component shows.
    let mut wrong = plan.theta.clone();
    directions[1..].iter().for_each(|p| wrong[*p] *= 1.01);
    let wrong = rollout.linearise(&wrong, &directions).unwrap_or_else(|e| panic!("{e}"));
    assert!(apart(&wrong, &lin, &plan)[0] > 1e-3);
}

pub(crate) fn effect(kind: &str, values: &[(usize, f64)]) -> Effect {
    let mut effect = Effect::absent(find(kind).unwrap_or_else(|| panic!("{kind}")));
    values.iter().for_each(|(slot, v)| effect.values[*slot] = Some(*v));
    effect
}

#[test]
fn readings_that_are_off_are_those_of_the_cpu() {
    let Some(gpu) = device(None) else { return };
    let mut scene = ball(0.03);
    scene.time.steps = 2;
    scene.observation = watched();
    scene.effects = vec![
        effect("depth-bias", &[(0, 4e-3)]),
        effect("camera-pose", &[(0, 1.0), (1, 3e-3), (3, -2e-3), (4, 0.004), (5, -0.003), (6, 0.002)]),
        effect("depth-bias-part", &[(0, 5e-3), (2, 0.5), (3, 0.3)]),
        effect("depth-scale", &[(0, 0.01)]),
        effect("depth-along-ray", &[(0, 0.2)]),
    ];
    let plan = seen(&scene);
    let own = |k: &ParamKey| match *k {
        ParamKey::Effect { law, slot, .. } => {
            !matches!(ALL[usize::from(law)].params[usize::from(slot)].default, Unstated::Choice(_))
        }
        ParamKey::YoungsModulus => true,
        _ => false,
    };
    let directions: Vec<usize> = (0..plan.layout.len()).filter(|p| own(&plan.layout.keys[*p])).collect();
    let request = Request { gradient: Wanted::All, sensitivities: directions.clone() };
    let mut other = plan.theta.clone();
    other[directions[1]] *= 1.5;
    other[directions[3]] *= 1.2;
    let rows = ParamBatch::from_rows(&[plan.theta.clone(), other]);
    let mut cpu = Rollout::new(CpuBackend, &plan, 2).unwrap_or_else(|e| panic!("{e}"));
    let right = cpu.evaluate(&rows, &request);
    let mut rollout = Rollout::new(GpuBackend::on(gpu), &plan, 2).unwrap_or_else(|e| panic!("{e}"));
    let found = rollout.evaluate(&rows, &request);
    for (a, b) in found.iter().zip(&right) {
        assert!(b.failure.is_none() && b.matched > 100, "{b:?}");
        assert_agreement(a, b, &directions);
    }
    let lin = cpu.linearise(&plan.theta, &directions).unwrap_or_else(|e| panic!("{e}"));
    let d = apart(&rollout.linearise(&plan.theta, &directions).unwrap_or_else(|e| panic!("{e}")), &lin, &plan);
    println!("{d:?}");
    assert!(d.iter().all(|d| *d < 1e-3), "{d:?}");
    // One percent of each effect's first number.
    for (p, key) in plan.layout.keys.iter().enumerate() {
        if matches!(*key, ParamKey::Effect { slot: 0, .. }) {
            let p = if own(key) { p } else { p + 1 };
            let mut wrong = plan.theta.clone();
            wrong[p] *= 1.01;
            let wrong = rollout.linearise(&wrong, &directions).unwrap_or_else(|e| panic!("{e}"));
            assert!(apart(&wrong, &lin, &plan)[0] > 1e-3, "{}", plan.layout.keys[p].spec().path);
        }
    }
}
