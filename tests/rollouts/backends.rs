//! The GPU against the CPU through whole rollouts: every scheme with the last material of the table, and every material with the last scheme.

use super::combinations::{Kind, beam, seen};
use super::moving::{jet, pressed};
use glam::{DAffine3, DQuat, DVec3};
use palpate_cpu::CpuBackend;
use palpate_engine::{Backend, Evaluate, Evaluation, ParamBatch, Request, Rollout, Wanted};
use palpate_gpu::{Gpu, GpuBackend};
use palpate_model::materials;
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::params::fields::{Basis, FieldSpec, Scale, Varied};
use palpate_model::plan::Plan;
use palpate_model::plan::scheme;
use palpate_model::scene::*;
use palpate_model::space::stars::StarSpec;
use std::sync::Arc;

/// Single precision through a few steps leaves derivatives that are right to a thousandth of what they could be at most.
const AGREEMENT: f64 = 1e-3;

/// Cost, gradient and Gauss–Newton matrix by every parameter.
fn evaluate<B: Backend>(backend: B, plan: &Plan) -> Evaluation {
    let mut rollout = Rollout::new(backend, plan, 1).unwrap_or_else(|e| panic!("{e}"));
    let request = Request { gradient: Wanted::All, sensitivities: (0..plan.theta.len()).collect() };
    let e = rollout.evaluate(&ParamBatch::from_rows(std::slice::from_ref(&plan.theta)), &request).remove(0);
    if let Some(f) = &e.failure {
        panic!("{f}");
    }
    e
}

/// What a value of a field is compared with at least, over the most that any of its values could be: single precision strains what a clamp moves
/// rigidly by its rounding.
const OF_FIELD: f64 = 1e-2;

/// Gradients by the adjoint and by sensitivities over what they could be at most: |dJ/dp| ≤ √(2 J H_pp).
fn gradients(plan: &Plan, e: &Evaluation, right: &Evaluation) -> Vec<[f64; 2]> {
    let p = right.gradient.len();
    let (own, exact) = (e.curvature.as_ref().expect("asked for"), right.curvature.as_ref().expect("asked for"));
    let alone = |i: usize| (2.0 * right.cost * exact.matrix[i * p + i]).sqrt();
    let most = |i: usize| {
        let field = plan.layout.fields().find(|f| f.contains(&i));
        field.map_or(alone(i), |f| alone(i).max(OF_FIELD * f.map(alone).fold(0.0, f64::max)))
    };
    (0..p).filter(|i| most(*i) > 0.0).map(|i| [e.gradient[i] / most(i), own.gradient[i] / most(i)]).collect()
}

/// Compares both backends on a scene.
fn compare(gpu: &Arc<Gpu>, scene: &Scene, name: &str) {
    let plan = seen(scene);
    let right = evaluate(CpuBackend, &plan);
    let found = evaluate(GpuBackend::on(gpu.clone()).with_shapes(Arc::new(CpuBackend)), &plan);
    let cost = (found.cost / right.cost - 1.0).abs();
    let pairs: Vec<([f64; 2], [f64; 2])> =
        gradients(&plan, &found, &right).into_iter().zip(gradients(&plan, &right, &right)).collect();
    let off = pairs.iter().flat_map(|(a, b)| [(a[0] - b[0]).abs(), (a[1] - b[1]).abs()]).fold(0.0, f64::max);
    let large = pairs.iter().filter(|(_, b)| b[0].abs() > 0.15).count();
    println!("{name}: cost off by {cost:.1e}, gradients by {off:.1e}; {large} of {} are large", pairs.len());
    assert!(cost < AGREEMENT && off < AGREEMENT, "{name}: cost {cost:.1e}, gradients {off:.1e}");
    // So that one per cent of them would show.
    assert!(large >= 3, "{name}: {large} gradients are large");
}

#[test]
fn every_scheme_and_every_material_agree() {
    let Some(gpu) = support::gpu::device() else { return };
    let known: Vec<_> = materials::ALL.iter().filter(|m| m.has_twin()).collect();
    let (scheme, model) = (scheme::ALL.last().expect("there is one"), *known.last().expect("there is one"));
    let schemes = scheme::ALL.iter().map(|s| (s, model));
    let models = known.iter().filter(|m| **m != model).map(|m| (scheme, *m));
    let bdf2 = scheme::find("bdf2").expect("it is in the table");
    let neo_hookean = materials::find("neo-hookean").expect("it is in the table");
    let tets = (Kind::Tetrahedra(Tetrahedron::Quadratic), bdf2, neo_hookean);
    for (kind, scheme, model) in schemes.chain(models).map(|(s, m)| (Kind::CutCells, s, m)).chain([tets]) {
        let mut scene = beam(kind, scheme, model);
        if let Kind::Tetrahedra(_) = kind {
            // In equilibrium at the start, in a clamp that moves.
            (scene.initial.velocity, scene.initial.state) = (glam::DVec3::ZERO, InitialShape::StaticEquilibrium);
            scene.planes.clear();
        }
        // As accurate as single precision can use.
        scene.solver.tolerance = 1e-10;
        let name = format!("{kind:?}, {}, {}", scheme.name, model.name);
        compare(&gpu, &scene, &name);
    }
}

