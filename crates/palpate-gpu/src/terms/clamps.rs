//! Clamps of cells: Nitsche's terms of what they hold.

use super::{Along, Past, Pull, Term, seeks_effect};
use crate::device::pipelines::pass;
use crate::device::pipelines::shared::asks;
use crate::device::pipelines::shared::pulls::{MATRICES_AT, POSES_AT};
use crate::passes::{ALL, Passes, Per};
use palpate_model::effects::Site;

pub(super) struct Clamps;

/// How many numbers effects on clamps have, for kernels.
pub(super) fn numbers(s: &Passes, grips: bool) -> u32 {
    let numbers = if grips { s.world.geometry.effects.hold_numbers() } else { [0; 2] };
    numbers[0] << POSES_AT | numbers[1] << MATRICES_AT
}

impl Term for Clamps {
    fn prepare(&self, s: &mut Passes) {
        // Its weight is zero where the past's force does not act.
        s.run(pass::HOLD_CELLS, ALL, Per::Hold, asks::HOLD_OLD);
    }

    fn residual(&self, s: &mut Passes, section: u32) {
        s.run(pass::HOLD_CELLS, section, Per::Hold, 0);
    }

    fn by_past(&self, s: &mut Passes, past: &Past) {
        s.run_with(pass::HOLD_CELLS, ALL, Per::Hold, asks::HOLD_PROBE, &past.named());
    }

    fn by_coefficients(&self, s: &mut Passes, along: &Along) {
        if along.clamps {
            s.run_with(pass::PUSH_HOLDS, ALL, Per::Hold, along.flags | numbers(s, along.grips), &along.named);
        } else if along.gathered {
            s.run(pass::HOLD_CELLS, ALL, Per::Hold, asks::NO_HOLD);
        }
    }

    fn by_coefficients_transposed(&self, s: &mut Passes, pull: &Pull) {
        let grips = seeks_effect(s.world, pull.sought(), |s| matches!(s, Site::Clamps(_) | Site::Edges(_)));
        if pull.material || pull.sought().start || grips {
            s.run_with(pass::PULL_HOLDS, ALL, Per::Hold, pull.asked() | numbers(s, grips), &pull.named);
        }
    }
}
