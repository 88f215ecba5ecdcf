//! A specimen that has everything, in every format.

use super::*;
use crate::cells::Cells;
use crate::fill::fill;
use glam::{DAffine3, DVec3};
use palpate_model::cutcells::cut::ClipBox;
use palpate_model::scene::Analytic;
use palpate_model::shape::Placed;
use quick_xml::Reader;
use quick_xml::events::Event;
use std::collections::BTreeMap;
use std::sync::Arc;

const HELD: f64 = 0.02;

/// A bar of 0.2 × 0.04 × 0.04 m, held at one end.
fn bar(quadratic: bool) -> Specimen<'static> {
    let shape = Analytic::Box { min: DVec3::new(0.0, -0.02, -0.02), max: DVec3::new(0.2, 0.02, 0.02) };
    let region = ClipBox { to_frame: DAffine3::IDENTITY, min: DVec3::splat(-1.0), max: DVec3::new(HELD, 1.0, 1.0) };
    let filled = fill(&Placed::new(shape, DAffine3::IDENTITY), &[region], 0.02).unwrap();
    let mesh = Mesh::new(&filled.mesh, quadratic);
    let on_plane = |n: &u32| mesh.nodes[*n as usize].x < HELD + 1e-6;
    let nodes = (0..mesh.nodes.len() as u32).filter(on_plane).collect();
    Specimen {
        name: "bar".into(),
        title: "A <bar> & -- more".into(),
        source: "bar.toml".into(),
        mesh,
        material: Material {
            model: "corotated-linear",
            youngs_modulus: 6e5,
            poisson_ratio: 0.4,
            density: 1000.0,
            mass_damping: 0.0,
            stiffness_damping: 0.0,
        },
        moduli: None,
        densities: None,
        held: vec![Held { nodes, region }],
        planes: Vec::new(),
        masses: Vec::new(),
        gravity: DVec3::new(0.0, 0.0, -9.81),
        start: None,
        spin: None,
        clock: Clock::Static,
        beyond: Vec::new(),
    }
}

/// The bar with everything that a scene may have, but for a stiffness that varies.
fn full(quadratic: bool) -> Specimen<'static> {
    let plain = bar(quadratic);
    let count = plain.mesh.tets.len();
    Specimen {
        material: Material { mass_damping: 2.0, stiffness_damping: 1e-3, ..plain.material.clone() },
        densities: Some((0..count).map(|e| 1000.0 + e as f64).collect()),
        planes: vec![Ground { normal: DVec3::new(0.0, 0.6, 0.8), height: -0.1, stiffness: 1e6 }],
        masses: vec![PointMass { point: DVec3::new(0.19, 0.0, 0.02), mass: 0.05 }],
        start: Some(Arc::new(|x: DVec3| DVec3::new(0.0, 0.0, -0.1 * x.x * x.x))),
        spin: Some(Spin { velocity: DVec3::new(0.1, 0.0, 0.0), angular: DVec3::new(0.0, 2.0, 0.0), pivot: DVec3::ZERO }),
        clock: Clock::Motion { step: 0.01, steps: 20 },
        beyond: vec![("effect.0".into(), "coulomb-friction".into())],
        ..plain
    }
}

/// Number of elements of every name in a well-formed XML text.
fn elements(text: &str) -> BTreeMap<String, usize> {
    let (mut reader, mut count, mut open) = (Reader::from_str(text), BTreeMap::new(), Vec::new());
    loop {
        let name = |e: &quick_xml::events::BytesStart| String::from_utf8_lossy(e.name().as_ref()).into_owned();
        let mut seen = |n: String| *count.entry(n).or_insert(0) += 1;
        match reader.read_event().unwrap() {
            Event::Start(e) => {
                assert!(e.attributes().all(|a| a.is_ok()), "{e:?}");
                seen(name(&e));
                open.push(name(&e));
            }
            Event::Empty(e) => {
                assert!(e.attributes().all(|a| a.is_ok()), "{e:?}");
                seen(name(&e));
            }
            Event::End(e) => assert_eq!(open.pop().unwrap().as_bytes(), e.name().as_ref()),
            Event::Comment(c) => assert!(!String::from_utf8_lossy(&c).contains("--"), "two dashes in a comment"),
            Event::Eof => break,
            _ => {}
        }
    }
    assert!(open.is_empty(), "{open:?}");
    count
}

