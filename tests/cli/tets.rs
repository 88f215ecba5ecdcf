//! What a person gets from a body of tetrahedra: the elements of the mesh with what happens to them, in a file that others read.

use glam::DVec3;
use std::fs;
use std::path::Path;
use support::command::{arg, palpate, succeed};
use support::tets;
use vtkio::model::{Attribute, CellType, DataSet, Piece, UnstructuredGridPiece, VertexNumbers};

/// A bar that flies freely, stiffer and heavier at one end, of these elements.
fn bar(solver: &str) -> String {
    format!("{BAR}\n[solver]\n{solver}\n")
}

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
    fly("element = \"tet4\"", CellType::Tetra, 4);
    fly("", CellType::QuadraticTetra, 10);
}

/// Elements of so many nodes, the first four of which are the mesh's own.
fn fly(solver: &str, kind: CellType, nodes: usize) {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (folder.path().join("bar.toml"), folder.path().join("frames"));
    let mesh = tets::mesh(DVec3::ZERO, 0.01, [6, 2, 2]);
    fs::write(folder.path().join("bar.msh"), tets::msh(&mesh)).unwrap();
    fs::write(&scene, bar(solver)).unwrap();
    succeed(&["simulate", arg(&scene), "--backend", "cpu", "--out", arg(&out), "--format", "vtu"]);
    for (frame, time) in [(0, 0.0), (4, 0.04)] {
        let found = grid(&out.join(format!("frame_{frame:05}.vtu")));
        // The mesh's own tetrahedra, in its order.
        assert_eq!(found.cells.types, vec![kind; mesh.tets.len()]);
        let VertexNumbers::XML { connectivity, offsets } = &found.cells.cell_verts else { panic!("an XML file") };
        assert!(offsets.iter().enumerate().all(|(e, end)| *end == (nodes * (e + 1)) as u64));
        let elements = || connectivity.chunks_exact(nodes);
        assert!(elements().zip(&mesh.tets).all(|(e, t)| e[..4] == t.map(u64::from)));
        let points = vectors(&found.points.cast_into::<f64>().unwrap());
        let moved = vectors(&array(&found.data.point, "displacement"));
        assert!(points[..mesh.nodes.len()].len() == mesh.nodes.len() && (nodes == 4) == (points.len() == mesh.nodes.len()));
        for e in elements().filter(|e| e.len() == 10) {
            // VTK's order: middles of the edges 01, 12, 20, 03, 13, 23.
            for (k, [a, b]) in [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]].into_iter().enumerate() {
                let middle = 0.5 * (points[e[a] as usize] + points[e[b] as usize]);
                assert!((points[e[4 + k] as usize] - middle).length() < 1e-8);
            }
        }
        // No force acts: all nodes go the same way, and every tetrahedron keeps its shape. Newton stops at 1e-8 of the forces.
        let velocity = DVec3::new(0.3, -0.1, 0.2);
        assert!(moved.iter().all(|u| (*u - velocity * time).length() < 1e-8), "frame {frame}");
        assert!(vectors(&array(&found.data.point, "velocity")).iter().all(|v| (*v - velocity).length() < 1e-6), "frame {frame}");
        for t in elements() {
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
        let heavy = |x: &DVec3| if x.x > 0.03 { 2000.0 } else { 1000.0 };
        let off = points
            .iter()
            .map(|x| *x - velocity * time)
            .zip(&density)
            .filter(|(x, d)| (x.x - 0.03).abs() > 1e-6 && (heavy(x) - **d).abs() > 1e-9)
            .count();
        assert_eq!(off, 0, "{density:?}");
        assert_eq!(array(&found.data.point, "factor_1").len(), points.len());
    }
}

/// The end of the bar at x = 0 as a physical surface of two triangles a square.
fn msh2(mesh: &palpate_model::space::points::TetMesh) -> String {
    let held = |t: &[u32; 3]| t.iter().all(|n| mesh.nodes[*n as usize].x == 0.0);
    let faces: Vec<[u32; 3]> = mesh.faces().into_iter().map(|(_, f)| f).filter(held).collect();
    let nodes: String = (1..).zip(&mesh.nodes).map(|(n, x): (usize, _)| format!("{n} {} {} {}\n", x.x, x.y, x.z)).collect();
    let list = |nodes: &[u32]| nodes.iter().map(|n| format!(" {}", n + 1)).collect::<String>();
    let faces_of: String = (1..).zip(&faces).map(|(e, f): (usize, _)| format!("{e} 2 2 4 1{}\n", list(f))).collect();
    let tets: String = (1 + faces.len()..).zip(&mesh.tets).map(|(e, t)| format!("{e} 4 2 5 1{}\n", list(t))).collect();
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n2 4 \"base\"\n3 5 \"bar\"\n$EndPhysicalNames\n$Nodes\n{}\n{nodes}$EndNodes\n\
         $Elements\n{}\n{faces_of}{tets}$EndElements\n",
        mesh.nodes.len(),
        faces.len() + mesh.tets.len()
    )
}

