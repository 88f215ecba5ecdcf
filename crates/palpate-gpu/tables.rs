//! Tables: arrays that kernels only read and that fit into a device many at a time. A kernel may bind ten buffers in a browser, and some
//! read from twenty arrays, so all tables of a kind lie in one buffer of words, an arena.
//!
//! WGSL declares `var<body> cells: array<Cell>;` and reads `cells[i].nodes[k]`; `body` is the arena. The linker writes what that means: the
//! word at the start of the table, which stands at the head of the arena, plus strides as naga lays them out.

use naga::{Module, Scalar, ScalarKind, Type, TypeInner, VectorSize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Arenas, by the word between the brackets of a declaration: tables of the body or of what is observed, of the batch, of element matrices,
/// of a direction of tangents, of recorded frames.
pub const ARENAS: [&str; 5] = ["body", "batch", "matrices", "rates", "shots"];

/// Names of the tables of every arena, in the order of their starts at its head.
pub type Tables = BTreeMap<&'static str, Vec<String>>;

/// Arena and name that a line declares.
fn declared(line: &str) -> Option<(&'static str, &str)> {
    let (arena, rest) = line.strip_prefix("var<")?.split_once("> ")?;
    Some((ARENAS.into_iter().find(|a| *a == arena)?, rest.split_once(':')?.0))
}

/// All tables that files below a folder declare.
pub fn all(folder: &Path) -> Tables {
    let mut names: BTreeMap<&'static str, BTreeSet<String>> = BTreeMap::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("the folder is there").flatten() {
            if entry.path().is_dir() {
                folders.push(entry.path());
            } else {
                let text = fs::read_to_string(entry.path()).expect("it is text");
                let found = text.lines().filter_map(declared).map(|(arena, name)| (arena, name.to_string()));
                found.for_each(|(arena, name)| {
                    names.entry(arena).or_default().insert(name);
                });
            }
        }
    }
    names.into_iter().map(|(arena, names)| (arena, names.into_iter().collect())).collect()
}

/// The buffer that an arena is to kernels.
pub fn buffer(arena: &str) -> String {
    format!("{arena}_tables")
}

/// A kernel's text with its tables read from their arenas.
pub fn resolve(text: &str, tables: &Tables) -> String {
    let plain: Vec<String> = text
        .lines()
        .map(|line| match declared(line) {
            Some((arena, _)) => line.replacen(&format!("var<{arena}>"), "var<storage, read>", 1),
            None => line.to_string(),
        })
        .collect();
    let plain = plain.join("\n");
    let module = naga::front::wgsl::parse_str(&plain).unwrap_or_else(|e| panic!("{}", e.emit_to_string(&plain)));
    let mut w = Writer { module: &module, places: BTreeMap::new(), loaders: BTreeMap::new() };
    let mut used = BTreeSet::new();
    let mut out = String::new();
    for line in text.lines() {
        let Some((arena, name)) = declared(line) else {
            out.push_str(line);
            out.push('\n');
            continue;
        };
        let place = tables[arena].iter().position(|t| t == name).expect("every table is listed");
        w.places.insert(name.to_string(), (arena, place));
        if used.insert(arena) {
            writeln!(out, "var<storage, read> {}: array<u32>;", buffer(arena)).expect("a String takes all");
        }
    }
    let rewritten = w.rewritten(&out);
    // Lines are told as they were written, too: tests read off them how long loops are, and make them wrong.
    let lines = out.lines().zip(rewritten.lines()).map(|(before, after)| match before.trim() {
        written if before != after => format!("{after} // {written}\n"),
        _ => format!("{after}\n"),
    });
    let mut out: String = lines.collect();
    w.loaders.values().for_each(|text| out.push_str(text));
    out
}

struct Writer<'a> {
    module: &'a Module,
    /// Arena of a table, and where its start stands.
    places: BTreeMap<String, (&'static str, usize)>,
    /// Functions that put a value together from words, by their names.
    loaders: BTreeMap<String, String>,
}

fn is_name(c: u8) -> bool {
    c.is_ascii_alphanumeric() || c == b'_'
}

/// End of the name that starts at `at`.
fn end_of_name(text: &str, at: usize) -> usize {
    text.as_bytes()[at..].iter().position(|c| !is_name(*c)).map_or(text.len(), |n| at + n)
}

/// What stands between the bracket at `at` and the one that closes it, and where the text goes on.
fn bracketed(text: &str, at: usize) -> (&str, usize) {
    let mut depth = 0;
    for (k, c) in text.bytes().enumerate().skip(at) {
        match c {
            b'[' => depth += 1,
            b']' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return (&text[at + 1..k], k + 1);
        }
    }
    panic!("no bracket closes the one after: {}", &text[..at.min(80)]);
}