#[test]
fn every_format_names_in_its_head_what_it_leaves_out() {
    for quadratic in [false, true] {
        let s = full(quadratic);
        for format in formats() {
            let done = export(&s, format).unwrap_or_else(|e| panic!("{}: {e}", format.name));
            assert_eq!(done.files[0].name, format!("bar.{}", format.ending));
            let text = &done.files[0].text;
            assert!(done.lost.contains(&"effect.0 (coulomb-friction) is left out: no format has it".to_string()));
            for line in &done.lost {
                assert!(
                    text.contains(&format!("not here: {line}").replace('"', "\\\"")) || text.contains(line),
                    "{}: {line}",
                    format.name
                );
            }
            for feature in Feature::ALL.into_iter().filter(|f| f.is_in(&s)) {
                let told = done.lost.iter().any(|l| l.starts_with(&format!("{} is left out", feature.keys())));
                assert_eq!(told, matches!((format.carries)(feature, quadratic), Carried::Not(_)), "{} {feature:?}", format.name);
            }
            assert!(text.contains("gravity: 0 0 -9.81 m/s2"), "{}", format.name);
        }
    }
}

#[test]
fn a_modulus_that_varies_is_written_or_refused() {
    let plain = bar(true);
    let count = plain.mesh.tets.len();
    let s = Specimen { moduli: Some((0..count).map(|e| if e % 2 == 0 { 1e5 } else { 3e5 }).collect()), ..plain };
    let e = export(&s, find("mujoco").unwrap()).unwrap_err().to_string();
    let told = "field on material.youngs_modulus cannot be written as mujoco: a flex has one modulus; formats that hold it: calculix, febio, sofa, \
                usd, gmsh";
    assert_eq!(e, told);
    let deck = &export(&s, find("calculix").unwrap()).unwrap().files[0].text;
    assert_eq!(deck.matches("*SOLID SECTION").count(), 2);
    let moduli: Vec<f64> = deck.split("*ELASTIC\n").skip(1).map(|t| t.split(',').next().unwrap().parse().unwrap()).collect();
    // Half a step of a hundredth.
    assert!((moduli[0] / 1e5 - 1.0).abs() < 0.006 && (moduli[1] / 3e5 - 1.0).abs() < 0.006, "{moduli:?}");
    let field = export(&s, find("sofa").unwrap()).unwrap().files[0].text.clone();
    let list = field.split("youngModulus=\"").nth(1).unwrap().split('"').next().unwrap();
    assert_eq!(list.split_whitespace().count(), count);
    // A rigid link has no stiffness that could mislead.
    let rigid = export(&s, find("urdf").unwrap()).unwrap();
    assert!(rigid.lost.iter().any(|l| l == "field on material.youngs_modulus is left out: a link is rigid"), "{:?}", rigid.lost);
}

#[test]
fn xml_is_well_formed_and_complete() {
    let (s, l) = (full(true), full(false));
    let count = |s: &Specimen, name: &str| elements(&export(s, find(name).unwrap()).unwrap().files[0].text);
    let feb = count(&s, "febio");
    assert_eq!((feb["node"], feb["elem"], feb["bc"]), (s.mesh.nodes.len(), s.mesh.tets.len(), 1));
    for section in ["Module", "Control", "Material", "Mesh", "MeshDomains", "Boundary", "Loads", "Initial", "Output"] {
        assert_eq!(feb[section], 1, "{section}");
    }
    let scn = count(&l, "sofa");
    assert_eq!((scn["Node"], scn["PlaneForceField"], scn["FixedProjectiveConstraint"]), (2, 1, 1));
    // Every free corner is a body with three joints.
    let free = l.mesh.corners - l.held[0].nodes.len();
    let xml = count(&l, "mujoco");
    assert_eq!((xml["body"], xml["joint"], xml["flex"], xml["geom"]), (free, 3 * free, 1, 1));
    let robot = count(&l, "urdf");
    assert_eq!((robot["link"], robot["joint"], robot["mesh"]), (2, 1, 2));
}

