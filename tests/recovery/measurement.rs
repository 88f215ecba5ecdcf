//! Hidden measurement effects: a scene with the effect is recorded, a scene without its value finds it again, together with the
//! stiffness that it would otherwise bias.

use super::gauss_newton;
use glam::{DVec2, DVec3, Vec3Swizzles};
use palpate::Backend;
use palpate::Experiment;
use palpate::render::{Pinhole, Sensor};
use palpate::synthetic::{Observers, observe};
use palpate_io::recording::Recording;
use palpate_model::effects::{self, Effect, Unstated};
use palpate_model::observation::ReadingKind;
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::build::{PlanError, build_plan};
use palpate_model::scene::*;
use studies::paper::study::{self, Unknown};
use support::scenes;

/// A soft bar of 4 × 4 × 16 cm that stands out of a wall and hangs down by its weight, its tip by some 45°.
fn bar() -> Scene {
    let mut s = scenes::body(
        Analytic::Box { min: DVec3::new(0.0, -0.02, -0.02), max: DVec3::new(0.16, 0.02, 0.02) },
        // Not a divisor of the sides: cut cells.
        0.0135,
    );
    s.material.youngs_modulus = 30e3;
    s.gravity = DVec3::new(0.0, 0.0, -9.81);
    s.clamps = vec![Clamp::still(DVec3::new(-0.1, -0.1, -0.1), DVec3::new(0.02, 0.1, 0.1))];
    s.initial.state = InitialShape::StaticEquilibrium;
    s.time = Time { step: 1.0, steps: 0, start: 0.0, ..Time::weighted(0.6) };
    s
}

/// A ball that falls for 60 ms.
fn falling_ball() -> Scene {
    let mut s = scenes::body(Analytic::Ball { radius: 0.04, center: DVec3::ZERO }, 0.016);
    s.gravity = DVec3::new(0.0, 0.0, -9.81);
    s.initial.velocity = DVec3::new(0.8, 0.0, 0.0);
    s.time = Time { step: 0.01, steps: 6, start: 0.0, ..Time::weighted(0.5) };
    s
}

fn with(mut scene: Scene, kind: &str, values: &[(&str, &[f64])]) -> Scene {
    let mut effect = Effect::absent(effects::find(kind).expect("the effect exists"));
    for (key, numbers) in values {
        let first = effect.law().params.iter().position(|p| p.key == *key).expect("the parameter exists");
        numbers.iter().enumerate().for_each(|(a, v)| effect.values[first + a] = Some(*v));
    }
    scene.effects.push(effect);
    scene
}

/// Two cameras at 40 cm, wide enough that rays differ from the axis.
fn cameras() -> Vec<Pinhole> {
    let target = DVec3::new(0.07, 0.0, 0.0);
    [DVec3::new(0.12, -0.35, 0.2), DVec3::new(0.25, 0.2, 0.25)]
        .into_iter()
        .enumerate()
        .map(|(i, from)| {
            let camera = Pinhole::looking_at(target + from, target, DVec3::Z, 32.0, 36, 36).expect("a camera from the side");
            Pinhole { name: format!("cam{i}"), ..camera }
        })
        .collect()
}

const SENSOR: Sensor = Sensor { noise: 0.5e-3, dropout: 0.0, depth_scale: 1e-5, seed: 11 };

fn record(scene: &Scene, markers: Vec<(String, DVec3)>, times: Vec<f64>) -> Recording {
    record_with(SENSOR, scene, markers, times)
}

fn record_with(sensor: Sensor, scene: &Scene, markers: Vec<(String, DVec3)>, times: Vec<f64>) -> Recording {
    let experiment = Experiment::new(scene.clone(), String::new(), Vec::new()).unwrap();
    let cameras = if markers.is_empty() { cameras() } else { Vec::new() };
    let observers = Observers { cameras, markers, points: Vec::new(), displacements: false, times, sensor };
    observe(&experiment, Backend::Cpu, &observers, |_| std::ops::ControlFlow::Continue(())).unwrap()
}

