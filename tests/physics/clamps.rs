//! Clamps that move: what they hold follows, and what hangs on them is turned as a rigid body.

use glam::{DQuat, DVec3};
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::plan::clamp_pose;
use palpate_model::plan::scheme;
use palpate_model::scene::*;
use support::{run, scenes};

/// So little mass that inertia is a rounding error beside the clamp's stiffness: ρ/Δt² over 10 (λ + 2μ)/h² is 1e-17.
const MASSLESS: f64 = 1e-12;

/// A body of E = 5 kPa off the lattice, solved to rounding.
fn body(density: f64, steps: usize) -> Scene {
    let shape = Analytic::Box { min: DVec3::new(-0.031, -0.012, -0.013), max: DVec3::new(0.033, 0.011, 0.014) };
    let mut s = scenes::body(shape, 0.01);
    s.material.inertia = Inertia::Density(density);
    s.time = Time { step: 0.01, steps, start: 0.0, ..Time::weighted(0.6) };
    s.solver.tolerance = 1e-13;
    s
}

/// A motion given at every step, that begins with rest.
fn motion(time: &Time, pose: impl Fn(f64) -> (DQuat, DVec3)) -> Option<RigidMotion> {
    let times: Vec<f64> = (0..=time.steps).map(|k| k as f64 * time.step).collect();
    let (rotations, translations) = times.iter().map(|t| pose(*t)).unzip();
    Some(RigidMotion { times, translations, rotations })
}

/// Largest distance between nodes and where the first clamp's motion takes them from `from`, over all steps [m].
fn worst(s: &Scene, from: impl Fn(DVec3, DVec3) -> DVec3) -> f64 {
    let plan = scenes::plan(s);
    let states = run::states(&plan);
    let off = |k: usize| {
        let (turn, shift) = clamp_pose(plan.clamps[0].motion.as_ref(), k as f64 * s.time.step);
        let (first, now) = (&states[0].displacement, &states[k].displacement);
        let node = |i: usize| {
            let x = plan.body.nodes[i];
            (x + now[i] - turn * from(x, first[i]) - shift).length()
        };
        (0..plan.body.nodes.len()).map(node).fold(0.0, f64::max)
    };
    (0..=s.time.steps).map(off).fold(0.0, f64::max)
}

#[test]
fn a_body_that_is_clamped_whole_follows_the_clamp() {
    // At constant velocity with its full mass, and turned and shifted with hardly any.
    let velocity = DVec3::new(0.3, -0.2, 0.5);
    let straight = |t: f64| (DQuat::IDENTITY, velocity * t);
    let axis = DVec3::new(0.3, 1.0, -0.4).normalize();
    let winding =
        |t: f64| (DQuat::from_axis_angle(axis, 20.0 * t), DVec3::new((30.0 * t).sin(), t, 1.0 - (30.0 * t).cos()) * 0.1);
    let run = |scheme, density: f64, v: DVec3, pose: &dyn Fn(f64) -> (DQuat, DVec3)| {
        let mut s = body(density, 20);
        s.time.scheme = scheme;
        s.initial.velocity = v;
        let whole = Clamp::still(DVec3::splat(-1.0), DVec3::splat(1.0));
        s.clamps = vec![Clamp { motion: motion(&s.time, pose), ..whole }];
        worst(&s, |x, _| x)
    };
    for scheme in scheme::ALL {
        let (carried, wound) = (run(scheme, 1000.0, velocity, &straight), run(scheme, MASSLESS, DVec3::ZERO, &winding));
        let name = scheme.name;
        println!(
            "{name}: farthest from where the clamp takes it {carried:.1e} m in a line, {wound:.1e} m turned by four radians"
        );
        // Rounding of a displacement of 0.1 m, twenty steps long.
        assert!(carried < 1e-12 && wound < 1e-12, "{name}: {carried} m, {wound} m");
    }
}

