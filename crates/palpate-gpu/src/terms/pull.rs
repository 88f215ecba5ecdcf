//! Derivatives of a cost by the coefficients of the balance: dJ/dc −= z · ∂r/∂c for all that are sought, in one pass a term. How many parameters
//! they make does not matter here: the host pulls the sums back once, at the end.

use crate::device::pipelines::pass;
use crate::device::pipelines::shared::points::{AT_CONTACT, AT_NODES};
use crate::device::pipelines::shared::pulls::{
    MATRICES_AT, POSES_AT, ROW_AT, SEEK_AT, SEEK_DAMPING, SEEK_GRAVITY, SEEK_MODULUS, SEEK_OWN, SEEK_PLANES, SEEK_POISSON,
    SEEK_REST, SEEK_START, SEEK_STIFFNESS, SEEK_TIME,
};
use crate::device::recorder::Named;
use crate::passes::{ALL, Passes, Per};
use crate::world::{Sums, Tally};
use palpate_model::effects::Site;
use palpate_model::params::coefficients::Sought;

/// The bit where something is sought.
fn bit(sought: bool, bit: u32) -> u32 {
    if sought { bit } else { 0 }
}

/// What terms of the whole body are told of what is sought.
fn asked(s: &Sought) -> u32 {
    bit(s.modulus, SEEK_MODULUS)
        | bit(s.poisson, SEEK_POISSON)
        | bit(s.damping[1], SEEK_DAMPING)
        | bit(s.rest, SEEK_REST)
        | bit(s.start, SEEK_START)
}

impl Passes<'_, '_> {
    /// Adds what this balance says of all that is sought, z in `direction`.
    pub(crate) fn pull(&mut self, tally: &Tally) {
        let Some(sums) = &tally.sums else { return };
        let (sought, named) = (&sums.sought, tally.named());
        let material = sought.modulus || sought.poisson || sought.rest;
        if material || sought.damping[1] {
            self.run_with(pass::PULL_CELLS, ALL, Per::Cell, asked(sought), &named);
            self.pull_elastic(&named);
        }
        if material || self.seeks_effect(sought, |s| matches!(s, Site::Cells(_))) {
            self.laws(pass::PULL_LAWS, ALL, Per::Cell, asked(sought), &named);
        }
        let grips = self.seeks_effect(sought, |s| matches!(s, Site::Clamps(_) | Site::Edges(_)));
        if material || sought.start || grips {
            let numbers = if grips { self.world.geometry.effects.hold_numbers() } else { [0; 2] };
            let extra = asked(sought) | numbers[0] << POSES_AT | numbers[1] << MATRICES_AT;
            self.run_with(pass::PULL_HOLDS, ALL, Per::Hold, extra, &named);
        }
        if sought.start {
            self.pull_held(&named);
        }
        if sought.rest {
            self.run_with(pass::PULL_REST, ALL, Per::Node, asked(sought), &named);
        }
        if material || sought.density || sought.gravity || sought.damping.contains(&true) {
            self.run_with(pass::PULL_NODES, ALL, Per::Node, asked(sought), &named);
        }
        if sought.masses {
            self.run_with(pass::PULL_MASSES, ALL, Per::Member, 0, &named);
        }
        let scales = self.world.plan.planes.iter().any(|p| p.stiffness.is_none());
        if self.world.geometry.shape.planes != 0 && (sought.planes || (sought.modulus && scales)) {
            self.run_with(pass::PULL_PATCHES, ALL, Per::Patch, 0, &named);
        }
        self.pull_points(sums, &named);
    }

    /// The same of the start, by its velocity, spin and shape; `adj` is dJ/du and dJ/dv there.
    pub(crate) fn pull_start(&mut self, tally: &Tally, adj: &wgpu::Buffer) {
        let Some(sums) = &tally.sums else { return };
        let named: Vec<_> = [("probe", adj)].into_iter().chain(tally.named()).collect();
        self.run_with(pass::PULL_START, ALL, Per::Node, asked(&sums.sought), &named);
    }

    /// Whether numbers of some effect on such a site are sought.
    pub(super) fn seeks_effect(&self, sought: &Sought, on: fn(&Site) -> bool) -> bool {
        self.world.plan.layout.effects().zip(&sought.effects).any(|((law, _), own)| *own && on(&law.site))
    }

    /// Laws of points: one pass an effect, by all that it depends on.
    fn pull_points(&mut self, sums: &Sums, named: &Named) {
        let (world, sought) = (self.world, &sums.sought);
        for (k, ((number, site), first)) in world.geometry.effects.points.iter().zip(&sums.points).enumerate() {
            let own = sought.effects[*number];
            // What does nothing depends on nothing but its own numbers.
            let absent = world.is_absent(*number);
            let what = bit(own, SEEK_OWN)
                | bit(sought.gravity && !absent, SEEK_GRAVITY)
                | bit(sought.modulus && !absent, SEEK_STIFFNESS)
                | bit(sought.start && !absent, SEEK_TIME)
                | bit(sought.planes && site.site == AT_CONTACT && !absent, SEEK_PLANES);
            if what == 0 {
                continue;
            }
            let extra = k as u32 | what << SEEK_AT | first << ROW_AT;
            if site.site == AT_NODES {
                self.run_with(pass::PULL_NODE_LAWS, ALL, Per::Node, extra, named);
            } else {
                self.run_with(pass::PULL_PATCH_LAWS, ALL, Per::Patch, extra, named);
            }
        }
    }
}
