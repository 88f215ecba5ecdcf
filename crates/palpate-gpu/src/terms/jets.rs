//! Jets of air, taken at the state that a step starts from: a load that the step does not change, with derivatives by the past. What a nozzle sees is
//! found anew for every step, on the way back as well, from the same state.

use super::{Along, Past, Pull, Term, Way, seeks_effect};
use crate::device::pipelines::pass;
use crate::device::pipelines::shared::asks;
use crate::passes::{ALL, Passes, Per};
use palpate_model::effects::Site;

/// At patches; it adds to what planes left there.
pub(super) struct Jets;

/// What the turning of patches says at nodes.
pub(super) struct JetTurns;

impl Passes<'_, '_> {
    /// True in a step of a plan with jets; no equilibrium has any.
    fn has_jets(&self) -> bool {
        self.world.geometry.shape.jets != 0 && self.step.is_some()
    }
}

impl Term for Jets {
    fn prepare(&self, s: &mut Passes) {
        if s.has_jets() {
            s.run(pass::AIM_JETS, ALL, Per::Patch, 0);
            s.run(pass::FRAME_JETS, ALL, Per::Member, 0);
            s.run(pass::SEE_JETS, ALL, Per::Patch, 0);
        }
    }

    fn residual(&self, s: &mut Passes, section: u32) {
        if s.has_jets() {
            s.run(pass::LOAD_JETS, section, Per::Patch, 0);
        }
    }

    fn by_past(&self, s: &mut Passes, past: &Past) {
        if s.has_jets() {
            let ask = match past.way {
                Way::Along { .. } => asks::TOUCH_OLD,
                Way::Back { .. } => asks::TOUCH_BACK,
            };
            s.run_with(pass::PRESS_JETS, ALL, Per::Patch, ask, &past.named());
        }
    }

    fn by_coefficients(&self, s: &mut Passes, along: &Along) {
        if along.jets && s.has_jets() {
            s.run_with(pass::PRESS_JETS, ALL, Per::Patch, asks::TOUCH_ALONG, &along.named);
        }
    }

    fn by_coefficients_transposed(&self, s: &mut Passes, pull: &Pull) {
        let sought = pull.sought().start || seeks_effect(s.world, pull.sought(), |s| matches!(s, Site::Jet));
        if sought && s.has_jets() {
            s.run_with(pass::PULL_JETS, ALL, Per::Patch, 0, &pull.named);
        }
    }
}

impl Term for JetTurns {
    fn by_past(&self, s: &mut Passes, past: &Past) {
        if let (Way::Back { .. }, true) = (&past.way, s.has_jets()) {
            s.run_with(pass::TURN_JETS, ALL, Per::Node, 0, &[("forces", past.to)]);
        }
    }
}
