//! Asks a device which of two ways to solve is faster.

use super::choices::Choices;
use crate::device::pipelines::shared::solving;
use crate::device::{Gpu, GpuError};
use crate::layout::{Newton, Shape};
use crate::passes::{Passes, SOLVE};
use crate::world::{MANY, Product, State, Tally, Tuning, World};
use palpate_engine::{ParamBatch, Request};
use palpate_model::plan::Plan;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Bodies of fewer nodes are left to one workgroup.
const FEW: usize = 256;
/// What is not the plain way must be this much faster, so that chance does not decide between equals: which one runs decides the last
/// bits of a result.
const CLEARLY: f64 = 0.8;
/// Products that are timed.
const REPEATS: usize = 8;

/// Names of the choice between one and many workgroups.
const WORKGROUPS: [&str; 2] = ["one", "many"];

impl Tuning {
    /// With the choice between one and many workgroups made for a body of so many nodes, where a device is to be asked: for one member
    /// alone, because a member must get the same bits alone and in any batch.
    pub(crate) fn on_device(self, gpu: &Arc<Gpu>, plan: &Plan) -> Result<Tuning, GpuError> {
        let asked = self == Tuning::default() && !gpu.is_software() && (FEW..MANY).contains(&plan.body.nodes.len());
        if asked { Tuning::measured(gpu, plan, &Choices::of_user()) } else { Ok(self) }
    }

