//! Links the WGSL of `shaders/` into one source per pass and variant, validates each with naga, and writes down what Rust must
//! know of it: bindings by name, workgroup size, overrides, and assertions that `#[repr(C)]` twins have the same layout.
//!
//! A line `// use shared/NAME` asks for a shared file (each once, before the file that asks). Buffers are declared without
//! numbers; the linker numbers them. A line `// coherent` in a pass makes what it writes coherent among workgroups. `shared/lanes` stands for `lanes_subgroup` or `lanes_memory`: such passes have two variants.
//! `effects/points` stands for every law of points (`effects/KIND.wgsl`, one function of that name) with the call by number, `effects/nodes`
//! and `effects/patches` for those that act there (a kernel compiles as long as all its laws take), `effects/cells` and `effects/tets` for
//! every law of cells, on cells and on tetrahedra; `materials/all` for every material that cells are not made of already (`materials/NAME.wgsl`).

mod tables;
mod validate;

use naga::{AddressSpace, Expression, Literal, StorageAccess, TypeInner};
use palpate_model::effects::{self, Law, Site, cell, law};
use palpate_model::materials;
use palpate_model::mechanics::contact::DEFAULT_STIFFNESS;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};
use tables::Tables;
use validate::validate;

const VARIANTS: [&str; 2] = ["subgroup", "memory"];

