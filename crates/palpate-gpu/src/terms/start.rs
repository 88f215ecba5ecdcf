//! The start: how velocity, spin and shape of the first state follow from the coefficients.

use super::asked;
use crate::device::pipelines::pass;
use crate::passes::{ALL, Passes, Per};
use crate::world::{Rates, Tally};

impl Passes<'_, '_> {
    /// Tangent of the start's shape and velocity → `part`.
    pub(crate) fn push_start(&mut self, rates: &Rates, part: &wgpu::Buffer) {
        let named: Vec<_> = [("tangent", part)].into_iter().chain(rates.named()).collect();
        self.run_with(pass::PUSH_START, ALL, Per::Node, rates.flags, &named);
    }

    /// Adds derivatives by velocity, spin and shape; `adj` is dJ/du and dJ/dv at the start.
    pub(crate) fn pull_start(&mut self, tally: &Tally, adj: &wgpu::Buffer) {
        let Some(sums) = &tally.sums else { return };
        let named: Vec<_> = [("probe", adj)].into_iter().chain(tally.named()).collect();
        self.run_with(pass::PULL_START, ALL, Per::Node, asked(&sums.sought), &named);
    }
}
