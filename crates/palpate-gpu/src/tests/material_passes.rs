//! The passes of a step with materials that are not linear, against the CPU; one percent must show.

use super::passes::{Exact, apart, found, given};
use super::scenes::{ball, device, plan};
use crate::GpuBackend;
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;

#[test]
fn passes_with_every_material_agree_with_the_cpu_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu);
    for model in palpate_model::materials::ALL.iter().filter(|m| !m.is_linear && m.has_twin()) {
        let mut scene = ball(0.03);
        scene.material.model = model;
        let plan = plan(&scene);
        let right = Exact::new(&plan, given);
        // The CPU's cells by themselves were computed with the linear material.
        let others = |plan: &Plan| -> Vec<&str> {
            apart(&found(&backend, plan, &right), &right).into_iter().filter(|p| *p != "press_cells").collect()
        };
        assert_eq!(others(&plan), [""; 0], "{}", model.name);
        let mut wrong = plan.clone();
        wrong.theta[plan.layout.index(ParamKey::PoissonRatio)] *= 1.01;
        let seen = others(&wrong);
        for pass in ["gather_residual", "gather_matrix", "multiply_rows"] {
            assert!(seen.contains(&pass), "{}: 1 % of Poisson's ratio is not seen in {pass}, only in {seen:?}", model.name);
        }
    }
}