impl Writer<'_> {
    /// Text with every read of a table as a read of its arena.
    fn rewritten(&mut self, text: &str) -> String {
        let (mut out, mut at) = (String::with_capacity(text.len()), 0);
        let bytes = text.as_bytes();
        while at < bytes.len() {
            if text[at..].starts_with("//") {
                let end = text[at..].find('\n').map_or(text.len(), |n| at + n);
                out.push_str(&text[at..end]);
                at = end;
            } else if is_name(bytes[at]) {
                let end = end_of_name(text, at);
                let name = &text[at..end];
                let of_value = out.trim_end().ends_with('.');
                match self.places.get(name).copied() {
                    Some(place) if !of_value && text[end..].starts_with('[') => {
                        let (read, next) = self.read(text, name, place, end);
                        out.push_str(&read);
                        at = next;
                    }
                    _ => {
                        out.push_str(name);
                        at = end;
                    }
                }
            } else {
                let next = at + text[at..].chars().next().map_or(1, char::len_utf8);
                out.push_str(&text[at..next]);
                at = next;
            }
        }
        out
    }

    /// A read of table `name`, whose index begins at `at`, as far as fields and fixed arrays of its elements go.
    fn read(&mut self, text: &str, name: &str, (arena, place): (&'static str, usize), at: usize) -> (String, usize) {
        let global = self.module.global_variables.iter().find(|(_, g)| g.name.as_deref() == Some(name));
        let TypeInner::Array { mut base, stride, .. } = self.module.types[global.expect("it is declared").1.ty].inner else {
            panic!("the table {name} is no array");
        };
        let (index, mut at) = bracketed(text, at);
        let index = self.rewritten(index);
        let mut address = format!("{}[{place}u] + ({index}) * {}u", buffer(arena), stride / 4);
        loop {
            let ty = &self.module.types[base];
            match &ty.inner {
                TypeInner::Struct { members, .. } if text[at..].starts_with('.') => {
                    let end = end_of_name(text, at + 1);
                    let field = &text[at + 1..end];
                    let member = members.iter().find(|m| m.name.as_deref() == Some(field));
                    let member = member.unwrap_or_else(|| panic!("{name} has no field {field}"));
                    write!(address, " + {}u", member.offset / 4).expect("a String takes all");
                    (base, at) = (member.ty, end);
                }
                TypeInner::Array { base: element, stride, .. } if text[at..].starts_with('[') => {
                    let (index, end) = bracketed(text, at);
                    let index = self.rewritten(index);
                    write!(address, " + ({index}) * {}u", stride / 4).expect("a String takes all");
                    (base, at) = (*element, end);
                }
                _ => return (self.load(arena, &self.module.types[base], &address), at),
            }
        }
    }

    /// The value of a type that starts at a word.
    fn load(&mut self, arena: &'static str, ty: &Type, address: &str) -> String {
        if let TypeInner::Scalar(scalar) = ty.inner {
            return scalar_at(arena, scalar, address);
        }
        let name = self.name(ty);
        let function = format!("{arena}_{}", name.replace(['<', '>', ',', ' '], "_"));
        if !self.loaders.contains_key(&function) {
            // A place of its own, so that types that hold each other end.
            self.loaders.insert(function.clone(), String::new());
            let parts: Vec<String> = self.parts(ty).into_iter().map(|(ty, offset)| self.part(arena, &ty, offset)).collect();
            let text = format!("fn {function}(a: u32) -> {name} {{\n    return {name}({});\n}}\n", parts.join(", "));
            self.loaders.insert(function.clone(), text);
        }
        format!("{function}({address})")
    }

    fn part(&mut self, arena: &'static str, ty: &Type, offset: u32) -> String {
        self.load(arena, ty, &format!("a + {}u", offset / 4))
    }

    /// What a type is put together from, with offsets in bytes.
    fn parts(&self, ty: &Type) -> Vec<(Type, u32)> {
        let plain = |inner| Type { name: None, inner };
        match &ty.inner {
            TypeInner::Vector { size, scalar } => (0..*size as u32).map(|k| (plain(TypeInner::Scalar(*scalar)), 4 * k)).collect(),
            TypeInner::Matrix { columns, rows, scalar } => {
                let stride = if *rows == VectorSize::Bi { 8 } else { 16 };
                let column = || plain(TypeInner::Vector { size: *rows, scalar: *scalar });
                (0..*columns as u32).map(|k| (column(), stride * k)).collect()
            }
            TypeInner::Struct { members, .. } => members.iter().map(|m| (self.module.types[m.ty].clone(), m.offset)).collect(),
            TypeInner::Array { base, size: naga::ArraySize::Constant(count), stride } => {
                (0..count.get()).map(|k| (self.module.types[*base].clone(), stride * k)).collect()
            }
            other => panic!("a table cannot hold {other:?}"),
        }
    }

    /// A type as WGSL writes it.
    fn name(&self, ty: &Type) -> String {
        let scalar = |s: &Scalar| match s.kind {
            ScalarKind::Float => "f32",
            ScalarKind::Uint => "u32",
            ScalarKind::Sint => "i32",
            other => panic!("a table cannot hold {other:?}"),
        };
        match &ty.inner {
            TypeInner::Scalar(s) => scalar(s).into(),
            TypeInner::Vector { size, scalar: s } => format!("vec{}<{}>", *size as u32, scalar(s)),
            TypeInner::Matrix { columns, rows, scalar: s } => format!("mat{}x{}<{}>", *columns as u32, *rows as u32, scalar(s)),
            TypeInner::Array { base, size: naga::ArraySize::Constant(count), .. } => {
                format!("array<{}, {count}>", self.name(&self.module.types[*base]))
            }
            _ => ty.name.clone().expect("structs have names"),
        }
    }
}

/// A number that stands at a word.
fn scalar_at(arena: &str, scalar: Scalar, address: &str) -> String {
    let word = format!("{}[{address}]", buffer(arena));
    match scalar.kind {
        ScalarKind::Uint => word,
        ScalarKind::Float => format!("bitcast<f32>({word})"),
        _ => format!("bitcast<i32>({word})"),
    }
}
