//! `[object] points`: a body from a cloud of points that fills it.

use super::{closed, pose, resolution};
use crate::cloud::{ENDINGS, ending, read_cloud};
use crate::document::Table;
use crate::error::{InputError, number};
use crate::mesh::{LARGEST_SIDE, bounds};
use crate::npy::read_array;
use glam::DVec3;
use palpate_model::scene::{BodySource, Cloud, Object, Resolution};
use palpate_model::shape::cloud::around;
use palpate_model::space::stars::graph::MOST;
use palpate_model::space::stars::{StarSpec, Weights, check};
use std::path::Path;

/// Keys of stars alone.
const STARS: [&str; 3] = ["neighbours", "weights", "residual_penalty"];

/// Refuses keys of clouds beside another source.
pub(super) fn refuse_keys(t: &Table) -> Result<(), InputError> {
    match STARS.iter().chain(&["volume"]).find(|k| t.has(k)) {
        Some(key) => Err(t.error(key, "belongs to bodies of object.points".to_string())),
        None => Ok(()),
    }
}

/// The body: cells within a surface around the points, or the points themselves.
pub(super) fn object(t: &Table, warnings: &mut Vec<String>) -> Result<Object, InputError> {
    let Some(path) = t.optional_file("points")? else { return Err(t.missing("points", "a file of points")) };
    if t.has("volume_mesh") {
        return Err(t.error("volume_mesh", "points and volume_mesh exclude each other; give one".to_string()));
    }
    let own = t.optional_str("discretisation")? == Some("points");
    if let Some(key) = STARS.iter().find(|k| t.has(k)).filter(|_| !own) {
        return Err(t.error(key, "belongs to discretisation = \"points\"".to_string()));
    }
    let points = read_points(&path)?;
    check(&points).map_err(|message| InputError::file(&path, message))?;
    let (min, max) = bounds(&points);
    let longest = (max - min).max_element();
    if longest > LARGEST_SIDE {
        let text = format!("its longest side is {} m; in millimetres? lengths are in metres: scale by 0.001", number(longest));
        return Err(t.error("points", text));
    }
    let volume = t.f64_where("volume", |v| v > 0.0, "is not allowed: must be > 0 (m³)")?;
    let stated = closed(t, warnings)?;
    let hull = match (stated, volume) {
        (Some(_), Some(_)) => {
            return Err(t.error("volume", "is that of the mesh or shape beside the points; leave it out".to_string()));
        }
        (Some((hull, _)), None) => hull,
        (None, volume) => {
            let key = if volume.is_some() { "volume" } else { "points" };
            let mesh = around(&points, volume).map_err(|message| t.error(key, format!("the points {message}")))?;
            BodySource::Mesh { path: path.clone(), mesh, open_edges: 0 }
        }
    };
    if !own {
        return Ok(Object { source: hull, pose: pose(t)?, resolution: resolution(t, longest)? });
    }
    if let Some(key) = ["cell_size", "cells", "edge_length"].iter().find(|k| t.has(k)) {
        let text =
            "belongs to bodies of cells or tetrahedra; with discretisation = \"points\" the points say how fine the body is";
        return Err(t.error(key, text.to_string()));
    }
    let stars = stars(t, points.len())?;
    let source = BodySource::Cloud(Box::new(Cloud { path, points, hull, stars }));
    Ok(Object { source, pose: pose(t)?, resolution: Resolution::Own })
}

fn stars(t: &Table, points: usize) -> Result<StarSpec, InputError> {
    let default = StarSpec::default();
    let neighbours = t.optional_count("neighbours", 4..=MOST as u64)?.map_or(default.neighbours, |n| n as usize);
    if neighbours >= points {
        let text = format!("{neighbours} of {points} points; a point has at most all others");
        return Err(t.error("neighbours", text));
    }
    let weights = t.optional_choice("weights", &[("compatible", Weights::Compatible), ("published", Weights::Published)])?;
    let penalty = t.f64_where("residual_penalty", |x| (0.0..=10.0).contains(&x), "is not allowed: must lie in [0, 10]")?;
    Ok(StarSpec {
        neighbours,
        weights: weights.unwrap_or(default.weights),
        residual_penalty: penalty.unwrap_or(default.residual_penalty),
    })
}

/// The points of a file [m].
fn read_points(path: &Path) -> Result<Vec<DVec3>, InputError> {
    let end = ending(path);
    if ENDINGS.contains(&end.as_str()) {
        return Ok(read_cloud(path)?.points);
    }
    if !["npy", "npz"].contains(&end.as_str()) {
        let text = format!("\".{end}\" is no format of points that is read; allowed: .npy, .npz, .ply, .pcd");
        return Err(InputError::file(path, text));
    }
    let array = read_array(path, None)?;
    match array.shape[..] {
        [_, 3] => Ok(array.values.chunks_exact(3).map(DVec3::from_slice).collect()),
        _ => {
            Err(InputError::file(path, format!("has shape {}, expected (N, 3): x, y, z of every point [m]", array.shape_text())))
        }
    }
}

#[cfg(test)]
#[path = "points_tests.rs"]
mod tests;
