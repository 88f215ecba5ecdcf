//! Points of PLY files; everything but their coordinates is passed over.

use super::CloudFile;
use crate::error::InputError;
use crate::mesh::announces_no_more_than_it_holds;
use glam::DVec3;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};
use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;

/// An element: a vertex has all three coordinates.
struct Element([Option<f64>; 3]);

impl PropertyAccess for Element {
    fn new() -> Element {
        Element([None; 3])
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let Some(axis) = ["x", "y", "z"].iter().position(|n| *n == name) else { return PropertyAccessResult::Ignored };
        self.0[axis] = match value {
            Property::Float(x) => Some(f64::from(x)),
            Property::Double(x) => Some(x),
            Property::Int(x) => Some(f64::from(x)),
            Property::UInt(x) => Some(f64::from(x)),
            Property::Short(x) => Some(f64::from(x)),
            Property::UShort(x) => Some(f64::from(x)),
            Property::Char(x) => Some(f64::from(x)),
            Property::UChar(x) => Some(f64::from(x)),
            _ => None,
        };
        PropertyAccessResult::Set
    }
}

/// Bytes that the crate reads: in text it knows numbers alone, and what writers print where there is none becomes one that is not finite.
fn readable(bytes: &[u8]) -> Cow<'_, [u8]> {
    const END: &[u8] = b"end_header";
    let Some(end) = bytes.windows(END.len()).position(|w| w == END) else { return bytes.into() };
    let (head, body) = bytes.split_at(end + END.len());
    if !head.windows(12).any(|w| w == b"format ascii") {
        return bytes.into();
    }
    let text = String::from_utf8_lossy(body);
    let none = |word: &str| {
        let bare = word.trim_start_matches(['-', '+']).to_ascii_lowercase();
        bare.starts_with("nan") || bare.starts_with("inf")
    };
    if !text.split_ascii_whitespace().any(none) {
        return bytes.into();
    }
    let word = |w: &str| if none(w.trim_end()) { w.replace(w.trim_end(), "1e999") } else { w.to_string() };
    let whole: String = text.split_inclusive([' ', '\t', '\n']).map(word).collect();
    [head, whole.as_bytes()].concat().into()
}

/// The points of a file's bytes.
pub(super) fn decode(path: &Path, bytes: &[u8]) -> Result<CloudFile, InputError> {
    let wrong = |text: String| InputError::file(path, text);
    let bytes = readable(bytes);
    announces_no_more_than_it_holds(&bytes).map_err(&wrong)?;
    let ply = Parser::<Element>::new()
        .read_ply(&mut Cursor::new(&bytes[..]))
        .map_err(|e| wrong(format!("not a readable PLY file: {e}")))?;
    let vertices = ply.payload.get("vertex").ok_or_else(|| wrong("has no element \"vertex\"".into()))?;
    let point = |(i, v): (usize, &Element)| match v.0 {
        [Some(x), Some(y), Some(z)] => Ok(DVec3::new(x, y, z)),
        _ => Err(wrong(format!("vertex {} lacks x, y or z", i + 1))),
    };
    let points = vertices.iter().enumerate().map(point).collect::<Result<_, _>>()?;
    let stamp = |c: &str| match c.split_whitespace().collect::<Vec<_>>()[..] {
        ["time", t] => t.parse::<f64>().ok().filter(|t| t.is_finite()),
        _ => None,
    };
    Ok(CloudFile { points, viewpoint: None, time: ply.header.comments.iter().find_map(|c| stamp(c)) })
}