    /// The same, asked.
    pub(crate) fn measured(gpu: &Arc<Gpu>, plan: &Plan, choices: &Choices) -> Result<Tuning, GpuError> {
        static KNOWN: Known = Mutex::new(None);
        let ways = [usize::MAX, 0].map(|many_from| Tuning { many_from, product: None });
        let (nodes, cells, parameters) = (plan.body.nodes.len(), plan.body.cells().len(), plan.layout.len());
        let key = format!("{}: {nodes} nodes, {cells} cells, {parameters} parameters", device(gpu));
        let chosen = once(&key, WORKGROUPS, choices, &KNOWN, || {
            let iteration = |way| {
                let mut world = World::new(gpu.clone(), plan, 1, way)?;
                world.set_params(&ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
                world.cg_speed().map(|speed| speed.iteration.seconds)
            };
            Ok([iteration(ways[0])?, iteration(ways[1])?])
        })?;
        Ok(ways[chosen])
    }
}

/// A plan made ready on a device, with the ways to solve that are stated, or else faster.
///
/// # Errors
/// The plan needs something this backend lacks, or more than the device has.
pub(crate) fn world(gpu: Arc<Gpu>, plan: &Plan, members: usize, tuning: Tuning) -> Result<World, GpuError> {
    let tuning = tuning.on_device(&gpu, plan)?;
    let mut world = World::new(gpu, plan, members, tuning)?;
    if world.many && tuning.product.is_none() && !world.needs_matrix() {
        world.product = faster(&mut world, &Choices::of_user())?;
    }
    Ok(world)
}

/// Choices of this process.
type Known = Mutex<Option<HashMap<String, usize>>>;

/// Adapter and driver that a choice holds for.
fn device(gpu: &Gpu) -> String {
    format!("{} {}", gpu.name, gpu.driver).replace(char::is_control, " ")
}

/// What the choice of a product holds for: the device, nodes, cells, kinds of cells.
fn key(world: &World) -> String {
    let s = &world.geometry.shape;
    format!("{}: {} nodes, {} cells of {} kinds", device(&world.gpu), s.nodes, s.cells, s.classes)
}

/// Which of two ways is faster: measured once [s], so that a user gets the same bits twice.
fn once(
    key: &str,
    names: [&str; 2],
    choices: &Choices,
    known: &Known,
    measure: impl FnOnce() -> Result<[f64; 2], GpuError>,
) -> Result<usize, GpuError> {
    // Where nothing can be kept a process gives the same bits twice in any case.
    let mut known = known.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(k) = choices.get(key, names).or_else(|| known.as_ref()?.get(key).copied()) {
        return Ok(k);
    }
    let chosen = choices.keep(key, names, choose(measure()?));
    known.get_or_insert_default().insert(key.to_string(), chosen);
    Ok(chosen)
}

/// The faster product for a body on its device.
pub(crate) fn faster(world: &mut World, choices: &Choices) -> Result<Product, GpuError> {
    static KNOWN: Known = Mutex::new(None);
    let both = [Product::Matrix, Product::Free];
    let chosen = once(&key(world), both.map(Product::name), choices, &KNOWN, || {
        world.set_params(&ParamBatch::from_rows(std::slice::from_ref(&world.plan.theta.clone())));
        world.set_iterations(1);
        Ok([time(world, both[0])?, time(world, both[1])?])
    })?;
    Ok(both[chosen])
}

/// Which to take when the plain way and another one take so long [s].
fn choose([plain, other]: [f64; 2]) -> usize {
    usize::from(other < CLEARLY * plain)
}

/// Seconds of a product of every member with a matrix of zeros, which takes as long as any.
pub(crate) fn time(world: &World, product: Product) -> Result<f64, GpuError> {
    let tally = Tally::new(world, &Request::default());
    let blank = State(world.lend(3));
    let wanting = vec![Newton { stage: SOLVE, goal: -1.0, forcing: -1.0, ..Newton::default() }; world.members()];
    // Sums of solves that have just begun, with something left to do.
    let left = world.buffers["cg_sums"].size() as usize / size_of::<[f32; 4]>();
    let begun = begun_sums(&world.geometry.shape, left);
    world.gpu.queue.write_buffer(&world.buffers["newton"], 0, bytemuck::cast_slice(&wanting));
    let run = |repeats: usize| {
        let clock = Instant::now();
        world.gpu.queue.write_buffer(&world.buffers["cg_sums"], 0, bytemuck::cast_slice(&begun));
        world.record(|r| {
            let mut s = Passes::new(world, r, Some(0), &blank, &blank, &tally);
            s.list();
            for _ in 0..repeats {
                s.multiply(product, 0);
            }
        });
        world.gpu.download::<f32>(&world.buffers["cg_sums"], 1).map(|_| clock.elapsed().as_secs_f64())
    };
    // The first run compiles the kernels.
    run(1)?;
    // No clock tells less than a microsecond of such work.
    let seconds = (shortest(|| run(REPEATS))? - shortest(|| run(0))?).max(1e-6);
    world.gpu.queue.write_buffer(&world.buffers["newton"], 0, bytemuck::cast_slice(&vec![Newton::default(); world.members()]));
    Ok(seconds / REPEATS as f64)
}

/// Sums of solves before their first iteration, whose residuals are not small.
fn begun_sums(shape: &Shape, count: usize) -> Vec<[f32; 4]> {
    let [head, groups] = [solving::SCALARS + solving::OF_SLICE * shape.slices, shape.groups].map(|n| n as usize);
    let of_system = head + solving::OF_GROUP as usize * groups;
    (0..count).map(|i| if (head..head + groups).contains(&(i % of_system)) { [1.0, 0.0, 0.0, 0.0] } else { [0.0; 4] }).collect()
}

/// The shortest of three, which is the least disturbed.
pub(crate) fn shortest(mut run: impl FnMut() -> Result<f64, GpuError>) -> Result<f64, GpuError> {
    Ok(run()?.min(run()?).min(run()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_plain_way_is_left_only_for_what_is_clearly_faster() {
        assert_eq!(choose([1e-3, 0.5e-3]), 1);
        // Equals, measured twice with a tenth of noise either way: the same answer.
        for times in [[1.0, 1.0], [1.1, 0.9], [0.9, 1.1], [1e-6, 1e-6]] {
            assert_eq!(choose(times), 0);
        }
        assert_eq!(
            [Product::Matrix, Product::Free].map(|p| Product::named(p.name())),
            [Some(Product::Matrix), Some(Product::Free)]
        );
    }

    #[test]
    fn settings_are_read_and_others_refused() {
        assert_eq!(Tuning::parse("", "").unwrap_or_else(|e| panic!("{e}")), Tuning::default());
        let forced = Tuning::parse("many", "free").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(forced, Tuning { many_from: 0, product: Some(Product::Free) });
        let e = Tuning::parse("many", "fast").unwrap_err();
        assert_eq!(e.to_string(), "PALPATE_GPU_PRODUCT = \"fast\"; allowed: csr, free");
    }
}
