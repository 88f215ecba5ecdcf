//! What observations found, back on the host: sums over frames in double precision, and residuals for reports.

use super::readings::shifts;
use super::shots::{Shots, row_count};
use super::{COSTS, FOUND, Observer, VECTOR, look};
use crate::device::GpuError;
use crate::device::Maker as _;
use crate::device::recorder::Buffers;
use crate::layout::{Found, Health, Look, Shot};
use crate::world::World;
use glam::DVec3;
use palpate_engine::{Curvature, Evaluation, FrameResiduals, Misfit, ReadingResidual, ResidualRow, Rows, Source};
use palpate_model::effects::sensors::Sensors;
use palpate_model::observation::{Frame, Observation, Sensor};
use palpate_model::plan::Plan;

impl Observer {
    /// What a tally of `members` holds of observations along `directions` directions: buffers, and their bytes.
    pub(crate) fn results<'a>(&self, tally: &'a Buffers, members: usize, directions: usize) -> Vec<(&'a wgpu::Buffer, usize)> {
        let (looks, q) = (members * self.sight.frames as usize, directions);
        if looks == 0 {
            return Vec::new();
        }
        let mut all = vec![(&tally["frame_sums"], VECTOR as usize * looks), (&tally["start_sums"], VECTOR as usize * looks)];
        if q > 0 {
            all.push((&tally["curvature"], 4 * members * (q + q * q)));
        }
        all
    }

    /// Adds to evaluations (one a member) what [`Observer::results`] held; members take these `counts` of the directions.
    pub(crate) fn add_to(&self, results: &[Vec<u8>], directions: usize, counts: impl Fn(usize) -> usize, all: &mut [Evaluation]) {
        let (frames, q) = (self.sight.frames as usize, directions);
        let [sums, later, curvature @ ..] = results else { return };
        let [sums, later] = [sums, later].map(|bytes| -> Vec<[f32; 4]> { bytemuck::pod_collect_to_vec(bytes) });
        let each = q + q * q;
        let curvature: Vec<f32> = curvature.iter().flat_map(|bytes| bytemuck::pod_collect_to_vec(bytes)).collect();
        for (m, e) in all.iter_mut().enumerate() {
            for [cost, matched, squares, signed] in &sums[m * frames..(m + 1) * frames] {
                e.cost += f64::from(*cost);
                e.matched += *matched as usize;
                e.sum_squares += f64::from(*squares);
                e.sum_signed += f64::from(*signed);
            }
            for place in shifts(&self.plan) {
                e.gradient[place] += later[m * frames..(m + 1) * frames].iter().map(|s| f64::from(s[0])).sum::<f64>();
            }
            if q > 0 {
                let own: Vec<f64> = curvature[m * each..(m + 1) * each].iter().map(|x| f64::from(*x)).collect();
                let (gradient, matrix) = own.split_at(q);
                let n = counts(m);
                let matrix = matrix.chunks(q).take(n).flat_map(|row| &row[..n]).copied().collect();
                e.curvature = Some(Curvature { gradient: gradient[..n].to_vec(), matrix });
            }
        }
    }
}

/// A frame as one member saw it, back on the host.
pub(super) struct Downloaded<'a> {
    pub(super) plan: &'a Plan,
    pub(super) observation: &'a Observation,
    pub(super) sensors: &'a Sensors,
    /// Number of the frame.
    pub(super) frame: usize,
    pub(super) shot: &'a Shot,
    pub(super) shots: &'a Shots,
    /// Matches of its points, in the device's order.
    pub(super) found: Vec<Found>,
    /// Its scalar residuals [m] and their weights, in the device's order.
    values: Vec<[f32; 2]>,
}

impl<'a> Downloaded<'a> {
    /// Waits for what a look found, and for some more bytes.
    async fn new(
        world: &'a World,
        at: Look,
        more: &[(&wgpu::Buffer, usize)],
    ) -> Result<(Downloaded<'a>, Vec<Vec<u8>>), GpuError> {
        let o = &world.observer;
        let (frame, shot) = (at.frame as usize, &o.shots.shots[at.shot as usize]);
        let observation = o.views[at.member as usize].observation();
        let rows = row_count(&world.plan, &observation.frames[frame]);
        let own = [("found", FOUND as usize * shot.point_count as usize), ("rows", 8 * rows)];
        let wanted: Vec<_> = own.iter().map(|(name, bytes)| (&o.buffers[name], *bytes)).chain(more.iter().copied()).collect();
        let mut all = world.gpu.contents_of(&wanted).await?;
        let more = all.split_off(2);
        let found = bytemuck::pod_collect_to_vec(&all[0]);
        let values = bytemuck::pod_collect_to_vec(&all[1]);
        let sensors = &o.sensors[at.member as usize];
        Ok((Downloaded { plan: &world.plan, observation, sensors, frame, shot, shots: &o.shots, found, values }, more))
    }

