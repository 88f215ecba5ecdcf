//! Bodies in free space: falling, spinning, vibrating, and scenes that are turned as a whole.

use glam::{DAffine3, DMat3, DVec3};
use palpate_model::scene::*;
use support::{run, scenes};

fn block() -> Scene {
    // Faces off the lattice: cut cells and ghost penalty take part.
    scenes::body(Analytic::Box { min: DVec3::new(-0.031, -0.022, -0.013), max: DVec3::new(0.033, 0.021, 0.014) }, 0.01)
}

#[test]
fn free_fall_follows_the_schemes_closed_form() {
    for theta in [0.5, 0.6, 0.9] {
        let mut s = block();
        s.gravity = DVec3::new(0.3, -9.81, 1.0);
        s.material.stiffness_damping = 0.01;
        s.time = Time { step: 0.01, steps: 20, start: 0.0, ..Time::weighted(theta) };
        let plan = scenes::plan(&s);
        let states = run::states(&plan);
        for (k, state) in states.iter().enumerate() {
            let k = k as f64;
            // v grows by gΔt a step and u by Δt (θ v₁ + (1−θ) v₀); ½ g t² at θ = ½.
            let expected = s.gravity * s.time.step.powi(2) * (0.5 * k * (k + 1.0) - (1.0 - theta) * k);
            let worst = state.displacement.iter().map(|u| (*u - expected).length()).fold(0.0, f64::max);
            assert!(worst <= 1e-10 * expected.length().max(1e-3), "θ = {theta}, step {k}: {worst:.1e} m off");
        }
    }
}

/// Relative loss of angular momentum over one turn with so many steps.
fn loss(steps: usize, theta: f64) -> f64 {
    let mut s = block();
    // One turn a second; stiff enough that centrifugal stretch stays small.
    s.material.youngs_modulus = 2.0e4;
    s.initial.angular_velocity = DVec3::new(0.0, 0.0, std::f64::consts::TAU);
    s.time = Time { step: 1.0 / steps as f64, steps, start: 0.0, ..Time::weighted(theta) };
    let plan = scenes::plan(&s);
    let m = run::masses(&plan, 1000.0);
    let states = run::states(&plan);
    let l = |k: usize| run::angular_momentum(&plan, &m, &states[k]);
    (l(steps) - l(0)).length() / l(0).length()
}

#[test]
fn spinning_body_keeps_its_angular_momentum() {
    let (coarse, fine) = (loss(50, 0.5), loss(100, 0.5));
    println!("angular momentum lost in a turn: {coarse:.2e} at 50 steps, {fine:.2e} at 100");
    assert!(fine < 0.01, "{fine}");
    assert!(fine < 0.6 * coarse, "converging");
}

#[test]
fn the_default_theta_slows_a_spin_in_proportion_to_the_step() {
    // θ = 0.6 is what scenes have by default.
    let (coarse, fine) = (loss(50, 0.6), loss(100, 0.6));
    println!("angular momentum lost in a turn at θ = 0.6: {coarse:.2e} at 50 steps, {fine:.2e} at 100");
    assert!(fine < 0.6 * coarse, "converging");
    // A spin loses more than a vibration of its frequency, whose amplitude the scheme takes by 1 − exp(−(2π)² (θ − ½)/n) in n steps, 4 %
    // of 100: stretched by what turns it, the body gives way as well. Who needs the spin takes θ = ½ or shorter steps.
    let vibration = |n: f64| 1.0 - (-std::f64::consts::TAU.powi(2) * 0.1 / n).exp();
    for (lost, n) in [(coarse, 50.0), (fine, 100.0)] {
        assert!(lost > 0.5 * vibration(n) && lost < 2.2 * vibration(n), "{lost} in {n} steps");
    }
}

