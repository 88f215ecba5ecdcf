//! Order of the schemes through the whole chain, from a scene to the states of a rollout: a beam that swings in a moving clamp.

use glam::{DAffine3, DQuat, DVec3};
use palpate_engine::Snapshot;
use palpate_model::materials;
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::plan::clamp_pose;
use palpate_model::plan::scheme;
use palpate_model::scene::*;
use support::{run, scenes, tets};

/// Time after which states are compared [s]: about a period of the slowest bending.
const END: f64 = 0.24;
/// Where the clamp ends [m].
const EDGE: f64 = 0.033;
/// Edge of the cubes that tetrahedra are made of [m]: two of them reach to the clamp's end.
const CUBE: f64 = 0.5 * EDGE;

/// A clamp that starts and ends without a jerk: sin⁴ of a half turn, in samples closer than any step here.
fn motion() -> RigidMotion {
    let times: Vec<f64> = (0..=4096).map(|k| k as f64 * END / 4096.0).collect();
    let part = |t: &f64| (std::f64::consts::PI * t / 0.2).sin().powi(4);
    RigidMotion {
        translations: times.iter().map(|t| part(t) * DVec3::new(0.002, 0.004, 0.01)).collect(),
        rotations: times.iter().map(|t| DQuat::from_axis_angle(DVec3::new(0.2, 1.0, 0.3).normalize(), 0.3 * part(t))).collect(),
        times,
    }
}

/// A beam of cut cells that hangs in the clamp, at rest.
fn beam(time: Time) -> Scene {
    let (min, max) = (DVec3::new(0.0, -0.011, -0.012), DVec3::new(0.113, 0.012, 0.011));
    let mut s = scenes::body(Analytic::Box { min, max }, 0.016);
    s.material.youngs_modulus = 5e4;
    s.material.mass_damping = 0.5;
    s.gravity = DVec3::new(0.3, -0.5, -4.0);
    s.clamps = vec![Clamp { motion: Some(motion()), ..Clamp::still(DVec3::splat(-1.0), DVec3::new(EDGE, 1.0, 1.0)) }];
    s.initial.state = InitialShape::StaticEquilibrium;
    s.time = time;
    // Far below the smallest error that is compared.
    s.solver.tolerance = 1e-11;
    s
}

/// The whole time in so many steps.
fn time(scheme: &'static scheme::Scheme, theta: f64, steps: usize) -> Time {
    Time { step: END / steps as f64, steps, start: 0.0, theta, scheme, open: None }
}

/// Distance of two states, in displacement [m] and in velocity [m/s], root mean square over nodes.
fn apart(a: &Snapshot, b: &Snapshot) -> [f64; 2] {
    let rms =
        |a: &[DVec3], b: &[DVec3]| (a.iter().zip(b).map(|(a, b)| a.distance_squared(*b)).sum::<f64>() / a.len() as f64).sqrt();
    [rms(&a.displacement, &b.displacement), rms(&a.velocity, &b.velocity)]
}

#[test]
fn every_scheme_has_its_order() {
    // The reference has a quarter of the shortest step and errors of 1/16 at least of what it is compared with; that alone takes 0.07 to
    // the order, and steps of finite length as much. A damper's force acts along the new state's rotation. Where a solve's forces act
    // between its ends (θ = ½, and in TR-BDF2's first part) that leaves a part of first order, small here beside the rest.
    for (damping, least) in [(0.0, 1.85), (0.002, 1.7)] {
        let last = |time: Time| {
            let mut s = beam(time);
            s.material.stiffness_damping = damping;
            run::states(&scenes::plan(&s)).pop().expect("there is a start")
        };
        let exact = last(time(scheme::find("tr-bdf2").expect("it is in the table"), 0.5, 1024));
        for scheme in scheme::ALL {
            let open = scheme.leaves_theta_open();
            for (theta, least, most) in [(0.5, least, 2.15), (1.0, 0.85, 1.15)].into_iter().take(if open { 2 } else { 1 }) {
                let errors = [64, 128, 256].map(|n| apart(&last(time(scheme, theta, n)), &exact));
                let order = |k: usize, part: usize| (errors[k][part] / errors[k + 1][part]).log2();
                // Velocities of the first halving are still on their way: backward Euler takes a quarter of an amplitude in a period there.
                let found = [order(0, 0), order(1, 0), order(1, 1)];
                println!("{} at θ = {theta}, damping {damping} s: errors {errors:?}, orders {found:.2?}", scheme.name);
                let meant = found.iter().all(|o| (least..most).contains(o));
                assert!(meant, "{} at θ = {theta}, damping {damping} s: orders {found:?}", scheme.name);
            }
        }
    }
}

#[test]
fn nodes_in_a_moving_clamp_are_where_it_is_after_every_step() {
    for scheme in scheme::ALL {
        for steps in [16, 64] {
            let mut s = beam(time(scheme, 0.5, steps));
            let source = tets::bar(DVec3::new(0.0, -CUBE, -CUBE), CUBE, [7, 2, 2]);
            s.object = Object { source, pose: DAffine3::IDENTITY, resolution: Resolution::Own };
            s.solver.tetrahedron = Tetrahedron::Linear;
            // Its derivatives have formulas: on tetrahedra several times as fast as the linear one.
            s.material.model = materials::find("neo-hookean").expect("it is in the table");
            s.material.stiffness_damping = 0.002;
            let plan = scenes::plan(&s);
            let held: Vec<usize> = plan.clamps[0].nodes.iter().map(|n| n.0 as usize).collect();
            assert_eq!(held.len(), 27);
            let states = run::states(&plan);
            // Farthest from where the clamp was a part of a step before.
            let off = |late: f64| {
                let after = |(k, state): (usize, &Snapshot)| {
                    let (turn, shift) = clamp_pose(plan.clamps[0].motion.as_ref(), (k as f64 - late) * plan.clock.step);
                    let node =
                        |n: &usize| (plan.body.nodes[*n] + state.displacement[*n] - turn * plan.body.nodes[*n] - shift).length();
                    held.iter().map(node).fold(0.0, f64::max)
                };
                states.iter().enumerate().map(after).fold(0.0, f64::max)
            };
            let [now, late] = [off(0.0), off(0.01)];
            println!("{} in {steps} steps: {now:.1e} m off, {late:.1e} m from a hundredth of a step before", scheme.name);
            // A held node gives way by a hundred-millionth of what its cubes of 16 mm are strained.
            assert!(now < 1e-9 && late > 100.0 * now, "{} in {steps} steps: {now} m, {late} m", scheme.name);
        }
    }
}
