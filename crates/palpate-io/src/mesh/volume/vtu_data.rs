//! Numbers of VTK's XML files: text, base64 or raw bytes behind a head with their size, or blocks of zlib behind one with theirs.

use super::bytes::Fault;
use super::vtu::Attributes;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::io::Read;

/// Where in the file an array stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Place {
    Points,
    Cells,
    PointData,
    CellData,
    Elsewhere,
}

/// Types of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Coded {
    Int8,
    UInt8,
    Int16,
    UInt16,
    Int32,
    UInt32,
    Int64,
    UInt64,
    Float32,
    Float64,
}

impl Coded {
    const ALL: [(&'static str, Coded, usize); 10] = [
        ("Int8", Coded::Int8, 1),
        ("UInt8", Coded::UInt8, 1),
        ("Int16", Coded::Int16, 2),
        ("UInt16", Coded::UInt16, 2),
        ("Int32", Coded::Int32, 4),
        ("UInt32", Coded::UInt32, 4),
        ("Int64", Coded::Int64, 8),
        ("UInt64", Coded::UInt64, 8),
        ("Float32", Coded::Float32, 4),
        ("Float64", Coded::Float64, 8),
    ];

    /// The type of a name.
    pub fn find(name: &str) -> Option<Coded> {
        Coded::ALL.iter().find(|c| c.0 == name).map(|c| c.1)
    }

    /// Bytes of a number.
    pub fn size(self) -> usize {
        Coded::ALL.iter().find(|c| c.1 == self).map_or(8, |c| c.2)
    }

    pub fn is_whole(self) -> bool {
        !matches!(self, Coded::Float32 | Coded::Float64)
    }

    /// A whole number from its bytes, the lowest first.
    pub fn int(self, b: &[u8]) -> i64 {
        let wide = b.iter().rev().fold(0u64, |n, b| n << 8 | u64::from(*b));
        match self {
            Coded::Int8 => i64::from(wide as u8 as i8),
            Coded::Int16 => i64::from(wide as u16 as i16),
            Coded::Int32 => i64::from(wide as u32 as i32),
            _ => wide as i64,
        }
    }

    /// A number from its bytes, the lowest first.
    pub fn real(self, b: &[u8]) -> f64 {
        match (self, b) {
            (Coded::Float32, [a, b, c, d]) => f64::from(f32::from_le_bytes([*a, *b, *c, *d])),
            (Coded::Float64, b) => f64::from_bits(Coded::UInt64.int(b) as u64),
            _ => self.int(b) as f64,
        }
    }
}

/// An array as the XML announces it.
pub(super) struct Array<'a> {
    pub name: String,
    pub place: Place,
    pub coded: Coded,
    pub components: u64,
    pub format: String,
    /// Place in the appended data.
    pub offset: Option<u64>,
    /// What stands in its element.
    pub text: &'a [u8],
}

/// How and where the file keeps its numbers.
#[derive(Default)]
pub(super) struct Store<'a> {
    big_endian: bool,
    /// Bytes of the numbers in a head.
    head: usize,
    zlib: bool,
    /// Appended data, as raw bytes or base64.
    pub appended: &'a [u8],
    pub raw: bool,
    /// Where appended arrays begin, in increasing order.
    pub offsets: Vec<u64>,
}

