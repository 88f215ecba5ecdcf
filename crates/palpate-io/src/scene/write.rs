//! A scene written back with found values in place; comments and layout of the user's file are kept, and every changed value
//! says what it was, so that no comment speaks of a number that is gone.

use crate::error::InputError;
use glam::DVec3;
use palpate_model::effects::Effect;
use palpate_model::params::fields::Basis;
use palpate_model::plan::PlaneSite;
use palpate_model::scene::Scene;
use std::path::{Component, Path, PathBuf};
use toml_edit::{Array, DocumentMut, Item, Table, TableLike, Value};

/// The text of `scene` with `values` (dotted path, value in SI units) in place, readable from `folder`.
///
/// `template` is the scene's own text. A plane's height and angles are written back as its point and normal; relative
/// paths are rewritten so that they hold from `folder`.
///
/// # Errors
/// A template that is no TOML, a path that the scene does not have, a value that is not finite.
pub fn write_scene(template: &str, scene: &Scene, values: &[(String, f64)], folder: &Path) -> Result<String, InputError> {
    let before = document(template, scene)?;
    let mut doc = before.clone();
    put(&mut doc, scene, values)?;
    start_there(&mut doc, values);
    note_changes(doc.as_table_mut(), before.as_table());
    rebase(&mut doc, scene.path.parent().unwrap_or(Path::new("")), folder);
    Ok(doc.to_string())
}

/// The text of `scene` with other `values` (dotted path, value in SI units), as somebody would type them: starts of a fit and paths stay.
///
/// # Errors
/// As [`write_scene`].
pub fn scene_with_values(template: &str, scene: &Scene, values: &[(String, f64)]) -> Result<String, InputError> {
    let mut doc = document(template, scene)?;
    put(&mut doc, scene, values)?;
    Ok(doc.to_string())
}

/// The text of a scene as a document that keeps comments and layout.
pub(super) fn document(template: &str, scene: &Scene) -> Result<DocumentMut, InputError> {
    let wrong = |e: toml_edit::TomlError| InputError::file(&scene.path, format!("not valid TOML: {}", e.message()));
    template.parse().map_err(wrong)
}

