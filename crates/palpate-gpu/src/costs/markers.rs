//! Markers and tracked points: where the body carries them, minus where they were seen.

use super::looks::Round;
use super::results::{Downloaded, places};
use super::shots::Shots;
use super::tables::SiteTables;
use super::{CARRIED, Cost, VECTOR, groups_of, readings, run};
use crate::device::pipelines::pass;
use crate::device::recorder::{Named, Recorder};
use crate::device::{GpuError, Maker};
use crate::layout::Sight;
use palpate_engine::{ReadingResidual, ResidualRow};
use palpate_model::plan::Plan;
use std::collections::HashMap;

/// The cost.
pub(super) struct Markers;

impl Cost for Markers {
    fn items(&self, round: &Round) -> usize {
        round.markers
    }

    fn scratch(&self, s: &Sight) -> Vec<(&'static str, u64)> {
        vec![("carried", CARRIED * u64::from(s.markers))]
    }

    fn compare(&self, r: &mut Recorder, own: &Named, _sight: &Sight, round: Round) {
        if round.markers > 0 {
            run(r, pass::CARRY_MARKERS, own, round, groups_of(round.markers), 0);
        }
    }

    fn pull(&self, r: &mut Recorder, own: &Named, sight: &Sight, round: Round) {
        if round.markers > 0 && sight.offsets > 0 {
            run(r, pass::PULL_OFFSETS, own, round, sight.offsets as usize, 0);
        }
    }

    fn readings(&self, d: &Downloaded) -> Vec<ReadingResidual> {
        let obs = &d.plan.observation;
        let all = order(d).into_iter().zip(&d.seen().markers);
        all.map(|(place, m)| d.reading(obs.sensor_of(m.site), m.site, m.position, place)).collect()
    }

    fn rows(&self, d: &Downloaded) -> Vec<(ResidualRow, usize)> {
        let (obs, nodes) = (&d.plan.observation, &d.plan.body.nodes);
        let all = order(d).into_iter().zip(&d.seen().markers);
        all.flat_map(|(place, m)| {
            let rest = obs.markers[m.site as usize].carry(|i| nodes[i]).0;
            d.coordinates(obs.sensor_of(m.site), m.site, rest, place)
        })
        .collect()
    }
}

/// Where each of the frame's markers stands on the device.
fn order(d: &Downloaded) -> Vec<usize> {
    places(&d.shots.mark_order[d.shot.marker_start as usize..][..d.shot.marker_count as usize])
}

/// Uploads sites, and what was seen of them.
///
/// # Errors
/// More than the device has.
pub(super) fn upload<M: Maker>(
    gpu: &M,
    plan: &Plan,
    members: usize,
    (shots, sites): (&Shots, &SiteTables),
    to: &mut HashMap<&'static str, M::Buffer>,
) -> Result<(), GpuError> {
    let node_sites: Vec<[u32; 2]> = sites.of_node.columns.iter().zip(&sites.of_node.values).map(|(s, k)| [*s, *k]).collect();
    to.insert("marks", gpu.upload("marks", &shots.marks)?);
    to.insert("mark_rows", gpu.upload("mark_rows", &shots.mark_rows)?);
    to.insert("sites", gpu.upload("sites", &sites.sites)?);
    to.insert("offsets", gpu.buffer("offsets", VECTOR * (members.max(1) * sites.sites.len()) as u64)?);
    to.insert("offset_places", gpu.upload("offset_places", &readings::offset_places(plan))?);
    sites.stencils.upload(gpu, to)?;
    to.insert("node_site_rows", gpu.upload("node_site_rows", &sites.of_node.starts)?);
    to.insert("node_site_list", gpu.upload("node_site_list", &node_sites)?);
    Ok(())
}
