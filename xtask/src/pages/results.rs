//! `docs/result-files.md`: its lists of keys are what the structs in `crates/palpate/src/results/` say.
//!
//! A struct's documentation becomes a sentence above a table, that of a field a row. So a key cannot be there without a word about it, and the page
//! cannot tell of one that is gone.

use std::fmt::Write;
use std::fs;
use std::path::Path;

/// The page.
pub const PAGE: &str = "docs/result-files.md";
/// Stands before and after what is generated.
const MARK: &str = "<!-- keys of result files -->\n";
/// What writes the page anew.
const HINT: &str = "PALPATE_BLESS=1 cargo test --release -p xtask pages";

/// One struct or enumeration.
#[derive(Default)]
struct Item {
    name: String,
    doc: String,
    /// Key (or word), type, documentation.
    rows: Vec<[String; 3]>,
    words: bool,
}

/// What stands between two texts.
fn between<'a>(text: &'a str, before: &str, after: &str) -> Option<&'a str> {
    text.split_once(before)?.1.split_once(after).map(|p| p.0)
}

fn kebab(name: &str) -> String {
    let mut out = String::new();
    for (i, c) in name.chars().enumerate() {
        if c.is_uppercase() && i > 0 {
            out.push('-');
        }
        out.extend(c.to_lowercase());
    }
    out
}

/// A type in the words of JSON; names of other structs stay.
fn kind(of: &str) -> String {
    let inner = |head: &str| of.strip_prefix(head).and_then(|r| r.strip_suffix('>'));
    if let Some(t) = inner("Option<") {
        return format!("{} or null", kind(t));
    }
    if let Some(t) = inner("Box<") {
        return kind(t);
    }
    if let Some(t) = inner("Vec<") {
        let each = kind(t);
        return if each.contains(' ') { format!("list of ({each})") } else { format!("list of {each}") };
    }
    if let Some(t) = inner("BTreeMap<String, ") {
        return format!("object of {}", kind(t));
    }
    if let Some((t, n)) = of.strip_prefix('[').and_then(|r| r.strip_suffix(']')).and_then(|r| r.split_once("; ")) {
        return format!("{n} × {}", kind(t));
    }
    match of {
        "f64" => "number".into(),
        "usize" | "u32" | "u64" => "count".into(),
        "bool" => "true or false".into(),
        "String" | "&'static str" => "text".into(),
        other => format!("*{}*", other.rsplit("::").next().unwrap_or(other)),
    }
}

/// Structs and enumerations of a source file, without its tests.
fn items(source: &str) -> Vec<Item> {
    let mut all: Vec<Item> = Vec::new();
    let (mut doc, mut attributes, mut open) = (String::new(), String::new(), false);
    for line in source.split("#[cfg(test)]").next().unwrap_or("").lines() {
        let line_ = line.trim();
        if let Some(text) = line_.strip_prefix("///") {
            doc.push_str(text);
        } else if line_.starts_with("#[") {
            attributes.push_str(line_);
        } else if let Some((words, head)) =
            [(false, "pub struct "), (true, "pub enum ")].iter().find_map(|(w, h)| Some((*w, line.strip_prefix(h)?)))
        {
            let name = head.split([' ', '<', '{']).next().unwrap_or("").to_string();
            open = !head.ends_with("{}");
            all.push(Item { name, doc: doc.trim().into(), rows: Vec::new(), words });
            (doc, attributes) = Default::default();
        } else if line == "}" {
            open = false;
        } else if open && line.starts_with("    ") && !line_.is_empty() {
            let item = all.last_mut().expect("a struct is open");
            let row = if item.words {
                let word = line_.split(['(', ',', ' ']).next().unwrap_or("");
                Some((kebab(word), String::new()))
            } else {
                line_.strip_prefix("pub ").and_then(|r| r.trim_end_matches(',').split_once(": ")).map(|(key, of)| {
                    let key = between(&attributes, "rename = \"", "\"").unwrap_or(key);
                    let gone = if attributes.contains("skip_serializing_if") { ", may be absent" } else { "" };
                    let key = if attributes.contains("flatten") { "…".into() } else { format!("`{key}`") };
                    (key, kind(of) + gone)
                })
            };
            if let Some((key, of)) = row {
                item.rows.push([key, of, doc.trim().into()]);
            }
            (doc, attributes) = Default::default();
        } else if !line_.is_empty() {
            (doc, attributes) = Default::default();
        }
    }
    all
}

