//! `[object]`: the shape.

mod points;

use super::corners;
use crate::document::Table;
use crate::error::{InputError, number};
use crate::mesh::{LARGEST_SIDE, read_repaired, read_tets};
use crate::rigid::rigid;
use glam::{DAffine3, DVec3};
use palpate_model::scene::{Analytic, BodySource, Object, Resolution};
use palpate_model::shape::Repaired;
use palpate_model::shape::unit_hint;
use std::path::PathBuf;

pub(super) fn object(root: &Table, warnings: &mut Vec<String>) -> Result<Object, InputError> {
    let t = root.optional_table("object")?.ok_or_else(|| root.missing("object", "a table [object] with mesh or shape"))?;
    if t.has("points") {
        return points::object(&t, warnings);
    }
    points::refuse_keys(&t)?;
    let sources = ["mesh", "shape", "volume_mesh"];
    if let [first, second, ..] = sources.into_iter().filter(|k| t.has(k)).collect::<Vec<_>>()[..] {
        return Err(t.error(second, format!("{first} and {second} exclude each other; give one")));
    }
    if let Some(path) = t.optional_file("volume_mesh")? {
        return tetrahedra(&t, path, warnings);
    }
    let Some((body, extent)) = closed(&t, warnings)? else {
        return Err(t.missing("mesh", "mesh = \"FILE\" or shape = { … }"));
    };
    Ok(Object { source: body, pose: pose(&t)?, resolution: resolution(&t, extent.max_element())? })
}

/// A rigid placement.
fn pose(t: &Table) -> Result<DAffine3, InputError> {
    match t.optional_matrix4("pose")? {
        None => Ok(DAffine3::IDENTITY),
        Some(m) => rigid(m).map_err(|e| t.error("pose", e)),
    }
}

/// The closed surface that a table states, and the sides of a box around it.
fn closed(t: &Table, warnings: &mut Vec<String>) -> Result<Option<(BodySource, DVec3)>, InputError> {
    Ok(Some(match (t.optional_file("mesh")?, t.optional_table("shape")?) {
        (None, None) => return Ok(None),
        (Some(path), _) => {
            let loaded = read_repaired(&path)?;
            warnings.extend(loaded.warnings);
            let Repaired { mesh, open_edges, .. } = loaded.value;
            let (min, max) = crate::mesh::bounds(&mesh.vertices);
            (BodySource::Mesh { path, mesh, open_edges }, max - min)
        }
        (None, Some(shape)) => {
            let analytic = analytic(&shape)?;
            let extent = extent(&analytic);
            if extent.max_element() > LARGEST_SIDE {
                return Err(t.error(
                    "shape",
                    format!(
                        "its longest side is {} m; in millimetres? lengths are in metres: scale by 0.001",
                        number(extent.max_element())
                    ),
                ));
            }
            (BodySource::Analytic(analytic), extent)
        }
    }))
}

/// True where the shape is the equilibrium that the motion starts from; else it is free of stress.
pub(super) fn is_given(root: &Table) -> Result<bool, InputError> {
    let t = root.optional_table("object")?;
    Ok(t.map(|t| t.optional_choice("state", &[("rest", false), ("static", true)])).transpose()?.flatten().unwrap_or(false))
}

