//! VTK's legacy files of unstructured grids (VTK file formats, "Simple legacy formats"), text or binary, versions 1 to 5.

use super::Raw;
use super::bytes::{Bytes, Coding, Fault};
use super::vtu::cells_of;
use super::vtu_data::Coded;

/// Whole-numbered arrays of points or cells, which become groups.
type Arrays = Vec<(bool, String, Vec<i64>)>;

/// Reads a grid.
pub(super) fn read(bytes: &[u8]) -> Result<Raw, Fault> {
    let mut file = Bytes::new(bytes);
    if !file.line().is_some_and(|l| l.to_ascii_lowercase().starts_with("# vtk datafile version")) {
        return Err("is no legacy VTK file: it must begin with \"# vtk DataFile Version\"".into());
    }
    file.line();
    let coding = match file.line().map(str::to_ascii_uppercase).as_deref() {
        Some("ASCII") => Coding::Text,
        // Whatever machine wrote it.
        Some("BINARY") => Coding::BigEndian,
        _ => return Err(file.fault("the third line must be ASCII or BINARY")),
    };
    let mut raw = Raw::default();
    let (mut connectivity, mut ends, mut types) = (Vec::new(), Vec::new(), Vec::new());
    let mut arrays = Arrays::new();
    // Entries of an array that follows, and whether it is one of cells; none before either is named.
    let mut of: Option<(u64, bool)> = None;
    while let Some(line) = file.full_line() {
        let mut words = line.split_whitespace();
        let key = words.next().unwrap_or_default().to_ascii_uppercase();
        let rest: Vec<&str> = words.collect();
        let word = |k: usize| rest.get(k).copied().unwrap_or_default();
        let number = |k: usize| word(k).parse::<u64>().map_err(|_| file.fault(format!("{key} must be followed by numbers")));
        match key.as_str() {
            "DATASET" if word(0).eq_ignore_ascii_case("UNSTRUCTURED_GRID") => {}
            "DATASET" => return Err(file.fault(format!("holds a {}; an UNSTRUCTURED_GRID is needed", word(0)))),
            "POINTS" => {
                let count = number(0)?;
                let x = values(&mut file, coding, word(1), count, 3, Coded::real)?;
                raw.nodes = x.chunks_exact(3).map(|x| [x[0], x[1], x[2]].into()).collect();
            }
            "CELLS" => {
                let (count, size) = (number(0)?, number(1)?);
                (connectivity, ends) = cells(&mut file, coding, count, size)?;
            }
            "CELL_TYPES" => {
                let count = number(0)?;
                types = values(&mut file, coding, "int", count, 1, Coded::int)?;
            }
            "POINT_DATA" => of = Some((number(0)?, false)),
            "CELL_DATA" => of = Some((number(0)?, true)),
            "METADATA" => while file.line().is_some_and(|l| !l.is_empty()) {},
            "FIELD" => {
                for _ in 0..number(1)? {
                    field(&mut file, coding, of, &mut arrays)?;
                }
            }
            _ => {
                let Some(of) = of else { return Err(file.fault(format!("{key} is not known here"))) };
                attribute(&mut file, coding, (&key, &rest), of, &mut arrays)?;
            }
        }
    }
    if file.left() > 0 {
        return Err("is damaged: it goes on with bytes that are no text where a keyword must stand".into());
    }
    if types.len() != ends.len() {
        return Err(format!("has {} cells and {} types of cells", ends.len(), types.len()).into());
    }
    let cells = cells_of(&mut raw, &connectivity, &ends, &types)?;
    let own: Vec<[u32; 1]> = (0..raw.nodes.len() as u32).map(|n| [n]).collect();
    for (of_cells, name, values) in &arrays {
        let entries = if *of_cells { cells.len() } else { own.len() };
        if values.len() != entries {
            return Err(format!("array \"{name}\" has {} entries, {entries} are needed", values.len()).into());
        }
        raw.by_values(name, values, |k| if *of_cells { &cells[k][..] } else { &own[k][..] });
    }
    Ok(raw)
}

/// The type of a name in these files.
fn coded(name: &str) -> Option<Coded> {
    Some(match name.to_ascii_lowercase().as_str() {
        "unsigned_char" => Coded::UInt8,
        "char" | "signed_char" => Coded::Int8,
        "unsigned_short" => Coded::UInt16,
        "short" => Coded::Int16,
        "unsigned_int" => Coded::UInt32,
        // Ids were written as int before version 5.
        "int" | "vtkidtype" => Coded::Int32,
        "unsigned_long" | "vtktypeuint64" => Coded::UInt64,
        "long" | "vtktypeint64" => Coded::Int64,
        "float" => Coded::Float32,
        "double" => Coded::Float64,
        _ => return None,
    })
}

/// `count` × `each` numbers of a type.
fn values<T: std::str::FromStr>(
    file: &mut Bytes,
    coding: Coding,
    kind: &str,
    count: u64,
    each: u64,
    number: fn(Coded, &[u8]) -> T,
) -> Result<Vec<T>, Fault> {
    let of = coded(kind).ok_or_else(|| file.fault(format!("numbers of type \"{kind}\" are not read")))?;
    // A digit at least: the last number of a text needs no space after it.
    let bytes = if coding == Coding::Text { 1 } else { of.size() };
    let all = file.room(count.saturating_mul(each), bytes, "numbers")?;
    file.coding = coding;
    let found = match coding {
        Coding::Text => (0..all).map(|_| file.text()).collect::<Result<Vec<T>, Fault>>()?,
        _ => {
            let part = file.take(all.saturating_mul(of.size()))?;
            let one = |b: &[u8]| number(of, &b.iter().rev().copied().collect::<Vec<u8>>());
            part.chunks_exact(of.size()).map(one).collect()
        }
    };
    file.coding = Coding::Text;
    Ok(found)
}

