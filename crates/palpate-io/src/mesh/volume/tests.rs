//! One block of tetrahedra in every format, as text and binary, comes back as the same mesh with the same groups.

use super::*;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::io::Write;

#[path = "hostile_tests.rs"]
mod hostile;

/// Two cubes of six tetrahedra, and the triangles of the end at x = 0.
struct Block {
    nodes: Vec<DVec3>,
    tets: Vec<[u32; 4]>,
    base: [[u32; 3]; 2],
}

fn block() -> Block {
    let at = |i: u32, j: u32, k: u32| i + 3 * (j + 2 * k);
    let (mut nodes, mut tets) = (Vec::new(), Vec::new());
    for n in 0..12 {
        nodes.push(0.1 * DVec3::new(f64::from(n % 3), f64::from(n / 3 % 2), f64::from(n / 6)));
    }
    for i in 0..2 {
        let c = |bits: u32| at(i + (bits & 1), bits >> 1 & 1, bits >> 2);
        tets.extend([[1, 3], [5, 1], [3, 2], [2, 6], [4, 5], [6, 4]].map(|w| [c(0), c(w[0]), c(w[1]), c(7)]));
    }
    Block { nodes, tets, base: [[0, 3, 9], [0, 6, 9]] }
}

/// Numbers as text or bytes.
#[derive(Clone, Copy, PartialEq)]
enum As {
    Text,
    Little,
    Big,
}

struct Out(Vec<u8>, As);

impl Out {
    fn text(&mut self, text: &str) {
        self.0.extend(text.as_bytes());
    }
    fn bytes<const N: usize>(&mut self, mut bytes: [u8; N], text: String) {
        match self.1 {
            As::Text => return self.text(&(text + " ")),
            As::Big => bytes.reverse(),
            As::Little => {}
        }
        self.0.extend(bytes);
    }
    fn int(&mut self, n: u32) {
        self.bytes((n as i32).to_le_bytes(), n.to_string());
    }
    fn size(&mut self, n: u32) {
        self.bytes(u64::from(n).to_le_bytes(), n.to_string());
    }
    fn real(&mut self, x: f64) {
        self.bytes(x.to_le_bytes(), format!("{x:?}"));
    }
    fn ints(&mut self, all: &[u32]) {
        all.iter().for_each(|n| self.int(*n));
    }
    fn sizes(&mut self, all: &[u32]) {
        all.iter().for_each(|n| self.size(*n));
    }
}

/// Tags of Gmsh's nodes: in steps of ten, from 7 on.
fn tag(n: u32) -> u32 {
    7 + 10 * n
}

fn gmsh(version: &str, how: As) -> Vec<u8> {
    let (b, mut out) = (block(), Out(Vec::new(), how));
    out.text(&format!("$MeshFormat\n{version} {} 8\n", u8::from(how != As::Text)));
    if how != As::Text {
        out.int(1);
    }
    out.text("\n$EndMeshFormat\n$PhysicalNames\n2\n2 4 \"the base\"\n3 5 \"all\"\n$EndPhysicalNames\n");
    if version == "4.1" {
        out.text("$Entities\n");
        out.sizes(&[1, 0, 1, 1]);
        out.int(1);
        (0..3).for_each(|_| out.real(0.0));
        out.size(0);
        // A surface in group 4 with a boundary, and a volume in group 5 and one without a name.
        for (entity, groups, boundary) in [(8, &[4][..], &[1, 2][..]), (9, &[5, 6], &[8])] {
            out.int(entity);
            (0..6).for_each(|_| out.real(0.25));
            out.size(groups.len() as u32);
            out.ints(groups);
            out.size(boundary.len() as u32);
            out.ints(boundary);
        }
        out.text("\n$EndEntities\n$Nodes\n");
        out.sizes(&[2, 12, 7, 117]);
        // One block with a parameter for each node of a curve, and one without.
        for (dimension, parametric, from, to) in [(1, 1, 0, 5), (3, 0, 5, 12)] {
            out.ints(&[dimension, 1, parametric]);
            out.size(to - from);
            (from..to).for_each(|n| out.size(tag(n)));
            for n in from..to {
                b.nodes[n as usize].to_array().iter().for_each(|x| out.real(*x));
                (0..parametric).for_each(|_| out.real(0.5));
            }
        }
        out.text("\n$EndNodes\n$Periodic\n0\n$EndPeriodic\n$Elements\n");
        out.sizes(&[2, 14, 1, 14]);
        out.ints(&[2, 8, 2]);
        out.size(2);
        b.base.iter().for_each(|t| out.sizes(&[1, tag(t[0]), tag(t[1]), tag(t[2])]));
        out.ints(&[3, 9, 4]);
        out.size(12);
        b.tets.iter().for_each(|t| out.sizes(&[2, tag(t[0]), tag(t[1]), tag(t[2]), tag(t[3])]));
    } else {
        out.text("$Nodes\n12\n");
        for (n, x) in (0..).zip(&b.nodes) {
            out.int(tag(n));
            x.to_array().iter().for_each(|x| out.real(*x));
        }
        out.text("\n$EndNodes\n$Elements\n14\n");
        for (of, count) in [(2, 2), (4, 12)] {
            if how != As::Text {
                out.ints(&[of, count, 2]);
            }
            for e in 0..count as usize {
                out.int(1 + e as u32);
                if how == As::Text {
                    out.ints(&[of, 2]);
                }
                out.ints(&[if of == 2 { 4 } else { 5 }, 1]);
                let nodes = if of == 2 { &b.base[e][..] } else { &b.tets[e][..] };
                nodes.iter().for_each(|n| out.int(tag(*n)));
            }
        }
    }
    out.text("\n$EndElements\n");
    out.0
}

