//! Asks a device which of two ways to solve is faster.

use crate::device::pipelines::shared::solving;
use crate::device::{Gpu, GpuError};
use crate::layout::{Newton, Shape};
use crate::passes::{Passes, SOLVE};
use crate::world::{MANY, Product, State, Tally, Tuning, World};
use palpate_engine::{ParamBatch, Request};
use palpate_model::plan::Plan;
use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};

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
    /// True where a device is to be asked whether one workgroup or many solve for a member of a body of so many nodes.
    fn asks(self, gpu: &Gpu, plan: &Plan) -> bool {
        self == Tuning::default() && !gpu.is_software() && (FEW..MANY).contains(&plan.body.nodes.len())
    }

    /// With the choice between one and many workgroups made, where a device is to be asked and its host has a clock: for one member
    /// alone, because a member must get the same bits alone and in any batch.
    pub(crate) fn on_device(self, gpu: &Arc<Gpu>, plan: &Plan) -> Result<Tuning, GpuError> {
        if self.asks(gpu, plan) { Tuning::measured(gpu, plan) } else { Ok(self) }
    }

    /// The same, asked.
    pub(crate) fn measured(gpu: &Arc<Gpu>, plan: &Plan) -> Result<Tuning, GpuError> {
        let chosen = once(gpu, &key_of_workgroups(gpu, plan), WORKGROUPS, || {
            let iteration = |way| {
                let mut world = World::new(gpu.clone(), plan, 1, way)?;
                world.set_params(&ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
                world.cg_speed().map(|speed| speed.iteration.seconds)
            };
            Ok([iteration(WAYS[0])?, iteration(WAYS[1])?])
        })?;
        Ok(chosen.map_or_else(Tuning::default, |k| WAYS[k]))
    }
}

/// One workgroup a member, and many.
const WAYS: [Tuning; 2] =
    [Tuning { many_from: usize::MAX, product: None, crew: 0 }, Tuning { many_from: 0, product: None, crew: 0 }];

/// A plan made ready on a device, with the ways to solve that are stated, or else faster; without a clock those that were faster before, or the
/// plain ones.
///
/// # Errors
/// The plan needs something this backend lacks, or more than the device has.
pub(crate) fn world(gpu: Arc<Gpu>, plan: &Plan, members: usize, tuning: Tuning) -> Result<World, GpuError> {
    let asked = tuning.on_device(&gpu, plan)?;
    let mut world = World::new(gpu, plan, members, asked)?;
    if has_choice(&world, tuning) {
        world.product = faster(&mut world)?;
    }
    Ok(world)
}

/// The same for whoever may not wait, and so may not measure: as without a clock.
///
/// # Errors
/// As [`world`].
pub(crate) async fn world_async(gpu: Arc<Gpu>, plan: &Plan, members: usize, tuning: Tuning) -> Result<World, GpuError> {
    let asked = tuning.asks(&gpu, plan).then(|| before(&gpu, &key_of_workgroups(&gpu, plan), WORKGROUPS, &known())).flatten();
    let mut world = World::made(gpu, plan, members, asked.map_or(tuning, |k| WAYS[k])).await?;
    if has_choice(&world, tuning) {
        world.product = before(&world.gpu, &key(&world), NAMES, &known()).map_or(Product::Matrix, |k| PRODUCTS[k]);
    }
    Ok(world)
}

/// True where products can be made in either way, which workgroups that stay cannot, and none is stated.
fn has_choice(world: &World, stated: Tuning) -> bool {
    world.many && world.geometry.shape.crew == 0 && stated.product.is_none() && !world.needs_matrix()
}

const PRODUCTS: [Product; 2] = [Product::Matrix, Product::Free];
const NAMES: [&str; 2] = [PRODUCTS[0].name(), PRODUCTS[1].name()];

/// Choices of this process by their keys.
type Known = HashMap<String, usize>;

/// Held while a choice is measured: other measurements would disturb it.
fn known() -> MutexGuard<'static, Known> {
    static KNOWN: LazyLock<Mutex<Known>> = LazyLock::new(Mutex::default);
    KNOWN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Adapter and driver that a choice holds for.
fn device(gpu: &Gpu) -> String {
    format!("{} {}", gpu.name, gpu.driver).replace(char::is_control, " ")
}

/// What the choice of a product holds for: the device, nodes, cells, kinds of cells.
fn key(world: &World) -> String {
    let s = &world.geometry.shape;
    format!("{}: {} nodes, {} cells of {} kinds", device(&world.gpu), s.nodes, s.cells, s.classes)
}

/// What the choice between one and many workgroups holds for.
fn key_of_workgroups(gpu: &Gpu, plan: &Plan) -> String {
    let (nodes, cells, parameters) = (plan.body.nodes.len(), plan.body.cells().len(), plan.layout.len());
    format!("{}: {nodes} nodes, {cells} cells, {parameters} parameters", device(gpu))
}

/// Which of two ways was faster when it was measured, which the host remembers, or else this process.
fn before(gpu: &Gpu, key: &str, names: [&str; 2], known: &Known) -> Option<usize> {
    let written = gpu.host().written(key);
    written.and_then(|w| names.iter().position(|name| *name == w)).or_else(|| known.get(key).copied())
}

/// Which of two ways is faster: measured once [s], so that a user gets the same bits twice; `None` where there is no clock.
fn once(
    gpu: &Gpu,
    key: &str,
    names: [&str; 2],
    measure: impl FnOnce() -> Result<[f64; 2], GpuError>,
) -> Result<Option<usize>, GpuError> {
    let mut known = known();
    let found = before(gpu, key, names, &known);
    if found.is_some() || gpu.seconds().is_err() {
        return Ok(found);
    }
    let chosen = choose(measure()?);
    let counts = gpu.host().write(key, names[chosen]);
    let chosen = names.iter().position(|name| *name == counts).unwrap_or(chosen);
    known.insert(key.to_string(), chosen);
    Ok(Some(chosen))
}

/// The faster product for a body on its device; the plain one without a clock.
pub(crate) fn faster(world: &mut World) -> Result<Product, GpuError> {
    let gpu = world.gpu.clone();
    let chosen = once(&gpu, &key(world), NAMES, || {
        world.set_params(&ParamBatch::from_rows(std::slice::from_ref(&world.plan.theta.clone())));
        world.set_iterations(1);
        Ok([time(world, PRODUCTS[0])?, time(world, PRODUCTS[1])?])
    })?;
    Ok(PRODUCTS[chosen.unwrap_or(0)])
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
    let beginning = begun_sums(&world.geometry.shape, left);
    world.gpu.queue.write_buffer(&world.buffers["newton"], 0, bytemuck::cast_slice(&wanting));
    let run = |repeats: usize| {
        let begun = world.gpu.seconds()?;
        world.gpu.queue.write_buffer(&world.buffers["cg_sums"], 0, bytemuck::cast_slice(&beginning));
        world.record(|r| {
            let mut s = Passes::new(world, r, Some(0), &blank, &blank, &tally);
            s.list();
            for _ in 0..repeats {
                s.multiply(product, 0);
            }
        });
        world.gpu.download::<f32>(&world.buffers["cg_sums"], 1)?;
        Ok(world.gpu.seconds()? - begun)
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
        assert_eq!(forced, Tuning { many_from: 0, product: Some(Product::Free), crew: 0 });
        let e = Tuning::parse("many", "fast").unwrap_err();
        assert_eq!(e.to_string(), "PALPATE_GPU_PRODUCT = \"fast\"; allowed: csr, free");
    }
}
