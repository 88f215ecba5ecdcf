//! Every kernel in the languages of Metal and Direct3D 12, within what those promise everywhere. Whether compilers of these languages take the
//! texts is asked by `.ci/translations`, for which they are written to the folder that `PALPATE_TRANSLATIONS` names.

#[path = "../../translate.rs"]
mod translate;

use super::wgsl::{VARIANTS, validate::validate};
use crate::device::Lanes;
use crate::device::pipelines::{CALL_BYTES, PASSES, PassSource, constant};
use naga::back::hlsl::ShaderModel;
use translate::{Kernel, Translated, to_hlsl, to_msl};

/// Buffers that a Metal function has places for (Metal feature set tables, "Maximum number of entries in the buffer argument table").
const METAL_BUFFERS: u32 = 31;
/// Workgroup memory of every Metal family from Apple 4 on, and of Direct3D 12 compute shaders [B].
const SHARED_BYTES: u32 = 32_768;
/// Invocations of a workgroup, likewise.
const MOST_WIDTH: u32 = 1024;
/// Writable views of a compute shader on every Direct3D 12 device, also of feature level 11.0.
const WRITABLE_VIEWS: usize = 8;
/// Double words of a root signature; a table of views takes one, the numbers of workgroups that wgpu hands over three.
const ROOT_WORDS: u32 = 64;

/// Versions of Metal's language: of macOS 10.14, the oldest with the functions of subgroups, and the newest that wgpu asks for.
const METAL: [(u8, u8); 2] = [(2, 1), (4, 0)];
/// Instead of the first for kernels whose workgroups see each other's writes: older versions know no coherent buffers, and wgpu does not offer them.
const COHERENT_METAL: (u8, u8) = (3, 2);

/// Writes a text down where it is asked for: `NAME.VARIANT.TARGET.KIND`, with the name of its entry point in the first line.
fn keep(done: &Translated, pass: &PassSource, lanes: Lanes, target: &str, kind: &str) {
    let Some(folder) = std::env::var_os("PALPATE_TRANSLATIONS").map(std::path::PathBuf::from) else { return };
    let variant = format!("{lanes:?}").to_lowercase();
    let path = folder.join(format!("{}.{variant}.{target}.{kind}", pass.name));
    let text = format!("// entry {}\n{}", done.entry, done.text);
    std::fs::create_dir_all(&folder)
        .and_then(|()| std::fs::write(&path, text))
        .unwrap_or_else(|e| panic!("{}: {e}", path.display()));
}

/// Each variant of each pass in one more language.
fn each(pass: &PassSource, lanes: Lanes, make: impl Fn(&Kernel) -> Result<Translated, String>) -> Result<Translated, String> {
    let (module, info) = validate(pass.sources[usize::from(lanes == Lanes::Memory)], lanes == Lanes::Subgroup)?;
    let constants: Vec<_> = pass.overrides.iter().filter_map(|name| Some((*name, constant(name)?))).collect();
    make(&Kernel { name: pass.name, module: (&module, &info), bindings: pass.bindings, constants: &constants })
}

#[test]
fn every_kernel_is_translated_for_metal_and_has_room_for_its_buffers() {
    let mut most = 0;
    for pass in &PASSES {
        for (lanes, version) in VARIANTS.into_iter().flat_map(|lanes| METAL.map(|version| (lanes, version))) {
            let version = if pass.coherent { version.max(COHERENT_METAL) } else { version };
            let done = each(pass, lanes, |k| to_msl(k, version));
            let done = done.unwrap_or_else(|e| panic!("{} ({lanes:?}) in Metal {version:?}: {e}", pass.name));
            assert!(done.text.contains(&format!("kernel void {}(", done.entry)), "{}: no entry {}", pass.name, done.entry);
            assert!(done.slots <= METAL_BUFFERS, "{}: {} buffers", pass.name, done.slots);
            most = most.max(done.slots);
            keep(&done, pass, lanes, &format!("{}{}", version.0, version.1), "metal");
        }
        assert!(pass.memory <= SHARED_BYTES && pass.width <= MOST_WIDTH, "{}: {} B", pass.name, pass.memory);
    }
    println!("at most {most} places for buffers");
}

/// The older compiler, which every Windows has, ends with shader model 5.1 and knows no waves: there wgpu offers no subgroups, and kernels use
/// workgroup memory. Subgroups need model 6.0.
#[test]
fn every_kernel_is_translated_for_direct3d_with_waves_from_model_6_on() {
    let mut with_waves = 0;
    for pass in &PASSES {
        let written = pass.bindings.iter().filter(|b| b.2).count();
        assert!(written <= WRITABLE_VIEWS, "{} writes {written} buffers", pass.name);
        for (lanes, model) in [
            (Lanes::Memory, ShaderModel::V5_1),
            (Lanes::Memory, ShaderModel::V6_0),
            (Lanes::Subgroup, ShaderModel::V6_0),
            (Lanes::Subgroup, ShaderModel::V6_6),
        ] {
            let done = each(pass, lanes, |k| to_hlsl(k, model));
            let done = done.unwrap_or_else(|e| panic!("{} ({lanes:?}) for {model:?}: {e}", pass.name));
            assert!(done.text.contains(&format!("void {}(", done.entry)), "{}: no entry {}", pass.name, done.entry);
            keep(&done, pass, lanes, model.to_str(), "hlsl");
            let waves = done.text.contains("Wave") || done.text.contains("Quad");
            assert!(!waves || (lanes == Lanes::Subgroup && pass.lanes), "{} ({lanes:?}): waves", pass.name);
            with_waves += usize::from(waves);
        }
    }
    assert!(with_waves > 5, "{with_waves}");
    const { assert!(CALL_BYTES / 4 + 1 + 3 <= ROOT_WORDS) };
}

#[test]
fn what_has_no_place_or_no_such_function_is_an_error() {
    let pass = PASSES.iter().find(|p| p.lanes && p.bindings.len() > 1).unwrap_or_else(|| panic!("there is one"));
    let msl = |k: &Kernel| to_msl(k, METAL[1]);
    let hlsl = |k: &Kernel| to_hlsl(k, ShaderModel::V6_0);
    for lanes in VARIANTS {
        let bindings = &pass.bindings[1..];
        assert!(each(pass, lanes, |k| msl(&Kernel { bindings, ..*k })).is_err(), "{lanes:?}: a buffer without a place");
        assert!(each(pass, lanes, |k| hlsl(&Kernel { bindings, ..*k })).is_err(), "{lanes:?}: a buffer without a place");
        let name = "another";
        assert!(each(pass, lanes, |k| msl(&Kernel { name, ..*k })).is_err(), "{lanes:?}: no such entry");
        assert!(each(pass, lanes, |k| hlsl(&Kernel { name, ..*k })).is_err(), "{lanes:?}: no such entry");
    }
}
