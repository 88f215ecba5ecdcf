//! The check that a kernel's text must pass, for the build script and the tests.

use naga::valid::{Capabilities, ModuleInfo, ShaderStages, SubgroupOperationSet, ValidationFlags, Validator};

/// A kernel's module and what naga found out about it; only with `subgroups` may lanes talk by subgroup operations.
///
/// # Errors
/// What is wrong with the text, with its place.
pub fn validate(text: &str, subgroups: bool) -> Result<(naga::Module, ModuleInfo), String> {
    let module = naga::front::wgsl::parse_str(text).map_err(|e| e.emit_to_string(text))?;
    let mut capabilities = Capabilities::IMMEDIATES | Capabilities::MEMORY_DECORATION_COHERENT;
    if subgroups {
        capabilities |= Capabilities::SUBGROUP;
    }
    let mut validator = Validator::new(ValidationFlags::all(), capabilities);
    if subgroups {
        validator.subgroup_stages(ShaderStages::COMPUTE).subgroup_operations(SubgroupOperationSet::all());
    }
    let info = validator.validate(&module).map_err(|e| e.emit_to_string(text))?;
    Ok((module, info))
}