/// Nodes and ends of cells: `n nodes…` for each, or from version 5 on arrays of offsets and of nodes.
fn cells(file: &mut Bytes, coding: Coding, count: u64, size: u64) -> Result<(Vec<i64>, Vec<i64>), Fault> {
    let mark = file.mark();
    let kind = |line: Option<&str>, wanted: &str| {
        let line = line?.to_string();
        let (name, kind) = line.split_once(char::is_whitespace)?;
        name.eq_ignore_ascii_case(wanted).then(|| kind.trim().to_string())
    };
    if let Some(of) = kind(file.full_line(), "OFFSETS") {
        let offsets = values(file, coding, &of, count, 1, Coded::int)?;
        let of = kind(file.full_line(), "CONNECTIVITY").ok_or_else(|| file.fault("CONNECTIVITY must follow OFFSETS"))?;
        let nodes = values(file, coding, &of, size, 1, Coded::int)?;
        return Ok((nodes, offsets.get(1..).unwrap_or_default().to_vec()));
    }
    file.back_to(mark);
    let flat: Vec<i64> = values(file, coding, "int", size, 1, Coded::int)?;
    let (mut nodes, mut ends, mut at) = (Vec::new(), Vec::new(), 0);
    while at < flat.len() {
        let part = usize::try_from(flat[at]).ok().and_then(|n| flat.get(at + 1..)?.get(..n));
        let part = part.ok_or_else(|| file.fault("CELLS is damaged: a cell has more nodes than follow"))?;
        nodes.extend(part);
        ends.push(nodes.len() as i64);
        at += 1 + part.len();
    }
    if ends.len() as u64 != count {
        return Err(file.fault(format!("CELLS announces {count} cells and holds {}", ends.len())));
    }
    Ok((nodes, ends))
}

/// Numbers of an array; whole ones, one for each entry, are kept.
fn keep(
    file: &mut Bytes,
    coding: Coding,
    (name, kind): (&str, &str),
    (count, each): (u64, u64),
    of: Option<(u64, bool)>,
    arrays: &mut Arrays,
) -> Result<(), Fault> {
    match (coded(kind), of) {
        (Some(c), Some((entries, of_cells))) if c.is_whole() && each == 1 && count == entries => {
            arrays.push((of_cells, name.to_string(), values(file, coding, kind, count, 1, Coded::int)?));
        }
        _ => drop(values(file, coding, kind, count, each, Coded::real)?),
    }
    Ok(())
}

/// `name components entries type` and numbers.
fn field(file: &mut Bytes, coding: Coding, of: Option<(u64, bool)>, arrays: &mut Arrays) -> Result<(), Fault> {
    let mut line = file.full_line().unwrap_or_default();
    // What VTK says about an array stands between it and the next.
    if line.eq_ignore_ascii_case("METADATA") {
        while file.line().is_some_and(|l| !l.is_empty()) {}
        line = file.full_line().unwrap_or_default();
    }
    let words: Vec<&str> = line.split_whitespace().collect();
    let [name, each, count, kind] = words[..] else {
        return Err(file.fault("an array of a FIELD must say name, components, entries and type"));
    };
    match (each.parse(), count.parse()) {
        (Ok(each), Ok(count)) => keep(file, coding, (name, kind), (count, each), of, arrays),
        _ => Err(file.fault("an array of a FIELD must say its components and entries in numbers")),
    }
}

/// Arrays with keywords of their own.
fn attribute(
    file: &mut Bytes,
    coding: Coding,
    (key, rest): (&str, &[&str]),
    of: (u64, bool),
    arrays: &mut Arrays,
) -> Result<(), Fault> {
    let word = |k: usize| rest.get(k).copied().unwrap_or_default();
    let number = |k: usize| word(k).parse::<u64>().map_err(|_| file.fault(format!("{key} must say how many numbers it has")));
    let (kind, each) = match key {
        "SCALARS" => {
            let each = if rest.len() > 2 { number(2)? } else { 1 };
            let mark = file.mark();
            if !file.full_line().is_some_and(|l| l.to_ascii_uppercase().starts_with("LOOKUP_TABLE")) {
                file.back_to(mark);
            }
            (word(1), each)
        }
        "VECTORS" | "NORMALS" => (word(1), 3),
        "TENSORS" => (word(1), 9),
        "TENSORS6" => (word(1), 6),
        "GLOBAL_IDS" | "PEDIGREE_IDS" => (word(1), 1),
        "TEXTURE_COORDINATES" => (word(2), number(1)?),
        "COLOR_SCALARS" => (if coding == Coding::Text { "float" } else { "unsigned_char" }, number(1)?),
        "LOOKUP_TABLE" => {
            let kind = if coding == Coding::Text { "float" } else { "unsigned_char" };
            let size = number(1)?;
            return keep(file, coding, (word(0), kind), (size, 4), None, arrays);
        }
        other => return Err(file.fault(format!("{other} is not known here"))),
    };
    keep(file, coding, (word(0), kind), (of.0, each), Some(of), arrays)
}
