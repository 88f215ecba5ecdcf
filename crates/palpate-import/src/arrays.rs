//! Arrays of NumPy with whole numbers or floats, by themselves or in an archive. Recordings hold floats alone; depth images are whole numbers.

use crate::error::{ImportError, read, refuse};
use npyz::{DType, NpyFile, Order, TypeChar};
use palpate_io::npy::{open, to_c_order, unpack};
use std::io::Cursor;
use std::path::Path;
use zip::ZipArchive;

/// Numbers as they are stored.
#[derive(Clone, Debug, PartialEq)]
pub enum Numbers {
    /// Unsigned 16-bit, as depth cameras write.
    Counts(Vec<u16>),
    /// All other whole numbers.
    Whole(Vec<i64>),
    /// Single or double precision.
    Real(Vec<f64>),
}

/// An array.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Its name in an archive.
    pub name: String,
    /// Length along every axis.
    pub shape: Vec<usize>,
    /// The numbers, last axis fastest.
    pub numbers: Numbers,
}

impl Array {
    /// The shape as NumPy prints it.
    pub fn shape_text(&self) -> String {
        format!("{:?}", self.shape).replace('[', "(").replace(']', if self.shape.len() == 1 { ",)" } else { ")" })
    }

    /// As floats.
    pub fn reals(&self) -> Vec<f64> {
        match &self.numbers {
            Numbers::Counts(c) => c.iter().map(|x| f64::from(*x)).collect(),
            Numbers::Whole(w) => w.iter().map(|x| *x as f64).collect(),
            Numbers::Real(r) => r.clone(),
        }
    }
}

/// All arrays of a file; one of an `.npy` file is called by nothing. Arrays that hold no numbers (texts, objects) are passed over in an archive.
pub fn read_arrays(path: &Path) -> Result<Vec<Array>, ImportError> {
    let bytes = read(path)?;
    if !bytes.starts_with(b"PK") {
        return match decode("", &bytes) {
            Ok(Some(a)) => Ok(vec![a]),
            Ok(None) => refuse(path, "holds no numbers: whole numbers or floats are read"),
            Err(e) => refuse(path, e),
        };
    }
    let broken = |e: &dyn std::fmt::Display| refuse(path, format!("is not a readable .npz file: {e}"));
    let mut archive = match ZipArchive::new(Cursor::new(bytes)) {
        Ok(a) => a,
        Err(e) => return broken(&e),
    };
    let mut arrays = Vec::new();
    for i in 0..archive.len() {
        let file = match archive.by_index(i) {
            Ok(file) => file,
            Err(e) => return broken(&e),
        };
        let name = file.name().map_or_else(|_| format!("array {i}"), |n| n.to_string());
        let content = match unpack(file) {
            Ok(content) => content,
            Err(e) => return broken(&e),
        };
        match decode(name.strip_suffix(".npy").unwrap_or(&name), &content) {
            Ok(a) => arrays.extend(a),
            Err(e) => return refuse(path, format!("array \"{name}\": {e}")),
        }
    }
    Ok(arrays)
}

/// The array in the bytes of an `.npy` file; `None` where it holds no numbers.
fn decode(name: &str, bytes: &[u8]) -> Result<Option<Array>, String> {
    let file = open(bytes)?;
    let (dtype, order) = (file.dtype(), file.order());
    let shape: Vec<usize> = file.shape().iter().map(|n| *n as usize).collect();
    let DType::Plain(t) = &dtype else { return Ok(None) };
    let (kind, size) = (t.type_char(), t.size_field());
    fn all<T: npyz::Deserialize>(file: NpyFile<&[u8]>) -> Result<Vec<T>, String> {
        let data = file.data::<T>().map_err(|e| e.to_string())?;
        data.collect::<Result<Vec<T>, _>>().map_err(|e| format!("is not a readable .npy file: {e}"))
    }
    let wide = |v: Vec<i64>| Numbers::Whole(v);
    let numbers = match (kind, size) {
        (TypeChar::Uint, 2) => Numbers::Counts(all::<u16>(file)?),
        (TypeChar::Bool, 1) => wide(all::<bool>(file)?.into_iter().map(i64::from).collect()),
        (TypeChar::Uint, 1) => wide(all::<u8>(file)?.into_iter().map(i64::from).collect()),
        (TypeChar::Uint, 4) => wide(all::<u32>(file)?.into_iter().map(i64::from).collect()),
        (TypeChar::Uint, 8) => wide(all::<u64>(file)?.into_iter().map(|x| x.min(i64::MAX as u64) as i64).collect()),
        (TypeChar::Int, 1) => wide(all::<i8>(file)?.into_iter().map(i64::from).collect()),
        (TypeChar::Int, 2) => wide(all::<i16>(file)?.into_iter().map(i64::from).collect()),
        (TypeChar::Int, 4) => wide(all::<i32>(file)?.into_iter().map(i64::from).collect()),
        (TypeChar::Int, 8) => wide(all::<i64>(file)?),
        (TypeChar::Float, 4) => Numbers::Real(all::<f32>(file)?.into_iter().map(f64::from).collect()),
        (TypeChar::Float, 8) => Numbers::Real(all::<f64>(file)?),
        _ => return Ok(None),
    };
    let numbers = match (order, numbers) {
        (Order::C, n) => n,
        (Order::Fortran, Numbers::Counts(v)) => Numbers::Counts(to_c_order(&shape, &v)),
        (Order::Fortran, Numbers::Whole(v)) => Numbers::Whole(to_c_order(&shape, &v)),
        (Order::Fortran, Numbers::Real(v)) => Numbers::Real(to_c_order(&shape, &v)),
    };
    Ok(Some(Array { name: name.to_string(), shape, numbers }))
}
