//! An observed point is not matched with a side that the camera cannot see.

use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::Rollout;
use palpate_model::observation::{Camera, Frame, Observation, ObservedPoint};
use palpate_model::plan_build::build_plan;
use palpate_model::scene::*;
use std::ops::ControlFlow;
use support::measured::compared;
use support::scenes;

/// Distances that points get from a plate of 8 × 8 × 1.5 cells whose top is at z = 0, seen from straight above.
fn distances(points: &[DVec3]) -> Vec<Option<f64>> {
    let h = 0.01;
    let mut s = scenes::body(Analytic::Box { min: DVec3::new(-0.04, -0.04, -0.015), max: DVec3::new(0.04, 0.04, 0.0) }, h);
    s.time.steps = 1;
    s.observation = Some(compared(CostKind::SparseSurface));
    let seen = points.iter().map(|&position| ObservedPoint { position, camera: 0 }).collect();
    let observation = Observation {
        cameras: vec![Camera { center: DVec3::new(0.0, 0.0, 5.0), axis: -DVec3::Z }],
        frames: vec![Frame { time: 0.005, points: seen, ..Frame::default() }],
        depth_noise: 2e-4,
        marker_noise: 1e-3,
        displacement_noise: 1e-3,
        ..Observation::default()
    };
    let plan = build_plan(&s, observation, &[]).unwrap();
    let mut found = Vec::new();
    let theta = plan.theta.clone();
    Rollout::new(CpuBackend, &plan, 1)
        .unwrap()
        .visit(&theta, |_, _, r| {
            found.extend(r.into_iter().flat_map(|r| r.points));
            ControlFlow::Continue(())
        })
        .unwrap();
    found
}

#[test]
fn the_back_of_a_plate_is_never_matched_and_an_edge_is() {
    let d = distances(&[
        // Above the top, and inside nearer to the top: the front.
        DVec3::new(0.001, 0.002, 0.004),
        DVec3::new(0.001, 0.002, -0.003),
        // Inside nearer to the bottom, and below it: only the back is near, and the camera cannot see it.
        DVec3::new(0.001, 0.002, -0.013),
        DVec3::new(0.001, 0.002, -0.022),
        // Beside a side wall, level with the plate: grazing, but not a back.
        DVec3::new(0.043, 0.002, -0.004),
        // Far above: outside the band.
        DVec3::new(0.0, 0.0, 0.2),
    ]);
    assert!((d[0].unwrap() - 0.004).abs() < 1e-4, "{d:?}");
    // The ridge of the signed distance, 0.75 cells down, is rounded off by the quadratic interpolation: up to h/16 there.
    assert!((d[1].unwrap() + 0.003).abs() < 7e-4, "{d:?}");
    assert_eq!(d[2], None);
    assert_eq!(d[3], None);
    assert!((d[4].unwrap() - 0.003).abs() < 5e-4, "{d:?}");
    assert_eq!(d[5], None);
}
