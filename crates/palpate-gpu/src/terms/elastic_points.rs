//! Elastic and viscous force of points that stand for a volume each, and laws of cells, which elements add at their means. A body of cells has none
//! of these passes.

use super::{Along, Past, Pull, Term, seeks_effect};
use crate::device::pipelines::pass;
use crate::device::pipelines::shared::asks::{ALONG, OF_SHAPE, TRANSPOSED};
use crate::device::pipelines::shared::elastic_asks::{
    SHAPE_PULLS, SHAPE_TANGENT, SPREAD_MINUS, SPREAD_PATCHES, SPREAD_RESIDUAL, STRESS_NEW, STRESS_OLD,
};
use crate::device::recorder::Named;
use crate::passes::{ALL, Passes, Per};
use crate::world::SOLVING;
use crate::world::rates::REST_CHANGE;
use palpate_model::effects::Site;

pub(super) struct ElasticPoints;

impl Passes<'_, '_> {
    pub(super) fn has_points(&self) -> bool {
        self.world.geometry.shape.elastic != 0
    }

    /// Whether laws of cells act on elements of such points.
    fn has_element_laws(&self) -> bool {
        self.has_points() && self.world.geometry.effects.cell_laws() > 0
    }

    /// A pass of laws of cells on elements. There are no more elements than points.
    fn element_laws(&mut self, pass: usize, section: u32, extra: u32, more: &Named) {
        if self.has_element_laws() {
            self.run_with(pass, section, Per::Elastic, extra, more);
        }
    }

    /// Sums up what elements strained in the past.
    fn strain_elements(&mut self) {
        if !self.has_element_laws() {
            return;
        }
        let stretches = ("stretches", &self.world.buffers["past_stretches"]);
        self.recorder.clear(stretches.1);
        for (weight, state) in self.past.clone() {
            self.element_laws(pass::STRAIN_TET_LAWS, ALL, weight.to_bits(), &[("now", state), stretches]);
        }
        if self.past.is_empty() {
            self.element_laws(pass::STRAIN_TET_LAWS, ALL, 1.0f32.to_bits(), &[stretches]);
        }
    }

    /// Leaves what points' forces do when the stress-free shape changes by `probe`, or what the adjoint `probe` says of the shape, in
    /// `shape_stress`.
    fn reshape(&mut self, probe: &wgpu::Buffer, pulls: bool) {
        let bits = if pulls { SHAPE_PULLS } else { 0 };
        let named = [("probe", probe)];
        self.recorder.clear(&self.world.buffers["shape_stress"]);
        // The old state has a stress of its own where it is the only past one.
        let states: &[u32] = if self.step.is_some() && self.past.is_empty() { &[STRESS_NEW, STRESS_OLD] } else { &[STRESS_NEW] };
        for state in states.iter().copied() {
            self.run(pass::PRESS_ELASTIC, ALL, Per::Elastic, state);
            self.element_laws(pass::PRESS_TET_LAWS, ALL, state, &[]);
            self.run_with(pass::SHAPE_ELASTIC, ALL, Per::Elastic, bits, &named);
        }
        self.run_with(pass::SHAPE_ELASTIC, ALL, Per::Elastic, bits | SHAPE_TANGENT, &named);
        if self.step.is_none() {
            return;
        }
        let ask = OF_SHAPE | if pulls { TRANSPOSED } else { ALONG };
        let now = self.own.iter().find(|b| b.0 == "now").map(|b| (1.0, b.1));
        let past = if self.past.is_empty() { Vec::from_iter(now) } else { self.past.clone() };
        for (weight, state) in past {
            let named = [("probe", probe), ("now", state)];
            self.run_with(pass::COUPLE_ELASTIC, ALL, Per::Elastic, ask, &named);
            self.element_laws(pass::COUPLE_TET_LAWS, ALL, ask, &named);
            self.run_with(pass::SHAPE_PAST, ALL, Per::Elastic, weight.to_bits(), &named);
        }
    }

    /// Adds what points, and patches where they take part, do to nodes to `forces`.
    fn spread_elastic(&mut self, section: u32, bits: u32, patches: bool, forces: &wgpu::Buffer) {
        let patches = if patches && self.world.geometry.shape.patches != 0 { SPREAD_PATCHES } else { 0 };
        self.run_with(pass::SPREAD_ELASTIC, section, Per::Node, bits | patches, &[("forces", forces)]);
    }
}