/// Puts values into a scene's text.
fn put(doc: &mut DocumentMut, scene: &Scene, values: &[(String, f64)]) -> Result<(), InputError> {
    let mut planes: Vec<Option<[Option<f64>; 3]>> = vec![None; scene.planes.len()];
    for (path, value) in values {
        let wrong = |message: String| InputError { key: path.clone(), ..InputError::file(&scene.path, message) };
        if !value.is_finite() {
            return Err(wrong(format!("{value} cannot be written")));
        }
        let parts: Vec<&str> = path.split('.').collect();
        let axis = |a: &str| ["x", "y", "z"].iter().position(|n| *n == a);
        let unknown = || wrong("not a number of this scene".to_string());
        match parts[..] {
            ["plane", i, what] => {
                let plane = i.parse().ok().and_then(|i: usize| planes.get_mut(i)).ok_or_else(unknown)?;
                let slot = ["height", "theta", "phi"].iter().position(|n| *n == what).ok_or_else(unknown)?;
                plane.get_or_insert([None; 3])[slot] = Some(*value);
            }
            ["mass", i, "mass"] => {
                let i: usize = i.parse().map_err(|_| unknown())?;
                set(row(doc, "mass", i).ok_or_else(unknown)?, "mass", Value::from(*value));
            }
            ["field", i, k] if region(scene, i, k).is_some() => {
                let (i, k) = region(scene, i, k).ok_or_else(unknown)?;
                let table = row(doc, "field", i).ok_or_else(unknown)?;
                set(entry(table, "regions", k).ok_or_else(unknown)?, "value", Value::from(*value));
            }
            // Values of cells and nodes go into a file, which `name_field_files` names.
            ["field", i] | ["field", i, _] if i.parse().is_ok_and(|i: usize| i < scene.fields.len()) => {}
            [rows @ ("effect" | "load" | "attach"), i, key] => {
                let i: usize = i.parse().map_err(|_| unknown())?;
                set(row(doc, rows, i).ok_or_else(unknown)?, key, Value::from(*value));
            }
            [rows @ ("effect" | "load" | "attach"), i, key, a] => {
                let (i, a) = (i.parse::<usize>().map_err(|_| unknown())?, axis(a).ok_or_else(unknown)?);
                let effect = scene.effects.iter().filter(|e| e.law().table() == rows).nth(i).ok_or_else(unknown)?;
                let slot = effect.law().params.iter().position(|p| p.key == key && p.axis == Some(0)).ok_or_else(unknown)?;
                let table = row(doc, rows, i).ok_or_else(unknown)?;
                if !table.contains_key(key) {
                    // Components that are not written keep what the scene means by leaving them out.
                    let known = |k: usize| values.iter().find(|(p, _)| *p == format!("{rows}.{i}.{key}.{}", ["x", "y", "z"][k]));
                    let before = |k: usize| effect.values[slot + k].or_else(|| known(k).map(|v| v.1));
                    let [Some(x), Some(y), Some(z)] = [0, 1, 2].map(before) else {
                        return Err(wrong("needs all three components".to_string()));
                    };
                    set(table, key, vector(DVec3::new(x, y, z)));
                }
                let array = table.get_mut(key).and_then(Item::as_array_mut).ok_or_else(unknown)?;
                replace(array.get_mut(a).ok_or_else(unknown)?, Value::from(*value));
            }
            [group @ ("world" | "initial"), name, a] => {
                let a = axis(a).ok_or_else(unknown)?;
                let before = match name {
                    "gravity" => scene.gravity,
                    "velocity" => scene.initial.velocity,
                    "angular_velocity" => scene.initial.angular_velocity,
                    _ => return Err(unknown()),
                };
                let table = section(doc, group).ok_or_else(unknown)?;
                if !table.contains_key(name) {
                    set(table, name, vector(before));
                }
                let array = table.get_mut(name).and_then(Item::as_array_mut).ok_or_else(unknown)?;
                replace(array.get_mut(a).ok_or_else(unknown)?, Value::from(*value));
            }
            ["material", inner @ "viscosity", name] => {
                let table = section(doc, "material").and_then(|t| t.get_mut(inner)?.as_table_like_mut());
                set(table.ok_or_else(unknown)?, name, Value::from(*value));
            }
            ["material", curve @ ("stretch_curve" | "volume_curve"), "factors", k] => {
                let table = section(doc, "material").and_then(|t| t.get_mut(curve)?.as_table_like_mut());
                let table = table.ok_or_else(unknown)?;
                if !table.contains_key("factors") {
                    let known = if curve == "stretch_curve" { &scene.curves.stretch } else { &scene.curves.volume };
                    set(table, "factors", Value::from(known.factors.iter().copied().collect::<Array>()));
                }
                let array = table.get_mut("factors").and_then(Item::as_array_mut).ok_or_else(unknown)?;
                let k: usize = k.parse().map_err(|_| unknown())?;
                replace(array.get_mut(k).ok_or_else(unknown)?, Value::from(*value));
            }
            [group @ ("material" | "time" | "object"), name] => {
                let table = section(doc, group).ok_or_else(unknown)?;
                match name {
                    "density" => drop(table.remove("mass")),
                    "mass" => drop(table.remove("density")),
                    _ => {}
                }
                set(table, name, Value::from(*value));
            }
            _ => return Err(unknown()),
        }
    }
    for (i, change) in planes.iter().enumerate() {
        let Some(change) = change else { continue };
        let (point, normal) = moved_plane(scene.planes[i].point, scene.planes[i].normal, *change);
        let missing = || InputError { key: format!("plane.{i}"), ..InputError::file(&scene.path, "not in the file") };
        let table = row(doc, "plane", i).ok_or_else(missing)?;
        set(table, "point", vector(point));
        set(table, "normal", vector(normal));
    }
    Ok(())
}

