//! The terms of the residual: inertia, elastic cells, ghost penalty, clamps, contact, laws at points. One file each, and one line in
//! [`Equation::new`]; a term knows nothing of the others.
//!
//! A solve of a scheme (`palpate_model::plan::scheme`) starts from a state (ũ, ṽ) and asks for the displacement u₁ with r(u₁) = 0:
//! `r(u₁) = M[(u₁−ũ)/(θℓ²) − ṽ/(θℓ)] + αM(u₁−ũ)/ℓ + cells + ghost + clamps + contact − weight + laws`.
//! A static problem is the same sum without inertia.

mod assembly;
pub mod clamps;
pub mod consistent;
pub mod contact;
mod curvature;
pub mod elastic_cells;
pub mod elastic_points;
pub mod ghost;
pub mod held_nodes;
pub mod inertia;
pub mod jets;
pub mod obstacles;
pub mod point_laws;
pub mod products;
mod seen;
pub mod star_penalty;
pub mod tet_laws;
pub mod unstrained;

use crate::linear::matrix::Matrix;
use crate::linear::vector::Nodes;
use clamps::Clamped;
use contact::Contact;
use elastic_cells::ElasticCells;
use elastic_points::ElasticPoints;
use ghost::Ghost;
use glam::{DMat3, DVec3};
use held_nodes::HeldNodes;
use inertia::Inertia;
use jets::{Jets, Lag};
use obstacles::Obstacles;
use palpate_model::cutcells::elements::Elements;
use palpate_model::materials::Solid;
use palpate_model::mechanics::plane::PlaneNow;
use palpate_model::params::changes;
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::plan::{Physics, Plan};
use palpate_model::space::pattern::{Pattern, Places};
use point_laws::PointLaws;
use products::Parts;
use star_penalty::StarPenalty;
use std::sync::OnceLock;
use tet_laws::TetLaws;

pub use curvature::Curvature;
pub use elastic_cells::laws::{CellActing, cell_laws};
pub use point_laws::{Acting, acting};

/// What effects change of the body itself, beside [`Coefficients`].
pub mod altered;

/// Factors of a solve of length ℓ with weight θ; `None` in a static problem.
#[derive(Clone, Copy, Debug)]
pub struct Rates {
    /// 1/(θℓ²): factor of M(u₁ − ũ) [1/s²].
    pub displacement: f64,
    /// 1/(θℓ): factor of −M ṽ [1/s].
    pub velocity: f64,
    /// 1/ℓ [1/s].
    pub rate: f64,
}

/// How the states enter elastic and viscous forces.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    /// θ: weight of the new state's elastic force.
    pub new: f64,
    /// 1 − θ: weight of the old state's; not zero only where there is one past state.
    pub old: f64,
    /// β/ℓ: weight of the change between them.
    pub rate: f64,
}

impl Weights {
    /// The elastic force of one state alone.
    pub const STATIC: Weights = Weights { new: 1.0, old: 0.0, rate: 0.0 };

    /// True where the force depends on the past at all.
    pub fn sees_past(&self) -> bool {
        self.old != 0.0 || self.rate != 0.0
    }
}

/// The past that a solve starts from.
#[derive(Clone, Copy)]
pub struct Past<'a> {
    /// ũ `[N]` [m].
    pub u: &'a [DVec3],
    /// ṽ `[N]` [m/s].
    pub v: &'a [DVec3],
    /// Weights and displacements of the past states that ũ is the sum of. Objective rates see each by itself: a turned body has no strain,
    /// but a weighted sum of turned bodies has.
    pub each: &'a [(f64, &'a [DVec3])],
    /// State that jets are taken at; `None` = ũ.
    pub lag: Option<&'a Lag>,
}

/// A change of the past.
#[derive(Clone, Copy)]
pub struct PastChange<'a> {
    /// Of ũ [m].
    pub u: &'a [DVec3],
    /// Of ṽ [m/s].
    pub v: &'a [DVec3],
    /// Of every past displacement.
    pub each: &'a [&'a [DVec3]],
}

/// Derivatives by the past.
#[derive(Clone, Debug)]
pub struct PastGradient {
    /// By ũ.
    pub u: Nodes,
    /// By ṽ.
    pub v: Nodes,
    /// By every past displacement, beyond what comes through ũ.
    pub each: Vec<Nodes>,
}

impl PastGradient {
    /// Zero, for `n` nodes and so many past states.
    pub fn zero(n: usize, states: usize) -> PastGradient {
        PastGradient { u: zeros(n), v: zeros(n), each: vec![zeros(n); states] }
    }
}

