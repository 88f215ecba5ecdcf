//! The terms of a balance, one file each, and what they make together: residual, tangent, and derivatives by the old state.

mod cell_laws;
mod elastic;
mod point_laws;
mod pull;
mod push;

use crate::device::pipelines::pass;
use crate::device::pipelines::shared::points::{FORCE, STIFFNESS};
use crate::device::pipelines::shared::{asks, structs};
use crate::device::recorder::Named;
use crate::passes::{ALL, Passes, Per};

impl Passes<'_, '_> {
    /// What the old state leaves for the whole solve.
    pub(crate) fn prepare(&mut self) {
        if self.step.is_none() {
            return;
        }
        // The clamps' old force; its weight is zero where it does not act.
        self.run(pass::HOLD_CELLS, ALL, Per::Hold, asks::HOLD_OLD);
        self.mix_deformations();
        self.run(pass::PRESS_OLD, ALL, Per::Cell, 0);
        self.laws(pass::PRESS_LAWS, ALL, Per::Cell, 1, &[]);
        self.run(pass::GATHER_OLD, ALL, Per::Node, 0);
        self.prepare_elastic();
    }

    /// The residual at a trial of the members of a section: forces of contact, clamps, cells and laws, summed per node with inertia.
    pub(crate) fn residual(&mut self, section: u32) {
        self.run(pass::TOUCH_PATCHES, section, Per::Patch, 0);
        self.press_patches(section, FORCE, None, &[]);
        self.run(pass::HOLD_CELLS, section, Per::Hold, 0);
        self.press_cells(section);
        self.run(pass::GATHER_RESIDUAL, section, Per::Node, 0);
        self.press_nodes(section, FORCE, None, &self.world.buffers["residual"], &[]);
        self.residual_elastic(section);
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
            self.press_patches(section, STIFFNESS, None, &[]);
        }
        self.run(pass::TANGENT_CELLS, section, Per::Cell, 0);
        self.laws(pass::TANGENT_LAWS, section, Per::Cell, 0, &[]);
        self.run(pass::GATHER_MATRIX, section, Per::Block, 0);
        self.laws(pass::GATHER_LAWS, section, Per::Block, 0, &[]);
        self.assemble_elastic(section);
        self.press_nodes(section, STIFFNESS, None, &self.world.buffers["column"], &[]);
        self.run(pass::INVERT_DIAGONAL, section, Per::Node, 0);
        self.forget_springs(section);
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
}
