//! Arrays of NumPy: `.npy` files, and `.npz` archives of them.
//!
//! Numbers are read from single and double precision, either byte order, in C or Fortran order; they are written in double precision,
//! little-endian, in C order.

use crate::error::{InputError, OutputError};
use crate::input::read_bytes;
use crate::keys::suggest;
use crate::output::write_file;
use crate::room::{self, gigabytes};
use npyz::{DType, NpyFile, NpyHeader, Order, TypeChar, WriterBuilder};
use std::io::{Cursor, Read, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// Largest array that is read [B]: more is a broken file, or more than a recording of this kind can be used for.
const LARGEST: u64 = 16 << 30;

/// Most brackets within brackets of a header: plain numbers have two, structures with fields a few more. A header that is no Python is given up in
/// a time that grows threefold with every level.
const DEEPEST: usize = 8;

/// An array of numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Array {
    /// Length along every axis.
    pub shape: Vec<usize>,
    /// The numbers, last axis fastest.
    pub values: Vec<f64>,
}

impl Array {
    /// The shape as NumPy prints it.
    pub fn shape_text(&self) -> String {
        let lengths: Vec<String> = self.shape.iter().map(usize::to_string).collect();
        format!("({}{})", lengths.join(", "), if lengths.len() == 1 { "," } else { "" })
    }
}

/// True for the name of an archive.
pub fn is_archive(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npz"))
}

/// Reads an array: of an archive the one of this name, or the only one.
///
/// # Errors
/// The file cannot be read, is no array of real numbers, or has no array of the name.
pub fn read_array(path: &Path, name: Option<&str>) -> Result<Array, InputError> {
    read_numbers(path, name, false)
}

/// `whole`: integers are allowed as well.
fn read_numbers(path: &Path, name: Option<&str>, whole: bool) -> Result<Array, InputError> {
    let bytes = read_bytes(path)?;
    if !is_archive(path) {
        return match name {
            None => decode(path, "", &bytes, whole),
            Some(name) => {
                Err(InputError::file(path, format!("holds one array without a name; \"{name}\" is one of an .npz file")))
            }
        };
    }
    let broken = |e: &dyn std::fmt::Display| InputError::file(path, format!("is not a readable .npz file: {e}"));
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|e| broken(&e))?;
    let bare = |n: std::borrow::Cow<str>| n.strip_suffix(".npy").unwrap_or(&n).to_string();
    let names: Vec<String> = archive.file_names().filter_map(Result::ok).map(bare).collect();
    let known: Vec<&str> = names.iter().map(String::as_str).collect();
    let name = match (name, &known[..]) {
        (Some(name), _) if known.contains(&name) => name,
        (Some(name), _) => {
            return Err(InputError::file(path, format!("holds no array \"{name}\"; {}", suggest(name, &known))));
        }
        (None, [only]) => only,
        (None, _) => {
            return Err(InputError::file(path, format!("holds {} arrays ({}); say which", known.len(), known.join(", "))));
        }
    };
    let member = [format!("{name}.npy"), name.to_string()].into_iter().find(|m| archive.index_for_name(m).is_some());
    let file = archive.by_name(&member.unwrap_or_default()).map_err(|e| broken(&e))?;
    let content = unpack(file).map_err(|e| broken(&e))?;
    decode(path, name, &content, whole)
}

/// Reads whole numbers from 0 on, stored as integers or as floats: indices.
///
/// # Errors
/// As [`read_array`], and numbers that are no such.
pub(crate) fn read_indices(path: &Path, name: Option<&str>) -> Result<Vec<u32>, InputError> {
    let array = read_numbers(path, name, true)?;
    if array.shape.len() != 1 {
        return Err(InputError::file(path, format!("has shape {}, expected one axis", array.shape_text())));
    }
    let index = |(k, x): (usize, &f64)| {
        let is_one = x.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(x);
        is_one.then_some(*x as u32).ok_or_else(|| InputError::file(path, format!("{x} (number {k}) is no index from 0 on")))
    };
    array.values.iter().enumerate().map(index).collect()
}