/// Lets the next fit start where this one ended: a `start` that is written becomes the value found. One that could not say it, of a field or
/// of a plane's angles (whose axis may be another now), goes, and the scene's own values are the start.
fn start_there(doc: &mut DocumentMut, values: &[(String, f64)]) {
    let Some(parameters) = doc.get_mut("fit").and_then(Item::as_table_like_mut) else { return };
    let found = |path: &str| values.iter().find(|(p, _)| p == path).map(|(_, v)| *v);
    let mut i = 0;
    while let Some(t) = entry(parameters, "parameter", i) {
        i += 1;
        let Some(path) = t.get("path").and_then(Item::as_str).map(str::to_string).filter(|_| t.contains_key("start")) else {
            continue;
        };
        let components: Option<Vec<f64>> = ["x", "y", "z"].iter().map(|a| found(&format!("{path}.{a}"))).collect();
        let says_it = !(path.starts_with("field.") || path.ends_with(".theta") || path.ends_with(".phi"));
        match (found(&path), components) {
            (Some(value), _) if says_it => set(t, "start", Value::from(value)),
            (None, Some(all)) => set(t, "start", Value::from(all.into_iter().collect::<Array>())),
            (None, None) if says_it => {}
            _ => drop(t.remove("start")),
        }
    }
}

/// The field and region that a path's numbers name, where there are such.
fn region(scene: &Scene, field: &str, place: &str) -> Option<(usize, usize)> {
    let (i, k) = (field.parse::<usize>().ok()?, place.parse::<usize>().ok()?);
    match &scene.fields.get(i)?.basis {
        Basis::Regions(regions, _) if k < regions.len() => Some((i, k)),
        _ => None,
    }
}

/// The text of a scene whose fields by cells or nodes read their values from other files: number of the field, file as seen from the
/// text's folder, and name of the array.
///
/// # Errors
/// A text that is no TOML or lacks the field.
pub fn name_field_files(text: &str, scene: &Scene, files: &[(usize, String, &str)]) -> Result<String, InputError> {
    let wrong = |key: String, message: String| InputError { key, ..InputError::file(&scene.path, message) };
    let mut doc = document(text, scene)?;
    for (i, file, array) in files {
        let table = row(&mut doc, "field", *i).ok_or_else(|| wrong(format!("field.{i}"), "not in the file".into()))?;
        set(table, "file", Value::from(file.as_str()));
        set(table, "array", Value::from(*array));
    }
    Ok(doc.to_string())
}

/// The text of a scene with effects appended to it, each with every value that it states.
///
/// # Errors
/// A text that is no TOML, or one that gives its effects as an inline array.
pub fn append_effects(text: &str, scene: &Scene, effects: &[Effect]) -> Result<String, InputError> {
    let wrong = |message: String| InputError { key: "effect".into(), ..InputError::file(&scene.path, message) };
    let mut doc: DocumentMut =
        text.parse().map_err(|e: toml_edit::TomlError| wrong(format!("not valid TOML: {}", e.message())))?;
    for effect in effects {
        let mut table = Table::new();
        table.insert("kind", toml_edit::value(effect.law().kind));
        for (slot, p) in effect.law().params.iter().enumerate() {
            match (effect.values[slot], p.axis) {
                (Some(v), None) => drop(table.insert(p.key, toml_edit::value(v))),
                (Some(x), Some(0)) => {
                    if let (Some(y), Some(z)) = (effect.values[slot + 1], effect.values[slot + 2]) {
                        table.insert(p.key, Item::Value(vector(DVec3::new(x, y, z))));
                    }
                }
                _ => {}
            }
        }
        let array = doc.as_table_mut().entry("effect").or_insert_with(|| Item::ArrayOfTables(Default::default()));
        let array = array.as_array_of_tables_mut();
        array.ok_or_else(|| wrong("must be written as [[effect]] tables to be extended".into()))?.push(table);
    }
    Ok(doc.to_string())
}