fn main() {
    let shaders = PathBuf::from(env::var("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("../../shaders");
    println!("cargo::rerun-if-changed={}", shaders.display());
    let mut names: Vec<String> = fs::read_dir(shaders.join("passes"))
        .expect("shaders/passes exists")
        .filter_map(|e| Some(e.ok()?.path().file_stem()?.to_string_lossy().into_owned()))
        .collect();
    names.sort();
    let mut out = String::new();
    let mut structs = BTreeMap::new();
    let mut numbers = BTreeMap::new();
    let mut indices = String::new();
    let tables = tables::all(&shaders);
    writeln!(out, "/// Every kernel, by name.\npub static PASSES: [PassSource; {}] = [", names.len())
        .expect("a String takes all");
    for (index, name) in names.iter().enumerate() {
        let variants: Vec<Linked> = VARIANTS.iter().map(|v| link(&shaders, name, v, &tables)).collect();
        let facts: Vec<Facts> = variants.iter().map(|v| Facts::of(name, v, &mut structs, &mut numbers)).collect();
        let same = variants[0].text == variants[1].text;
        assert!(same || facts[0].bindings == facts[1].bindings, "variants of {name} bind different buffers");
        let sources: Vec<&str> = variants.iter().map(|v| v.text.as_str()).collect();
        writeln!(
            out,
            "    PassSource {{ name: {name:?}, sources: {sources:?}, lanes: {}, coherent: {}, width: {}, memory: {}, bindings: &{:?}, overrides: &{:?} }},",
            !same, variants[0].coherent, facts[0].width, facts.iter().map(|f| f.memory).max().unwrap_or(0), facts[0].bindings, facts[0].overrides,
        )
        .expect("a String takes all");
        writeln!(indices, "    /// `shaders/passes/{name}.wgsl`.\n    pub const {}: usize = {index};", name.to_uppercase())
            .expect("a String takes all");
    }
    writeln!(out, "];\n/// Numbers of the passes in [`PASSES`].\npub mod pass {{\n{indices}}}").expect("a String takes all");
    out.push_str(&constants(&shaders, &numbers));
    writeln!(out, "/// Arenas by the names of their buffers, and their tables in the order of their starts.")
        .expect("a String takes all");
    let arenas: Vec<(String, &Vec<String>)> = tables.iter().map(|(arena, names)| (tables::buffer(arena), names)).collect();
    writeln!(out, "pub static ARENAS: [(&str, &[&str]); {}] = [", arenas.len()).expect("a String takes all");
    arenas.iter().for_each(|(buffer, names)| writeln!(out, "    ({buffer:?}, &{names:?}),").expect("a String takes all"));
    out.push_str("];\n");
    for (name, (span, members)) in structs {
        writeln!(out, "const _: () = {{\n    assert!(size_of::<crate::layout::{name}>() == {span}, \"size of {name}\");")
            .expect("text");
        for (member, offset) in members {
            writeln!(
                out,
                "    assert!(core::mem::offset_of!(crate::layout::{name}, {member}) == {offset}, \"{name}.{member}\");"
            )
            .expect("a String takes all");
        }
        out.push_str("};\n");
    }
    let path = Path::new(&env::var("OUT_DIR").expect("cargo sets it")).join("shaders.rs");
    fs::write(path, out).expect("OUT_DIR is writable");
}

/// Shared files whose whole numbers Rust uses as well.
const NUMBERED: [&str; 13] = [
    "asks",
    "brace_asks",
    "directions",
    "efforts",
    "elastic_asks",
    "laws",
    "points",
    "pulls",
    "rates",
    "reduce",
    "roster",
    "solving",
    "structs",
];

/// Whole numbers by file and name, as naga computed them.
type Numbers = BTreeMap<(String, String), u32>;

/// Numbers of these files as Rust.
fn constants(shaders: &Path, numbers: &Numbers) -> String {
    let mut out = String::from("/// Numbers that kernels and host share, by the file in `shaders/shared`.\npub mod shared {\n");
    for file in NUMBERED {
        writeln!(out, "    /// `{file}.wgsl`.\n    pub mod {file} {{").expect("a String takes all");
        for name in constants_of(shaders, file) {
            let number = numbers
                .get(&(file.to_string(), name.clone()))
                .unwrap_or_else(|| panic!("shaders/shared/{file}.wgsl: {name} is no u32, or no pass uses the file"));
            writeln!(out, "        #[allow(missing_docs)]\n        pub const {name}: u32 = {number};")
                .expect("a String takes all");
        }
        out.push_str("    }\n");
    }
    out + "}\n"
}

/// Names of the constants that a shared file declares.
fn constants_of(shaders: &Path, file: &str) -> Vec<String> {
    let text = fs::read_to_string(shaders.join(format!("shared/{file}.wgsl"))).expect("the file is there");
    let name = |line: &str| Some(line.strip_prefix("const ")?.split_once(['=', ':'])?.0.trim().to_string());
    text.lines().filter_map(name).collect()
}

/// A pass with everything it uses.
struct Linked {
    text: String,
    /// Its workgroups see what others write in the same dispatch, which only some devices offer.
    coherent: bool,
    /// It is the variant that needs subgroups.
    subgroups: bool,
    /// Constants of the shared files in it that Rust uses as well.
    shared: Vec<(String, String)>,
}

fn link(shaders: &Path, name: &str, variant: &str, tables: &Tables) -> Linked {
    let mut text = String::new();
    let mut done = BTreeSet::new();
    include(shaders, &format!("passes/{name}"), variant, &mut done, &mut text);
    let used = NUMBERED.into_iter().filter(|file| done.contains(&format!("shared/{file}")));
    let shared = used.flat_map(|file| constants_of(shaders, file).into_iter().map(|name| (file.to_string(), name))).collect();
    let mut number = 0;
    let text = tables::resolve(&text, tables);
    let own = fs::read_to_string(shaders.join(format!("passes/{name}.wgsl"))).expect("the file is there");
    let coherent = own.lines().any(|line| line == "// coherent");
    let lines: Vec<String> = text
        .lines()
        .map(|line| {
            if line.starts_with("var<storage") || line.starts_with("var<uniform") {
                number += 1;
                let shared = if coherent && line.starts_with("var<storage, read_write>") { "@coherent " } else { "" };
                format!("@group(0) @binding({}) {shared}{line}", number - 1)
            } else {
                line.to_string()
            }
        })
        .collect();
    Linked { text: lines.join("\n"), coherent, subgroups: variant == VARIANTS[0], shared }
}

fn include(shaders: &Path, file: &str, variant: &str, done: &mut BTreeSet<String>, out: &mut String) {
    if !done.insert(file.to_string()) {
        return;
    }
    let on_nodes = |law: &Law| matches!(law.site, Site::Nodes(_));
    let on_patches = |law: &Law| matches!(law.site, Site::Surface(_) | Site::Contact(_));
    match file {
        "effects/points" => return include_points(shaders, variant, done, out, |law| on_nodes(law) || on_patches(law)),
        "effects/nodes" => return include_points(shaders, variant, done, out, on_nodes),
        "effects/patches" => return include_points(shaders, variant, done, out, on_patches),
        "effects/cells" => return include_cells(shaders, variant, "shared/cell_laws", done, out),
        "effects/tets" => return include_cells(shaders, variant, "shared/tet_laws", done, out),
        "materials/all" => return include_materials(shaders, variant, done, out),
        _ => {}
    }
    let path = shaders.join(format!("{file}.wgsl"));
    let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    for line in text.lines() {
        if let Some(other) = line.strip_prefix("// use ") {
            let other = if other == "shared/lanes" { format!("shared/lanes_{variant}") } else { other.to_string() };
            include(shaders, &other, variant, done, out);
        }
    }
    for line in text.lines().filter(|l| !l.starts_with("//") && !l.is_empty()) {
        out.push_str(line);
        out.push('\n');
    }
}

/// The laws of points that `acts` picks, the function `potential` that calls the one of a number in the table of effects, and where the input holds
/// what.
fn include_points(shaders: &Path, variant: &str, done: &mut BTreeSet<String>, out: &mut String, acts: impl Fn(&Law) -> bool) {
    include(shaders, "shared/points", variant, done, out);
    let cases = include_laws(shaders, variant, done, out, acts, "");
    let places = [
        ("COMMON", law::COMMON),
        ("MOST", law::MOST),
        ("INPUTS", law::COMMON + law::MOST),
        ("OLD_AT", law::OLD),
        ("VELOCITY_AT", law::VELOCITY),
        ("GRAVITY_AT", law::GRAVITY),
        ("STIFFNESS_AT", law::STIFFNESS),
        ("PLANE_AT", law::PLANE),
        ("TIME_AT", law::TIME),
    ];
    for (name, place) in places {
        writeln!(out, "const {name} = {place}u;").expect("a String takes all");
    }
    write!(
        out,
        "const DEFAULT_STIFFNESS = {DEFAULT_STIFFNESS:?};\nfn potential(law: u32) -> Dual {{\n    switch law {{\n{cases}        default: {{ return vec4(0.0); }}\n    }}\n}}\n"
    )
    .expect("a String takes all");
}

/// All laws of cells with the file that asks them, the function `cell_law` that calls the one of a number in the table of effects, and the sizes
/// of the input.
fn include_cells(shaders: &Path, variant: &str, asking: &str, done: &mut BTreeSet<String>, out: &mut String) {
    include(shaders, asking, variant, done, out);
    let cases = include_laws(shaders, variant, done, out, |law| matches!(law.site, Site::Cells(_)), "which");
    let (scalars, inputs) = (cell::ENERGY, cell::ENERGY + cell::MOST);
    write!(
        out,
        "const SCALARS = {scalars}u;\nconst CELL_INPUTS = {inputs}u;\nfn cell_law(law: u32, which: u32) -> Dual {{\n    switch law {{\n{cases}        default: {{ return vec4(0.0); }}\n    }}\n}}\n"
    )
    .expect("a String takes all");
}

/// All materials that are not linear, and the function `material_energy` that calls the one of a number in the table of materials.
fn include_materials(shaders: &Path, variant: &str, done: &mut BTreeSet<String>, out: &mut String) {
    include(shaders, "shared/materials", variant, done, out);
    let mut cases = String::new();
    for (number, model) in materials::ALL.iter().enumerate().filter(|(_, model)| !model.is_linear && model.has_twin()) {
        let name = model.name.replace('-', "_");
        include(shaders, &format!("materials/{name}"), variant, done, out);
        writeln!(cases, "        case {number}u: {{ return {name}(h, lambda, mu); }}").expect("a String takes all");
    }
    write!(
        out,
        "fn material_energy(number: u32, h: Gradient, lambda: Dual, mu: Dual) -> Dual {{\n    switch number {{\n{cases}        default: {{ return vec4(0.0); }}\n    }}\n}}\n"
    )
    .expect("a String takes all");
}

/// The laws that `acts` picks; returns the cases of a switch that call them.
fn include_laws(
    shaders: &Path,
    variant: &str,
    done: &mut BTreeSet<String>,
    out: &mut String,
    acts: impl Fn(&Law) -> bool,
    arguments: &str,
) -> String {
    let mut cases = String::new();
    // What asks for more than the kernels have is the CPU backend's.
    let has_twin = |law: &Law| law.asks() == law::Asks::Nothing;
    for (number, law) in effects::ALL.iter().enumerate().filter(|(_, law)| has_twin(law) && acts(law)) {
        let name = law.kind.replace('-', "_");
        include(shaders, &format!("effects/{name}"), variant, done, out);
        writeln!(cases, "        case {number}u: {{ return {name}({arguments}); }}").expect("a String takes all");
    }
    cases
}

/// What Rust must know of a linked pass.
struct Facts {
    width: u32,
    memory: u32,
    /// Name, number, whether it is written, whether it is a uniform.
    bindings: Vec<(String, u32, bool, bool)>,
    overrides: Vec<String>,
}

type Structs = BTreeMap<String, (u32, Vec<(String, u32)>)>;

impl Facts {
    fn of(pass: &str, linked: &Linked, structs: &mut Structs, numbers: &mut Numbers) -> Facts {
        let (module, info) =
            validate(&linked.text, linked.subgroups).unwrap_or_else(|e| panic!("shaders/passes/{pass}.wgsl: {e}"));
        assert!(module.entry_points.len() == 1, "{pass} has one entry point");
        let entry = &module.entry_points[0];
        assert!(entry.name == pass, "the entry point of {pass}.wgsl is called {pass}, not {}", entry.name);
        assert!(entry.workgroup_size[1..] == [1, 1], "{pass} is one-dimensional");
        let used = info.get_entry_point(0);
        let layouter = {
            let mut l = naga::proc::Layouter::default();
            l.update(module.to_ctx()).expect("layouts of a validated module");
            l
        };
        let mut bindings = Vec::new();
        let mut memory = 0;
        for (handle, variable) in module.global_variables.iter() {
            if used[handle].is_empty() {
                continue;
            }
            if variable.space == AddressSpace::WorkGroup {
                memory += layouter[variable.ty].size;
            }
            let Some(binding) = &variable.binding else { continue };
            let writes = matches!(variable.space, AddressSpace::Storage { access } if access.contains(StorageAccess::STORE));
            let uniform = variable.space == AddressSpace::Uniform;
            bindings.push((variable.name.clone().expect("buffers have names"), binding.binding, writes, uniform));
        }
        for (_, ty) in module.types.iter() {
            if let (Some(name), TypeInner::Struct { members, span }) = (&ty.name, &ty.inner)
                && linked.text.contains(&format!("struct {name} {{ // mirrored"))
            {
                let members = members.iter().map(|m| (m.name.clone().expect("fields have names"), m.offset)).collect();
                structs.insert(name.clone(), (*span, members));
            }
        }
        for key in &linked.shared {
            let constant = module.constants.iter().find(|(_, c)| c.name.as_ref() == Some(&key.1));
            if let Some((_, c)) = constant
                && let Expression::Literal(Literal::U32(number)) = module.global_expressions[c.init]
            {
                numbers.insert(key.clone(), number);
            }
        }
        let overrides = module.overrides.iter().filter_map(|(_, o)| o.name.clone()).collect();
        Facts { width: entry.workgroup_size[0], memory, bindings, overrides }
    }
}
