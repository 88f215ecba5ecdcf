//! What `palpate export --json` prints.

use super::Document;
use serde::{Deserialize, Serialize};

/// What was exported (`export/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExportDocument {
    /// The scene's file.
    pub scene: String,
    /// The folder of the files.
    pub out: String,
    /// Nodes of the mesh, middles of edges included.
    pub nodes: usize,
    /// Tetrahedra.
    pub tetrahedra: usize,
    /// True where they are quadratic, in formats that have such.
    pub quadratic: bool,
    /// Volume of the mesh [m³].
    pub volume: f64,
    /// Volume of the shape [m³].
    pub shape_volume: f64,
    /// Mass of the mesh, without point masses [kg].
    pub mass: f64,
    /// Nodes that each clamp holds.
    pub held: Vec<usize>,
    /// What was made.
    pub formats: Vec<ExportedFormat>,
}

/// One format.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExportedFormat {
    /// Its name.
    pub name: String,
    /// Its files in the folder, the main one first.
    pub files: Vec<String>,
    /// What it does not hold, or holds as something else.
    pub left_out: Vec<String>,
}

impl Document for ExportDocument {
    const FORMAT: &'static str = "export/1";
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, round_trip};
    use super::*;

    #[test]
    fn an_export_is_what_it_was_when_it_is_read_again() {
        let format = ExportedFormat { name: "urdf".into(), files: vec!["a.urdf".into()], left_out: vec!["plane".into()] };
        let file = round_trip(&ExportDocument {
            scene: "a.toml".into(),
            out: "out/a-export".into(),
            nodes: 10,
            tetrahedra: 1,
            quadratic: true,
            volume: 1e-3,
            shape_volume: 1e-3,
            mass: 1.0,
            held: vec![3],
            formats: vec![format],
        });
        let all =
            ["format", "formats", "held", "mass", "nodes", "out", "quadratic", "scene", "shape_volume", "tetrahedra", "volume"];
        assert_eq!(keys(&file), all);
    }
}