#[test]
fn undamped_vibration_keeps_its_energy() {
    // A block without weight strikes a plane with its whole face and flies off vibrating.
    let mut s = block();
    s.material.youngs_modulus = 5.0e4;
    s.planes = vec![scenes::plane(DVec3::new(0.0, 0.0, -0.0137), DVec3::Z)];
    s.initial.velocity = DVec3::new(0.0, 0.0, -0.05);
    // The first stretching mode along the longest side; 24 steps a period, 50 periods after the contact.
    let period = 2.0 * 0.064 / (5.0e4f64 / 1000.0).sqrt();
    let contact = 150;
    s.time = Time { step: period / 24.0, steps: contact + 1200, start: 0.0, ..Time::weighted(0.5) };
    s.solver.tolerance = 1e-10;
    let plan = scenes::plan(&s);
    let m = run::masses(&plan, 1000.0);
    let states = run::states(&plan);
    let kinetic = |k: usize| -> f64 { m.iter().zip(&states[k].velocity).map(|(m, v)| 0.5 * m * v.length_squared()).sum() };
    let elastic = |k: usize| support::energy::elastic(&plan, &s, &states[k].displacement);
    // What vibrates is what is left of the kinetic energy without the motion of the centre of mass.
    let total: f64 = m.iter().sum();
    let flight = |k: usize| 0.5 * run::momentum(&m, &states[k]).length_squared() / total;
    let energy = |k: usize| kinetic(k) + elastic(k);
    let inner = energy(contact) - flight(contact);
    let strained = (contact..contact + 1200).map(elastic).fold(0.0, f64::max);
    let worst = (contact..=contact + 1200).step_by(20).map(|k| (energy(k) - energy(contact)).abs() / inner).fold(0.0, f64::max);
    println!("inner energy {inner:.2e} J, strained at most {strained:.2e} J, at worst {worst:.1e} of it off in 50 periods");
    let height =
        |k: usize| plan.body.nodes.iter().zip(&states[k].displacement).map(|(x, u)| (*x + *u).z).fold(f64::INFINITY, f64::min);
    assert!((contact..=contact + 1200).all(|k| height(k) > -0.0207 + 0.001), "it has left the plane");
    assert!(strained > 0.05 * inner, "it vibrates");
    assert!(worst < 0.01);
}

#[test]
fn turned_scene_gives_the_turned_result() {
    let make = |turn: DMat3| {
        let mut s = block();
        s.object.pose = DAffine3::from_mat3(turn);
        s.gravity = turn * DVec3::new(1.0, -3.0, -9.0);
        s.initial.angular_velocity = turn * DVec3::new(3.0, 1.0, 5.0);
        s.planes = vec![scenes::plane(turn * DVec3::new(0.0, 0.0, -0.02), turn * DVec3::new(0.1, 0.0, 1.0))];
        s.time = Time { step: 0.005, steps: 20, start: 0.0, ..Time::weighted(0.6) };
        s.solver.tolerance = 1e-12;
        let plan = scenes::plan(&s);
        let end = run::states(&plan).pop().unwrap();
        (plan, end)
    };
    let (plan, end) = make(DMat3::IDENTITY);
    // A third of a turn about (1, 1, 1) maps the lattice onto itself. What is left comes from the edges of the box, where the
    // signed distance is not linear and the tetrahedra that cells are divided into see it from another side.
    let third = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X);
    let (turned, turned_end) = make(third);
    assert_eq!(plan.body.nodes.len(), turned.body.nodes.len());
    for i in 0..plan.body.nodes.len() {
        let j = run::nearest(&turned, third * plan.body.nodes[i]);
        let off = (third * end.displacement[i] - turned_end.displacement[j]).length();
        assert!(off < 1e-4 * end.displacement[i].length().max(0.01), "node {i}: {off:.1e}");
    }
    // Any other turn cuts the cells differently: the motion of the centre of mass agrees within the discretisation. Free flight, most
    // of that motion, is the same to 1e-10; what the contact adds depends on how cells are cut, to first order in their size. A block of
    // three cells' thickness shows a tenth of a per cent.
    let skew = DMat3::from_rotation_x(0.5) * DMat3::from_rotation_z(0.3);
    let (other, other_end) = make(skew);
    let center = |plan: &palpate_model::plan::Plan, u: &[DVec3]| -> DVec3 {
        plan.body.node_volume.iter().zip(u).map(|(w, u)| *w * *u).sum::<DVec3>() / plan.body.volume
    };
    let a = skew * center(&plan, &end.displacement);
    let b = center(&other, &other_end.displacement);
    println!("turned askew: {:.5} of the motion off", (a - b).length() / a.length());
    assert!((a - b).length() < 0.003 * a.length(), "{a} {b}");
}
