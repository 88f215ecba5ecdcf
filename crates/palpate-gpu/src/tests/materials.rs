//! Materials: every twin against its law from strains of 1e-5 up, whole evaluations against the CPU, and guesses at which a material does
//! not exist.

use super::effects::{Noise, compare_within, with};
use super::forward::{off, states};
use super::scenes::{ball, device, plan};
use crate::GpuBackend;
use crate::costs::rollout_tests::{seen, watched};
use crate::device::Gpu;
use crate::device::Maker as _;
use crate::device::pipelines::pass;
use crate::device::recorder::{Args, Recorder, Size};
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_cpu::terms::elastic_cells::corners;
use palpate_model::cutcells::corotation::CellPose;
use palpate_model::cutcells::grid::SIGNS;
use palpate_model::materials::{ALL, Model};
use palpate_model::mechanics::lame::lame;
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::scene::{Analytic, BodySource, Scene};
use std::collections::HashMap;

/// H row by row, λ and μ.
const INPUTS: usize = 11;

/// Input and a change of it, as single precision has them.
struct Probe {
    z: [f64; INPUTS],
    change: [f64; INPUTS],
}

/// A gradient with entries of about `size`, of a material with Poisson's ratio anywhere.
fn probe(size: f64, noise: &mut Noise) -> Probe {
    let (lambda, mu) = lame(1.0, noise.uniform(0.05, 0.45));
    let mut z = [0.0; INPUTS];
    z[..9].iter_mut().for_each(|h| *h = size * noise.uniform(-1.0, 1.0));
    (z[9], z[10]) = (lambda, mu);
    let z = z.map(|v| f64::from(v as f32));
    Probe { z, change: z.map(|v| f64::from((v * noise.uniform(-1.0, 1.0)) as f32)) }
}

/// Value, derivatives by H, change of these along the probe's.
fn exact(model: &Model, p: &Probe) -> Vec<f64> {
    let h = std::array::from_fn(|i| std::array::from_fn(|j| p.z[3 * i + j]));
    let (lambda, mu) = (p.z[9], p.z[10]);
    let (stress, tangent) = model.law.stress(&h, lambda, mu);
    let moduli = model.law.by_moduli(&h, lambda, mu);
    let along = |k: usize| {
        let by_h: f64 = tangent[k].iter().zip(&p.change).map(|(t, d)| t * d).sum();
        by_h + moduli[0][k] * p.change[9] + moduli[1][k] * p.change[10]
    };
    [vec![model.law.value(&h, lambda, mu)], stress.to_vec(), (0..9).map(along).collect()].concat()
}

/// What its twin says on the device.
fn answers(gpu: &Gpu, number: usize, probes: &[Probe]) -> Vec<Vec<f64>> {
    let data: Vec<f32> = probes.iter().flat_map(|p| p.z.into_iter().chain(p.change)).map(|v| v as f32).collect();
    let made = gpu.upload("probes", &data).and_then(|d| Ok((d, gpu.buffer("answers", 80 * probes.len() as u64)?)));
    let (data, answers) = made.unwrap_or_else(|e| panic!("{e}"));
    let (world, mut groups, mut times) = (HashMap::new(), HashMap::new(), HashMap::new());
    let mut r = Recorder::new(gpu, &world, &mut groups, false);
    let args = Args { step: probes.len() as u32, extra: number as u32, ..Args::default() };
    let size = Size::All { members: 1, groups: probes.len().div_ceil(64) };
    r.run(pass::PROBE_MATERIAL, &[("probes", &data), ("answers", &answers)], size, args);
    r.submit(&mut times);
    let found: Vec<[f32; 20]> = gpu.download(&answers, probes.len()).unwrap_or_else(|e| panic!("{e}"));
    found.iter().map(|a| a[..19].iter().map(|v| f64::from(*v)).collect()).collect()
}

/// Largest difference of one probe's value, derivatives or changes, over the size of these for the same probe.
fn worst(found: &[Vec<f64>], right: &[Vec<f64>]) -> f64 {
    let groups = [0..1, 1..10, 10..19];
    let apart = |a: &[f64], b: &[f64]| {
        let size = b.iter().fold(1e-30, |m: f64, v| m.max(v.abs()));
        a.iter().zip(b).map(|(x, y)| (x - y).abs() / size).fold(0.0, |m: f64, d| if d > m || d.is_nan() { d } else { m })
    };
    let all = found.iter().zip(right).flat_map(|(a, b)| groups.clone().map(|g| apart(&a[g.clone()], &b[g])));
    all.fold(0.0, |m: f64, d| if d > m || d.is_nan() { d } else { m })
}