/// The array in the bytes of an `.npy` file.
///
/// # Errors
/// As [`read_array`].
pub(crate) fn decode_array(path: &Path, bytes: &[u8]) -> Result<Array, InputError> {
    decode(path, "", bytes, false)
}

/// The same, of one with a name.
fn decode(path: &Path, name: &str, bytes: &[u8], whole: bool) -> Result<Array, InputError> {
    let which = if name.is_empty() { String::new() } else { format!("array \"{name}\": ") };
    let wrong = |text: String| InputError::file(path, format!("{which}{text}"));
    let file = open(bytes).map_err(&wrong)?;
    let (dtype, order) = (file.dtype(), file.order());
    let shape: Vec<usize> = file.shape().iter().map(|n| *n as usize).collect();
    let mut stored = TypeChar::Float;
    let size = match &dtype {
        DType::Plain(t) if t.type_char() == TypeChar::Float && [4, 8].contains(&t.size_field()) => t.size_field(),
        DType::Plain(t)
            if whole && matches!(t.type_char(), TypeChar::Int | TypeChar::Uint) && [4, 8].contains(&t.size_field()) =>
        {
            stored = t.type_char();
            t.size_field()
        }
        other => {
            let text = other.descr();
            return Err(wrong(format!("holds {text}, expected float32 or float64; convert it with .astype(numpy.float32)")));
        }
    };
    let short = |e: npyz::DTypeError| wrong(e.to_string());
    let values: Result<Vec<f64>, std::io::Error> = match (stored, size) {
        (TypeChar::Int, 4) => file.data::<i32>().map_err(short)?.map(|x| x.map(f64::from)).collect(),
        (TypeChar::Int, _) => file.data::<i64>().map_err(short)?.map(|x| x.map(|x| x as f64)).collect(),
        (TypeChar::Uint, 4) => file.data::<u32>().map_err(short)?.map(|x| x.map(f64::from)).collect(),
        (TypeChar::Uint, _) => file.data::<u64>().map_err(short)?.map(|x| x.map(|x| x as f64)).collect(),
        (_, 4) => file.data::<f32>().map_err(short)?.map(|x| x.map(f64::from)).collect(),
        _ => file.data::<f64>().map_err(short)?.collect(),
    };
    let values = values.map_err(|e| wrong(format!("is not a readable .npy file: {e}")))?;
    Ok(Array { values: if order == Order::Fortran { to_c_order(&shape, &values) } else { values }, shape })
}

/// The bytes of an archive's member.
///
/// # Errors
/// The archive is damaged, or the member takes more than half of the memory that is left: its numbers need as much again.
pub fn unpack(member: impl Read) -> std::io::Result<Vec<u8>> {
    unfold(member, room::available().map_or(LARGEST, |r| LARGEST.min(r.bytes / 2)))
}

/// The bytes of a member that has at most so many: an archive of a thousandth of them can hold it.
fn unfold(member: impl Read, most: u64) -> std::io::Result<Vec<u8>> {
    let mut content = Vec::new();
    member.take(most.saturating_add(1)).read_to_end(&mut content)?;
    match content.len() as u64 > most {
        true => Err(std::io::Error::other(format!("an array has more than {}, all that there is room for", gigabytes(most)))),
        false => Ok(content),
    }
}

/// Opens an `.npy` file: its header is read, its numbers are next, and none of them is missing.
///
/// # Errors
/// In words: it is no such file, or its header says what cannot be.
pub fn open(bytes: &[u8]) -> Result<NpyFile<&[u8]>, String> {
    check(header(bytes))?;
    let mut rest = bytes;
    let header = NpyHeader::from_reader(&mut rest).map_err(|e| format!("is not a readable .npy file: {e}"))?;
    // Counted before anything is allocated: what a header says may be anything. Python's objects have no size.
    let size = header.dtype().num_bytes().unwrap_or(0) as u64;
    if header.len().checked_mul(size).is_none_or(|n| n > rest.len() as u64) {
        return Err(format!("ends before its {} numbers", header.len()));
    }
    Ok(NpyFile::with_header(header, rest))
}