/// The stress-free shape is found on the host; derivatives through it are the host's and the device's together.
#[test]
fn shapes_that_are_given_as_the_equilibrium_agree() {
    let Some(gpu) = support::gpu::device() else { return };
    let neo_hookean = materials::find("neo-hookean").expect("it is in the table");
    let kinds = [(Kind::CutCells, &materials::ALL[0]), (Kind::Tetrahedra(Tetrahedron::Quadratic), neo_hookean)];
    for (kind, model) in kinds {
        let mut scene = beam(kind, scheme::ALL.last().expect("there is one"), model);
        scene.initial.state = InitialShape::Given;
        scene.solver.tolerance = 1e-10;
        let name = format!("{kind:?}, {}", model.name);
        compare(&gpu, &scene, &name);
        // One that no stress-free shape explains is refused in the CPU's words.
        scene.material.youngs_modulus = 1.0;
        let plan = palpate_model::plan::build::build_plan(&scene, Default::default(), &[]).unwrap_or_else(|e| panic!("{e}"));
        let theta = ParamBatch::from_rows(std::slice::from_ref(&plan.theta));
        let device = GpuBackend::on(gpu.clone()).with_shapes(Arc::new(CpuBackend));
        let why = |e: Evaluation| e.failure.map(|f| f.message());
        let own =
            why(Rollout::new(device, &plan, 1).unwrap_or_else(|e| panic!("{e}")).evaluate(&theta, &Request::default()).remove(0));
        let right = why(Rollout::new(CpuBackend, &plan, 1)
            .unwrap_or_else(|e| panic!("{e}"))
            .evaluate(&theta, &Request::default())
            .remove(0));
        assert!(own == right && right.is_some_and(|r| r.contains("stress-free")), "{own:?}");
    }
}

/// Points off a lattice along the beam, each with more neighbours than a tetrahedron has nodes.
fn stars() -> Object {
    let (low, size, counts) = (DVec3::new(0.0, -0.017, -0.0165), DVec3::new(0.1, 0.0334, 0.0334), [9, 3, 3]);
    let place = |n: usize| DVec3::new((n % 9) as f64, (n / 9 % 3) as f64, (n / 27) as f64);
    let moved = |n: usize| (DVec3::new(0.819, 0.671, 0.549) * (n as f64 + 1.0)).fract() * 0.4 + 0.3;
    let edges = size / DVec3::from_array(counts.map(|c| c as f64));
    let points = (0..counts.iter().product()).map(|n| low + edges * (place(n) + moved(n))).collect();
    let hull = BodySource::Analytic(Analytic::Box { min: low, max: low + size });
    let stars = StarSpec { neighbours: 11, residual_penalty: 0.5, ..StarSpec::default() };
    let source = BodySource::Cloud(Box::new(Cloud { path: "in-code.npy".into(), points, hull, stars }));
    Object { source, pose: DAffine3::IDENTITY, resolution: Resolution::Own }
}

/// A scheme that weighs the old state's forces and one with two past states; moduli and densities that vary from point to point.
#[test]
fn bodies_of_stars_agree() {
    let Some(gpu) = support::gpu::device() else { return };
    let neo_hookean = materials::find("neo-hookean").expect("it is in the table");
    for name in ["theta", "bdf2"] {
        let mut scene = beam(Kind::Tetrahedra(Tetrahedron::Linear), scheme::find(name).expect("it is in the table"), neo_hookean);
        scene.object = stars();
        scene.solver.tolerance = 1e-10;
        let of = |varied| FieldSpec { varied, basis: Basis::Points, scale: Scale::Log, values: None, prior: None };
        if name == "theta" {
            scene.fields = vec![of(Varied::Modulus), of(Varied::Density)];
        }
        compare(&gpu, &scene, &format!("stars, {name}"));
    }
}

/// Bodies of every kind, with schemes that take contact along the way of a step, at its end, and in turn, and with two past states.
fn bodies() -> Vec<(String, Scene)> {
    let neo_hookean = materials::find("neo-hookean").expect("it is in the table");
    let kinds = [
        ("cells", "theta", Kind::CutCells),
        ("cells", "tr-bdf2", Kind::CutCells),
        ("tetrahedra", "bdf2", Kind::Tetrahedra(Tetrahedron::Quadratic)),
        ("stars", "theta", Kind::Tetrahedra(Tetrahedron::Linear)),
    ];
    let made = kinds.map(|(body, name, kind)| {
        let model = if body == "cells" { &materials::ALL[0] } else { neo_hookean };
        let mut scene = beam(kind, scheme::find(name).expect("it is in the table"), model);
        if body == "stars" {
            scene.object = stars();
        }
        scene.solver.tolerance = 1e-10;
        (format!("{body}, {name}"), scene)
    });
    made.into()
}

