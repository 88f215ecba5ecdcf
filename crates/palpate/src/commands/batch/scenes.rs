//! Which scenes a batch has, and what their folders are called.

use crate::error::Error;
use crate::options::stem;
use palpate_io::{InputError, read_text};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn unreadable(path: &Path, cause: &std::io::Error) -> Error {
    InputError::file(path, format!("cannot be read: {cause}")).into()
}

/// The scenes that the arguments name: folders in the order of names, lists in the order of lines.
pub fn scenes(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Error> {
    let mut out = Vec::new();
    for path in paths {
        if path.is_dir() {
            let list = std::fs::read_dir(path).map_err(|e| unreadable(path, &e))?;
            let files: BTreeSet<PathBuf> = list.filter_map(|f| Some(f.ok()?.path())).collect();
            let toml = files.into_iter().filter(|f| f.extension().is_some_and(|e| e == "toml"));
            // Other TOML files (recordings, settings) may lie beside the scenes; one that cannot be read is reported later.
            let before = out.len();
            out.extend(toml.filter(|f| read_text(f).map_or(true, |t| t.contains("\"scene/1\""))));
            if out.len() == before {
                return Err(InputError::file(path, "holds no scene (*.toml with format = \"scene/1\")").into());
            }
        } else if path.extension().is_some_and(|e| e == "toml") {
            out.push(path.clone());
        } else {
            let folder = path.parent().unwrap_or(Path::new(""));
            let lines = read_text(path)?;
            let named = lines.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#'));
            let before = out.len();
            out.extend(named.map(|l| folder.join(l)));
            if out.len() == before {
                return Err(InputError::file(path, "names no scene; one path a line is expected").into());
            }
        }
    }
    Ok(out)
}

/// A folder name per scene: its file's name, numbered where two are the same.
pub fn names(scenes: &[PathBuf]) -> Vec<String> {
    let mut taken = BTreeSet::new();
    let free = |s: &PathBuf| {
        let name = stem(s);
        let numbered = |n: usize| if n == 1 { name.clone() } else { format!("{name}-{n}") };
        (1..).map(numbered).find(|n| taken.insert(n.clone())).expect("some number is free")
    };
    scenes.iter().map(free).collect()
}
