//! A tangent, products at every step and an adjoint are a product with the Gauss–Newton matrix of a whole rollout.

use crate::CpuBackend;
use crate::costs::tests::{Noise, seen};
use palpate_engine::{Backend, Direction, Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::plan::Plan;

/// H v by one way forward with the tangent along v and one way back.
fn product(plan: &Plan, v: &[f64]) -> Vec<f64> {
    let (b, stages) = (CpuBackend, plan.clock.stages());
    let mut w = b.build(plan, 1).unwrap();
    b.set_params(&mut w, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let mut tally = b.new_tally(&w, &Request { gradient: Wanted::All, ..Request::default() });
    let along = [Direction::Dense(v.to_vec())];
    let (mut state, mut tangent) = (b.new_state(&w), b.new_tangent(&w, &along));
    b.start(&mut w, &mut state, &mut tally);
    b.start_tangent(&mut w, &state, &mut tangent, &mut tally);
    let (mut states, mut tangents) = (vec![state], vec![tangent]);
    for s in &stages {
        let (mut next, mut t_next) = (b.new_state(&w), b.new_tangent(&w, &along));
        let now = s.from[0].0;
        b.step(&mut w, s, &[&states[now]], &mut next, &mut tally);
        b.observe(&w, s.step, &states[now], &next, &mut tally);
        b.step_tangent(&mut w, s, &[&states[now]], &next, &[&tangents[now]], &mut t_next, &mut tally);
        states.push(next);
        tangents.push(t_next);
    }
    let mut adj = b.new_adjoint(&w);
    for s in stages.iter().rev() {
        let (now, next) = (s.from[0].0, s.number + 1);
        let mut past = [b.new_adjoint(&w)];
        let ends = (&states[now], &states[next], &tangents[now], &tangents[next]);
        b.observe_product(&w, s.step, ends.0, ends.1, ends.2, ends.3, &mut adj, &mut past[0], &mut tally);
        b.step_adjoint(&mut w, s, &[ends.0], ends.1, &adj, &mut past, &mut tally);
        [adj] = past;
    }
    b.start_adjoint(&mut w, &states[0], &adj, &mut tally);
    let e = b.read(&w, &tally).remove(0);
    assert!(e.failure.is_none(), "{:?}", e.failure);
    e.gradient
}

#[test]
fn a_tangent_and_an_adjoint_multiply_with_the_gauss_newton_matrix() {
    let plan = seen();
    let p = plan.layout.len();
    let request = Request { sensitivities: (0..p).collect(), ..Request::default() };
    let mut rollout = Rollout::new(CpuBackend, &plan, 1).unwrap();
    let e = rollout.evaluate(&ParamBatch::from_rows(std::slice::from_ref(&plan.theta)), &request).remove(0);
    let matrix = e.curvature.unwrap().matrix;
    // Every number counts alike: sizes differ by many powers of ten.
    let size: Vec<f64> = (0..p).map(|a| matrix[a * p + a].sqrt()).collect();
    let mut noise = Noise(9);
    let known: Vec<usize> = (0..p).filter(|a| size[*a] > 0.0).collect();
    assert!(known.len() > 10, "{known:?}");
    for round in 0..4 {
        let mut v = vec![0.0; p];
        // One number alone, then all of them.
        let chosen = if round == 0 { &known[..1] } else { &known[..] };
        chosen.iter().for_each(|a| v[*a] = noise.next() / size[*a]);
        let found = product(&plan, &v);
        let right: Vec<f64> = (0..p).map(|a| (0..p).map(|b| matrix[a * p + b] * v[b]).sum()).collect();
        let length = known.iter().map(|a| (right[*a] / size[*a]).powi(2)).sum::<f64>().sqrt();
        for a in &known {
            let off = (found[*a] - right[*a]).abs() / size[*a];
            assert!(off < 1e-9 * length, "{:?}: {} and {}", plan.layout.keys[*a], found[*a], right[*a]);
        }
        let quadratic = |h: &[f64]| v.iter().zip(h).map(|(v, h)| v * h).sum::<f64>();
        assert!((quadratic(&found) - quadratic(&right)).abs() < 1e-9 * quadratic(&right));
    }
}
