//! Volume meshes in Gmsh's format (MSH 4.1, ASCII or binary): their linear tetrahedra.

use crate::error::InputError;
use glam::DVec3;
use mshio::ElementType;
use palpate_model::space::points::TetMesh;
use std::collections::HashMap;
use std::path::Path;

/// Reads the linear tetrahedra of a file; lengths in metres.
///
/// # Errors
/// It cannot be read, is another version of the format, or its tetrahedra are no body.
pub fn read_tets(path: impl AsRef<Path>) -> Result<TetMesh, InputError> {
    let path = path.as_ref();
    let bytes = std::fs::read(path).map_err(|e| InputError::file(path, format!("cannot be read: {e}")))?;
    parse(&bytes).and_then(TetMesh::checked).map_err(|e| InputError::file(path, e))
}

fn parse(bytes: &[u8]) -> Result<TetMesh, String> {
    // The parser takes 4.1 alone; older files say so in their second line.
    let head: Vec<&str> = std::str::from_utf8(&bytes[..bytes.len().min(64)]).unwrap_or("").lines().take(2).collect();
    if head.first().map(|l| l.trim()) != Some("$MeshFormat") {
        return Err("is no Gmsh file: it must begin with $MeshFormat".into());
    }
    let version = head.get(1).and_then(|l| l.split_whitespace().next()).unwrap_or("");
    if version != "4.1" {
        return Err(format!("is of MSH version {version}; version 4.1 is read: gmsh FILE -save -format msh41 -o NEW.msh"));
    }
    let file = mshio::parse_msh_bytes(bytes).map_err(|_| "is damaged: its sections cannot be read as MSH 4.1".to_string())?;
    let nodes = file.data.nodes.ok_or("holds no nodes")?;
    let (mut mesh, mut number) = (TetMesh::default(), HashMap::new());
    // Where a block names no tags, nodes count on from those before.
    let mut next = 1u64;
    for block in nodes.node_blocks {
        let tags = block.node_tags.map(|tags| {
            let mut tags: Vec<(usize, u64)> = tags.into_iter().map(|(tag, place)| (place, tag)).collect();
            tags.sort_unstable();
            tags.into_iter().map(|t| t.1).collect::<Vec<_>>()
        });
        for (k, n) in block.nodes.iter().enumerate() {
            let tag = tags.as_ref().map_or(next, |t| t[k]);
            next = tag + 1;
            number.insert(tag, mesh.nodes.len() as u32);
            mesh.nodes.push(DVec3::new(n.x, n.y, n.z));
        }
    }
    let elements = file.data.elements.ok_or("holds no elements")?;
    let mut others = 0;
    for block in elements.element_blocks {
        match block.element_type {
            ElementType::Tet4 => {
                for e in &block.elements {
                    let node = |k: usize| {
                        let tag =
                            e.nodes.get(k).ok_or_else(|| format!("tetrahedron {} has fewer than 4 nodes", e.element_tag))?;
                        number.get(tag).copied().ok_or_else(|| format!("names node {tag}, which it does not hold"))
                    };
                    mesh.tets.push([node(0)?, node(1)?, node(2)?, node(3)?]);
                }
            }
            _ if block.entity_dim == 3 => others += block.elements.len(),
            _ => {}
        }
    }
    if others > 0 {
        return Err(format!(
            "holds {others} volume elements that are no linear tetrahedra; mesh it with those alone (gmsh -order 1)"
        ));
    }
    if mesh.nodes.iter().any(|x| !x.is_finite()) {
        return Err("has nodes that are no numbers".into());
    }
    Ok(mesh)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 5 1 5\n3 1 0 5\n1\n2\n3\n4\n5\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n\
        $EndNodes\n$Elements\n2 3 1 3\n2 1 2 1\n1 1 2 3\n3 1 4 2\n2 1 2 3 4\n3 2 4 3 5\n$EndElements\n";

    #[test]
    fn tetrahedra_are_read_and_turned_the_right_way_round() {
        let mesh = parse(TWO.as_bytes()).and_then(TetMesh::checked).unwrap();
        assert_eq!((mesh.nodes.len(), mesh.tets.len(), mesh.faces().len()), (5, 2, 6));
        let volume: f64 = mesh.points().0.volume.iter().sum();
        assert!((volume - (1.0 + 2.0) / 6.0).abs() < 1e-15, "{volume}");
    }

    #[test]
    fn what_is_no_mesh_of_tetrahedra_is_refused_with_a_reason() {
        for (text, message) in [
            ("solid ball", "is no Gmsh file: it must begin with $MeshFormat"),
            (
                &TWO.replace("4.1 0 8", "2.2 0 8"),
                "is of MSH version 2.2; version 4.1 is read: gmsh FILE -save -format msh41 -o NEW.msh",
            ),
            (&TWO.replace("3 2 4 3 5", "3 2 4 3 9"), "names node 9, which it does not hold"),
            (&TWO[..60], "is damaged: its sections cannot be read as MSH 4.1"),
        ] {
            assert_eq!(parse(text.as_bytes()).unwrap_err(), message);
        }
    }
}