/// Ways to keep the arrays of a VTU file.
#[derive(Clone, Copy, PartialEq)]
enum Keep {
    Ascii,
    Inline { zlib: bool },
    Appended { raw: bool, zlib: bool },
}

fn vtu(keep: Keep, big: bool) -> Vec<u8> {
    let b = block();
    let zlib = matches!(keep, Keep::Inline { zlib: true } | Keep::Appended { zlib: true, .. });
    let ordered = |mut bytes: Vec<u8>, size: usize| {
        if big {
            bytes.chunks_exact_mut(size).for_each(<[u8]>::reverse);
        }
        bytes
    };
    let head = |sizes: &[u64]| ordered(sizes.iter().flat_map(|n| n.to_le_bytes()).collect(), 8);
    let coded = |bytes: Vec<u8>, raw: bool| -> Vec<u8> {
        let parts = if zlib {
            // Two blocks, the second one shorter.
            let half = bytes.len() * 2 / 3;
            let packed: Vec<Vec<u8>> = [&bytes[..half], &bytes[half..]]
                .map(|part| {
                    let mut z = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
                    z.write_all(part).unwrap();
                    z.finish().unwrap()
                })
                .to_vec();
            let sizes = [2, half, bytes.len() - half, packed[0].len(), packed[1].len()].map(|n| n as u64);
            vec![head(&sizes), packed.concat()]
        } else {
            vec![[head(&[bytes.len() as u64]), bytes].concat()]
        };
        if raw { parts.concat() } else { parts.iter().flat_map(|p| STANDARD.encode(p).into_bytes()).collect() }
    };
    let mut appended = Vec::new();
    let mut array = |kind: &str, name: &str, components: u32, numbers: &[f64]| {
        let bytes = numbers.iter().flat_map(|x| match kind {
            "Float64" => x.to_le_bytes().to_vec(),
            "Int64" => (*x as i64).to_le_bytes().to_vec(),
            "Int32" => (*x as i32).to_le_bytes().to_vec(),
            _ => vec![*x as u8],
        });
        let bytes = ordered(
            bytes.collect(),
            match kind {
                "UInt8" => 1,
                "Int32" => 4,
                _ => 8,
            },
        );
        let tag = format!("<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\"");
        match keep {
            Keep::Ascii => {
                let text: Vec<String> = numbers.iter().map(f64::to_string).collect();
                format!("{tag} format=\"ascii\">\n{}\n</DataArray>\n", text.join(" "))
            }
            Keep::Inline { .. } => {
                format!("{tag} format=\"binary\">\n  {}\n</DataArray>\n", String::from_utf8(coded(bytes, false)).unwrap())
            }
            Keep::Appended { raw, .. } => {
                let offset = appended.len();
                appended.extend(coded(bytes, raw));
                format!("{tag} format=\"appended\" offset=\"{offset}\"/>\n")
            }
        }
    };
    let points: Vec<f64> = b.nodes.iter().flat_map(|x| x.to_array()).collect();
    let cells: Vec<f64> = b.base.as_flattened().iter().chain(b.tets.as_flattened()).map(|n| f64::from(*n)).collect();
    let ends: Vec<f64> = (1..=14).map(|e| f64::from(if e < 3 { 3 * e } else { 6 + 4 * (e - 2) })).collect();
    let each = |face: f64, volume: f64| (0..14).map(|e| if e < 2 { face } else { volume }).collect::<Vec<f64>>();
    let (types, part) = (each(5.0, 10.0), each(4.0, 5.0));
    let held: Vec<f64> = b.nodes.iter().map(|x| if x.x == 0.0 { -1.0 } else { 0.0 }).collect();
    let numbers: Vec<f64> = (0..12).map(f64::from).collect();
    let mut out = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"{}\" header_type=\"UInt64\"{}>\n\
         <UnstructuredGrid>\n<Piece NumberOfPoints=\"12\" NumberOfCells=\"14\">\n<PointData>\n{}{}</PointData>\n<CellData>\n{}</CellData>\n\
         <Points>\n{}</Points>\n<Cells>\n{}{}{}</Cells>\n</Piece>\n</UnstructuredGrid>\n",
        if big { "BigEndian" } else { "LittleEndian" },
        if zlib { " compressor=\"vtkZLibDataCompressor\"" } else { "" },
        array("Int32", "held &amp; more", 1, &held),
        array("Float64", "x", 1, &numbers),
        array("Int64", "part", 1, &part),
        array("Float64", "Points", 3, &points),
        array("Int64", "connectivity", 1, &cells),
        array("Int64", "offsets", 1, &ends),
        array("UInt8", "types", 1, &types),
    )
    .into_bytes();
    if let Keep::Appended { raw, .. } = keep {
        out.extend(format!("<AppendedData encoding=\"{}\">\n _", if raw { "raw" } else { "base64" }).bytes());
        out.extend(appended);
        out.extend(b"\n</AppendedData>\n");
    }
    out.extend(b"</VTKFile>\n");
    out
}

