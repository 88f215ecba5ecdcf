//! The nonlinear and linear solves of a step as lists of dispatches. The device decides who takes part in which; the host
//! only says how often to ask.

use crate::effects;
use crate::effort::{Effort, FULL};
use crate::pipelines::pass;
use crate::pipelines::shared::{asks, roster, structs};
use crate::recorder::{Args, Named, Recorder, Size};
use crate::tuning::Product;
use crate::world::{KINDS, State, Tally, World};

/// Sections of the roster: all, or those at one stage.
pub(crate) const ALL: u32 = structs::IDLE;
pub(crate) const MATRIX: u32 = structs::WANTS_MATRIX;
pub(crate) const SOLVE: u32 = structs::WANTS_SOLVE;
pub(crate) const TRIAL: u32 = structs::WANTS_TRIAL;

/// What the items of a dispatch are: the kinds of `list_members`.
#[derive(Clone, Copy, Debug)]
#[repr(u32)]
pub(crate) enum Per {
    Member = roster::PER_MEMBER,
    Node = roster::PER_NODE,
    Cell = roster::PER_CELL,
    Block = roster::PER_BLOCK,
    Patch = roster::PER_PATCH,
    Hold = roster::PER_HOLD,
    /// Nodes, in workgroups of 256.
    Wide = roster::PER_WIDE,
    /// Nodes with eight lanes each, in workgroups of 256.
    Row = roster::PER_ROW,
}

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

/// One balance on the way to the device: a step, or the static problem.
pub(crate) struct Solve<'a, 'r> {
    pub(crate) world: &'a World,
    pub(crate) recorder: &'a mut Recorder<'r>,
    /// Step number; `None` = static.
    pub(crate) step: Option<usize>,
    /// Names of this balance's own buffers.
    pub(crate) own: Vec<(&'static str, &'a wgpu::Buffer)>,
    /// Columns of each member that the roster lists: more than one while several are solved for at the same time.
    columns: u32,
}

impl<'a, 'r> Solve<'a, 'r> {
    pub(crate) fn new(
        world: &'a World,
        recorder: &'a mut Recorder<'r>,
        step: Option<usize>,
        now: &'a State,
        next: &'a State,
        tally: &'a Tally,
    ) -> Solve<'a, 'r> {
        let own = vec![
            ("now", &now.0.buffer),
            ("next", &next.0.buffer),
            ("health", tally.get("health")),
            ("gradient", tally.get("gradient")),
            // Products ask for a vector; unless a caller says otherwise it is the solution of the last solve.
            ("probe", &world.buffers["direction"]),
        ];
        Solve { world, recorder, step, own, columns: 1 }
    }

    /// One dispatch over the members of a section of the roster.
    pub(crate) fn run(&mut self, pass: usize, section: u32, per: Per, extra: u32) {
        self.run_with(pass, section, per, extra, &[]);
    }

    /// The same with more buffers.
    pub(crate) fn run_with(&mut self, pass: usize, section: u32, per: Per, extra: u32, more: &Named) {
        let shape = &self.world.geometry.shape;
        let empty = match per {
            Per::Patch => shape.patches == 0,
            Per::Hold => shape.holds == 0,
            _ => false,
        };
        if empty {
            return;
        }
        let roster = section * (self.columns * shape.members + 1);
        let args = Args { step: self.step.unwrap_or(0) as u32, mode: u32::from(self.step.is_some()), roster, extra };
        let offset = 12 * (section as usize * KINDS + per as usize) as u64;
        let named: Vec<_> = more.iter().chain(&self.own).copied().collect();
        self.recorder.run(pass, &named, Size::Indirect(offset), args);
    }

    /// Lists anew who takes part in what, and whether [`Solve::relist`] has anything to do from here on.
    pub(crate) fn list(&mut self) {
        let own = self.own.clone();
        let args = Args { extra: self.columns, ..Args::default() };
        self.recorder.run(pass::LIST_MEMBERS, &own, Size::All { members: 1, groups: 1 }, args);
    }

    /// Lists anew, unless the last [`Solve::list`] found nobody who wants anything. (A dispatch may not write its own size, so
    /// these leave the gate as it is.)
    fn relist(&mut self) {
        let own: Vec<_> = [("gate", &self.world.buffers["no_gate"])].into_iter().chain(self.own.iter().copied()).collect();
        self.recorder.run(pass::LIST_MEMBERS, &own, Size::Gate, Args { extra: self.columns, ..Args::default() });
    }