/// Materials that cells are not made of already, with their numbers.
fn nonlinear() -> impl Iterator<Item = (usize, &'static Model)> {
    ALL.iter().enumerate().filter(|(_, m)| !m.is_linear && m.has_twin())
}

#[test]
fn every_material_agrees_with_its_twin_at_any_strain_and_one_percent_shows() {
    const TOLERANCE: f64 = 1e-5;
    let Some(gpu) = device(None) else { return };
    for (number, model) in nonlinear() {
        for size in [1e-5, 1e-4, 1e-3, 1e-2, 0.1, 0.3, 0.5] {
            let mut noise = Noise::new(3 + number as u64);
            let exists = |p: &Probe| exact(model, p).iter().all(|v| v.is_finite());
            // Close to no volume at all, the volume itself has few digits.
            let roomy = |p: &Probe| p.z[0] + p.z[4] + p.z[8] > -0.6;
            let all = std::iter::repeat_with(|| probe(size, &mut noise)).filter(|p| exists(p) && roomy(p));
            let mut probes: Vec<Probe> = all.take(200).collect();
            let found = answers(&gpu, number, &probes);
            let right = |probes: &[Probe]| -> Vec<Vec<f64>> { probes.iter().map(|p| exact(model, p)).collect() };
            let off = worst(&found, &right(&probes));
            println!("{} at {size}: {off:.1e}", model.name);
            assert!(off < TOLERANCE, "{} at {size}: {off:.1e}", model.name);
            probes.iter_mut().for_each(|p| p.z[10] *= 1.01);
            assert!(worst(&found, &right(&probes)) > TOLERANCE, "{}: 1 % is not seen", model.name);
        }
    }
}

#[test]
fn where_a_material_does_not_exist_its_twin_is_finite_and_enormous() {
    let Some(gpu) = device(None) else { return };
    let squeezed = |by: f64| {
        let mut p = probe(0.0, &mut Noise::new(1));
        p.z[0] = by;
        p
    };
    for (number, model) in nonlinear() {
        let found = answers(&gpu, number, &[squeezed(-1.0), squeezed(-1.7), squeezed(-0.9)]);
        assert!(found.iter().flatten().all(|v| v.is_finite()), "{}: {found:?}", model.name);
        let exists = exact(model, &squeezed(-1.7))[0].is_finite();
        assert_eq!(found[1][0] < 1e25, exists, "{}: {found:?}", model.name);
        assert!(found[2][0] < 10.0, "{}: {found:?}", model.name);
    }
}

/// A block of whole cells: on cut ones a softening material can be softer than what they have.
fn block(mut s: Scene, model: &'static Model) -> Scene {
    let (min, max) = (DVec3::new(0.0, 0.0, 0.003), DVec3::new(0.06, 0.06, 0.093));
    s.object.source = BodySource::Analytic(Analytic::Box { min, max });
    s.material.model = model;
    s.material.youngs_modulus *= 2.0;
    s.observation = watched();
    s
}

/// A block thrown into the ground.
fn thrown(model: &'static Model) -> Scene {
    let mut s = block(ball(0.03), model);
    s.initial.velocity.z = -1.0;
    s.time.steps = 3;
    s
}

#[test]
fn evaluations_of_bodies_of_every_material_agree() {
    for (_, model) in nonlinear() {
        println!("{}", model.name);
        compare_within(&seen(&thrown(model)), 1e-3);
    }
}

#[test]
fn evaluations_of_a_body_of_a_material_and_laws_agree() {
    let mut s = thrown(palpate_model::materials::find("neo-hookean").unwrap_or_else(|| panic!("it is there")));
    s.material.youngs_modulus *= 2.0;
    // At the others' 1 m/s one point of the first frame lies on a seam of its cell's distances, where their slope jumps: in single precision
    // it takes the other side's.
    s.initial.velocity.z = -0.8;
    s.time.steps = 2;
    with(&mut s, "structural-damping", &[("loss", &[1.0])]);
    with(&mut s, "rest-shape", &[("stretch", &[0.04, -0.02, 0.03])]);
    compare_within(&seen(&s), 1e-3);
}

