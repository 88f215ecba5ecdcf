//! What other programs build on: recordings and values without files, and the cost of a fit as a function.

use glam::DVec3;
use palpate::render::Sensor;
use palpate::synthetic::{Observers, observe};
use palpate::{Backend, Coordinates, Error, Experiment, FitOptions, Interrupt, Objective};
use palpate_engine::Misfit;
use palpate_io::recording::Recording;
use palpate_io::write_recording;
use palpate_model::observation::ReadingKind;
use std::ops::ControlFlow;

const BAR: &str = concat!(include_str!("bar.toml"), include_str!("bar-fit.toml"));

fn bar() -> Experiment {
    Experiment::from_toml(BAR, "bar.toml").unwrap_or_else(|e| panic!("{e}"))
}

fn recording() -> Recording {
    let observers = Observers {
        cameras: Vec::new(),
        markers: Vec::new(),
        points: (0..8).map(|k| DVec3::new(0.02 + 0.012 * f64::from(k), 0.005 + 0.02 * f64::from(k % 2), 0.03)).collect(),
        displacements: true,
        times: (1..=12).map(|k| 0.01 * f64::from(k)).collect(),
        sensor: Sensor { noise: 2e-4, dropout: 0.1, depth_scale: 1e-3, seed: 4 },
    };
    observe(&bar(), Backend::Cpu, &observers, |_| ControlFlow::Continue(())).unwrap_or_else(|e| panic!("{e}"))
}

