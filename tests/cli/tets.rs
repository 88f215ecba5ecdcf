//! What a person gets from a body of tetrahedra: the elements of the mesh with what happens to them, in a file that others read.

use glam::DVec3;
use std::fs;
use std::path::Path;
use support::command::{arg, succeed};
use support::tets;
use vtkio::model::{Attribute, CellType, DataSet, Piece, UnstructuredGridPiece, VertexNumbers};

/// A bar that flies freely, stiffer and heavier at one end.
const BAR: &str = r#"
format = "scene/1"
world = { gravity = [0, 0, 0] }

[object]
volume_mesh = "bar.msh"

[material]
density = 1000.0
youngs_modulus = 2.0e4
poisson_ratio = 0.3

[[field]]
path = "material.youngs_modulus"
basis = "regions"
blend = "axis"
regions = [{ center = [0, 0, 0], radius = 0.01 }, { center = [0.06, 0, 0], radius = 0.01, value = 3.0 }]

[[field]]
path = "material.density"
basis = "regions"
blend = "nearest"
regions = [{ center = [0, 0, 0], radius = 0.01 }, { center = [0.06, 0, 0], radius = 0.01, value = 2.0 }]

[initial]
velocity = [0.3, -0.1, 0.2]

[time]
step = 0.01
steps = 4
"#;

/// The grid of a VTU file.
fn grid(path: &Path) -> UnstructuredGridPiece {
    let DataSet::UnstructuredGrid { mut pieces, .. } = vtkio::Vtk::import(path).unwrap().data else {
        panic!("an unstructured grid")
    };
    let Piece::Inline(piece) = pieces.remove(0) else { panic!("one file holds all") };
    *piece
}

fn vectors(numbers: &[f64]) -> Vec<DVec3> {
    numbers.chunks_exact(3).map(DVec3::from_slice).collect()
}

fn array(of: &[Attribute], wanted: &str) -> Vec<f64> {
    let own = |a: &Attribute| match a {
        Attribute::DataArray(d) if d.name == wanted => d.data.cast_into(),
        _ => None,
    };
    of.iter().find_map(own).unwrap_or_else(|| panic!("no array {wanted}"))
}

#[test]
fn tetrahedra_fly_without_stress_and_carry_their_fields() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (folder.path().join("bar.toml"), folder.path().join("frames"));
    let mesh = tets::mesh(DVec3::ZERO, 0.01, [6, 2, 2]);
    fs::write(folder.path().join("bar.msh"), tets::msh(&mesh)).unwrap();
    fs::write(&scene, BAR).unwrap();
    succeed(&["simulate", arg(&scene), "--backend", "cpu", "--out", arg(&out), "--format", "vtu"]);
    for (frame, time) in [(0, 0.0), (4, 0.04)] {
        let found = grid(&out.join(format!("frame_{frame:05}.vtu")));
        // The mesh's own tetrahedra (VTK's type 10), in its order.
        assert_eq!(found.cells.types, vec![CellType::Tetra; mesh.tets.len()]);
        let VertexNumbers::XML { connectivity, offsets } = &found.cells.cell_verts else { panic!("an XML file") };
        assert!(offsets.iter().enumerate().all(|(e, end)| *end == 4 * (e as u64 + 1)));
        assert_eq!(connectivity, &mesh.tets.as_flattened().iter().map(|n| u64::from(*n)).collect::<Vec<_>>());
        let points = vectors(&found.points.cast_into::<f64>().unwrap());
        let moved = vectors(&array(&found.data.point, "displacement"));
        assert_eq!(points.len(), mesh.nodes.len());
        // No force acts: all nodes go the same way, and every tetrahedron keeps its shape. Newton stops at 1e-8 of the forces.
        let velocity = DVec3::new(0.3, -0.1, 0.2);
        assert!(moved.iter().all(|u| (*u - velocity * time).length() < 1e-8), "frame {frame}");
        assert!(vectors(&array(&found.data.point, "velocity")).iter().all(|v| (*v - velocity).length() < 1e-6), "frame {frame}");
        for t in connectivity.chunks_exact(4) {
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| points[t[i] as usize]);
            let volume = (b - a).cross(c - a).dot(d - a) / 6.0;
            assert!((volume / (1e-6 / 6.0) - 1.0).abs() < 1e-5, "{volume} m³");
        }
        let (modulus, factor) = (array(&found.data.cell, "E"), array(&found.data.cell, "factor_0"));
        for (t, (e, f)) in mesh.tets.iter().zip(modulus.iter().zip(&factor)) {
            let share = t.iter().map(|n| mesh.nodes[*n as usize].x).sum::<f64>() / 4.0 / 0.06;
            // Logarithms are blended along the bar.
            assert!((f / 3f64.powf(share) - 1.0).abs() < 1e-12 && (e / (2e4 * f) - 1.0).abs() < 1e-12, "{share}: {e} Pa, {f}");
        }
        let density = array(&found.data.point, "density");
        let heavy = |x: &DVec3| if x.x > 0.031 { 2000.0 } else { 1000.0 };
        let off =
            mesh.nodes.iter().zip(&density).filter(|(x, d)| (x.x - 0.03).abs() > 1e-9 && (heavy(x) - **d).abs() > 1e-9).count();
        assert_eq!(off, 0, "{density:?}");
        assert_eq!(array(&found.data.point, "factor_1").len(), mesh.nodes.len());
    }
}
