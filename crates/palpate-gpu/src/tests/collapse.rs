//! Cells that are turned inside out, where the barrier of `palpate_model::cutcells::corotation::inversion` acts: passes, states and evaluations
//! against the CPU, each with a device whose barrier is one percent too stiff, which must be seen.

use super::effects::Noise;
use super::forward::{off, states};
use super::passes::{Exact, apart, found};
use super::scenes::{ball, device, own_device, plan};
use crate::costs::rollout_tests::{differences, watched};
use crate::device::pipelines::constant;
use crate::{Gpu, GpuBackend, Lanes, Product, Tuning};
use glam::{DQuat, DVec3};
use palpate_cpu::CpuBackend;
use palpate_cpu::terms::elastic_cells::corners;
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::cutcells::corotation::CellPose;
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::observation::{Channel, Frame, Observation, ObservedDisplacement, ReadingKind};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::{Analytic, BodySource, Clamp, Scene, Time};
use std::sync::{Arc, OnceLock};

/// The shared device, and one whose barrier is one percent too stiff.
fn right_and_stiffer() -> Option<[Arc<Gpu>; 2]> {
    static STIFFER: OnceLock<Option<Arc<Gpu>>> = OnceLock::new();
    let right = device(None)?;
    let open = || {
        let mut gpu = own_device()?;
        let own = Arc::get_mut(&mut gpu).unwrap_or_else(|| panic!("nobody else holds a device of one's own"));
        own.pipelines.constant = |name| constant(name).map(|v| if name == "guard_strength" { 1.01 * v } else { v });
        Some(gpu)
    };
    Some([right, STIFFER.get_or_init(open).clone()?])
}

/// Cells that the barrier acts in.
fn guarded(plan: &Plan, u: &[DVec3]) -> usize {
    let pose = |e: usize| CellPose::new(&corners(&plan.body, e, u), plan.body.cut().grid.h);
    (0..plan.body.cells().len()).filter(|e| pose(*e).guard().is_some()).count()
}

/// A step that turns a ball inside out along z, far enough for the barrier in some cells and not quite in others.
fn turned_inside_out(x: DVec3) -> [DVec3; 3] {
    let wave = |f: f64| DVec3::new((f * x.y).sin(), (f * x.z + 1.0).cos(), (f * (x.x + x.y)).sin());
    let mirror = (1.66 + 0.14 * (30.0 * x.x).sin()) * (x.z - 0.045);
    [1e-3 * wave(40.0), 0.1 * wave(25.0), 4e-4 * wave(60.0) - DVec3::Z * mirror]
}

#[test]
fn passes_agree_where_the_barrier_acts_and_one_percent_shows() {
    let Some([gpu, wrong]) = right_and_stiffer() else { return };
    let mut scene = ball(0.03);
    // So short that inertia makes the matrix positive definite; the body lies in the ground.
    scene.time.step = 0.0005;
    scene.planes[0].point.z = 0.02;
    let plan = plan(&scene);
    let u: Vec<DVec3> = plan.body.nodes.iter().map(|x| turned_inside_out(*x)).map(|[u, _, w]| u + w).collect();
    let count = guarded(&plan, &u);
    assert!(count > 5 && count < plan.body.cells().len(), "{count} of {}", plan.body.cells().len());
    let right = Exact::new(&plan, turned_inside_out);
    let mut off = apart(&found(&GpuBackend::on(gpu), &plan, &right), &right);
    // The barrier makes single cells many times stiffer than their neighbours: solves keep fewer digits than elsewhere.
    off.retain(|pass| *pass != "iterate_cg");
    assert_eq!(off, [""; 0]);
    let seen = apart(&found(&GpuBackend::on(wrong), &plan, &right), &right);
    for pass in ["press_cells", "gather_matrix", "multiply_rows", "multiply_cells"] {
        assert!(seen.contains(&pass), "1 % of the barrier is not seen in {pass}, only in {seen:?}");
    }
}

