//! Bodies whose given shape is their equilibrium: the shape found, its refusal, and derivatives through it.

use crate::CpuBackend;
use crate::linear::Purpose;
use crate::linear::matrix::Matrix;
use crate::newton::{self, Effort};
use crate::simulate::{self, Start, equation};
use crate::stress_free;
use crate::world::{MemberState, World};
use glam::{DAffine3, DVec3};
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Snapshot, Wanted};
use palpate_model::effects::{self, Effect};
use palpate_model::observation::{Channel, Frame, Observation, ObservedDisplacement, ReadingKind};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::*;
use palpate_model::space::points::TetMesh;
use std::ops::ControlFlow;

const LENGTH: f64 = 0.2;
const EDGE: f64 = 0.04;

/// The bar as cubes of six tetrahedra each.
fn tetrahedra() -> BodySource {
    let (h, n) = (0.02, [10usize, 2, 2]);
    let at = |i: usize, j: usize, k: usize| (i + (n[0] + 1) * (j + (n[1] + 1) * k)) as u32;
    let mut mesh = TetMesh::default();
    for k in 0..=n[2] {
        for j in 0..=n[1] {
            mesh.nodes.extend((0..=n[0]).map(|i| h * DVec3::new(i as f64, j as f64, k as f64)));
        }
    }
    for m in 0..n[0] * n[1] * n[2] {
        let (i, j, k) = (m % n[0], m / n[0] % n[1], m / (n[0] * n[1]));
        let c = |bits: usize| at(i + (bits & 1), j + (bits >> 1 & 1), k + (bits >> 2));
        for way in [[1, 3], [1, 5], [2, 3], [2, 6], [4, 5], [4, 6]] {
            mesh.tets.push([c(0), c(way[0]), c(way[1]), c(7)]);
        }
    }
    let mesh = mesh.checked().unwrap();
    BodySource::Tetrahedra { path: "in-code.msh".into(), surface: mesh.surface(), mesh }
}

/// A bar that is held at one end and straight under its weight, which would bend it by this part of its length if it were straight without
/// and deflections were small (w L⁴/8EI).
fn bar(sag: f64, of_tetrahedra: bool) -> Scene {
    let (density, gravity) = (1000.0, 9.81);
    let load = density * gravity * EDGE * EDGE;
    let young = load * LENGTH.powi(3) / (8.0 * EDGE.powi(4) / 12.0) / sag;
    let (source, resolution) = match of_tetrahedra {
        true => (tetrahedra(), Resolution::Own),
        false => {
            let (min, max) = (DVec3::ZERO, DVec3::new(LENGTH, EDGE, EDGE));
            (BodySource::Analytic(Analytic::Box { min, max }), Resolution::CellSize(0.02))
        }
    };
    let object = Object { source, pose: DAffine3::IDENTITY, resolution };
    let mut scene =
        Scene::at_rest("in-code.toml", object, Material { stiffness_damping: 0.01, ..Material::undamped(young, 0.3) });
    scene.gravity = DVec3::new(0.0, 0.0, -gravity);
    scene.clamps = vec![Clamp::still(DVec3::splat(-1.0), DVec3::new(0.021, 1.0, 1.0))];
    scene.initial.state = InitialShape::Given;
    scene.time = Time { step: 0.01, steps: 4, ..Time::default() };
    scene
}

fn plan(scene: &Scene) -> Plan {
    build_plan(scene, Observation::default(), &[]).unwrap_or_else(|e| panic!("{e}"))
}

