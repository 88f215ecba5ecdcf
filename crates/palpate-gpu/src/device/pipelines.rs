//! Kernels as the build script found them, compiled when they are first used.

use super::error::{GpuError, translate};
use super::gpu::Gpu;
use std::sync::OnceLock;

/// How the eight lanes of a cell talk to each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lanes {
    /// Subgroup shuffles.
    Subgroup,
    /// Workgroup memory.
    Memory,
}

/// A buffer of a kernel: name, number, whether it is written, whether it is a uniform.
pub type Binding = (&'static str, u32, bool, bool);

/// One kernel, linked and validated by `build.rs`.
#[derive(Debug)]
pub struct PassSource {
    /// Name of the file and of the entry point.
    pub name: &'static str,
    /// WGSL with subgroups, and with workgroup memory.
    pub sources: [&'static str; 2],
    /// True when the two differ.
    pub lanes: bool,
    /// True where its workgroups see what others write in the same dispatch: only with [`wgpu::Features::MEMORY_DECORATION_COHERENT`].
    pub coherent: bool,
    /// Invocations of a workgroup.
    pub width: u32,
    /// Workgroup memory of the hungrier variant [B].
    pub memory: u32,
    /// Its buffers.
    pub bindings: &'static [Binding],
    /// Constants that the host supplies.
    pub overrides: &'static [&'static str],
}

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

/// A compiled kernel.
#[derive(Debug)]
pub struct Kernel {
    pub(crate) pipeline: wgpu::ComputePipeline,
    pub(crate) layout: wgpu::BindGroupLayout,
}

/// All kernels of a device.
#[derive(Debug)]
pub struct Pipelines {
    /// How lanes talk.
    pub lanes: Lanes,
    /// Values of overrides; tests put a wrong one in.
    pub(crate) constant: fn(&str) -> Option<f64>,
    kernels: Vec<OnceLock<Result<Kernel, GpuError>>>,
}

/// Bytes of a dispatch's own arguments (`Call` in `shared/structs.wgsl`).
pub const CALL_BYTES: u32 = size_of::<crate::layout::Call>() as u32;

/// Value of an override: every constant that host and kernels share has its one source in `palpate-model`.
pub fn constant(name: &str) -> Option<f64> {
    Some(match name {
        "contact_damped" => palpate_model::mechanics::contact::DAMPED,
        "instant_count" => palpate_model::mechanics::contact::INSTANTS as f64,
        "instant_offset" => palpate_model::mechanics::contact::INSTANT_OFFSET,
        "instant_weight" => palpate_model::mechanics::contact::INSTANT_WEIGHT,
        "front_far" => palpate_model::cutcells::front::FAR,
        "front_most" => palpate_model::cutcells::front::MOST as f64,
        "front_per_cell" => palpate_model::cutcells::front::PER_CELL,
        "front_root" => palpate_model::cutcells::front::ROOT as f64,
        "place_iterations" => palpate_model::cutcells::pullback::ITERATIONS as f64,
        "sdf_pieces" => palpate_model::cutcells::distances::PIECES as f64,
        "smallest_pair" => palpate_model::mechanics::rotation::SMALLEST_PAIR,
        "newton_determinant" => palpate_model::mechanics::rotation::NEWTON_DETERMINANT,
        "jet_reach" => palpate_model::effects::jet::REACH,
        "jet_side" => palpate_model::effects::jet::SIDE as f64,
        "jet_steepest" => palpate_model::effects::jet::STEEPEST,
        "local_share" => palpate_model::space::points::LOCAL,
        "held_stiffness" => palpate_model::plan::build::HELD,
        "guard_start" => palpate_model::cutcells::corotation::inversion::START,
        "guard_strength" => palpate_model::cutcells::corotation::inversion::STRENGTH,
        _ => return None,
    })
}

impl Pipelines {
    pub(crate) fn new(lanes: Lanes) -> Pipelines {
        Pipelines { lanes, constant, kernels: PASSES.iter().map(|_| OnceLock::new()).collect() }
    }

    /// Whether the kernel of a pass has been asked for.
    #[cfg(test)]
    pub(crate) fn is_compiled(&self, pass: usize) -> bool {
        self.kernels[pass].get().is_some()
    }

    /// Puts another kernel in the place of a pass's, and returns what was there.
    #[cfg(test)]
    pub(crate) fn swap(&mut self, pass: usize, kernel: OnceLock<Result<Kernel, GpuError>>) -> OnceLock<Result<Kernel, GpuError>> {
        std::mem::replace(&mut self.kernels[pass], kernel)
    }

    /// The kernel of a pass.
    pub(crate) fn get(&self, gpu: &Gpu, pass: usize) -> Result<&Kernel, &GpuError> {
        self.kernels[pass].get_or_init(|| compile(gpu, &PASSES[pass], self)).as_ref()
    }
}

/// Hands a kernel to the driver.
///
/// # Errors
/// It refuses.
pub(crate) fn compile(gpu: &Gpu, source: &PassSource, pipelines: &Pipelines) -> Result<Kernel, GpuError> {
    let device = &gpu.device;
    let entries: Vec<wgpu::BindGroupLayoutEntry> = source
        .bindings
        .iter()
        .map(|&(_, binding, writes, uniform)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: if uniform {
                    wgpu::BufferBindingType::Uniform
                } else {
                    wgpu::BufferBindingType::Storage { read_only: !writes }
                },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        })
        .collect();
    let label = Some(source.name);
    let guards = [wgpu::ErrorFilter::Validation, wgpu::ErrorFilter::Internal, wgpu::ErrorFilter::OutOfMemory]
        .map(|filter| device.push_error_scope(filter));
    let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
    let whole = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: &[Some(&layout)],
        immediate_size: CALL_BYTES,
    });
    let text = source.sources[usize::from(pipelines.lanes == Lanes::Memory)];
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label,
        source: wgpu::ShaderSource::Wgsl(std::borrow::Cow::Borrowed(text)),
    });
    let constants: Vec<(&str, f64)> = source.overrides.iter().filter_map(|n| Some((*n, (pipelines.constant)(n)?))).collect();
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label,
        layout: Some(&whole),
        module: &module,
        entry_point: Some(source.name),
        compilation_options: wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() },
        cache: None,
    });
    let ([validation, internal, memory], name) = (guards, source.name);
    // In the order in which they were pushed, from the last to the first.
    let (memory, internal, validation) = (memory.pop(), internal.pop(), validation.pop());
    let caught = gpu.caught(async move {
        let all = [memory.await, internal.await, validation.await];
        all.into_iter().flatten().next().map(|e| match translate(e) {
            GpuError::Refused { message } => GpuError::Shader { pass: name.into(), message },
            e => e,
        })
    });
    caught.map_or(Ok(Kernel { pipeline, layout }), Err)
}
