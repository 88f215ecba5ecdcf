//! Effects: every law of points against its twin at random states, and whole evaluations with many effects at once against the CPU.

use super::scenes::{ball, device, held};
use crate::GpuBackend;
use crate::costs::rollout_tests::{assert_agreement, seen, watched};
use crate::costs::rows_tests::apart as apart_by_row;
use crate::device::Gpu;
use crate::device::Maker as _;
use crate::device::pipelines::pass;
use crate::device::recorder::{Args, Recorder, Size};
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Backend as _, Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::effects::law::{Asks, COMMON, Followed, MOST, OLD, PLANE, Place, Point, STIFFNESS, TIME};
use palpate_model::effects::{self, ALL, Effect, Law, Site, Unstated};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::scene::Scene;
use std::collections::HashMap;

/// Random numbers in [low, high): a linear congruential generator (Knuth's constants).
pub(super) struct Noise(u64);

impl Noise {
    pub(super) fn new(seed: u64) -> Noise {
        Noise(seed)
    }

    pub(super) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn vector(&mut self, size: f64) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| self.uniform(-size, size)))
    }
}

/// What a law is asked, every number as single precision has it.
struct Probe {
    place: Place,
    z: Vec<f64>,
    change: Vec<f64>,
    weight: DVec3,
}

fn single(v: f64) -> f64 {
    f64::from(v as f32)
}

/// A patch that touches a plane, slides, and has been there before.
fn probe(law: &Law, noise: &mut Noise) -> Probe {
    let normal = noise.vector(1.0).normalize();
    let width = single(1e-3);
    let height = noise.uniform(-0.1, 0.1);
    let old = normal * (height + width * noise.uniform(-2.0, 0.8)) + normal.cross(noise.vector(1.0)) * 0.02;
    let x = old + 2e-4 * noise.vector(1.0);
    let rest = (old + 0.01 * noise.vector(1.0)).to_array().map(single);
    let mut z = vec![0.0; COMMON + law.params.len()];
    let (velocity, gravity) = (noise.vector(1.0), noise.vector(9.81));
    for i in 0..3 {
        (z[i], z[OLD + i], z[6 + i], z[9 + i], z[PLANE + i]) = (x[i], old[i], velocity[i], gravity[i], normal[i]);
    }
    (z[STIFFNESS], z[PLANE + 3], z[PLANE + 4]) = (3e5, height, 2e5);
    z[TIME] = noise.uniform(0.0, 1.0);
    for (p, v) in law.params.iter().zip(&mut z[COMMON..]) {
        *v = match p.default {
            Unstated::Center | Unstated::Reference => old[usize::from(p.axis.unwrap_or(0))] + 0.01 * noise.uniform(-1.0, 1.0),
            _ => (p.typical * noise.uniform(0.3, 1.5)).clamp(p.lower.max(-1e9), p.upper.min(1e9)),
        };
    }
    let z: Vec<f64> = z.into_iter().map(single).collect();
    let sizes = z.iter().enumerate().map(|(i, v)| if i < 6 { width } else { v.abs().max(1e-3) });
    let change = sizes.map(|s| single(s * noise.uniform(-1.0, 1.0))).collect();
    let place = Place {
        rest: DVec3::from_array(rest),
        normal: DVec3::Z,
        measure: single(noise.uniform(0.5, 2.0)),
        width,
        rate: 100.0,
        inertia: single(1e4 / 0.6),
        momentum: single(1e2 / 0.55),
        followed: Followed::default(),
    };
    Probe { place, z, change, weight: DVec3::from_array(noise.vector(1.0).to_array().map(single)) }
}

/// Force, second derivative, derivative along the change, transposes by the old position and velocity: names and numbers.
const PARTS: [(&str, usize); 5] =
    [("force", 3), ("second derivative", 6), ("along a change", 3), ("by the old place", 3), ("by the old velocity", 3)];

