//! Elastic points, and nodes that clamps hold: the terms of bodies without cells. A body of cells has none of these passes.

use crate::device::pipelines::pass;
use crate::device::pipelines::shared::elastic_asks::{SPREAD_MINUS, SPREAD_PATCHES, SPREAD_RESIDUAL, STRESS_NEW, STRESS_OLD};
use crate::device::pipelines::shared::structs::FIELD_COUPLED;
use crate::device::recorder::Named;
use crate::passes::{ALL, Passes, Per};

impl Passes<'_, '_> {
    fn has_points(&self) -> bool {
        self.world.geometry.shape.elastic != 0
    }

    fn holds_nodes(&self) -> bool {
        self.world.geometry.shape.held != 0
    }

    /// Adds what points, and patches where they take part, do to nodes to `forces`.
    fn spread_elastic(&mut self, section: u32, bits: u32, patches: bool, forces: &wgpu::Buffer) {
        let patches = if patches && self.world.geometry.shape.patches != 0 { SPREAD_PATCHES } else { 0 };
        self.run_with(pass::SPREAD_ELASTIC, section, Per::Node, bits | patches, &[("forces", forces)]);
    }

    /// What the old states leave for the whole solve: strains that damping sees, and the force of a single one.
    pub(super) fn prepare_elastic(&mut self) {
        if !self.has_points() {
            return;
        }
        self.recorder.clear(&self.world.buffers["past_strains"]);
        for (weight, state) in self.past.clone() {
            self.run_with(pass::STRAIN_ELASTIC, ALL, Per::Elastic, weight.to_bits(), &[("now", state)]);
        }
        // Of several past states none has a force of its own.
        if self.past.is_empty() {
            self.run(pass::STRAIN_ELASTIC, ALL, Per::Elastic, 1.0f32.to_bits());
            self.run(pass::PRESS_ELASTIC, ALL, Per::Elastic, STRESS_OLD);
            self.spread_elastic(ALL, 0, false, &self.world.buffers["old_force"]);
        }
    }

    /// Puts nodes that are held where they are wanted in a trial.
    pub(crate) fn place_held(&mut self, section: u32) {
        if self.holds_nodes() {
            self.run(pass::PLACE_HELD, section, Per::Node, 0);
        }
    }

    /// The last of a residual: what all other terms left at nodes that are held counts no more.
    pub(super) fn residual_elastic(&mut self, section: u32) {
        if self.has_points() {
            self.run(pass::PRESS_ELASTIC, section, Per::Elastic, STRESS_NEW);
            self.spread_elastic(section, SPREAD_RESIDUAL, true, &self.world.buffers["residual"]);
        }
    }

    /// Adds points, patches, springs and mass damping to the matrix.
    pub(super) fn assemble_elastic(&mut self, section: u32) {
        if self.has_points() {
            self.run(pass::TANGENT_ELASTIC, section, Per::Elastic, 0);
            self.run(pass::GATHER_ELASTIC, section, Per::Block, 0);
            self.run(pass::BRACE_NODES, section, Per::Node, 0);
        }
    }

    /// After the diagonal was inverted.
    pub(super) fn forget_springs(&mut self, section: u32) {
        if self.holds_nodes() {
            self.run(pass::FORGET_SPRINGS, section, Per::Node, 0);
        }
    }

    /// Subtracts the derivative by the old state, times a vector (`back` is ALONG), or its transpose, from `forces`; with what patches left
    /// for it.
    pub(crate) fn couple_elastic(&mut self, back: u32, forces: &wgpu::Buffer, more: &Named) {
        if self.has_points() {
            self.run_with(pass::COUPLE_ELASTIC, ALL, Per::Elastic, back, more);
            let coupled = self.world.geometry.shape.fields & FIELD_COUPLED != 0;
            self.spread_elastic(ALL, SPREAD_MINUS, coupled, forces);
        }
    }

    /// Adds the change along a direction to `column`, with what patches left for it.
    pub(super) fn push_elastic(&mut self, flags: u32, start: bool, named: &Named) {
        if self.has_points() {
            self.run_with(pass::PUSH_ELASTIC, ALL, Per::Elastic, flags, named);
            self.spread_elastic(ALL, 0, true, &self.world.buffers["column"]);
        }
        if self.holds_nodes() && start {
            self.run_with(pass::PUSH_HELD, ALL, Per::Node, flags, named);
        }
    }

    /// Adds derivatives by what acts at points.
    pub(super) fn pull_elastic(&mut self, named: &Named) {
        if self.has_points() {
            self.run_with(pass::PULL_ELASTIC, ALL, Per::Elastic, 0, named);
        }
    }

    /// Adds the derivative by the time of the start through nodes that are held.
    pub(super) fn pull_held(&mut self, named: &Named) {
        if self.holds_nodes() {
            self.run_with(pass::PULL_HELD, ALL, Per::Node, 0, named);
        }
    }
}
