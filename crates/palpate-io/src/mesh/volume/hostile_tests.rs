//! Files that are damaged or no mesh of tetrahedra: one error that says why, no panic, and no room made for what is not there.

use super::*;

const TWO: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 1 1\n$EndNodes\n\
    $Elements\n2\n1 4 2 0 1 1 2 3 4\n2 4 2 0 1 2 4 3 5\n$EndElements\n";

/// What reading a changed file says.
fn said(from: &str, to: &str) -> String {
    assert!(TWO.contains(from), "{from}");
    read("m.msh", TWO.replace(from, to).as_bytes()).unwrap_err()
}

#[test]
fn what_is_no_mesh_of_tetrahedra_is_refused_with_a_reason() {
    let volume: f64 = read("m.msh", TWO.as_bytes()).unwrap().value.volume();
    assert!((volume - 0.5).abs() < 1e-15, "{volume}");
    for (from, to, message) in [
        ("$MeshFormat\n2.2", "solid ball\n2.2", "m.msh: is no Gmsh file: it must begin with $MeshFormat"),
        ("2.2 0 8", "4.0 0 8", "m.msh: is of MSH version 4.0; 2.2 and 4.1 are read: gmsh FILE -save -format msh41 -o NEW.msh"),
        ("2 4 2 0 1 2 4 3 5", "2 4 2 0 1 2 4 3 9", "m.msh:15: names node 9, which it does not hold"),
        ("5 1 1 1", "5 1 nan 1", "m.msh: node 5 of 5 is not finite: [1, NaN, 1]"),
        (
            "$Elements\n2",
            "$Elements\n10000000",
            "m.msh:13: announces 10000000 elements, and only 50 bytes follow: the file is cut short or damaged",
        ),
        ("\n$EndElements\n", "", "m.msh:15: ends within $Elements: the file is cut short"),
        ("2 4 2 0 1 2 4 3 5", "2 4 2 0 1 2 4 x 5", "m.msh:15: \"x\" stands where a number must"),
        (
            "2 4 2 0 1 2 4 3 5",
            "2 6 2 0 1 1 2 3 4 5 5",
            "m.msh: holds 1 volume elements that are no tetrahedra (1 prisms) beside 1 that are; mesh the body with tetrahedra alone",
        ),
        ("5 1 1 1", "5 .3 .3 .4", "m.msh: 1 of 2 tetrahedra is flat; remesh the body, or let the mesher optimise it away"),
    ] {
        assert_eq!(said(from, to), message);
    }
    assert!(
        read("m.obj", b"")
            .unwrap_err()
            .contains("\".obj\" is not a volume mesh that is read; allowed: .msh, .vtu, .vtk, .node with .ele")
    );
}

#[test]
fn turned_tetrahedra_are_turned_back_with_a_count() {
    let loaded = read("m.msh", TWO.replace("1 2 3 4\n", "1 3 2 4\n").as_bytes()).unwrap();
    let count = "m.msh: 2 of 2 tetrahedra count their nodes the other way round; they were turned";
    assert!(loaded.warnings.len() == 1 && loaded.warnings[0].ends_with(count), "{:?}", loaded.warnings);
    assert!((loaded.value.volume() - 0.5).abs() < 1e-15);
}

#[test]
fn lengths_in_another_unit_are_refused() {
    let scaled = |by: f64| {
        let nodes = [[0.0; 3], [by, 0.0, 0.0], [0.0, by, 0.0], [0.0, 0.0, by]];
        let nodes: String = (1..).zip(nodes).map(|(n, x)| format!("{n} {} {} {}\n", x[0], x[1], x[2])).collect();
        let text = format!(
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n{nodes}$EndNodes\n$Elements\n1\n1 4 2 0 1 1 2 3 4\n$EndElements\n"
        );
        read("m.msh", text.as_bytes()).map(|_| String::new()).unwrap_or_else(|e| e)
    };
    assert_eq!(scaled(1.0), "");
    let hint = "is the object in millimetres or centimetres? convert it to metres (scale by 0.001 or 0.01)";
    assert_eq!(scaled(300.0), format!("m.msh: its longest side is 300 m; lengths are in metres; {hint}"));
    assert_eq!(scaled(1e-5), "m.msh: its longest side is 0.00001 m; lengths are in metres; convert the file");
}