fn legacy(version: u32, how: As) -> Vec<u8> {
    let (b, mut out) = (block(), Out(Vec::new(), how));
    let word = if how == As::Text { "ASCII" } else { "BINARY" };
    out.text(&format!("# vtk DataFile Version {version}.0\na block\n{word}\nDATASET UNSTRUCTURED_GRID\nPOINTS 12 double\n"));
    b.nodes.iter().flat_map(|x| x.to_array()).for_each(|x| out.real(x));
    let cells: Vec<&[u32]> = b.base.iter().map(|t| &t[..]).chain(b.tets.iter().map(|t| &t[..])).collect();
    if version < 5 {
        out.text("\nCELLS 14 68\n");
        for c in &cells {
            out.int(c.len() as u32);
            out.ints(c);
        }
    } else {
        out.text("\nMETADATA\nINFORMATION 0\n\nCELLS 15 54\nOFFSETS vtktypeint64\n");
        out.size(0);
        let mut end = 0;
        for c in &cells {
            end += c.len() as u32;
            out.size(end);
        }
        out.text("\nCONNECTIVITY vtktypeint64\n");
        cells.iter().for_each(|c| out.sizes(c));
    }
    out.text("\nCELL_TYPES 14\n");
    (0..14).for_each(|e| out.int(if e < 2 { 5 } else { 10 }));
    out.text("\nCELL_DATA 14\nSCALARS part int 1\nLOOKUP_TABLE default\n");
    (0..14).for_each(|e| out.int(if e < 2 { 4 } else { 5 }));
    out.text("\nPOINT_DATA 12\nVECTORS u double\n");
    b.nodes.iter().flat_map(|x| x.to_array()).for_each(|x| out.real(x));
    out.text("\nFIELD FieldData 1\nheld 1 12 vtktypeint64\n");
    b.nodes.iter().for_each(|x| out.size(u32::from(x.x == 0.0)));
    out.text("\n");
    out.0
}

/// `.node` and `.ele` that count from here.
fn tetgen(first: u32) -> [String; 2] {
    let b = block();
    let mut node = "# made by hand\n12 3 1 1\n".to_string();
    for (n, x) in (first..).zip(&b.nodes) {
        node += &format!("{n} {} {} {} {}.0 {}\n", x.x, x.y, x.z, u8::from(x.y > 0.0), if x.x == 0.0 { 3 } else { 0 });
    }
    let mut ele = "12 4 1\n".to_string();
    for (e, t) in (first..).zip(&b.tets) {
        let t = t.map(|n| n + first);
        ele += &format!("  {e} {} {} {} {}   {}  # a comment\n", t[0], t[1], t[2], t[3], if e < first + 6 { 1 } else { 2 });
    }
    [node, ele]
}