/// Plan of a scene compared with a recording.
fn plan(scene: &Scene, recording: &Recording, cost: ReadingKind) -> Result<Plan, PlanError> {
    let spec = ObservationSpec::new("recording", vec![cost]);
    let (observation, rest) = recording.observation(&spec, &mut Vec::new()).unwrap();
    let scene = Scene { observation: Some(spec), ..scene.clone() };
    build_plan(&scene, observation, &rest)
}

/// Fits the effect's amplitudes (from absent) and, where asked, the stiffness (from 1.3 of the truth) to the recording; prints and
/// checks every value against the truth: within three standard errors or 5 %.
fn recovers(truth: &Scene, recording: &Recording, cost: ReadingKind, stiffness: bool) -> palpate_fit::FitResult {
    let plan = plan(truth, recording, cost).unwrap();
    let mut unknowns: Vec<Unknown> = Vec::new();
    for key in &plan.layout.keys {
        if let ParamKey::Effect { law, slot, .. } = *key
            && let Unstated::Absent(v) = effects::ALL[usize::from(law)].params[usize::from(slot)].default
        {
            unknowns.push(Unknown { key: *key, start: (v, v) });
        }
    }
    if stiffness {
        let e = 1.3 * truth.material.youngs_modulus;
        unknowns.push(Unknown { key: ParamKey::YoungsModulus, start: (e, e) });
    }
    let result = study::search(&plan, &unknowns, &gauss_newton(1)).unwrap();
    let largest = |u: &Unknown| plan.theta[plan.layout.index(u.key)].abs();
    for (p, u) in result.parameters.iter().zip(&unknowns) {
        let (truth, error) = (plan.theta[plan.layout.index(u.key)], p.standard_error.unwrap());
        println!("{} = {:.6} ± {error:.6} {}, truth {truth}", p.path, p.value, p.unit);
        assert!(
            (p.value - truth).abs() < (3.0 * error).max(0.05 * largest(u)),
            "{} = {} ± {error}, truth {truth}",
            p.path,
            p.value
        );
        // A value that is not told apart from none would pass whatever it is.
        assert!(truth == 0.0 || error < 0.2 * truth.abs(), "{} is not told: ± {error}", p.path);
    }
    result
}

/// A static recording of the bar.
fn bar_recovers(kind: &str, values: &[(&str, &[f64])]) {
    let truth = with(bar(), kind, values);
    recovers(&truth, &record(&truth, Vec::new(), vec![0.0]), ReadingKind::Depth, true);
}

#[test]
fn a_depth_bias() {
    bar_recovers("depth-bias", &[("bias", &[0.02])]);
}

#[test]
fn a_depth_scale() {
    bar_recovers("depth-scale", &[("error", &[-0.03])]);
}

#[test]
fn depth_along_the_ray() {
    bar_recovers("depth-along-ray", &[("blend", &[1.0])]);
}

#[test]
fn a_depth_bias_of_the_outer_half() {
    let place: &[(&str, &[f64])] = &[("bias", &[0.012]), ("direction", &[1.0, 0.0, 0.0]), ("position", &[0.09, 0.0, 0.0])];
    bar_recovers("depth-bias-part", place);
}

#[test]
fn the_second_cameras_pose() {
    let off: &[(&str, &[f64])] =
        &[("camera", &[1.0]), ("translation", &[0.012, -0.009, 0.01]), ("rotation", &[0.03, -0.02, 0.025])];
    bar_recovers("camera-pose", off);
}

#[test]
fn two_effects_at_once() {
    let truth = with(bar(), "depth-bias", &[("bias", &[-0.015])]);
    let truth = with(truth, "camera-pose", &[("translation", &[0.01, 0.008, -0.012]), ("rotation", &[0.03, 0.02, -0.03])]);
    recovers(&truth, &record(&truth, Vec::new(), vec![0.0]), ReadingKind::Depth, true);
}