/// What the law says in double precision.
fn exact(point: &dyn Point, p: &Probe) -> Vec<f64> {
    let h = point.hessian(&p.place, &p.z);
    let mut back = [0.0; 6];
    point.transposed(&p.place, &p.z, p.weight.to_array(), OLD..OLD + 6, &mut back);
    let six = [h[0][0], h[1][1], h[2][2], h[0][1], h[0][2], h[1][2]];
    let (force, along) = (point.gradient(&p.place, &p.z), point.along(&p.place, &p.z, &p.change));
    [&force[..], &six, &along, &back].concat()
}

/// What its twin says on the device.
fn answers(gpu: &Gpu, law: usize, probes: &[Probe]) -> Vec<Vec<f64>> {
    let mut data: Vec<f32> = Vec::new();
    let inputs = COMMON + MOST;
    for p in probes {
        let (x, w) = (p.place.rest, p.weight);
        let head =
            [p.place.measure, p.place.width, p.place.rate, p.place.inertia, p.place.momentum, x.x, x.y, x.z, w.x, w.y, w.z];
        let padded = |v: &[f64]| [v, &vec![0.0; inputs - v.len()]].concat();
        data.extend([&head[..], &padded(&p.z), &padded(&p.change)].concat().iter().map(|v| *v as f32));
    }
    let made = gpu.upload("probes", &data).and_then(|d| Ok((d, gpu.buffer("answers", 96 * probes.len() as u64)?)));
    let (data, answers) = made.unwrap_or_else(|e| panic!("{e}"));
    let (world, mut groups, mut times) = (HashMap::new(), HashMap::new(), HashMap::new());
    let mut r = Recorder::new(gpu, &world, &mut groups, false);
    let args = Args { step: probes.len() as u32, extra: law as u32, ..Args::default() };
    let size = Size::All { members: 1, groups: probes.len().div_ceil(64) };
    r.run(pass::PROBE_LAW, &[("probes", &data), ("answers", &answers)], size, args);
    r.submit(&mut times);
    let found: Vec<[f32; 4]> = gpu.download(&answers, 6 * probes.len()).unwrap_or_else(|e| panic!("{e}"));
    found
        .chunks_exact(6)
        .map(|a| {
            let rows = [&a[0][..3], &a[1], &a[2][..2], &a[3][..3], &a[4][..3], &a[5][..3]];
            rows.concat().into_iter().map(f64::from).collect()
        })
        .collect()
}

/// Parts in which two sets of answers differ by more than this share of the part's largest number. Distances from planes are
/// differences of positions around 0.1 m, rounded to 7e-9 m, over the layer's 1e-3 m; a force that grows with the third power of the
/// depth and its derivatives multiply that by a few.
fn apart(found: &[Vec<f64>], right: &[Vec<f64>]) -> Vec<(&'static str, f64)> {
    const TOLERANCE: f64 = 2e-4;
    let mut start = 0;
    let mut out = Vec::new();
    for (name, count) in PARTS {
        let range = start..start + count;
        start += count;
        let size = right.iter().flat_map(|r| &r[range.clone()]).fold(1e-12, |m: f64, v| m.max(v.abs()));
        let off = found.iter().zip(right).flat_map(|(f, r)| range.clone().map(|i| (f[i] - r[i]).abs())).fold(0.0, f64::max);
        if off.is_nan() || off > TOLERANCE * size {
            out.push((name, off / size));
        }
    }
    out
}

