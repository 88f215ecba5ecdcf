//! Depth points: matched with the deformed band, pulled by the cells that won them, moved by effects on the measurement.

use super::looks::Round;
use super::results::{Downloaded, places};
use super::tables::BandTables;
use super::{Cost, FOUND, VECTOR, groups_of, run};
use crate::device::Arena;
use crate::device::pipelines::pass;
use crate::device::pipelines::shared::structs::NONE;
use crate::device::recorder::{Named, Recorder};
use crate::layout::Sight;
use glam::DVec3;
use palpate_engine::{Misfit, ReadingResidual, ResidualRow, Source};
use palpate_model::observation::{Camera, ReadingKind, kernel};

/// The cost.
pub(super) struct Depth;

impl Cost for Depth {
    fn items(&self, round: &Round) -> usize {
        round.points
    }

    fn scratch(&self, s: &Sight) -> Vec<(&'static str, u64)> {
        let points = u64::from(s.points);
        let corners = if points == 0 { 0 } else { 8 * u64::from(s.stripes) * u64::from(s.cells) };
        vec![("keys", 4 * points), ("owners", 4 * points), ("found", FOUND * points), ("corner_pulls", VECTOR * corners)]
    }

    fn compare(&self, r: &mut Recorder, own: &Named, sight: &Sight, round: Round) {
        if round.points == 0 {
            return;
        }
        if sight.extended > sight.nodes {
            run(r, pass::EXTEND_BAND, own, round, groups_of((sight.extended - sight.nodes) as usize), 0);
        }
        run(r, pass::FORGET_MATCHES, own, round, groups_of(round.points), 0);
        for mode in [0, 1] {
            run(r, pass::MATCH_POINTS, own, round, cell_groups(sight), mode);
        }
        run(r, pass::PLACE_POINTS, own, round, groups_of(round.points), 0);
    }

    fn pull(&self, r: &mut Recorder, own: &Named, sight: &Sight, round: Round) {
        if round.points == 0 {
            return;
        }
        run(r, pass::PULL_POINTS, own, round, cell_groups(sight), 0);
        run(r, pass::GATHER_PULLS, own, round, groups_of(sight.extended as usize), 0);
        if sight.readings > 0 {
            run(r, pass::PULL_READINGS, own, round, sight.readings as usize, 0);
        }
    }

    fn readings(&self, d: &Downloaded) -> Vec<ReadingResidual> {
        let reading = |(p, place): (usize, usize)| {
            let (seen, found) = (&d.seen().points[p], &d.found[place]);
            let misfit = (found.cell != NONE).then(|| Misfit::Distance(f64::from(found.phi)));
            ReadingResidual { sensor: d.observation.sensor_of_point(seen), item: p as u32, place: seen.position, misfit }
        };
        order(d).into_iter().enumerate().map(reading).collect()
    }

    fn rows(&self, d: &Downloaded) -> Vec<(ResidualRow, usize)> {
        order(d).into_iter().enumerate().map(|(p, place)| (row(d, p, place), place)).collect()
    }
}

/// Where each of the frame's points stands on the device.
fn order(d: &Downloaded) -> Vec<usize> {
    places(&d.shots.point_order[d.shot.point_start as usize..][..d.shot.point_count as usize])
}

fn row(d: &Downloaded, point: usize, place: usize) -> ResidualRow {
    let (obs, grid) = (d.observation, &d.plan.body.band.grid);
    let (seen, found) = (&d.seen().points[point], &d.found[place]);
    let bare = ResidualRow {
        frame: d.frame,
        source: Source::point(point as u32, obs.sensor_of_point(seen)),
        value: None,
        noise: obs.noise(ReadingKind::Depth),
        weight: 0.0,
        rest: seen.position,
        along_sight: 0.0,
        by_place: DVec3::ZERO,
    };
    let Some(cell) = d.plan.body.band.cells.get(found.cell as usize) else { return bare };
    let camera = &obs.cameras[seen.camera as usize];
    let truth = d.sensors.truth(camera, seen);
    let sight = DVec3::from_array(truth.ray()).normalize_or_zero();
    let gradient = DVec3::from_array(found.gradient.map(f64::from));
    let value = f64::from(found.phi);
    ResidualRow {
        value: Some(value),
        weight: kernel::weight(value, d.plan.band),
        rest: grid.position(cell.lattice) + grid.h * DVec3::from_array(found.xi.map(f64::from)),
        // Without a line of sight errors may have any direction.
        along_sight: if *camera == Camera::Unknown { gradient.length() } else { gradient.dot(sight) },
        by_place: gradient,
        ..bare
    }
}

fn cell_groups(s: &Sight) -> usize {
    groups_of(8 * s.cells as usize * s.stripes as usize)
}

/// Adds the band to an arena.
pub(super) fn put(band: &BandTables, tables: &mut Arena) {
    tables.put("band_cells", &band.cells);
    tables.put("band_sdf", &band.sdf);
    tables.put("band_lookup", &band.lookup);
    tables.put("band_rows", &band.extend.starts);
    tables.put("band_columns", &band.extend.columns);
    tables.put("band_values", &band.extend.values);
    tables.put("fold_rows", &band.fold.starts);
    tables.put("fold_columns", &band.fold.columns);
    tables.put("fold_values", &band.fold.values);
    tables.put("band_node_rows", &band.corners.starts);
    tables.put("band_node_list", &band.corners.columns);
}
