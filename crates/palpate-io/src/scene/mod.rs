//! Format `scene/1`: one TOML file ↔ [`Scene`].

#[cfg(test)]
mod answer_tests;
mod edit;
mod effects;
mod fields;
mod fit;
#[cfg(test)]
mod load_tests;
mod loads;
mod material;
mod motion;
mod moving;
mod normal;
mod object;
mod path;
mod regions;
mod rework;
mod rows;
pub(crate) mod scale;
mod synthesis;
mod target;
#[cfg(test)]
mod tests;
mod time;
mod track;
mod write;

pub use edit::edit_scene;
pub use regions::{scene_in, scene_with_regions};
pub use rework::{recast_scene, scene_of_tracks};
pub use write::{append_effects, name_field_files, scene_with_values, without_wishes, write_scene};

use crate::document::{Source, Table};
use crate::error::{InputError, Loaded, number};
use crate::keys::SCENE;
use crate::recording::leaves;
use glam::DVec3;
use palpate_model::observation::MarkerRest;
use palpate_model::observation::ReadingKind;
use palpate_model::scene::*;
use std::path::Path;

/// The scene format this version reads and writes.
pub const FORMAT: &str = "scene/1";

/// Reads a scene and every file it names except the recording.
///
/// Where a key is absent: damping 0, gravity (0, 0, −9.81) m/s², θ 0.6, start 0, state `rest`, band 4 cells, all frames,
/// every pixel, optimiser `gauss-newton`, 50 iterations, one start, seed 1, all threads, [`Solver::default`]. Relative paths start from the scene's
/// folder and are not expanded.
///
/// # Errors
/// The first thing that is wrong, in the order: TOML, format, unknown keys, then table by table.
pub fn read_scene(path: impl AsRef<Path>) -> Result<Loaded<Scene>, InputError> {
    let source = Source::read(path.as_ref())?;
    scene(&source)
}

/// Reads a scene from text; relative paths start from the folder of `path`.
///
/// # Errors
/// As [`read_scene`].
pub fn parse_scene(text: &str, path: impl AsRef<Path>) -> Result<Loaded<Scene>, InputError> {
    parse(text, path.as_ref())
}

fn parse(text: &str, path: &Path) -> Result<Loaded<Scene>, InputError> {
    scene(&Source::parse(path, text.to_string())?)
}

/// An error about a key of a scene (`clamp.0.box`) that was found after reading, with its line where the file's `text` has the
/// key; a scene built in code has an empty text and no lines.
pub fn scene_error(path: &Path, text: &str, key: &str, message: impl Into<String>) -> InputError {
    match Source::parse(path, text.to_string()) {
        Ok(source) => source.fault(key, message),
        Err(_) => InputError { key: key.to_string(), ..InputError::file(path, message) },
    }
}

/// True where a scene's text states a dotted key (`observation.band`) itself.
pub fn states(text: &str, key: &str) -> bool {
    let Ok(document) = text.parse::<toml_edit::DocumentMut>() else { return false };
    let mut item = Some(document.as_item());
    for part in key.split('.') {
        item = item.and_then(|i| i.get(part));
    }
    item.is_some()
}

fn scene(source: &Source) -> Result<Loaded<Scene>, InputError> {
    let root = source.root();
    check_format(&root, FORMAT)?;
    root.check_keys(&SCENE)?;

    let mut warnings = Vec::new();
    let object = object::object(&root, &mut warnings)?;
    let (of_tets, of_points) = (object.is_of_tetrahedra(), object.is_of_points());
    let (material, curves) = material::material(&root, &mut warnings)?;
    let gravity = match root.optional_table("world")? {
        Some(w) => w.optional_vec3("gravity")?,
        None => None,
    };
    let initial = initial(&root, object::is_given(&root)?)?;
    let (time, mut effects) = (time::time(&root, &initial)?, effects::effects(&root)?);
    let synthesis = synthesis::synthesis(&root, &time, &mut effects)?;
    let observation = observation(&root)?;
    loads::loads(source, &root, observation.as_ref(), &mut effects)?;
    loads::attachments(source, &root, observation.as_ref(), &mut effects)?;
    moving::obstacles(&root, &mut effects, &mut warnings)?;
    let mut scene = Scene {
        path: source.path.clone(),
        title: root.optional_str("title")?.unwrap_or_default().to_string(),
        object,
        material,
        curves,
        gravity: gravity.unwrap_or(DVec3::new(0.0, 0.0, -9.81)),
        clamps: clamps(&root)?,
        planes: planes(&root)?,
        masses: masses(&root)?,
        effects,
        fields: fields::fields(&root, of_points)?,
        time,
        initial,
        solver: solver(&root, of_tets, of_points)?,
        observation,
        targets: target::targets(&root)?,
        synthesis,
        tracking: track::tracking(&root)?,
        fit: None,
    };
    if scene.gravity.length() > 100.0 {
        warnings.push(format!(
            "{}: world.gravity is {} m/s² long; is it in m/s²?",
            source.path.display(),
            number(scene.gravity.length())
        ));
    }
    scale::check(source, &scene, &mut warnings)?;
    scene.fit = fit::fit(&root, &scene)?;
    Ok(Loaded { value: scene, warnings })
}