#[test]
fn every_law_of_points_agrees_with_its_twin() {
    let Some(gpu) = device(None) else { return };
    for (number, law) in ALL.iter().enumerate() {
        let (point, on_patches) = match law.site {
            Site::Nodes(p) => (p, false),
            Site::Surface(p) | Site::Contact(p) => (p, true),
            _ => continue,
        };
        if law.asks() != Asks::Nothing {
            continue;
        }
        let mut noise = Noise::new(5 + number as u64);
        let probes: Vec<Probe> =
            std::iter::repeat_with(|| probe(law, &mut noise)).filter(|p| !point.skips(&p.place, &p.z)).take(100).collect();
        let right: Vec<Vec<f64>> = probes.iter().map(|p| exact(point, p)).collect();
        let found = answers(&gpu, number, &probes);
        assert_eq!(apart(&found, &right), [], "{}", law.kind);
        // The pass of patches relies on this.
        assert!(!on_patches || right.iter().all(|r| r[15..] == [0.0; 3]), "{}: reads the velocity", law.kind);
        // One percent in its first parameter shows wherever the law has something to say.
        let mut wrong = probes;
        wrong.iter_mut().for_each(|p| p.z[COMMON] *= 1.01);
        let wrong: Vec<Vec<f64>> = wrong.iter().map(|p| exact(point, p)).collect();
        let seen = apart(&found, &wrong).len();
        println!("{}: 1 % is seen in {seen} parts", law.kind);
        assert!(seen > 0, "{}: 1 % is not seen", law.kind);
    }
}

/// A scene with an effect of this kind.
pub(super) fn with(scene: &mut Scene, kind: &str, values: &[(&str, &[f64])]) {
    let law = effects::find(kind).unwrap_or_else(|| panic!("{kind}"));
    let mut effect = Effect::absent(law);
    for (key, numbers) in values {
        let first = effect.law().params.iter().position(|p| p.key == *key).unwrap_or_else(|| panic!("{key}"));
        numbers.iter().enumerate().for_each(|(a, v)| effect.values[first + a] = Some(*v));
    }
    scene.effects.push(effect);
}

/// Part of the noise (of a cell, of the largest derivative) by which single residuals may differ: 3e-7 m, which is what Newton's method
/// in single precision leaves of a few steps (`forward::CLOSE`).
const CLOSE: f64 = 1e-4;

/// Evaluations of two members with all derivatives by the numbers of effects and by what effects change the derivative of; then every
/// residual of the second with its derivatives, in which one percent of any effect's first number must show.
pub(super) fn compare(plan: &Plan) {
    compare_within(plan, CLOSE);
}

/// The same where single residuals may differ by so much.
pub(super) fn compare_within(plan: &Plan, close: f64) {
    let Some(gpu) = device(None) else { return };
    let own = |k: &ParamKey| match *k {
        ParamKey::Effect { law, slot, .. } => {
            !matches!(ALL[usize::from(law)].params[usize::from(slot)].default, Unstated::Fixed(_) | Unstated::Sharp(_))
        }
        ParamKey::YoungsModulus | ParamKey::Gravity(_) | ParamKey::Density | ParamKey::PoissonRatio => true,
        ParamKey::PlaneHeight(_) | ParamKey::PlaneTheta(_) | ParamKey::TimeStart | ParamKey::AngularVelocity(0) => true,
        _ => false,
    };
    let directions: Vec<usize> = (0..plan.layout.len()).filter(|p| own(&plan.layout.keys[*p])).collect();
    let request = Request { gradient: Wanted::All, sensitivities: directions.clone() };
    // Away from what was measured, so that there is something to explain, and by another effect than the first member's.
    let mut row = plan.theta.clone();
    row[plan.layout.index(ParamKey::YoungsModulus)] *= 1.2;
    for (value, key) in row.iter_mut().zip(&plan.layout.keys) {
        if matches!(key, ParamKey::Effect { slot: 0, .. }) {
            *value *= 0.9;
        }
    }
    let batch = ParamBatch::from_rows(&[plan.theta.clone(), row.clone()]);
    let mut cpu = Rollout::new(CpuBackend, plan, 2).unwrap_or_else(|e| panic!("{e}"));
    let right = cpu.evaluate(&batch, &request);
    let mut rollout = Rollout::new(GpuBackend::on(gpu), plan, 2).unwrap_or_else(|e| panic!("{e}"));
    let found = rollout.evaluate(&batch, &request);
    for (a, b) in found.iter().zip(&right) {
        assert!(a.failure.is_none() && b.failure.is_none(), "{:?} {:?}", a.failure, b.failure);
    }
    for (i, place) in directions.iter().enumerate() {
        println!("direction {i}: {}", plan.layout.keys[*place].spec().path);
    }
    assert_agreement(&found[1], &right[1], &directions);
    let mut linearise = |row: &[f64], along: &[usize]| rollout.linearise(row, along).unwrap_or_else(|e| panic!("{e}"));
    let right = cpu.linearise(&row, &directions).unwrap_or_else(|e| panic!("{e}"));
    let off = apart_by_row(&linearise(&row, &directions), &right, plan);
    println!("single residuals: {off:?}");
    assert!(off.iter().all(|d| *d < close), "{off:?}");
    let right = cpu.linearise(&row, &[]).unwrap_or_else(|e| panic!("{e}"));
    for (place, key) in plan.layout.keys.iter().enumerate() {
        if matches!(*key, ParamKey::Effect { slot: 0, .. }) {
            let mut wrong = row.clone();
            wrong[place] *= 1.01;
            let off = apart_by_row(&linearise(&wrong, &[]), &right, plan);
            println!("{}: 1 % makes {off:?}", key.spec().path);
            assert!(off.iter().any(|d| *d > close), "1 % of {} is not seen: {off:?}", key.spec().path);
        }
    }
}

