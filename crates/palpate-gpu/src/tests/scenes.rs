//! Small scenes that hold every term of the balance, and the device that tests run on.

use super::host::Desk;
use crate::device::GpuError;
use crate::device::{Choice, Gpu, Host, Lanes};
use crate::world::{SOLVING, SOLVING_VECTORS, World};
use glam::{DAffine3, DQuat, DVec3};
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::observation::Observation;
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::*;
use std::sync::{Arc, OnceLock};

/// What opening a device gave; `None` with a printed word where there is none and none is required (`PALPATE_GPU=require`).
fn opened(result: Result<Arc<Gpu>, GpuError>) -> Option<Arc<Gpu>> {
    match result {
        Ok(gpu) => Some(gpu),
        Err(e) => {
            assert!(std::env::var("PALPATE_GPU").as_deref() != Ok("require"), "{e} (hint: {})", e.hint());
            println!("skipped: {e}");
            None
        }
    }
}

/// The device that tests share, so that every kernel is compiled once; with a given way for lanes to talk if asked for.
pub fn device(lanes: Option<Lanes>) -> Option<Arc<Gpu>> {
    static OPEN: [OnceLock<Result<Arc<Gpu>, GpuError>>; 2] = [const { OnceLock::new() }; 2];
    let open = |place: usize, lanes| {
        OPEN[place].get_or_init(|| Gpu::open_for(&Choice::from_env(), lanes, Arc::<Desk>::default())).clone()
    };
    let usual = opened(open(0, None))?;
    match lanes {
        Some(lanes) if lanes != usual.pipelines.lanes => opened(open(1, Some(lanes))),
        _ => Some(usual),
    }
}

/// A device for one test alone: one that breaks it, or counts what is made on it.
pub fn own_device() -> Option<Arc<Gpu>> {
    opened(Gpu::open(&Choice::from_env()))
}

/// The same for a given host.
pub fn device_of(host: Arc<dyn Host>) -> Option<Arc<Gpu>> {
    opened(Gpu::open_for(&Choice::from_env(), None, host))
}

/// A ball of radius 5 cm in cells of `h`.
pub fn ball(h: f64) -> Scene {
    Scene {
        path: "in-code.toml".into(),
        title: String::new(),
        object: Object {
            source: BodySource::Analytic(Analytic::Ball { radius: 0.05, center: DVec3::new(0.003, 0.001, 0.051) }),
            pose: DAffine3::IDENTITY,
            resolution: Resolution::CellSize(h),
        },
        material: Material {
            model: &palpate_model::materials::ALL[0],
            inertia: Inertia::Density(1000.0),
            youngs_modulus: 5000.0,
            poisson_ratio: 0.4,
            mass_damping: 0.3,
            stiffness_damping: 0.004,
            viscosity: None,
        },
        gravity: DVec3::new(0.4, -0.3, -9.0),
        clamps: Vec::new(),
        planes: vec![Plane { point: DVec3::ZERO, normal: DVec3::new(0.1, 0.05, 1.0).normalize(), stiffness: None }],
        masses: vec![PointMass { point: DVec3::new(0.0, 0.02, 0.07), mass: 0.02 }],
        effects: Vec::new(),
        fields: Vec::new(),
        curves: Default::default(),
        initial: Initial {
            velocity: DVec3::new(0.2, 0.0, -0.5),
            angular_velocity: DVec3::new(0.0, 3.0, 1.0),
            pivot: None,
            state: InitialShape::Rest,
        },
        time: Time { step: 0.01, steps: 6, start: 0.05, ..Time::weighted(0.6) },
        solver: Solver::default(),
        observation: None,
        targets: Vec::new(),
        synthesis: Synthesis::default(),
        tracking: palpate_model::scene::Tracking::default(),
        fit: None,
    }
}

/// The ball held at its top by a clamp that moves and turns, hanging from the start into the layer of the ground.
///
/// The ground is 1.2 mm higher than the free ball's, so that the lowest patches lie well within its layer, of 0.75 mm to either side where
/// cells are 3 cm. Where the free ball's ground is, one patch grazes the layer by a twentieth of it. Contact's stiffness goes by the square
/// of that depth, so that the 1e-7 m of single precision would make some 3e-3 of what a plane does to the body.
pub fn held(h: f64) -> Scene {
    let motion = RigidMotion {
        times: vec![-1.0, 0.0, 1.0],
        translations: vec![DVec3::ZERO, DVec3::new(0.003, 0.001, 0.0), DVec3::new(0.01, 0.0, 0.02)],
        rotations: vec![DQuat::IDENTITY, DQuat::from_rotation_z(0.1), DQuat::from_rotation_y(0.4)],
    };
    let mut scene = ball(h);
    scene.planes[0].point.z = 0.0012;
    let min = DVec3::new(-1.0, -1.0, 0.07);
    scene.clamps.push(Clamp::still(min, DVec3::ONE).moved(Some(motion)));
    scene.initial.state = InitialShape::StaticEquilibrium;
    scene.initial.velocity = DVec3::ZERO;
    scene.initial.angular_velocity = DVec3::ZERO;
    scene
}

/// The plan of a scene.
pub fn plan(scene: &Scene) -> Plan {
    build_plan(scene, Observation::default(), &[]).unwrap_or_else(|e| panic!("{e}"))
}

/// Members around the scene's own parameters: moduli, damping, gravity and planes differ.
pub fn spread(plan: &Plan, members: usize) -> Vec<Vec<f64>> {
    (0..members)
        .map(|b| {
            let s = b as f64;
            plan.layout
                .keys
                .iter()
                .zip(&plan.theta)
                .map(|(key, value)| match key {
                    ParamKey::YoungsModulus => value * (1.0 + 0.5 * s),
                    ParamKey::PoissonRatio => value - 0.03 * (s % 2.0),
                    ParamKey::StiffnessDamping => value / (1.0 + s),
                    ParamKey::Gravity(2) => value - 0.2 * s,
                    ParamKey::PlaneHeight(_) => value - 0.001 * s,
                    _ => *value,
                })
                .collect()
        })
        .collect()
}

/// A part of the vectors of the latest solve, of every member.
pub(crate) fn solving_part(world: &World, part: u32) -> Vec<[f32; 4]> {
    let count = world.plan.body.nodes.len() * world.members();
    let all = world.gpu.download(&world.buffers[SOLVING], SOLVING_VECTORS as usize * count).unwrap_or_else(|e| panic!("{e}"));
    all[part as usize * count..][..count].to_vec()
}