/// What all terms read: one member and one solve.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// Everything common to the batch.
    pub plan: &'a Plan,
    /// Pattern of the matrix.
    pub pattern: &'a Pattern,
    /// Where terms add into it.
    pub places: &'a Places,
    /// Matrices at the member's Poisson ratio.
    pub elements: &'a Elements,
    /// Matrices for E = 1 Pa and ν = 0, whose energy is ½|ε|²; of materials with a viscosity alone.
    pub strains: Option<&'a Elements>,
    /// The member's coefficients.
    pub coefficients: &'a Coefficients,
    /// Its mass matrix by block [kg], of a body of tetrahedra.
    pub masses: &'a [f64],
    /// The penalty of a cloud's stars by block, over γ and the shear modulus where no field varies it [m]; once it is asked for.
    pub springs: &'a OnceLock<Vec<f64>>,
    /// The member's planes.
    pub planes: &'a [PlaneNow],
    /// The member's effects.
    pub effects: &'a [Acting],
    /// What effects change of the body besides.
    pub altered: &'a altered::Altered,
    /// Inertia; `None` = static.
    pub inertia: Option<Rates>,
    /// How the states enter the elastic force.
    pub weights: Weights,
    /// Time of the new state on the recording's clock [s].
    pub time: f64,
    /// The past.
    pub past: Past<'a>,
}

impl<'a> Context<'a> {
    /// Numbers of the scene.
    pub fn physics(&self) -> &'a Physics {
        &self.coefficients.physics
    }

    /// The material's law.
    pub fn law(&self) -> &'a dyn Solid {
        self.altered.law.as_ref().map_or(self.plan.model.law, |own| own as &dyn Solid)
    }

    /// Adds z·∂r/∂(factor) of the material's curves, in their order.
    pub fn pull_curves(&self, by: &[f64], gradient: &mut Coefficients) {
        gradient.physics.curves.iter_mut().flatten().zip(by).for_each(|(out, g)| *out += g);
    }

    /// Length of the solve [s]; 0 in a static problem.
    pub fn length(&self) -> f64 {
        self.inertia.map_or(0.0, |t| 1.0 / t.rate)
    }

    /// Time from the start of the simulation to the instant between the states that the scheme weights them for [s].
    pub fn elapsed(&self) -> f64 {
        self.time - self.physics().start - (1.0 - self.weights.new) * self.length()
    }

    /// Factor on Young's modulus from creep.
    pub fn aging(&self) -> f64 {
        if self.effects.is_empty() { 1.0 } else { changes::aging(self.plan, self.physics(), self.elapsed()) }
    }

    /// Young's modulus [Pa] at the time that the forces are taken at.
    pub fn young(&self) -> f64 {
        self.physics().youngs_modulus * self.aging()
    }

    /// Factor on Young's modulus in a cell.
    pub fn factor(&self, cell: usize) -> f64 {
        self.coefficients.changes.modulus.as_ref().map_or(1.0, |m| m[cell])
    }

    /// How the states enter the elastic force of a cell, whose damping may be its own.
    #[inline(always)]
    pub fn weights_of(&self, cell: usize) -> Weights {
        Weights { rate: self.weights.rate * self.damping_factor(cell), ..self.weights }
    }

    /// Factor on the stiffness damping in a cell.
    #[inline(always)]
    pub fn damping_factor(&self, cell: usize) -> f64 {
        self.coefficients.changes.damping.as_ref().map_or(1.0, |d| d[cell])
    }

    /// Change of a cell's stiffness damping along `rates` [s].
    pub fn damping_along(&self, rates: &Coefficients, cell: usize) -> f64 {
        let own = rates.changes.damping.as_ref().map_or(0.0, |d| self.physics().stiffness_damping * d[cell]);
        rates.physics.stiffness_damping * self.damping_factor(cell) + own
    }

    /// Adds what derivatives by the cells' stiffness damping make of the coefficients: `by` lists cell and derivative.
    pub fn pull_damping(&self, by: impl Iterator<Item = (usize, f64)>, gradient: &mut Coefficients) {
        for (cell, g) in by {
            gradient.physics.stiffness_damping += g * self.damping_factor(cell);
            if let Some(d) = &mut gradient.changes.damping {
                d[cell] += g * self.physics().stiffness_damping;
            }
        }
    }

    /// Change of the logarithm of Young's modulus along `rates`, but for what varies from cell to cell.
    pub fn ln_young_along(&self, rates: &Coefficients) -> f64 {
        let own = rates.physics.youngs_modulus / self.physics().youngs_modulus;
        if self.effects.is_empty() {
            return own;
        }
        own + changes::aging_along(self.plan, self.physics(), self.elapsed(), &rates.physics) / self.aging()
    }

    /// Change of the logarithm of a cell's modulus that comes from its factor.
    pub fn ln_factor_along(&self, rates: &Coefficients, cell: usize) -> f64 {
        rates.changes.modulus.as_ref().map_or(0.0, |m| m[cell] / self.factor(cell))
    }

    /// Adds what derivatives by the logarithms of the cells' moduli make of the coefficients: `by_ln` lists cell and derivative.
    pub fn pull_modulus(&self, by_ln: impl Iterator<Item = (usize, f64)>, gradient: &mut Coefficients) {
        let mut sum = 0.0;
        for (cell, g) in by_ln {
            sum += g;
            if let Some(m) = &mut gradient.changes.modulus {
                m[cell] += g / self.factor(cell);
            }
        }
        self.pull_young(sum, gradient);
    }

    /// The same of the whole body's.
    pub fn pull_young(&self, by_ln: f64, gradient: &mut Coefficients) {
        gradient.physics.youngs_modulus += by_ln / self.physics().youngs_modulus;
        if !self.effects.is_empty() {
            changes::pull_aging(self.plan, self.physics(), self.elapsed(), by_ln / self.aging(), &mut gradient.physics);
        }
    }
}