impl Store<'_> {
    /// From the attributes of the whole file.
    pub fn new(tag: &Attributes) -> Result<Self, Fault> {
        let kind = tag.text("type")?.unwrap_or_default();
        if kind != "UnstructuredGrid" {
            return Err(format!("holds VTK data of type \"{kind}\"; an UnstructuredGrid is needed").into());
        }
        let head = match tag.text("header_type")?.as_deref() {
            None | Some("UInt32") => 4,
            Some("UInt64") => 8,
            Some(other) => return Err(format!("has heads of type {other}; UInt32 and UInt64 are read").into()),
        };
        let zlib = match tag.text("compressor")?.as_deref() {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => {
                return Err(format!("is compressed by {other}; zlib is read: write it with that, or uncompressed").into());
            }
        };
        let big_endian = tag.text("byte_order")?.as_deref() == Some("BigEndian");
        Ok(Store { big_endian, head, zlib, ..Store::default() })
    }

    /// `count` × `components` numbers of an array.
    pub fn reals(&self, array: &Array, count: u64, components: u64) -> Result<Vec<f64>, Fault> {
        self.numbers(array, count, components, Coded::real)
    }

    /// The same of whole numbers.
    pub fn ints(&self, array: &Array, count: u64, components: u64) -> Result<Vec<i64>, Fault> {
        if !array.coded.is_whole() {
            return Err(format!("array \"{}\" must hold whole numbers", array.name).into());
        }
        self.numbers(array, count, components, Coded::int)
    }

    fn numbers<T: std::str::FromStr>(
        &self,
        array: &Array,
        count: u64,
        components: u64,
        number: fn(Coded, &[u8]) -> T,
    ) -> Result<Vec<T>, Fault> {
        let called = if array.name.is_empty() { "of points".to_string() } else { format!("\"{}\"", array.name) };
        if array.components != components {
            return Err(format!("array {called} has {} numbers each, {components} are needed", array.components).into());
        }
        let short = |found: usize| {
            Fault::from(format!(
                "array {called} holds {found} numbers, and {count} × {components} are announced: the file is cut short or damaged"
            ))
        };
        let wanted = count.checked_mul(components).and_then(|n| usize::try_from(n).ok()).ok_or_else(|| short(0))?;
        if array.format == "ascii" {
            let text = std::str::from_utf8(array.text).map_err(|_| Fault::from(format!("array {called} is no text")))?;
            let one = |w: &str| {
                w.parse().map_err(|_| Fault::from(format!("array {called}: \"{}\" stands where a number must", shown(w))))
            };
            let found = text.split_ascii_whitespace().map(one).collect::<Result<Vec<T>, Fault>>()?;
            return if found.len() == wanted { Ok(found) } else { Err(short(found.len())) };
        }
        let size = array.coded.size();
        let damaged = |why: &str| Fault::from(format!("array {called} is damaged: {why}"));
        let mut bytes = self.bytes(array, wanted.saturating_mul(size)).map_err(damaged)?;
        if bytes.len() != wanted.saturating_mul(size) {
            return Err(short(bytes.len() / size));
        }
        if self.big_endian {
            bytes.chunks_exact_mut(size).for_each(<[u8]>::reverse);
        }
        Ok(bytes.chunks_exact(size).map(|b| number(array.coded, b)).collect())
    }

    /// The bytes of an array, at most one more than wanted.
    fn bytes(&self, array: &Array, wanted: usize) -> Result<Vec<u8>, &'static str> {
        const SHORT: &str = "it ends before its head says";
        let coded = match (array.format.as_str(), array.offset) {
            ("binary", _) => decoded(array.text)?,
            ("appended", Some(offset)) => {
                let next = self.offsets.iter().copied().find(|o| *o > offset).unwrap_or(u64::MAX);
                let end = next.min(self.appended.len() as u64) as usize;
                let part = usize::try_from(offset).ok().and_then(|from| self.appended.get(from..end)).ok_or(SHORT)?;
                if self.raw { part.to_vec() } else { decoded(part)? }
            }
            _ => return Err("its format is none of ascii, binary and appended"),
        };
        let head = |k: usize| -> Result<usize, &'static str> {
            let mut bytes = coded.get(k * self.head..(k + 1) * self.head).ok_or(SHORT)?.to_vec();
            if self.big_endian {
                bytes.reverse();
            }
            usize::try_from(Coded::UInt64.int(&bytes) as u64).map_err(|_| SHORT)
        };
        if !self.zlib {
            let size = head(0)?;
            return Ok(coded.get(self.head..).and_then(|b| b.get(..size)).ok_or(SHORT)?.to_vec());
        }
        let blocks = head(0)?;
        // Each block has its size in the head.
        if blocks > coded.len() / self.head {
            return Err(SHORT);
        }
        let mut at = (3 + blocks) * self.head;
        let mut out = Vec::new();
        for k in 0..blocks {
            let size = head(3 + k)?;
            let block = coded.get(at..).and_then(|b| b.get(..size)).ok_or(SHORT)?;
            at += size;
            let left = (wanted + 1).saturating_sub(out.len());
            let unpacked = flate2::read::ZlibDecoder::new(block).take(left as u64).read_to_end(&mut out);
            unpacked.map_err(|_| "zlib cannot unpack it")?;
        }
        Ok(out)
    }
}

/// Bytes of base64; head and numbers may be coded by themselves, each with its own end.
fn decoded(text: &[u8]) -> Result<Vec<u8>, &'static str> {
    let text: Vec<u8> = text.iter().copied().filter(|b| !b.is_ascii_whitespace()).take_while(|b| *b != b'<').collect();
    let (mut out, mut rest) = (Vec::with_capacity(text.len() / 4 * 3), &text[..]);
    while !rest.is_empty() {
        let pad = rest.iter().position(|b| *b == b'=');
        let end = pad.map_or(rest.len(), |p| p + rest[p..].iter().take_while(|b| **b == b'=').count());
        STANDARD.decode_vec(&rest[..end], &mut out).map_err(|_| "its base64 cannot be read")?;
        rest = &rest[end..];
    }
    Ok(out)
}

fn shown(word: &str) -> String {
    word.chars().take(20).collect()
}