fn seen() -> Experiment {
    bar().with_recording(recording(), Some(vec![ReadingKind::Track])).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_recording_in_memory_is_fitted_with_the_bits_of_its_files() {
    let folder = tempfile::tempdir().expect("a folder");
    write_recording(folder.path().join("seen"), &recording()).unwrap_or_else(|e| panic!("{e}"));
    let text = format!("{BAR}\n[observation]\nrecording = \"seen\"\ncost = \"points\"\n");
    let filed = Experiment::from_toml(&text, folder.path().join("bar.toml")).unwrap_or_else(|e| panic!("{e}"));
    let held = seen();
    let fit = |e: &Experiment| {
        let mut f = e.fit(FitOptions { backend: Backend::Cpu, ..FitOptions::default() }).unwrap_or_else(|e| panic!("{e}"));
        // Finer cells ask for the recording again.
        f.check_grid(std::slice::from_ref(e), Backend::Cpu, &Interrupt::default());
        assert!(f.grid.is_some(), "{:?}", f.warnings);
        (0..2).map(|i| (f.headline(i).value.to_bits(), f.headline(i).parts.map(|p| p.total().to_bits()))).collect::<Vec<_>>()
    };
    assert_eq!(fit(&held), fit(&filed));
    // Who does not say what counts means all that there is.
    let all = bar().with_recording(recording(), None).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(all.scene().observation.as_ref().map(|o| o.costs.len()), Some(2));
    let e = held.with_recording(Recording::empty("", ""), None).expect_err("nothing is in it").to_string();
    assert_eq!(e, "<arrays>: observation.recording holds nothing that could be compared");
}

#[test]
fn other_values_keep_the_recording() {
    let held = seen();
    let softer = held.with_values(&[("material.youngs_modulus".into(), 3.0e4)]).unwrap_or_else(|e| panic!("{e}"));
    let held_frames = |e: &Experiment| format!("{:?}", e.plan().observation.frames);
    assert_eq!(held_frames(&softer), held_frames(&held));
    assert_eq!((softer.plan().theta[0], held.plan().theta[0]), (3.0e4, 6.0e4));
    let at = held.at(&softer.plan().theta).unwrap_or_else(|e| panic!("{e}"));
    let end = |e: &Experiment| {
        let motion = e.simulate(Backend::Cpu).unwrap_or_else(|e| panic!("{e}"));
        motion.snapshots.last().map(|s| (s.displacement.clone(), s.velocity.clone()))
    };
    assert_eq!(end(&at), end(&softer));
    assert!(held.at(&[1.0]).is_err());
    let e = held.with_values(&[("material.youngs".into(), 3.0e4)]).expect_err("no such key").to_string();
    assert!(e.starts_with("bar.toml:") && e.contains("did you mean"), "{e}");
}

#[test]
fn a_simulation_is_heard_compared_and_stopped() {
    let held = seen();
    let mut heard = Vec::new();
    let (motion, frames) = held
        .simulate_until(Backend::Cpu, &Interrupt::default(), |k, steps| heard.push((k, steps)))
        .unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(heard, (0..=12).map(|k| (k, 12)).collect::<Vec<_>>());
    assert_eq!(motion.snapshots.len(), 13);
    assert_eq!(frames.iter().map(|f| f.frame).collect::<Vec<_>>(), (0..12).collect::<Vec<_>>());
    let squares: f64 = frames.iter().flat_map(|f| &f.readings).filter_map(|r| r.misfit).map(Misfit::length_squared).sum();
    let count = frames.iter().map(|f| f.readings.len()).sum::<usize>();
    let summary = held.residuals(Backend::Cpu, &held.plan().theta).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(count, summary.points);
    // Sums in another order.
    assert!(((squares / count as f64).sqrt() / summary.rms - 1.0).abs() < 1e-12);
    let stop = Interrupt::default();
    let other = stop.clone();
    let stopped = held.simulate_until(Backend::Cpu, &stop, |k, _| {
        if k == 3 {
            other.raise();
        }
    });
    assert!(matches!(stopped, Err(Error::Interrupted)));
}

#[test]
fn the_cost_of_a_fit_has_its_gradient_in_both_coordinates() {
    let both = [seen(), seen().with_values(&[("world.gravity.z".into(), -9.7)]).unwrap_or_else(|e| panic!("{e}"))];
    let new = |c| Objective::new(&both, Backend::Cpu, c).unwrap_or_else(|e| panic!("{e}"));
    let (mut plain, mut scaled) = (new(Coordinates::Physical), new(Coordinates::Scaled));
    assert_eq!(plain.names(), ["material.youngs_modulus", "material.stiffness_damping"]);
    assert_eq!((plain.units(), plain.start()), (vec!["Pa".to_string(), "s".into()], vec![6.0e4, 0.004]));
    let x = [7.0e4, 0.006];
    let (cost, gradient) = plain.value_and_gradient(&x).unwrap_or_else(|e| panic!("{e}"));
    let z = scaled.coordinates_of(&x);
    let (same, by_z) = scaled.value_and_gradient(&z).unwrap_or_else(|e| panic!("{e}"));
    // There and back through a logarithm.
    assert!((same / cost - 1.0).abs() < 1e-9, "{same} {cost}");
    for i in 0..2 {
        // Central differences over a thousandth of the value: their error is a millionth of the third derivative.
        let at = |factor: f64| plain_at(&x, i, factor);
        let ahead = plain.value(&at(1.001)).unwrap_or_else(|e| panic!("{e}"));
        let behind = plain.value(&at(0.999)).unwrap_or_else(|e| panic!("{e}"));
        let difference = (ahead - behind) / (0.002 * x[i]);
        assert!((difference / gradient[i] - 1.0).abs() < 1e-4, "{i}: {difference} {}", gradient[i]);
        // Both are fitted as logarithms: dJ/dz = v dJ/dv.
        assert!((by_z[i] / (x[i] * gradient[i]) - 1.0).abs() < 1e-9, "{i}: {} {}", by_z[i], gradient[i]);
    }
    let (_, curvature) = plain.gradient_and_curvature(&x).unwrap_or_else(|e| panic!("{e}"));
    assert!(curvature[0] > 0.0 && curvature[3] > 0.0 && curvature[1] == curvature[2]);
}

fn plain_at(x: &[f64; 2], i: usize, factor: f64) -> Vec<f64> {
    let mut at = x.to_vec();
    at[i] *= factor;
    at
}

#[test]
fn a_cost_says_what_is_wrong_and_goes_on_after_an_interrupt() {
    let mut cost = Objective::new(&[seen()], Backend::Cpu, Coordinates::Physical).unwrap_or_else(|e| panic!("{e}"));
    let said = |e: Result<f64, Error>| e.expect_err("it is refused").to_string();
    assert!(said(cost.value(&[1.0])).contains("1 values are given, 2 are free: material.youngs_modulus"));
    assert_eq!(said(cost.value(&[1e4, f64::NAN])), "material.stiffness_damping is NaN, which is not finite");
    let stop = Interrupt::default();
    stop.raise();
    cost.until(&stop);
    assert!(matches!(cost.value(&[6e4, 0.004]), Err(Error::Interrupted)));
    cost.until(&Interrupt::default());
    assert!(cost.value(&[6e4, 0.004]).is_ok_and(f64::is_finite));
    let e = Objective::new(&[bar()], Backend::Cpu, Coordinates::Physical).map(|_| ()).expect_err("no recording").to_string();
    assert!(e.contains("bar.toml: observation is missing"), "{e}");
}
