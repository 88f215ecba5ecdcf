//! What happens at nodes: inertia, weight, mass damping, point masses and the ghost penalty. Its passes also gather what cells, clamps and patches
//! left at their corners and stencils, in a fixed order: one pass over nodes or blocks reads everything that was left for them.

use super::{Along, Past, Pull, Term, Way};
use crate::device::pipelines::pass;
use crate::device::pipelines::shared::rates::WITH_CELLS;
use crate::device::pipelines::shared::structs::FIELD_DENSITY;
use crate::passes::{ALL, Passes, Per};

pub(super) struct Nodes;

impl Term for Nodes {
    fn prepare(&self, s: &mut Passes) {
        s.run(pass::GATHER_OLD, ALL, Per::Node, 0);
    }

    fn residual(&self, s: &mut Passes, section: u32) {
        s.run(pass::GATHER_RESIDUAL, section, Per::Node, 0);
    }

    fn tangent(&self, s: &mut Passes, section: u32) {
        s.run(pass::GATHER_MATRIX, section, Per::Block, 0);
        s.laws(pass::GATHER_LAWS, section, Per::Block, 0, &[]);
    }

    fn by_past(&self, s: &mut Passes, past: &Past) {
        match past.way {
            Way::Along { first } => s.run_with(pass::SUM_OLD, ALL, Per::Node, u32::from(!first), &past.named()),
            Way::Back { adjoint } => {
                let named = [("probe", past.probe), ("adj", adjoint), ("adj_now", past.to)];
                s.run_with(pass::STEP_BACK, ALL, Per::Node, 0, &named);
            }
        }
    }

    fn by_coefficients(&self, s: &mut Passes, along: &Along) {
        let flags = along.flags | if along.gathered { WITH_CELLS } else { 0 };
        s.run_with(pass::PUSH_NODES, ALL, Per::Node, flags, &along.named);
    }

    fn by_coefficients_transposed(&self, s: &mut Passes, pull: &Pull) {
        let sought = pull.sought();
        if sought.rest {
            // Through the cells and clamps, which left it at their corners.
            s.run_with(pass::PULL_REST, ALL, Per::Node, pull.asked(), &pull.named);
        }
        if pull.material || sought.density || sought.gravity || sought.damping.contains(&true) {
            s.run_with(pass::PULL_NODES, ALL, Per::Node, pull.asked(), &pull.named);
        }
        if sought.density && s.has_points() && s.world.geometry.shape.fields & FIELD_DENSITY != 0 {
            s.run_with(pass::PULL_DENSITIES, ALL, Per::Elastic, 0, &pull.named);
        }
        if sought.masses {
            s.run_with(pass::PULL_MASSES, ALL, Per::Member, 0, &pull.named);
        }
    }
}
