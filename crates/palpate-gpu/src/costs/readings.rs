//! Effects on the measurement: the clock's shift, markers' offsets, and, for depth readings, true points and cameras of every member with
//! the points' derivatives, computed in double precision when a batch is set. Without the latter all members share the recording's points.
//! Fronts are looked for along lines of sight as the recording has them (`shared/front.wgsl`), which effects do not move.

use super::shots::{Shots, Take, split};
use crate::device::{Arena, GpuError, Maker};
use palpate_engine::Direction;
use palpate_model::effects::sensors::Sensors;
use palpate_model::effects::{Site, Unstated};
use palpate_model::observation::{Camera, Observation, ObservedPoint};
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
    (0..most_sites(plan) as u32).flat_map(of).collect()
}

/// Most markers and tracked points of a recording.
pub(super) fn most_sites(plan: &Plan) -> usize {
    (0..plan.recordings()).map(|r| plan.recording(r).observation.markers.len()).max().unwrap_or(0)
}

/// Components of directions by what the measurement depends on beside the states, for so many members, as `shared/directions.wgsl` says.
pub(super) fn components(plan: &Plan, members: usize, directions: &[Direction]) -> Vec<f32> {
    let (shifts, offsets, readings) = (shifts(plan), offset_places(plan), places(plan));
    let of_offsets = if offsets.is_empty() { 0 } else { 3 * most_sites(plan) };
    let one = |d: Direction| {
        let mut all = vec![0.0; of_offsets];
        offsets.iter().for_each(|[number, place]| all[*number as usize] = d.component(*place as usize) as f32);
        let later = shifts.iter().map(|p| d.component(*p)).sum::<f64>() as f32;
        [vec![later], all, readings.iter().map(|p| d.component(*p as usize) as f32).collect()].concat()
    };
    (0..members).flat_map(|b| directions.iter().map(move |d| d.of(b))).flat_map(one).collect()
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

/// What shots are made of, for members with these takes: one of every recording where readings are exact, else every member's own.
pub(super) fn distinct(plan: &Plan, members: Vec<Take>) -> Vec<Take> {
    if places(plan).is_empty() { (0..plan.recordings()).map(|r| (r, Sensors::default())).collect() } else { members }
}

/// Uploads what depends on the sensors; `shots` are those of the takes.
///
/// # Errors
/// More than the device has.
pub(super) fn upload<M: Maker>(
    gpu: &M,
    plan: &Plan,
    takes: &[Take],
    shots: &Shots,
    buffers: &mut HashMap<&'static str, M::Buffer>,
) -> Result<(), GpuError> {
    let cameras = takes.iter().flat_map(|(r, s)| s.cameras(&plan.recording(*r).observation.cameras));
    // The fourth number says whether there are lines of sight.
    let place = |c: Camera| {
        let [x, y, z, _] = split(c.center().unwrap_or(plan.body.center) - plan.body.center)[0];
        [x, y, z, f32::from(u8::from(c.center().is_some()))]
    };
    let cameras: Vec<[f32; 4]> = cameras.map(place).collect();
    let mut tables = Arena::new("shots_tables");
    tables.put("cameras", &cameras);
    tables.put("shots", &shots.shots);
    tables.put("points", &shots.points);
    tables.put("cube_starts", &shots.cube_starts);
    tables.put("reading_slopes", &slopes(plan, takes, shots));
    tables.put("recorded_lines", &recorded_lines(plan, takes, shots));
    tables.upload(gpu, buffers)
}

/// Calls `visit` with every point of the takes in the device's order, with its take and recording.
fn each_point(plan: &Plan, takes: &[Take], shots: &Shots, mut visit: impl FnMut(&Take, &Observation, &ObservedPoint)) {
    for (take, first) in takes.iter().zip(&shots.firsts) {
        let recording = plan.recording(take.0).observation;
        for (frame, shot) in recording.frames.iter().zip(&shots.shots[*first as usize..]) {
            let order = &shots.point_order[shot.point_start as usize..][..shot.point_count as usize];
            order.iter().for_each(|&p| visit(take, &recording, &frame.points[p as usize]));
        }
    }
}

/// Directions from cameras to points as the recordings have them, in the device's order; none where no reading is moved.
fn recorded_lines(plan: &Plan, takes: &[Take], shots: &Shots) -> Vec<[f32; 4]> {
    let mut out = Vec::new();
    if !places(plan).is_empty() {
        each_point(plan, takes, shots, |_, recording, seen| {
            out.push(split(recording.cameras[seen.camera as usize].line(seen.position))[0]);
        });
    }
    out
}

/// ∂(true point)/∂θ of every point in the device's order, `[points][K]`.
fn slopes(plan: &Plan, takes: &[Take], shots: &Shots) -> Vec<[f32; 4]> {
    let (mut out, places) = (Vec::new(), places(plan));
    if places.is_empty() {
        return out;
    }
    each_point(plan, takes, shots, |(_, sensors), recording, seen| {
        let first = out.len();
        out.resize(first + places.len(), [0.0; 4]);
        sensors.point_slopes(
            &recording.cameras[seen.camera as usize],
            seen,
            |_| true,
            |at, by| {
                if let Some(k) = places.iter().position(|p| *p as usize == at) {
                    for (s, v) in out[first + k].iter_mut().zip(by.to_array()) {
                        *s += v as f32;
                    }
                }
            },
        );
    });
    out
}
