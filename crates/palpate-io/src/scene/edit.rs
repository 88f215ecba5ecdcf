//! A scene with some of its keys changed, as `--edit KEY=VALUE` asks for.

use crate::error::InputError;
use crate::keys::{SCENE, Schema, suggest};
use std::path::Path;
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, Value};

/// The text of a scene with `edits` made, one after the other. An edit is `KEY=VALUE`: a dotted key of the scene, rows of arrays by their
/// number, and a TOML value; a plain word is taken for a string. A key of one table alone needs no table before it (`gravity` is
/// `world.gravity`). The number after the last row of an array adds a row, whose value is a table. `path` is the scene's file, for messages.
///
/// # Errors
/// A text or value that is no TOML, a key that no scene has (with the nearest one), a row that is not there. What the values mean is
/// checked when the scene is read.
pub fn edit_scene(text: &str, path: &Path, edits: &[String]) -> Result<String, InputError> {
    let mut doc: DocumentMut =
        text.parse().map_err(|e: toml_edit::TomlError| InputError::file(path, format!("not valid TOML: {}", e.message())))?;
    for edit in edits {
        let wrong = |key: &str, message: String| InputError { key: key.into(), ..InputError::file(path, message) };
        let Some((key, text)) = edit.split_once('=').map(|(k, v)| (k.trim(), v.trim())) else {
            let message = "--edit needs a key and a value, like material.youngs_modulus=2e4".to_string();
            return Err(wrong(edit, message));
        };
        let value = value(text).ok_or_else(|| wrong(key, format!("--edit: \"{text}\" is not a TOML value")))?;
        let parts = whole_key(key).map_err(|m| wrong(key, format!("--edit: {m}")))?;
        put(doc.as_item_mut(), &parts, value).map_err(|m| wrong(key, format!("--edit: {m}")))?;
    }
    Ok(doc.to_string())
}

/// A TOML value, or a plain word as a string.
fn value(text: &str) -> Option<Value> {
    if let Ok(value) = text.parse::<Value>() {
        return Some(value);
    }
    let plain = |c: char| c.is_alphanumeric() || "-_./".contains(c);
    (!text.is_empty() && text.chars().all(plain)).then(|| Value::from(text))
}

/// The parts of a key, with the table that a lone one belongs to; every name is one that scenes have.
fn whole_key(key: &str) -> Result<Vec<String>, String> {
    let mut parts: Vec<String> = key.split('.').map(str::to_string).collect();
    if let [name] = &parts[..]
        && !SCENE.keys.contains(&name.as_str())
        && SCENE.child(name).is_none()
    {
        let homes: Vec<&str> = SCENE.tables.iter().filter(|(_, s)| s.keys.contains(&name.as_str())).map(|(t, _)| *t).collect();
        match homes[..] {
            [home] => parts.insert(0, home.to_string()),
            [] => {
                let known: Vec<&str> =
                    SCENE.tables.iter().flat_map(|(t, s)| [*t].into_iter().chain(s.keys.iter().copied())).collect();
                return Err(format!("unknown key; {}", suggest(name, &known)));
            }
            _ => return Err(format!("is a key of several tables ({}); say which, like {}.{name}", homes.join(", "), homes[0])),
        }
    }
    let mut schema: Option<&Schema> = Some(&SCENE);
    for (k, part) in parts.iter().enumerate() {
        // The keys of an effect depend on its kind: reading the scene checks them.
        let Some(known) = schema.filter(|_| part.parse::<usize>().is_err()) else { continue };
        let is_value = known.keys.contains(&part.as_str());
        if !is_value && known.child(part).is_none() {
            return Err(format!("unknown key \"{part}\"; {}", known.suggest(part)));
        }
        if is_value && k + 1 < parts.len() && part != "effect" && parts[k + 1].parse::<usize>().is_err() {
            return Err(format!("\"{part}\" is a value and has no key \"{}\"", parts[k + 1]));
        }
        schema = known.child(part);
    }
    Ok(parts)
}