/// Sizes of the forces that a residual is the sum of, by kind `[N]` [N]; what "small" is measured against.
pub struct Forces {
    /// Weight.
    pub weight: Nodes,
    /// What keeps the old velocity.
    pub momentum: Nodes,
    /// Elastic forces.
    pub elastic: Nodes,
    /// Clamps, contact and laws of points.
    pub supports: Nodes,
}

/// One term of the residual, at one member and one solve. What it needs of the past it takes when it is made; `u1` is the new
/// displacement `[N]` [m]. All but the residual may rely on the residual having been computed last at the same `u1`.
pub trait Term: Send + Sync {
    /// Adds the residual [N].
    fn residual(&mut self, u1: &[DVec3], out: &mut [DVec3]);
    /// Potential whose gradient by u₁ is the residual, up to a constant [J].
    fn potential(&self, u1: &[DVec3]) -> f64;
    /// Adds the tangent stiffness ∂r/∂u₁, symmetric [N/m].
    fn tangent(&self, u1: &[DVec3], curvature: Curvature, matrix: &mut Matrix);
    /// The exact one as products with vectors, where that takes less than the matrix.
    fn products<'b>(&'b self, _u1: &[DVec3]) -> Parts<'b> {
        Parts::Matrix
    }
    /// Adds the derivative of the residual along a change of the past.
    fn by_past(&self, u1: &[DVec3], change: &PastChange, out: &mut [DVec3]);
    /// Its transpose: adds z·∂r/∂(past).
    fn by_past_transposed(&self, u1: &[DVec3], z: &[DVec3], out: &mut PastGradient);
    /// Adds the derivative along a change of the coefficients at fixed states.
    fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]);
    /// Its transpose, for all that is sought in one pass: adds z·∂r/∂(coefficients).
    fn by_coefficients_transposed(&self, u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients);
    /// Adds its forces to those of their kind.
    fn forces(&self, u1: &[DVec3], out: &mut Forces);
}

/// The residual of one solve: the sum of its terms.
pub struct Equation<'a> {
    /// What the terms read.
    pub context: Context<'a>,
    terms: Vec<Box<dyn Term + 'a>>,
}

impl<'a> Equation<'a> {
    /// All terms that act.
    pub fn new(context: Context<'a>) -> Equation<'a> {
        // The elements come first: their tangent overwrites the matrix.
        let mut terms: Vec<Box<dyn Term + 'a>> = match context.plan.body.cut {
            Some(_) => vec![Box::new(ElasticCells::new(context))],
            None => vec![Box::new(ElasticPoints::new(context)), Box::new(HeldNodes::new(context))],
        };
        if let Some(penalty) = context.plan.body.points.stars.as_ref().filter(|p| p.factor != 0.0) {
            terms.push(Box::new(StarPenalty::new(context, penalty)));
        }
        if context.plan.body.cut.is_none() && !context.altered.laws.is_empty() {
            terms.push(Box::new(TetLaws::new(context)));
        }
        if !context.plan.body.ghosts().is_empty() {
            terms.push(Box::new(Ghost { c: context }));
        }
        if !context.plan.clamps.is_empty() {
            terms.push(Box::new(Clamped { c: context }));
        }
        if !context.planes.is_empty() {
            terms.push(Box::new(Contact { c: context }));
        }
        terms.push(Box::new(Inertia { c: context }));
        if !context.effects.is_empty() {
            terms.push(Box::new(PointLaws { c: context }));
            terms.extend(Obstacles::new(context).map(|o| Box::new(o) as Box<dyn Term>));
            terms.extend(Jets::new(context).map(|j| Box::new(j) as Box<dyn Term>));
        }
        Equation { context, terms }
    }

