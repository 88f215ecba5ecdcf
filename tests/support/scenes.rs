//! Small scenes built in code.

use glam::{DAffine3, DVec3};
use palpate_model::observation::Observation;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::*;
use palpate_model::space::points::TetMesh;

/// A body in free space at rest, E = 5 kPa, ν = 0.4, 1000 kg/m³, no damping, no gravity, 10 steps of 5 ms at θ = ½.
pub fn body(shape: Analytic, cell_size: f64) -> Scene {
    Scene {
        path: "in-code.toml".into(),
        title: String::new(),
        object: Object {
            source: BodySource::Analytic(shape),
            pose: DAffine3::IDENTITY,
            resolution: Resolution::CellSize(cell_size),
        },
        material: Material {
            model: &palpate_model::materials::ALL[0],
            inertia: Inertia::Density(1000.0),
            youngs_modulus: 5000.0,
            poisson_ratio: 0.4,
            mass_damping: 0.0,
            stiffness_damping: 0.0,
        },
        gravity: DVec3::ZERO,
        clamps: Vec::new(),
        planes: Vec::new(),
        masses: Vec::new(),
        effects: Vec::new(),
        fields: Vec::new(),
        initial: Initial { velocity: DVec3::ZERO, angular_velocity: DVec3::ZERO, pivot: None, state: InitialShape::Rest },
        time: Time { step: 0.005, steps: 10, start: 0.0, theta: 0.5, ..Time::default() },
        solver: Solver::default(),
        observation: None,
        fit: None,
    }
}

/// A box from `min` on as `count` cubes of six tetrahedra each.
pub fn tetrahedra(min: DVec3, edge: f64, count: [usize; 3]) -> BodySource {
    let [a, b, c] = count.map(|n| n + 1);
    let mut mesh = TetMesh::default();
    for n in 0..a * b * c {
        mesh.nodes.push(min + edge * DVec3::new((n % a) as f64, (n / a % b) as f64, (n / (a * b)) as f64));
    }
    for n in 0..count.iter().product() {
        let (i, j, k) = (n % count[0], n / count[0] % count[1], n / (count[0] * count[1]));
        let corner = |bits: usize| (i + (bits & 1) + a * (j + (bits >> 1 & 1) + b * (k + (bits >> 2)))) as u32;
        for way in [[1, 3], [1, 5], [2, 3], [2, 6], [4, 5], [4, 6]] {
            mesh.tets.push([corner(0), corner(way[0]), corner(way[1]), corner(7)]);
        }
    }
    let mesh = mesh.checked().expect("a box of cubes is sound");
    BodySource::Tetrahedra { path: "in-code.msh".into(), surface: mesh.surface(), mesh }
}

/// A clamp that holds still.
pub fn clamp(min: DVec3, max: DVec3) -> Clamp {
    Clamp { min, max, object_frame: false, motion: None, motion_path: None }
}

/// A contact plane whose stiffness follows the material.
pub fn plane(point: DVec3, normal: DVec3) -> Plane {
    Plane { point, normal: normal.normalize(), stiffness: None }
}

/// A plan without observations.
pub fn plan(scene: &Scene) -> Plan {
    build_plan(scene, Observation::default(), &[]).unwrap_or_else(|e| panic!("{e}"))
}