    /// What the old state leaves for the whole solve.
    pub(crate) fn prepare(&mut self) {
        if self.step.is_none() {
            return;
        }
        // The clamps' old force; its weight is zero where it does not act.
        self.run(pass::HOLD_CELLS, ALL, Per::Hold, asks::HOLD_OLD);
        self.run(pass::PRESS_OLD, ALL, Per::Cell, 0);
        self.laws(pass::PRESS_LAWS, ALL, Per::Cell, 1, &[]);
        self.run(pass::GATHER_OLD, ALL, Per::Node, 0);
    }

    /// A pass of the laws of cells, where there are any.
    pub(crate) fn laws(&mut self, pass: usize, section: u32, per: Per, extra: u32, more: &Named) {
        if self.world.geometry.effects.on_cells() {
            self.run_with(pass, section, per, extra, more);
        }
    }

    /// Forces of the cells and of their laws at the new state.
    pub(crate) fn press_cells(&mut self, section: u32) {
        self.run(pass::PRESS_CELLS, section, Per::Cell, 0);
        self.laws(pass::PRESS_LAWS, section, Per::Cell, 0, &[]);
    }

    /// Tangent, matrix and preconditioner of the members of a section, at the new state.
    pub(crate) fn assemble(&mut self, section: u32) {
        if self.world.geometry.effects.on_patches() {
            // Anew, because the convex part may be wanted after the exact one was taken.
            self.run(pass::TOUCH_PATCHES, section, Per::Patch, 0);
            self.press_patches(section, effects::STIFFNESS, None, &[]);
        }
        self.run(pass::TANGENT_CELLS, section, Per::Cell, 0);
        self.laws(pass::TANGENT_LAWS, section, Per::Cell, 0, &[]);
        self.run(pass::GATHER_MATRIX, section, Per::Block, 0);
        self.laws(pass::GATHER_LAWS, section, Per::Block, 0, &[]);
        self.press_nodes(section, effects::STIFFNESS, None, &self.world.buffers["column"], &[]);
        self.run(pass::INVERT_DIAGONAL, section, Per::Node, 0);
    }

    /// What solves are given: a static problem, which is solved once and may take long, everything.
    fn effort(&self) -> Effort {
        if self.step.is_some() { self.world.effort.effort() } else { FULL }
    }

    /// Newton's method from free flight.
    pub(crate) fn newton(&mut self, iterations: usize) {
        self.list();
        self.prepare();
        self.run(pass::PREDICT, ALL, Per::Node, 0);
        self.list();
        let full = iterations + SPARE_ROUNDS;
        let effort = self.effort();
        for round in 0..effort.rounds.min(full) {
            self.run(pass::PLACE_NEXT, TRIAL, Per::Node, 0);
            self.run(pass::TOUCH_PATCHES, TRIAL, Per::Patch, 0);
            self.press_patches(TRIAL, effects::FORCE, None, &[]);
            self.run(pass::HOLD_CELLS, TRIAL, Per::Hold, 0);
            self.press_cells(TRIAL);
            self.run(pass::GATHER_RESIDUAL, TRIAL, Per::Node, 0);
            self.press_nodes(TRIAL, effects::FORCE, None, &self.world.buffers["residual"], &[]);
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
        self.prepare();
        self.run(pass::TOUCH_PATCHES, ALL, Per::Patch, 0);
        self.assemble(ALL);
    }

    /// Derivative of the cells' force by the old state, times a vector (`back` is ALONG), or its transpose.
    pub(crate) fn couple_cells(&mut self, back: u32, more: &Named) {
        self.run_with(pass::COUPLE_OLD, ALL, Per::Cell, back, more);
        self.laws(pass::COUPLE_LAWS, ALL, Per::Cell, back, more);
    }

    /// What planes and effects on patches have to say of the old state, for `couple_old`.
    pub(crate) fn couple_patches(&mut self, question: u32, more: &Named) {
        if self.world.geometry.shape.fields & structs::FIELD_COUPLED != 0 {
            self.run_with(pass::TOUCH_PATCHES, ALL, Per::Patch, asks::TOUCH_OLD, more);
            self.press_patches(ALL, question, None, more);
        }
    }

    /// Solves with the tangent of [`Solve::linearise`]: `rhs` → `direction`.
    pub(crate) fn solve(&mut self) {
        self.begin_column(0);
        self.solve_columns(1);
    }

    /// Makes `rhs` column q of the next [`Solve::solve_columns`].
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
