//! A whole step, traced.

use crate::backend::GpuBackend;
use crate::device::GpuError;
use crate::device::trace::Trace;
use crate::world::Tuning;
use crate::{Gpu, State};
use palpate_engine::{Backend as _, ParamBatch, Request, Wanted};
use palpate_model::plan::Plan;
use std::sync::Arc;

/// The start and one step of a plan, its observation, and the adjoint of both.
#[derive(Debug)]
pub struct TracedStep {
    /// What was handed to the device.
    pub trace: Trace,
    /// Buffers that hold results: the `state` after the step as `[3][nodes]` vectors of four (u = first + second part, v), the `adjoint` of the
    /// state before it, and sums of the gradient.
    pub results: Vec<(&'static str, usize)>,
}

/// Traces the first step of a plan.
///
/// # Errors
/// The device cannot compute it.
pub fn trace_step(gpu: &Arc<Gpu>, plan: &Plan, tuning: Tuning) -> Result<TracedStep, GpuError> {
    let refused = |e: palpate_engine::BuildError| GpuError::Refused { message: e.message };
    let backend = GpuBackend::on(gpu.clone()).tuned(tuning);
    let mut world = backend.build(plan, 1).map_err(refused)?;
    backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let mut tally = backend.new_tally(&world, &Request { gradient: Wanted::All, ..Request::default() });
    let [mut now, mut next]: [State; 2] = [0; 2].map(|_| backend.new_state(&world));
    let [mut adj, mut adj_now] = [0; 2].map(|_| backend.new_adjoint(&world));
    let stage = &plan.clock.stages()[0];
    gpu.trace();
    backend.start(&mut world, &mut now, &mut tally);
    backend.step(&mut world, stage, &[&now], &mut next, &mut tally);
    backend.observe(&world, 0, &now, &next, &mut tally);
    backend.observe_adjoint(&world, 0, &now, &next, &mut adj, &mut adj_now, &mut tally);
    backend.step_adjoint(&mut world, stage, &[&now], &next, &adj, std::slice::from_mut(&mut adj_now), &mut tally);
    backend.start_adjoint(&mut world, &now, &adj_now, &mut tally);
    let results = [("state", &next.0.buffer), ("adjoint", &adj_now.0.buffer)];
    let sums = tally.buffers.iter().filter(|(name, _)| name.ends_with("sums") || name.ends_with("pulls"));
    let named = results.into_iter().chain(sums.map(|(name, buffer)| (*name, buffer)));
    let results = named.filter_map(|(name, buffer)| Some((name, gpu.traced(buffer)?))).collect();
    let trace = gpu.take_trace().unwrap_or_default();
    gpu.take_trouble().map_or(Ok(TracedStep { trace, results }), Err)
}
