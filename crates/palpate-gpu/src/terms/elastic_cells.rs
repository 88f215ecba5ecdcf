//! Elastic and viscous force of the cells, and what their laws and a material that is not linear add to it.

use super::{Along, Past, Pull, Term, seeks_effect};
use crate::device::pipelines::pass;
use crate::passes::{ALL, Passes, Per};
use palpate_model::effects::Site;

pub(super) struct ElasticCells;

impl Term for ElasticCells {
    fn prepare(&self, s: &mut Passes) {
        s.mix_deformations();
        s.run(pass::PRESS_OLD, ALL, Per::Cell, 0);
        s.all_laws(pass::PRESS_LAWS, 1, &[]);
    }

    fn residual(&self, s: &mut Passes, section: u32) {
        s.run(pass::PRESS_CELLS, section, Per::Cell, 0);
        s.laws(pass::PRESS_LAWS, section, Per::Cell, 0, &[]);
    }

    fn tangent(&self, s: &mut Passes, section: u32) {
        s.run(pass::TANGENT_CELLS, section, Per::Cell, 0);
        s.laws(pass::TANGENT_LAWS, section, Per::Cell, 0, &[]);
    }

    fn by_past(&self, s: &mut Passes, past: &Past) {
        let named = [("probe", past.probe), ("now", past.state)];
        s.run_with(pass::COUPLE_OLD, ALL, Per::Cell, past.ask(), &named);
        s.all_laws(pass::COUPLE_LAWS, past.ask(), &named);
    }

    fn by_coefficients(&self, s: &mut Passes, along: &Along) {
        if along.gathered {
            s.run_with(pass::PUSH_CELLS, ALL, Per::Cell, along.flags, &along.named);
        }
        if along.body || along.laws || along.moved.viscosity {
            s.all_laws(pass::PUSH_LAWS, along.flags, &along.named);
        }
    }

    fn by_coefficients_transposed(&self, s: &mut Passes, pull: &Pull) {
        if pull.material || pull.sought().damping[1] {
            s.run_with(pass::PULL_CELLS, ALL, Per::Cell, pull.asked(), &pull.named);
        }
        if pull.material || pull.sought().viscosity || seeks_effect(s.world, pull.sought(), |s| matches!(s, Site::Cells(_))) {
            s.all_laws(pass::PULL_LAWS, pull.asked(), &pull.named);
        }
    }
}
