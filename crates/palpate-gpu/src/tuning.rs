//! Ways to solve of which one is faster: one or many workgroups a member, with an assembled matrix or without.

use crate::error::GpuError;
use crate::layout::Newton;
use crate::solve::Solve;
use crate::world::{State, Tally, World};
use palpate_engine::ParamBatch;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// From so many nodes on, many workgroups share the conjugate gradients of a member: one workgroup alone then cannot draw a
/// device's memory bandwidth, while below, three dispatches an iteration cost more than they save.
pub const MANY: usize = 4096;
/// The product without a matrix must be this much faster, so that chance does not decide between equals: which one runs decides
/// the last bits of a result.
const CLEARLY: f64 = 0.8;
/// Products that are timed.
pub(crate) const REPEATS: usize = 8;

/// How A p is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Product {
    /// With the assembled, blocked matrix.
    Matrix,
    /// From the element matrices, cell by cell.
    Free,
}

/// What is given instead of chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tuning {
    /// Nodes from which on many workgroups share a solve.
    pub many_from: usize,
    /// `None` = whichever is faster on the device.
    pub product: Option<Product>,
}

impl Default for Tuning {
    fn default() -> Tuning {
        Tuning { many_from: MANY, product: None }
    }
}

impl Tuning {
    /// As `PALPATE_GPU_CG` (one, many) and `PALPATE_GPU_PRODUCT` (csr, free) say.
    ///
    /// # Errors
    /// They say something else.
    pub fn from_env() -> Result<Tuning, GpuError> {
        let get = |name| std::env::var(name).unwrap_or_default();
        Tuning::parse(&get("PALPATE_GPU_CG"), &get("PALPATE_GPU_PRODUCT"))
    }

    fn parse(cg: &str, product: &str) -> Result<Tuning, GpuError> {
        let wrong = |name, value: &str, allowed| GpuError::Setting { name, value: value.into(), allowed };
        Ok(Tuning {
            many_from: match cg {
                "" => MANY,
                "one" => usize::MAX,
                "many" => 0,
                _ => return Err(wrong("PALPATE_GPU_CG", cg, "one, many")),
            },
            product: match product {
                "" => None,
                "csr" => Some(Product::Matrix),
                "free" => Some(Product::Free),
                _ => return Err(wrong("PALPATE_GPU_PRODUCT", product, "csr, free")),
            },
        })
    }
}

/// Adapter, nodes, cells, kinds of cells.
type Key = (String, u32, u32, u32);

/// The faster product for a body on its device: measured once per process, so that a process gives the same bits twice.
pub(crate) fn faster(world: &mut World) -> Result<Product, GpuError> {
    static KNOWN: Mutex<Option<HashMap<Key, Product>>> = Mutex::new(None);
    let s = &world.geometry.shape;
    let key = (world.gpu.name.clone(), s.nodes, s.cells, s.classes);
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(p) = known.as_ref().and_then(|k| k.get(&key)) {
        return Ok(*p);
    }
    world.set_params(&ParamBatch::from_rows(std::slice::from_ref(&world.plan.theta.clone())));
    world.set_iterations(1);
    let seconds = [Product::Matrix, Product::Free].map(|p| time(world, p));
    let [matrix, free] = seconds;
    let product = if free? < CLEARLY * matrix? { Product::Free } else { Product::Matrix };
    known.get_or_insert_default().insert(key, product);
    Ok(product)
}

/// Seconds of [`REPEATS`] products of the first member with a matrix of zeros, which takes as long as any.
pub(crate) fn time(world: &World, product: Product) -> Result<f64, GpuError> {
    let tally = Tally::new(world, &[]);
    let blank = State(world.lend(3));
    let newton = &world.buffers["newton"];
    let wanting = |stage: u32| vec![Newton { stage, ..Newton::default() }; world.members()];
    world.gpu.queue.write_buffer(newton, 0, bytemuck::cast_slice(&wanting(2)));
    let run = |repeats: usize| {
        let clock = Instant::now();
        world.record(|r| {
            let mut s = Solve::new(world, r, Some(0), &blank, &blank, &tally);
            s.list();
            for _ in 0..repeats {
                s.multiply(product, 0);
            }
        });
        world.gpu.download::<f32>(&world.buffers["cg_parts"], 1).map(|_| clock.elapsed().as_secs_f64())
    };
    // The first run compiles the kernels. The shortest of three is the least disturbed; what submitting and waiting take by
    // themselves is left out.
    run(1)?;
    let shortest = |repeats| -> Result<f64, GpuError> { Ok(run(repeats)?.min(run(repeats)?).min(run(repeats)?)) };
    let idle = shortest(0)?;
    let seconds = shortest(REPEATS)? - idle;
    world.gpu.queue.write_buffer(newton, 0, bytemuck::cast_slice(&wanting(0)));
    // No clock tells less than a microsecond of such work.
    Ok(seconds.max(1e-6))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_read_and_others_refused() {
        assert_eq!(Tuning::parse("", "").unwrap_or_else(|e| panic!("{e}")), Tuning::default());
        let forced = Tuning::parse("many", "free").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(forced, Tuning { many_from: 0, product: Some(Product::Free) });
        let e = Tuning::parse("many", "fast").unwrap_err();
        assert_eq!(e.to_string(), "PALPATE_GPU_PRODUCT = \"fast\"; allowed: csr, free");
    }
}
