//! Displacements of nodes: simulated minus measured.

use super::looks::Round;
use super::results::Downloaded;
use super::{Cost, groups_of, run};
use crate::device::pipelines::pass;
use crate::device::recorder::{Named, Recorder};
use crate::layout::Sight;
use palpate_engine::{ReadingResidual, ResidualRow};
use palpate_model::observation::Sensor;

/// The cost.
pub(super) struct Displacements;

impl Cost for Displacements {
    fn items(&self, round: &Round) -> usize {
        round.nodes
    }

    fn scratch(&self, _s: &Sight) -> Vec<(&'static str, u64)> {
        Vec::new()
    }

    fn compare(&self, r: &mut Recorder, own: &Named, _sight: &Sight, round: Round) {
        if round.nodes > 0 {
            run(r, pass::COMPARE_NODES, own, round, groups_of(round.nodes), 0);
        }
    }

    /// Nodes gather their own residuals.
    fn pull(&self, _r: &mut Recorder, _own: &Named, _sight: &Sight, _round: Round) {}

    fn readings(&self, d: &Downloaded) -> Vec<ReadingResidual> {
        let (nodes, markers) = (&d.plan.body.nodes, d.seen().markers.len());
        let reading = |s: &palpate_model::observation::ObservedDisplacement| {
            d.reading(Sensor::Nodes, s.node, nodes[s.node as usize] + s.value, markers + s.node as usize)
        };
        d.seen().displacements.iter().map(reading).collect()
    }

    fn rows(&self, d: &Downloaded) -> Vec<(ResidualRow, usize)> {
        let (nodes, markers) = (&d.plan.body.nodes, d.seen().markers.len());
        let all = d.seen().displacements.iter().map(|s| s.node);
        all.flat_map(|n| d.coordinates(Sensor::Nodes, n, nodes[n as usize], markers + n as usize)).collect()
    }
}
