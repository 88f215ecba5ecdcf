//! One balance of forces on the way to the device: its passes, each over the members that take part. The device decides who does.

use crate::device::pipelines::pass;
use crate::device::pipelines::shared::{roster, structs};
use crate::device::recorder::{Args, Named, Recorder, Size};
use crate::world::{KINDS, SOLVING, State, Tally, World};
use palpate_model::plan::scheme::Stage;

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
    /// Slices of groups of nodes with eight lanes each node, a workgroup of 256 each.
    Slice = roster::PER_SLICE,
    Elastic = roster::PER_ELASTIC,
    /// Groups of nodes, a workgroup each.
    Group = roster::PER_GROUP,
    /// Workgroups that stay for a whole solve.
    Crew = roster::PER_CREW,
}

/// One balance on the way to the device: a step, or the static problem.
pub(crate) struct Passes<'a, 'r> {
    pub(crate) world: &'a World,
    pub(crate) recorder: &'a mut Recorder<'r>,
    /// Stage number; `None` = static.
    pub(crate) step: Option<usize>,
    /// Past states with their weights, the newest first, of a stage that starts from several.
    pub(crate) past: Vec<(f32, &'a wgpu::Buffer)>,
    /// Names of this balance's own buffers.
    pub(crate) own: Vec<(&'static str, &'a wgpu::Buffer)>,
    /// Columns of each member that the roster lists: more than one while several are solved for at the same time.
    pub(crate) columns: u32,
}

impl<'a, 'r> Passes<'a, 'r> {
    pub(crate) fn new(
        world: &'a World,
        recorder: &'a mut Recorder<'r>,
        step: Option<usize>,
        now: &'a State,
        next: &'a State,
        tally: &'a Tally,
    ) -> Passes<'a, 'r> {
        let own = vec![
            ("now", &now.0.buffer),
            ("next", &next.0.buffer),
            ("health", tally.get("health")),
            ("gradient", tally.get("gradient")),
            ("efforts", tally.get("efforts")),
            // Products ask for a vector; unless a caller says otherwise it is the solution of the last solve.
            ("probe", &world.buffers[SOLVING]),
        ];
        Passes { world, recorder, step, past: Vec::new(), own, columns: 1 }
    }

    /// A stage from past states, whose weighted sum goes to `now` where they are several.
    pub(crate) fn of_stage(
        world: &'a World,
        recorder: &'a mut Recorder<'r>,
        stage: &Stage,
        past: &[&'a State],
        now: &'a State,
        next: &'a State,
        tally: &'a Tally,
    ) -> Passes<'a, 'r> {
        let mut s = Passes::new(world, recorder, Some(stage.number), now, next, tally);
        if past.len() > 1 {
            s.past = stage.from.iter().zip(past).map(|(f, state)| (f.1 as f32, &state.0.buffer)).collect();
        }
        s
    }

    /// Puts the weighted sum of several past states in place.
    pub(crate) fn mix_states(&mut self) {
        if let [(_, newer), (weight, older)] = self.past[..]
            && let Some((_, now)) = self.own.iter().find(|b| b.0 == "now")
        {
            let named = [("newer", newer), ("older", older), ("mixed", *now)];
            self.run_with(pass::MIX_STATES, ALL, Per::Node, weight.to_bits(), &named);
        }
    }

    /// Adds up the cells' deformations in several past states.
    pub(crate) fn mix_deformations(&mut self) {
        if !self.past.is_empty() {
            self.recorder.clear(&self.world.buffers["old_q"]);
        }
        for (weight, state) in self.past.clone() {
            self.run_with(pass::MIX_DEFORMATIONS, ALL, Per::Cell, weight.to_bits(), &[("now", state)]);
        }
    }

    /// Σ factor · addend → `total`, derivatives by displacements and velocities.
    pub(crate) fn add_scaled(&mut self, parts: &[(f32, &wgpu::Buffer)], total: &wgpu::Buffer) {
        self.recorder.clear(total);
        for (factor, addend) in parts {
            self.accumulate(*factor, addend, total);
        }
    }

    /// Adds factor · addend to `total`.
    pub(crate) fn accumulate(&mut self, factor: f32, addend: &wgpu::Buffer, total: &wgpu::Buffer) {
        self.run_with(pass::ADD_SCALED, ALL, Per::Node, factor.to_bits(), &[("addend", addend), ("total", total)]);
    }

    /// One dispatch over the members of a section of the roster.
    pub(crate) fn run(&mut self, pass: usize, section: u32, per: Per, extra: u32) {
        self.run_with(pass, section, per, extra, &[]);
    }

    /// The same with more buffers.
    pub(crate) fn run_with(&mut self, pass: usize, section: u32, per: Per, extra: u32, more: &Named) {
        let shape = &self.world.geometry.shape;
        let empty = match per {
            Per::Cell => shape.cells == 0,
            Per::Elastic => shape.elastic == 0,
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

    /// Lists anew who takes part in what, and whether [`Passes::relist`] has anything to do from here on.
    pub(crate) fn list(&mut self) {
        let own = self.own.clone();
        let args = Args { extra: self.columns, ..Args::default() };
        self.recorder.run(pass::LIST_MEMBERS, &own, Size::All { members: 1, groups: 1 }, args);
    }

    /// Lists anew, unless the last [`Passes::list`] found nobody who wants anything. (A dispatch may not write its own size, so
    /// these leave the gate as it is.)
    pub(crate) fn relist(&mut self) {
        let own: Vec<_> = [("gate", &self.world.buffers["no_gate"])].into_iter().chain(self.own.iter().copied()).collect();
        self.recorder.run(pass::LIST_MEMBERS, &own, Size::Gate, Args { extra: self.columns, ..Args::default() });
    }
}