#[test]
fn decks_keep_to_the_lengths_of_their_fields() {
    let deck = &export(&full(true), find("calculix").unwrap()).unwrap().files[0].text;
    for line in deck.lines().filter(|l| !l.starts_with("**")) {
        let fields = line.trim_end_matches(',').split(',').count();
        assert!(line.len() <= 132 && fields <= 16, "{line}");
        assert!(line.starts_with('*') || line.split(',').all(|f| f.trim().len() <= 20), "{line}");
    }
}

#[test]
fn gmsh_files_are_read_again_node_by_node() {
    let folder = tempfile::tempdir().unwrap();
    for quadratic in [false, true] {
        let s = full(quadratic);
        let path = folder.path().join("bar.msh");
        std::fs::write(&path, &export(&s, find("gmsh").unwrap()).unwrap().files[0].text).unwrap();
        let read = palpate_io::mesh::read_tets(&path).unwrap().value;
        let corners = &s.mesh.nodes[..s.mesh.corners];
        assert_eq!((&read.nodes[..], &read.tets), (corners, &s.mesh.tets));
        let held: Vec<u32> = s.held[0].nodes.iter().copied().filter(|n| (*n as usize) < corners.len()).collect();
        assert_eq!(read.groups["clamp-0"], held);
    }
}

#[test]
fn masses_of_nodes_are_those_of_the_body() {
    let s = full(true);
    let (mass, center, _) = s.mesh.inertia(|e| s.density(e));
    let whole = mass + s.masses[0].mass;
    assert!((s.corner_masses().iter().sum::<f64>() / whole - 1.0).abs() < 1e-12);
    let cells = Cells::new(&s, s.mesh.length());
    assert!((cells.masses.iter().sum::<f64>() / whole - 1.0).abs() < 1e-12);
    assert!(cells.masses.iter().all(|m| *m > 0.0), "the bar fills its box");
    // Without the point mass, and of one density, the lumped centre is the body's: cells are full.
    let plain = bar(true);
    let cells = Cells::new(&plain, plain.mesh.length());
    let first: DVec3 = (0..cells.len()).map(|n| cells.place(n) * cells.masses[n]).sum();
    let middle = DVec3::new(0.1, 0.0, 0.0);
    // 32 points a tetrahedron integrate the squares of quadratic functions to a few per mille.
    assert!((first / plain.mass() - middle).length() < 1e-3 * 0.2, "{first} {center}");
}

#[test]
fn inertia_is_that_of_a_block() {
    let s = bar(false);
    let (mass, center, i) = s.mesh.inertia(|e| s.density(e));
    let (l, b) = (0.2, 0.04f64);
    assert!((mass / (1000.0 * l * b * b) - 1.0).abs() < 1e-9 && (center.x - 0.5 * l).abs() < 1e-9);
    let exact = DVec3::new(b * b + b * b, l * l + b * b, l * l + b * b) * mass / 12.0;
    let diagonal = DVec3::new(i.x_axis.x, i.y_axis.y, i.z_axis.z);
    assert!((diagonal - exact).length() < 1e-9 * exact.length(), "{diagonal} {exact}");
    assert!(i.x_axis.y.abs() + i.x_axis.z.abs() + i.y_axis.z.abs() < 1e-12);
}

#[test]
fn a_clamp_between_the_nodes_of_cells_is_refused() {
    let plain = bar(true);
    // Turned, so that no number of cells brings planes of nodes to its faces, and away from all of them.
    let to_frame = DAffine3::from_rotation_x(0.3) * DAffine3::from_translation(-DVec3::new(0.05, 0.0085, 0.0085));
    let region = ClipBox { to_frame, min: DVec3::splat(-1e-4), max: DVec3::splat(1e-4) };
    let s = Specimen { held: vec![Held { nodes: vec![3], region }], ..plain };
    let e = export(&s, find("mujoco").unwrap()).unwrap_err().to_string();
    assert!(e.starts_with("clamp.0 cannot be written as mujoco: it holds no node of the cells"), "{e}");
}

#[test]
fn the_page_has_the_table() {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/export.md")).unwrap();
    assert!(page.contains(&markdown()), "docs/export.md has another table than:\n{}", markdown());
}
