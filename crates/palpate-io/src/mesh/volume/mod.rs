//! Volume meshes: Gmsh, VTU, legacy VTK and TetGen files to linear tetrahedra with named groups of nodes.
//!
//! Every reader checks a number that a header announces against what is left of the file before it makes room for it.

mod bytes;
mod kinds;
mod legacy;
mod msh;
mod msh2;
mod msh4;
#[cfg(test)]
mod tests;
mod tetgen;
mod vtu;
mod vtu_data;

use self::bytes::Fault;
use self::kinds::Kind;
use crate::error::{InputError, Loaded};
use crate::input::read_bytes;
use crate::mesh::{LARGEST_SIDE, SMALLEST_SIDE, bounds};
use glam::DVec3;
use palpate_model::shape::unit_hint;
use palpate_model::space::points::TetMesh;
use palpate_model::space::tet_checks::CheckedTets;
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::Path;

/// Most distinct values of an array that become groups: beyond, they are numbers of nodes or cells and no groups.
const MOST_VALUES: usize = 256;

/// What a file holds, before anything is checked but that all named nodes are there.
#[derive(Debug, Default)]
struct Raw {
    nodes: Vec<DVec3>,
    tets: Vec<[u32; 4]>,
    groups: BTreeMap<String, BTreeSet<u32>>,
    /// Tetrahedra with nodes beside their corners.
    curved: usize,
    /// Volume elements that are no tetrahedra.
    others: BTreeMap<&'static str, usize>,
}

impl Raw {
    /// Takes an element with its nodes, corners first, into the mesh and into its groups.
    fn element(&mut self, kind: Kind, nodes: &[u32], groups: &[String]) {
        match (kind, nodes) {
            (Kind::Tetrahedron, [a, b, c, d, rest @ ..]) => {
                self.tets.push([*a, *b, *c, *d]);
                self.curved += usize::from(!rest.is_empty());
            }
            (Kind::Tetrahedron, _) => *self.others.entry("tetrahedra with fewer than 4 nodes").or_default() += 1,
            (Kind::Other(name), _) => *self.others.entry(name).or_default() += 1,
            (Kind::Part, _) => {}
        }
        for name in groups {
            match self.groups.get_mut(name) {
                Some(group) => group.extend(nodes),
                None => drop(self.groups.insert(name.clone(), nodes.iter().copied().collect())),
            }
        }
    }

    /// Groups of an array of whole numbers: one for each value, with the nodes that `of` gives for an entry.
    fn by_values<'a>(&mut self, name: &str, values: &[i64], of: impl Fn(usize) -> &'a [u32]) {
        let distinct: BTreeSet<i64> = values.iter().copied().collect();
        if distinct.len() > MOST_VALUES {
            return;
        }
        for (e, value) in values.iter().enumerate() {
            self.groups.entry(format!("{name}={value}")).or_default().extend(of(e));
        }
    }

    /// The mesh, if all of it is one of tetrahedra, and what is to be said of it.
    fn finish(mut self) -> Result<CheckedTets, String> {
        if let Some(n) = self.nodes.iter().position(|x| !x.is_finite()) {
            return Err(format!("node {} of {} is not finite: {}", n + 1, self.nodes.len(), self.nodes[n]));
        }
        if !self.others.is_empty() {
            let all: usize = self.others.values().sum();
            let kinds: Vec<String> = self.others.iter().map(|(name, n)| format!("{n} {name}")).collect();
            return Err(format!(
                "holds {all} volume elements that are no tetrahedra ({}) beside {} that are; mesh the body with tetrahedra alone",
                kinds.join(", "),
                self.tets.len()
            ));
        }
        let mut warnings = Vec::new();
        if self.curved > 0 {
            warnings.push(format!(
                "{} of {} tetrahedra have nodes beside their corners; these are left out: edges are straight, and mid-edge nodes of \
                 quadratic elements are placed anew",
                self.curved,
                self.tets.len()
            ));
        }
        // Gmsh 2.2 repeats an element for every physical group that it belongs to.
        let mut seen = HashSet::new();
        self.tets.retain(|t| {
            let mut key = *t;
            key.sort_unstable();
            seen.insert(key)
        });
        let groups = self.groups.into_iter().map(|(name, nodes)| (name, nodes.into_iter().collect())).collect();
        let mut checked = TetMesh { nodes: self.nodes, tets: self.tets, groups }.with_warnings()?;
        if self.curved > 0 {
            // Nodes that a warning has named already.
            checked.warnings.retain(|w| !w.ends_with("to no tetrahedron; dropped"));
        }
        checked.warnings.splice(0..0, warnings);
        Ok(checked)
    }
}

/// Reads tetrahedra (`.msh`, `.vtu`, `.vtk`, `.node` with `.ele`; metres) and groups of nodes.
///
/// # Errors
/// The file cannot be read or is damaged, holds other volume elements, is in the wrong unit, or its tetrahedra are no body.
pub fn read_tets(path: impl AsRef<Path>) -> Result<Loaded<TetMesh>, InputError> {
    tets(path.as_ref())
}

fn tets(path: &Path) -> Result<Loaded<TetMesh>, InputError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let wrong = |f: Fault| match f.line {
        Some(line) => InputError::line(path, line, f.message),
        None => InputError::file(path, f.message),
    };
    let raw = match extension.as_str() {
        "msh" | "vtu" | "vtk" => {
            let bytes = read_bytes(path)?;
            match extension.as_str() {
                "msh" => msh::read(&bytes).map_err(wrong)?,
                "vtu" => vtu::read(&bytes).map_err(wrong)?,
                _ => legacy::read(&bytes).map_err(wrong)?,
            }
        }
        "node" | "ele" => tetgen::read(path)?,
        other => {
            let message = format!("\".{other}\" is not a volume mesh that is read; allowed: .msh, .vtu, .vtk, .node with .ele");
            return Err(InputError::file(path, message));
        }
    };
    let CheckedTets { mesh, warnings } = raw.finish().map_err(|e| InputError::file(path, e))?;
    let (min, max) = bounds(&mesh.nodes);
    let side = (max - min).max_element();
    if !(SMALLEST_SIDE..=LARGEST_SIDE).contains(&side) {
        let hint = if side < SMALLEST_SIDE { "; convert the file" } else { unit_hint(side) };
        return Err(InputError::file(
            path,
            format!("its longest side is {} m; lengths are in metres{hint}", crate::error::number(side)),
        ));
    }
    let warnings = warnings.into_iter().map(|w| InputError::file(path, w).to_string()).collect();
    Ok(Loaded { value: mesh, warnings })
}