impl Term for ElasticPoints {
    fn prepare(&self, s: &mut Passes) {
        if !s.has_points() {
            return;
        }
        s.recorder.clear(&s.world.buffers["past_strains"]);
        for (weight, state) in s.past.clone() {
            s.run_with(pass::STRAIN_ELASTIC, ALL, Per::Elastic, weight.to_bits(), &[("now", state)]);
        }
        s.strain_elements();
        // Of several past states none has a force of its own.
        if s.past.is_empty() {
            s.run(pass::STRAIN_ELASTIC, ALL, Per::Elastic, 1.0f32.to_bits());
            s.run(pass::PRESS_ELASTIC, ALL, Per::Elastic, STRESS_OLD);
            s.element_laws(pass::PRESS_TET_LAWS, ALL, STRESS_OLD, &[]);
            s.spread_elastic(ALL, 0, false, &s.world.buffers["old_force"]);
        }
    }

    /// The last of a residual: what all other terms left at nodes that are held counts no more.
    fn residual(&self, s: &mut Passes, section: u32) {
        if s.has_points() {
            s.run(pass::PRESS_ELASTIC, section, Per::Elastic, STRESS_NEW);
            s.element_laws(pass::PRESS_TET_LAWS, section, STRESS_NEW, &[]);
            s.spread_elastic(section, SPREAD_RESIDUAL, true, &s.world.buffers["residual"]);
        }
    }

    /// Points, patches, mass damping and springs.
    fn tangent(&self, s: &mut Passes, section: u32) {
        if s.has_points() {
            s.run(pass::TANGENT_ELASTIC, section, Per::Elastic, 0);
            s.element_laws(pass::TANGENT_TET_LAWS, section, 0, &[]);
            s.run(pass::GATHER_ELASTIC, section, Per::Block, 0);
            s.run(pass::BRACE_NODES, section, Per::Node, 0);
        }
    }

    /// With what patches left for it.
    fn by_past(&self, s: &mut Passes, past: &Past) {
        if s.has_points() {
            let named = [("probe", past.probe), ("now", past.state)];
            s.run_with(pass::COUPLE_ELASTIC, ALL, Per::Elastic, past.ask(), &named);
            s.element_laws(pass::COUPLE_TET_LAWS, ALL, past.ask(), &named);
            s.spread_elastic(ALL, SPREAD_MINUS, s.patches_see_past(), past.to);
        }
    }

    /// With what patches left for it.
    fn by_coefficients(&self, s: &mut Passes, along: &Along) {
        if s.has_points() && along.gathered {
            s.run_with(pass::PUSH_ELASTIC, ALL, Per::Elastic, along.flags, &along.named);
            if along.body || along.laws {
                s.element_laws(pass::PUSH_TET_LAWS, ALL, along.flags, &along.named);
            }
            s.spread_elastic(ALL, 0, true, &s.world.buffers["column"]);
        }
        let shape = along.named.iter().find(|b| b.0 == REST_CHANGE).filter(|_| along.moved.rest);
        if let Some((_, change)) = shape.filter(|_| s.has_points()) {
            s.reshape(change, false);
            let named = [("forces", &s.world.buffers["column"]), ("elastic_stress", &s.world.buffers["shape_stress"])];
            s.run_with(pass::SPREAD_ELASTIC, ALL, Per::Node, 0, &named);
        }
    }

    fn by_coefficients_transposed(&self, s: &mut Passes, pull: &Pull) {
        if s.has_points() && (pull.material || pull.sought().damping[1] || pull.sought().viscosity) {
            s.run_with(pass::PULL_ELASTIC, ALL, Per::Elastic, 0, &pull.named);
        }
        if pull.material || seeks_effect(s.world, pull.sought(), |s| matches!(s, Site::Cells(_))) {
            s.element_laws(pass::PULL_TET_LAWS, ALL, 0, &pull.named);
        }
        if pull.sought().rest && s.has_points() {
            s.reshape(&s.world.buffers[SOLVING], true);
            let pulls = pull.named.iter().find(|b| b.0 == "rest_pulls").map(|b| b.1);
            let named = [("elastic_stress", &s.world.buffers["shape_stress"])];
            if let Some(to) = pulls {
                s.run_with(pass::SPREAD_ELASTIC, ALL, Per::Node, SPREAD_MINUS, &[named[0], ("forces", to)]);
            }
        }
    }
}
