//! Effects on the measurement: the clock's shift, markers' offsets, and, for depth readings, true points and cameras of every member with
//! the points' derivatives, computed in double precision when a batch is set. Without the latter all members share the recording's points.
//! Fronts are looked for along lines of sight as the recording has them (`shared/front.wgsl`), which effects do not move.

use super::shots::{Shots, split};
use crate::device::{Arena, GpuError, Maker};
use palpate_engine::Direction;
use palpate_model::effects::sensors::Sensors;
use palpate_model::effects::{Site, Unstated};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use std::collections::HashMap;

/// Places in θ of numbers that shift the simulation against the frames.
pub(super) fn shifts(plan: &Plan) -> Vec<usize> {
    let sensors = Sensors::new(&plan.layout, &plan.theta);
    sensors.clocks().iter().copied().chain([plan.layout.index(ParamKey::TimeStart)]).collect()
}

/// Parameters that are offsets of markers: 3 · marker + axis, and the place in θ.
pub(super) fn offset_places(plan: &Plan) -> Vec<[u32; 2]> {
    let sensors = Sensors::new(&plan.layout, &plan.theta);
    let of =
        |m: u32| sensors.marker_places(m).flat_map(move |at| (0..3).map(move |a| [3 * m + a, at as u32 + a])).collect::<Vec<_>>();
    (0..plan.observation.markers.len() as u32).flat_map(of).collect()
}

/// Components of directions by what the measurement depends on beside the states, as `shared/directions.wgsl` says.
pub(super) fn components(plan: &Plan, directions: &[Direction]) -> Vec<f32> {
    let (shifts, offsets, readings) = (shifts(plan), offset_places(plan), places(plan));
    let of_offsets = if offsets.is_empty() { 0 } else { 3 * plan.observation.markers.len() };
    let one = |d: &Direction| {
        let mut all = vec![0.0; of_offsets];
        offsets.iter().for_each(|[number, place]| all[*number as usize] = d.component(*place as usize) as f32);
        let later = shifts.iter().map(|p| d.component(*p)).sum::<f64>() as f32;
        [vec![later], all, readings.iter().map(|p| d.component(*p as usize) as f32).collect()].concat()
    };
    directions.iter().flat_map(one).collect()
}

/// Offsets of all markers, `[B][sites]` [m].
pub(super) fn offsets(sensors: &[Sensors], sites: u32) -> Vec<[f32; 4]> {
    sensors.iter().flat_map(|s| (0..sites).map(|m| split(s.marker_offset(m))[0])).collect()
}

/// Numbers of effects on readings that have derivatives: their places in θ.
pub(super) fn places(plan: &Plan) -> Vec<u32> {
    let of_readings = plan.layout.effects().filter(|(law, _)| matches!(law.site, Site::Readings(_)));
    of_readings
        .flat_map(|(law, range)| law.params.iter().zip(range))
        .filter(|(p, _)| !matches!(p.default, Unstated::Choice(_)))
        .map(|(_, place)| place as u32)
        .collect()
}

/// The sensors that shots are made for: one for all members where readings are exact.
pub(super) fn distinct(plan: &Plan, sensors: &[Sensors]) -> Vec<Sensors> {
    if places(plan).is_empty() { vec![Sensors::default()] } else { sensors.to_vec() }
}

/// Uploads what depends on the sensors.
///
/// # Errors
/// More than the device has.
pub(super) fn upload<M: Maker>(
    gpu: &M,
    plan: &Plan,
    sensors: &[Sensors],
    shots: &Shots,
    buffers: &mut HashMap<&'static str, M::Buffer>,
) -> Result<(), GpuError> {
    let obs = &plan.observation;
    let cameras = sensors.iter().flat_map(|s| s.cameras(&obs.cameras));
    let cameras: Vec<[f32; 4]> = cameras.map(|c| split(c.center - plan.body.center)[0]).collect();
    let mut tables = Arena::new("shots_tables");
    tables.put("cameras", &cameras);
    tables.put("shots", &shots.shots);
    tables.put("points", &shots.points);
    tables.put("cube_starts", &shots.cube_starts);
    tables.put("reading_slopes", &slopes(plan, sensors, shots));
    tables.put("recorded_lines", &recorded_lines(plan, shots));
    tables.upload(gpu, buffers)
}

/// Directions from cameras to points as the recording has them, in the device's order; none where no reading is moved.
fn recorded_lines(plan: &Plan, shots: &Shots) -> Vec<[f32; 4]> {
    if places(plan).is_empty() {
        return Vec::new();
    }
    let obs = &plan.observation;
    let mut out = Vec::with_capacity(shots.points.len());
    for (number, shot) in shots.shots.iter().enumerate() {
        let points = &obs.frames[number % obs.frames.len()].points;
        out.extend(shots.point_order[shot.point_start as usize..][..shot.point_count as usize].iter().map(|&p| {
            let seen = &points[p as usize];
            split((seen.position - obs.cameras[seen.camera as usize].center).normalize_or_zero())[0]
        }));
    }
    out
}

/// ∂(true point)/∂θ of every point in the device's order, `[points][K]`.
fn slopes(plan: &Plan, sensors: &[Sensors], shots: &Shots) -> Vec<[f32; 4]> {
    let (obs, places) = (&plan.observation, places(plan));
    if places.is_empty() {
        return Vec::new();
    }
    let mut out = vec![[0.0; 4]; shots.points.len() * places.len()];
    for (number, shot) in shots.shots.iter().enumerate() {
        let (member, frame) = (number / obs.frames.len(), number % obs.frames.len());
        let first = shot.point_start as usize;
        for (i, &p) in shots.point_order[first..][..shot.point_count as usize].iter().enumerate() {
            let seen = &obs.frames[frame].points[p as usize];
            sensors[member].point_slopes(
                &obs.cameras[seen.camera as usize],
                seen,
                |_| true,
                |at, by| {
                    if let Some(k) = places.iter().position(|p| *p as usize == at) {
                        let slot = &mut out[(first + i) * places.len() + k];
                        for (s, v) in slot.iter_mut().zip(by.to_array()) {
                            *s += v as f32;
                        }
                    }
                },
            );
        }
    }
    out
}
