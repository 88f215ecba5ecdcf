//! The calls of [`Backend`](palpate_engine::Backend) that wait for the device, for whoever may not wait: a page in a browser awaits them between
//! the others, which only put work on the device's list. `Backend` itself drives these.

use crate::device::GpuError;
use crate::world::{State, Tally, Tangent, World};
use crate::{GpuBackend, costs, read, solve};
use glam::DVec3;
use palpate_engine::{BuildError, Evaluation, FrameResiduals, Rows};
use palpate_model::plan::Plan;

impl GpuBackend {
    /// As [`Backend::build`](palpate_engine::Backend::build), but nothing is measured, which takes waiting: ways to solve are those that are stated,
    /// or that the host remembers, or the plain ones.
    ///
    /// # Errors
    /// As there.
    pub async fn build_async(&self, plan: &Plan, members: usize) -> Result<World, BuildError> {
        self.made(plan, members).await.map_err(|e| self.not_built(&e))
    }

    async fn made(&self, plan: &Plan, members: usize) -> Result<World, GpuError> {
        self.check_shape(plan)?;
        let world = self.dressed(solve::world_async(self.gpu.clone(), plan, members, self.ways()?).await?);
        self.gpu.trouble().await.map_or(Ok(world), Err)
    }

    /// As [`Backend::keep_pace`](palpate_engine::Backend::keep_pace).
    pub async fn keep_pace_async(&self, world: &mut World) {
        world.keep_pace_async().await;
    }

    /// As [`Backend::read`](palpate_engine::Backend::read).
    pub async fn read_async(&self, world: &World, tally: &Tally) -> Vec<Evaluation> {
        read::tally(world, tally).await
    }

    /// As [`Backend::read_state`](palpate_engine::Backend::read_state).
    ///
    /// # Errors
    /// Whatever went wrong on the device since the last read.
    pub async fn read_state_async(
        &self,
        world: &World,
        state: &State,
        member: usize,
    ) -> Result<(Vec<DVec3>, Vec<DVec3>), GpuError> {
        read::state(world, state, member).await
    }

    /// As [`Backend::residuals`](palpate_engine::Backend::residuals), `ends` the states before and after the step.
    ///
    /// # Errors
    /// As [`GpuBackend::read_state_async`].
    pub async fn residuals_async(
        &self,
        world: &World,
        k: usize,
        ends: [&State; 2],
        member: usize,
    ) -> Result<Vec<FrameResiduals>, GpuError> {
        costs::residuals(world, k, ends.map(|s| &s.0.buffer), member).await
    }

    /// As [`Backend::rows`](palpate_engine::Backend::rows).
    ///
    /// # Errors
    /// As [`GpuBackend::read_state_async`].
    pub async fn rows_async(
        &self,
        world: &World,
        k: usize,
        ends: [&State; 2],
        tangents: [&Tangent; 2],
        tally: &Tally,
        member: usize,
    ) -> Result<Rows, GpuError> {
        let pairs = tangents[0].parts.iter().zip(&tangents[1].parts);
        let tangents: Vec<_> = pairs.map(|(a, b)| [&a.buffer, &b.buffer]).collect();
        costs::rows(world, k, ends.map(|s| &s.0.buffer), &tangents, &tally.buffers, member).await
    }
}
