//! What keeps stars of a cloud from moving otherwise than affinely. Its blocks of the matrix are gathered with those of elastic points.

use super::{Along, Past, Pull, Term};
use crate::device::pipelines::pass;
use crate::device::pipelines::shared::brace_asks::{BRACE_MINUS, BRACE_NEW, BRACE_OLD, BRACE_PROBE, BRACE_RESIDUAL};
use crate::device::pipelines::shared::structs::FIELD_STARS;
use crate::passes::{ALL, Passes, Per};

pub(super) struct StarPenalty;

impl Passes<'_, '_> {
    fn has_stars(&self) -> bool {
        self.world.geometry.shape.fields & FIELD_STARS != 0
    }
}

impl Term for StarPenalty {
    fn prepare(&self, s: &mut Passes) {
        // Of several past states none has a force of its own.
        if s.has_stars() && s.past.is_empty() {
            let to = [("forces", &s.world.buffers["old_force"])];
            s.run_with(pass::BRACE_STARS, ALL, Per::Node, BRACE_OLD, &to);
        }
    }

    /// Before elastic points, which leave nothing at nodes that are held.
    fn residual(&self, s: &mut Passes, section: u32) {
        if s.has_stars() {
            let to = [("forces", &s.world.buffers["residual"])];
            s.run_with(pass::BRACE_STARS, section, Per::Node, BRACE_NEW | BRACE_RESIDUAL, &to);
        }
    }

    fn by_past(&self, s: &mut Passes, past: &Past) {
        if s.has_stars() {
            let named = [("probe", past.probe), ("now", past.state), ("forces", past.to)];
            s.run_with(pass::BRACE_STARS, ALL, Per::Node, BRACE_PROBE | BRACE_MINUS, &named);
        }
    }

    fn by_coefficients(&self, s: &mut Passes, along: &Along) {
        if s.has_stars() && (along.moved.modulus || along.moved.poisson) {
            let mut named = along.named.clone();
            named.push(("forces", &s.world.buffers["column"]));
            s.run_with(pass::PUSH_STARS, ALL, Per::Node, along.flags, &named);
        }
    }

    fn by_coefficients_transposed(&self, s: &mut Passes, pull: &Pull) {
        if s.has_stars() && pull.material {
            s.run_with(pass::PULL_STARS, ALL, Per::Elastic, 0, &pull.named);
        }
    }
}
