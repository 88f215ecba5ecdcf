//! Points of PCD files (Point Cloud Library), as text, binary and compressed. A file is a header and columns of numbers: read here, where every
//! announced size is checked before room is made.

use super::CloudFile;
use crate::error::InputError;
use glam::DVec3;
use std::path::Path;

/// A column of numbers: bytes of one, kind (I, U or F), how many a point has.
#[derive(Clone, Debug)]
struct Field {
    name: String,
    size: usize,
    kind: char,
    count: usize,
}

fn refuse<T>(file: &Path, message: impl Into<String>) -> Result<T, InputError> {
    Err(InputError::file(file, message))
}

/// The points of a file's bytes, and its viewpoint.
pub(super) fn decode(file: &Path, bytes: &[u8]) -> Result<CloudFile, InputError> {
    let mut fields: Vec<Field> = Vec::new();
    let (mut width, mut height, mut announced, mut viewpoint) = (None, None, None, None);
    let (mut at, mut line) = (0, 0);
    let data = loop {
        let Some(end) = bytes[at..].iter().position(|b| *b == b'\n') else {
            return refuse(file, "is no PCD file: it ends before its line DATA");
        };
        let text = String::from_utf8_lossy(&bytes[at..at + end]).trim().to_string();
        (at, line) = (at + end + 1, line + 1);
        let mut words = text.split_whitespace();
        let Some(key) = words.next().filter(|k| !k.starts_with('#')) else { continue };
        let values: Vec<&str> = words.collect();
        let wrong = |what: &str| InputError::line(file, line, format!("{key} {}: {what}", values.join(" ")));
        let whole = |i: usize| values.get(i).and_then(|v| v.parse::<usize>().ok());
        let listed = |fields: &[Field]| {
            let all: Option<Vec<usize>> = (0..values.len()).map(&whole).collect();
            all.filter(|a| a.len() == fields.len() && a.iter().all(|n| (1..=1024).contains(n)))
        };
        match key {
            "VERSION" => {}
            "FIELDS" | "COLUMNS" => {
                let field = |n: &&str| Field { name: n.to_string(), size: 4, kind: 'F', count: 1 };
                fields = values.iter().map(field).collect();
            }
            "SIZE" => {
                let all = listed(&fields).ok_or_else(|| wrong("must be one of 1, 2, 4, 8 for every field"))?;
                fields.iter_mut().zip(all).for_each(|(f, n)| f.size = n);
            }
            "COUNT" => {
                let all = listed(&fields).ok_or_else(|| wrong("must be 1 to 1024 for every field"))?;
                fields.iter_mut().zip(all).for_each(|(f, n)| f.count = n);
            }
            "TYPE" if values.len() == fields.len() => {
                fields.iter_mut().zip(&values).for_each(|(f, v)| f.kind = v.chars().next().unwrap_or('?'));
            }
            "WIDTH" => width = Some(whole(0).ok_or_else(|| wrong("must be a whole number"))?),
            "HEIGHT" => height = Some(whole(0).ok_or_else(|| wrong("must be a whole number"))?),
            "POINTS" => announced = Some(whole(0).ok_or_else(|| wrong("must be a whole number"))?),
            "VIEWPOINT" => viewpoint = values.iter().take(3).map(|v| v.parse::<f64>().ok()).collect::<Option<Vec<f64>>>(),
            "DATA" => break values.first().unwrap_or(&"").to_string(),
            _ => return Err(wrong("is no line of a PCD header")),
        }
        if line > 64 {
            return refuse(file, "is no PCD file: it has no line DATA");
        }
    };
    let count = match (width.zip(height).and_then(|(w, h)| w.checked_mul(h)), announced) {
        (Some(n), Some(p)) if n != p => return refuse(file, format!("WIDTH × HEIGHT is {n}, POINTS is {p}")),
        (Some(n), _) | (None, Some(n)) => n,
        _ => return refuse(file, "states neither WIDTH and HEIGHT nor POINTS"),
    };
    let Some(columns) = ["x", "y", "z"].iter().map(|n| fields.iter().position(|f| f.name == *n)).collect::<Option<Vec<usize>>>()
    else {
        return refuse(file, "FIELDS lack x, y or z");
    };
    let body = &bytes[at..];
    let points = match data.as_str() {
        "ascii" => text_points(file, body, line, &fields, &columns, count)?,
        "binary" => binary_points(file, body, &fields, &columns, count, false)?,
        "binary_compressed" => {
            let content = match decompress(body) {
                Ok(c) => c,
                Err(e) => return refuse(file, e),
            };
            binary_points(file, &content, &fields, &columns, count, true)?
        }
        other => return refuse(file, format!("DATA {other} is not read; allowed: ascii, binary, binary_compressed")),
    };
    let viewpoint =
        viewpoint.filter(|v| v.len() == 3).map(|v| DVec3::from_slice(&v)).filter(|v| *v != DVec3::ZERO && v.is_finite());
    Ok(CloudFile { points, viewpoint, time: None })
}

