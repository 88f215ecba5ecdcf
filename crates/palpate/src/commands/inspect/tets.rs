//! What `palpate inspect` says of a body of tetrahedra: its mesh, and what was made of a shape.

use super::{Lines, why};
use crate::experiment::Experiment;
use crate::results::inspection::{Group, MadeHere, SceneInspection, Tetrahedra};
use palpate_model::plan::build::made;
use palpate_model::scene::{BodySource, Resolution};
use palpate_model::space::points::TetMesh;
use palpate_model::space::stars::Weights;

/// Adds the mesh of a body of tetrahedra to what is said.
pub(super) fn tetrahedra(e: &Experiment, content: &mut SceneInspection, lines: &mut Lines) {
    let object = &e.scene().object;
    if let BodySource::Cloud(cloud) = &object.source {
        let stars = &e.plan().body.points.stencils;
        let members = stars.iter().map(|s| s.nodes.len() - 1);
        let (least, most) = members.fold((usize::MAX, 0), |(a, b), n| (a.min(n), b.max(n)));
        let weights = match cloud.stars.weights {
            Weights::Compatible => "compatible",
            Weights::Published => "published",
        };
        lines.push(("points", format!("{} of about {:.5} m", cloud.points.len(), content.cell_size)));
        lines.push((
            "stars",
            format!("{least} to {most} neighbours, {weights} weights, residual penalty {}", cloud.stars.residual_penalty),
        ));
        return;
    }
    let (mesh, here): (TetMesh, _) = match (&object.source, object.resolution) {
        (BodySource::Tetrahedra { mesh, .. }, _) => (mesh.clone(), None),
        // The plan was made of it a moment ago, so it can be made again.
        (_, Resolution::Edge(edge)) => match made(object) {
            Ok((mesh, kept)) => (mesh, Some(MadeHere { edge_length: edge, volume_error: kept.error, moved: kept.moved })),
            Err(_) => return,
        },
        _ => return,
    };
    lines.push((
        "tetrahedra",
        format!("{} of about {:.5} m, {} corner nodes", mesh.tets.len(), content.cell_size, mesh.nodes.len()),
    ));
    let (least, most) = mesh.worst_dihedral_angles();
    lines.push(("dihedral angles", format!("{least:.1}° to {most:.1}°")));
    if let Some(m) = here {
        let kept = match m.moved {
            0.0 => "stays so: moving the surface would spoil tetrahedra".to_string(),
            moved => format!("made up for by moving the surface by {:.3} mm", 1e3 * moved),
        };
        let edge = format!("{:.5} m{}", m.edge_length, why(e, "object.edge_length"));
        lines.push(("edge length", edge));
        lines.push(("filled", format!("with an error in volume of {:.2} %, {kept}", 100.0 * m.volume_error)));
    } else {
        let named: Vec<String> = mesh.groups.iter().map(|(name, of)| format!("{name} ({} nodes)", of.len())).collect();
        lines.push(("groups", if named.is_empty() { "none".to_string() } else { named.join(", ") }));
    }
    content.tetrahedra = Some(Tetrahedra {
        count: mesh.tets.len(),
        corner_nodes: mesh.nodes.len(),
        volume: mesh.volume(),
        dihedral_angles: [least, most],
        groups: mesh.groups.iter().map(|(name, of)| Group { name: name.clone(), nodes: of.len() }).collect(),
        made_here: here,
    });
}
