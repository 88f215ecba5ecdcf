//! A scene with another field of regions, and with other numbers free.

use super::write::{document, rebase, vector};
use crate::error::InputError;
use palpate_model::params::fields::{Basis, FieldSpec, Scale};
use palpate_model::scene::Scene;
use std::path::Path;
use toml_edit::{Array, ArrayOfTables, InlineTable, Item, Table, Value};

/// The text of `scene` with `spec`, a field of regions, as field number `number`, or as one more behind the last; the numbers of [fit] that `bound`
/// names are free no more, and the values of the regions are. What else there is stays.
///
/// # Errors
/// A text that is no TOML; fields or free numbers that are no arrays.
pub fn scene_with_regions(
    text: &str,
    scene: &Scene,
    number: usize,
    spec: &FieldSpec,
    bound: impl Fn(&str) -> bool,
) -> Result<String, InputError> {
    let wrong = |key: &str, message: String| InputError { key: key.into(), ..InputError::file(&scene.path, message) };
    let mut doc = document(text, scene)?;
    let Basis::Regions(regions, blend) = &spec.basis else {
        return Err(wrong("field", "has no regions".into()));
    };
    let mut all = Array::new();
    for r in regions {
        let mut region = InlineTable::from_iter([("center", vector(r.center))]);
        region.insert("radius", r.radius.into());
        region.insert("value", r.value.into());
        let mut region = Value::InlineTable(region);
        region.decor_mut().set_prefix("\n  ");
        all.push_formatted(region);
    }
    all.set_trailing("\n");
    let names = [
        ("path", spec.varied.path()),
        ("basis", "regions"),
        ("blend", blend.name()),
        ("scale", if spec.scale == Scale::Log { "log" } else { "linear" }),
    ];
    let entries = names.into_iter().map(|(key, value)| (key, Value::from(value))).chain([("regions", Value::Array(all))]);
    put_row(doc.as_table_mut(), "field", number, entries.collect())
        .ok_or_else(|| wrong("field", "is no array of tables".into()))?;
    let fit = doc.get_mut("fit").and_then(Item::as_table_like_mut).ok_or_else(|| wrong("fit", "is missing".into()))?;
    let path_of = |t: &dyn toml_edit::TableLike| t.get("path").and_then(Item::as_str).unwrap_or_default().to_string();
    match fit.get_mut("parameter") {
        Some(Item::ArrayOfTables(rows)) => rows.retain(|t| !bound(&path_of(t))),
        Some(Item::Value(Value::Array(rows))) => rows.retain(|t| t.as_inline_table().is_none_or(|t| !bound(&path_of(t)))),
        _ => {}
    }
    for k in 0..regions.len() {
        let free = vec![("path", Value::from(format!("field.{number}.{k}")))];
        put_row(fit, "parameter", usize::MAX, free).ok_or_else(|| wrong("fit.parameter", "is no array of tables".into()))?;
    }
    Ok(doc.to_string())
}

/// The text of `scene` as somebody would write it in `folder`: relative paths hold from there.
///
/// # Errors
/// A text that is no TOML.
pub fn scene_in(text: &str, scene: &Scene, folder: &Path) -> Result<String, InputError> {
    let mut doc = document(text, scene)?;
    rebase(&mut doc, scene.path.parent().unwrap_or(Path::new("")), folder);
    Ok(doc.to_string())
}

/// Puts a row into an array of tables, of either notation, in place of row `number` or behind the last.
fn put_row(table: &mut dyn toml_edit::TableLike, key: &str, number: usize, entries: Vec<(&str, Value)>) -> Option<()> {
    let array = table.entry(key).or_insert_with(|| Item::ArrayOfTables(ArrayOfTables::new()));
    match array {
        Item::ArrayOfTables(rows) => {
            let new: Table = entries.into_iter().map(|(k, v)| (k, Item::Value(v))).collect();
            match rows.get_mut(number) {
                Some(old) => *old = new,
                None => rows.push(new),
            }
        }
        Item::Value(Value::Array(rows)) => {
            let new = Value::InlineTable(InlineTable::from_iter(entries));
            match rows.get_mut(number) {
                Some(old) => *old = new,
                None => rows.push(new),
            }
        }
        _ => return None,
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::parse_scene;
    use glam::DVec3;
    use palpate_model::params::fields::{Blend, Region, Varied};

    const SCENE: &str = "format = \"scene/1\"\ntitle = \"Bar\" # mine\n\n[object]\nshape = { box = { min = [0, 0, 0], max = [0.2, 0.04, 0.04] } }\n\
        cell_size = 0.02\n\n[material]\ndensity = 1000.0\nyoungs_modulus = 5e4\npoisson_ratio = 0.3\nstiffness_damping = 0.001\n\n\
        [time]\nstep = 0.01\nduration = 0.1\n\n";

    fn spec(values: &[f64]) -> FieldSpec {
        let region = |(k, value): (usize, &f64)| Region {
            center: DVec3::new(0.02 + 0.05 * k as f64, 0.02, 0.02),
            radius: 0.02,
            value: *value,
        };
        let basis = Basis::Regions(values.iter().enumerate().map(region).collect(), Blend::Nearest);
        FieldSpec { varied: Varied::Modulus, basis, scale: Scale::Log, values: None, prior: None }
    }

    #[test]
    fn a_field_joins_is_replaced_and_its_values_are_free_instead_of_the_number() {
        let rows =
            "[[fit.parameter]]\npath = \"material.youngs_modulus\"\n\n[[fit.parameter]]\npath = \"material.stiffness_damping\"\n";
        let inline = "[fit]\nparameter = [{ path = \"material.youngs_modulus\" }, { path = \"material.stiffness_damping\" }]\n";
        for fit in [rows, inline] {
            let text = format!("{SCENE}{fit}");
            let scene = parse_scene(&text, "scene.toml").unwrap().value;
            let two = scene_with_regions(&text, &scene, 0, &spec(&[0.5, 2.0]), |p| p == "material.youngs_modulus").unwrap();
            assert!(two.contains("# mine"), "{two}");
            let read = parse_scene(&two, "scene.toml").unwrap_or_else(|e| panic!("{e}\n{two}")).value;
            let free = |s: &Scene| s.fit.iter().flat_map(|f| f.parameters.iter().map(|p| p.path.clone())).collect::<Vec<_>>();
            assert_eq!(free(&read), ["material.stiffness_damping", "field.0.0", "field.0.1"]);
            assert_eq!(read.fields, [spec(&[0.5, 2.0])]);
            let own = |p: &str| p.starts_with("field.0.");
            let three = scene_with_regions(&two, &read, 0, &spec(&[0.5, 2.0, 3.0]), own).unwrap();
            let read = parse_scene(&three, "scene.toml").unwrap_or_else(|e| panic!("{e}\n{three}")).value;
            assert_eq!((free(&read).len(), read.fields), (4, vec![spec(&[0.5, 2.0, 3.0])]));
        }
    }
}
