//! TetGen's `.node` and `.ele` (manual, section "File formats"): `#` begins a comment, nodes count from 0 or from 1.

use super::Raw;
use super::bytes::Fault;
use super::kinds::Kind;
use crate::error::InputError;
use crate::input::read_bytes;
use std::path::Path;

/// Reads both files of a mesh, whichever is named.
pub(super) fn read(path: &Path) -> Result<Raw, InputError> {
    let mut texts = Vec::new();
    for extension in ["node", "ele"] {
        let file = path.with_extension(extension);
        if file != path && !file.exists() {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            let text = format!("{name} is missing beside it; TetGen writes .node and .ele, and both are needed");
            return Err(InputError::file(path, text));
        }
        let bytes = read_bytes(&file)?;
        let text = String::from_utf8(bytes).map_err(|_| InputError::file(&file, "is not UTF-8 text"))?;
        texts.push((file, text));
    }
    let wrong = |which: usize, f: Fault| InputError { line: f.line, ..InputError::file(&texts[which].0, f.message) };
    let mut raw = Raw::default();
    let first = nodes(&rows(&texts[0].1), &mut raw).map_err(|f| wrong(0, f))?;
    tets(&rows(&texts[1].1), &mut raw, first).map_err(|f| wrong(1, f))?;
    Ok(raw)
}

/// Lines with something in them, and their numbers.
fn rows(text: &str) -> Vec<(usize, &str)> {
    let told = text.lines().map(|l| l.split('#').next().unwrap_or_default().trim());
    (1..).zip(told).filter(|(_, l)| !l.is_empty()).collect()
}

/// The numbers of a line.
fn numbers<T: std::str::FromStr>((line, text): (usize, &str), least: usize) -> Result<Vec<T>, Fault> {
    let fault = |message: String| Fault { line: Some(line), message };
    let one = |w: &str| {
        w.parse().map_err(|_| fault(format!("\"{}\" stands where a number must", w.chars().take(20).collect::<String>())))
    };
    let all = text.split_whitespace().map(one).collect::<Result<Vec<T>, Fault>>()?;
    if all.len() < least {
        return Err(fault(format!("has {} numbers where {least} are needed", all.len())));
    }
    Ok(all)
}

/// Numbers of a header, and the rows behind it with the lines that they stand in.
type Rows<'a> = (Vec<u64>, Vec<(usize, &'a str)>);

/// The head of a file, and as many rows as it announces.
fn table<'a>(rows: &[(usize, &'a str)], things: &str) -> Result<Rows<'a>, Fault> {
    let (head, rest) = rows.split_first().ok_or_else(|| Fault::from("is empty"))?;
    let head: Vec<u64> = numbers(*head, 1)?;
    match usize::try_from(head[0]).ok().and_then(|n| rest.get(..n)) {
        Some(rest) => Ok((head, rest.to_vec())),
        None => {
            Err(format!("announces {} {things}, and only {} lines follow: the file is cut short", head[0], rest.len()).into())
        }
    }
}

/// A whole number that is written as one, or as 1.0.
fn whole(x: f64) -> Option<i64> {
    (x.fract() == 0.0 && x.abs() < 1e15).then_some(x as i64)
}

/// `number x y z attributes… marker`; tells which number the first node has.
fn nodes(rows: &[(usize, &str)], raw: &mut Raw) -> Result<u64, Fault> {
    let (head, rows) = table(rows, "nodes")?;
    let of = |k: usize| head.get(k).copied().unwrap_or(0);
    if head.len() > 1 && head[1] != 3 {
        return Err(format!("has nodes in {} dimensions; 3 are needed", head[1]).into());
    }
    let (attributes, marked) = (of(2) as usize, of(3) > 0);
    let columns = 4usize.saturating_add(attributes).saturating_add(usize::from(marked));
    let mut first = 0;
    let (mut values, mut markers) = (Vec::new(), Vec::new());
    for (n, row) in (0u32..).zip(&rows) {
        let x: Vec<f64> = numbers(*row, columns)?;
        if n == 0 {
            first = if x[0] == 1.0 { 1 } else { 0 };
        }
        if x[0] != f64::from(n) + first as f64 {
            let message =
                format!("node {} stands where node {} must: nodes are counted from 0 or 1 on", x[0], u64::from(n) + first);
            return Err(Fault { line: Some(row.0), message });
        }
        raw.nodes.push([x[1], x[2], x[3]].into());
        if attributes > 0 {
            values.push(whole(x[4]));
        }
        if marked {
            markers.push(whole(x[columns - 1]).unwrap_or(0));
        }
    }
    let own: Vec<[u32; 1]> = (0..raw.nodes.len() as u32).map(|n| [n]).collect();
    // Inside a body markers are 0.
    for (n, marker) in markers.iter().enumerate().filter(|(_, m)| **m != 0) {
        raw.groups.entry(format!("marker-{marker}")).or_default().insert(n as u32);
    }
    // An attribute with fractions is a field and no group.
    if let Some(values) = values.into_iter().collect::<Option<Vec<i64>>>().filter(|v| !v.is_empty()) {
        raw.by_values("attribute", &values, |n| &own[n]);
    }
    Ok(first)
}

/// `number nodes… region`.
fn tets(rows: &[(usize, &str)], raw: &mut Raw, first: u64) -> Result<(), Fault> {
    let (head, rows) = table(rows, "tetrahedra")?;
    let of = |k: usize, default: u64| head.get(k).copied().unwrap_or(default);
    let size = match of(1, 4) {
        n @ (4 | 10) => n as usize,
        n => return Err(format!("has tetrahedra of {n} nodes; 4 and 10 are read").into()),
    };
    let region = of(2, 0) > 0;
    for row in rows {
        let x: Vec<f64> = numbers(row, 1 + size + usize::from(region))?;
        let mut nodes = Vec::with_capacity(size);
        for tag in &x[1..=size] {
            let n = whole(*tag).and_then(|t| u32::try_from(t - first as i64).ok()).filter(|n| (*n as usize) < raw.nodes.len());
            let message = || format!("names node {tag}, which the .node file does not hold");
            nodes.push(n.ok_or_else(|| Fault { line: Some(row.0), message: message() })?);
        }
        let groups = if region { whole(x[1 + size]).map(|r| format!("region-{r}")) } else { None };
        raw.element(Kind::Tetrahedron, &nodes, groups.as_slice());
    }
    Ok(())
}