#[test]
fn a_body_held_at_its_ends_is_turned_as_it_is() {
    // By two thirds of a turn in forty steps, and carried along: held at one end and therefore unstrained, or bent and twisted by a clamp
    // at its other end as well. Hardly any mass: what holds it is all that acts.
    let turn = |t: f64| (DQuat::from_axis_angle(DVec3::new(0.2, 0.1, 1.0).normalize(), 10.0 * t), DVec3::new(0.2, -0.1, 0.3) * t);
    let bend = (DQuat::from_axis_angle(DVec3::new(1.0, 1.0, 0.0).normalize(), 0.3), DVec3::new(-0.002, 0.004, 0.006));
    let ends = [(-1.0, -0.022), (0.022, 1.0)].map(|(a, b)| Clamp::still(DVec3::new(a, -1.0, -1.0), DVec3::new(b, 1.0, 1.0)));
    for held in [1, 2] {
        let mut s = body(MASSLESS, 40);
        s.initial.state = InitialShape::StaticEquilibrium;
        s.solver.tolerance = 1e-11;
        let bent = |t: f64| (turn(t).0 * bend.0, turn(t).0 * bend.1 + turn(t).1);
        let motions = [motion(&s.time, turn), motion(&s.time, bent)];
        s.clamps = ends.iter().zip(motions).take(held).map(|(e, motion)| Clamp { motion, ..e.clone() }).collect();
        let plan = scenes::plan(&s);
        let strained = run::states(&plan)[0].displacement.iter().map(|u| u.length()).fold(0.0, f64::max);
        let off = worst(&s, |x, u| x + u);
        println!("held at {held} ends: {strained:.1e} m bent; farthest from the turned shape {off:.1e} m");
        assert!((strained > 0.006) == (held == 2), "{strained} m");
        // Every step is solved to 1e-11 of the forces involved, in a norm in which the stiffness has a condition number of a few
        // hundred (`cut.rs`): 1e-11 · 200 of the body's 6 cm.
        assert!(off < 1.2e-10, "{off} m");
    }
}

#[test]
fn what_a_clamp_holds_does_not_depend_on_the_stiffness() {
    // With loads that grow like E and time that passes like 1/√E the equations are the same up to a factor, if Nitsche's penalty grows
    // like E as well: a fixed one is too soft for 1e7 Pa, where the body gives way at the clamp, and needless at 1e3 Pa.
    let moved = |e: f64, state: InitialShape| {
        let mut s = body(1000.0, 12);
        let times = e / 5000.0;
        s.material.youngs_modulus = e;
        s.material.mass_damping = 2.0 * times.sqrt();
        s.time.step = 0.005 / times.sqrt();
        s.gravity = DVec3::new(0.3, -0.5, -2.0) * times;
        s.initial.velocity = DVec3::new(0.02, 0.05, 0.1) * times.sqrt();
        s.initial.state = state;
        // Its edge is in the middle of cells.
        s.clamps = vec![Clamp::still(DVec3::splat(-1.0), DVec3::new(-0.0165, 1.0, 1.0))];
        let states = run::states(&scenes::plan(&s));
        states.into_iter().map(|s| s.displacement).collect::<Vec<_>>()
    };
    for state in [InitialShape::Rest, InitialShape::StaticEquilibrium] {
        let reference = moved(1e3, state);
        let largest = reference.iter().flatten().map(|u| u.length()).fold(0.0, f64::max);
        for e in [1e4, 1e5, 1e6, 1e7] {
            let scaled = moved(e, state);
            let nodes = reference.iter().flatten().zip(scaled.iter().flatten());
            let apart = nodes.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            println!("{state:?}, {e:.0e} Pa: {apart:.1e} m apart of {largest:.1e} m");
            // Every step is solved to 1e-13 of the forces, times a condition number of a few hundred (see above).
            assert!(largest > 1e-3 && apart < 1e-9 * largest, "{e} Pa: {apart} m of {largest} m");
        }
    }
}
