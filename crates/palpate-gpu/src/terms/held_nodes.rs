//! Nodes that clamps hold, of bodies of elastic points: they are placed where the clamp wants them. Their springs are in the matrix and in all
//! derivatives ([`super::elastic_points`]), where stiff numbers cost no digits.

use super::{Along, Pull, Term};
use crate::device::pipelines::pass;
use crate::passes::{ALL, Passes, Per};

pub(super) struct HeldNodes;

impl Passes<'_, '_> {
    fn holds_nodes(&self) -> bool {
        self.world.geometry.shape.held != 0
    }

    /// Puts nodes that are held where they are wanted in a trial.
    pub(crate) fn place_held(&mut self, section: u32) {
        if self.holds_nodes() {
            self.run(pass::PLACE_HELD, section, Per::Node, 0);
        }
    }

    /// After the diagonal was inverted.
    pub(super) fn forget_springs(&mut self, section: u32) {
        if self.holds_nodes() {
            self.run(pass::FORGET_SPRINGS, section, Per::Node, 0);
        }
    }
}

impl Term for HeldNodes {
    fn by_coefficients(&self, s: &mut Passes, along: &Along) {
        if s.holds_nodes() && along.moved.start {
            s.run_with(pass::PUSH_HELD, ALL, Per::Node, along.flags, &along.named);
        }
    }

    fn by_coefficients_transposed(&self, s: &mut Passes, pull: &Pull) {
        if s.holds_nodes() && pull.sought().start {
            s.run_with(pass::PULL_HELD, ALL, Per::Node, 0, &pull.named);
        }
    }
}
