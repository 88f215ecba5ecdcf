//! Energies computed from the model's laws alone, independently of any backend.

use glam::DVec3;
use palpate_model::cutcells::corotation::CellPose;
use palpate_model::cutcells::element;
use palpate_model::plan::Plan;
use palpate_model::scene::Scene;

/// Elastic energy of cells and ghost penalty at displacement u [J]; clamps are left out.
pub fn elastic(plan: &Plan, scene: &Scene, u: &[DVec3]) -> f64 {
    let body = &plan.body;
    let h = body.length;
    let (mut k, mut k_nu) = (Box::new([0.0; 576]), Box::new([0.0; 576]));
    let mut last: Option<[f64; 27]> = None;
    let shear = scene.material.youngs_modulus / (2.0 * (1.0 + scene.material.poisson_ratio));
    let ghost: f64 = body
        .ghosts()
        .iter()
        .map(|g| {
            let [a, b, c] = g.nodes.map(|n| u[n as usize]);
            0.5 * scene.solver.ghost * shear * h * g.weight * (a - 2.0 * b + c).length_squared()
        })
        .sum();
    let cells: f64 = body
        .cells()
        .iter()
        .map(|cell| {
            if last != Some(cell.weights) {
                let nu = scene.material.poisson_ratio;
                element::stiffness(scene.solver.element, h, &cell.weights, cell.fraction, nu, &mut k, &mut k_nu);
                last = Some(cell.weights);
            }
            let x = cell.nodes.map(|n| body.nodes[n as usize] + u[n as usize]);
            CellPose::new(&x, h).energy(&k, scene.material.youngs_modulus)
        })
        .sum();
    cells + ghost
}
