//! Adjoint and tangents of whole rollouts against central differences of the CPU backend, for every parameter; one percent must show.

use super::faults::{BALANCE, busy};
use super::scenes::{ball, device, held, plan, spread};
use crate::GpuBackend;
use crate::world::Adjoint;
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Backend, Direction, ParamBatch, Request, Wanted};
use palpate_model::params::ParamKey;
use palpate_model::params::fields::{Basis, FieldSpec, Scale, Varied};
use palpate_model::plan::Plan;
use palpate_model::scene::Scene;

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
    let mut tally = b.new_tally(&world, &Request::default());
    let mut now = b.new_state(&world);
    b.start(&mut world, &mut now, &mut tally);
    for k in 0..plan.clock.steps {
        let mut next = b.new_state(&world);
        b.step(&mut world, &plan.clock.stages()[k], &[&now], &mut next, &mut tally);
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
    let mut tally = backend.new_tally(&world, &Request { gradient: Wanted::All, ..Request::default() });
    let mut tape = vec![backend.new_state(&world)];
    backend.start(&mut world, &mut tape[0], &mut tally);
    let mut tangent = backend.new_tangent(&world, &Direction::parameters(&directions));
    let mut tangent_next = backend.new_tangent(&world, &Direction::parameters(&directions));
    backend.start_tangent(&mut world, &tape[0], &mut tangent, &mut tally);
    for k in 0..plan.clock.steps {
        let mut next = backend.new_state(&world);
        backend.step(&mut world, &plan.clock.stages()[k], &[&tape[k]], &mut next, &mut tally);
        backend.step_tangent(&mut world, &plan.clock.stages()[k], &[&tape[k]], &next, &[&tangent], &mut tangent_next, &mut tally);
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
        backend.step_adjoint(
            &mut world,
            &plan.clock.stages()[k],
            &[&tape[k]],
            &tape[k + 1],
            &adj,
            std::slice::from_mut(&mut adj_now),
            &mut tally,
        );
        std::mem::swap(&mut adj, &mut adj_now);
        backend.clear_adjoint(&mut adj_now);
    }
    backend.start_adjoint(&mut world, &tape[0], &adj, &mut tally);
    let evaluations = backend.read(&world, &tally);
    assert!(evaluations.iter().all(|e| e.failure.is_none()), "{:?}", evaluations[0].failure);
    (evaluations.into_iter().map(|e| e.gradient).collect(), by_tangent)
}

/// Differences beyond which a derivative is wrong, over what it may be at most. The CPU's solves over a step of 1e-4 of a parameter leave 1e-5
/// at worst, and truncation 1e-8; single precision leaves the rest.
const AGREEMENT: f64 = 1e-3;
/// Accuracy of the CPU's solves, of the forces: 1e-8 leaves up to 3e-3 in a difference by a plane's height.
const EXACT: f64 = 1e-11;

/// dJ/dp of a member by central differences of the CPU, and what counts as its size: the change of the cost over a change of the
/// parameter by its own size.
pub(super) type Slope = [f64; 2];

/// Of every parameter.
fn exact(plan: &Plan, row: &[f64]) -> Vec<Slope> {
    let mut plan = plan.clone();
    plan.solver.tolerance = EXACT;
    let slope = |(p, key): (usize, &ParamKey)| {
        let size = row[p].abs().max(key.spec().typical.min(1.0));
        let d = 1e-4 * size;
        let moved = |s: f64| {
            let mut t = row.to_vec();
            t[p] += s * d;
            t
        };
        let c = costs(&plan, &[moved(1.0), moved(-1.0)]);
        let slope = (c[0] - c[1]) / (2.0 * d);
        [slope, slope.abs().max(1e-3 * c[0].abs().max(1e-3) / size)]
    };
    plan.layout.keys.iter().enumerate().map(slope).collect()
}

/// Parameters by which a gradient is not the exact one.
fn wrong(gradient: &[f64], exact: &[Slope]) -> Vec<usize> {
    let off = |(g, [e, size]): (&f64, &Slope)| ((g - e) / size).abs();
    // Not a number is wrong as well.
    let bad = |d: &f64| d.is_nan() || *d > AGREEMENT;
    gradient.iter().zip(exact).map(off).enumerate().filter(|(_, d)| bad(d)).map(|(p, _)| p).collect()
}

