//! Pages for people: sentences that can be read at once ([`words`]), links that lead somewhere and quotations that are true ([`links`]), a page of result files that is
//! written from their structs ([`results`]).
//!
//! Nothing here depends on another crate.

pub mod links;
pub mod results;
pub mod words;

use std::fs;
use std::path::Path;

/// Pages outside of `docs/`.
const OUTSIDE: [&str; 5] = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md", "benchmark/README.md"];

/// All pages with their text: those of `docs/`, sorted, then the others that are there.
pub fn pages(root: &Path) -> Vec<(String, String)> {
    let entries = fs::read_dir(root.join("docs")).into_iter().flatten();
    let mut names: Vec<String> = entries.filter_map(|e| Some(e.ok()?.file_name().to_string_lossy().into_owned())).collect();
    names.retain(|n| n.ends_with(".md"));
    names.sort();
    let names = names.into_iter().map(|n| format!("docs/{n}")).chain(OUTSIDE.map(String::from));
    names.filter_map(|n| Some((n.clone(), fs::read_to_string(root.join(&n)).ok()?))).collect()
}

/// Files below a folder, by their paths from the root.
fn below(root: &Path, folder: &str, files: &mut Vec<String>) {
    for entry in fs::read_dir(root.join(folder)).into_iter().flatten().flatten() {
        let name = format!("{folder}/{}", entry.file_name().to_string_lossy());
        if entry.path().is_dir() { below(root, &name, files) } else { files.push(name) }
    }
}

/// Checks every page; one line per finding.
pub fn check(root: &Path, found: &mut Vec<String>) {
    let all = pages(root);
    let mut files = Vec::new();
    for folder in ["crates", "shaders", "tests", "xtask", "python", "fuzz"] {
        below(root, folder, &mut files);
    }
    for (name, text) in &all {
        words::check(name, text, found);
        links::check(root, name, text, found);
        links::quotes(root, name, text, found);
        links::sources(&files, name, text, found);
    }
    links::summary(root, &all, found);
    results::check(root, found);
}

/// Lines of a page that are no code, with their numbers from 1.
fn outside_code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut code = false;
    text.lines().enumerate().filter_map(move |(i, line)| {
        let fence = line.trim_start().starts_with("```");
        code ^= fence;
        (!code && !fence).then_some((i + 1, line))
    })
}
