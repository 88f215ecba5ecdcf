//! Scenes like those of the paper. Its radii, heights, time steps and dampings are unpublished; these are our own, with its
//! numbers of cells, steps, cameras and pixels and its ratio of noise to cell.

use super::study::Unknown;
use glam::{DAffine3, DQuat, DVec3};
use palpate::render::Pinhole;
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::scene::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A body under gravity above nothing, with the paper's Rayleigh damping.
pub fn body(shape: Analytic, cell: f64, youngs_modulus: f64) -> Scene {
    let object = Object { source: BodySource::Analytic(shape), pose: DAffine3::IDENTITY, resolution: Resolution::CellSize(cell) };
    let material = Material {
        model: &palpate_model::materials::ALL[0],
        // A foam: weight over stiffness ρ g L / E is 0.05 for the torus, like the paper's (there 80 · 3 / 5000 in its own units).
        inertia: Inertia::Density(100.0),
        youngs_modulus,
        poisson_ratio: 0.4,
        mass_damping: 0.1,
        stiffness_damping: 0.01,
        viscosity: None,
    };
    let time = Time { step: 0.01, steps: 20, ..Time::weighted(0.6) };
    Scene { gravity: DVec3::new(0.0, 0.0, -9.81), time, ..Scene::at_rest("study.toml", object, material) }
}

/// A tilted torus (radii 0.1 m and 0.04 m) that falls 5 cm to the ground and bounces; E = 5000 Pa. At a cell of 0.02 m it has
/// about as many cells as the paper's.
pub fn torus(cell: f64) -> Scene {
    let axis = DVec3::new(0.45, 0.0, 1.0).normalize();
    let (major, minor) = (0.1, 0.04);
    // Lowest point of a torus: the ring falls by R sin(angle between axis and vertical), the tube by r.
    let reach = major * axis.cross(DVec3::Z).length() + minor;
    let center = DVec3::new(0.001, 0.002, reach + 0.05);
    let mut s = body(Analytic::Torus { major, minor, center, axis }, cell, 5000.0);
    s.planes = vec![Plane { point: DVec3::ZERO, normal: DVec3::Z, stiffness: None }];
    s.time = Time { step: 0.01, steps: 40, start: 0.0, ..Time::weighted(0.6) };
    s
}

/// A scene moved as a whole [m]: the same physics, cut by the lattice at other places.
pub fn moved(mut scene: Scene, by: DVec3) -> Scene {
    scene.object.pose.translation += by;
    scene.planes.iter_mut().for_each(|p| p.point += by);
    scene
}

/// A ball of radius 0.05 m above a tilted plane, thrown; E = 2000 Pa. Tilt and throw are drawn from `seed`.
pub fn ball(cell: f64, seed: u64) -> Scene {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut gauss = || -> f64 { StandardNormal.sample(&mut rng) };
    let normal = DVec3::new(0.25 * gauss(), 0.25 * gauss(), 1.0).normalize();
    let velocity = DVec3::new(0.3 * gauss(), 0.3 * gauss(), -0.6 - 0.2 * rng.random::<f64>());
    let center = DVec3::new(0.001, 0.002, 0.1);
    let mut s = body(Analytic::Ball { radius: 0.05, center }, cell, 2000.0);
    // 2 cm between ball and plane.
    s.planes = vec![Plane { point: center - 0.07 * normal, normal, stiffness: None }];
    s.initial.velocity = velocity;
    s
}

/// A ball so viscous that its elasticity has no time to show: within the scene's 0.2 s the stress E (ε + β dε/dt) is that of the
/// product E β alone (20 Pa · 5 s).
pub fn creeping_ball(cell: f64) -> Scene {
    let mut s = ball(cell, 1);
    s.material.youngs_modulus = 20.0;
    s.material.stiffness_damping = 5.0;
    // The plane of a body of 2000 Pa: one that followed E would be soft enough to be seen.
    s.planes[0].stiffness = Some(palpate_model::mechanics::contact::DEFAULT_STIFFNESS * 2000.0 / cell);
    s
}

/// `count` square cameras of `pixels`² around a scene, a little from above, evenly spread in azimuth.
pub fn cameras(target: DVec3, distance: f64, fov: f64, count: usize, pixels: usize) -> Vec<Pinhole> {
    (0..count)
        .map(|i| {
            let turn = DQuat::from_rotation_z(std::f64::consts::TAU * i as f64 / count as f64);
            let eye = target + turn * (DVec3::new(0.35, -1.0, 0.45).normalize() * distance);
            let camera = Pinhole::looking_at(eye, target, DVec3::Z, fov, pixels, pixels);
            let camera = camera.expect("a camera that looks down a little is not parallel to the vertical");
            Pinhole { name: format!("cam{i}"), ..camera }
        })
        .collect()
}

/// Gravity, Young's modulus and stiffness damping, with starts as in the paper's ball experiment: gravity up to 5 m/s² off in
/// every component, the other two a factor of ten.
pub fn gravity_stiffness_damping(plan: &Plan) -> Vec<Unknown> {
    let gravity = |axis: u8| {
        let g = plan.theta[plan.layout.index(ParamKey::Gravity(axis))];
        Unknown { key: ParamKey::Gravity(axis), start: (g - 5.0, g + 5.0) }
    };
    let mut all: Vec<Unknown> = (0..3).map(gravity).collect();
    all.extend([ParamKey::YoungsModulus, ParamKey::StiffnessDamping].map(|k| Unknown::within(plan, k, 10.0)));
    all
}