    /// What was seen.
    pub(super) fn seen(&self) -> &'a Frame {
        &self.observation.frames[self.frame]
    }

    /// Place of a coordinate among the rows; `vector` counts markers, then nodes.
    fn row(&self, vector: usize, axis: usize) -> usize {
        self.shot.point_count as usize + 3 * vector + axis
    }

    /// A reading of three coordinates.
    pub(super) fn reading(&self, sensor: Sensor, item: u32, place: DVec3, vector: usize) -> ReadingResidual {
        let off = DVec3::from_array([0, 1, 2].map(|a| self.values[self.row(vector, a)][0].into()));
        ReadingResidual { sensor, item, place, misfit: Some(Misfit::Offset(off)) }
    }

    /// Its scalar residuals, with their places among the rows.
    pub(super) fn coordinates(&self, sensor: Sensor, item: u32, rest: DVec3, vector: usize) -> [(ResidualRow, usize); 3] {
        let noise = self.observation.noise_in(self.seen(), sensor.kind());
        [0u8, 1, 2].map(|axis| {
            let row = self.row(vector, axis.into());
            let value = self.values[row][0].into();
            (ResidualRow::coordinate(self.frame, Source { sensor, item, axis }, value, noise, rest), row)
        })
    }
}

/// Residuals of the frames of step k of one member, `ends` the states before and after it.
///
/// # Errors
/// Whatever went wrong on the device.
pub(crate) async fn residuals(
    world: &World,
    k: usize,
    ends: [&wgpu::Buffer; 2],
    member: usize,
) -> Result<Vec<FrameResiduals>, GpuError> {
    let (o, gpu) = (&world.observer, &world.gpu);
    let mut all = Vec::new();
    // Reports ask for members that are well.
    let health = gpu.buffer("health", (size_of::<Health>() * o.sight.members as usize) as u64)?;
    let tally = Buffers::from([("health", health)]);
    let own = o.named(&[("now", ends[0]), ("next", ends[1])], &tally);
    for round in o.rounds(k).flat_map(|round| round.parts(1)) {
        let at = o.agenda.looks[round.first];
        if at.member as usize == member {
            world.record(|r| look(r, &own, &o.sight, round));
            let (found, _) = Downloaded::new(world, at, &[]).await?;
            let readings = COSTS.iter().flat_map(|cost| cost.readings(&found)).collect();
            all.push(FrameResiduals { frame: found.frame, readings });
        }
    }
    Ok(all)
}

/// Where each thing stands in the device's order, which lists the things.
pub(super) fn places(order: &[u32]) -> Vec<usize> {
    let mut all = vec![0; order.len()];
    order.iter().enumerate().for_each(|(place, &thing)| all[thing as usize] = place);
    all
}

/// Every residual of the frames of step k of one member with its derivatives along the tangents; `tally` was made for as many.
///
/// # Errors
/// Whatever went wrong on the device.
pub(crate) async fn rows(
    world: &World,
    k: usize,
    ends: [&wgpu::Buffer; 2],
    tangents: &[[&wgpu::Buffer; 2]],
    tally: &Buffers,
    member: usize,
) -> Result<Rows, GpuError> {
    let (o, q) = (&world.observer, tangents.len());
    let most = o.sight.rows as usize;
    let mut out = Rows::default();
    for round in o.rounds(k).flat_map(|round| round.parts(1)) {
        let at = o.agenda.looks[round.first];
        if at.member as usize != member {
            continue;
        }
        world.record(|r| {
            o.differentiate(r, round, ends, tangents, tally);
        });
        let (found, slopes) = Downloaded::new(world, at, &[(&tally["slopes"], 4 * q * most)]).await?;
        let slopes: Vec<f32> = bytemuck::pod_collect_to_vec(&slopes[0]);
        for (row, place) in COSTS.iter().flat_map(|cost| cost.rows(&found)) {
            out.residuals.push(row);
            out.sensitivity.extend((0..q).map(|q| f64::from(slopes[q * most + place])));
        }
    }
    Ok(out)
}
