//! The comparison of observation kernels with the CPU sees one percent of whatever they are made of.

use super::residuals;
use super::tests::{MEMBERS, ball_plan, differences, expected, found, motion, observed, scene, upload, velocity};
use crate::GpuBackend;
use crate::tests::faults::Fault;
use crate::tests::scenes::device;
use glam::DVec3;
use palpate_cpu::costs::{Costs, Look, blend};
use palpate_engine::{Backend, Misfit, ParamBatch};
use palpate_model::cutcells::domain::Band;
use palpate_model::effects::sensors::Sensors;
use palpate_model::observation::instant::instants;
use palpate_model::observation::{Observation, ReadingKind};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::scene::Analytic;
use std::sync::Arc;

fn band(plan: &mut Plan) -> &mut Band {
    &mut Arc::make_mut(&mut plan.body).band
}

fn seen(plan: &mut Plan) -> &mut Observation {
    Arc::make_mut(&mut plan.observation)
}

fn noise(plan: &mut Plan, kind: ReadingKind) {
    seen(plan).channels.iter_mut().filter(|c| c.kind == kind).for_each(|c| c.noise *= 1.01);
}

/// Faults of the comparison; the first three act on points and displacements, too.
pub(super) const FAULTS: [Fault; 6] = [
    ("weights of the extension", |p| band(p).values.iter_mut().for_each(|w| *w *= 1.01)),
    ("distances", |p| band(p).cells.iter_mut().for_each(|c| c.sdf.iter_mut().for_each(|d| *d *= 1.01))),
    ("width of the kernel", |p| p.band *= 1.01),
    ("noise of markers", |p| noise(p, ReadingKind::Marker)),
    ("noise of depth", |p| noise(p, ReadingKind::Depth)),
    ("stalk of a marker", |p| seen(p).markers[2].stalk *= 1.01),
];

#[test]
fn one_percent_of_everything_shows() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu);
    let right = ball_plan();
    let exact = expected(&right, 0);
    for (name, fault) in FAULTS {
        let mut wrong = right.clone();
        fault(&mut wrong);
        let off = differences(&found(&backend, &wrong, 1, None)[0], &exact);
        println!("{name}: {off:?}");
        assert!(!off.is_empty(), "1 % of {name} was not seen");
    }
}

#[test]
fn one_cell_and_flat_bodies_agree_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu);
    let one = Analytic::Box { min: DVec3::new(0.0, 0.0, 0.04), max: DVec3::new(0.04, 0.04, 0.08) };
    let flat = Analytic::Box { min: DVec3::new(-0.06, -0.05, 0.04), max: DVec3::new(0.07, 0.05, 0.065) };
    for (shape, h, each) in [(one, 0.04, 20), (flat, 0.02, 3)] {
        let right = observed(&scene(shape, h), &[], each);
        let exact: Vec<_> = (0..3).map(|m| expected(&right, m)).collect();
        for (m, (found, exact)) in found(&backend, &right, 3, None).iter().zip(&exact).enumerate() {
            let off = differences(found, exact);
            assert!(off.is_empty(), "h {h}, member {m}: {off:?}");
        }
        for (name, fault) in &FAULTS[..3] {
            let mut wrong = right.clone();
            fault(&mut wrong);
            for (m, (found, exact)) in found(&backend, &wrong, 3, None).iter().zip(&exact).enumerate() {
                assert!(!differences(found, exact).is_empty(), "h {h}, member {m}: 1 % of {name} was not seen");
            }
        }
    }
}

/// Largest difference of a single residual of the device, which has the plan `given`, over what it may be, and how many were compared.
fn single_residuals(backend: &GpuBackend, plan: &Plan, given: &Plan) -> (f64, usize) {
    let mut world = backend.build(given, 2).unwrap_or_else(|e| panic!("{e}"));
    let mut theta = vec![given.theta.clone(); 2];
    theta[1][given.layout.index(ParamKey::TimeStart)] = MEMBERS[1].0;
    backend.set_params(&mut world, &ParamBatch::from_rows(&theta));
    let (costs, sensors) = (Costs::new(plan, &plan.observation), Sensors::default());
    let (start, size) = MEMBERS[1];
    let (mut worst, mut compared) = (0.0f64, 0);
    for k in 0..plan.clock.steps {
        let (now, next) = (upload(&world, k), upload(&world, k + 1));
        let residuals = residuals(&world, k, [&now.0.buffer, &next.0.buffer], 1);
        let found = backend.gpu.waited(residuals).unwrap_or_else(|e| panic!("{e}"));
        let all = instants(&plan.recording(0), plan.clock.step, start, k);
        assert_eq!(found.iter().map(|f| f.frame).collect::<Vec<_>>(), all.iter().map(|i| i.frame).collect::<Vec<_>>());
        for (found, i) in found.iter().zip(&all) {
            let at = |k: usize, f: fn(f64, f64, DVec3) -> DVec3| -> Vec<DVec3> {
                plan.body.nodes.iter().map(|x| f(size, k as f64 * plan.clock.step, *x)).collect()
            };
            let u = blend(&i.value, [&at(k, motion), &at(k, velocity), &at(k + 1, motion), &at(k + 1, velocity)]);
            let look = Look { plan, observation: &plan.observation, sensors: &sensors, frame: i.frame };
            let right = costs.compare(look, u).residuals(look);
            assert_eq!(found.readings.len(), right.readings.len());
            compared += right.readings.len();
            // A thousandth of the noise is far above rounding (1e-7 of a cell) and far below what matters.
            let off = found.readings.iter().zip(&right.readings).map(|(a, b)| {
                assert_eq!((a.sensor, a.item, a.place), (b.sensor, b.item, b.place));
                let distance = match (a.misfit, b.misfit) {
                    (Some(Misfit::Distance(a)), Some(Misfit::Distance(b))) => (a - b).abs(),
                    (Some(Misfit::Offset(a)), Some(Misfit::Offset(b))) => (a - b).length(),
                    (None, None) => 0.0,
                    _ => f64::INFINITY,
                };
                distance / (1e-3 * plan.observation.noise(a.sensor.kind()))
            });
            // Not a number is a difference as well.
            worst = off.fold(worst, |w, d| if d > w || d.is_nan() { d } else { w });
        }
    }
    (worst, compared)
}

#[test]
fn residuals_of_single_points_and_markers_agree_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu);
    let plan = ball_plan();
    let (worst, compared) = single_residuals(&backend, &plan, &plan);
    assert!(worst < 1.0 && compared > 1000, "{worst} of {compared}");
    for (name, fault) in FAULTS.iter().filter(|f| !f.0.contains("noise") && !f.0.contains("kernel")) {
        let mut wrong = plan.clone();
        fault(&mut wrong);
        let (worst, _) = single_residuals(&backend, &plan, &wrong);
        println!("{name}: {worst:.1e}");
        assert!(worst.is_nan() || worst > 1.0, "1 % of {name} was not seen");
    }
}
