//! Gradients by the values of fields: adjoint = sensitivities = central differences, cell by cell and node by node.

use super::gradients::{ball, observed};
use palpate_cpu::CpuBackend;
use palpate_engine::{Direction, Evaluate, Evaluation, ParamBatch, Request, Rollout, Wanted};
use palpate_model::params::fields::{Basis, Blend, FieldSpec, Region, Scale, Varied};
use palpate_model::plan::Plan;
use support::scenes;

/// The bouncing ball with a field of unequal values.
fn with_field(varied: Varied, basis: Basis, scale: Scale) -> Plan {
    let mut scene = ball();
    let body = scenes::plan(&scene).body;
    let mut spec = FieldSpec { varied, basis, scale, values: None, prior: None };
    if !matches!(spec.basis, Basis::Regions(..)) {
        spec.values = Some((0..spec.count(&body)).map(|k| 1.0 + 0.4 * (1.7 * k as f64).sin()).collect());
    }
    scene.fields = vec![spec];
    observed(&scene, &[0.025, 0.0437, 0.06])
}

fn evaluate(rollout: &mut Rollout<CpuBackend>, rows: &[Vec<f64>], request: &Request) -> Vec<Evaluation> {
    let all = rollout.evaluate(&ParamBatch::from_rows(rows), request);
    all.iter().for_each(|e| assert!(e.failure.is_none(), "{:?}", e.failure));
    all
}

/// Compares the gradient with differences of fourth order along single values and along all of them at once, and with sensitivities.
fn check(plan: &Plan, name: &str) {
    let places = plan.layout.resolve("field.0");
    let mut rollout = Rollout::new(CpuBackend, plan, 4).unwrap();
    let wanted = Request { gradient: Wanted::Places(places.clone().collect()), ..Request::default() };
    let gradient = evaluate(&mut rollout, std::slice::from_ref(&plan.theta), &wanted).remove(0).gradient;
    let outside = (0..gradient.len()).filter(|p| !places.contains(p)).all(|p| gradient[p] == 0.0);
    let largest = gradient[places.clone()].iter().fold(0.0, |m: f64, g| m.max(g.abs()));
    assert!(outside && largest > 0.0, "{name}: zero where nothing is wanted");
    let some: Vec<usize> = places.clone().step_by(places.len().div_ceil(12)).collect();
    let request = Request { sensitivities: some.clone(), ..Request::default() };
    let forward = evaluate(&mut rollout, std::slice::from_ref(&plan.theta), &request).remove(0).curvature.unwrap().gradient;
    let mut along: Vec<Direction> = Direction::parameters(&some);
    let mut all = vec![0.0; plan.layout.len()];
    places.clone().for_each(|p| all[p] = (0.9 * p as f64).cos());
    along.push(Direction::Dense(all));
    let mut worst = [0.0f64; 2];
    for (q, direction) in along.iter().enumerate() {
        let rows: Vec<Vec<f64>> = [-2.0, -1.0, 1.0, 2.0]
            .map(|s| (0..plan.theta.len()).map(|p| plan.theta[p] + s * 1e-4 * direction.component(p)).collect())
            .to_vec();
        let c: Vec<f64> = evaluate(&mut rollout, &rows, &Request::default()).iter().map(|e| e.cost).collect();
        let difference = (c[0] - 8.0 * c[1] + 8.0 * c[2] - c[3]) / (12.0 * 1e-4);
        let adjoint: f64 = direction.entries().map(|(p, d)| d * gradient[p]).sum();
        worst[0] = worst[0].max((adjoint - difference).abs() / adjoint.abs().max(largest));
        if let Some(forward) = forward.get(q) {
            worst[1] = worst[1].max((adjoint - forward).abs() / largest);
        }
    }
    println!("{name}: {} values, adjoint - differences {:.1e}, - sensitivities {:.1e}", places.len(), worst[0], worst[1]);
    assert!(worst[0] < 1e-6 && worst[1] < 1e-9, "{name}: {worst:?}");
}

#[test]
fn gradients_by_cells_and_nodes_are_those_of_differences() {
    for (varied, name) in [(Varied::Modulus, "modulus"), (Varied::Density, "density"), (Varied::Damping, "damping")] {
        check(&with_field(varied, Basis::Cells, Scale::Log), &format!("{name} by cells"));
        check(&with_field(varied, Basis::Nodes, Scale::Linear), &format!("{name} by nodes"));
    }
}

#[test]
fn gradients_by_regions_are_those_of_differences() {
    let region = |x: f64, value| Region { center: glam::DVec3::new(x, 0.0, 0.06), radius: 0.02, value };
    for (blend, scale) in [(Blend::Harmonic, Scale::Log), (Blend::Axis, Scale::Linear)] {
        let basis = Basis::Regions(vec![region(-0.03, 0.6), region(0.03, 1.8)], blend);
        let plan = with_field(Varied::Modulus, basis, scale);
        // Without depth: a point that turns away from its camera between two differences makes the cost jump.
        let mut seen = (*plan.observation).clone();
        seen.frames.iter_mut().for_each(|f| f.points.clear());
        check(&Plan { observation: seen.into(), ..plan }, &format!("{blend:?}"));
    }
}