/// Largest difference of displacements of all states of two runs [m].
fn apart(a: &[Vec<super::forward::Moment>], b: &[Vec<super::forward::Moment>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| off(&a[0].0, &b[0].0)).fold(0.0, f64::max)
}

#[test]
fn states_of_every_material_agree_and_one_percent_of_any_modulus_or_another_material_shows() {
    // As in `forward`, where a stiffer blow leaves more.
    const TOLERANCE: f64 = 2e-6;
    let Some(gpu) = device(None) else { return };
    for (_, model) in nonlinear() {
        let plan = plan(&thrown(model));
        let (right, said) = states(&CpuBackend, &plan, std::slice::from_ref(&plan.theta));
        assert!(said[0].failure.is_none(), "{:?}", said[0].failure);
        let apart_from = |plan: &Plan, row: &[f64]| {
            let (found, said) = states(&GpuBackend::on(gpu.clone()), plan, &[row.to_vec()]);
            assert!(said[0].failure.is_none(), "{:?}", said[0].failure);
            apart(&found, &right)
        };
        let own = apart_from(&plan, &plan.theta);
        println!("{}: {own:.1e} m", model.name);
        assert!(own < TOLERANCE, "{}: {own:.1e} m", model.name);
        for key in [ParamKey::YoungsModulus, ParamKey::PoissonRatio] {
            let mut row = plan.theta.clone();
            row[plan.layout.index(key)] *= 1.01;
            let off = apart_from(&plan, &row);
            assert!(off > 2.0 * TOLERANCE, "{}: 1 % of {key:?} is not seen: {off:.1e} m", model.name);
        }
        for other in ALL.iter().filter(|m| *m != model && m.has_twin()) {
            let off = apart_from(&super::scenes::plan(&thrown(other)), &plan.theta);
            assert!(off > 2.0 * TOLERANCE, "{} for {} is not seen: {off:.1e} m", other.name, model.name);
        }
    }
}

/// Cells whose mean strain leaves no volume where the body flies freely from a state.
fn outside(plan: &Plan, u: &[DVec3], v: &[DVec3]) -> usize {
    let (dt, h) = (plan.clock.step, plan.body.length);
    let flown: Vec<_> = u.iter().zip(v).map(|(u, v)| *u + *v * dt).collect();
    let volume = |e: usize| {
        let q = CellPose::new(&corners(&plan.body, e, &flown), h).q;
        let mut f = [[0.0; 3]; 3];
        for (i, row) in f.iter_mut().enumerate() {
            for (j, v) in row.iter_mut().enumerate() {
                let mean = |a: usize, b: usize| (0..8).map(|k| 0.25 / h * SIGNS[k][b] * q[3 * k + a]).sum::<f64>();
                *v = 0.5 * (mean(i, j) + mean(j, i)) + f64::from(u8::from(i == j));
            }
        }
        glam::DMat3::from_cols_array_2d(&f).determinant()
    };
    (0..plan.body.cells().len()).filter(|e| volume(*e) <= 0.0).count()
}

#[test]
fn a_guess_at_which_a_material_does_not_exist_is_drawn_back() {
    let Some(gpu) = device(None) else { return };
    let mut scene = thrown(palpate_model::materials::find("neo-hookean").unwrap_or_else(|| panic!("it is there")));
    scene.material.youngs_modulus *= 10.0;
    scene.initial.velocity.z = -6.0;
    let plan = plan(&scene);
    let theta = std::slice::from_ref(&plan.theta);
    let (right, said) = states(&CpuBackend, &plan, theta);
    assert!(said[0].failure.is_none(), "{:?}", said[0].failure);
    let counts: Vec<usize> = right.iter().map(|m| outside(&plan, &m[0].0, &m[0].1)).collect();
    assert!(counts[..plan.clock.steps].iter().any(|n| *n > 0), "no guess is impossible: {counts:?}");
    let (found, said) = states(&GpuBackend::on(gpu), &plan, theta);
    assert!(said[0].failure.is_none(), "{:?}", said[0].failure);
    let off = apart(&found, &right);
    println!("impossible cells {counts:?}, {off:.1e} m");
    assert!(off < 1e-5, "{off:.1e} m");
}
