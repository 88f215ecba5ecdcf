//! What is read of every member at the end.

use super::sums::Sums;
use super::{Tangent, World};
use crate::device::Maker as _;
use crate::device::pipelines::shared::efforts::LOGGED;
use crate::device::recorder::Buffers;
use crate::layout::Health;
use palpate_engine::{Direction, Request};

/// Everything to be read of every member.
#[derive(Debug)]
pub struct Tally {
    pub(crate) directions: Vec<usize>,
    /// health `[B]`, what solves took, derivatives by what observations depend on `[B, P]`, what observations add, and the sums of an adjoint.
    pub(crate) buffers: Buffers,
    /// What an adjoint sums up; `None` where no gradient is wanted.
    pub(crate) sums: Option<Sums>,
    /// The buffers are those along the direction of a product.
    pointed: bool,
}

/// What a tally of B members, P parameters and so many stages holds beside observations and the sums of an adjoint, in bytes.
pub(crate) fn tally_sizes(b: u64, p: u64, stages: u64) -> [(&'static str, u64); 3] {
    [("health", b * size_of::<Health>() as u64), ("gradient", 4 * b * p), ("efforts", 4 * stages * u64::from(LOGGED))]
}

impl Tally {
    pub(crate) fn new(world: &World, request: &Request) -> Tally {
        let (b, p) = (world.members() as u64, world.plan.layout.len() as u64);
        let geometry = &world.geometry;
        let sums = Sums::new(&world.plan, &geometry.effects, &request.gradient);
        let of_sums = sums.as_ref().map_or_else(Vec::new, |s| s.sizes(&geometry.shape, &geometry.effects, b));
        let mut buffers = Buffers::new();
        for (name, bytes) in tally_sizes(b, p, geometry.shape.steps.into()).into_iter().chain(of_sums) {
            let buffer = world.gpu.buffer(name, bytes).unwrap_or_else(|e| {
                world.gpu.keep(e);
                world.gpu.small()
            });
            buffers.insert(name, buffer);
        }
        let directions = &request.sensitivities;
        world.observer.extend_tally(&world.gpu, &world.batch.directions(directions), &mut buffers);
        Tally { directions: directions.clone(), buffers, sums, pointed: false }
    }

    /// Makes it ready for a product along the only direction of a tangent.
    pub(crate) fn point(&mut self, world: &World, tangent: &Tangent) {
        if !self.pointed {
            let directions: Vec<Direction> = tangent.rates.iter().map(|r| r.direction.clone()).collect();
            world.observer.point(&world.gpu, &directions, &mut self.buffers);
            self.pointed = true;
        }
    }

    pub(crate) fn get(&self, name: &'static str) -> &wgpu::Buffer {
        &self.buffers[name]
    }

    /// All buffers, for passes.
    pub(crate) fn named(&self) -> Vec<(&'static str, &wgpu::Buffer)> {
        self.buffers.iter().map(|(name, buffer)| (*name, buffer)).collect()
    }
}
