//! Links between pages, and the book's table of contents.

use super::outside_code;
use std::fs;
use std::path::{Component, Path, PathBuf};

/// The book's table of contents.
const SUMMARY: &str = "docs/SUMMARY.md";

/// Addresses of a page's links and pictures, with their lines.
fn addresses(text: &str) -> Vec<(usize, String)> {
    let mut all = Vec::new();
    for (number, line) in outside_code(text) {
        // What stands in backquotes is no link.
        let line: String = line.split('`').step_by(2).collect::<Vec<_>>().join("``");
        for part in line.split("](").skip(1) {
            if let Some((address, _)) = part.split_once(')') {
                all.push((number, address.to_string()));
            }
        }
    }
    all
}

/// The name under which a heading can be linked, as GitHub and mdBook form it.
pub fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    kept.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c)).map(|c| if c == ' ' { '-' } else { c }).collect()
}

fn has_heading(text: &str, wanted: &str) -> bool {
    outside_code(text).any(|(_, line)| line.starts_with('#') && anchor(line.trim_start_matches('#')) == wanted)
}

/// A path without `.` and `..`.
fn plain(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => {
                out.pop();
            }
            Component::CurDir => {}
            other => out.push(other),
        }
    }
    out
}

/// Links of a page that lead nowhere: to a file that is not there, or to no heading of it. Addresses on the web are not asked.
pub fn check(root: &Path, name: &str, text: &str, found: &mut Vec<String>) {
    for (line, address) in addresses(text).into_iter().filter(|(_, a)| !a.contains("://")) {
        let (file, heading) = address.split_once('#').unwrap_or((&address, ""));
        let page = root.join(name);
        let target = if file.is_empty() { page } else { plain(&page.parent().unwrap_or(root).join(file)) };
        if !target.exists() {
            found.push(format!("{name}:{line}: the link to {address} leads to no file"));
        } else if !heading.is_empty() && !fs::read_to_string(&target).is_ok_and(|t| has_heading(&t, heading)) {
            found.push(format!("{name}:{line}: the link to {address} leads to no heading"));
        }
    }
}

/// Pages of `docs/` that the book's table of contents does not name, or names twice.
pub fn summary(root: &Path, pages: &[(String, String)], found: &mut Vec<String>) {
    let text = fs::read_to_string(root.join(SUMMARY)).unwrap_or_default();
    let named = addresses(&text);
    for (name, _) in pages {
        let Some(file) = name.strip_prefix("docs/").filter(|_| name != SUMMARY) else { continue };
        match named.iter().filter(|(_, a)| a == file).count() {
            0 => found.push(format!("{SUMMARY}: does not name {file}; add a line `- [Title]({file})` where it belongs")),
            1 => {}
            n => found.push(format!("{SUMMARY}: names {file} {n} times")),
        }
    }
}

/// Every way to write a path with `{a,b}` in it.
fn alternatives(path: &str) -> Vec<String> {
    let Some((before, (inside, after))) = path.split_once('{').and_then(|(b, r)| Some((b, r.split_once('}')?))) else {
        return vec![path.into()];
    };
    inside.split(',').flat_map(|one| alternatives(&format!("{before}{one}{after}"))).collect()
}

/// Sources that a page names in backquotes and that are not there. Of a path its end is enough, `corotation/hessian.rs`; names in capitals stand for any.
pub fn sources(files: &[String], name: &str, text: &str, found: &mut Vec<String>) {
    let is_path = |c: &str| c.chars().all(|c| c.is_ascii_alphanumeric() || "_-./{},".contains(c));
    for (number, line) in outside_code(text) {
        let spans = line.split('`').skip(1).step_by(2);
        for path in spans.filter(|s| is_path(s) && (s.ends_with(".rs") || s.ends_with(".wgsl"))).flat_map(alternatives) {
            let stands_for_any = path.rsplit('/').next().is_some_and(|n| n.starts_with(|c: char| c.is_ascii_uppercase()));
            if !stands_for_any
                && !files
                    .iter()
                    .any(|f| *f == path || f.ends_with(&format!("/{path}")) || f.replace("/src/", "/").ends_with(&path))
            {
                found.push(format!("{name}:{number}: there is no {path}"));
            }
        }
    }
}

/// Blocks behind `<!-- quoted from: FILE -->` that do not stand in that file.
pub fn quotes(root: &Path, name: &str, text: &str, found: &mut Vec<String>) {
    const MARK: &str = "<!-- quoted from: ";
    for part in text.split(MARK).skip(1) {
        let file = part.split(" -->").next().unwrap_or("");
        let quoted = part.split("```").nth(1).and_then(|b| b.split_once('\n')).map_or("", |b| b.1);
        let source = fs::read_to_string(root.join(file)).unwrap_or_default();
        if quoted.is_empty() || !source.contains(quoted) {
            found.push(format!("{name}: what is quoted from {file} does not stand there"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_to_nowhere_and_forgotten_pages_are_named() {
        let folder = std::env::temp_dir().join(format!("palpate-links-{}", std::process::id()));
        fs::create_dir_all(folder.join("docs")).unwrap();
        let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
        write("code.rs", "fn f() {}\nfn g() {}\n");
        let quote = |line: &str| format!("<!-- quoted from: code.rs -->\n```rust\n{line}\n```\n");
        write("README.md", &(quote("fn g() {}") + &quote("fn h() {}")));
        let code = ["a/src/b/c.rs".to_string()];
        let mut missing = Vec::new();
        sources(&code, "x.md", "`b/c.rs` `a/b/c.rs` `b/{c,d}.rs` `b/NAME.rs` c.rs\n```\n`e.rs`\n```\n", &mut missing);
        assert_eq!(missing, ["x.md:1: there is no b/d.rs"]);
        let a = "[b](b.md#two--words) [up](../README.md) [web](https://x.org/y) [own](#here) `[no](link.md)`\n\n## Here\n";
        write("docs/a.md", a);
        write("docs/b.md", "# Two — words\n\n[c](c.md)\n[a](a.md#there)\n```\n[d](d.md)\n```\n");
        write("docs/SUMMARY.md", "- [A](a.md)\n");
        let mut found = Vec::new();
        super::super::check(&folder, &mut found);
        fs::remove_dir_all(&folder).unwrap();
        let of_links: Vec<&String> =
            found.iter().filter(|f| ["link", "SUMMARY", "quoted"].iter().any(|w| f.contains(w))).collect();
        let expected = [
            "docs/b.md:3: the link to c.md leads to no file",
            "docs/b.md:4: the link to a.md#there leads to no heading",
            "README.md: what is quoted from code.rs does not stand there",
            "docs/SUMMARY.md: does not name b.md; add a line `- [Title](b.md)` where it belongs",
        ];
        assert_eq!(of_links, expected.iter().collect::<Vec<_>>());
    }
}