/// The text of a scene without what a motion is to be found for: keyframes, how to find it, and handles whose force is free.
///
/// # Errors
/// A text that is no TOML.
pub fn without_wishes(text: &str, scene: &Scene) -> Result<String, InputError> {
    let mut doc: DocumentMut = text
        .parse()
        .map_err(|e: toml_edit::TomlError| InputError::file(&scene.path, format!("not valid TOML: {}", e.message())))?;
    doc.remove("keyframe");
    doc.remove("synthesize");
    let left = match doc.get_mut("handle") {
        Some(Item::ArrayOfTables(all)) => {
            all.retain(|t| t.contains_key("path"));
            all.len()
        }
        Some(Item::Value(Value::Array(all))) => {
            all.retain(|t| t.as_inline_table().is_some_and(|t| t.contains_key("path")));
            all.len()
        }
        _ => 0,
    };
    if left == 0 {
        doc.remove("handle");
    }
    Ok(doc.to_string())
}

/// A plane's point and unit normal with a new height, θ or φ; the point moves as little as the new plane allows.
fn moved_plane(point: DVec3, normal: DVec3, [height, theta, phi]: [Option<f64>; 3]) -> (DVec3, DVec3) {
    let site = PlaneSite { polar_axis: PlaneSite::polar_axis_for(normal), stiffness: None };
    let (theta0, phi0) = site.angles(normal);
    let height = height.unwrap_or(point.dot(normal));
    let n = match (theta, phi) {
        (None, None) => normal,
        _ => site.normal(theta.unwrap_or(theta0), phi.unwrap_or(phi0))[0],
    };
    (point + n * (height - point.dot(n)), n)
}

pub(super) fn vector(v: DVec3) -> Value {
    Value::from(v.to_array().into_iter().collect::<Array>())
}

/// A table under a top-level key, made when absent.
pub(super) fn section<'a>(doc: &'a mut DocumentMut, key: &str) -> Option<&'a mut dyn TableLike> {
    doc.as_table_mut().entry(key).or_insert_with(|| Item::Table(Table::new())).as_table_like_mut()
}

/// Table `i` of a top-level array of tables.
fn row<'a>(doc: &'a mut DocumentMut, key: &str, i: usize) -> Option<&'a mut dyn TableLike> {
    entry(doc.as_table_mut(), key, i)
}

/// Table `i` of an array of tables.
fn entry<'a>(table: &'a mut dyn TableLike, key: &str, i: usize) -> Option<&'a mut dyn TableLike> {
    match table.get_mut(key)? {
        Item::ArrayOfTables(a) => a.get_mut(i).map(|t| t as &mut dyn TableLike),
        Item::Value(Value::Array(a)) => a.get_mut(i)?.as_inline_table_mut().map(|t| t as &mut dyn TableLike),
        _ => None,
    }
}

/// Replaces a value and keeps the blanks and comments around it.
fn replace(old: &mut Value, new: Value) {
    let decor = old.decor().clone();
    *old = new;
    *old.decor_mut() = decor;
}

pub(super) fn set(table: &mut dyn TableLike, key: &str, new: Value) {
    match table.get_mut(key).and_then(Item::as_value_mut) {
        Some(old) => replace(old, new),
        None => drop(table.insert(key, Item::Value(new))),
    }
}

/// Begins the note of a changed value.
const NOTE: &str = "fitted, was ";

/// Writes beside every value that differs from `before` what it was, in front of the comment that was written for the old one.
fn note_changes(table: &mut dyn TableLike, before: &dyn TableLike) {
    for (key, old) in before.iter() {
        match (table.get_mut(key), old) {
            (Some(Item::Value(new)), Item::Value(old)) => note_change(new, old),
            (Some(Item::Table(new)), Item::Table(old)) => note_changes(new, old),
            (Some(Item::ArrayOfTables(new)), Item::ArrayOfTables(old)) => {
                new.iter_mut().zip(old.iter()).for_each(|(new, old)| note_changes(new, old));
            }
            _ => {}
        }
    }
}

