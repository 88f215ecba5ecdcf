//! An observed point is not matched with a side that the camera cannot see: behind a thin part's middle it belongs to the front.

use super::gradients::check_some;
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::Rollout;
use palpate_model::effects::{ALL, Effect};
use palpate_model::observation::{Camera, Channel, Frame, Observation, ObservedPoint, ReadingKind};
use palpate_model::params::ParamKey;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::*;
use std::ops::ControlFlow;
use support::measured::compared;
use support::scenes;

/// A plate of 8 × 8 × 1.5 cells whose top is at z = 0.
fn plate() -> Scene {
    let mut s = scenes::body(Analytic::Box { min: DVec3::new(-0.04, -0.04, -0.015), max: DVec3::new(0.04, 0.04, 0.0) }, 0.01);
    s.time.steps = 1;
    s.observation = Some(compared(ReadingKind::Depth));
    s
}

/// Points seen by a camera in one frame.
fn seen(points: &[DVec3], center: DVec3, time: f64) -> Observation {
    Observation {
        cameras: vec![Camera::Pinhole { center, axis: -center.normalize() }],
        frames: vec![Frame {
            time,
            points: points.iter().map(|&position| ObservedPoint { position, camera: 0 }).collect(),
            ..Frame::default()
        }],
        channels: vec![Channel::new(ReadingKind::Depth, 2e-4)],
        ..Observation::default()
    }
}

/// Distances that points get from the plate, seen from straight above.
fn distances(points: &[DVec3]) -> Vec<Option<f64>> {
    let plan = build_plan(&plate(), seen(points, DVec3::new(0.0, 0.0, 5.0), 0.005), &[]).unwrap();
    let mut found = Vec::new();
    let theta = plan.theta.clone();
    Rollout::new(CpuBackend, &plan, 1)
        .unwrap()
        .visit(&theta, |_, _, r| {
            found.extend(r.into_iter().flat_map(|r| r.distances().collect::<Vec<_>>()));
            ControlFlow::Continue(())
        })
        .unwrap();
    found
}

#[test]
fn the_back_of_a_plate_belongs_to_its_front_and_an_edge_to_itself() {
    let d = distances(&[
        // Above the top, and inside nearer to the top: the front.
        DVec3::new(0.001, 0.002, 0.004),
        DVec3::new(0.001, 0.002, -0.003),
        // Inside nearer to the bottom, which the camera cannot see, and below it: the front again, four cells (the band) far at most.
        DVec3::new(0.001, 0.002, -0.013),
        DVec3::new(0.001, 0.002, -0.022),
        DVec3::new(0.001, 0.002, -0.042),
        // Beside a side wall, level with the plate: grazing, but not a back.
        DVec3::new(0.043, 0.002, -0.004),
        // Far above: outside the band.
        DVec3::new(0.0, 0.0, 0.2),
    ]);
    assert!((d[0].unwrap() - 0.004).abs() < 1e-4, "{d:?}");
    // The ridge of the signed distance, 0.75 cells down, is rounded off by the quadratic interpolation: up to h/16 there.
    assert!((d[1].unwrap() + 0.003).abs() < 7e-4, "{d:?}");
    // φ is exact at the front, and the line of sight leans by 4e-4.
    assert!((d[2].unwrap() + 0.013).abs() < 1e-6, "{d:?}");
    assert!((d[3].unwrap() + 0.022).abs() < 1e-6, "{d:?}");
    assert_eq!(d[4], None);
    assert!((d[5].unwrap() - 0.003).abs() < 5e-4, "{d:?}");
    assert_eq!(d[6], None);
}

#[test]
fn derivatives_of_points_that_belong_to_the_front_agree() {
    let mut s = plate();
    s.material.youngs_modulus = 2e4;
    s.initial.velocity = DVec3::new(0.1, -0.2, 0.3);
    s.initial.angular_velocity = DVec3::new(3.0, -5.0, 1.0);
    s.clamps = vec![Clamp::still(DVec3::new(-0.05, -0.05, -0.02), DVec3::new(-0.03, 0.05, 0.01))];
    s.time = Time { step: 0.01, steps: 3, start: 0.0, ..Time::weighted(0.6) };
    s.solver.tolerance = 1e-13;
    // A wrong camera moves points and lines of sight.
    let pose = ALL.iter().position(|l| l.kind == "camera-pose").unwrap();
    let mut effect = Effect::absent(pose);
    effect.values[1..].iter_mut().for_each(|v| *v = Some(2e-3));
    s.effects = vec![effect];
    let points: Vec<DVec3> = (0..49)
        .map(|i| {
            let (x, y) = (f64::from(i % 7) - 3.0, f64::from(i / 7) - 3.0);
            DVec3::new(0.0083 * x + 1e-3, 0.0079 * y, -0.0145 - 1.3e-3 * (1.7 * x + y).sin())
        })
        .collect();
    let plan = build_plan(&s, seen(&points, DVec3::new(0.4, -0.3, 1.5), 0.0262), &[]).unwrap();
    let mut behind = 0;
    Rollout::new(CpuBackend, &plan, 1)
        .unwrap()
        .visit(&plan.theta, |_, _, r| {
            // Nothing else is further than half the plate's thickness inside.
            behind = r.into_iter().flat_map(|r| r.distances().collect::<Vec<_>>()).flatten().filter(|d| *d < -0.008).count();
            ControlFlow::Continue(())
        })
        .unwrap();
    assert!(behind >= 10, "{behind} points belong to the front");
    check_some(&plan, "plate", |key| !matches!(key, ParamKey::Gravity(_)));
}