/// A block held at its bottom, whose upper part is driven down through it, askew: the layer between is turned inside out however soft
/// or stiff it is, so that there is one solution only.
pub(super) fn pressed() -> Scene {
    let mut s = ball(0.03);
    let (min, max) = (DVec3::new(0.003, 0.004, 0.002), DVec3::new(0.085, 0.08, 0.088));
    s.object.source = BodySource::Analytic(Analytic::Box { min, max });
    s.masses.clear();
    s.planes.clear();
    s.material.stiffness_damping = 0.002;
    s.initial.velocity = DVec3::ZERO;
    s.initial.angular_velocity = DVec3::ZERO;
    s.time = Time { step: 0.01, steps: 6, start: 0.0, ..Time::weighted(0.6) };
    let (far, turn) = (DVec3::new(0.004, 0.002, -0.05), DQuat::from_rotation_y(0.1));
    let motion = RigidMotion {
        times: vec![-0.06, 0.0, 0.06, 0.12],
        translations: vec![DVec3::ZERO, DVec3::ZERO, far, far],
        rotations: vec![DQuat::IDENTITY, DQuat::IDENTITY, turn, turn],
    };
    let clamp = |low: f64, high: f64, motion| {
        let (min, max) = (DVec3::new(-1.0, -1.0, low), DVec3::new(1.0, 1.0, high));
        Clamp::still(min, max).moved(motion)
    };
    s.clamps = vec![clamp(-1.0, 0.03, None), clamp(0.058, 1.0, Some(motion))];
    s.observation = watched();
    s
}

/// The plan of a scene of which every node was seen at every step, a third of a millimetre off.
pub(super) fn measured(scene: &Scene) -> Plan {
    let bare = plan(scene);
    let moments = states(&CpuBackend, &bare, std::slice::from_ref(&bare.theta)).0;
    let count = moments.iter().filter(|m| guarded(&bare, &m[0].0) > 0).count();
    assert!(count > 1, "the barrier acts in {count} steps");
    let mut noise = Noise::new(5);
    let mut near = |u: &DVec3| *u + 3e-4 * DVec3::from_array(std::array::from_fn(|_| noise.uniform(-1.0, 1.0)));
    let frames = moments.iter().enumerate().map(|(k, m)| Frame {
        time: scene.time.start + scene.time.step * k as f64,
        displacements: ObservedDisplacement::of_all(m[0].0.iter().map(&mut near)),
        ..Frame::default()
    });
    let observation = Observation {
        frames: frames.collect(),
        channels: vec![Channel::new(ReadingKind::Displacement, 1e-3)],
        ..Observation::default()
    };
    build_plan(scene, observation, &[]).unwrap_or_else(|e| panic!("{e}"))
}

const ONE: Tuning = Tuning { many_from: usize::MAX, product: None, crew: 0 };
const MANY: [Tuning; 2] = [
    Tuning { many_from: 0, product: Some(Product::Matrix), crew: 0 },
    Tuning { many_from: 0, product: Some(Product::Free), crew: 0 },
];

#[test]
fn evaluations_of_a_body_pressed_inside_out_agree_and_one_percent_shows() {
    let Some([gpu, wrong]) = right_and_stiffer() else { return };
    let plan = measured(&pressed());
    let directions: Vec<usize> =
        [ParamKey::YoungsModulus, ParamKey::PoissonRatio, ParamKey::Density, ParamKey::StiffnessDamping, ParamKey::Gravity(2)]
            .map(|k| plan.layout.index(k))
            .to_vec();
    let request = Request { gradient: Wanted::All, sensitivities: directions.clone() };
    let mut row = plan.theta.clone();
    row[directions[0]] *= 1.1;
    row[directions[1]] *= 0.9;
    let rows = ParamBatch::from_rows(&[row]);
    let mut cpu = Rollout::new(CpuBackend, &plan, 1).unwrap_or_else(|e| panic!("{e}"));
    let exact = cpu.evaluate(&rows, &request).remove(0);
    let off = |gpu: &Arc<Gpu>, tuning: Tuning| {
        let backend = GpuBackend::on(gpu.clone()).tuned(tuning);
        let mut rollout = Rollout::new(backend, &plan, 1).unwrap_or_else(|e| panic!("{e}"));
        differences(&rollout.evaluate(&rows, &request).remove(0), &exact, &directions)
    };
    for tuning in [ONE, MANY[0], MANY[1]] {
        assert_eq!(off(&gpu, tuning), [""; 0], "{tuning:?}");
    }
    for tuning in [ONE, MANY[1]] {
        let seen = off(&wrong, tuning).len();
        println!("{tuning:?}: {seen} numbers differ");
        assert!(seen > 0, "1 % of the barrier was not seen: {tuning:?}");
    }
}

