//! Points that belong to the front of a thin plate, against the CPU: the plate has swung less far than the one that was recorded, so that
//! points of the side which it swung away from lie behind its middle.

use super::fault_tests::FAULTS;
use super::rollout_tests::{assert_agreement, differences, seen_within, watched};
use super::rows_tests::{apart, effect};
use crate::GpuBackend;
use crate::tests::faults::{BALANCE, faulty};
use crate::tests::scenes::{device, held};
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, Linearised, ParamBatch, Request, Rollout, Wanted};
use palpate_model::effects::Effect;
use palpate_model::observation::{Camera, ReadingKind, kernel};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::scene::{Analytic, BodySource, InitialShape};

/// Thickness of the plate and size of a cell [m].
const THICK: f64 = 0.02;

/// A plate held at its top that swings along x, seen from both sides.
fn plate(effects: Vec<Effect>) -> Plan {
    let mut s = held(THICK);
    let (min, max) = (DVec3::new(-0.009, -0.03, 0.0), DVec3::new(THICK - 0.009, 0.03, 0.1));
    s.object.source = BodySource::Analytic(Analytic::Box { min, max });
    (s.planes, s.masses) = (Vec::new(), Vec::new());
    s.initial.state = InitialShape::Rest;
    s.initial.velocity = DVec3::new(1.0, 0.0, 0.0);
    s.time.steps = 3;
    s.observation = watched();
    s.effects = effects;
    // Readings that scatter: some of them lie behind the middle.
    seen_within(&s, 0.1)
}

/// Rows of fronts: no place of the plate lies deeper in it than half its thickness.
fn fronts(l: &Linearised) -> Vec<usize> {
    let deep = |r: f64| r < -0.55 * THICK;
    (0..l.rows.residuals.len()).filter(|i| l.rows.residuals[*i].value.is_some_and(deep)).collect()
}

fn check(plan: &Plan, keys: &[usize]) {
    let Some(gpu) = device(None) else { return };
    let speed = plan.layout.index(ParamKey::Velocity(0));
    let directions = [keys, &[plan.layout.index(ParamKey::YoungsModulus), speed]].concat();
    let request = Request { gradient: Wanted::All, sensitivities: directions.clone() };
    let rows: Vec<Vec<f64>> = [0.5, 0.3]
        .map(|factor| {
            let mut row = plan.theta.clone();
            row[speed] *= factor;
            row
        })
        .to_vec();
    let batch = ParamBatch::from_rows(&rows);
    let mut cpu = Rollout::new(CpuBackend, plan, 2).unwrap_or_else(|e| panic!("{e}"));
    let mut rollout = Rollout::new(GpuBackend::on(gpu.clone()), plan, 2).unwrap_or_else(|e| panic!("{e}"));
    let (found, exact) = (rollout.evaluate(&batch, &request), cpu.evaluate(&batch, &request));
    for fault in [&FAULTS[..2], &BALANCE[2..3]].concat() {
        let (wrong, rows) = faulty(plan, &rows, &fault);
        let mut rollout = Rollout::new(GpuBackend::on(gpu.clone()), &wrong, 2).unwrap_or_else(|e| panic!("{e}"));
        for (a, b) in rollout.evaluate(&ParamBatch::from_rows(&rows), &request).iter().zip(&exact) {
            let seen = differences(a, b, &directions);
            println!("1 % of {}: {seen:?}", fault.0);
            assert!(!seen.is_empty(), "1 % of {} was not seen", fault.0);
        }
    }
    for ((a, b), row) in found.iter().zip(&exact).zip(&rows) {
        assert!(b.failure.is_none() && b.matched > 100, "{b:?}");
        assert_agreement(a, b, &directions);
        let right = cpu.linearise(row, &directions).unwrap_or_else(|e| panic!("{e}"));
        let lin = rollout.linearise(row, &directions).unwrap_or_else(|e| panic!("{e}"));
        let places = fronts(&right);
        let d = apart(&lin, &right, plan);
        println!("{} fronts of {} points: {d:?}", places.len(), b.matched);
        assert!(places.len() >= 8, "{}", places.len());
        // As `rows_tests` has it: 3e-5 is found, and one percent of a front, which lies half the thickness deep, is 5e-2 of the noise.
        assert!(d.iter().all(|d| *d < 1e-3), "{d:?}");

        // Fronts that are wrong by one percent show, in residuals, derivatives and the cost.
        let mut wrong = lin.clone();
        places.iter().for_each(|i| wrong.rows.residuals[*i].value = right.rows.residuals[*i].value.map(|r| 1.01 * r));
        assert!(apart(&wrong, &right, plan)[0] > 1e-3);
        let (mut wrong, q) = (lin.clone(), directions.len());
        places.iter().for_each(|i| wrong.rows.sensitivity[i * q..(i + 1) * q].iter_mut().for_each(|d| *d *= 1.01));
        assert!(apart(&wrong, &right, plan)[2] > 1e-3);
        let (mut wrong, noise) = (a.clone(), plan.observation.noise(ReadingKind::Depth));
        let more = |r: f64| kernel::cost(1.01 * r, plan.band) - kernel::cost(r, plan.band);
        let by_fronts: f64 = places.iter().filter_map(|i| right.rows.residuals[*i].value).map(more).sum();
        wrong.cost += by_fronts / (noise * noise * plan.observation.residuals() as f64);
        assert_eq!(differences(&wrong, b, &directions).len(), 1, "1 % was not seen");
    }
}

#[test]
fn fronts_of_a_thin_plate_are_those_of_the_cpu_and_one_percent_shows() {
    check(&plate(Vec::new()), &[]);
}

/// Fronts are looked for along the recorded line of sight, whatever the effects on readings say.
#[test]
fn fronts_with_a_camera_that_stood_elsewhere_are_those_of_the_cpu() {
    let plan = plate(vec![effect("camera-pose", &[(0, 1.0), (2, 0.01), (6, 0.01)])]);
    let turned = |k: &ParamKey| matches!(*k, ParamKey::Effect { slot: 6, .. });
    let keys: Vec<usize> = (0..plan.layout.len()).filter(|p| turned(&plan.layout.keys[*p])).collect();
    check(&plan, &keys);
}

/// Without lines of sight the nearest side is the one that counts, and no point belongs to a front.
#[test]
fn points_without_lines_of_sight_are_those_of_the_cpu() {
    let Some(gpu) = device(None) else { return };
    let sighted = plate(Vec::new());
    let mut observation = (*sighted.observation).clone();
    observation.cameras.fill(Camera::Unknown);
    let plan = Plan { observation: observation.into(), ..sighted.clone() };
    let speed = plan.layout.index(ParamKey::Velocity(0));
    let mut row = plan.theta.clone();
    row[speed] *= 0.5;
    let directions = [plan.layout.index(ParamKey::YoungsModulus), speed];
    let right = |p: &Plan| {
        let mut cpu = Rollout::new(CpuBackend, p, 1).unwrap_or_else(|e| panic!("{e}"));
        cpu.linearise(&row, &directions).unwrap_or_else(|e| panic!("{e}"))
    };
    let mut rollout = Rollout::new(GpuBackend::on(gpu), &plan, 1).unwrap_or_else(|e| panic!("{e}"));
    let (found, exact) = (rollout.linearise(&row, &directions).unwrap_or_else(|e| panic!("{e}")), right(&plan));
    assert!(fronts(&exact).is_empty() && !fronts(&right(&sighted)).is_empty());
    // As above.
    let d = apart(&found, &exact, &plan);
    assert!(d.iter().all(|d| *d < 1e-3), "{d:?}");
}
