//! The passes of derivatives, those of a step's old forces and those of conjugate gradients by many workgroups, at one given state,
//! against the same quantities of the CPU; each comparison must see one percent.

use super::faults::{BALANCE, Fault};
use super::passes::{Exact, FORCES, flat, given, load, scene, single, stepwise, three, vectors, with_context};
use super::scenes::{device, plan};
use crate::device::pipelines::pass;
use crate::device::pipelines::shared::asks;
use crate::passes::{ALL, Passes, Per};
use crate::world::SOLVING;
use crate::{GpuBackend, Product, Tuning};
use glam::DVec3;
use palpate_cpu::terms::{Context, Equation, PastChange, Rates, Weights};
use palpate_engine::{Backend, Direction, Request, Wanted};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;

/// What was computed by one pass or by several together: name, numbers.
pub(super) type Part = (String, Vec<f64>);

/// Part of the largest number that may differ. Derivatives by the old state and by parameters cancel more than forces do (two states,
/// their difference over a step): ten times as much as forces.
const ALLOWED: f64 = 10.0 * FORCES;

/// Vectors that derivatives are taken along: a displacement, and a velocity or an adjoint.
fn along(plan: &Plan) -> [Vec<DVec3>; 2] {
    let wave = |x: &DVec3, f: f64| DVec3::new((f * x.x).sin() + 0.3, (f * x.y + 1.0).cos(), (f * (x.x + x.z)).sin() - 0.2);
    let of = |f: f64, size: f64| plan.body.nodes.iter().map(|x| size * wave(x, f)).collect();
    [of(30.0, 1e-3), of(50.0, 0.1)]
}

/// A direction in which every parameter moves by some part of its size.
fn dense(plan: &Plan) -> Vec<f64> {
    let size = |(p, key): (usize, &ParamKey)| (p as f64 + 0.5).sin() * plan.theta[p].abs().max(0.1 * key.spec().typical.min(1.0));
    plan.layout.keys.iter().enumerate().map(size).collect()
}

fn name_of(key: ParamKey) -> String {
    format!("column of {}", key.spec().path)
}

