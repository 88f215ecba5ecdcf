//! VTU and PVD files for ParaView.

use crate::error::{InputError, OutputError};
use crate::keys::suggest;
use crate::output::write_file;
use glam::DVec3;
use std::path::Path;
use vtkio::model::{
    Attribute, Attributes, ByteOrder, CellType, Cells, DataArray, DataSet, Piece, UnstructuredGridPiece, Version, VertexNumbers,
    Vtk,
};

/// Corner `VTK_ORDER[i]` of a lattice cell (bit 0 of the number +x, bit 1 +y, bit 2 +z) is corner i of VTK's hexahedron,
/// which runs around the bottom and then around the top (VTK User's Guide, `VTK_HEXAHEDRON`).
const VTK_ORDER: [usize; 8] = [0, 1, 3, 2, 4, 5, 7, 6];

/// Writes hexahedra with data: `points` [m] shape `[N]`; `hexes` in the order of `palpate_model::cutcells::grid::CORNERS`; vectors per
/// point, shape `[N]` each; numbers per cell, shape `[cells]` each.
///
/// # Errors
/// The file that could not be written and why; an array of the wrong length.
pub fn write_vtu(
    path: impl AsRef<Path>,
    points: &[DVec3],
    hexes: &[[u32; 8]],
    point_data: &[(&str, &[DVec3])],
    cell_data: &[(&str, &[f64])],
) -> Result<(), OutputError> {
    let connectivity = hexes.iter().flat_map(|h| VTK_ORDER.map(|i| u64::from(h[i]))).collect();
    let vectors = vectors(path.as_ref(), point_data, points.len())?;
    let scalars = scalars(path.as_ref(), cell_data.iter().copied(), hexes.len())?;
    write_grid(path.as_ref(), points, connectivity, (8, CellType::Hexahedron), hexes.len(), vectors, scalars)
}

/// Writes hexahedra with numbers per point `[N]` and per cell `[cells]`.
///
/// # Errors
/// As [`write_vtu`].
pub fn write_vtu_scalars(
    path: impl AsRef<Path>,
    points: &[DVec3],
    hexes: &[[u32; 8]],
    point_data: &[(String, Vec<f64>)],
    cell_data: &[(String, Vec<f64>)],
) -> Result<(), OutputError> {
    let path = path.as_ref();
    let connectivity = hexes.iter().flat_map(|h| VTK_ORDER.map(|i| u64::from(h[i]))).collect();
    let borrowed =
        |data: &'_ [(String, Vec<f64>)], wanted| scalars(path, data.iter().map(|(n, d)| (n.as_str(), d.as_slice())), wanted);
    let (of_points, of_cells) = (borrowed(point_data, points.len())?, borrowed(cell_data, hexes.len())?);
    write_grid(path, points, connectivity, (8, CellType::Hexahedron), hexes.len(), of_points, of_cells)
}

/// Writes a triangle surface with vectors per vertex as a VTU file.
///
/// # Errors
/// As [`write_vtu`].
pub fn write_vtu_surface(
    path: impl AsRef<Path>,
    mesh: &palpate_model::shape::TriMesh,
    point_data: &[(&str, &[DVec3])],
) -> Result<(), OutputError> {
    let connectivity = mesh.triangles.iter().flatten().map(|v| u64::from(*v)).collect();
    let vectors = vectors(path.as_ref(), point_data, mesh.vertices.len())?;
    write_grid(path.as_ref(), &mesh.vertices, connectivity, (3, CellType::Triangle), mesh.triangles.len(), vectors, Vec::new())
}

fn flat(v: &[DVec3]) -> Vec<f64> {
    v.iter().flat_map(|p| p.to_array()).collect()
}

/// An error where an array has another number of entries than it should.
fn check(path: &Path, name: &str, found: usize, wanted: usize) -> Result<(), OutputError> {
    match found == wanted {
        true => Ok(()),
        false => Err(OutputError::new(path, format!("data \"{name}\" has {found} entries, {wanted} are needed"))),
    }
}

fn vectors(path: &Path, data: &[(&str, &[DVec3])], wanted: usize) -> Result<Vec<Attribute>, OutputError> {
    let one = |(name, d): &(&str, &[DVec3])| {
        check(path, name, d.len(), wanted)?;
        Ok(Attribute::DataArray(DataArray::vectors(*name).with_data(flat(d))))
    };
    data.iter().map(one).collect()
}

fn scalars<'a>(
    path: &Path,
    data: impl Iterator<Item = (&'a str, &'a [f64])>,
    wanted: usize,
) -> Result<Vec<Attribute>, OutputError> {
    let one = |(name, d): (&str, &[f64])| {
        check(path, name, d.len(), wanted)?;
        Ok(Attribute::DataArray(DataArray::scalars(name, 1).with_data(d.to_vec())))
    };
    data.map(one).collect()
}

fn write_grid(
    path: &Path,
    points: &[DVec3],
    connectivity: Vec<u64>,
    (corners, kind): (u64, CellType),
    cells: usize,
    point: Vec<Attribute>,
    cell: Vec<Attribute>,
) -> Result<(), OutputError> {
    let data = Attributes { point, cell };
    let offsets = (1..=cells as u64).map(|i| corners * i).collect();
    let piece = UnstructuredGridPiece {
        points: flat(points).into(),
        cells: Cells { cell_verts: VertexNumbers::XML { connectivity, offsets }, types: vec![kind; cells] },
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

/// Writes a time series: a time [s] and a file (relative to the PVD) per frame.
///
/// # Errors
/// The file that could not be written and why.
pub fn write_pvd(path: impl AsRef<Path>, frames: &[(f64, String)]) -> Result<(), OutputError> {
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
    use palpate_model::cutcells::grid::CORNERS;

    /// One unit cell with a displacement per corner.
    fn cell() -> (Vec<DVec3>, [u32; 8]) {
        let points = CORNERS.iter().map(|c| DVec3::new(f64::from(c[0]), f64::from(c[1]), f64::from(c[2]))).collect();
        (points, [0, 1, 2, 3, 4, 5, 6, 7])
    }

    #[test]
    fn a_cell_comes_back_with_its_data_in_the_order_of_vtk() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.vtu");
        let (points, hex) = cell();
        let moved: Vec<DVec3> = points.iter().map(|p| *p * 0.1).collect();
        write_vtu(&path, &points, &[hex], &[("displacement", &moved)], &[("fraction", &[0.25])]).unwrap();
        let DataSet::UnstructuredGrid { pieces, .. } = Vtk::import(&path).unwrap().data else { panic!("a grid was written") };
        let Piece::Inline(piece) = &pieces[0] else { panic!("one file holds all") };
        assert_eq!(piece.points.cast_into::<f64>().unwrap(), flat(&points));
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
        let (points, hex) = cell();
        let e = write_vtu(folder.path().join("a.vtu"), &points, &[hex], &[("u", &points[1..])], &[]).unwrap_err();
        assert!(e.to_string().contains("\"u\" has 7 entries, 8 are needed"), "{e}");
        let path = folder.path().join("a.pvd");
        write_pvd(&path, &[(0.0, "f0.vtu".into()), (0.1, "a&b.vtu".into())]).unwrap();
        let text = std::fs::read_to_string(path).unwrap();
        assert!(text.contains("timestep=\"0.1\" part=\"0\" file=\"a&amp;b.vtu\""), "{text}");
    }
}