/// The generated part of the page, from every file of the folder.
fn keys(root: &Path) -> String {
    let folder = root.join("crates/palpate/src/results");
    let mut files: Vec<_> = fs::read_dir(folder).into_iter().flatten().filter_map(|e| Some(e.ok()?.path())).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "rs") && f.file_name().is_some_and(|n| n != "mod.rs"));
    files.sort();
    let mut out = String::new();
    for file in files {
        let source = fs::read_to_string(&file).unwrap_or_default();
        let about: Vec<&str> = source.lines().map_while(|l| l.strip_prefix("//!")).map(str::trim).collect();
        let format = between(&source, "const FORMAT: &'static str = \"", "\"").unwrap_or("");
        let _ = write!(out, "\n## `{format}`\n\n{}\n", about.join(" ").replace("``", "`"));
        for item in items(&source).into_iter().filter(|i| !i.rows.is_empty()) {
            let head = if item.words { ["word", ""] } else { ["key", " value |"] };
            let rule = if item.words { "|---|---|" } else { "|---|---|---|" };
            let _ = write!(out, "\n***{}***. {}\n\n| {} |{} what it is |\n{rule}\n", item.name, item.doc, head[0], head[1]);
            for [key, of, doc] in &item.rows {
                let doc = doc.replace('|', "\\|").replace("`None`", "`null`");
                let _ = match item.words {
                    true => writeln!(out, "| `{key}` | {doc} |"),
                    false => writeln!(out, "| {key} | {of} | {doc} |"),
                };
            }
        }
    }
    out + "\n"
}

/// The page as it should be; nothing where it has no two marks.
fn page(root: &Path, old: &str) -> Option<String> {
    let [before, _, after] = old.split(MARK).collect::<Vec<_>>()[..] else { return None };
    Some(format!("{before}{MARK}{}{MARK}{after}", keys(root)))
}

/// The page against the structs.
pub fn check(root: &Path, found: &mut Vec<String>) {
    let old = fs::read_to_string(root.join(PAGE)).unwrap_or_default();
    if page(root, &old).as_ref() != Some(&old) {
        found.push(format!("{PAGE}: is not what crates/palpate/src/results says; write it anew with: {HINT}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_of_result_files_is_what_their_structs_say() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let old = fs::read_to_string(root.join(PAGE)).unwrap();
        let new = page(root, &old).expect("two marks");
        if std::env::var_os("PALPATE_BLESS").is_some() {
            fs::write(root.join(PAGE), &new).unwrap();
            return;
        }
        assert!(old == new, "{PAGE} is not what crates/palpate/src/results says; write it anew with: {HINT}");
        // A key of a fit that many programs read, with its type and its words.
        assert!(new.contains("| `standard_error` | number or null | The whole standard error in the same unit;"));
    }

    #[test]
    fn a_struct_becomes_a_table() {
        let source = "/// What it is.\n#[derive(Debug)]\npub struct Thing {\n    /// Its size [m],\n    /// or none.\n    pub size: Option<f64>,\n    \
                      /// Last.\n    #[serde(rename = \"final\", skip_serializing_if = \"Vec::is_empty\")]\n    pub last: Vec<Part>,\n}\n\n\
                      impl Thing {\n    pub fn of() -> Thing {\n    }\n}\n\n/// A word.\npub enum Word {\n    /// Both.\n    AtABound,\n}\n";
        let [thing, word] = &items(source)[..] else { panic!("two items") };
        assert_eq!(thing.doc, "What it is.");
        let [size, last] = &thing.rows[..] else { panic!("two keys") };
        assert_eq!(size, &["`size`".to_string(), "number or null".into(), "Its size [m], or none.".into()]);
        assert_eq!(last, &["`final`".to_string(), "list of *Part*, may be absent".into(), "Last.".into()]);
        assert_eq!(word.rows, [["at-a-bound".to_string(), String::new(), "Both.".into()]]);
    }
}