/// Cells or tetrahedra, and how fine.
fn resolution(t: &Table, longest: f64) -> Result<Resolution, InputError> {
    let own = "points";
    if t.optional_str("discretisation")? == Some(own) && !t.has("points") {
        return Err(t.error("discretisation", "\"points\" is that of a cloud: give points = \"FILE\""));
    }
    let made = t.optional_choice("discretisation", &[("cells", false), ("tetrahedra", true)])?.unwrap_or(false);
    let (length, others) = if made { ("edge_length", &["cell_size", "cells"][..]) } else { ("cell_size", &["edge_length"][..]) };
    if let Some(key) = others.iter().find(|k| t.has(k)) {
        let (of, say) = if made { ("cells", "edge_length") } else { ("tetrahedra", "cell_size or cells") };
        let message = format!("belongs to discretisation = \"{of}\"; give {say}, or leave it to be chosen");
        return Err(t.error(key, message));
    }
    let h = t.f64_where(length, |x| x > 0.0, "is not allowed: must be > 0 (m)")?;
    match (h, t.optional_count("cells", 1..=4096)?) {
        (Some(_), Some(_)) => Err(t.error("cells", "cell_size and cells exclude each other; give one")),
        (None, None) if made => Ok(Resolution::OpenEdge),
        (None, None) => Ok(Resolution::Open),
        (None, Some(n)) => Ok(Resolution::Cells(n as u32)),
        (Some(h), None) if h > longest => {
            Err(t.error(length, format!("{} m is larger than the object, whose longest side is {longest:.4} m", number(h))))
        }
        (Some(h), None) if longest / h > 4096.0 => Err(t.error(
            length,
            format!(
                "{} m makes {} {} along the longest side of {} m, at most 4096 are allowed{}",
                number(h),
                number((longest / h).round()),
                if made { "edges" } else { "cells" },
                number(longest),
                unit_hint(longest)
            ),
        )),
        (Some(h), None) if made => Ok(Resolution::Edge(h)),
        (Some(h), None) => Ok(Resolution::CellSize(h)),
    }
}

/// A body of a volume mesh's own tetrahedra.
fn tetrahedra(t: &Table, path: PathBuf, warnings: &mut Vec<String>) -> Result<Object, InputError> {
    for (key, of) in [
        ("cell_size", "bodies that are cut out of a lattice"),
        ("cells", "bodies that are cut out of a lattice"),
        ("discretisation", "bodies of a mesh, shape or points"),
        ("edge_length", "bodies whose tetrahedra are made here"),
    ] {
        if t.has(key) {
            return Err(t.error(key, format!("belongs to {of}; a volume mesh has its own elements")));
        }
    }
    let loaded = read_tets(&path)?;
    warnings.extend(loaded.warnings);
    let mesh = loaded.value;
    let surface = mesh.surface();
    Ok(Object { source: BodySource::Tetrahedra { path, mesh, surface }, pose: pose(t)?, resolution: Resolution::Own })
}

fn analytic(shape: &Table) -> Result<Analytic, InputError> {
    const KINDS: &str = "one of ball, torus, box, cylinder";
    let names = shape.names();
    let [name] = names[..] else {
        return Err(shape.own_error(format!("expected exactly {KINDS}, found {}", names.len())));
    };
    let t = shape.optional_table(name)?.ok_or_else(|| shape.missing(name, KINDS))?;
    let length = |key: &str| {
        t.f64_where(key, |x| x > 0.0, "is not allowed: must be > 0 (m)")?.ok_or_else(|| t.missing(key, "a number > 0 (m)"))
    };
    let center = || Ok::<_, InputError>(t.optional_vec3("center")?.unwrap_or(DVec3::ZERO));
    let axis = || match t.optional_vec3("axis")? {
        None => Ok(DVec3::Z),
        Some(a) if a.length() < 1e-12 => Err(t.error("axis", "has no length")),
        Some(a) => Ok(a),
    };
    Ok(match name {
        "ball" => Analytic::Ball { radius: length("radius")?, center: center()? },
        "torus" => {
            let (major, minor) = (length("major")?, length("minor")?);
            if minor >= major {
                return Err(t.error(
                    "minor",
                    format!("{} must be smaller than major = {}, or the torus has no hole", number(minor), number(major)),
                ));
            }
            Analytic::Torus { major, minor, center: center()?, axis: axis()? }
        }
        "box" => {
            let (min, max) = corners(&t)?;
            Analytic::Box { min, max }
        }
        "cylinder" => {
            Analytic::Cylinder { radius: length("radius")?, height: length("height")?, center: center()?, axis: axis()? }
        }
        _ => return Err(shape.error(name, format!("unknown shape; expected {KINDS}"))),
    })
}

/// Sides of a box that holds the shape whatever its axis [m]; the shape's own longest side is the largest of them.
pub(super) fn extent(shape: &Analytic) -> DVec3 {
    match *shape {
        Analytic::Ball { radius, .. } => DVec3::splat(2.0 * radius),
        Analytic::Torus { major, minor, .. } => DVec3::splat(2.0 * (major + minor)),
        Analytic::Box { min, max } => max - min,
        Analytic::Cylinder { radius, height, .. } => DVec3::new(2.0 * radius, 2.0 * radius, height),
    }
}