#[test]
fn a_time_offset() {
    let truth = with(falling_ball(), "time-offset", &[("offset", &[0.013])]);
    let recording = record(&truth, Vec::new(), vec![0.013, 0.0255, 0.037, 0.048]);
    assert!((recording.frames[0].time - 0.026).abs() < 1e-12, "a clock that runs ahead stamps later");
    recovers(&truth, &recording, ReadingKind::Depth, false);
}

#[test]
fn a_marker_offset() {
    let truth = with(bar(), "marker-offset", &[("marker", &[2.0]), ("offset", &[0.004, -0.006, 0.005])]);
    let markers: Vec<(String, DVec3)> = [0.05, 0.09, 0.14].iter().map(|x| (format!("m{x}"), DVec3::new(*x, 0.0, 0.02))).collect();
    // Offsets are told to the noise of one reading: several readings of the same instant, as a static problem has them.
    let recording = record(&truth, markers, (0..40).map(|k| 0.01 * f64::from(k)).collect());
    recovers(&truth, &recording, ReadingKind::Marker, true);
}

#[test]
fn a_marker_offset_turns_with_the_body() {
    let offset = DVec3::new(0.004, -0.006, 0.005);
    let tip = || vec![("tip".to_string(), DVec3::new(0.14, 0.0, 0.02))];
    let exact = Sensor { noise: 0.0, ..SENSOR };
    let at = |scene: &Scene| record_with(exact, scene, tip(), vec![0.0]).markers.unwrap().samples[0].position;
    let moved = at(&with(bar(), "marker-offset", &[("offset", &offset.to_array())])) - at(&bar());
    println!("offset {offset} m at rest, {moved} m on the hanging bar");
    // A rotation about y, that of the line between two points beside it: lengths stay, and y too (the mirrored sides of the grid are
    // cut a little differently); between the points the bar bends by some hundredths of a radian.
    assert!((moved.length() - offset.length()).abs() < 1e-12 && (moved.y - offset.y).abs() < 1e-5);
    let turned = moved.xz().angle_to(offset.xz());
    let two = [0.13, 0.15].map(|x| (format!("m{x}"), DVec3::new(x, 0.0, 0.02))).to_vec();
    let line = record_with(exact, &bar(), two, vec![0.0]).markers.unwrap().samples;
    let bent = (line[1].position - line[0].position).xz().angle_to(DVec2::X);
    assert!((turned - bent).abs() < 0.05 && bent.abs() > 0.3, "turned by {turned}, the bar by {bent}");
}

#[test]
fn a_camera_or_marker_that_does_not_exist_is_named() {
    let none = with(bar(), "camera-pose", &[("camera", &[2.0])]);
    let seen = record(&bar(), Vec::new(), vec![0.0]);
    let error = |e: &dyn std::fmt::Display| e.to_string();
    let observers = Observers {
        cameras: cameras(),
        markers: Vec::new(),
        points: Vec::new(),
        displacements: false,
        times: vec![0.0],
        sensor: SENSOR,
    };
    let experiment =
        Experiment::new(none.clone(), String::new(), Vec::new()).expect("a scene that is only simulated has no camera");
    let observed = observe(&experiment, Backend::Cpu, &observers, |_| std::ops::ControlFlow::Continue(())).map(|_| ());
    let observed = error(&observed.expect_err("there are two cameras"));
    assert!(observed.contains("effect.0.camera: there is no camera number 2; they are 0 to 1"), "{observed}");
    let planned = error(&plan(&none, &seen, ReadingKind::Depth).expect_err("the recording has two cameras"));
    assert!(planned.contains("effect.0.camera: there is no camera number 2"), "{planned}");
    let marker = with(bar(), "marker-offset", &[]);
    let planned = error(&plan(&marker, &seen, ReadingKind::Depth).expect_err("the recording has no markers"));
    assert!(planned.contains("effect.0.marker: there is no marker"), "{planned}");
}
