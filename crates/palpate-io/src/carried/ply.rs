//! Vertices of binary PLY files, changed in place: coordinates, normals, and of splats orientation, size and colour.
//!
//! The head is read by `ply-rs-bw`. That crate looks every property up by its name, which at 62 properties a splat takes seconds a frame; here
//! each is found once.

use super::Moved;
use glam::{DMat3, DQuat, DVec3};
use palpate_model::mechanics::rotation::polar;
use palpate_model::mechanics::splat::{FUNCTIONS, Turner, deformed};
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, ElementDef, Encoding, PropertyType, ScalarType};
use rayon::prelude::*;
use std::io::Cursor;

/// A property of a vertex: where it begins in its row, and whether it has eight bytes.
#[derive(Clone, Copy, Debug)]
struct Column {
    at: usize,
    double: bool,
}

impl Column {
    fn get(self, row: &[u8]) -> f64 {
        if self.double {
            f64::from_le_bytes(std::array::from_fn(|k| row[self.at + k]))
        } else {
            f64::from(f32::from_le_bytes(std::array::from_fn(|k| row[self.at + k])))
        }
    }

    fn put(self, row: &mut [u8], value: f64) {
        if self.double {
            row[self.at..self.at + 8].copy_from_slice(&value.to_le_bytes());
        } else {
            row[self.at..self.at + 4].copy_from_slice(&(value as f32).to_le_bytes());
        }
    }
}

type Three = [Column; 3];

/// Columns of a splat.
#[derive(Debug)]
struct Splat {
    /// Logarithms of the standard deviations.
    scales: Three,
    /// Quaternion, w first, of any length.
    rotation: [Column; 4],
    /// Harmonics from degree 1 on, channel by channel.
    colours: [Vec<Column>; 3],
    turner: Turner,
}

/// A file of vertices.
#[derive(Debug)]
pub(super) struct Vertices {
    bytes: Vec<u8>,
    /// Where the vertices begin and end.
    rows: std::ops::Range<usize>,
    /// Bytes of a vertex.
    stride: usize,
    places: Three,
    normals: Option<Three>,
    splat: Option<Splat>,
}

