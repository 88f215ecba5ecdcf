//! Hypotheses side by side are what each is by itself, in fewer batches; and recordings of one body are one batch.

use super::super::laps::fit;
use super::super::simulate::cost;
use super::*;
use crate::fitting::{self, FitOptions};
use crate::interrupt::{Clock, Interrupt};
use crate::render::Sensor;
use crate::synthetic::{Observers, observe};
use glam::DVec3;
use palpate_diagnose::{Fit, Start};
use palpate_model::effects::find;
use std::ops::ControlFlow;
use std::path::Path;

const BLOCK: &str = include_str!("../../tests/block.toml");
const FIT: &str = r#"
[fit]
[[fit.parameter]]
path = "material.youngs_modulus"
start = [2.0e4, 2.0e4]
"#;

/// A block whose corner is tracked while a wind blows, recorded twice; the second recording ends earlier.
fn recorded(folder: &Path) -> Vec<Experiment> {
    let wind = "[[effect]]\nkind = \"uniform-force\"\nforce = [0.0, 1500.0, 400.0]\n";
    let truth = Experiment::from_toml(&format!("{BLOCK}{wind}"), "scene.toml").unwrap();
    let (steps, step) = (truth.plan.clock.steps, truth.plan.clock.step);
    let places: Vec<DVec3> = truth.plan.body.patches.iter().step_by(7).map(|p| p.point).collect();
    let one = |(name, count, seed): (&str, usize, u64)| {
        let observers = Observers {
            cameras: Vec::new(),
            markers: Vec::new(),
            points: places.clone(),
            displacements: false,
            times: (1..=count).map(|k| k as f64 * step).collect(),
            sensor: Sensor { noise: 2e-4, dropout: 0.0, depth_scale: 5e-5, seed },
        };
        let recording = observe(&truth, Backend::Cpu, &observers, |_| ControlFlow::Continue(())).unwrap();
        let place = folder.join(name);
        palpate_io::write_recording(&place, &recording).unwrap();
        let shorter = BLOCK.replace(&format!("steps = {steps}"), &format!("steps = {count}"));
        let seen = format!("[observation]\nrecording = {:?}\ncost = \"points\"\n", place.display().to_string());
        Experiment::from_toml(&format!("{shorter}{seen}{FIT}"), folder.join(format!("{name}.toml"))).unwrap()
    };
    [("long", steps, 1), ("short", steps / 2, 2)].map(one).to_vec()
}

/// Changes of these kinds, with the numbers that they start from.
fn start(base: &[Experiment], kinds: &[&str]) -> Start {
    let changes: Vec<Change> = kinds.iter().map(|k| Change::Effect(Effect::absent(find(k).unwrap()))).collect();
    let values = prepare(base, &changes).unwrap().numbers().iter().map(|n| n.start).collect();
    Start { changes, values, reach: f64::INFINITY }
}

fn limits() -> Limits {
    Limits::new(&Interrupt::default(), &Clock::start(), None)
}

/// Two fits of one hypothesis have the same end.
fn assert_alike(a: &Fit, b: &Fit, share: f64) {
    let kinds = Change::kinds(&b.model.changes);
    assert!((a.cost - b.cost).abs() <= share * b.cost, "{kinds}: {} and {}", a.cost, b.cost);
    for ((x, y), n) in a.model.values.iter().zip(&b.model.values).zip(&b.model.numbers) {
        // Numbers that readings hardly know may lie anywhere within their errors.
        assert!((x - y).abs() <= 1e2 * share * n.scale.max(y.abs()), "{kinds}, {}: {x} and {y}", n.path);
    }
}

