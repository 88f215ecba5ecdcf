//! The mass matrix of a body of tetrahedra: ∫ ρ N_i N_j, exactly, with one density an element. Points of a cloud have their own mass alone.
//!
//! The density around a node is a coefficient of the model; an element's is the mean over its nodes, weighed as `space::tets::lumped` has them. So
//! the whole mass is the sum of the nodes' densities times their volumes, and every entry is linear in each node's density.

use glam::DVec3;
use palpate_model::params::coefficients::Coefficients;
use palpate_model::plan::Plan;
use palpate_model::space::pattern::{Pattern, Places};
use palpate_model::space::stencil::Stencil;
use palpate_model::space::tets::{lumped, lumped_mean, mass};
use rayon::prelude::*;

/// Most nodes of an element.
const MOST: usize = 10;
/// Rows that one task multiplies at least.
const ROWS: usize = 256;

/// The matrix, element by element.
pub(super) struct Consistent<'a> {
    plan: &'a Plan,
    coefficients: &'a Coefficients,
    /// Mass of every element [kg], or its change.
    masses: Vec<f64>,
    /// Entries of an element's matrix over its mass.
    unit: [[f64; MOST]; MOST],
}

/// Entries of the mass matrix by block of the pattern [kg], of a body of tetrahedra; none of one of cells.
pub fn mass_matrix(plan: &Plan, pattern: &Pattern, places: &Places, coefficients: &Coefficients) -> Vec<f64> {
    if plan.body.cut.is_some() {
        return Vec::new();
    }
    let mut out = vec![0.0; pattern.blocks.columns.len()];
    Consistent::new(plan, coefficients).each_block(places, |place, m| out[place] += m);
    out
}

/// Adds M a for accelerations a(node), with M by block of the pattern.
pub(super) fn add_product(pattern: &Pattern, matrix: &[f64], a: impl Fn(usize) -> DVec3 + Sync, out: &mut [DVec3]) {
    let blocks = &pattern.blocks;
    out.par_iter_mut().with_min_len(ROWS).enumerate().for_each(|(n, sum)| {
        *sum += (blocks.rows[n]..blocks.rows[n + 1]).map(|k| matrix[k] * a(blocks.columns[k] as usize)).sum::<DVec3>();
    });
}

impl<'a> Consistent<'a> {
    /// With the densities at hand.
    pub(super) fn new(plan: &'a Plan, coefficients: &'a Coefficients) -> Consistent<'a> {
        let all = Consistent { plan, coefficients, masses: Vec::new(), unit: [[0.0; MOST]; MOST] };
        let nodes = all.nodes();
        let unit = std::array::from_fn(|i| std::array::from_fn(|j| if i < nodes && j < nodes { mass(nodes, i, j) } else { 0.0 }));
        let (rho, factors) = (coefficients.physics.density, coefficients.changes.density.as_deref());
        let masses = all.elements().map(|(_, s, v)| rho * factors.map_or(1.0, |f| lumped_mean(&s, f)) * v).collect();
        Consistent { masses, unit, ..all }
    }

    /// Its change along a change of the coefficients.
    pub(super) fn along(&self, rates: &Coefficients) -> Consistent<'a> {
        let (rho, factors) = (self.coefficients.physics.density, self.coefficients.changes.density.as_deref());
        let (d_rho, d_factors) = (rates.physics.density, rates.changes.density.as_deref());
        let change =
            |s: &Stencil| d_rho * factors.map_or(1.0, |f| lumped_mean(s, f)) + rho * d_factors.map_or(0.0, |f| lumped_mean(s, f));
        Consistent { masses: self.elements().map(|(_, s, v)| change(&s) * v).collect(), ..*self }
    }

    /// Nodes of an element.
    fn nodes(&self) -> usize {
        if self.plan.body.points.is_empty() { 0 } else { self.plan.body.points.bearers(0).nodes.len() }
    }

    /// Number, nodes that bear the mass and volume [m³] of every element.
    fn elements(&self) -> impl Iterator<Item = (usize, Stencil<'a>, f64)> + use<'a> {
        let points = &self.plan.body.points;
        (0..points.elements()).map(|e| (e, points.bearers(e), points.element_volume(e)))
    }

    /// Rows of an element's matrix over its mass, times a vector per node.
    fn product(&self, s: &Stencil, a: &impl Fn(usize) -> DVec3) -> [DVec3; MOST] {
        let mut own = [DVec3::ZERO; MOST];
        s.nodes.iter().zip(&mut own).for_each(|(n, own)| *own = a(*n as usize));
        let n = s.nodes.len();
        std::array::from_fn(|i| own[..n].iter().zip(&self.unit[i]).map(|(a, m)| *m * *a).sum())
    }

    /// Adds M a for accelerations a(node).
    pub(super) fn add(&self, a: impl Fn(usize) -> DVec3, out: &mut [DVec3]) {
        for (e, s, _) in self.elements() {
            let rows = self.product(&s, &a);
            s.nodes.iter().zip(rows).for_each(|(n, row)| out[*n as usize] += self.masses[e] * row);
        }
    }

    /// Hands every entry to `put`: its place in the matrix, and its mass [kg].
    fn each_block(&self, places: &Places, mut put: impl FnMut(usize, f64)) {
        for (e, s, _) in self.elements() {
            let n = s.nodes.len();
            let places = places.points.of(self.plan.body.points.mean_point(e));
            // A star's first block is its own point's.
            for (k, place) in places.iter().enumerate().take(n * n) {
                put(*place as usize, self.masses[e] * self.unit[k / n][k % n]);
            }
        }
    }

    /// Adds z · ∂M/∂ρ a, by the density and by the factor on it at every node.
    pub(super) fn pull_density(&self, z: &[DVec3], a: impl Fn(usize) -> DVec3, gradient: &mut Coefficients) {
        let (rho, factors) = (self.coefficients.physics.density, self.coefficients.changes.density.as_deref());
        for (_, s, v) in self.elements() {
            let by_density: f64 =
                s.nodes.iter().zip(self.product(&s, &a)).map(|(n, row)| z[*n as usize].dot(row)).sum::<f64>() * v;
            gradient.physics.density += factors.map_or(1.0, |f| lumped_mean(&s, f)) * by_density;
            if let Some(by_factor) = &mut gradient.changes.density {
                s.nodes.iter().zip(lumped(s.nodes.len())).for_each(|(n, w)| by_factor[*n as usize] += rho * w * by_density);
            }
        }
    }
}
