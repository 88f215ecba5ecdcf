//! How much device memory an evaluation takes, known before a device is asked for it: the same code that makes buffers counts them.

use crate::device::whole;
use crate::error::GpuError;
use crate::geometry::Geometry;
use crate::layout::{ClampPose, Member, Plane};
use crate::observe;
use crate::tuning::MANY;
use crate::world::{VECTOR, tally_sizes, work};
use palpate_engine::Request;
use palpate_model::plan::Plan;
use std::collections::HashMap;

/// Makes buffers, or counts them.
pub(crate) trait Maker {
    /// What is made.
    type Buffer;

    /// A zeroed storage buffer.
    ///
    /// # Errors
    /// It is larger than a limit of the device.
    fn buffer(&self, label: &str, bytes: u64) -> Result<Self::Buffer, GpuError>;

    /// A storage buffer that holds `data`.
    ///
    /// # Errors
    /// As [`Maker::buffer`].
    fn upload<T: bytemuck::NoUninit>(&self, label: &str, data: &[T]) -> Result<Self::Buffer, GpuError>;

    /// Largest buffer that a kernel can bind [B].
    fn largest(&self) -> u64;
}

/// Counts bytes, on a device without limits.
struct Counter;

impl Maker for Counter {
    type Buffer = u64;

    fn buffer(&self, _label: &str, bytes: u64) -> Result<u64, GpuError> {
        Ok(whole(bytes))
    }

    fn upload<T: bytemuck::NoUninit>(&self, _label: &str, data: &[T]) -> Result<u64, GpuError> {
        Ok(whole(size_of_val(data) as u64))
    }

    fn largest(&self) -> u64 {
        u64::MAX
    }
}

/// Device memory of an evaluation [B].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// The body, its matrices, what was measured, and θ.
    pub constants: u64,
    /// Work space of the solves.
    pub work: u64,
    /// States: all steps when a gradient is asked for, two otherwise; and adjoints.
    pub states: u64,
    /// Derivatives of two states along every direction.
    pub tangents: u64,
}

impl Memory {
    /// All of it.
    pub fn total(&self) -> u64 {
        self.constants + self.work + self.states + self.tangents
    }
}

/// Device memory that one evaluation of `members` simulations takes, each with a Poisson's ratio (and so element matrices) of its
/// own.
///
/// # Errors
/// The body or the batch is beyond what the kernels can do.
pub fn memory(plan: &Plan, members: usize, request: &Request) -> Result<Memory, GpuError> {
    let members = members.max(1);
    let (b, q) = (members as u64, request.sensitivities.len());
    let mut buffers = HashMap::new();
    let geometry = Geometry::new(&Counter, plan, members, plan.body.nodes.len() >= MANY, &mut buffers)?;
    let shape = &geometry.shape;
    let matrices = |count: u32| whole(b * 2 * u64::from(count) * 576 * 4);
    let batch = whole(b * size_of::<Member>() as u64)
        + whole(b * u64::from(shape.planes) * size_of::<Plane>() as u64)
        + whole(b * u64::from(shape.steps + 1) * u64::from(shape.clamps) * size_of::<ClampPose>() as u64)
        + whole(b * u64::from(shape.masses) * 4)
        + matrices(shape.classes)
        + matrices(shape.holds)
        + whole(b * 4 * geometry.effects.matrix_floats(shape.holds as usize) as u64)
        + geometry
            .effects
            .sizes(members, shape.nodes as usize, shape.cells as usize, shape.clamps as usize)
            .iter()
            .map(|s| whole(4 * s.1 as u64))
            .sum::<u64>();
    let tally: u64 = tally_sizes(b, plan.layout.len() as u64).iter().map(|t| whole(t.1)).sum();
    let observed = observe::memory(&Counter, plan, members, q)?;
    let vectors = |count: u64| count * VECTOR * u64::from(shape.nodes) * b;
    // A static start keeps a state at rest beside the first one.
    let kept = if request.gradient { u64::from(shape.steps) + 1 } else { 2 };
    Ok(Memory {
        constants: buffers.values().sum::<u64>() + batch + observed,
        work: work(shape, members).iter().map(|w| whole(w.1)).sum::<u64>() + tally,
        states: vectors(3 * kept.max(2)) + if request.gradient { vectors(4) } else { 0 },
        tangents: vectors(4 * q as u64),
    })
}