/// What the start made of the plan's own numbers: W, or why there is none.
fn started(plan: &Plan) -> (World, Result<Vec<DVec3>, String>) {
    let mut world = World::new(plan);
    world.set_params(&ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let n = plan.body.nodes.len();
    let mut state = MemberState { u: vec![DVec3::ZERO; n], v: vec![DVec3::ZERO; n] };
    let found = simulate::start(&world.shared, &mut world.members[0], &mut state).map_err(|e| e.1);
    let w = world.members[0].coefficients.changes.rest.clone().unwrap_or_default();
    (world, found.map(|()| w))
}

/// A shape that was measured with an error: the start is an equilibrium all the same, and away from the shape given by about the error.
#[test]
fn a_shape_that_departs_from_the_equilibrium_starts_in_its_own() {
    let plan = seen(false, true);
    let mut states = Vec::new();
    let visit = |_: usize, s: Snapshot, _| {
        states.push(s.displacement);
        ControlFlow::Continue(())
    };
    let mut rollout = Rollout::new(CpuBackend, &plan, 1).unwrap();
    rollout.visit(&plan.theta, visit).unwrap();
    let mut theta = plan.theta.clone();
    let still = |key: &ParamKey| matches!(key, ParamKey::Velocity(_));
    plan.layout.keys.iter().zip(&mut theta).filter(|(k, _)| still(k)).for_each(|(_, t)| *t = 0.0);
    let first = states.remove(0);
    states.clear();
    let visit = |_: usize, s: Snapshot, _| {
        states.push(s.displacement);
        ControlFlow::Continue(())
    };
    rollout.visit(&theta, visit).unwrap();
    let moved = states.iter().flat_map(|s| s.iter().zip(&first)).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
    println!("starts {:.4} of the length away, then moves {:.1e} m", largest(&first), moved);
    // Bent by ½ · 0.4 /m · (0.18 m)², which is 0.032 of the length; the load, which presses another shape, changes it by a part of that.
    assert!((0.02..0.05).contains(&largest(&first)), "{}", largest(&first));
    // What Newton's tolerance of 1e-8 of the forces leaves of a bar of 0.2 m.
    assert!(moved < 1e-7, "{moved:e}");
}

/// Largest displacement over the body's length.
fn largest(u: &[DVec3]) -> f64 {
    u.iter().map(|u| u.length()).fold(0.0, f64::max) / LENGTH
}

#[test]
fn the_equilibrium_of_the_stress_free_shape_is_the_shape_given() {
    for (of_tetrahedra, sag) in [(false, 0.14), (false, 0.94), (true, 0.14), (true, 0.5)] {
        let plan = plan(&bar(sag, of_tetrahedra));
        let (mut world, w) = started(&plan);
        let w = w.unwrap_or_else(|e| panic!("{e}"));
        // The forward problem from the shape without stress.
        let (shared, member) = (&world.shared, &mut world.members[0]);
        let still = Start::still(w.len());
        let (mut u, mut matrix) = (w.clone(), Matrix::default());
        let mut e = equation(shared, member, None, &still);
        let mut effort = Effort::default();
        newton::solve(&mut e, &shared.solvers, &mut matrix, Purpose::Static, &mut u, 1e-12, 400, &mut effort).unwrap();
        println!("sag {sag}, tetrahedra {of_tetrahedra}: W {:.3}, {:.1e} off", largest(&w), largest(&u));
        assert!(largest(&w) > 0.5 * sag && largest(&u) < 1e-9, "{} {}", largest(&w), largest(&u));
    }
}

#[test]
fn nothing_moves_until_something_else_changes() {
    let plan = plan(&bar(0.3, false));
    let mut most = 0.0f64;
    let visit = |_: usize, s: Snapshot, _| {
        most = most.max(largest(&s.displacement));
        ControlFlow::Continue(())
    };
    Rollout::new(CpuBackend, &plan, 1).unwrap().visit(&plan.theta, visit).unwrap();
    assert!(most < 1e-8, "{most}");
}

#[test]
fn a_body_too_soft_for_its_shape_is_refused_with_the_stiffness_that_will_do() {
    let scene = bar(20.0, false);
    let told = started(&plan(&scene)).1.unwrap_err();
    println!("{told}");
    let least: f64 = told.split("about ").nth(1).unwrap().split(" Pa").next().unwrap().parse().unwrap();
    let mut stiffer = scene.clone();
    // Well above it: steps of the load are longer there.
    stiffer.material.youngs_modulus = 4.0 * least;
    assert!(least > 2.0 * scene.material.youngs_modulus && started(&plan(&stiffer)).1.is_ok());
}

#[test]
fn tetrahedra_do_not_depart_from_the_shape_given() {
    let mut scene = bar(0.2, true);
    scene.effects = vec![Effect::absent(effects::find("rest-shape").unwrap())];
    let told = build_plan(&scene, Observation::default(), &[]).map(|_| ()).unwrap_err().to_string();
    assert!(told.contains("effect.0.kind") && told.contains("tetrahedra"), "{told}");
}

#[test]
fn a_body_that_nothing_holds_is_refused() {
    let mut scene = bar(0.2, false);
    scene.clamps.clear();
    let told = build_plan(&scene, Observation::default(), &[]).map(|_| ()).unwrap_err().to_string();
    assert!(told.contains("needs a [[clamp]]"), "{told}");
}

/// Numbers of `rest-shape` that move the bar away from the shape given: stretched along x and y, bent from x to z.
const AWAY: [(usize, f64); 3] = [(0, 0.01), (1, -0.005), (4, 0.4)];

/// The bar with a weight at its end, let go with a swing, and seen by its nodes; `away` where its shape was measured with an error.
fn seen(of_tetrahedra: bool, away: bool) -> Plan {
    let mut scene = bar(0.3, of_tetrahedra);
    if away {
        let mut effect = Effect::absent(effects::find("rest-shape").unwrap());
        AWAY.iter().for_each(|(slot, x)| effect.values[*slot] = Some(*x));
        scene.effects = vec![effect];
    }
    scene.initial.velocity.z = 0.2;
    scene.masses = vec![PointMass { point: DVec3::new(0.19, 0.02, 0.02), mass: 0.01 }];
    let bare = plan(&scene);
    let channels = vec![Channel::new(ReadingKind::Displacement, 1e-3)];
    let mut observation = Observation { channels, ..Observation::default() };
    let visit = |k: usize, s: Snapshot, _| {
        let off =
            |(i, u): (usize, &DVec3)| *u + 2e-3 * DVec3::new((i * k) as f64, (2 * i + k) as f64, i as f64 + 0.5).map(f64::sin);
        let displacements = ObservedDisplacement::of_all(s.displacement.iter().enumerate().map(off));
        observation.frames.push(Frame { time: s.time, displacements, ..Frame::default() });
        ControlFlow::Continue(())
    };
    Rollout::new(CpuBackend, &bare, 1).unwrap().visit(&bare.theta, visit).unwrap();
    build_plan(&scene, observation, &[]).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn gradients_and_sensitivities_go_through_the_stress_free_shape() {
    let own = [
        ParamKey::YoungsModulus,
        ParamKey::PoissonRatio,
        ParamKey::Density,
        ParamKey::StiffnessDamping,
        ParamKey::Gravity(2),
        ParamKey::PointMass(0),
        ParamKey::Velocity(2),
    ];
    for (of_tetrahedra, away) in [(false, false), (true, false), (false, true)] {
        let plan = seen(of_tetrahedra, away);
        let of_effect = |key: &&ParamKey| match key {
            ParamKey::Effect { slot, .. } => AWAY.iter().any(|(k, _)| k == &usize::from(*slot)),
            _ => false,
        };
        let keys: Vec<ParamKey> = own.iter().chain(plan.layout.keys.iter().filter(of_effect)).copied().collect();
        assert_eq!(keys.len(), own.len() + if away { AWAY.len() } else { 0 });
        let mut theta = plan.theta.clone();
        theta[plan.layout.index(ParamKey::YoungsModulus)] *= 1.1;
        let places: Vec<usize> = keys.iter().map(|k| plan.layout.index(*k)).collect();
        let mut rollout = Rollout::new(CpuBackend, &plan, 1).unwrap();
        let mut cost =
            |theta: &[f64]| rollout.evaluate(&ParamBatch::from_rows(&[theta.to_vec()]), &Request::default()).remove(0).cost;
        let slope = |place: usize, cost: &mut dyn FnMut(&[f64]) -> f64| {
            let step = 1e-5 * theta[place].abs().max(1e-3);
            let at = |s: f64| {
                let mut t = theta.clone();
                t[place] += s * step;
                t
            };
            // Fourth order, so that the step may be large beside rounding.
            (8.0 * (cost(&at(1.0)) - cost(&at(-1.0))) - (cost(&at(2.0)) - cost(&at(-2.0)))) / (12.0 * step)
        };
        let differences: Vec<f64> = places.iter().map(|p| slope(*p, &mut cost)).collect();
        let request = Request { gradient: Wanted::All, sensitivities: places.clone() };
        let mut rollout = Rollout::new(CpuBackend, &plan, 1).unwrap();
        let found = rollout.evaluate(&ParamBatch::from_rows(&[theta.clone()]), &request).remove(0);
        assert!(found.failure.is_none(), "{:?}", found.failure);
        let curvature = found.curvature.as_ref().unwrap();
        for (k, (p, difference)) in places.iter().zip(&differences).enumerate() {
            // What the derivative could be at most, |dJ/dp| ≤ √(2 J H_pp).
            let most = (2.0 * found.cost * curvature.matrix[k * (places.len() + 1)]).sqrt();
            let [adjoint, tangent] = [found.gradient[*p], curvature.gradient[k]].map(|g| (g - difference).abs() / most);
            println!(
                "tetrahedra {of_tetrahedra}, away {away}, {:?}: {difference:.6e} of {most:.1e}, {adjoint:.1e} {tangent:.1e}",
                keys[k]
            );
            assert!(adjoint < 1e-6 && tangent < 1e-6, "{:?}: {adjoint:e} {tangent:e}", keys[k]);
        }
        // The stress-free shape matters to what moves.
        assert!(stress_free::applies(&plan));
    }
}