fn note_change(new: &mut Value, old: &Value) {
    let bare = |v: &Value| v.clone().decorated("", "").to_string();
    let was = bare(old);
    // An array over several lines has no room for a note.
    if bare(new) == was || was.contains('\n') {
        return;
    }
    let suffix = old.decor().suffix().and_then(|s| s.as_str()).unwrap_or("").trim().trim_start_matches('#').trim_start();
    // A value that is fitted again does not pile up notes.
    let comment = match suffix.strip_prefix(NOTE) {
        Some(note) => note.split_once(": ").map_or("", |(_, comment)| comment),
        None => suffix,
    };
    let colon = if comment.is_empty() { "" } else { ": " };
    new.decor_mut().set_suffix(format!("   # {NOTE}{was}{colon}{comment}"));
}

/// Rewrites the paths in a scene that lies in `from` so that they hold from `to`.
pub(super) fn rebase(doc: &mut DocumentMut, from: &Path, to: &Path) {
    let fix = |table: &mut dyn TableLike, key: &str| {
        if let Some(Value::String(s)) = table.get_mut(key).and_then(Item::as_value_mut)
            && Path::new(s.value()).is_relative()
            // The points of the recording, not a file.
            && (key, s.value().as_str()) != ("track", "recording")
        {
            let path = relative(&absolute(&from.join(s.value())), &absolute(to));
            replace(table.get_mut(key).and_then(Item::as_value_mut).expect("the key was just read"), Value::from(path));
        }
    };
    if let Some(t) = doc.get_mut("object").and_then(Item::as_table_like_mut) {
        fix(t, "mesh");
        fix(t, "volume_mesh");
        fix(t, "points");
    }
    if let Some(t) = doc.get_mut("observation").and_then(Item::as_table_like_mut) {
        fix(t, "recording");
    }
    for (rows, key) in FILES {
        let mut i = 0;
        while let Some(t) = row(doc, rows, i) {
            fix(t, key);
            i += 1;
        }
    }
}

/// Keys of tables that name files; one in an archive is named `file.npz:array`.
const FILES: [(&str, &str); 14] = [
    ("clamp", "motion"),
    ("field", "file"),
    ("target", "file"),
    ("effect", "path"),
    ("handle", "path"),
    ("load", "forces"),
    ("load", "total"),
    ("load", "index"),
    ("load", "places"),
    ("load", "times"),
    ("attach", "points"),
    ("attach", "places"),
    ("attach", "track"),
    ("attach", "times"),
];

/// The absolute path without links, `.` and `..`, as far as the file system knows it.
fn absolute(path: &Path) -> PathBuf {
    if let Ok(p) = path.canonicalize() {
        return p;
    }
    // The output folder may not exist yet: resolve what does.
    match (path.parent(), path.file_name()) {
        (Some(parent), Some(name)) if !parent.as_os_str().is_empty() => absolute(parent).join(name),
        _ => std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf()),
    }
}

/// `path` as seen from `folder`, both absolute, with forward slashes.
fn relative(path: &Path, folder: &Path) -> String {
    let a: Vec<Component> = path.components().collect();
    let b: Vec<Component> = folder.components().collect();
    let common = a.iter().zip(&b).take_while(|(x, y)| x == y).count();
    if common == 0 {
        return path.to_string_lossy().into_owned();
    }
    let up = std::iter::repeat_n("..".to_string(), b.len() - common);
    let down = a[common..].iter().map(|c| c.as_os_str().to_string_lossy().into_owned());
    let parts: Vec<String> = up.chain(down).collect();
    if parts.is_empty() { ".".to_string() } else { parts.join("/") }
}
