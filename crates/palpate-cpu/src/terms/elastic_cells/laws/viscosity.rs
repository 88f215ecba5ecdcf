//! The material's viscosity in a cell: its potential of the mean of |ε₁ − ε̃|² over what deforms, modes inside the cell included.
//!
//! That mean is twice d = ½ (q₁ − q̃)ᵀK₀(q₁ − q̃)/V, with K₀ the matrix for E = 1 and ν = 0, whose energy is ½|ε|². No modulus scales it.

use super::{CellLaws, LawState, Local, Side, V24, add, dot, multiply};
use crate::terms::Curvature;
use palpate_model::cutcells::corotation::M24;
use palpate_model::cutcells::elements::Elements;
use palpate_model::materials::viscosity::Viscosity;

/// What one solve needs of it.
#[derive(Clone, Copy)]
pub(super) struct Viscous<'a> {
    pub law: Viscosity,
    /// Matrices for E = 1 and ν = 0.
    strains: &'a Elements,
}

/// One cell's way from the past.
pub(super) struct Flow {
    /// K₀ (q₁ − q̃).
    pub kd: V24,
    /// |ε₁ − ε̃|², its mean.
    squared: f64,
    /// φ [J/m³] and its first and second derivative by d.
    pub value: f64,
    pub by_d: f64,
    pub by_dd: f64,
}

impl Default for Flow {
    fn default() -> Flow {
        Flow { kd: [0.0; 24], squared: 0.0, value: 0.0, by_d: 0.0, by_dd: 0.0 }
    }
}

/// What the tangent needs of a flow: the factor of K₀, K₀(q₁ − q̃), and the factor of its square.
#[derive(Clone, Copy)]
pub(super) struct FlowState {
    pub scale: f64,
    pub kd: V24,
    pub second: f64,
}

impl Flow {
    /// For a cell of this volume.
    pub fn state(&self, volume: f64) -> FlowState {
        FlowState { scale: self.by_d, kd: self.kd, second: self.by_dd / volume }
    }
}

impl LawState {
    /// With the curvature of what dissipates that a tangent asks for.
    pub(in crate::terms::elastic_cells) fn of(&self, curvature: Curvature) -> LawState {
        let mut state = *self;
        state.loss.1 = curvature.of_dissipation(state.loss.1);
        if let Some(flow) = &mut state.flow {
            flow.second = curvature.of_dissipation(flow.second);
        }
        state
    }
}

impl<'a> CellLaws<'a> {
    /// Present where the material has a viscosity and time passes.
    pub(super) fn viscous(&self) -> Option<Viscous<'a>> {
        let law = self.cells.c.physics().viscosity.filter(|_| self.rate > 0.0)?;
        Some(Viscous { law, strains: self.cells.c.strains? })
    }

    /// K₀ of a cell, for those who know that there is a viscosity.
    pub(super) fn flow_matrix(&self, e: usize) -> Option<&'a M24> {
        self.cells.c.strains.map(|s| &*s.cell(e).k)
    }

    pub(super) fn flow(&self, e: usize, volume: f64, new: &Side, old: &Side) -> Flow {
        let Some(v) = self.viscous() else { return Flow::default() };
        let dq: V24 = std::array::from_fn(|i| new.q[i] - old.q[i]);
        let kd = multiply(&v.strains.cell(e).k, &dq);
        let squared = dot(&dq, &kd) / volume;
        let [value, first, second] = v.law.loss(squared, self.rate);
        Flow { kd, squared, value, by_d: 2.0 * first, by_dd: 4.0 * second }
    }

    /// Change of the flow's force in the body frame when the past's deformation changes by `dq`: symmetric.
    pub(super) fn flow_by_old(&self, e: usize, l: &Local, dq: &V24, y: &mut V24) {
        let Some(v) = self.viscous() else { return };
        add(y, -l.flow.by_d, &multiply(&v.strains.cell(e).k, dq));
        add(y, -l.flow.by_dd * dot(&l.flow.kd, dq) / l.volume, &l.flow.kd);
    }

    /// Body-frame force along a change of η and h.
    pub(super) fn flow_along(&self, l: &Local, rates: &Viscosity) -> V24 {
        let [by_coefficient, by_exponent] = self.flow_by_numbers(l);
        let factor = by_coefficient * rates.coefficient + by_exponent * rates.exponent;
        l.flow.kd.map(|y| factor * y)
    }

    /// Derivatives by η and h of the factor on K₀(q₁ − q̃).
    pub(super) fn flow_by_numbers(&self, l: &Local) -> [f64; 2] {
        self.viscous().map_or([0.0; 2], |v| v.law.by_numbers(l.flow.squared, self.rate).map(|g| 2.0 * g))
    }
}
