//! A scene as the template of another one.

use super::write::{document, rebase, section, set};
use crate::error::InputError;
use palpate_model::scene::{Resolution, Scene};
use std::path::Path;
use toml_edit::{Array, DocumentMut, InlineTable, Item, Value};

/// The text of `scene` with another grid and another recording, readable from `folder`: its `[observation]`, targets and `[fit]` give way to a recording
/// of tracked points at `recording` (relative to `folder`) and a fit of the numbers at `free`, from the scene's own values.
///
/// # Errors
/// A template that is no TOML.
pub fn recast_scene(
    template: &str,
    scene: &Scene,
    resolution: Resolution,
    recording: &str,
    free: &[String],
    folder: &Path,
) -> Result<String, InputError> {
    let mut doc = document(template, scene)?;
    for key in ["observation", "target", "fit"] {
        doc.remove(key);
    }
    let wrong = |key: &str| InputError { key: key.into(), ..InputError::file(&scene.path, "must be a table") };
    let object = section(&mut doc, "object").ok_or_else(|| wrong("object"))?;
    let (cells, tetrahedra) = (&["cell_size", "cells"][..], &["edge_length", "discretisation"][..]);
    let (without, with): (&[&[&str]], Vec<(&str, Value)>) = match resolution {
        Resolution::CellSize(h) => (&[cells, tetrahedra], vec![("cell_size", h.into())]),
        Resolution::Cells(n) => (&[cells, tetrahedra], vec![("cells", i64::from(n).into())]),
        Resolution::Edge(h) => (&[cells], vec![("discretisation", "tetrahedra".into()), ("edge_length", h.into())]),
        Resolution::Own | Resolution::Open | Resolution::OpenEdge => (&[], Vec::new()),
    };
    without.iter().flat_map(|keys| *keys).for_each(|key| drop(object.remove(key)));
    with.into_iter().for_each(|(key, value)| set(object, key, value));
    rebase(&mut doc, scene.path.parent().unwrap_or(Path::new("")), folder);
    compare_with(&mut doc, scene, recording)?;
    let parameters: Array = free.iter().map(|p| Value::InlineTable(InlineTable::from_iter([("path", p.as_str())]))).collect();
    let fit = section(&mut doc, "fit").ok_or_else(|| wrong("fit"))?;
    fit.insert("parameter", Item::Value(Value::Array(parameters)));
    Ok(doc.to_string())
}

/// The text of `scene` with another recording, readable from `folder`: its `[observation]` gives way to tracked points at `recording` (relative to
/// `folder`). All else stays.
///
/// # Errors
/// A template that is no TOML.
pub fn scene_of_tracks(template: &str, scene: &Scene, recording: &str, folder: &Path) -> Result<String, InputError> {
    let mut doc = document(template, scene)?;
    doc.remove("observation");
    rebase(&mut doc, scene.path.parent().unwrap_or(Path::new("")), folder);
    compare_with(&mut doc, scene, recording)?;
    Ok(doc.to_string())
}

fn compare_with(doc: &mut DocumentMut, scene: &Scene, recording: &str) -> Result<(), InputError> {
    let wrong = || InputError { key: "observation".into(), ..InputError::file(&scene.path, "must be a table") };
    let observation = section(doc, "observation").ok_or_else(wrong)?;
    set(observation, "recording", Value::from(recording));
    set(observation, "cost", Value::from("points"));
    Ok(())
}
