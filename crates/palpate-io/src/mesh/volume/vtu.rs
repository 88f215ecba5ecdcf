//! VTK's XML files of unstructured grids (VTK file formats, "UnstructuredGrid"): points, cells, and groups by whole-numbered arrays.

use super::Raw;
use super::bytes::Fault;
use super::kinds;
use super::vtu_data::{Array, Coded, Place, Store};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::borrow::Cow;

/// What the XML says, without the numbers.
#[derive(Default)]
struct Outline<'a> {
    store: Store<'a>,
    /// Points and cells that the piece announces.
    counts: Option<[u64; 2]>,
    arrays: Vec<Array<'a>>,
}

/// Reads a grid of one piece, its arrays as text, binary or appended, compressed with zlib or not.
pub(super) fn read(bytes: &[u8]) -> Result<Raw, Fault> {
    let outline = outline(bytes)?;
    let [points, cells] = outline.counts.ok_or("holds no piece of a grid")?;
    let mut raw = Raw::default();
    let find = |place: Place, name: &str| {
        let found = outline.arrays.iter().find(|a| a.place == place && (place == Place::Points || a.name == name));
        found.ok_or_else(|| Fault::from(format!("has no array of {}", if place == Place::Points { "points" } else { name })))
    };
    let store = &outline.store;
    let places = store.reals(find(Place::Points, "")?, points, 3)?;
    raw.nodes = places.chunks_exact(3).map(|x| [x[0], x[1], x[2]].into()).collect();
    let ends = store.ints(find(Place::Cells, "offsets")?, cells, 1)?;
    let types = store.ints(find(Place::Cells, "types")?, cells, 1)?;
    let connectivity = find(Place::Cells, "connectivity")?;
    let all = ends.last().copied().unwrap_or(0);
    let all = u64::try_from(all).map_err(|_| Fault::from("has cells that end before they begin"))?;
    let connectivity = store.ints(connectivity, all, 1)?;
    let cells = cells_of(&mut raw, &connectivity, &ends, &types)?;
    let own: Vec<[u32; 1]> = (0..raw.nodes.len() as u32).map(|n| [n]).collect();
    for array in outline.arrays.iter().filter(|a| a.components == 1 && a.coded.is_whole()) {
        match array.place {
            Place::PointData => {
                let values = store.ints(array, points, 1)?;
                raw.by_values(&array.name, &values, |n| &own[n]);
            }
            Place::CellData => {
                let values = store.ints(array, cells.len() as u64, 1)?;
                raw.by_values(&array.name, &values, |e| &cells[e]);
            }
            _ => {}
        }
    }
    Ok(raw)
}

/// Takes cells into the mesh and returns the nodes of every one.
pub(super) fn cells_of(raw: &mut Raw, connectivity: &[i64], ends: &[i64], types: &[i64]) -> Result<Vec<Vec<u32>>, Fault> {
    let mut cells = Vec::with_capacity(ends.len());
    let mut begin = 0;
    for (e, (end, of)) in ends.iter().zip(types).enumerate() {
        let kind = kinds::vtk(*of).ok_or_else(|| Fault::from(format!("cell {e} is of type {of}, which is not known")))?;
        let part = usize::try_from(*end).ok().and_then(|end| connectivity.get(begin..end));
        let part = part.ok_or_else(|| Fault::from(format!("cell {e} ends before it begins, or after all cells")))?;
        begin += part.len();
        let node = |n: &i64| u32::try_from(*n).ok().filter(|n| (*n as usize) < raw.nodes.len());
        let nodes = part
            .iter()
            .map(|n| node(n).ok_or_else(|| Fault::from(format!("cell {e} names node {n}, but there are {}", raw.nodes.len()))))
            .collect::<Result<Vec<u32>, Fault>>()?;
        raw.element(kind, &nodes, &[]);
        cells.push(nodes);
    }
    Ok(cells)
}

