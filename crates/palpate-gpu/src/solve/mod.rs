//! The nonlinear and linear solves of a step as lists of dispatches. The device decides who takes part in which; the host
//! only says how often to ask.

pub(crate) mod backward;
mod faster;
pub(crate) mod forward;
mod measure;
mod stay;

use crate::device::pipelines::pass;
use crate::device::pipelines::shared::asks;
use crate::device::recorder::{Args, Size};
use crate::passes::{ALL, MATRIX, Passes, Per, SOLVE, TRIAL};
use crate::world::{Effort, Product};
#[cfg(test)]
pub(crate) use faster::faster;
pub(crate) use faster::{world, world_async};
pub use measure::{CgSpeed, Traffic};

/// Rounds for each allowed Newton iteration, as a step may be halved, and beyond: friction halves two of three.
const ROUNDS: usize = 2;
const SPARE_ROUNDS: usize = 8;

/// CG iterations between two looks at who has converged (an even number: scalars alternate between two places).
const BLOCK: u32 = 16;
/// Those of a derivative's, with a look at the true residual after each block.
const EXACT_BLOCK: u32 = 32;
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
        self.step.map_or_else(Effort::full, |stage| self.world.effort.effort(stage))
    }

    /// Newton's method from free flight.
    pub(crate) fn newton(&mut self, iterations: usize) {
        self.list();
        self.mix_states();
        self.prepare();
        self.run(pass::PREDICT, ALL, Per::Node, 0);
        self.list();
        // Groups hardly turn in a step. On the way to a balance they do.
        if self.step.is_some() {
            self.turn_groups(ALL, self.state("now"));
        }
        let full = ROUNDS * iterations + SPARE_ROUNDS;
        let effort = self.effort();
        for round in 0..effort.rounds.min(full) {
            self.run(pass::PLACE_NEXT, TRIAL, Per::Node, 0);
            self.place_held(TRIAL);
            self.residual(TRIAL);
            self.run(pass::WEIGH_TRIAL, TRIAL, Per::Node, 0);
            self.run(pass::JUDGE_TRIAL, TRIAL, Per::Member, round as u32);
            self.list();
            self.assemble(MATRIX);
            if self.step.is_none() {
                self.turn_groups(MATRIX, self.state("next"));
            }
            self.run(pass::BEGIN_SOLVE, MATRIX, Per::Member, 0);
            self.relist();
            let budget = if round < EARLY { ROUND } else { LATE_ROUND };
            // One workgroup alone has all it is allowed in every round.
            let budget = if self.world.many { budget } else { self.world.geometry.shape.most };
            self.conjugate_gradients(asks::FOR_DIRECTION, effort.of_round(round).min(budget));
        }
        self.run(pass::FINISH_STEP, ALL, Per::Node, 0);
        self.run(pass::CHECK_STATE, ALL, Per::Member, u32::from(effort != Effort::full()));
    }

    /// At least so many iterations of the solves of all members that want one: the rest comes in the next round.
    fn conjugate_gradients(&mut self, purpose: u32, budget: u32) {
        self.begin_cg(purpose);
        if !self.world.many {
            // An end that was none cuts a chunk short.
            let more = if purpose == asks::FOR_DERIVATIVE { asks::MOST_CLAIMS } else { 0 };
            for _ in 0..budget.div_ceil(self.world.geometry.shape.chunk) + more {
                self.iterate_chunk(purpose);
                if purpose == asks::FOR_DERIVATIVE {
                    self.run_with(pass::LOOK_CG, SOLVE, Per::Member, purpose, &self.failures(purpose));
                }
                self.relist();
            }
            return;
        }
        self.precondition();
        let exact = purpose == asks::FOR_DERIVATIVE;
        if let Some(chunk) = self.world.stay(self.columns * self.world.geometry.shape.members) {
            return self.stay(purpose, budget, chunk);
        }
        let mut left = budget.next_multiple_of(2);
        for block in 1.. {
            if left == 0 {
                break;
            }
            let now = left.min(if exact { EXACT_BLOCK } else { BLOCK });
            (0..now).for_each(|i| self.iterate(i % 2));
            left -= now;
            if exact {
                self.look_at_rest();
            }
            self.run_with(pass::CLOSE_CG, SOLVE, Per::Member, purpose, &self.failures(purpose));
            if block % GATED == 0 { self.list() } else { self.relist() }
        }
    }

    /// The same by workgroups that stay, so many iterations in a dispatch.
    fn stay(&mut self, purpose: u32, budget: u32, chunk: u32) {
        let exact = purpose == asks::FOR_DERIVATIVE;
        for _ in 0..if exact { 1 + asks::MOST_CLAIMS } else { 1 } {
            let mut left = budget.next_multiple_of(2);
            while left > 0 {
                let now = left.min(chunk);
                self.run(pass::PERSIST_CG, SOLVE, Per::Crew, 8 * now);
                left -= now;
            }
            if exact {
                self.look_at_rest();
            }
            self.run_with(pass::CLOSE_CG, SOLVE, Per::Member, purpose, &self.failures(purpose));
            self.relist();
        }
    }

    /// One iteration by many workgroups a member, of this parity, from the preconditioned residual to the next one.
    pub(crate) fn iterate(&mut self, parity: u32) {
        self.multiply(self.product(), parity);
        self.run(pass::ADVANCE_CG, SOLVE, Per::Group, parity);
    }

    /// Columns of a member find its matrix in the caches; without a matrix each would need corner forces of its own.
    fn product(&self) -> Product {
        if self.columns > 1 { Product::Matrix } else { self.world.product }
    }

    /// Makes solves ready that have not begun.
    pub(crate) fn begin_cg(&mut self, purpose: u32) {
        self.run(pass::BEGIN_CG, SOLVE, Per::Group, purpose);
    }

    /// The first preconditioned residual, or that of a residual that was replaced: after an odd iteration, or none.
    pub(crate) fn precondition(&mut self) {
        self.run(pass::ADVANCE_CG, SOLVE, Per::Group, asks::ODD | asks::BEGINS);
    }

    /// Replaces the residual that iterations carry along with the true one, after an odd iteration.
    fn look_at_rest(&mut self) {
        self.multiply(self.product(), asks::OF_SOLUTION);
        self.run(pass::REPLACE_REST, SOLVE, Per::Group, 0);
        self.precondition();
    }

    /// How far the groups of the preconditioner's second level have turned in a state.
    pub(crate) fn turn_groups(&mut self, section: u32, state: &wgpu::Buffer) {
        self.run_with(pass::TURN_GROUPS, section, Per::Group, 0, &[("turning", state)]);
    }

    /// The buffer of this balance's old or new state.
    fn state(&self, name: &str) -> &'a wgpu::Buffer {
        self.own.iter().find(|b| b.0 == name).map(|b| b.1).expect("a balance has both")
    }

    /// A chunk of iterations by one workgroup a member, for this purpose.
    pub(crate) fn iterate_chunk(&mut self, purpose: u32) {
        self.run_with(pass::ITERATE_CG, SOLVE, Per::Member, purpose, &self.failures(purpose));
    }

    /// Where a solve says that it failed: columns of a derivative have a place of their own each.
    fn failures(&self, purpose: u32) -> Vec<(&'static str, &'a wgpu::Buffer)> {
        (purpose == asks::FOR_DERIVATIVE).then(|| ("health", &self.world.buffers["column_health"])).into_iter().collect()
    }

    /// Multiplies A with the way of an iteration of this parity, or with the solution (`asks`).
    pub(crate) fn multiply(&mut self, product: Product, ask: u32) {
        match product {
            Product::Matrix => self.run(pass::MULTIPLY_ROWS, SOLVE, Per::Slice, ask),
            Product::Free => {
                self.run(pass::MULTIPLY_CELLS, SOLVE, Per::Cell, ask);
                self.run(pass::GATHER_PRODUCT, SOLVE, Per::Slice, ask);
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
        self.turn_groups(ALL, self.state("next"));
    }

    /// Solves with the tangent of [`Passes::linearise`]: `rhs` → `direction`.
    pub(crate) fn solve(&mut self) {
        self.begin_column(0);
        self.solve_columns(1);
    }

    /// Makes `rhs` column q of the next [`Passes::solve_columns`].
    pub(crate) fn begin_column(&mut self, q: usize) {
        self.run(pass::WEIGH_RHS, ALL, Per::Node, q as u32);
        self.run_with(pass::BEGIN_EXACT, ALL, Per::Member, q as u32, &self.failures(asks::FOR_DERIVATIVE));
    }

    /// Solves for as many columns as were begun, all at the same time, into as many vectors `direction`.
    pub(crate) fn solve_columns(&mut self, count: usize) {
        self.columns = count as u32;
        self.list();
        // A look that finds too much left comes at the end of a block, and the next block begins anew: a solve may take all its iterations and that
        // often some more, and must have come to an end then.
        let most = self.world.geometry.shape.most + asks::MOST_CLAIMS * EXACT_BLOCK;
        let given = self.effort().derivative.saturating_add(EXACT_BLOCK).min(most);
        self.conjugate_gradients(asks::FOR_DERIVATIVE, given);
        self.columns = 1;
        let groups = self.world.members().div_ceil(64);
        let (step, mode) = (self.step.unwrap_or(0) as u32, u32::from(self.step.is_some()));
        let args = Args { step, mode, extra: count as u32, ..Args::default() };
        self.recorder.run(pass::END_EXACT, &self.own, Size::All { members: 1, groups }, args);
        self.list();
    }
}