#[test]
fn hypotheses_side_by_side_are_what_each_is_by_itself_in_fewer_batches() {
    let folder = tempfile::tempdir().unwrap();
    let base = recorded(folder.path());
    let kinds: [&[&str]; 5] = [&["uniform-force"], &["air-drag"], &[], &["uniform-force", "air-drag"], &["stiffness-gradient"]];
    let tries: Vec<Start> = kinds.iter().map(|k| start(&base, k)).collect();
    let all: Vec<&[Change]> = tries.iter().map(|t| t.changes.as_slice()).collect();
    let (effort, newton) = ((3, 1e-4), 1e-8);
    let lines: Vec<usize> = (0..tries.len()).collect();
    let limits = limits();
    let crowd = Crowd::new(&base, Backend::Cpu, &limits, &all, newton).unwrap_or_else(|e| panic!("{e}"));
    let one = |k: usize, physics| fit(&base, (Backend::Cpu, physics), &limits, &tries[k], effort, None).map(|f| f.0);
    let (found, counts) = crowd.run(&lines, |k, physics| one(k, Some(physics)));
    for (k, found) in found.into_iter().enumerate() {
        // The CPU adds what is absent in another order, and Newton's method stops at other last digits.
        assert_alike(&found.unwrap(), &one(k, None).unwrap(), 1e-5);
    }
    println!("{}", counts.told().unwrap());
    // Alone every hypothesis asks for both recordings at a time; nobody needs many more rounds than another.
    assert!(counts.simulations == 2 * counts.asks && 2 * counts.batches < counts.asks, "{counts:?}");
}

#[test]
fn a_device_computes_hypotheses_side_by_side() {
    if Backend::Gpu.check().is_err() {
        assert!(std::env::var("PALPATE_GPU").as_deref() != Ok("require"), "there is no device");
        return eprintln!("skipped: there is no device");
    }
    let folder = tempfile::tempdir().unwrap();
    let base = recorded(folder.path());
    let tries: Vec<(Vec<Change>, Vec<f64>)> = [&["uniform-force"][..], &["air-drag"], &["stiffness-gradient"]]
        .map(|k| start(&base, k))
        .map(|s| (s.changes, s.values.iter().map(|v| v + 1e-3).collect()))
        .to_vec();
    let all: Vec<&[Change]> = tries.iter().map(|t| t.0.as_slice()).collect();
    let limits = limits();
    let one = |backend| {
        let (base, limits, tries) = (&base, &limits, &tries);
        move |k: usize, physics| cost(base, (backend, physics), limits, &tries[k]).unwrap()
    };
    let (found, counts) = side_by_side((&base, Backend::Gpu, &limits), &all, 1e-8, &[0, 1, 2], one(Backend::Gpu));
    assert_eq!(counts, Counts { simulations: 6, asks: 3, batches: 1 });
    for (k, cost) in found.into_iter().enumerate() {
        let right = one(Backend::Cpu)(k, None);
        // Single precision.
        assert!((cost - right).abs() < 1e-3 * right, "{cost} and {right}");
    }
}

#[test]
fn recordings_of_one_body_are_one_batch_of_a_joint_fit() {
    let folder = tempfile::tempdir().unwrap();
    let base = recorded(folder.path());
    let joint = join(&[&base[0].plan, &base[1].plan]);
    assert!(joint.len() == 1 && joint[0].plan.recordings() == 2, "{} plans", joint.len());
    let options = || FitOptions { backend: Backend::Cpu, ..FitOptions::default() };
    let together = fitting::fit(&base, options()).unwrap();
    // Another width of the band does not matter to tracked points, but keeps the plans apart.
    let mut apart = base.clone();
    apart[1].plan.band *= 1.5;
    assert_eq!(join(&[&apart[0].plan, &apart[1].plan]).len(), 2);
    let apart = fitting::fit(&apart, options()).unwrap();
    assert_eq!(together.result.parameters, apart.result.parameters);
    assert_eq!((together.result.cost, together.result.theta), (apart.result.cost, apart.result.theta));
}

#[test]
fn auto_times_as_many_members_as_a_round_has_candidates() {
    let folder = tempfile::tempdir().unwrap();
    let base = recorded(folder.path());
    let statistics = palpate_diagnose::Options::default();
    let demand = super::super::demand(&base, &statistics).unwrap();
    assert_eq!((demand.starts, demand.places.len(), demand.compared), (statistics.search.fits * base.len(), 1, true));
}
