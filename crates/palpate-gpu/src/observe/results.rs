//! What observations found, back on the host: sums over frames in double precision, and residuals for reports.

use super::readings::shifts;
use super::shots::row_count;
use super::{FOUND, Observer, VECTOR, look};
use crate::device::GpuError;
use crate::device::Maker as _;
use crate::device::pipelines::shared::structs::NONE;
use crate::device::recorder::Buffers;
use crate::layout::{Found, Health};
use crate::world::World;
use glam::DVec3;
use palpate_engine::{Curvature, Evaluation, FrameResiduals, Misfit, ReadingResidual, ResidualRow, Rows, Source};
use palpate_model::observation::{ReadingKind, Sensor, kernel};

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

    /// Adds to evaluations (one a member) what [`Observer::results`] held.
    pub(crate) fn add_to(&self, results: &[Vec<u8>], directions: usize, all: &mut [Evaluation]) {
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
                let mut own = curvature[m * each..(m + 1) * each].iter().map(|x| f64::from(*x));
                e.curvature = Some(Curvature { gradient: own.by_ref().take(q).collect(), matrix: own.collect() });
            }
        }
    }
}

/// Residuals of the frames of step k of one member, `ends` the states before and after it.
///
/// # Errors
/// Whatever went wrong on the device.
pub(crate) fn residuals(
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
        if at.member as usize != member {
            continue;
        }
        world.record(|r| look(r, &own, &o.sight, round));
        let frame = at.frame as usize;
        let shot = &o.shots.shots[at.shot as usize];
        let obs = &world.plan.observation;
        let f = &obs.frames[frame];
        let points = shot.point_count as usize;
        let sizes = [("found", FOUND as usize * points), ("rows", 8 * row_count(&world.plan, f))];
        let all_found = gpu.download_all(&sizes.map(|(name, bytes)| (&o.buffers[name], bytes)))?;
        let found: Vec<Found> = bytemuck::pod_collect_to_vec(&all_found[0]);
        let rows: Vec<[f32; 2]> = bytemuck::pod_collect_to_vec(&all_found[1]);
        let offset = |place: usize| {
            let r = &rows[points + 3 * place..][..3];
            Some(Misfit::Offset(DVec3::new(r[0][0].into(), r[1][0].into(), r[2][0].into())))
        };
        let mut readings: Vec<ReadingResidual> = Vec::with_capacity(obs.frames[frame].residuals());
        for (p, (&place, seen)) in
            places(&o.shots.point_order[shot.point_start as usize..][..points]).iter().zip(&f.points).enumerate()
        {
            let distance = || Misfit::Distance(f64::from(found[place].phi));
            let misfit = (found[place].cell != NONE).then(distance);
            readings.push(ReadingResidual { sensor: Sensor::Camera(seen.camera), item: p as u32, place: seen.position, misfit });
        }
        let markers = f.markers.len();
        let order = places(&o.shots.mark_order[shot.marker_start as usize..][..markers]);
        for (&place, m) in order.iter().zip(&f.markers) {
            let sensor = obs.sensor_of(m.site);
            readings.push(ReadingResidual { sensor, item: m.site, place: m.position, misfit: offset(place) });
        }
        for d in &f.displacements {
            let place = world.plan.body.nodes[d.node as usize] + d.value;
            let misfit = offset(markers + d.node as usize);
            readings.push(ReadingResidual { sensor: Sensor::Nodes, item: d.node, place, misfit });
        }
        let out = FrameResiduals { frame, readings };
        all.push(out);
    }
    Ok(all)
}

/// Where each thing stands in the device's order, which lists the things.
fn places(order: &[u32]) -> Vec<usize> {
    let mut all = vec![0; order.len()];
    order.iter().enumerate().for_each(|(place, &thing)| all[thing as usize] = place);
    all
}