/// A soft block of some thirty cells thrown at the ground, which crushes it.
fn thrown(youngs_modulus: f64, steps: usize) -> Scene {
    let mut s = ball(0.03);
    let (min, max) = (DVec3::new(0.0, 0.0, 0.01), DVec3::new(0.1, 0.08, 0.09));
    s.object.source = BodySource::Analytic(Analytic::Box { min, max });
    s.masses.clear();
    s.planes[0].normal = DVec3::Z;
    // Half as stiff as the default: where the whole bottom lands in one step, a solve to the same share of the forces leaves five times as much
    // on the default's. That is 3e-6 m, which the body carries on as a velocity, and one percent of the barrier would drown in it.
    s.planes[0].stiffness = Some(10.0 * youngs_modulus / 0.03);
    s.material.youngs_modulus = youngs_modulus;
    s.material.poisson_ratio = 0.45;
    s.material.stiffness_damping = 0.002;
    s.initial.velocity = DVec3::new(0.3, 0.1, -4.0);
    s.initial.angular_velocity = DVec3::new(0.5, 1.0, 0.3);
    s.time = Time { step: 0.01, steps, start: 0.0, ..Time::weighted(0.6) };
    s
}

// Newton's 2e-7 of the forces, which here strain the body of 0.1 m by several hundred per cent, and rounding of u: some 1e-7 m a step,
// which a body that folds does not forget; eight steps.
const CRUSHED: f64 = 5e-6;

#[test]
fn crushed_bodies_are_solved_to_the_end_as_on_the_cpu_and_one_percent_shows() {
    let Some([gpu, wrong]) = right_and_stiffer() else { return };
    for (youngs_modulus, steps) in [(300.0, 7), (1000.0, 8)] {
        let plan = plan(&thrown(youngs_modulus, steps));
        let row = std::slice::from_ref(&plan.theta);
        let exact = states(&CpuBackend, &plan, row).0;
        let worst = |gpu: &Arc<Gpu>, tuning: Tuning| {
            let (moments, evaluations) = states(&GpuBackend::on(gpu.clone()).tuned(tuning), &plan, row);
            let far: Vec<f64> = moments.iter().zip(&exact).map(|(a, b)| off(&a[0].0, &b[0].0)).collect();
            println!("{youngs_modulus} Pa: {far:?}");
            assert!(evaluations[0].failure.is_none(), "{youngs_modulus} Pa, {tuning:?}: {:?}", evaluations[0].failure);
            far.into_iter().fold(0.0, f64::max)
        };
        let count: usize = exact.iter().map(|m| guarded(&plan, &m[0].0)).sum();
        assert!(count > 5, "the barrier acts {count} times");
        for tuning in [ONE, MANY[0], MANY[1]] {
            let d = worst(&gpu, tuning);
            assert!(d < CRUSHED, "{youngs_modulus} Pa, {tuning:?}: {d:.1e} m");
        }
        let d = worst(&wrong, ONE);
        assert!(d > 3.0 * CRUSHED, "1 % of the barrier makes {d:.1e} m");
    }
}

#[test]
fn same_bits_in_both_variants_where_the_barrier_acts() {
    let Some(gpu) = device(Some(Lanes::Memory)) else { return };
    let plan = plan(&pressed());
    let row = std::slice::from_ref(&plan.theta);
    for tuning in [ONE, MANY[1]] {
        let run = |gpu: &Arc<Gpu>| states(&GpuBackend::on(gpu.clone()).tuned(tuning), &plan, row).0;
        let first = run(&gpu);
        assert!(guarded(&plan, &first[6][0].0) > 0);
        assert!(first == run(&gpu), "two runs differ");
        if crate::adapters().iter().any(|a| a.subgroups) {
            let Some(gpu) = device(Some(Lanes::Subgroup)) else { return };
            assert!(first == run(&gpu), "subgroups and workgroup memory differ");
        }
    }
}