    /// r(u₁) `[N]` [N].
    pub fn residual(&mut self, u1: &[DVec3]) -> Nodes {
        let mut r = zeros(u1.len());
        self.terms.iter_mut().for_each(|t| t.residual(u1, &mut r));
        r
    }

    /// Potential whose gradient is the residual, up to a constant [J].
    pub fn potential(&self, u1: &[DVec3]) -> f64 {
        self.terms.iter().map(|t| t.potential(u1)).sum()
    }

    /// That of the elements alone, up to a constant [J].
    pub fn strain_energy(&self, u1: &[DVec3]) -> f64 {
        self.terms[0].potential(u1)
    }

    /// The tangent stiffness.
    pub fn tangent(&self, u1: &[DVec3], curvature: Curvature, matrix: &mut Matrix) {
        self.terms.iter().for_each(|t| t.tangent(u1, curvature, matrix));
    }

    /// Sizes of the forces that the residual is the sum of, in the given norm.
    pub fn scale(&self, u1: &[DVec3], norm: impl Fn(&[DVec3]) -> f64) -> f64 {
        let blank = || zeros(u1.len());
        let mut f = Forces { weight: blank(), momentum: blank(), elastic: blank(), supports: blank() };
        self.terms.iter().for_each(|t| t.forces(u1, &mut f));
        norm(&f.weight) + norm(&f.momentum) + norm(&f.elastic) + norm(&f.supports)
    }

    /// Derivative along a change of the past `[N]`.
    pub fn by_past(&self, u1: &[DVec3], change: &PastChange) -> Nodes {
        let mut out = zeros(u1.len());
        self.terms.iter().for_each(|t| t.by_past(u1, change, &mut out));
        out
    }

    /// Its transpose.
    pub fn by_past_transposed(&self, u1: &[DVec3], z: &[DVec3]) -> PastGradient {
        let mut out = PastGradient::zero(u1.len(), self.context.past.each.len());
        self.terms.iter().for_each(|t| t.by_past_transposed(u1, z, &mut out));
        out
    }

    /// Derivative along a change of the coefficients `[N]`.
    pub fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients) -> Nodes {
        let mut out = zeros(u1.len());
        self.terms.iter().for_each(|t| t.by_coefficients(u1, rates, &mut out));
        out
    }

    /// Its transpose: adds z·∂r/∂(coefficients).
    pub fn by_coefficients_transposed(&self, u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        self.terms.iter().for_each(|t| t.by_coefficients_transposed(u1, z, sought, gradient));
    }

    /// Share of inertia in the diagonal of the matrix; 0 in a static problem.
    pub fn share_of_inertia(&self, matrix: &Matrix) -> f64 {
        let Some(t) = self.context.inertia else { return 0.0 };
        let mass = inertia::diagonal(&self.context);
        let diagonal = &self.context.pattern.blocks.diagonal;
        t.displacement * mass / diagonal.iter().map(|k| matrix.mean_diagonal(*k)).sum::<f64>()
    }
}

/// A zero vector for `n` nodes.
pub fn zeros(n: usize) -> Nodes {
    vec![DVec3::ZERO; n]
}

/// Adds the blocks of a tangent ∂P/∂F [N m], row by row of both, to the nodes whose gradients these are; `places` are those of its pairs.
pub(crate) fn add_blocks(gradient: &[DVec3], places: &[u32], tangent: &[[f64; 9]; 9], matrix: &mut Matrix) {
    let n = gradient.len();
    for (j, b) in gradient.iter().enumerate() {
        let half: [DVec3; 9] =
            tangent.map(|t| DVec3::from_array([0, 3, 6].map(|c| t[c] * b.x + t[c + 1] * b.y + t[c + 2] * b.z)));
        for (i, a) in gradient.iter().enumerate() {
            let row = |r: usize| half[3 * r] * a.x + half[3 * r + 1] * a.y + half[3 * r + 2] * a.z;
            matrix.values[places[n * i + j] as usize] += DMat3::from_cols(row(0), row(1), row(2)).transpose();
        }
    }
}

/// block += s I.
pub(crate) fn add_to_diagonal(block: &mut DMat3, s: f64) {
    block.x_axis.x += s;
    block.y_axis.y += s;
    block.z_axis.z += s;
}