/// Every residual of the frames of step k of one member with its derivatives along the tangents; `tally` was made for as many.
///
/// # Errors
/// Whatever went wrong on the device.
pub(crate) fn rows(
    world: &World,
    k: usize,
    ends: [&wgpu::Buffer; 2],
    tangents: &[[&wgpu::Buffer; 2]],
    tally: &Buffers,
    member: usize,
) -> Result<Rows, GpuError> {
    let (o, gpu, q) = (&world.observer, &world.gpu, tangents.len());
    let (body, obs) = (&*world.plan.body, &*world.plan.observation);
    let mut out = Rows::default();
    for round in o.rounds(k).flat_map(|round| round.parts(1)) {
        let at = o.agenda.looks[round.first];
        if at.member as usize != member {
            continue;
        }
        world.record(|r| {
            o.differentiate(r, round, ends, tangents, tally);
        });
        let frame = at.frame as usize;
        let (f, shot) = (&obs.frames[frame], &o.shots.shots[at.shot as usize]);
        let (points, most) = (f.points.len(), o.sight.rows as usize);
        let all_found = gpu.download_all(&[
            (&o.buffers["found"], FOUND as usize * points),
            (&o.buffers["rows"], 8 * row_count(&world.plan, f)),
            (&tally["slopes"], 4 * q * most),
        ])?;
        let found: Vec<Found> = bytemuck::pod_collect_to_vec(&all_found[0]);
        let values: Vec<[f32; 2]> = bytemuck::pod_collect_to_vec(&all_found[1]);
        let slopes: Vec<f32> = bytemuck::pod_collect_to_vec(&all_found[2]);
        let mut add = |row: ResidualRow, place: usize| {
            out.residuals.push(row);
            out.sensitivity.extend((0..q).map(|q| f64::from(slopes[q * most + place])));
        };
        // The device has points and markers in an order of its own.
        let place_of = places(&o.shots.point_order[shot.point_start as usize..][..points]);
        for (p, (&place, seen)) in place_of.iter().zip(&f.points).enumerate() {
            let Found { xi, phi, gradient, cell } = found[place];
            let source = Source::point(p as u32, seen.camera);
            let (noise, value) = (obs.noise(ReadingKind::Depth), f64::from(phi));
            let (rest, by_place) = (seen.position, DVec3::ZERO);
            let bare = ResidualRow { frame, source, value: None, noise, weight: 0.0, rest, along_sight: 0.0, by_place };
            let row = body.band.cells.get(cell as usize).map_or(bare, |cell| {
                let truth = o.sensors[member].truth(&obs.cameras[seen.camera as usize], seen);
                let sight = DVec3::from_array(truth.ray()).normalize_or_zero();
                let gradient = DVec3::from_array(gradient.map(f64::from));
                ResidualRow {
                    value: Some(value),
                    weight: kernel::weight(value, world.plan.band),
                    rest: body.grid.position(cell.lattice) + body.grid.h * DVec3::from_array(xi.map(f64::from)),
                    along_sight: gradient.dot(sight),
                    by_place: gradient,
                    ..bare
                }
            });
            add(row, place);
        }
        let mut vector = |sensor: Sensor, item: u32, rest: DVec3, place: usize| {
            for axis in 0..3u8 {
                let place = points + 3 * place + usize::from(axis);
                let source = Source { sensor, item, axis };
                add(ResidualRow::coordinate(frame, source, values[place][0].into(), obs.noise(sensor.kind()), rest), place);
            }
        };
        let markers = f.markers.len();
        let order = places(&o.shots.mark_order[shot.marker_start as usize..][..markers]);
        for (&place, m) in order.iter().zip(&f.markers) {
            let rest = obs.markers[m.site as usize].carry(|i| body.nodes[i]).0;
            vector(obs.sensor_of(m.site), m.site, rest, place);
        }
        for d in &f.displacements {
            vector(Sensor::Nodes, d.node, body.nodes[d.node as usize], markers + d.node as usize);
        }
    }
    Ok(out)
}
