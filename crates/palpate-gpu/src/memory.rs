//! How much device memory an evaluation takes, known before a device is asked for it: the same code that makes buffers counts them.

use crate::costs;
use crate::device::pipelines::shared::structs::FIELD_MIXES;
use crate::device::{Arena, GpuError, Maker, whole};
use crate::layout::{ClampPose, Member, Plane};
use crate::world::rates;
use crate::world::{Coarse, Geometry, MANY, SOLVING_VECTORS, Sums, VECTOR, coarse_vectors, columns, tally_sizes, work};
use palpate_engine::{Request, Wanted};
use palpate_model::plan::Plan;
use std::collections::HashMap;

/// Counts bytes, on a device with such a largest buffer [B].
struct Counter(u64);

impl Maker for Counter {
    type Buffer = u64;

    fn buffer(&self, _label: &str, bytes: u64) -> Result<u64, GpuError> {
        Ok(whole(bytes))
    }

    fn upload<T: bytemuck::NoUninit>(&self, _label: &str, data: &[T]) -> Result<u64, GpuError> {
        Ok(whole(size_of_val(data) as u64))
    }

    fn largest(&self) -> u64 {
        self.0
    }
}

/// A batch whose memory is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Load<'a> {
    /// Simulations at once.
    pub members: usize,
    /// Different Poisson's ratios among them: each has element matrices of its own.
    pub ratios: usize,
    /// What is asked of every evaluation.
    pub request: &'a Request,
    /// Largest buffer of the device [B] ([`crate::AdapterReport::largest_buffer`]); `u64::MAX` where that is not known.
    pub room: u64,
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
    /// Derivatives of two states along every direction, and what solving for them takes.
    pub tangents: u64,
    /// The largest single buffer, which must not exceed the device's.
    pub largest: u64,
}

impl Memory {
    /// All of it.
    pub fn total(&self) -> u64 {
        self.constants + self.work + self.states + self.tangents
    }
}

/// Device memory that a product with the Gauss–Newton matrix takes: one simulation with all its states and, for the only direction, the
/// tangents of all of them.
///
/// # Errors
/// The body is beyond what the kernels can do.
pub fn memory_of_product(plan: &Plan, gradient: &Wanted, room: u64) -> Result<Memory, GpuError> {
    let request = Request { gradient: gradient.clone(), sensitivities: vec![0] };
    let one = memory(plan, &Load { members: 1, ratios: 1, request: &request, room })?;
    let tangent = 2 * VECTOR * plan.body.nodes.len() as u64;
    let (kept, counted) = (plan.clock.stages().len() as u64 + 1, 2);
    Ok(Memory { tangents: one.tangents + tangent * kept.saturating_sub(counted), ..one })
}

/// Device memory that one evaluation of a batch takes.
///
/// # Errors
/// The body or the batch is beyond what the kernels can do.
pub fn memory(plan: &Plan, load: &Load) -> Result<Memory, GpuError> {
    let (members, request, counter) = (load.members.max(1), load.request, Counter(load.room));
    let (b, q) = (members as u64, request.sensitivities.len());
    let mut buffers = HashMap::new();
    let geometry = Geometry::new(&counter, plan, members, plan.body.nodes.len() >= MANY, &mut buffers)?;
    let shape = &geometry.shape;
    let coarse = Coarse::new(plan, &geometry);
    // A viscosity needs those at ν = 0 besides.
    let ratios = load.ratios.clamp(1, members) as u64 + u64::from(plan.layout.is_viscous());
    let matrices = |sets: u64, count: u32| sets * 2 * u64::from(count) * 576 * 4;
    let mut constants: Vec<u64> = buffers.into_values().collect();
    let effects = geometry.effects.sizes(members, &plan.body, geometry.mass.entries(), shape.clamps as usize);
    let of_batch = [
        b * size_of::<Member>() as u64,
        b * u64::from(shape.planes) * size_of::<Plane>() as u64,
        b * u64::from(shape.steps + 1) * u64::from(shape.clamps) * size_of::<ClampPose>() as u64,
        b * u64::from(shape.masses) * 4,
        effects.iter().map(|s| 4 * s.1 as u64).sum(),
        8 * b * (1 + coarse.kinds() as u64),
    ];
    let of_matrices = [
        matrices(ratios, shape.classes),
        // Effects on clamps make other matrices for each member.
        matrices(if geometry.effects.on_clamps() { b } else { ratios }, shape.holds),
        b * 4 * geometry.effects.matrix_floats(shape.holds as usize) as u64,
    ];
    constants
        .extend([Arena::bytes("batch_tables", of_batch.iter().sum()), Arena::bytes("matrices_tables", of_matrices.iter().sum())]);
    constants.push(coarse.usual() as u64 * VECTOR * coarse_vectors(geometry.groups.len()) as u64);
    constants.extend(costs::memory(&counter, plan, members, q)?);
    let mut space: Vec<u64> = work(shape, members).iter().map(|w| w.1).collect();
    space.extend(tally_sizes(b, plan.layout.len() as u64, shape.steps.into()).iter().map(|t| t.1));
    let sums = Sums::new(plan, &geometry.effects, &request.gradient);
    space.extend(sums.iter().flat_map(|s| s.sizes(shape, &geometry.effects, b)).map(|s| s.1));
    let vectors = |count: u64| count * VECTOR * u64::from(shape.nodes) * b;
    // A static start keeps a state at rest beside the first one.
    let several = u64::from(shape.fields & FIELD_MIXES != 0);
    let kept = if request.gradient.any() { u64::from(shape.steps) + 1 } else { 2 + several };
    let all = |sizes: &[u64]| sizes.iter().map(|s| whole(*s)).sum();
    let of_rates: u64 = request.sensitivities.iter().map(|p| rates::bytes(&geometry, plan, *p, b)).sum();
    // Each state is a buffer of three vectors.
    let largest = constants.iter().chain(&space).fold(vectors(3), |most, s| most.max(*s));
    Ok(Memory {
        constants: all(&constants),
        work: all(&space),
        // Several past states have a weighted sum beside them; so have their adjoints and tangents.
        states: vectors(3 * (kept.max(2) + several)) + if request.gradient.any() { vectors(4 + 4 * several) } else { 0 },
        tangents: of_rates
            + vectors(
                (4 + 2 * several) * q as u64
                    + 4 * several * q.min(1) as u64
                    + if q > 1 { SOLVING_VECTORS * columns(b).min(q as u64) } else { 0 },
            ),
        largest,
    })
}
