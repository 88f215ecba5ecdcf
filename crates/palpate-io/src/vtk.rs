//! VTU and PVD files for ParaView.

use crate::error::{InputError, OutputError};
use crate::keys::suggest;
use crate::output::write_file;
use glam::DVec3;
use palpate_model::space::body::Body;
use std::path::Path;
use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells, DataArray, DataSet, Piece, UnstructuredGridPiece, Version, VertexNumbers,
    Vtk,
};

/// Corner `VTK_ORDER[i]` of a lattice cell (bit 0 of the number +x, bit 1 +y, bit 2 +z) is corner i of VTK's hexahedron,
/// which runs around the bottom and then around the top (VTK User's Guide, `VTK_HEXAHEDRON`).
const VTK_ORDER: [usize; 8] = [0, 1, 3, 2, 4, 5, 7, 6];

/// Elements of a grid, as VTK counts them.
#[derive(Clone, Debug, Default)]
pub struct Elements {
    /// Points of all elements, one after another.
    connectivity: Vec<u64>,
    /// End of every element in it.
    offsets: Vec<u64>,
    types: Vec<CellType>,
}

impl Elements {
    /// The elements of a body: its cells as hexahedra (VTK's type 12), or its tetrahedra (type 10, or 24 where they are quadratic), or
    /// its points (type 1), in the body's order.
    pub fn of(body: &Body) -> Elements {
        let mut all = Elements::default();
        body.cells().iter().for_each(|c| all.push(CellType::Hexahedron, VTK_ORDER.map(|i| c.nodes[i])));
        // Tetrahedra count their nodes as VTK does: the fourth corner lies on the side that the first three turn around, and nodes of edges
        // follow as `palpate_model::space::tets::EDGES` has them.
        if body.points.stars.is_some() {
            return Elements::vertices(body.nodes.len());
        }
        for s in body.points.means() {
            let kind = if s.nodes.len() == 4 { CellType::Tetra } else { CellType::QuadraticTetra };
            all.push(kind, s.nodes.iter().copied());
        }
        all
    }

    /// Triangles.
    pub fn triangles(triangles: &[[u32; 3]]) -> Elements {
        let mut all = Elements::default();
        triangles.iter().for_each(|t| all.push(CellType::Triangle, *t));
        all
    }

    /// So many points, each an element by itself (VTK's type 1).
    pub fn vertices(count: usize) -> Elements {
        let mut all = Elements::default();
        (0..count as u32).for_each(|k| all.push(CellType::Vertex, [k]));
        all
    }

    fn push(&mut self, kind: CellType, points: impl IntoIterator<Item = u32>) {
        self.connectivity.extend(points.into_iter().map(u64::from));
        self.offsets.push(self.connectivity.len() as u64);
        self.types.push(kind);
    }

    /// Number of elements.
    pub fn len(&self) -> usize {
        self.types.len()
    }

    /// True without elements.
    pub fn is_empty(&self) -> bool {
        self.types.is_empty()
    }
}