#[test]
fn evaluations_with_loads_agree() {
    let mut s = ball(0.03);
    s.initial.velocity.z = -1.0;
    s.time.steps = 3;
    s.observation = watched();
    with(&mut s, "uniform-force", &[("force", &[3000.0, -1000.0, 500.0])]);
    with(&mut s, "point-mass", &[("mass", &[0.05]), ("point", &[0.02, 0.01, 0.08]), ("radius", &[0.02]), ("hung", &[0.4])]);
    with(
        &mut s,
        "tether",
        &[("stiffness", &[40.0]), ("attachment", &[-0.03, 0.0, 0.06]), ("anchor", &[-0.1, 0.02, 0.1]), ("radius", &[0.02])],
    );
    with(&mut s, "air-drag", &[("coefficient", &[5.0]), ("fluid_density", &[50.0])]);
    let place: &[(&str, &[f64])] = &[("stiffness", &[0.5]), ("distance", &[0.045]), ("normal", &[-2.0, 0.3, 0.6])];
    with(&mut s, "second-plane", place);
    with(&mut s, "time-offset", &[("offset", &[-4e-3])]);
    compare(&seen(&s));
}

#[test]
fn evaluations_with_contact_and_varying_stiffness_agree() {
    let mut s = ball(0.03);
    // Pressed into the ground and sliding.
    s.object.pose.translation.z = -0.008;
    s.initial.velocity = DVec3::new(0.4, 0.1, -0.6);
    s.time.steps = 3;
    s.time.theta = 0.55;
    s.observation = watched();
    with(&mut s, "coulomb-friction", &[("coefficient", &[0.5])]);
    with(&mut s, "adhesion", &[("pressure", &[600.0]), ("range", &[4e-3])]);
    with(&mut s, "contact-stiffness", &[("change", &[0.4])]);
    with(&mut s, "contact-dissipation", &[("dissipation", &[2.0])]);
    with(&mut s, "stiffness-gradient", &[("slope", &[9.0, 2.0, -4.0])]);
    compare(&seen(&s));
}

#[test]
fn evaluations_of_bodies_of_uneven_material_agree() {
    let parts: &[(&str, &[f64])] = &[("ratio", &[0.9]), ("direction", &[0.6, -0.3, 1.0])];
    let modes: &[(&str, &[f64])] = &[("square", &[1.2, -0.4, 0.8]), ("mixed", &[0.5, -0.7, 0.3])];
    for (kind, values) in [("two-part-stiffness", parts), ("stiffness-modes", modes)] {
        let mut s = ball(0.03);
        s.object.pose.translation.z = -0.006;
        s.initial.velocity.z = -0.6;
        s.time.steps = 3;
        s.observation = watched();
        with(&mut s, kind, values);
        with(&mut s, "density-gradient", &[("slope", &[9.0, 3.0, -6.0])]);
        compare(&seen(&s));
    }
}