/// The device's numbers; derivatives of the whole in these `sizes`.
pub(super) fn found(backend: &GpuBackend, plan: &Plan, sizes: &[f64]) -> Vec<Part> {
    let (world, n) = (&stepwise(backend, plan), plan.body.nodes.len());
    let tally = backend.new_tally(world, &Request { gradient: Wanted::All, ..Request::default() });
    let (now, next) = (backend.new_state(world), backend.new_state(world));
    let (mut adj, mut adj_now) = (backend.new_adjoint(world), backend.new_adjoint(world));
    backend.clear_adjoint(&mut adj);
    backend.clear_adjoint(&mut adj_now);
    let run = |work: &dyn Fn(&mut Passes)| world.record(|r| work(&mut Passes::new(world, r, Some(0), &now, &next, &tally)));
    let write = |buffer: &wgpu::Buffer, v: &[DVec3]| {
        let v: Vec<[f32; 4]> = v.iter().map(single).collect();
        world.gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(&v));
    };
    let read = |buffer: &wgpu::Buffer, items: usize| -> Vec<[f32; 4]> {
        world.gpu.download(buffer, items).unwrap_or_else(|e| panic!("{e}"))
    };
    let quantum = f64::from(world.geometry.shape.quantum);
    let all: Vec<[DVec3; 3]> = plan.body.nodes.iter().map(|x| given(*x)).collect();
    let whole: Vec<DVec3> = all.iter().map(|a| (a[0] / quantum).round() * quantum).collect();
    let rest = all.iter().zip(&whole).map(|(a, w)| a[0] - *w);
    write(&now.0.buffer, &whole.iter().copied().chain(rest).chain(all.iter().map(|a| a[1])).collect::<Vec<_>>());
    run(&|s| {
        s.list();
        s.prepare();
        s.run(pass::PREDICT, ALL, Per::Node, 0);
    });
    let mut parts = vec![("press_old and gather_old".into(), three(&read(&world.buffers["old_force"], n)))];
    write(&world.buffers["increment"], &all.iter().map(|a| a[2]).collect::<Vec<_>>());
    run(&|s| {
        s.run(pass::PLACE_NEXT, ALL, Per::Node, 0);
        s.run(pass::FINISH_STEP, ALL, Per::Node, 0);
        s.linearise();
    });
    let directions: Vec<Direction> = (0..plan.layout.len()).map(Direction::Parameter).collect();
    for (key, rates) in plan.layout.keys.iter().zip(&*world.rates(&directions)) {
        run(&|s| s.push(rates));
        parts.push((name_of(*key), three(&read(&world.buffers["column"], n))));
    }
    // All of them at once are their sum.
    let dense = world.rates(&[Direction::Dense(dense(plan))]);
    run(&|s| s.push(&dense[0]));
    parts.push((DENSE.into(), three(&read(&world.buffers["column"], n))));
    let [u, v] = along(plan);
    write(&world.buffers[SOLVING], &v);
    run(&|s| s.pull(&tally));
    let gradient = backend.read(world, &tally).remove(0).gradient;
    parts.push((PULL.into(), gradient.iter().zip(sizes).map(|(g, size)| g / size).collect()));
    run(&|s| s.back(&now.0.buffer, &adj.0.buffer, &adj_now.0.buffer));
    let back = read(&adj_now.0.buffer, 2 * n);
    parts.push(("couple_old and step_back, displacement".into(), three(&back[..n])));
    parts.push(("couple_old and step_back, velocity".into(), three(&back[n..])));
    let from = world.lend(2);
    write(&from.buffer, &[u, v].concat());
    write(&world.buffers["column"], &vec![DVec3::ZERO; n]);
    run(&|s| {
        let (from, flight) = (&from.buffer, &world.buffers["trial"]);
        s.run_with(pass::FLY_TANGENT, ALL, Per::Node, 0, &[("tangent", from), ("flight", flight)]);
        s.run_with(pass::SUM_FLIGHT, ALL, Per::Node, 0, &[("probe", flight)]);
        s.along_past(&now.0.buffer, from, true);
    });
    parts.push(("couple_old and sum_old".into(), three(&read(&world.buffers["rhs"], n))));
    write(&world.buffers["rhs"], &load(plan));
    // By block-Jacobi alone: what the second level does is a test of its own.
    let none = vec![0u8; world.buffers["coarse"].size() as usize];
    world.gpu.queue.write_buffer(&world.buffers["coarse"], 0, &none);
    run(&|s| {
        s.begin_column(0);
        s.list();
        s.begin_cg(asks::FOR_DERIVATIVE);
        s.precondition();
        s.iterate(0);
        s.iterate(1);
        s.iterate(0);
    });
    parts.push(("multiply_rows and advance_cg".into(), flat(&vectors(&read(&world.buffers[SOLVING], n)))));
    parts
}