/// Sets what `parts` lead to.
fn put(at: &mut Item, parts: &[String], value: Value) -> Result<(), String> {
    let (first, rest) = parts.split_first().ok_or("is empty")?;
    if let Ok(row) = first.parse::<usize>() {
        return put_row(at, row, rest, value);
    }
    if at.is_none() {
        let row = rest.first().is_some_and(|next| next.parse::<usize>().is_ok());
        *at = if row { Item::ArrayOfTables(ArrayOfTables::new()) } else { Item::Table(Table::new()) };
    }
    let table = at.as_table_like_mut().ok_or_else(|| format!("\"{first}\" is a key of something that is no table"))?;
    if rest.is_empty() {
        match table.get_mut(first).and_then(Item::as_value_mut) {
            Some(old) => {
                let decor = old.decor().clone();
                *old = value;
                *old.decor_mut() = decor;
            }
            None => drop(table.insert(first, Item::Value(value))),
        }
        return Ok(());
    }
    if table.get(first).is_none() {
        let row = rest[0].parse::<usize>().is_ok();
        table.insert(first, if row { Item::ArrayOfTables(ArrayOfTables::new()) } else { Item::Table(Table::new()) });
    }
    put(table.get_mut(first).expect("it was just made"), rest, value)
}

/// Sets what `rest` leads to in a row of an array, or adds a row.
fn put_row(at: &mut Item, row: usize, rest: &[String], value: Value) -> Result<(), String> {
    let missing = |count: usize| match count {
        0 => format!("there is no row {row}: there are none; number 0 with a table as its value adds one"),
        n => format!("there is no row {row}: they are 0 to {}, and number {n} with a table as its value adds one", n - 1),
    };
    match at {
        Item::ArrayOfTables(all) => {
            if rest.is_empty() {
                let table = value.as_inline_table().cloned().ok_or("is a row; its value is a table, like { kind = \"wind\" }")?;
                let table = table.into_table();
                let count = all.len();
                match all.get_mut(row) {
                    Some(old) => *old = table,
                    None if row == count => all.push(table),
                    None => return Err(missing(count)),
                }
                return Ok(());
            }
            let count = all.len();
            let table = all.get_mut(row).ok_or_else(|| missing(count))?;
            let mut item = Item::Table(std::mem::take(table));
            let done = put(&mut item, rest, value);
            if let Item::Table(t) = item {
                *table = t;
            }
            done
        }
        Item::Value(Value::Array(all)) => {
            let count = all.len();
            if rest.is_empty() && row == count {
                all.push(value);
                return Ok(());
            }
            let old = all.get_mut(row).ok_or_else(|| missing(count))?;
            if rest.is_empty() {
                *old = value;
                return Ok(());
            }
            let mut item = Item::Value(old.clone());
            put(&mut item, rest, value)?;
            if let Item::Value(v) = item {
                *old = v;
            }
            Ok(())
        }
        _ => Err(format!("{row} is the number of a row of something that has no rows")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::parse_scene;
    use crate::scene::tests::BASE;

    fn edited(edits: &[&str]) -> Result<String, String> {
        let edits: Vec<String> = edits.iter().map(|e| e.to_string()).collect();
        edit_scene(BASE, Path::new("scene.toml"), &edits).map_err(|e| e.to_string())
    }

    #[test]
    fn edits_change_set_and_add() {
        let text = edited(&[
            "gravity=[0, 0, -5]",
            "material.youngs_modulus = 2e4",
            "scheme=bdf2",
            "effect.0={ kind = \"wind\", mean = [1, 0, 0] }",
            "effect.1={ kind = \"air-drag\" }",
            "effect.1.coefficient=3",
        ])
        .unwrap();
        let scene = parse_scene(&text, "scene.toml").unwrap_or_else(|e| panic!("{e}\n{text}")).value;
        assert_eq!((scene.gravity.z, scene.material.youngs_modulus, scene.time.scheme.name), (-5.0, 2e4, "bdf2"));
        assert_eq!(scene.effects.iter().map(|e| e.law().kind).collect::<Vec<_>>(), ["wind", "air-drag"]);
        assert_eq!(scene.effects[1].values[0], Some(3.0));
    }

    #[test]
    fn what_no_scene_has_is_refused_with_the_nearest_key() {
        for (edit, said) in [
            ("material.youngs_modulu=3", "did you mean \"youngs_modulus\"?"),
            ("gravty=[0, 0, 1]", "did you mean \"gravity\"?"),
            ("point=[0, 0, 1]", "several tables"),
            ("gravity", "needs a key and a value"),
            ("gravity=[0, 0", "is not a TOML value"),
            ("clamp.3.group=a", "there is no row 3"),
            ("effect.1={ kind = \"wind\" }", "there is no row 1: there are none"),
            ("effect.0=3", "its value is a table"),
            ("title.text=3", "is a value and has no key"),
        ] {
            let e = edited(&[edit]).expect_err(edit);
            assert!(e.contains(said) && e.contains("scene.toml"), "{edit}: {e}");
        }
    }
}
