//! `[[field]]`: numbers that vary over the body, by cells, nodes or regions.

use crate::document::Table;
use crate::error::{InputError, number};
use crate::npy::read_array;
use crate::vtk::read_vtu_array;
use palpate_model::params::fields::{Basis, Blend, FieldSpec, Prior, PriorKind, Region, Scale, Varied};
use std::path::Path;

/// Every field of a scene, in the order of the file. `of_points`: of a body of points.
pub(super) fn fields(root: &Table, of_points: bool) -> Result<Vec<FieldSpec>, InputError> {
    root.tables("field")?.iter().map(|t| field(t, of_points)).collect()
}

/// The bases by name.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Cells,
    Nodes,
    Points,
    Regions,
}

fn field(t: &Table, of_points: bool) -> Result<FieldSpec, InputError> {
    let paths = Varied::ALL.map(|v| (v.0, v.1));
    let allowed = || paths.map(|p| format!("\"{}\"", p.0)).join(" or ");
    let varied = t.optional_choice("path", &paths)?.ok_or_else(|| t.missing("path", &allowed()))?;
    let kinds = [("cells", Kind::Cells), ("nodes", Kind::Nodes), ("points", Kind::Points), ("regions", Kind::Regions)];
    let kind = t
        .optional_choice("basis", &kinds)?
        .ok_or_else(|| t.missing("basis", "\"cells\", \"nodes\", \"points\" or \"regions\""))?;
    match (kind, of_points) {
        (Kind::Points, false) => {
            return Err(
                t.error("basis", "\"points\" belongs to bodies of points (object.discretisation); give \"cells\" or \"nodes\"")
            );
        }
        (Kind::Cells | Kind::Nodes, true) => {
            return Err(t.error("basis", "must be \"points\" or \"regions\" on a body of points"));
        }
        _ => {}
    }
    let scales = [("log", Scale::Log), ("linear", Scale::Linear)];
    let scale = t.optional_choice("scale", &scales)?.unwrap_or(Scale::Log);
    let (with_regions, without): (&[&str], &[&str]) = (&["regions", "blend"], &["file", "array"]);
    let (foreign, belongs) = match kind {
        Kind::Regions => (without, "basis = \"cells\", \"nodes\" or \"points\"; regions state their own value"),
        _ => (with_regions, "basis = \"regions\""),
    };
    if let Some(key) = foreign.iter().find(|k| t.has(k)) {
        return Err(t.error(key, format!("belongs to {belongs}")));
    }
    let basis = match kind {
        Kind::Cells => Basis::Cells,
        Kind::Nodes => Basis::Nodes,
        Kind::Points => Basis::Points,
        Kind::Regions => {
            let blend = t.optional_choice("blend", &Blend::ALL)?.unwrap_or(Blend::Harmonic);
            Basis::Regions(regions(t, blend)?, blend)
        }
    };
    let values = values(t, kind)?;
    let prior = prior(t, kind)?;
    Ok(FieldSpec { varied, basis, scale, values, prior })
}

/// What is expected of the values, if anything.
fn prior(t: &Table, kind: Kind) -> Result<Option<Prior>, InputError> {
    let Some(p) = t.optional_table("prior")? else { return Ok(None) };
    if kind == Kind::Regions {
        let message = "belongs to basis = \"cells\", \"nodes\" or \"points\"; what is known of a region is said by known = [value, sd] in its [[fit.parameter]]";
        return Err(t.error("prior", message));
    }
    let names = PriorKind::ALL.map(|(name, _)| format!("\"{name}\"")).join(" or ");
    let kind = p.optional_choice("kind", &PriorKind::ALL)?.ok_or_else(|| p.missing("kind", &names))?;
    if kind == PriorKind::EdgePreserving && p.has("length") {
        return Err(p.error("length", "belongs to kind = \"matern\"; an edge-preserving prior knows steps, not lengths"));
    }
    let auto_or = |key: &str, unit: &str| {
        let allowed = format!("is not allowed: must be \"auto\" or a number > 0{unit}");
        match p.optional_str(key) {
            Ok(None | Some("auto")) => Ok(None),
            Ok(Some(other)) => Err(p.error(key, format!("\"{other}\" {allowed}"))),
            Err(_) => p.f64_where(key, |x| x > 0.0, &allowed),
        }
    };
    Ok(Some(Prior { kind, length: auto_or("length", " (m)")?, deviation: auto_or("deviation", " (of the logarithm)")? }))
}

fn regions(t: &Table, blend: Blend) -> Result<Vec<Region>, InputError> {
    let wanted = "regions = [{ center = [x, y, z], radius = r, value = v }, …]";
    let mut regions: Vec<Region> = Vec::new();
    for r in t.tables("regions")? {
        let radius = r.f64_where("radius", |x| x > 0.0, "is not allowed: must be > 0 (m)")?;
        let value = r.f64_where("value", |x| x > 0.0, "is not allowed: a factor must be > 0 (1 = unchanged)")?;
        let region = Region {
            center: r.vec3("center")?,
            radius: radius.ok_or_else(|| r.missing("radius", "a number > 0 (m)"))?,
            value: value.unwrap_or(1.0),
        };
        if let (Blend::Axis, Some(last)) = (blend, regions.last())
            && last.center == region.center
        {
            return Err(r.error("center", "is that of the region before; blend = \"axis\" needs a way from one to the next"));
        }
        regions.push(region);
    }
    if regions.is_empty() { Err(t.missing("regions", wanted)) } else { Ok(regions) }
}

/// Values from the field's file, if it names one.
fn values(t: &Table, kind: Kind) -> Result<Option<Vec<f64>>, InputError> {
    let array = t.optional_str("array")?;
    let Some(file) = t.optional_file("file")? else {
        return if array.is_some() { Err(t.error("array", "names an array of file, which is missing")) } else { Ok(None) };
    };
    let values = read(t, &file, array, kind)?;
    match values.iter().position(|v| !(v.is_finite() && *v > 0.0)) {
        Some(k) => Err(t.error(
            "file",
            format!("{}: value {k} is {}; a factor must be > 0 (1 = unchanged)", file.display(), number(values[k])),
        )),
        None => Ok(Some(values)),
    }
}

fn read(t: &Table, file: &Path, array: Option<&str>, kind: Kind) -> Result<Vec<f64>, InputError> {
    let extension = file.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("npy" | "npz") => {
            let found = read_array(file, array)?;
            match found.shape[..] {
                [_] => Ok(found.values),
                _ => Err(t.error("file", format!("{}: has shape {}; expected one axis", file.display(), found.shape_text()))),
            }
        }
        // Points are cells of a grid of vertices as well.
        Some("vtu") if kind == Kind::Points => read_vtu_array(file, array, true).or_else(|_| read_vtu_array(file, array, false)),
        Some("vtu") => read_vtu_array(file, array, kind == Kind::Cells),
        _ => Err(t.error("file", format!("{}: is not an .npy, .npz or .vtu file", file.display()))),
    }
}