#[test]
fn a_group_of_a_gmsh_file_holds_its_nodes() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (folder.path().join("bar.toml"), folder.path().join("frames"));
    let mesh = tets::mesh(DVec3::ZERO, 0.01, [6, 2, 2]);
    fs::write(folder.path().join("bar.msh"), msh2(&mesh)).unwrap();
    let held = BAR.replace("[initial]\nvelocity = [0.3, -0.1, 0.2]\n", "[[clamp]]\ngroup = \"base\"\n");
    let held = held.replace("[0, 0, 0] }\n", "[0, 0, -9.81] }\n");
    fs::write(&scene, &held).unwrap();

    let said = succeed(&["inspect", arg(&scene)]).out;
    for words in ["144 of about", "bar (63 nodes), base (9 nodes)", "45.0° to 90.0°", "tetrahedra: a mesh is given", "1 clamp,"]
    {
        assert!(said.contains(words), "{words} is not in: {said}");
    }
    let found: serde_json::Value = serde_json::from_str(&succeed(&["inspect", arg(&scene), "--json"]).out).unwrap();
    assert_eq!(found["tetrahedra"]["groups"][1], serde_json::json!({ "name": "base", "nodes": 9 }));
    assert_eq!(found["suited"]["discretisation"], "tetrahedra");

    succeed(&["simulate", arg(&scene), "--backend", "cpu", "--out", arg(&out), "--format", "vtu"]);
    let last = grid(&out.join("frame_00004.vtu"));
    let moved = vectors(&array(&last.data.point, "displacement"));
    for (x, u) in mesh.nodes.iter().zip(&moved) {
        // Held nodes give way by a hundred-millionth of the strain; the free end has fallen by some millimetres.
        let still = x.x == 0.0;
        assert!(if still { u.length() < 1e-7 } else { x.x < 0.059 || u.z < -1e-3 }, "{x}: {u}");
    }

    // Nine corners and the middles of sixteen edges between them.
    assert_eq!(moved.iter().filter(|u| u.length() < 1e-7).count(), 25);

    fs::write(&scene, held.replace("\"base\"", "\"bse\"")).unwrap();
    let e = palpate(&["inspect", arg(&scene)]).err;
    assert!(e.ends_with("clamp.0.group: \"bse\" is no group of bar.msh; it has \"bar\" (63 nodes), \"base\" (9 nodes)\n"), "{e}");
}

#[test]
fn a_shape_is_filled_with_tetrahedra_that_keep_its_volume() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("ball.toml");
    let text = "format = \"scene/1\"\n[object]\nshape = { ball = { radius = 0.05 } }\ndiscretisation = \"tetrahedra\"\n\
        [material]\ndensity = 1000.0\nyoungs_modulus = 2.0e4\npoisson_ratio = 0.3\n[time]\nstep = 0.01\nsteps = 2\n";
    fs::write(&scene, text).unwrap();
    let found: serde_json::Value = serde_json::from_str(&succeed(&["inspect", arg(&scene), "--json"]).out).unwrap();
    let made = &found["tetrahedra"]["made_here"];
    // Three edges through the diameter, by two digits below it.
    assert!(made["edge_length"].as_f64().is_some_and(|h| h > 0.03 && h <= 0.0334), "{found}");
    assert!(made["volume_error"].as_f64().is_some_and(|e| (-0.2..-0.01).contains(&e)), "{found}");
    let exact = 4.0 / 3.0 * std::f64::consts::PI * 0.05f64.powi(3);
    // What cells of half the edge, divided into four, know of the volume.
    assert!((found["volume"].as_f64().unwrap() / exact - 1.0).abs() < 0.01, "{found}");
    for (key, to, wanted) in [
        (
            "steps = 2",
            "steps = 2\n[[clamp]]\ngroup = \"base\"",
            "clamp.0.group: names a group of a volume mesh, and the tetrahedra of this body are made here: give a box",
        ),
        (
            "\"tetrahedra\"",
            "\"tetrahedra\"\ncell_size = 0.01",
            "object.cell_size: belongs to discretisation = \"cells\"; give edge_length, or leave it to be chosen",
        ),
        (
            "\"tetrahedra\"",
            "\"cells\"\nedge_length = 0.01",
            "object.edge_length: belongs to discretisation = \"tetrahedra\"; give cell_size or cells, or leave it to be chosen",
        ),
        ("\"tetrahedra\"", "\"tetrahedra\"\nedge_length = 0.1", ""),
    ] {
        fs::write(&scene, text.replace(key, to)).unwrap();
        let a = palpate(&["inspect", arg(&scene)]);
        assert!(a.err.trim_end().ends_with(wanted) && (a.code == 2) != wanted.is_empty(), "{a:?}");
    }
}

#[test]
fn elements_are_those_of_the_body_and_linear_ones_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("bar.toml");
    fs::write(folder.path().join("bar.msh"), tets::msh(&tets::mesh(DVec3::ZERO, 0.01, [6, 2, 2]))).unwrap();
    fs::write(&scene, bar("element = \"tet4\"")).unwrap();
    let told = succeed(&["inspect", arg(&scene)]);
    let told = told.out + &told.err;
    assert!(told.contains("tet4 locks: at ν = 0.3 a bar that is") && told.contains("use [solver] element = \"tet10\""), "{told}");
    fs::write(&scene, bar("element = \"enhanced\"")).unwrap();
    let told = palpate(&["inspect", arg(&scene)]).err;
    assert!(told.contains("solver.element: belongs to bodies that are cut out of a lattice"), "{told}");
    let ball =
        bar("element = \"tet10\"").replace("volume_mesh = \"bar.msh\"", "shape = { ball = { radius = 0.03 } }\ncell_size = 0.01");
    fs::write(&scene, ball).unwrap();
    let told = palpate(&["inspect", arg(&scene)]).err;
    assert!(told.contains("solver.element: belongs to bodies of tetrahedra"), "{told}");
}