/// The text of the header, behind the magic number, the version and its own length.
fn header(bytes: &[u8]) -> &[u8] {
    let length = |bytes: &[u8]| bytes.iter().rev().fold(0, |n, b| n << 8 | usize::from(*b));
    let from = if bytes.get(6) == Some(&1) { 10 } else { 12 };
    let Some((start, rest)) = bytes.split_at_checked(from) else { return &[] };
    &rest[..length(&start[8..]).min(rest.len())]
}

/// Refuses a header that would keep the reader of Python's literals busy, or whose lengths it would multiply beyond 64 bits.
///
/// Outside of strings, NumPy writes brackets, whole numbers, `True` and `False` alone. Lengths of axes have two brackets around them; numbers
/// with more are of structures, whose size the reader checks itself.
fn check(header: &[u8]) -> Result<(), String> {
    let odd = || Err("is not a readable .npy file: its header is none that NumPy writes".to_string());
    // In three quotation marks, a string could hide what follows it.
    if header.windows(3).any(|w| w == b"'''" || w == b"\"\"\"") {
        return odd();
    }
    let (mut depth, mut count) = (0usize, 1u64);
    for word in outside_of_strings(header).chunk_by(|a, b| a.is_ascii_alphanumeric() && b.is_ascii_alphanumeric()) {
        match word {
            b"(" | b"[" | b"{" if depth < DEEPEST => depth += 1,
            b")" | b"]" | b"}" => depth = depth.saturating_sub(1),
            b"True" | b"False" | b":" | b"," | b"'" | b"\"" => {}
            [c] if c.is_ascii_whitespace() => {}
            digits if digits.iter().all(u8::is_ascii_digit) => {
                let number = String::from_utf8_lossy(digits).parse().map(|n: u64| if depth > 2 { 1 } else { n.max(1) });
                match number.ok().and_then(|n| count.checked_mul(n)) {
                    Some(n) => count = n,
                    None => return Err("has a shape that no array has".into()),
                }
            }
            _ => return odd(),
        }
    }
    Ok(())
}

/// The header with only the first mark of every string, so that no word goes on behind it.
fn outside_of_strings(header: &[u8]) -> Vec<u8> {
    let (mut within, mut escaped) = (None, false);
    let mut is_kept = |c: &u8| {
        let kept = within.is_none();
        match within {
            Some(_) if escaped => escaped = false,
            Some(_) if *c == b'\\' => escaped = true,
            Some(mark) if mark == *c => within = None,
            None if matches!(c, b'\'' | b'"') => within = Some(*c),
            _ => {}
        }
        kept
    };
    header.iter().copied().filter(|c| is_kept(c)).collect()
}

/// Numbers in Fortran order (first axis fastest) with the last axis fastest.
pub fn to_c_order<T: Copy>(shape: &[usize], values: &[T]) -> Vec<T> {
    let mut strides = Vec::with_capacity(shape.len());
    let mut stride = 1;
    for n in shape {
        strides.push(stride);
        stride *= n;
    }
    let mut index = vec![0; shape.len()];
    (0..values.len())
        .map(|_| {
            let at: usize = index.iter().zip(&strides).map(|(i, s)| i * s).sum();
            for a in (0..shape.len()).rev() {
                index[a] += 1;
                if index[a] < shape[a] {
                    break;
                }
                index[a] = 0;
            }
            values[at]
        })
        .collect()
}

/// Writes an archive of named arrays.
///
/// # Errors
/// The file that could not be written and why.
pub fn write_npz(path: impl AsRef<Path>, arrays: &[(&str, &Array)]) -> Result<(), OutputError> {
    write(path.as_ref(), arrays)
}

fn write(path: &Path, arrays: &[(&str, &Array)]) -> Result<(), OutputError> {
    write_file(path, |out| {
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored).large_file(true);
        for (name, array) in arrays {
            archive.start_file(format!("{name}.npy"), options)?;
            archive.write_all(&encode(array)?)?;
        }
        out.write_all(&archive.finish()?.into_inner())
    })
}

fn encode(array: &Array) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let shape: Vec<u64> = array.shape.iter().map(|n| *n as u64).collect();
    let mut writer = npyz::WriteOptions::new().default_dtype().shape(&shape).writer(&mut bytes).begin_nd()?;
    writer.extend(array.values.iter().copied())?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
#[path = "npy_tests.rs"]
mod tests;