/// The `format` key must be there and be one that is understood.
pub(crate) fn check_format(root: &Table, format: &str) -> Result<(), InputError> {
    match root.optional_str("format")? {
        Some(f) if f == format => Ok(()),
        Some(f) => Err(root.error("format", format!("\"{f}\" is not understood; this version reads \"{format}\""))),
        None => Err(root.missing("format", &format!("format = \"{format}\""))),
    }
}

/// `min` and `max` of a box table, in order.
fn corners(t: &Table) -> Result<(DVec3, DVec3), InputError> {
    let (min, max) = (t.vec3("min")?, t.vec3("max")?);
    for (a, axis) in ["x", "y", "z"].iter().enumerate() {
        if min[a] >= max[a] {
            return Err(t.error("max", format!("{axis}: {} must be larger than min = {}", number(max[a]), number(min[a]))));
        }
    }
    Ok((min, max))
}

fn clamps(root: &Table) -> Result<Vec<Clamp>, InputError> {
    let mut clamps = Vec::new();
    for t in root.tables("clamp")? {
        let object_frame = t.optional_choice("frame", &[("world", false), ("object", true)])?;
        let region = match (t.optional_table("box")?, t.optional_str("group")?) {
            (Some(_), Some(_)) => return Err(t.error("group", "box and group exclude each other; give one")),
            (None, None) => {
                let wanted = "box = { min = [x, y, z], max = [x, y, z] }, or group = \"NAME\" of a volume mesh";
                return Err(t.missing("box", wanted));
            }
            (None, Some(_)) if object_frame.is_some() => {
                return Err(t.error("frame", "belongs to a box; a group has its nodes wherever the body is placed"));
            }
            (None, Some(name)) => ClampRegion::Group(name.to_string()),
            (Some(b), None) => {
                let (min, max) = corners(&b)?;
                ClampRegion::Box { min, max, object_frame: object_frame.unwrap_or(false) }
            }
        };
        let motion_path = t.optional_file("motion")?;
        let motion = motion_path.as_deref().map(motion::read_motion).transpose()?;
        clamps.push(Clamp { region, motion, motion_path });
    }
    Ok(clamps)
}

fn planes(root: &Table) -> Result<Vec<Plane>, InputError> {
    let mut planes = Vec::new();
    for t in root.tables("plane")? {
        let normal = t.vec3("normal")?;
        // Shorter than this, the direction is rounding noise.
        if normal.length() < 1e-12 {
            return Err(t.error("normal", "has no length; give a direction out of the forbidden half-space"));
        }
        let stiffness = t.f64_where("stiffness", |x| x > 0.0, "is not allowed: must be > 0 (Pa/m)")?;
        planes.push(Plane { point: t.vec3("point")?, normal: normal.normalize(), stiffness });
    }
    Ok(planes)
}

fn masses(root: &Table) -> Result<Vec<PointMass>, InputError> {
    let mut masses = Vec::new();
    for t in root.tables("mass")? {
        let mass = t.f64_where("mass", |x| x >= 0.0, "is not allowed: must be ≥ 0 (kg)")?;
        masses.push(PointMass { point: t.vec3("point")?, mass: mass.ok_or_else(|| t.missing("mass", "a number ≥ 0 (kg)"))? });
    }
    Ok(masses)
}

/// `given`: the object's shape is the equilibrium.
fn initial(root: &Table, given: bool) -> Result<Initial, InputError> {
    let state = if given { InitialShape::Given } else { InitialShape::Rest };
    let mut initial = Initial { velocity: DVec3::ZERO, angular_velocity: DVec3::ZERO, pivot: None, state };
    if let Some(t) = root.optional_table("initial")? {
        initial.velocity = t.optional_vec3("velocity")?.unwrap_or_default();
        initial.angular_velocity = t.optional_vec3("angular_velocity")?.unwrap_or_default();
        initial.pivot = t.optional_vec3("pivot")?;
        let states = [("rest", InitialShape::Rest), ("static-equilibrium", InitialShape::StaticEquilibrium)];
        let state = t.optional_choice("state", &states)?;
        if given && state.is_some() {
            return Err(t.error(
                "state",
                "belongs to object.state = \"rest\": a static shape is the equilibrium that the motion starts from",
            ));
        }
        initial.state = state.unwrap_or(initial.state);
    }
    Ok(initial)
}

