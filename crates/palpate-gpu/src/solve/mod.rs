//! The nonlinear and linear solves of a step as lists of dispatches. The device decides who takes part in which; the host
//! only says how often to ask.

pub(crate) mod backward;
mod choices;
mod faster;
pub(crate) mod forward;
mod measure;

use crate::device::pipelines::pass;
use crate::device::pipelines::shared::asks;
use crate::device::recorder::{Args, Size};
use crate::passes::{ALL, MATRIX, Passes, Per, SOLVE, TRIAL};
use crate::world::{Effort, FULL, Product};
#[cfg(test)]
pub(crate) use choices::Choices;
#[cfg(test)]
pub(crate) use faster::faster;
pub(crate) use faster::world;
pub use measure::{CgSpeed, Traffic};

/// Rounds beyond the allowed Newton iterations, for convex retries and halved steps.
const SPARE_ROUNDS: usize = 8;

/// CG iterations between two looks at who has converged (an even number: scalars alternate between two places).
const BLOCK: u32 = 16;
/// Blocks between two listings that can close the gate.
const GATED: u32 = 8;
/// CG iterations of the first [`EARLY`] Newton rounds and of the later ones, which hardly anyone needs; a solve that wants more
/// goes on in the next round.
const ROUND: u32 = 256;
const LATE_ROUND: u32 = 64;
const EARLY: usize = 8;

impl<'a> Passes<'a, '_> {
    /// What solves are given: a static problem, which is solved once and may take long, everything.
    fn effort(&self) -> Effort {
        if self.step.is_some() { self.world.effort.effort() } else { FULL }
    }

    /// Newton's method from free flight.
    pub(crate) fn newton(&mut self, iterations: usize) {
        self.list();
        self.mix_states();
        self.prepare();
        self.run(pass::PREDICT, ALL, Per::Node, 0);
        self.list();
        let full = iterations + SPARE_ROUNDS;
        let effort = self.effort();
        for round in 0..effort.rounds.min(full) {
            self.run(pass::PLACE_NEXT, TRIAL, Per::Node, 0);
            self.place_held(TRIAL);
            self.residual(TRIAL);
            self.run(pass::JUDGE_TRIAL, TRIAL, Per::Member, 0);
            self.list();
            self.assemble(MATRIX);
            self.run(pass::BEGIN_SOLVE, MATRIX, Per::Member, 0);
            self.relist();
            let budget = if round < EARLY { ROUND } else { LATE_ROUND };
            // One workgroup alone has all it is allowed in every round.
            let budget = if self.world.many { budget } else { self.world.geometry.shape.most };
            self.conjugate_gradients(asks::FOR_DIRECTION, effort.iterations.min(budget));
        }
        self.run(pass::FINISH_STEP, ALL, Per::Node, 0);
        self.run(pass::CHECK_STATE, ALL, Per::Member, u32::from(effort != FULL));
    }

    /// At least so many iterations of the solves of all members that want one: the rest comes in the next round.
    fn conjugate_gradients(&mut self, purpose: u32, budget: u32) {
        if !self.world.many {
            for _ in 0..budget.div_ceil(self.world.geometry.shape.chunk) {
                self.iterate_chunk(purpose);
                self.relist();
            }
            return;
        }
        for block in 1..=budget.div_ceil(BLOCK) {
            for i in 0..BLOCK {
                self.iterate(i % 2);
            }
            self.run_with(pass::CLOSE_CG, SOLVE, Per::Member, purpose, &self.failures(purpose));
            if block % GATED == 0 { self.list() } else { self.relist() }
        }
    }

    /// One iteration by many workgroups a member, of this parity.
    pub(crate) fn iterate(&mut self, parity: u32) {
        self.run(pass::TURN_CG, SOLVE, Per::Wide, parity);
        // Columns of a member find its matrix in the caches; without a matrix each would need corner forces of its own.
        let product = if self.columns > 1 { Product::Matrix } else { self.world.product };
        let width = self.multiply(product, parity);
        self.run(pass::ADVANCE_CG, SOLVE, Per::Wide, parity + width);
    }

    /// A chunk of iterations by one workgroup a member, for this purpose.
    pub(crate) fn iterate_chunk(&mut self, purpose: u32) {
        self.run_with(pass::ITERATE_CG, SOLVE, Per::Member, purpose, &self.failures(purpose));
    }

    /// Where a solve says that it failed: columns of a derivative have a place of their own each.
    fn failures(&self, purpose: u32) -> Vec<(&'static str, &'a wgpu::Buffer)> {
        (purpose == asks::FOR_DERIVATIVE).then(|| ("health", &self.world.buffers["column_health"])).into_iter().collect()
    }

    /// A times `cg_along` → `cg_image`; returns how the parts of pᵀ A p lie, for `advance_cg`.
    pub(crate) fn multiply(&mut self, product: Product, parity: u32) -> u32 {
        match product {
            Product::Matrix => {
                self.run(pass::MULTIPLY_ROWS, SOLVE, Per::Row, parity);
                0
            }
            Product::Free => {
                self.run(pass::MULTIPLY_CELLS, SOLVE, Per::Cell, parity);
                self.run(pass::GATHER_PRODUCT, SOLVE, Per::Wide, parity);
                asks::WIDE_PARTS
            }
        }
    }

    /// Makes the exact tangent ready at a converged state.
    pub(crate) fn linearise(&mut self) {
        self.list();
        self.run(pass::PREDICT, ALL, Per::Node, 0);
        self.mix_states();
        self.prepare();
        self.react();
        self.touch(ALL);
        self.assemble(ALL);
    }

    /// Solves with the tangent of [`Passes::linearise`]: `rhs` → `direction`.
    pub(crate) fn solve(&mut self) {
        self.begin_column(0);
        self.solve_columns(1);
    }

    /// Makes `rhs` column q of the next [`Passes::solve_columns`].
    pub(crate) fn begin_column(&mut self, q: usize) {
        self.run_with(pass::BEGIN_EXACT, ALL, Per::Member, q as u32, &self.failures(asks::FOR_DERIVATIVE));
    }

    /// Solves for as many columns as were begun, all at the same time, into as many vectors `direction`.
    pub(crate) fn solve_columns(&mut self, count: usize) {
        self.columns = count as u32;
        self.list();
        let most = self.world.geometry.shape.most;
        self.conjugate_gradients(asks::FOR_DERIVATIVE, self.effort().derivative.min(most));
        self.columns = 1;
        let groups = self.world.members().div_ceil(64);
        let args = Args { extra: count as u32, ..Args::default() };
        self.recorder.run(pass::END_EXACT, &self.own, Size::All { members: 1, groups }, args);
        self.list();
    }
}
