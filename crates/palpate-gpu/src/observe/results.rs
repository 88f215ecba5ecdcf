//! What observations found, back on the host: sums over frames in double precision, and residuals for reports.

use super::{FOUND, Observer, look};
use crate::device::Gpu;
use crate::error::GpuError;
use crate::layout::Health;
use crate::memory::Maker as _;
use crate::world::{Buffers, World};
use glam::DVec3;
use palpate_engine::{Curvature, Evaluation, FrameResiduals};
use palpate_model::params::ParamKey;

impl Observer {
    /// Adds to evaluations (one a member) what a tally holds of observations.
    ///
    /// # Errors
    /// Whatever went wrong on the device.
    pub(crate) fn add_to(&self, gpu: &Gpu, tally: &Buffers, directions: usize, all: &mut [Evaluation]) -> Result<(), GpuError> {
        let (frames, q) = (self.sight.frames as usize, directions);
        if frames == 0 {
            return Ok(());
        }
        let start = self.plan.layout.index(ParamKey::TimeStart);
        let sums: Vec<[f32; 4]> = gpu.download(&tally["frame_sums"], all.len() * frames)?;
        let later: Vec<[f32; 4]> = gpu.download(&tally["start_sums"], all.len() * frames)?;
        let each = q + q * q;
        let curvature: Vec<f32> = if q > 0 { gpu.download(&tally["curvature"], all.len() * each)? } else { Vec::new() };
        for (m, e) in all.iter_mut().enumerate() {
            for [cost, matched, squares, signed] in &sums[m * frames..(m + 1) * frames] {
                e.cost += f64::from(*cost);
                e.matched += *matched as usize;
                e.sum_squares += f64::from(*squares);
                e.sum_signed += f64::from(*signed);
            }
            if let Some(g) = e.gradient.get_mut(start) {
                *g += later[m * frames..(m + 1) * frames].iter().map(|s| f64::from(s[0])).sum::<f64>();
            }
            if q > 0 {
                let mut own = curvature[m * each..(m + 1) * each].iter().map(|x| f64::from(*x));
                e.curvature = Some(Curvature { gradient: own.by_ref().take(q).collect(), matrix: own.collect() });
            }
        }
        Ok(())
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
        let shot = &o.shots.shots[frame];
        let (points, markers) = (shot.point_count as usize, shot.marker_count as usize);
        let found: Vec<[f32; FOUND as usize / 4]> = gpu.download(&o.buffers["found"], points)?;
        let rows: Vec<[f32; 2]> = gpu.download(&o.buffers["rows"], points + 3 * markers)?;
        let mut out = FrameResiduals { frame, points: vec![None; points], markers: vec![DVec3::ZERO; markers] };
        let order = &o.shots.point_order[shot.point_start as usize..][..points];
        for (f, &p) in found.iter().zip(order) {
            out.points[p as usize] = (f[7].to_bits() != u32::MAX).then(|| f64::from(f[3]));
        }
        for (r, &m) in rows[points..].chunks_exact(3).zip(&o.shots.mark_order[shot.marker_start as usize..]) {
            out.markers[m as usize] = DVec3::new(r[0][0].into(), r[1][0].into(), r[2][0].into());
        }
        all.push(out);
    }
    Ok(all)
}
