//! Resting on the ground.

use glam::DVec3;
use palpate_cpu::terms::contact::touches;
use palpate_model::mechanics::contact;
use palpate_model::mechanics::plane::PlaneNow;
use palpate_model::scene::*;
use support::{run, scenes};

#[test]
fn contact_force_of_a_resting_body_is_its_weight() {
    let ball = || Analytic::Ball { radius: 0.04, center: DVec3::new(0.001, 0.002, 0.0405) };
    let block = || Analytic::Box { min: DVec3::new(-0.031, -0.022, 0.001), max: DVec3::new(0.033, 0.021, 0.043) };
    // On the new state alone, and along the way of each step.
    for (shape, theta) in [(ball(), 0.6), (block(), 0.6), (ball(), 0.5), (block(), 0.5)] {
        let mut s = scenes::body(shape, 0.012);
        s.gravity = DVec3::new(0.0, 0.0, -9.81);
        s.planes = vec![scenes::plane(DVec3::ZERO, DVec3::Z)];
        s.material.mass_damping = 40.0;
        s.material.stiffness_damping = 0.01;
        s.time = Time { step: 0.01, steps: 150, start: 0.0, ..Time::weighted(theta) };
        let plan = scenes::plan(&s);
        let end = run::states(&plan).pop().unwrap();
        let plane = PlaneNow {
            normal: [DVec3::Z; 3],
            height: 0.0,
            stiffness: contact::DEFAULT_STIFFNESS * 5000.0 / plan.body.length,
            scales: true,
        };
        // At rest both states of a step are the same.
        let touching = touches(&plan.body, &plane, theta, [&end.displacement; 2]);
        let force: f64 = touching.map(|(_, t)| t.area * t.pressure).sum();
        let weight = 1000.0 * plan.body.volume * 9.81;
        println!("contact force over weight at θ = {theta}: {:.6}", force / weight);
        assert!((force / weight - 1.0).abs() < 1e-3, "{force} N against {weight} N");
    }
}

#[test]
fn stiff_contact_limits_no_time_step() {
    // A penalty a thousand times the default, with a step fifty times the stability limit of an explicit one.
    let mut s = scenes::body(Analytic::Ball { radius: 0.04, center: DVec3::new(0.0, 0.0, 0.06) }, 0.012);
    s.gravity = DVec3::new(0.0, 0.0, -9.81);
    s.planes = vec![Plane { stiffness: Some(5000.0 / 0.012 * 1e4), ..scenes::plane(DVec3::ZERO, DVec3::Z) }];
    s.time = Time { step: 0.01, steps: 60, start: 0.0, ..Time::weighted(0.6) };
    let plan = scenes::plan(&s);
    let body = &plan.body;
    let states = run::states(&plan);
    let heights = states.iter().flat_map(|s| body.pieces().map(|(p, place)| (p.point + place.at(&s.displacement)).z));
    let lowest = heights.fold(f64::INFINITY, f64::min);
    println!("deepest point of a patch: {lowest:.2e} m");
    // A patch may dip in by the smoothing width (a twentieth of a cell), no more.
    assert!(lowest > -0.05 * 0.012, "nothing falls through: {lowest}");
    let m = run::masses(&plan, 1000.0);
    let total: f64 = m.iter().sum();
    let fastest = states.iter().map(|s| run::momentum(&m, s).length() / total).fold(0.0, f64::max);
    // The ball falls 2 cm before it touches, and dips in by a little more.
    assert!(fastest < 1.1 * (2.0f64 * 9.81 * 0.02).sqrt(), "no energy is made: {fastest} m/s");
}