fn solver(root: &Table, of_tets: bool, of_points: bool) -> Result<Solver, InputError> {
    let mut s = Solver::default();
    let Some(t) = root.optional_table("solver")? else { return Ok(s) };
    if of_points && t.has("element") {
        return Err(t.error("element", "belongs to bodies of cells or tetrahedra; points have stars (object.neighbours)"));
    }
    element(&t, of_tets, &mut s)?;
    let linear = [("auto", LinearSolver::Auto), ("cholesky", LinearSolver::Cholesky), ("cg", LinearSolver::ConjugateGradient)];
    s.linear = t.optional_choice("linear", &linear)?.unwrap_or(s.linear);
    let tolerance = t.f64_where("tolerance", |x| x > 0.0 && x < 1.0, "is not allowed: must lie in (0, 1)")?;
    s.tolerance = tolerance.unwrap_or(s.tolerance);
    if let Some(n) = t.optional_count("newton_iterations", 1..=10_000)? {
        s.newton_iterations = n as usize;
    }
    s.ghost = t.f64_where("ghost", |x| x >= 0.0, "is not allowed: must be ≥ 0")?.unwrap_or(s.ghost);
    Ok(s)
}

/// `element`, which says what cells of a lattice are, or what tetrahedra.
fn element(t: &Table, of_tets: bool, s: &mut Solver) -> Result<(), InputError> {
    let cells = [("enhanced", Element::Enhanced), ("trilinear", Element::Trilinear), ("corner", Element::Corner)];
    let tets = [("tet10", Tetrahedron::Quadratic), ("tet4", Tetrahedron::Linear)];
    let all: Vec<(&str, bool)> = cells.iter().map(|c| (c.0, false)).chain(tets.iter().map(|c| (c.0, true))).collect();
    let Some(is_tet) = t.optional_choice("element", &all)? else { return Ok(()) };
    match (is_tet, of_tets) {
        (true, true) => s.tetrahedron = t.optional_choice("element", &tets)?.unwrap_or_default(),
        (false, false) => s.element = t.optional_choice("element", &cells)?.unwrap_or(s.element),
        (true, false) => {
            let message = "belongs to bodies of tetrahedra (object.volume_mesh); cells of a lattice are \"enhanced\", \"trilinear\" or \"corner\"";
            return Err(t.error("element", message));
        }
        (false, true) => {
            let message = "belongs to bodies that are cut out of a lattice; those of a volume_mesh are \"tet10\" or \"tet4\"";
            return Err(t.error("element", message));
        }
    }
    Ok(())
}

/// Widest band in cells: points farther away than a body is thick tell of nothing, and the lattice grows with its cube.
const WIDEST_BAND: f64 = 100.0;

fn observation(root: &Table) -> Result<Option<ObservationSpec>, InputError> {
    let Some(t) = root.optional_table("observation")? else { return Ok(None) };
    let recording = t.optional_path("recording")?.ok_or_else(|| t.missing("recording", "the folder of a recording"))?;
    if t.optional_str("cost").is_ok_and(|c| c == Some("silhouette")) {
        return Err(t.error("cost", "\"silhouette\" is not available in this version; allowed: \"sparse-surface\", \"markers\", \"points\", \"displacements\""));
    }
    let kinds = [
        ("sparse-surface", ReadingKind::Depth),
        ("markers", ReadingKind::Marker),
        ("points", ReadingKind::Track),
        ("displacements", ReadingKind::Displacement),
    ];
    let costs = t.optional_choices("cost", &kinds)?.ok_or_else(|| {
        t.missing("cost", "\"sparse-surface\", \"markers\", \"points\", \"displacements\", or an array of these")
    })?;
    let mut spec = ObservationSpec::new(recording, costs);
    if let Some(f) = t.optional_table("frames")? {
        spec.from = f.optional_f64("from")?.unwrap_or(spec.from);
        spec.to = f.optional_f64("to")?.unwrap_or(spec.to);
        spec.every = f.optional_count("every", 1..=u64::MAX)?.map_or(spec.every, |n| n as usize);
        if spec.from > spec.to {
            return Err(f.error("to", format!("{} lies before from = {}", number(spec.to), number(spec.from))));
        }
    }
    for m in t.tables("marker")? {
        let marker = marker_rest(&m)?;
        if spec.markers.iter().any(|o| o.name == marker.name) {
            return Err(m.error("name", format!("\"{}\" is given twice", marker.name)));
        }
        spec.markers.push(marker);
    }
    if let Some(file) = t.optional_str("file")? {
        if leaves(file) {
            let text =
                format!("\"{file}\" leaves the recording's folder; it names a file inside; for another folder give `recording`");
            return Err(t.error("file", text));
        }
        spec.file = file.to_string();
    }
    spec.band = t
        .f64_where("band", |x| x > 0.0 && x <= WIDEST_BAND, "is not allowed: must be > 0 and at most 100 (cells)")?
        .unwrap_or(spec.band);
    spec.pixel_stride = t.optional_count("pixel_stride", 1..=100_000)?.map_or(spec.pixel_stride, |n| n as usize);
    Ok(Some(spec))
}

/// `name`, `position` and perhaps `surface` of a marker at rest.
pub(crate) fn marker_rest(t: &Table) -> Result<MarkerRest, InputError> {
    let name = t.optional_str("name")?.filter(|n| !n.is_empty()).ok_or_else(|| t.missing("name", "a marker's label"))?;
    Ok(MarkerRest { name: name.to_string(), position: t.vec3("position")?, surface: t.optional_vec3("surface")? })
}