/// Highest y and z of the bodies of [`bodies`].
fn ends(name: &str) -> [f64; 2] {
    if name.starts_with("cells") { [0.014, 0.0215] } else { [0.0164, 0.0169] }
}

/// A ball that turns as it comes down on the beam, and a box beside it that moves away.
#[test]
fn obstacles_agree() {
    let Some(gpu) = support::gpu::device() else { return };
    for (name, mut scene) in bodies() {
        let [side, top] = ends(&name);
        let above = DVec3::new(0.07, 0.002, top + 0.03);
        let motion = RigidMotion {
            times: vec![0.0, 0.02, 0.04],
            translations: vec![above, above - DVec3::new(0.001, 0.0, 0.0015), above - DVec3::new(0.002, 0.001, 0.004)],
            rotations: vec![DQuat::IDENTITY, DQuat::from_rotation_y(0.1), DQuat::from_rotation_y(0.3)],
        };
        let ball = Analytic::Ball { radius: 0.03, center: DVec3::new(0.001, 0.0, 0.0) };
        let away = RigidMotion {
            times: vec![0.0, 0.04],
            translations: vec![DVec3::ZERO, DVec3::new(0.0, 0.001, 0.0)],
            rotations: vec![DQuat::IDENTITY, DQuat::from_rotation_z(0.02)],
        };
        let wall = Analytic::Box { min: DVec3::new(0.05, side + 7e-4, -0.01), max: DVec3::new(0.09, 0.03, 0.02) };
        scene.effects = vec![pressed(ball, motion, [5e7, 1e-4, -2e-4, 3e-4]), pressed(wall, away, [2e7, 0.0, -5e-4, 0.0])];
        compare(&gpu, &scene, &format!("obstacles, {name}"));
    }
}

/// Two nozzles that move and turn.
#[test]
fn jets_agree() {
    let Some(gpu) = support::gpu::device() else { return };
    for (name, mut scene) in bodies() {
        let above = DVec3::new(0.08, 0.02, ends(&name)[1] + 0.12);
        let beside = DVec3::new(0.09, -0.15, 0.01);
        scene.effects = vec![
            jet(above, above + DVec3::new(-0.02, 0.0, 0.01), DVec3::new(-0.1, -0.2, -1.0).normalize(), 1.5),
            jet(beside, beside + DVec3::new(-0.01, 0.0, 0.02), DVec3::new(-0.1, 1.0, 0.05).normalize(), 0.8),
        ];
        compare(&gpu, &scene, &format!("jets, {name}"));
        // The stress-free shape, under the jets too, is found on the host.
        if name == "cells, theta" {
            scene.initial.state = InitialShape::Given;
            compare(&gpu, &scene, &format!("jets on an equilibrium, {name}"));
        }
    }
}

/// A ring in a jet along its plane: half of what faces the nozzle lies behind the other half.
#[test]
fn what_a_nozzle_sees_agrees() {
    let Some(gpu) = support::gpu::device() else { return };
    let mut scene = beam(Kind::CutCells, scheme::find("theta").expect("it is in the table"), &materials::ALL[0]);
    let ring = Analytic::Torus { major: 0.05, minor: 0.02, center: DVec3::new(0.05, 0.0, 0.005), axis: DVec3::Z };
    scene.object =
        Object { source: BodySource::Analytic(ring), pose: DAffine3::IDENTITY, resolution: Resolution::CellSize(0.0125) };
    scene.planes.clear();
    scene.solver.tolerance = 1e-10;
    let before = DVec3::new(0.3, 0.004, 0.01);
    scene.effects = vec![jet(before, before + DVec3::new(0.0, 0.01, 0.01), DVec3::new(-1.0, 0.02, -0.03).normalize(), 3.0)];
    compare(&gpu, &scene, "a ring");
}

/// A bar of so few linear tetrahedra that a group of the second level is a plate which hinges on two held nodes.
#[test]
fn short_bars_of_linear_tetrahedra_agree() {
    let Some(gpu) = support::gpu::device() else { return };
    for scheme in scheme::ALL {
        let mut scene = beam(Kind::Tetrahedra(Tetrahedron::Linear), scheme, &materials::ALL[0]);
        scene.solver.tolerance = 1e-10;
        compare(&gpu, &scene, &format!("a short bar, {}", scheme.name));
    }
}
