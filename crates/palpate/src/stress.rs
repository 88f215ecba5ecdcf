//! Strain and stress of every element of a state, for files: Green's strain, Cauchy's stress and what von Mises makes of it.
//!
//! They are taken in the middle of a cell, and as the mean of a tetrahedron, of the material alone: viscosity, fibres and other laws beyond it
//! are left out. On cut cells this is the material's law at the cell's mean deformation.

use crate::curves::{matrix, middles};
use glam::{DMat3, DVec3};
use palpate_model::materials::Solid;
use palpate_model::mechanics::lame::lame;
use palpate_model::params::coefficients::Coefficients;
use palpate_model::plan::Plan;

/// Strain and stress of all elements, in the order of the body's cells or tetrahedra.
pub struct Stressed {
    /// Green's strain ½(FᵀF − I): xx, yy, zz, xy, yz, xz.
    pub strain: Vec<[f64; 6]>,
    /// Cauchy's stress [Pa], likewise.
    pub stress: Vec<[f64; 6]>,
    /// Von Mises' equivalent stress [Pa].
    pub von_mises: Vec<f64>,
}

/// A symmetric matrix as VTK orders it.
fn symmetric(m: DMat3) -> [f64; 6] {
    [m.x_axis.x, m.y_axis.y, m.z_axis.z, m.y_axis.x, m.z_axis.y, m.z_axis.x]
}

/// Of displacements `[N]` [m] with parameters θ `[P]`; `stress_free` is the displacement of the stress-free shape [m], where the shape given
/// is the equilibrium.
pub fn stressed(plan: &Plan, theta: &[f64], displacement: &[DVec3], stress_free: Option<&[DVec3]>) -> Stressed {
    let c = Coefficients::new(plan, theta);
    let own = plan.own_law(&c.physics);
    let law: &dyn Solid = own.as_ref().map_or(plan.model.law, |own| own);
    let rest: Option<Vec<DVec3>> = match (&c.changes.rest, stress_free) {
        (None, w) => w.map(<[DVec3]>::to_vec),
        (Some(w), None) => Some(w.clone()),
        (Some(w), Some(v)) => Some(w.iter().zip(v).map(|(a, b)| *a + *b).collect()),
    };
    let shapes: Option<Vec<DMat3>> = rest.map(|w| middles(plan, &w).collect());
    let (lambda, mu) = lame(c.physics.youngs_modulus, c.physics.poisson_ratio);
    let mut out = Stressed { strain: Vec::new(), stress: Vec::new(), von_mises: Vec::new() };
    for (e, gradient) in middles(plan, displacement).enumerate() {
        // F from the stress-free shape X + W to X + u.
        let shape = shapes.as_ref().map_or(DMat3::IDENTITY, |s| DMat3::IDENTITY + s[e]);
        let f = (DMat3::IDENTITY + gradient) * shape.inverse();
        let h = f - DMat3::IDENTITY;
        let factor = c.changes.modulus.as_ref().map_or(1.0, |m| m[e]);
        let rows = std::array::from_fn(|i| std::array::from_fn(|j| h.col(j)[i]));
        let first = law.first(&rows, factor * lambda, factor * mu);
        let p = matrix(|i, j| first[3 * i + j]);
        // P Fᵀ / J is symmetric but for rounding.
        let cauchy = p * f.transpose() * (1.0 / f.determinant());
        let cauchy = (cauchy + cauchy.transpose()) * 0.5;
        let mean = (cauchy.x_axis.x + cauchy.y_axis.y + cauchy.z_axis.z) / 3.0;
        let deviator = cauchy - DMat3::IDENTITY * mean;
        let squares: f64 = (0..3).map(|k| deviator.col(k).length_squared()).sum();
        out.strain.push(symmetric((h + h.transpose() + h.transpose() * h) * 0.5));
        out.stress.push(symmetric(cauchy));
        out.von_mises.push((1.5 * squares).sqrt());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Experiment;

    /// A bar of two materials' kinds under a uniform stretch, where all of it is known.
    #[test]
    fn a_uniform_stretch_has_the_stress_of_hookes_law() {
        let scene = |model: &str| {
            format!(
                "format = \"scene/1\"\n[object]\nshape = {{ box = {{ min = [0, 0, 0], max = [0.1, 0.05, 0.05] }} }}\ncell_size = 0.025\n\
                 [material]\nmodel = \"{model}\"\ndensity = 1000.0\nyoungs_modulus = 1e5\npoisson_ratio = 0.3\n[time]\nstep = 0.01\nsteps = 1\n"
            )
        };
        for model in ["corotated-linear", "neo-hookean"] {
            let e = Experiment::from_toml(&scene(model), "bar.toml").unwrap();
            let plan = e.plan();
            // Small, so that both materials are Hooke's: 1e-6 along x, and what Poisson's ratio makes of it across.
            let stretch = DVec3::new(1e-6, -0.3e-6, -0.3e-6);
            let u: Vec<DVec3> = plan.body.nodes.iter().map(|x| *x * stretch).collect();
            let s = stressed(plan, &plan.theta, &u, None);
            assert_eq!(s.stress.len(), plan.body.cells().len());
            for k in 0..s.stress.len() {
                // The next order of the strain is a millionth of it.
                assert!((s.stress[k][0] / 0.1 - 1.0).abs() < 1e-5, "{model}: {:?}", s.stress[k]);
                assert!(s.stress[k][1..].iter().all(|x| x.abs() < 1e-6), "{model}: {:?}", s.stress[k]);
                assert!((s.strain[k][0] / 1e-6 - 1.0).abs() < 1e-5 && (s.von_mises[k] / 0.1 - 1.0).abs() < 1e-5);
            }
            // Where the stretched shape is the stress-free one, there is none.
            let s = stressed(plan, &plan.theta, &u, Some(&u));
            assert!(s.stress.iter().flatten().all(|x| x.abs() < 1e-9));
        }
    }
}