fn text_points(
    file: &Path,
    body: &[u8],
    head: usize,
    fields: &[Field],
    columns: &[usize],
    count: usize,
) -> Result<Vec<DVec3>, InputError> {
    let before = |c: usize| fields[..c].iter().map(|f| f.count).sum::<usize>();
    let at = [before(columns[0]), before(columns[1]), before(columns[2])];
    let mut points = Vec::new();
    for (i, line) in String::from_utf8_lossy(body).lines().enumerate().filter(|(_, l)| !l.trim().is_empty()) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let p = at.map(|k| words.get(k).and_then(|w| w.parse::<f64>().ok()));
        let [Some(x), Some(y), Some(z)] = p else {
            return Err(InputError::line(file, head + i + 1, "has no x, y and z"));
        };
        points.push(DVec3::new(x, y, z));
    }
    if points.len() != count {
        return refuse(file, format!("holds {} points, its header announces {count}", points.len()));
    }
    Ok(points)
}

fn binary_points(
    file: &Path,
    body: &[u8],
    fields: &[Field],
    columns: &[usize],
    count: usize,
    by_field: bool,
) -> Result<Vec<DVec3>, InputError> {
    let bytes_of = |f: &Field| f.size * f.count;
    let stride: usize = fields.iter().map(bytes_of).sum();
    if stride.checked_mul(count).is_none_or(|n| n > body.len()) {
        return refuse(file, format!("ends before its {count} points of {stride} bytes"));
    }
    let before = |c: usize| fields[..c].iter().map(bytes_of).sum::<usize>();
    let value = |i: usize, c: usize| -> Option<f64> {
        let f = &fields[c];
        // Compressed files go field by field.
        let at = if by_field { before(c) * count + i * bytes_of(f) } else { i * stride + before(c) };
        let b = body.get(at..at + f.size)?;
        match (f.kind, f.size) {
            ('F', 4) => Some(f64::from(f32::from_le_bytes(b.try_into().ok()?))),
            ('F', 8) => Some(f64::from_le_bytes(b.try_into().ok()?)),
            ('I', 2) => Some(f64::from(i16::from_le_bytes(b.try_into().ok()?))),
            ('I', 4) => Some(f64::from(i32::from_le_bytes(b.try_into().ok()?))),
            ('U', 2) => Some(f64::from(u16::from_le_bytes(b.try_into().ok()?))),
            ('U', 4) => Some(f64::from(u32::from_le_bytes(b.try_into().ok()?))),
            _ => None,
        }
    };
    let point = |i: usize| Some(DVec3::new(value(i, columns[0])?, value(i, columns[1])?, value(i, columns[2])?));
    match (0..count).map(point).collect() {
        Some(points) => Ok(points),
        None => refuse(file, "x, y and z are of a type and size that is not read (F 4, F 8, I or U 2 and 4)"),
    }
}

/// Sizes before and after, then LZF: runs of literals, and copies of what went before.
fn decompress(body: &[u8]) -> Result<Vec<u8>, String> {
    let size = |at: usize| Some(u32::from_le_bytes(body.get(at..at + 4)?.try_into().ok()?) as usize);
    let (Some(packed), Some(full)) = (size(0), size(4)) else { return Err("ends before its compressed data".into()) };
    let Some(input) = body.get(8..8 + packed) else {
        return Err(format!("holds {} bytes of compressed data, announces {packed}", body.len() - 8));
    };
    let damaged = || "holds damaged compressed data".to_string();
    let mut out: Vec<u8> = Vec::new();
    let mut at = 0;
    let next = |n: &mut usize| -> Option<u8> {
        *n += 1;
        input.get(*n - 1).copied()
    };
    while at < input.len() {
        let control = usize::from(next(&mut at).ok_or_else(damaged)?);
        if control < 32 {
            let run = input.get(at..at + control + 1).ok_or_else(damaged)?;
            out.extend_from_slice(run);
            at += control + 1;
        } else {
            let mut length = control >> 5;
            if length == 7 {
                length += usize::from(next(&mut at).ok_or_else(damaged)?);
            }
            let back = ((control & 31) << 8) + usize::from(next(&mut at).ok_or_else(damaged)?) + 1;
            let from = out.len().checked_sub(back).ok_or_else(damaged)?;
            // Copies may overlap what they write.
            for k in from..from + length + 2 {
                out.push(out[k]);
            }
        }
        if out.len() > full {
            return Err(damaged());
        }
    }
    if out.len() == full { Ok(out) } else { Err(format!("decompresses to {} bytes, announces {full}", out.len())) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compressed_data_come_back() {
        // "abcabcabcabcX": literals abc, a copy of nine from three before, a literal.
        let packed = [2, b'a', b'b', b'c', 7 << 5, 0, 2, 0, b'X'];
        let mut body = vec![packed.len() as u8, 0, 0, 0, 13, 0, 0, 0];
        body.extend(packed);
        assert_eq!(decompress(&body).unwrap(), b"abcabcabcabcX");
        for cut in 0..body.len() {
            assert!(decompress(&body[..cut]).is_err(), "{cut}");
        }
        // A copy of what was never there.
        assert!(decompress(&[3, 0, 0, 0, 3, 0, 0, 0, 32, 200, 0]).is_err());
    }
}
