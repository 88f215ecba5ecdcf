//! Every scheme with every material, on cut cells and on tetrahedra: adjoint = sensitivities = differences, in a small scene in which a
//! moving clamp, damping, contact, a point mass and markers act. The tables of schemes and materials are gone through.

use super::gradients::check_some;
use glam::{DAffine3, DQuat, DVec3};
use palpate_model::materials::viscosity::Viscosity;
use palpate_model::materials::{self, Model};
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::observation::{Channel, Frame, MarkerRest, Observation, ObservedDisplacement, ObservedMarker, ReadingKind};
use palpate_model::params::ParamKey;
use palpate_model::params::fields::{Basis, FieldSpec, Scale, Varied};
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::plan::scheme::{self, Scheme};
use palpate_model::scene::*;
use support::{run, scenes, tets};

/// What a body is made of.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    CutCells,
    Tetrahedra(Tetrahedron),
}

/// A beam that a clamp moves and turns, and whose end falls onto the ground.
pub(super) fn beam(kind: Kind, scheme: &'static Scheme, model: &'static Model) -> Scene {
    // Cells are cut, by a half across the beam: a law of the strain has to know what of a cell there is.
    let min = DVec3::new(0.001, -0.017, -0.016);
    let max = min + DVec3::new(0.0975, 0.031, 0.0375);
    let mut s = scenes::body(Analytic::Box { min, max }, 0.02);
    if let Kind::Tetrahedra(element) = kind {
        s.solver.tetrahedron = element;
        let source = tets::bar(DVec3::new(0.0, -0.017, -0.0165), 0.0334, [3, 1, 1]);
        s.object = Object { source, pose: DAffine3::IDENTITY, resolution: Resolution::Own };
    }
    s.material.model = model;
    s.material.youngs_modulus = 2e5;
    s.material.mass_damping = 0.3;
    s.material.stiffness_damping = 0.004;
    s.gravity = DVec3::new(0.4, -0.3, -9.0);
    s.planes = vec![scenes::plane(DVec3::new(0.1, 0.0, -0.0168), DVec3::new(-0.02, 0.01, 1.0))];
    s.masses = vec![PointMass { point: DVec3::new(0.09, 0.005, 0.01), mass: 0.02 }];
    let motion = RigidMotion {
        times: vec![0.0, 0.02, 0.04, 0.06],
        translations: vec![DVec3::ZERO, DVec3::new(0.001, 0.0, -0.0005), DVec3::new(0.0015, -0.001, 0.0), DVec3::ZERO],
        rotations: vec![
            DQuat::IDENTITY,
            DQuat::from_rotation_x(0.05),
            DQuat::from_rotation_y(0.05),
            DQuat::from_rotation_z(0.05),
        ],
    };
    s.clamps = vec![Clamp { motion: Some(motion), ..Clamp::still(DVec3::splat(-1.0), DVec3::new(0.021, 1.0, 1.0)) }];
    s.initial.velocity = DVec3::new(0.02, -0.03, -0.05);
    s.time = Time { step: 0.01, steps: 3, start: 0.002, theta: 0.5, scheme, open: None };
    s.solver.tolerance = 1e-13;
    s
}