fn size(t: &ScalarType) -> usize {
    match t {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

/// Finds columns of one kind by their names.
struct Table(Vec<(String, Option<Column>)>);

impl Table {
    /// The columns of an element, and the bytes of a row.
    fn new(vertex: &ElementDef) -> Result<(Table, usize), String> {
        let (mut columns, mut at) = (Vec::new(), 0);
        for (name, property) in &vertex.properties {
            let PropertyType::Scalar(kind) = &property.data_type else {
                return Err(format!("vertices have a list, \"{name}\", which is not read here"));
            };
            let double = matches!(kind, ScalarType::Double);
            let real = double || matches!(kind, ScalarType::Float);
            columns.push((name.clone(), real.then_some(Column { at, double })));
            at += size(kind);
        }
        Ok((Table(columns), at))
    }

    fn has(&self, name: &str) -> bool {
        self.0.iter().any(|c| c.0 == name)
    }

    fn one(&self, name: &str) -> Result<Column, String> {
        match self.0.iter().find(|c| c.0 == name) {
            Some((_, Some(column))) => Ok(*column),
            Some(_) => Err(format!("\"{name}\" of the vertices is neither float nor double")),
            None => Err(format!("vertices have no \"{name}\"")),
        }
    }

    fn some<const N: usize>(&self, names: [&str; N]) -> Result<[Column; N], String> {
        let found = names.iter().map(|n| self.one(n)).collect::<Result<Vec<_>, _>>()?;
        found.try_into().map_err(|_| "lacks columns".to_string())
    }

    fn splat(&self) -> Result<Splat, String> {
        let rest = self.0.iter().filter(|c| c.0.starts_with("f_rest_")).count();
        let channel = rest / 3;
        if ![0, 3, 8, FUNCTIONS].contains(&channel) || rest % 3 != 0 {
            return Err(format!(
                "splats have {rest} numbers f_rest_…; allowed are 0, 9, 24 and 45, those of harmonics to degree 0 to 3"
            ));
        }
        let of = |c: usize| (0..channel).map(|k| self.one(&format!("f_rest_{}", c * channel + k))).collect::<Result<Vec<_>, _>>();
        Ok(Splat {
            scales: self.some(["scale_0", "scale_1", "scale_2"])?,
            rotation: self.some(["rot_0", "rot_1", "rot_2", "rot_3"])?,
            colours: [of(0)?, of(1)?, of(2)?],
            turner: Turner::default(),
        })
    }
}

pub(super) fn read(bytes: Vec<u8>) -> Result<(Vec<DVec3>, Vertices), String> {
    const END: &[u8] = b"end_header";
    let unreadable = |e: &dyn std::fmt::Display| format!("not a readable PLY file: {e}");
    let header = Parser::<DefaultElement>::new().read_ply_header(&mut Cursor::new(&bytes[..])).map_err(|e| unreadable(&e))?;
    if header.encoding != Encoding::BinaryLittleEndian {
        return Err("its numbers are not binary_little_endian, which is what is read here; save it as binary PLY".into());
    }
    let end = bytes.windows(END.len()).position(|w| w == END).ok_or_else(|| unreadable(&"it has no end_header"))?;
    let line = bytes[end..].iter().position(|b| *b == b'\n').ok_or_else(|| unreadable(&"its head does not end"))?;
    let first = end + line + 1;
    let Some((_, vertex)) = header.elements.iter().next().filter(|(name, _)| *name == "vertex") else {
        return Err("the first element is not \"vertex\"".into());
    };
    let (table, stride) = Table::new(vertex)?;
    let places = table.some(["x", "y", "z"])?;
    let rows = vertex.count.checked_mul(stride).and_then(|n| n.checked_add(first)).filter(|last| *last <= bytes.len());
    let last = rows.ok_or_else(|| format!("announces {} vertices of {stride} bytes and is shorter", vertex.count))?;
    let normals = if table.has("nx") { Some(table.some(["nx", "ny", "nz"])?) } else { None };
    let splat = if table.has("scale_0") || table.has("rot_0") { Some(table.splat()?) } else { None };
    let of = |row: &[u8]| DVec3::from_array(places.map(|c| c.get(row)));
    let all = bytes[first..last].chunks_exact(stride).map(of).collect();
    Ok((all, Vertices { rows: first..last, bytes, stride, places, normals, splat }))
}

impl Vertices {
    pub(super) fn noun(&self) -> &'static str {
        if self.splat.is_some() { "splats" } else { "vertices" }
    }

    pub(super) fn moved(&self, moved: impl Fn(usize) -> Moved + Sync) -> Vec<u8> {
        let mut bytes = self.bytes.clone();
        bytes[self.rows.clone()].par_chunks_exact_mut(self.stride).enumerate().for_each(|(number, row)| {
            let (place, f) = moved(number);
            self.places.iter().zip(place.to_array()).for_each(|(c, x)| c.put(row, x));
            if self.normals.is_none() && self.splat.is_none() {
                return;
            }
            let turn = polar(f);
            if let Some(columns) = self.normals {
                let normal = turn * DVec3::from_array(columns.map(|c| c.get(row)));
                columns.iter().zip(normal.to_array()).for_each(|(c, x)| c.put(row, x));
            }
            if let Some(splat) = &self.splat {
                splat.carry(row, f, turn);
            }
        });
        bytes
    }
}

impl Splat {
    fn carry(&self, row: &mut [u8], f: DMat3, turn: DMat3) {
        let [w, x, y, z] = self.rotation.map(|c| c.get(row));
        let q = DQuat::from_xyzw(x, y, z, w);
        // A quaternion of zero says nothing; programs take it for none.
        let q = if q.length() > 0.0 { q } else { DQuat::IDENTITY };
        let (q, scales) = deformed(f, q, DVec3::from_array(self.scales.map(|c| c.get(row).exp())));
        self.rotation.iter().zip([q.w, q.x, q.y, q.z]).for_each(|(c, v)| c.put(row, v));
        self.scales.iter().zip(scales.to_array()).for_each(|(c, v)| c.put(row, v.max(f64::from(f32::MIN_POSITIVE)).ln()));
        if self.colours[0].is_empty() {
            return;
        }
        let mut numbers = [[0.0; FUNCTIONS]; 3];
        for (n, columns) in numbers.iter_mut().zip(&self.colours) {
            n.iter_mut().zip(columns).for_each(|(n, c)| *n = c.get(row));
        }
        let mut channels = numbers.each_mut().map(|n| &mut n[..self.colours[0].len()]);
        self.turner.turn(turn, &mut channels);
        for (n, columns) in numbers.iter().zip(&self.colours) {
            columns.iter().zip(n).for_each(|(c, v)| c.put(row, *v));
        }
    }
}
