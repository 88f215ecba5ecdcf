//! Adjoint and tangents of whole rollouts against central differences of the CPU backend, for every parameter.

use super::scenes::{ball, device, held, plan, spread};
use crate::GpuBackend;
use crate::world::Adjoint;
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Backend, ParamBatch};
use palpate_model::plan::Plan;
use palpate_model::scene::{RotationUpdate, Scene};

/// Weights of the last displacement and velocity in the test's cost; smooth, so that no node stands out.
fn weights(plan: &Plan) -> (Vec<DVec3>, Vec<DVec3>) {
    let wave = |x: &DVec3, f: f64| DVec3::new((f * x.x).sin() + 0.3, (f * x.y + 1.0).cos(), (f * (x.x + x.z)).sin() - 0.2);
    let u = plan.body.nodes.iter().map(|x| wave(x, 30.0)).collect();
    let v = plan.body.nodes.iter().map(|x| wave(x, 50.0) * plan.clock.step).collect();
    (u, v)
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

/// Cost of the last state of each member on the CPU.
fn costs(plan: &Plan, theta: &[Vec<f64>]) -> Vec<f64> {
    let b = CpuBackend;
    let mut world = b.build(plan, theta.len()).unwrap_or_else(|e| panic!("{e}"));
    b.set_params(&mut world, &ParamBatch::from_rows(theta));
    let mut tally = b.new_tally(&world, &[]);
    let mut now = b.new_state(&world);
    b.start(&mut world, &mut now, &mut tally);
    for k in 0..plan.clock.steps {
        let mut next = b.new_state(&world);
        b.step(&mut world, k, &now, &mut next, &mut tally);
        now = next;
    }
    let (wu, wv) = weights(plan);
    (0..theta.len()).map(|m| b.read_state(&world, &now, m)).map(|(u, v)| dot(&u, &wu) + dot(&v, &wv)).collect()
}

fn vectors(v: &[DVec3]) -> Vec<[f32; 4]> {
    v.iter().map(|v| [v.x as f32, v.y as f32, v.z as f32, 0.0]).collect()
}

/// dJ/dθ of every member by the adjoint and by tangents, both on the device.
fn gradients(backend: &GpuBackend, plan: &Plan, theta: &[Vec<f64>]) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let directions: Vec<usize> = (0..plan.layout.len()).collect();
    let mut world = backend.build(plan, theta.len()).unwrap_or_else(|e| panic!("{e}"));
    backend.set_params(&mut world, &ParamBatch::from_rows(theta));
    let mut tally = backend.new_tally(&world, &[]);
    let mut tape = vec![backend.new_state(&world)];
    backend.start(&mut world, &mut tape[0], &mut tally);
    let mut tangent = backend.new_tangent(&world, &directions);
    let mut tangent_next = backend.new_tangent(&world, &directions);
    backend.start_tangent(&mut world, &tape[0], &mut tangent, &mut tally);
    for k in 0..plan.clock.steps {
        let mut next = backend.new_state(&world);
        backend.step(&mut world, k, &tape[k], &mut next, &mut tally);
        backend.step_tangent(&mut world, k, &tape[k], &next, &tangent, &mut tangent_next, &mut tally);
        std::mem::swap(&mut tangent, &mut tangent_next);
        tape.push(next);
    }
    let (wu, wv) = weights(plan);
    let (n, members) = (plan.body.nodes.len(), theta.len());
    let mut by_tangent = vec![vec![0.0; directions.len()]; members];
    for q in 0..directions.len() {
        let t: Vec<[f32; 4]> =
            backend.gpu().download(&tangent.parts[q].buffer, 2 * n * members).unwrap_or_else(|e| panic!("{e}"));
        let wide: Vec<DVec3> = t.iter().map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into())).collect();
        for (m, out) in by_tangent.iter_mut().enumerate() {
            let v = n * members;
            out[q] = dot(&wide[m * n..(m + 1) * n], &wu) + dot(&wide[v + m * n..v + (m + 1) * n], &wv);
        }
    }
    let mut adj: Adjoint = backend.new_adjoint(&world);
    let mut adj_now = backend.new_adjoint(&world);
    let all: Vec<[f32; 4]> = [vectors(&wu).repeat(members), vectors(&wv).repeat(members)].concat();
    backend.gpu().queue.write_buffer(&adj.0.buffer, 0, bytemuck::cast_slice(&all));
    for k in (0..plan.clock.steps).rev() {
        backend.step_adjoint(&mut world, k, &tape[k], &tape[k + 1], &adj, &mut adj_now, &mut tally);
        std::mem::swap(&mut adj, &mut adj_now);
        backend.clear_adjoint(&mut adj_now);
    }
    backend.start_adjoint(&mut world, &tape[0], &adj, &mut tally);
    let evaluations = backend.read(&world, &tally);
    assert!(evaluations.iter().all(|e| e.failure.is_none()), "{:?}", evaluations[0].failure);
    (evaluations.into_iter().map(|e| e.gradient).collect(), by_tangent)
}

fn check(scene: &Scene, members: usize) {
    let Some(gpu) = device(None) else { return };
    let plan = plan(scene);
    let theta = spread(&plan, members);
    let (adjoint, tangent) = gradients(&GpuBackend::on(gpu), &plan, &theta);
    for (m, row) in theta.iter().enumerate() {
        let mut wrong = Vec::new();
        for (p, key) in plan.layout.keys.iter().enumerate() {
            let size = row[p].abs().max(key.spec().typical.min(1.0));
            // Newton's 1e-8 of the forces over a step of 1e-4 leaves 1e-4 at worst, mostly 1e-6; truncation is 1e-8.
            let d = 1e-4 * size;
            let moved = |s: f64| {
                let mut t = row.clone();
                t[p] += s * d;
                t
            };
            let c = costs(&plan, &[moved(1.0), moved(-1.0)]);
            let exact = (c[0] - c[1]) / (2.0 * d);
            // What counts is the change of the cost over a change of the parameter by its own size.
            let scale = exact.abs().max(1e-3 * c[0].abs().max(1e-3) / size);
            let errors = [(adjoint[m][p] - exact) / scale, (tangent[m][p] - exact) / scale];
            println!("member {m} {:32} {exact:12.4e} adjoint {:8.1e} tangent {:8.1e}", key.spec().path, errors[0], errors[1]);
            if errors.iter().any(|e| e.is_nan() || e.abs() > 1e-3) {
                wrong.push(key.spec().path);
            }
        }
        assert!(wrong.is_empty(), "member {m}: {wrong:?}");
    }
}

#[test]
fn every_parameter_of_a_falling_ball() {
    for rotation in [RotationUpdate::Converged, RotationUpdate::Lagged] {
        let mut scene = ball(0.03);
        scene.solver.rotation = rotation;
        check(&scene, 2);
    }
}

#[test]
fn every_parameter_of_a_held_ball() {
    check(&held(0.03), 1);
}