/// The CPU's, and the sizes of the terms of each derivative of the whole.
pub(super) fn exact(plan: &Plan) -> (Vec<Part>, Vec<f64>) {
    let a = Exact::new(plan, given);
    let dt = plan.clock.step;
    let [u, v] = along(plan);
    with_context(plan, given, |c, u1| {
        let mut parts = vec![("press_old and gather_old".into(), flat(&old_forces(c)))];
        let mut equation = Equation::new(c);
        equation.residual(u1);
        let mut all = vec![DVec3::ZERO; u1.len()];
        let (mut gradient, mut sizes) = (vec![0.0; plan.layout.len()], vec![1.0; plan.layout.len()]);
        for (p, key) in plan.layout.keys.iter().enumerate() {
            let mut unit = vec![0.0; plan.layout.len()];
            unit[p] = 1.0;
            let column = equation.by_coefficients(u1, &c.coefficients.along(plan, &unit));
            all.iter_mut().zip(&column).for_each(|(sum, c)| *sum += dense(plan)[p] * *c);
            parts.push((name_of(*key), flat(&column)));
            if column.iter().any(|c| *c != DVec3::ZERO) {
                let terms = || column.iter().zip(&v).map(|(c, z)| c.dot(*z));
                sizes[p] = terms().map(f64::abs).sum();
                gradient[p] = -terms().sum::<f64>() / sizes[p];
            }
        }
        parts.push((DENSE.into(), flat(&all)));
        parts.push((PULL.into(), gradient));
        // What is free of inertia on the device is the sum of two terms here whose inertia cancels.
        let back = equation.by_past_transposed(u1, &v);
        let to_u: Vec<DVec3> = back.u.iter().zip(&back.each[0]).map(|(a, b)| *a + *b).collect();
        let sum = |x: &[DVec3], f: f64, y: &[DVec3]| -> Vec<DVec3> { x.iter().zip(y).map(|(x, y)| -(f * *x + *y)).collect() };
        parts.push(("couple_old and step_back, displacement".into(), flat(&sum(&a.product(&v), 1.0, &to_u))));
        parts.push(("couple_old and step_back, velocity".into(), flat(&sum(&a.product(&v), dt, &back.v))));
        let by_past = equation.by_past(u1, &PastChange { u: &u, v: &v, each: &[&u] });
        let flight: Vec<DVec3> = u.iter().zip(&v).map(|(u, v)| *u + dt * *v).collect();
        parts.push(("couple_old and sum_old".into(), flat(&sum(&a.product(&flight), 1.0, &by_past))));
        parts.push(("multiply_rows and advance_cg".into(), flat(&three_iterations(&a, &load(plan)))));
        (parts, sizes)
    })
}

/// The old state's forces that a solve takes over: of cells and clamps with their weight, and all of the ghost penalty's.
fn old_forces(c: Context) -> Vec<DVec3> {
    let none = vec![DVec3::ZERO; c.past.u.len()];
    let mut still = c.coefficients.clone();
    (still.physics.gravity, still.physics.mass_damping) = (DVec3::ZERO, 0.0);
    // What is lost on the way is no force of the old state.
    still.physics.viscosity = None;
    let mut smooth = c.plan.clone();
    smooth.solver.ghost = 0.0;
    let inertia = c.inertia.map(|t| Rates { displacement: 0.0, velocity: 0.0, ..t });
    let at = |plan: &Plan, rate: f64| {
        let weights = Weights { new: 0.0, rate, ..c.weights };
        let own = Context { plan, coefficients: &still, planes: &[], effects: &[], inertia, weights, ..c };
        Equation::new(own).residual(&none)
    };
    let rate = c.weights.rate;
    let ghosts = at(c.plan, rate).into_iter().zip(at(&smooth, rate)).map(|(with, without)| with - without);
    at(&smooth, 0.0).into_iter().zip(ghosts).map(|(a, b)| a + b).collect()
}

/// The solution after three iterations of conjugate gradients with the inverse diagonal blocks.
fn three_iterations(a: &Exact, load: &[DVec3]) -> Vec<DVec3> {
    let dot = |x: &[DVec3], y: &[DVec3]| x.iter().zip(y).map(|(x, y)| x.dot(*y)).sum::<f64>();
    let add = |x: &mut [DVec3], f: f64, y: &[DVec3]| x.iter_mut().zip(y).for_each(|(x, y)| *x += f * *y);
    let (mut x, mut r) = (vec![DVec3::ZERO; load.len()], load.to_vec());
    let mut p = a.scaled(&r);
    for _ in 0..3 {
        let (q, rz) = (a.product(&p), dot(&r, &a.scaled(&r)));
        let alpha = rz / dot(&p, &q);
        add(&mut x, alpha, &p);
        add(&mut r, -alpha, &q);
        let z = a.scaled(&r);
        let beta = dot(&r, &z) / rz;
        p.iter_mut().zip(&z).for_each(|(p, z)| *p = *z + beta * *p);
    }
    x
}