/// The scene, seen as it is with a body stiffer by 15 %, and a little off that: two markers and all nodes, in frames between steps.
pub(super) fn seen(scene: &Scene) -> Plan {
    let stiff = |mut s: Scene| {
        s.material.youngs_modulus *= 1.15;
        s
    };
    let states = run::states(&scenes::plan(&stiff(scene.clone())));
    let marker = |name: &str, position: DVec3| MarkerRest { name: name.into(), position, surface: None };
    // One on a stalk, which turns with the body.
    let markers = [marker("end", DVec3::new(0.1, 0.0, 0.0)), marker("stalk", DVec3::new(0.07, 0.005, 0.035))];
    let frames = [0.1, 1.7, 2.6].map(|at| {
        let u = &states[at as usize + 1].displacement;
        let moved = DVec3::new(0.002, -0.001, -0.001);
        Frame {
            time: scene.time.start + at * scene.time.step,
            markers: (0..2).map(|site| ObservedMarker { site, position: markers[site as usize].position + moved }).collect(),
            displacements: ObservedDisplacement::of_all(u.iter().map(|u| *u + DVec3::new(1e-4, -2e-4, 3e-4))),
            ..Frame::default()
        }
    });
    let channels = vec![Channel::new(ReadingKind::Marker, 2e-3), Channel::new(ReadingKind::Displacement, 5e-3)];
    let observation = Observation { frames: frames.to_vec(), channels, ..Observation::default() };
    build_plan(scene, observation, &markers).unwrap_or_else(|e| panic!("{e}"))
}

/// Parameters of the material, of the clamp's motion and of contact, which differences are taken by; adjoint and sensitivities are compared for all.
fn one_of_each(key: ParamKey) -> bool {
    use ParamKey::*;
    matches!(key, YoungsModulus | PoissonRatio | Density | StiffnessDamping | TimeStart | PlaneHeight(0))
        || matches!(key, Viscosity | ViscosityExponent)
}

fn check(kind: Kind, scheme: &'static Scheme, model: &'static Model) {
    let name = format!("{kind:?}, {}, {}", scheme.name, model.name);
    let mut scene = beam(kind, scheme, model);
    // One of the materials flows as well, by a law that a scheme with several past states must see the same way.
    if *model == materials::ALL[1] {
        scene.material.viscosity = Some(Viscosity { coefficient: 60.0, exponent: 0.8 });
    }
    let touched = check_some(&seen(&scene), &name, one_of_each);
    assert_eq!(touched, 1, "{name}: contact");
}

#[test]
fn cut_cells() {
    for scheme in scheme::ALL {
        materials::ALL.iter().for_each(|model| check(Kind::CutCells, scheme, model));
    }
}

#[test]
fn bodies_of_tetrahedra() {
    let quadratic = Kind::Tetrahedra(Tetrahedron::Quadratic);
    // Every scheme with a material that has formulas, every material with one scheme.
    scheme::ALL.iter().for_each(|scheme| check(quadratic, scheme, &materials::ALL[1]));
    materials::ALL.iter().filter(|m| **m != materials::ALL[1]).for_each(|model| check(quadratic, &scheme::ALL[1], model));
    check(Kind::Tetrahedra(Tetrahedron::Linear), &scheme::ALL[0], &materials::ALL[2]);
}

/// What a gradient has to get right at once: the adjoint of a static start, of two past states, of a clamp that moves, and every tetrahedron's own
/// modulus.
#[test]
fn every_tetrahedron_of_a_body_that_starts_in_equilibrium() {
    let bdf2 = scheme::find("bdf2").expect("it is in the table");
    let neo_hookean = materials::find("neo-hookean").expect("it is in the table");
    let mut s = beam(Kind::Tetrahedra(Tetrahedron::Quadratic), bdf2, neo_hookean);
    s.planes.clear();
    s.initial.velocity = DVec3::ZERO;
    s.initial.state = InitialShape::StaticEquilibrium;
    let of = |varied, basis| FieldSpec { varied, basis, scale: Scale::Log, values: None, prior: None };
    s.fields = vec![of(Varied::Modulus, Basis::Cells), of(Varied::Density, Basis::Nodes), of(Varied::Damping, Basis::Cells)];
    // Of the nodes' densities a few tell enough.
    let some = |key| match key {
        ParamKey::Field { field: 1, index } => index % 16 == 3,
        ParamKey::Field { .. } => true,
        key => one_of_each(key) && key != ParamKey::PlaneHeight(0),
    };
    assert_eq!(check_some(&seen(&s), "every tetrahedron", some), 0);
}
