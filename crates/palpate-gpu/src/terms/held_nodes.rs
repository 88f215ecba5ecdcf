//! Nodes that clamps hold, of bodies of elastic points: they are placed where the clamp wants them. Their springs are in the matrix and in all
//! derivatives ([`super::elastic_points`]), where stiff numbers cost no digits. Of members whose clamps give way the springs are soft, and part of
//! the balance.

use super::{Along, Pull, Term, clamps, seeks_effect};
use crate::device::pipelines::pass;
use crate::passes::{ALL, Passes, Per};
use palpate_model::effects::Site;

pub(super) struct HeldNodes;

impl Passes<'_, '_> {
    fn holds_nodes(&self) -> bool {
        self.world.geometry.shape.held != 0
    }

    /// Whether effects may put layers that give way between clamps and nodes.
    fn has_layers(&self) -> bool {
        self.holds_nodes() && !self.world.geometry.effects.matrix_rows().is_empty()
    }

    /// Puts nodes that are held where they are wanted in a trial.
    pub(crate) fn place_held(&mut self, section: u32) {
        if self.holds_nodes() {
            self.run(pass::PLACE_HELD, section, Per::Node, 0);
        }
    }

    /// What clamps bear at nodes that are placed, which derivatives by a layer's thickness need: nothing else tells how far springs give. Takes a
    /// residual at the states themselves.
    pub(crate) fn react(&mut self) {
        if self.has_layers() {
            self.run(pass::RECALL_TRIAL, ALL, Per::Node, 0);
            self.residual(ALL);
        }
    }
}

impl Term for HeldNodes {
    fn residual(&self, s: &mut Passes, section: u32) {
        if s.has_layers() {
            s.run(pass::PRESS_HELD, section, Per::Node, 0);
        }
    }

    fn by_coefficients(&self, s: &mut Passes, along: &Along) {
        let moves = along.moved.start || along.grips || along.moved.rest || (along.body && s.has_layers());
        if s.holds_nodes() && moves {
            s.run_with(pass::PUSH_HELD, ALL, Per::Node, along.flags | clamps::numbers(s, along.grips), &along.named);
        }
    }

    fn by_coefficients_transposed(&self, s: &mut Passes, pull: &Pull) {
        let grips = seeks_effect(s.world, pull.sought(), |s| matches!(s, Site::Clamps(_) | Site::Edges(_)));
        if s.holds_nodes() && (pull.sought().start || grips || (pull.material && s.has_layers())) {
            s.run_with(pass::PULL_HELD, ALL, Per::Node, clamps::numbers(s, grips), &pull.named);
        }
        if s.holds_nodes() && pull.sought().rest {
            s.run_with(pass::PULL_HELD_SHAPE, ALL, Per::Node, 0, &pull.named);
        }
    }
}