/// Reads the XML. Appended numbers may be raw bytes, which no XML is: it is read up to them.
fn outline(bytes: &[u8]) -> Result<Outline<'_>, Fault> {
    const APPENDED: &[u8] = b"<AppendedData";
    let cut = bytes.windows(APPENDED.len()).position(|w| w == APPENDED);
    let (head, tail) = bytes.split_at(cut.unwrap_or(bytes.len()));
    let mut out = Outline::default();
    let broken = |e: String| Fault::from(format!("is no readable XML: {e}"));
    let mut xml = Reader::from_reader(head);
    xml.config_mut().check_end_names = false;
    let (mut place, mut open, mut grid) = (Place::Elsewhere, false, false);
    loop {
        match xml.read_event().map_err(|e| broken(e.to_string()))? {
            Event::Eof => break,
            Event::Start(tag) | Event::Empty(tag) => match tag.name().as_ref() {
                b"VTKFile" => out.store = Store::new(&Attributes(&tag))?,
                b"UnstructuredGrid" => grid = true,
                b"Piece" => {
                    let count = |name| Attributes(&tag).number(name);
                    let counts = [count("NumberOfPoints")?, count("NumberOfCells")?];
                    if out.counts.is_some_and(|c| c != [0, 0]) {
                        return Err("holds several pieces; write the grid as one".into());
                    }
                    out.counts = Some(counts);
                }
                b"PointData" => place = Place::PointData,
                b"CellData" => place = Place::CellData,
                b"Points" => place = Place::Points,
                b"Cells" => place = Place::Cells,
                b"FieldData" => place = Place::Elsewhere,
                b"DataArray" => {
                    open = true;
                    out.arrays.push(array(&Attributes(&tag), place)?);
                }
                _ => open = false,
            },
            Event::End(tag) => {
                open = false;
                if matches!(tag.name().as_ref(), b"PointData" | b"CellData" | b"Points" | b"Cells") {
                    place = Place::Elsewhere;
                }
            }
            Event::Text(text) if open => {
                if let (Some(array), Cow::Borrowed(text)) = (out.arrays.last_mut(), text.into_inner()) {
                    array.text = text;
                }
            }
            _ => {}
        }
    }
    if !grid {
        return Err("holds no unstructured grid: <UnstructuredGrid> is not there".into());
    }
    if !tail.is_empty() {
        let mut xml = Reader::from_reader(tail);
        let Event::Start(tag) = xml.read_event().map_err(|e| broken(e.to_string()))? else {
            return Err(broken("its appended data do not begin".into()));
        };
        out.store.raw = match Attributes(&tag).text("encoding")?.as_deref() {
            Some("raw") => true,
            Some("base64") => false,
            other => return Err(format!("has appended data in an encoding that is not read: {}", other.unwrap_or("none")).into()),
        };
        // Offsets count from the underscore on.
        let rest = &tail[xml.buffer_position() as usize..];
        let begin = rest.iter().position(|b| *b == b'_').ok_or("its appended data do not begin with _")?;
        out.store.appended = &rest[begin + 1..];
    }
    out.store.offsets = out.arrays.iter().filter_map(|a| a.offset).collect();
    out.store.offsets.sort_unstable();
    Ok(out)
}

fn array<'a>(tag: &Attributes, place: Place) -> Result<Array<'a>, Fault> {
    let name = tag.text("Name")?.unwrap_or_default();
    let kind = tag.text("type")?.unwrap_or_default();
    let coded = Coded::find(&kind);
    // Words are no numbers, and nobody asks for them.
    let Some(coded) = coded else {
        return Ok(Array {
            name,
            place: Place::Elsewhere,
            coded: Coded::Int8,
            components: 1,
            format: String::new(),
            offset: None,
            text: b"",
        });
    };
    let components = if tag.text("NumberOfComponents")?.is_some() { tag.number("NumberOfComponents")? } else { 1 };
    let format = tag.text("format")?.unwrap_or_default();
    let offset = if format == "appended" { Some(tag.number("offset")?) } else { None };
    Ok(Array { name, place, coded, components, format, offset, text: b"" })
}

/// Attributes of an element.
pub(super) struct Attributes<'a, 'b>(&'a BytesStart<'b>);

impl Attributes<'_, '_> {
    pub fn text(&self, name: &str) -> Result<Option<String>, Fault> {
        let broken = |e: String| Fault::from(format!("is no readable XML: {e}"));
        let found = self.0.try_get_attribute(name).map_err(|e| broken(e.to_string()))?;
        found.map(|a| a.unescape_value().map(|v| v.into_owned()).map_err(|e| broken(e.to_string()))).transpose()
    }

    pub fn number(&self, name: &str) -> Result<u64, Fault> {
        let text = self.text(name)?.ok_or_else(|| Fault::from(format!("says no {name}")))?;
        text.trim().parse().map_err(|_| format!("says {name}=\"{text}\", where a number must stand").into())
    }
}