/// Parts that differ by more than they may.
pub(super) fn apart(found: &[Part], right: &[Part]) -> Vec<String> {
    let names = |p: &[Part]| p.iter().map(|p| (p.0.clone(), p.1.len())).collect::<Vec<_>>();
    assert_eq!(names(found), names(right));
    let mut out = Vec::new();
    for ((name, a), (_, b)) in found.iter().zip(right) {
        let size = b.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let off = a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, |m: f64, d| if d > m || d.is_nan() { d } else { m });
        if size > 0.0 {
            print!("{name} {:.1e}; ", off / size);
        }
        // What does not depend on a parameter is zero on both sides; the old forces are forces.
        if off.is_nan() || off > if name == OLD { FORCES } else { ALLOWED } * size {
            out.push(name.clone());
        }
    }
    println!();
    out
}

/// Along a direction in which all parameters change.
const DENSE: &str = "along all parameters";
/// Derivatives by all parameters at once.
const PULL: &str = "pull";
const BACK_U: &str = "couple_old and step_back, displacement";
const BACK_V: &str = "couple_old and step_back, velocity";
const FORTH: &str = "couple_old and sum_old";
const OLD: &str = "press_old and gather_old";
const CG: &str = "multiply_rows and advance_cg";

/// Parts that must show each fault of [`BALANCE`].
const SHOWN: [&[&str]; 8] = [
    &[OLD, "column of material.poisson_ratio", "column of time.start", PULL, BACK_U, BACK_V, FORTH, CG],
    &[OLD, "column of material.youngs_modulus", PULL, BACK_U, BACK_V, FORTH, CG],
    &["column of material.mass_damping", "column of world.gravity.z", PULL, BACK_V, FORTH, CG],
    &["column of material.density", PULL, BACK_V, FORTH, CG],
    &["column of material.youngs_modulus", BACK_U, BACK_V, FORTH, CG],
    &["column of world.gravity.x", PULL, CG],
    &[OLD, "column of material.stiffness_damping", PULL, BACK_U, BACK_V, FORTH, CG],
    &["column of plane.0.height", "column of plane.1.theta", PULL, BACK_U, BACK_V, FORTH, CG],
];

/// The column of a point mass depends on where it is alone: its own size does not enter, and the acceleration is given.
const PLACE: Fault = ("place of the point mass", |p| p.masses.values_mut().iter_mut().for_each(|w| *w *= 1.01));

#[test]
fn passes_of_derivatives_agree_with_the_cpu_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu).tuned(Tuning { many_from: 0, product: Some(Product::Matrix), crew: 0 });
    let mut scene = scene();
    // Else damping and the old state's weight cancel in the ghost penalty's old force.
    scene.material.stiffness_damping = 0.006;
    let plan = plan(&scene);
    let (right, sizes) = exact(&plan);
    let seen = |plan: &Plan| apart(&found(&backend, plan, &sizes), &right);
    assert_eq!(seen(&plan), [""; 0]);
    let place = (PLACE, &["column of mass.0.mass", "column of world.gravity.x", PULL][..]);
    for ((name, fault), parts) in BALANCE.into_iter().zip(SHOWN).chain([place]) {
        let mut wrong = plan.clone();
        fault(&mut wrong);
        print!("{name}: ");
        let seen = seen(&wrong);
        for part in parts {
            assert!(seen.iter().any(|s| s == part), "1 % of {name} is not seen in {part}, only in {seen:?}");
        }
    }
    for (place, key) in plan.layout.keys.iter().enumerate() {
        // No derivative depends on the size of a force that is the same everywhere.
        let path = key.spec().path;
        if matches!(key, ParamKey::Effect { slot: 0, .. }) && !path.ends_with("force.x") {
            let mut wrong = plan.clone();
            wrong.theta[place] *= 1.01;
            assert!(!seen(&wrong).is_empty(), "1 % of {path} is not seen");
        }
    }
}
