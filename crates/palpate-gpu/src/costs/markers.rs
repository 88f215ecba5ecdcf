//! Markers and tracked points: where the body carries them, minus where they were seen.

use super::looks::Round;
use super::results::{Downloaded, places};
use super::shots::Shots;
use super::tables::SiteTables;
use super::{CARRIED, Cost, groups_of, readings, run};
use crate::device::Arena;
use crate::device::pipelines::pass;
use crate::device::recorder::{Named, Recorder};
use crate::layout::Sight;
use palpate_engine::{ReadingResidual, ResidualRow};
use palpate_model::plan::Plan;

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
        let obs = d.observation;
        let all = order(d).into_iter().zip(&d.seen().markers);
        all.map(|(place, m)| d.reading(obs.sensor_of(m.site), m.site, m.position, place)).collect()
    }

    fn rows(&self, d: &Downloaded) -> Vec<(ResidualRow, usize)> {
        let (obs, nodes) = (d.observation, &d.plan.body.nodes);
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

/// Adds sites, and what was seen of them, to an arena.
pub(super) fn put(plan: &Plan, (shots, sites): (&Shots, &SiteTables), tables: &mut Arena) {
    let (starts, list) = sites.lists();
    tables.put("marks", &shots.marks);
    tables.put("mark_rows", &shots.mark_rows);
    tables.put("sites", &sites.sites);
    tables.put("offset_places", &readings::offset_places(plan));
    sites.stencils.put(tables);
    tables.put("node_site_rows", &starts);
    tables.put("node_site_list", &list);
}