/// Both gradients of every member, against differences; each must be found out when it is off by one percent, by any parameter that
/// the cost depends on; returns the differences.
pub(super) fn check(backend: &GpuBackend, plan: &Plan, members: usize) -> Vec<Vec<Slope>> {
    let theta = spread(plan, members);
    let (adjoint, tangent) = gradients(backend, plan, &theta);
    let mut all = Vec::new();
    for (m, row) in theta.iter().enumerate() {
        let slopes = exact(plan, row);
        for (p, (key, [e, size])) in plan.layout.keys.iter().zip(&slopes).enumerate() {
            let [a, t] = [&adjoint, &tangent].map(|g| (g[m][p] - e) / size);
            println!("member {m} {:32} {e:12.4e} adjoint {a:8.1e} tangent {t:8.1e}", key.spec().path);
        }
        for gradient in [&adjoint[m], &tangent[m]] {
            assert_eq!(wrong(gradient, &slopes), [], "member {m}");
            // One percent must be more than twice the agreement, as what is compared is off by some of it already.
            let matters: Vec<usize> =
                (0..slopes.len()).filter(|p| 0.01 * slopes[*p][0].abs() > 2.0 * AGREEMENT * slopes[*p][1]).collect();
            assert!(matters.len() > 8, "the cost depends on {matters:?} alone");
            let scaled: Vec<f64> = gradient.iter().map(|g| 1.01 * g).collect();
            let seen = wrong(&scaled, &slopes);
            assert!(matters.iter().all(|p| seen.contains(p)), "member {m}: of {matters:?} 1 % is seen in {seen:?}");
        }
        all.push(slopes);
    }
    all
}

#[test]
fn every_parameter_of_a_falling_ball() {
    let Some(gpu) = device(None) else { return };
    check(&GpuBackend::on(gpu), &plan(&ball(0.03)), 2);
}

/// A plan whose modulus varies from cell to cell and whose density from node to node.
fn varied(mut scene: Scene) -> Plan {
    let field = |varied, basis, scale, count: usize| {
        let values = Some((0..count).map(|k| 1.0 + 0.3 * (2.0 * k as f64).sin()).collect());
        FieldSpec { varied, basis, scale, values, prior: None }
    };
    let body = plan(&scene).body;
    scene.fields = vec![
        field(Varied::Modulus, Basis::Cells, Scale::Log, body.cells().len()),
        field(Varied::Density, Basis::Nodes, Scale::Linear, body.nodes.len()),
    ];
    plan(&scene)
}

#[test]
fn every_parameter_of_a_falling_ball_of_uneven_material() {
    let Some(gpu) = device(None) else { return };
    check(&GpuBackend::on(gpu), &varied(ball(0.05)), 1);
}

#[test]
fn fields_of_a_held_ball() {
    let Some(gpu) = device(None) else { return };
    let plan = varied(held(0.05));
    let theta = std::slice::from_ref(&plan.theta);
    let (adjoint, tangent) = gradients(&GpuBackend::on(gpu), &plan, theta);
    let slopes = exact(&plan, &theta[0]);
    let of_fields = |places: Vec<usize>| -> Vec<usize> {
        places.into_iter().filter(|p| matches!(plan.layout.keys[*p], ParamKey::Field { .. })).collect()
    };
    for gradient in [&adjoint[0], &tangent[0]] {
        assert_eq!(of_fields(wrong(gradient, &slopes)), []);
        let scaled: Vec<f64> = gradient.iter().map(|g| 1.01 * g).collect();
        assert!(of_fields(wrong(&scaled, &slopes)).len() > 20, "1 % is not seen");
    }
}

#[test]
fn every_parameter_of_a_held_ball() {
    let Some(gpu) = device(None) else { return };
    check(&GpuBackend::on(gpu), &plan(&held(0.03)), 1);
}

#[test]
fn derivatives_of_a_plan_that_is_wrong_by_one_percent_are_found_out() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu);
    let mut falling = busy(ball(0.03));
    falling.initial.velocity.z = -1.5;
    let right = plan(&falling);
    let slopes = check(&backend, &right, 1).remove(0);
    for (name, fault) in BALANCE {
        let mut other = right.clone();
        fault(&mut other);
        let (adjoint, tangent) = gradients(&backend, &other, std::slice::from_ref(&other.theta));
        for gradient in [&adjoint[0], &tangent[0]] {
            let seen = wrong(gradient, &slopes).len();
            println!("{name}: 1 % is seen in {seen} derivatives");
            assert!(seen > 0, "1 % of {name} was not seen");
        }
    }
}