#[test]
fn damaged_files_of_other_formats_say_what_is_wrong() {
    let cut = |name: &str, bytes: &[u8], at: usize| read(name, &bytes[..at]).unwrap_err();
    let all = gmsh("4.1", As::Little);
    let begin = all.windows(9).position(|w| w == b"$Elements").unwrap();
    assert_eq!(cut("m.msh", &all, begin), "m.msh: holds no elements");
    let e = cut("m.msh", &all, begin + 100);
    assert_eq!(e, "m.msh: announces 14 elements, and only 58 bytes follow: the file is cut short or damaged");

    let whole = String::from_utf8(vtu(Keep::Ascii, false)).unwrap();
    let with = |from: &str, to: &str| read("m.vtu", whole.replacen(from, to, 1).as_bytes()).unwrap_err();
    let e = with("NumberOfCells=\"14\"", "NumberOfCells=\"10000000\"");
    assert!(e.starts_with("m.vtu: array \"offsets\" holds 14 numbers, and 10000000 × 1 are announced"), "{e}");
    assert_eq!(
        with("type=\"UnstructuredGrid\"", "type=\"PolyData\""),
        "m.vtu: holds VTK data of type \"PolyData\"; an UnstructuredGrid is needed"
    );
    assert_eq!(with("Name=\"types\"", "Name=\"kinds\""), "m.vtu: has no array of types");
    let e = with("header_type", "compressor=\"vtkLZ4DataCompressor\" header_type");
    assert_eq!(e, "m.vtu: is compressed by vtkLZ4DataCompressor; zlib is read: write it with that, or uncompressed");
    let raw = vtu(Keep::Appended { raw: true, zlib: false }, false);
    let e = cut("m.vtu", &raw, raw.len() - 40);
    assert_eq!(e, "m.vtu: array \"types\" is damaged: it ends before its head says");

    let whole = String::from_utf8(legacy(3, As::Text)).unwrap();
    let with = |from: &str, to: &str| read("m.vtk", whole.replacen(from, to, 1).as_bytes()).unwrap_err();
    let e = with("POINTS 12 double", "POINTS 10000000 double");
    assert!(e.starts_with("m.vtk:5: announces 30000000 numbers, and only "), "{e}");
    assert_eq!(with("UNSTRUCTURED_GRID", "POLYDATA"), "m.vtk:4: holds a POLYDATA; an UNSTRUCTURED_GRID is needed");
    assert!(with("\n5 5 10", "\n5 99 10").ends_with("cell 1 is of type 99, which is not known"));

    let folder = tempfile::tempdir().unwrap();
    let (node, ele) = (folder.path().join("bar.node"), folder.path().join("bar.ele"));
    let [nodes, tets] = tetgen(1);
    std::fs::write(&ele, &tets).unwrap();
    let e = read_tets(&ele).unwrap_err().to_string();
    assert!(e.ends_with("bar.ele: bar.node is missing beside it; TetGen writes .node and .ele, and both are needed"), "{e}");
    std::fs::write(&node, nodes.replace("12 3 1 1", "10000000 3 1 1")).unwrap();
    let e = read_tets(&ele).unwrap_err().to_string();
    assert!(e.ends_with("bar.node: announces 10000000 nodes, and only 12 lines follow: the file is cut short"), "{e}");
    std::fs::write(&node, &nodes).unwrap();
    std::fs::write(&ele, tets.replace(" 12 ", " 13 ")).unwrap();
    let e = read_tets(&ele).unwrap_err().to_string();
    assert!(e.contains("bar.ele:") && e.ends_with("names node 13, which the .node file does not hold"), "{e}");
}

/// A generator of numbers: what is changed is the same in every run.
fn draw(state: &mut u64) -> usize {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    (*state >> 16) as usize
}

#[test]
fn no_change_of_a_few_bytes_makes_a_reader_panic() {
    let mut state = 0x9e37_79b9_7f4a_7c15;
    let mut outcomes = [0; 2];
    let mut try_bytes = |name: &str, bytes: &[u8]| {
        let raw = match name.rsplit('.').next() {
            Some("msh") => msh::read(bytes),
            Some("vtu") => vtu::read(bytes),
            _ => legacy::read(bytes),
        };
        outcomes[usize::from(raw.map_err(|f| f.message).and_then(Raw::finish).is_ok())] += 1;
    };
    for (name, whole) in files() {
        for round in 0..150 {
            let mut bytes = whole.clone();
            match round % 3 {
                0 => bytes.truncate(draw(&mut state) % bytes.len()),
                1 => {
                    let at = draw(&mut state) % bytes.len();
                    bytes[at] = draw(&mut state) as u8;
                }
                // Digits and bytes that make numbers large.
                _ => {
                    for _ in 0..4 {
                        let at = draw(&mut state) % bytes.len();
                        bytes[at] = [b'9', 0xff, b'-', 0x7f][draw(&mut state) % 4];
                    }
                }
            }
            try_bytes(&name, &bytes);
        }
    }
    // Some changes touch names alone, most do damage.
    assert!(outcomes.iter().all(|n| *n > 100), "{outcomes:?}");
}