/// Values of an array: one a point `[N]`, or one an element `[E]`.
#[derive(Clone, Copy, Debug)]
pub enum Values<'a> {
    /// Vectors.
    Vectors(&'a [DVec3]),
    /// Numbers.
    Numbers(&'a [f64]),
    /// Symmetric matrices: xx, yy, zz, xy, yz, xz, as ParaView names six numbers.
    Symmetric(&'a [[f64; 6]]),
}

/// Arrays by name.
pub type Arrays<'a> = [(&'a str, Values<'a>)];

/// Writes a grid with data: `points` [m] shape `[N]`, its elements, arrays by point and arrays by element.
///
/// # Errors
/// The file that could not be written and why; an array of the wrong length.
pub fn write_vtu(
    path: impl AsRef<Path>,
    points: &[DVec3],
    elements: &Elements,
    of_points: &Arrays,
    of_elements: &Arrays,
) -> Result<(), OutputError> {
    write_grid(path.as_ref(), points, elements, [of_points, of_elements])
}

fn write_grid(
    path: &Path,
    points: &[DVec3],
    elements: &Elements,
    [of_points, of_elements]: [&Arrays; 2],
) -> Result<(), OutputError> {
    let data =
        Attributes { point: attributes(path, of_points, points.len())?, cell: attributes(path, of_elements, elements.len())? };
    let Elements { connectivity, offsets, types } = elements.clone();
    let piece = UnstructuredGridPiece {
        points: flat(points).into(),
        cells: Cells { cell_verts: VertexNumbers::XML { connectivity, offsets }, types },
        data,
    };
    let vtk = Vtk {
        version: Version::new_xml(1, 0),
        title: String::new(),
        byte_order: ByteOrder::LittleEndian,
        data: DataSet::inline(piece),
        file_path: None,
    };
    write_file(path, |out| vtk.write_xml(out).map_err(std::io::Error::other))
}

fn flat(v: &[DVec3]) -> Vec<f64> {
    v.iter().flat_map(|p| p.to_array()).collect()
}

/// Arrays as VTK holds them; each must have as many entries as there are places.
fn attributes(path: &Path, arrays: &Arrays, wanted: usize) -> Result<Vec<Attribute>, OutputError> {
    let one = |(name, values): &(&str, Values)| {
        let (found, array) = match values {
            Values::Vectors(v) => (v.len(), DataArray::vectors(*name).with_data(flat(v))),
            Values::Numbers(v) => (v.len(), DataArray::scalars(*name, 1).with_data(v.to_vec())),
            Values::Symmetric(v) => (v.len(), DataArray::new(*name, 6).with_data(v.as_flattened().to_vec())),
        };
        match found == wanted {
            true => Ok(Attribute::DataArray(array)),
            false => Err(OutputError::new(path, format!("data \"{name}\" has {found} entries, {wanted} are needed"))),
        }
    };
    arrays.iter().map(one).collect()
}

/// Writes a time series: a time [s] and a file (relative to the PVD) per frame.
///
/// # Errors
/// The file that could not be written and why.
pub fn write_pvd(path: impl AsRef<Path>, frames: &[(f64, String)]) -> Result<(), OutputError> {
    write_series(path.as_ref(), frames)
}

fn write_series(path: &Path, frames: &[(f64, String)]) -> Result<(), OutputError> {
    let escape = |s: &str| s.replace('&', "&amp;").replace('"', "&quot;").replace('<', "&lt;");
    write_file(path, |out| {
        writeln!(
            out,
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n<Collection>"
        )?;
        for (time, file) in frames {
            writeln!(out, "<DataSet timestep=\"{time:?}\" part=\"0\" file=\"{}\"/>", escape(file))?;
        }
        writeln!(out, "</Collection>\n</VTKFile>")
    })
}

/// Reads numbers per cell or per point of a grid: the array of this name, or the only one that holds one number each.
///
/// # Errors
/// The file cannot be read, or has no such array.
pub fn read_vtu_array(path: &Path, name: Option<&str>, of_cells: bool) -> Result<Vec<f64>, InputError> {
    let wrong = |message: String| InputError::file(path, message);
    let vtk = Vtk::import(path).map_err(|e| wrong(format!("is not a readable .vtu file: {e}")))?;
    let DataSet::UnstructuredGrid { pieces, .. } = vtk.data else { return Err(wrong("holds no unstructured grid".into())) };
    let [Piece::Inline(piece)] = &pieces[..] else { return Err(wrong("holds several pieces; write the grid as one".into())) };
    let (data, kind) = if of_cells { (&piece.data.cell, "cell") } else { (&piece.data.point, "point") };
    let scalars: Vec<&DataArray> = data
        .iter()
        .filter_map(|a| match a {
            Attribute::DataArray(d) if d.num_comp() == 1 => Some(d),
            _ => None,
        })
        .collect();
    let known = scalars.iter().map(|d| d.name.as_str()).collect::<Vec<_>>();
    let found = match (name, &scalars[..]) {
        (Some(name), all) => *all
            .iter()
            .find(|d| d.name == name)
            .ok_or_else(|| wrong(format!("has no {kind} array \"{name}\" of single numbers; {}", suggest(name, &known))))?,
        (None, [only]) => only,
        (None, _) => {
            return Err(wrong(format!("has {} {kind} arrays ({}); say which: array = …", known.len(), known.join(", "))));
        }
    };
    found.data.cast_into::<f64>().ok_or_else(|| wrong(format!("{kind} array \"{}\" holds no numbers", found.name)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;
    use palpate_model::scene::Analytic;
    use palpate_model::shape::Placed;

    /// The unit cube as one cell.
    fn cell() -> Body {
        let cube = Analytic::Box { min: DVec3::ZERO, max: DVec3::ONE };
        let body = Body::build(&Placed::new(cube, DAffine3::IDENTITY), 1.0, 0.0, 2).unwrap();
        assert_eq!((body.cells().len(), body.nodes.len()), (1, 8));
        body
    }

    #[test]
    fn a_cell_comes_back_with_its_data_in_the_order_of_vtk() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.vtu");
        let body = cell();
        let (points, elements) = (&body.nodes, Elements::of(&body));
        let moved: Vec<DVec3> = points.iter().map(|p| *p * 0.1).collect();
        let (vectors, numbers) = ([("displacement", Values::Vectors(&moved))], [("fraction", Values::Numbers(&[0.25]))]);
        write_vtu(&path, points, &elements, &vectors, &numbers).unwrap();
        let DataSet::UnstructuredGrid { pieces, .. } = Vtk::import(&path).unwrap().data else { panic!("a grid was written") };
        let Piece::Inline(piece) = &pieces[0] else { panic!("one file holds all") };
        assert_eq!(piece.points.cast_into::<f64>().unwrap(), flat(points));
        assert_eq!(piece.cells.types, [CellType::Hexahedron]);
        let VertexNumbers::XML { connectivity, offsets } = &piece.cells.cell_verts else { panic!("an XML file") };
        assert_eq!(offsets, &[8]);
        // VTK's hexahedron: consecutive corners of either ring are joined by an edge, and so are i and i + 4.
        let at = |i: usize| points[connectivity[i] as usize];
        for ring in [0, 4] {
            for i in 0..4 {
                assert_eq!((at(ring + i) - at(ring + (i + 1) % 4)).length(), 1.0);
                assert_eq!(at(4 + i) - at(i), DVec3::Z);
            }
        }
        let positive = (at(1) - at(0)).cross(at(3) - at(0)).dot(at(4) - at(0));
        assert_eq!(positive, 1.0, "the cell is not inside out");
        let Attribute::DataArray(d) = &piece.data.point[0] else { panic!("an array") };
        assert_eq!((d.name.as_str(), d.data.cast_into::<f64>().unwrap()), ("displacement", flat(&moved)));
        let Attribute::DataArray(d) = &piece.data.cell[0] else { panic!("an array") };
        assert_eq!((d.name.as_str(), d.data.cast_into::<f64>().unwrap()), ("fraction", vec![0.25]));
    }

    #[test]
    fn lengths_are_checked_and_series_list_their_files() {
        let folder = tempfile::tempdir().unwrap();
        let body = cell();
        let short = [("u", Values::Vectors(&body.nodes[1..]))];
        let e = write_vtu(folder.path().join("a.vtu"), &body.nodes, &Elements::of(&body), &short, &[]).unwrap_err();
        assert!(e.to_string().contains("\"u\" has 7 entries, 8 are needed"), "{e}");
        let path = folder.path().join("a.pvd");
        write_pvd(&path, &[(0.0, "f0.vtu".into()), (0.1, "a&b.vtu".into())]).unwrap();
        let text = std::fs::read_to_string(path).unwrap();
        assert!(text.contains("timestep=\"0.1\" part=\"0\" file=\"a&amp;b.vtu\""), "{text}");
    }
}