#[test]
fn evaluations_of_a_held_body_that_creeps_agree() {
    let mut s = held(0.03);
    s.time.steps = 1;
    s.observation = watched();
    let by: [&[f64]; 3] = [&[4e3, 0.0, 1e3], &[0.0, 5e3, -2e3], &[3e3, 1e3, 4e3]];
    with(
        &mut s,
        "slack",
        &[("force", &[500.0, 200.0, -300.0]), ("by_x", by[0]), ("by_y", by[1]), ("by_z", by[2]), ("width", &[0.5])],
    );
    with(&mut s, "creep", &[("fraction", &[0.6]), ("time", &[0.005])]);
    with(&mut s, "inclusion", &[]);
    s.effects[2].values[0] = Some(0.8);
    with(&mut s, "density-inclusion", &[]);
    s.effects[3].values[0] = Some(0.7);
    compare(&seen(&s));
}

/// A stress-free shape that differs in every mode, of a body that rests against its ghost penalty.
fn bent(s: &mut Scene) {
    s.solver.ghost = 0.5;
    let bends: [(&str, &[f64]); 3] = [("bend_x_to_z", &[1.5]), ("bend_z_to_y", &[-1.0]), ("bend_y_to_x", &[0.8])];
    with(s, "rest-shape", &[&[("stretch", [0.04, -0.02, 0.03].as_slice())], bends.as_slice()].concat());
}

#[test]
fn evaluations_of_a_body_of_another_shape_agree() {
    let mut s = ball(0.03);
    s.time.steps = 3;
    s.observation = watched();
    bent(&mut s);
    compare(&seen(&s));
}

#[test]
fn evaluations_of_a_body_of_another_shape_in_soft_slipping_clamps_agree() {
    let mut s = held(0.03);
    s.time.steps = 2;
    s.observation = watched();
    bent(&mut s);
    with(&mut s, "compliant-clamp", &[("layer", &[0.004])]);
    let turning: &[f64] = &[0.5, 1.0, -0.7];
    with(
        &mut s,
        "clamp-slip",
        &[("offset", &[0.002, -0.001, 0.003]), ("turn", &[0.05, 0.1, -0.08]), ("drift", &[0.1, 0.0, -0.2]), ("turning", turning)],
    );
    with(&mut s, "stiffness-gradient", &[("slope", &[6.0, 2.0, -4.0])]);
    compare(&seen(&s));
}

#[test]
fn evaluations_of_a_body_in_clamps_with_moved_edges_agree() {
    let mut s = held(0.03);
    // What the edge takes turns with the clamp: not for a body that hangs by half its size. So it is stiffer, and the ground higher.
    s.material.youngs_modulus *= 4.0;
    s.planes[0].point.z += 0.012;
    s.time.steps = 2;
    s.observation = watched();
    with(&mut s, "clamp-edge", &[("shift", &[0.008])]);
    with(&mut s, "compliant-clamp", &[("layer", &[0.004])]);
    compare(&seen(&s));
    // It holds less than stated.
    s.effects[0].values[0] = Some(-0.005);
    compare(&seen(&s));
}

#[test]
fn more_laws_of_cells_than_kernels_have_room_for_are_refused() {
    let Some(gpu) = device(None) else { return };
    let mut s = ball(0.05);
    let refusal = |s: &Scene| {
        GpuBackend::on(gpu.clone()).build(&super::scenes::plan(s), 1).err().map(|e| e.to_string()).unwrap_or_default()
    };
    (0..16).for_each(|_| with(&mut s, "strain-stiffening", &[]));
    assert_eq!(refusal(&s), "");
    with(&mut s, "strain-stiffening", &[]);
    assert!(refusal(&s).starts_with("the GPU backend does not support more than 16 laws of cells"));
}
