//! Kernels in the languages of Metal and Direct3D 12, translated as wgpu does before it hands them to those drivers (its `metal/device.rs` and
//! `dx12/device.rs`): with all checks at run time that it asks for, and with the places that it gives to buffers.

use naga::back::pipeline_constants::process_overrides;
use naga::back::{PipelineConstants, TaskDispatchLimits, hlsl, msl};
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::ModuleInfo;
use naga::{Module, ResourceBinding, ShaderStage};

/// A valid kernel.
#[derive(Clone, Copy)]
pub struct Kernel<'a> {
    /// Name of the entry point.
    pub name: &'a str,
    /// Its text as naga read it.
    pub module: (&'a Module, &'a ModuleInfo),
    /// Its buffers: name, number, whether it is written, whether it is a uniform.
    pub bindings: &'a [(&'static str, u32, bool, bool)],
    /// Constants that the host supplies.
    pub constants: &'a [(&'a str, f64)],
}

/// The text in another language, the name of its entry point, and how many places for buffers its layout takes.
#[derive(Debug)]
pub struct Translated {
    /// The text.
    pub text: String,
    /// Name of the entry point.
    pub entry: String,
    /// Places for buffers, those of arguments and sizes included.
    pub slots: u32,
}

/// Both want limits of mesh shaders, which kernels are not.
const NO_MESHES: Option<TaskDispatchLimits> =
    Some(TaskDispatchLimits { max_mesh_workgroups_per_dim: 0, max_mesh_workgroups_total: 0 });

fn place(binding: u32) -> ResourceBinding {
    ResourceBinding { group: 0, binding }
}

/// In the language of Metal, of a version.
///
/// # Errors
/// What naga says.
pub fn to_msl(kernel: &Kernel, lang_version: (u8, u8)) -> Result<Translated, String> {
    let (module, info) = with_constants(kernel)?;
    // Arguments of the dispatch come first, then buffers by their numbers, then their sizes.
    let mut slots = 1u8;
    let mut next = || {
        slots += 1;
        slots - 1
    };
    let resources = kernel.bindings.iter().map(|&(_, binding, mutable, _)| {
        (place(binding), msl::BindTarget { buffer: Some(next()), mutable, ..msl::BindTarget::default() })
    });
    let resources = resources.collect();
    let sizes_buffer = kernel.bindings.iter().any(|b| !b.3).then(&mut next);
    let own = msl::EntryPointResources { resources, immediates_buffer: Some(0), sizes_buffer };
    let checked = BoundsCheckPolicy::Restrict;
    let options = msl::Options {
        lang_version,
        per_entry_point_map: [(kernel.name.to_string(), own)].into_iter().collect(),
        inline_samplers: Vec::new(),
        spirv_cross_compatibility: false,
        fake_missing_bindings: false,
        bounds_check_policies: BoundsCheckPolicies {
            index: checked,
            buffer: checked,
            image_load: checked,
            binding_array: BoundsCheckPolicy::Unchecked,
        },
        zero_initialize_workgroup_memory: true,
        force_loop_bounding: true,
        task_dispatch_limits: NO_MESHES,
        mesh_shader_primitive_indices_clamp: true,
        emit_int_div_checks: true,
        ray_query_initialization_tracking: true,
    };
    let wanted = msl::PipelineOptions {
        entry_point: Some((ShaderStage::Compute, kernel.name.into())),
        vertex_pulling_transform: true,
        ..msl::PipelineOptions::default()
    };
    let (text, made) = msl::write_string(&module, &info, &options, &wanted).map_err(|e| e.to_string())?;
    let entry = only(made.entry_point_names)?.map_err(|e| e.to_string())?;
    Ok(Translated { text, entry, slots: slots.into() })
}

/// In the language of Direct3D, for a shader model.
///
/// # Errors
/// What naga says.
pub fn to_hlsl(kernel: &Kernel, shader_model: hlsl::ShaderModel) -> Result<Translated, String> {
    let (module, info) = with_constants(kernel)?;
    // Arguments of the dispatch are the first constants; buffers that are only read, that are written, and uniforms are counted apart.
    let (mut read, mut written, mut uniform) = (0, 0, 1);
    let binding_map = kernel.bindings.iter().map(|&(_, binding, writes, is_uniform)| {
        let (count, space) = match (is_uniform, writes) {
            (true, _) => (&mut uniform, 1),
            (false, true) => (&mut written, 0),
            (false, false) => (&mut read, 0),
        };
        *count += 1;
        (place(binding), hlsl::BindTarget { space, register: *count - 1, ..hlsl::BindTarget::default() })
    });
    let binding_map = binding_map.collect();
    let samplers = hlsl::BindTarget { register: 2048, ..hlsl::BindTarget::default() };
    let options = hlsl::Options {
        shader_model,
        binding_map,
        fake_missing_bindings: false,
        special_constants_binding: Some(hlsl::BindTarget { space: 1, register: uniform, ..hlsl::BindTarget::default() }),
        immediates_target: Some(hlsl::BindTarget::default()),
        sampler_heap_target: hlsl::SamplerHeapBindTargets {
            standard_samplers: hlsl::BindTarget::default(),
            comparison_samplers: samplers,
        },
        sampler_buffer_binding_map: Default::default(),
        dynamic_storage_buffer_offsets_targets: Default::default(),
        external_texture_binding_map: Default::default(),
        zero_initialize_workgroup_memory: true,
        restrict_indexing: true,
        force_loop_bounding: true,
        task_dispatch_limits: NO_MESHES,
        mesh_shader_primitive_indices_clamp: true,
        ray_query_initialization_tracking: true,
    };
    let wanted = hlsl::PipelineOptions { entry_point: Some((ShaderStage::Compute, kernel.name.into())) };
    let mut text = String::new();
    let made = hlsl::Writer::new(&mut text, &options, &wanted).write(&module, &info, None).map_err(|e| e.to_string())?;
    let entry = only(made.entry_point_names)?.map_err(|e| e.to_string())?;
    Ok(Translated { text, entry, slots: read + written + uniform + 1 })
}

/// The module with the constants of the host in place.
fn with_constants<'a>(kernel: &Kernel<'a>) -> Result<(std::borrow::Cow<'a, Module>, std::borrow::Cow<'a, ModuleInfo>), String> {
    let constants: PipelineConstants = kernel.constants.iter().map(|(name, value)| (name.to_string(), *value)).collect();
    let (module, info) = kernel.module;
    process_overrides(module, info, Some((ShaderStage::Compute, kernel.name)), &constants).map_err(|e| e.to_string())
}

fn only<T>(mut all: Vec<T>) -> Result<T, String> {
    if all.len() == 1 { Ok(all.remove(0)) } else { Err(format!("{} entry points", all.len())) }
}