/// Every file, by name.
fn files() -> Vec<(String, Vec<u8>)> {
    let mut out = Vec::new();
    for (how, name) in [(As::Text, "text"), (As::Little, "little"), (As::Big, "big")] {
        out.push((format!("2-{name}.msh"), gmsh("2.2", how)));
        out.push((format!("4-{name}.msh"), gmsh("4.1", how)));
    }
    for (k, keep) in [
        Keep::Ascii,
        Keep::Inline { zlib: false },
        Keep::Inline { zlib: true },
        Keep::Appended { raw: true, zlib: false },
        Keep::Appended { raw: false, zlib: false },
        Keep::Appended { raw: true, zlib: true },
        Keep::Appended { raw: false, zlib: true },
    ]
    .into_iter()
    .enumerate()
    {
        out.push((format!("{k}.vtu"), vtu(keep, false)));
        out.push((format!("{k}-big.vtu"), vtu(keep, true)));
    }
    for version in [3, 5] {
        out.push((format!("{version}-text.vtk"), legacy(version, As::Text)));
        out.push((format!("{version}-big.vtk"), legacy(version, As::Big)));
    }
    out
}

fn read(name: &str, bytes: &[u8]) -> Result<Loaded<TetMesh>, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let shorter = |e: InputError| e.to_string().replace(&format!("{}/", folder.path().display()), "");
    read_tets(&path).map_err(shorter)
}

#[test]
fn every_format_gives_the_same_mesh_and_its_groups() {
    let b = block();
    let base: Vec<u32> = vec![0, 3, 6, 9];
    let check = |name: &str, mesh: &TetMesh| {
        assert_eq!(mesh.nodes, b.nodes, "{name}");
        assert_eq!(mesh.tets, b.tets, "{name}");
        let groups: Vec<&str> = mesh.groups.keys().map(String::as_str).collect();
        let expected: &[&str] = match name {
            n if n.ends_with(".msh") && n.starts_with("2-") => &["all", "the base"],
            n if n.ends_with(".msh") => &["all", "the base", "volume-6"],
            n if n.ends_with(".vtu") => &["held & more=-1", "held & more=0", "part=4", "part=5"],
            n if n.ends_with(".vtk") => &["held=0", "held=1", "part=4", "part=5"],
            _ => &["attribute=0", "attribute=1", "marker-3", "region-1", "region-2"],
        };
        assert_eq!(groups, expected, "{name}");
        for of in ["the base", "held & more=-1", "held=1", "part=4", "marker-3"] {
            assert!(mesh.groups.get(of).is_none_or(|nodes| *nodes == base), "{name}: {of}: {:?}", mesh.groups);
        }
        for of in ["all", "volume-6", "part=5"] {
            assert!(mesh.groups.get(of).is_none_or(|nodes| nodes.len() == 12), "{name}: {of}: {:?}", mesh.groups);
        }
    };
    for (name, bytes) in files() {
        let loaded = read(&name, &bytes).unwrap_or_else(|e| panic!("{e}"));
        assert!(loaded.warnings.is_empty(), "{name}: {:?}", loaded.warnings);
        check(&name, &loaded.value);
    }
    for first in [0, 1] {
        let folder = tempfile::tempdir().unwrap();
        let [node, ele] = tetgen(first);
        std::fs::write(folder.path().join("bar.node"), node).unwrap();
        std::fs::write(folder.path().join("bar.ele"), ele).unwrap();
        for name in ["bar.node", "bar.ele"] {
            check(name, &read_tets(folder.path().join(name)).unwrap_or_else(|e| panic!("{e}")).value);
        }
    }
}

#[test]
fn quadratic_tetrahedra_give_their_corners_with_a_word() {
    let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n10\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 .5 0 0\n6 .5 .5 0\n7 0 .5 0\n8 0 0 .5\n\
        9 0 .5 .5\n10 .5 0 .5\n$EndNodes\n$Elements\n2\n1 9 2 3 1 1 2 3 5 6 7\n2 11 2 0 1 1 2 3 4 5 6 7 8 9 10\n$EndElements\n";
    let Loaded { value, warnings } = read("q.msh", text.as_bytes()).unwrap();
    assert_eq!((value.nodes.len(), value.tets), (4, vec![[0, 1, 2, 3]]));
    assert_eq!(value.groups, [("surface-3".to_string(), vec![0, 1, 2])].into());
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].contains("1 of 1 tetrahedra have nodes beside their corners; these are left out"), "{warnings:?}");
}
