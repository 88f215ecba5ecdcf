//! Gmsh's MSH 2.2 in text: the version that most programs read, palpate among them. Clamps are physical groups of points, numbers that vary are
//! data of elements.

use super::{Format, file};
use crate::feature::{Carried, Feature};
use crate::specimen::Specimen;
use crate::text::{head, num, rows, vector};
use crate::{ExportError, File};

/// The mesh.
pub const FORMAT: Format = Format {
    name: "gmsh",
    what: "MSH 2.2: mesh, groups and data",
    ending: "msh",
    has_quadratic: true,
    carries,
    law: |_| None,
    write,
};

const NO_PLACE: &str = "a mesh has no place for it; its value stands in the head";

fn carries(feature: Feature, _: bool) -> Carried {
    match feature {
        Feature::Moduli => Carried::As("`$ElementData` \"E\""),
        Feature::Densities => Carried::As("`$ElementData` \"density\""),
        Feature::Clamps => Carried::As("physical groups of points"),
        Feature::StartShape => Carried::As("`$NodeData` \"displacement\""),
        Feature::StartVelocity | Feature::StartSpin => Carried::As("`$NodeData` \"velocity\""),
        Feature::Planes | Feature::Masses => Carried::Not("a mesh has no place for it"),
        _ => Carried::Not(NO_PLACE),
    }
}

/// Numbers of element types: point, tetrahedra of 4 and of 10 nodes.
const POINT: u32 = 15;
const TETS: [u32; 2] = [4, 11];

fn write(s: &Specimen, lost: &[String]) -> Result<Vec<File>, ExportError> {
    let mut out = String::from("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Comments\n");
    head(s, lost).iter().for_each(|l| out += &format!("{l}\n"));
    out += &format!("$EndComments\n$PhysicalNames\n{}\n", s.held.len() + 1);
    (0..s.held.len()).for_each(|i| out += &format!("0 {} \"clamp-{i}\"\n", i + 2));
    out += "3 1 \"body\"\n$EndPhysicalNames\n";
    out += &format!("$Nodes\n{}\n", s.mesh.nodes.len());
    for (n, x) in s.mesh.nodes.iter().enumerate() {
        out += &format!("{} {}\n", n + 1, vector(*x, " "));
    }
    out += "$EndNodes\n";
    let tets = s.mesh.tets.len();
    let points: usize = s.held.iter().map(|h| h.nodes.len()).sum();
    out += &format!("$Elements\n{}\n", tets + points);
    let kind = TETS[usize::from(s.mesh.is_quadratic())];
    for e in 0..tets {
        let mut nodes: Vec<u32> = s.mesh.element(e).map(|n| n + 1).collect();
        if s.mesh.is_quadratic() {
            // Gmsh counts the last two middles the other way round.
            nodes.swap(8, 9);
        }
        out += &format!("{} {kind} 2 1 1 {}\n", e + 1, rows(nodes, 10, " ", ""));
    }
    let mut number = tets;
    for (i, h) in s.held.iter().enumerate() {
        for n in &h.nodes {
            number += 1;
            out += &format!("{number} {POINT} 2 {0} {0} {1}\n", i + 2, n + 1);
        }
    }
    out += "$EndElements\n";
    for (name, values) in [("E", &s.moduli), ("density", &s.densities)] {
        if let Some(values) = values {
            out += &data("ElementData", name, 1, values.iter().map(|v| num(*v)));
        }
    }
    if s.start.is_some() {
        out += &data("NodeData", "displacement", 3, s.mesh.nodes.iter().map(|x| vector(s.start_of(*x) - *x, " ")));
    }
    if let Some(v) = s.spin {
        out += &data("NodeData", "velocity", 3, s.mesh.nodes.iter().map(|x| vector(v.at(s.start_of(*x)), " ")));
    }
    Ok(vec![file(s, &FORMAT, out)])
}

/// A block of data: its name, time zero, step zero, so many components, and a row for every element or node from the first on.
fn data(block: &str, name: &str, components: usize, values: impl ExactSizeIterator<Item = String>) -> String {
    let mut out = format!("${block}\n1\n\"{name}\"\n1\n0\n3\n0\n{components}\n{}\n", values.len());
    values.enumerate().for_each(|(k, v)| out += &format!("{} {v}\n", k + 1));
    out + &format!("$End{block}\n")
}
