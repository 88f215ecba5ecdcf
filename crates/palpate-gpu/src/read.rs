//! What comes back to the host: states, and the tally as evaluations.

use crate::device::GpuError;
use crate::device::pipelines::shared::structs as code;
use crate::layout::Health;
use crate::world::{Found, State, Tally, World};
use glam::DVec3;
use palpate_engine::{Curvature, Evaluation, Failure, FailureKind, number};

/// u [m] and v [m/s] of one member, `[N]` each.
pub(crate) async fn state(world: &World, state: &State, member: usize) -> Result<(Vec<DVec3>, Vec<DVec3>), GpuError> {
    let n = world.geometry.shape.nodes as usize;
    let all = world.members() * n;
    let v: Vec<[f32; 4]> = world.gpu.items_of(&state.0.buffer, 3 * all).await?;
    let wide = |v: &[f32; 4]| DVec3::new(v[0].into(), v[1].into(), v[2].into());
    let of = |part: usize| v[part * all + member * n..part * all + (member + 1) * n].iter().map(wide);
    Ok((of(0).zip(of(1)).map(|(a, b)| a + b).collect(), of(2).collect()))
}

/// The failure behind a health code of `shared/structs.wgsl`.
fn failure(world: &World, member: usize, h: &Health) -> Option<Failure> {
    if let Some(failure) = world.batch.refusal(member) {
        return Some(failure);
    }
    let p = &world.batch.physics[member];
    let [a, b] = h.detail;
    let (kind, what) = match h.code {
        code::WELL | code::RESTING => return None,
        code::NOT_FINITE => (FailureKind::NotFinite, "displacement, velocity or residual of a node".to_string()),
        code::STALLED => (
            FailureKind::NewtonStalled,
            format!(
                "{b} iterations left a scaled residual of {a:.1e} of the forces (--backend cpu may get further with a crushed body)"
            ),
        ),
        code::UNSOLVED => {
            (FailureKind::LinearSolve, format!("{b} conjugate gradient iterations left a relative residual of {a:.1e}"))
        }
        code::INDEFINITE => (FailureKind::LinearSolve, "the matrix is not positive definite".to_string()),
        code::FELL_OUT => (FailureKind::FellOut, format!("a node moved {} m", number(a.into()))),
        code::BAD_PARAMETER => (
            FailureKind::BadParameter,
            format!(
                "material.youngs_modulus = {}, material.poisson_ratio = {}, material.density = {}",
                number(p.youngs_modulus),
                number(p.poisson_ratio),
                number(p.density)
            ),
        ),
        code::HURRIED => {
            // Nobody sees it: the rollout is computed again.
            world.effort.fell_short();
            (FailureKind::NewtonStalled, "more iterations are needed than were planned".to_string())
        }
        code::STRANDED => (
            FailureKind::LinearSolve,
            "workgroups that had to run at the same time did not (PALPATE_GPU_CG = many needs none)".to_string(),
        ),
        _ => (FailureKind::NoEquilibrium, "no clamp holds the body".to_string()),
    };
    // A start that does not converge has no equilibrium.
    let kind = match kind {
        FailureKind::NewtonStalled | FailureKind::LinearSolve if h.step == 0 => FailureKind::NoEquilibrium,
        kind => kind,
    };
    let stages = world.plan.clock.stages();
    let time = (h.step as usize).checked_sub(1).and_then(|k| stages.get(k)).map_or(0.0, |s| s.time);
    Some(Failure::new(kind, time, what).in_plan(&world.plan, &world.batch.theta[member]))
}

/// Costs, gradients and health of every member.
pub(crate) async fn tally(world: &World, tally: &Tally) -> Vec<Evaluation> {
    try_tally(world, tally).await.unwrap_or_else(|e| failed(world, &e))
}

/// What is said of every member of a world whose device failed.
pub(crate) fn failed(world: &World, e: &GpuError) -> Vec<Evaluation> {
    let failure = Failure::of_device(e.to_string(), e.hint_for(world.alone));
    vec![Evaluation::failed(failure); world.members()]
}

async fn try_tally(world: &World, tally: &Tally) -> Result<Vec<Evaluation>, GpuError> {
    let (b, p, q) = (world.members(), world.plan.layout.len(), tally.directions.len());
    let efforts = tally.get("efforts");
    let own =
        [(tally.get("health"), b * size_of::<Health>()), (tally.get("gradient"), 4 * b * p), (efforts, efforts.size() as usize)];
    let observed = world.observer.results(&tally.buffers, b, q);
    let summed = summed(world, tally);
    let parts: Vec<_> = summed.iter().map(|(_, buffer, bytes)| (*buffer, *bytes)).collect();
    let found = world.gpu.contents_of(&[&own[..], &observed, &parts].concat()).await?;
    let (own, rest) = found.split_at(own.len());
    let (observed, sums) = rest.split_at(observed.len());
    let sums: Found = summed.iter().zip(sums).map(|(s, bytes)| (s.0, bytemuck::pod_collect_to_vec(bytes))).collect();
    let health: Vec<Health> = bytemuck::pod_collect_to_vec(&own[0]);
    let gradient: Vec<f32> = bytemuck::pod_collect_to_vec(&own[1]);
    let mut all: Vec<Evaluation> = (0..b)
        .map(|m| {
            let failure = failure(world, m, &health[m]);
            Evaluation {
                cost: if failure.is_some() { f64::INFINITY } else { 0.0 },
                gradient: gradient[m * p..(m + 1) * p].iter().map(|g| f64::from(*g)).collect(),
                curvature: (q > 0).then(|| {
                    let q = world.batch.count(m, q);
                    Curvature { gradient: vec![0.0; q], matrix: vec![0.0; q * q] }
                }),
                residuals: world.batch.views[m].residuals(),
                failure,
                ..Evaluation::default()
            }
        })
        .collect();
    world.effort.learn(&bytemuck::pod_collect_to_vec::<u8, u32>(&own[2]));
    world.observer.add_to(observed, q, |m| world.batch.count(m, q), &mut all);
    if let Some(own) = &tally.sums {
        for (m, e) in all.iter_mut().enumerate().filter(|(_, e)| e.failure.is_none()) {
            match own.gradient(world, m, &sums) {
                Ok(by) => e.gradient.iter_mut().zip(by).for_each(|(g, b)| *g += b),
                Err(failure) => (e.cost, e.failure) = (f64::INFINITY, Some(failure)),
            }
        }
    }
    Ok(all)
}

/// What an adjoint summed up: names, buffers and bytes that count.
fn summed<'a>(world: &World, tally: &'a Tally) -> Vec<(&'static str, &'a wgpu::Buffer, usize)> {
    let geometry = &world.geometry;
    let sizes = tally.sums.as_ref().map(|s| s.sizes(&geometry.shape, &geometry.effects, world.members() as u64));
    sizes.unwrap_or_default().into_iter().map(|(name, bytes)| (name, tally.get(name), bytes as usize)).collect()
}
