//! Effects on bodies of tetrahedra against the CPU: laws of cells at the elements' means, and clamps that slip or give way.

use super::cell_laws::lawful;
use super::derivative_passes;
use super::effects::{compare_within, with};
use super::elastic::{of_tets, seen};
use super::faults::busy;
use super::passes::{Exact, apart, found, given};
use super::scenes::{ball, device, held, plan};
use crate::costs::rollout_tests::assert_agreement;
use crate::{GpuBackend, Product, Tuning};
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Wanted};
use palpate_model::materials::viscosity::Viscosity;
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::scene::Scene;
use palpate_model::scene::Tetrahedron::{Linear, Quadratic};

/// Plans in which the first number of one effect is a percent larger, with its name.
fn wrong(plan: &Plan) -> impl Iterator<Item = (String, Plan)> + '_ {
    let first = |(_, key): &(usize, &ParamKey)| matches!(key, ParamKey::Effect { slot: 0, .. });
    plan.layout.keys.iter().enumerate().filter(first).map(|(place, key)| {
        let mut wrong = plan.clone();
        wrong.theta[place] *= 1.01;
        (key.spec().path, wrong)
    })
}

#[test]
fn passes_with_laws_of_cells_on_tetrahedra_agree_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    let mut scene = of_tets(busy(ball(0.03)), Quadratic, 1);
    scene.material.stiffness_damping = 0.006;
    lawful(&mut scene);
    let plan = plan(&scene);
    let backend = GpuBackend::on(gpu.clone());
    let right = Exact::new(&plan, given);
    assert_eq!(apart(&found(&backend, &plan, &right), &right), [""; 0]);
    for (name, wrong) in wrong(&plan) {
        print!("{name}: ");
        assert!(!apart(&found(&backend, &wrong, &right), &right).is_empty(), "1 % of {name} is not seen");
    }
    let backend = GpuBackend::on(gpu).tuned(Tuning { many_from: 0, product: Some(Product::Matrix), crew: 0 });
    let (right, sizes) = derivative_passes::exact(&plan);
    // The CPU's old forces by themselves have what would be lost on the way to a state at rest.
    let seen = |plan: &Plan| -> Vec<String> {
        let apart = derivative_passes::apart(&derivative_passes::found(&backend, plan, &sizes), &right);
        apart.into_iter().filter(|part| part != "press_old and gather_old").collect()
    };
    assert_eq!(seen(&plan), [""; 0]);
    for (name, wrong) in wrong(&plan) {
        print!("{name}: ");
        assert!(!seen(&wrong).is_empty(), "1 % of {name} is not seen");
    }
}

/// A held body of another stress-free shape, of such a scene, whose clamp slips, and gives way by a layer of such a thickness [m].
pub(super) fn slipping(mut s: Scene, layer: f64) -> Scene {
    s.time.steps = 2;
    with(&mut s, "compliant-clamp", &[("layer", &[layer])]);
    with(&mut s, "clamp-slip", &[("offset", &[0.002, -0.001, 0.001]), ("turn", &[0.02, 0.01, -0.03]), ("drift", &[0.02])]);
    with(&mut s, "rest-shape", &[("stretch", &[0.02, -0.01, 0.015]), ("bend_x_to_y", &[0.8]), ("bend_z_to_x", &[-0.6])]);
    with(&mut s, "creep", &[("fraction", &[0.6]), ("time", &[0.005])]);
    with(&mut s, "transverse-anisotropy", &[("stiffness", &[3.0]), ("fibre", &[1.0, 0.5, -0.3])]);
    s
}

#[test]
fn evaluations_with_laws_of_cells_and_a_clamp_that_gives_way_agree() {
    let mut scene = slipping(of_tets(held(0.03), Quadratic, 1), 0.004);
    with(&mut scene, "power-law-viscosity", &[("coefficient", &[0.2]), ("exponent", &[0.6])]);
    // What is lost depends on differences of strains, which in a slow step leave three digits.
    compare_within(&seen(&scene), 1e-3);
}

/// A free body that spins from a stress-free shape of its own, and flows.
pub(super) fn spinning() -> Scene {
    let mut s = of_tets(busy(ball(0.03)), Quadratic, 1);
    s.time.steps = 3;
    s.time.scheme = palpate_model::plan::scheme::find("bdf2").unwrap();
    s.material.model = &palpate_model::materials::ALL[1];
    s.material.viscosity = Some(Viscosity { coefficient: 60.0, exponent: 0.8 });
    s.initial.angular_velocity = DVec3::new(0.0, 3.0, 5.0);
    with(&mut s, "rest-shape", &[("stretch", &[0.02, -0.01, 0.015]), ("bend_y_to_z", &[0.8])]);
    with(&mut s, "structural-damping", &[("loss", &[0.2])]);
    s
}

#[test]
fn evaluations_of_free_bodies_that_start_in_another_stress_free_shape_agree() {
    compare_within(&seen(&spinning()), 5e-4);
}

#[test]
fn derivatives_by_a_layer_that_is_thin_or_not_there_are_those_of_the_cpu() {
    let Some(gpu) = device(None) else { return };
    for layer in [0.0, 1e-6] {
        let mut scene = slipping(of_tets(held(0.03), Linear, 2), layer);
        with(&mut scene, "structural-damping", &[("loss", &[1.0])]);
        let plan = seen(&scene);
        let own = |k: &ParamKey| matches!(k, ParamKey::Effect { .. } | ParamKey::YoungsModulus | ParamKey::TimeStart);
        let directions: Vec<usize> = (0..plan.layout.len()).filter(|p| own(&plan.layout.keys[*p])).collect();
        let mut row = plan.theta.clone();
        row[plan.layout.index(ParamKey::YoungsModulus)] *= 1.2;
        let request = Request { gradient: Wanted::All, sensitivities: directions.clone() };
        let batch = ParamBatch::from_rows(&[row]);
        let mut cpu = Rollout::new(CpuBackend, &plan, 1).unwrap_or_else(|e| panic!("{e}"));
        let right = cpu.evaluate(&batch, &request).remove(0);
        let mut rollout = Rollout::new(GpuBackend::on(gpu.clone()), &plan, 1).unwrap_or_else(|e| panic!("{e}"));
        let found = rollout.evaluate(&batch, &request).remove(0);
        assert!(found.failure.is_none() && right.failure.is_none(), "{:?} {:?}", found.failure, right.failure);
        for p in &directions {
            println!("{:32} {:12.4e} {:12.4e}", plan.layout.keys[*p].spec().path, found.gradient[*p], right.gradient[*p]);
        }
        let place = directions.iter().find(|p| plan.layout.keys[**p].spec().path.ends_with("layer")).copied().unwrap_or(0);
        // What all of the clamp bears, from forces of which single precision leaves three digits.
        let off = found.gradient[place] / right.gradient[place] - 1.0;
        assert!(off.abs() < 2e-3, "by a layer of {layer} m: {off:.1e}");
        assert_agreement(&found, &right, &directions);
    }
}
