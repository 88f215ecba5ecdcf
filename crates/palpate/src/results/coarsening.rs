//! What `palpate coarsen` found: `coarsening.json`.

use super::Document;
use serde::{Deserialize, Serialize};

/// Numbers with which a coarse body moves like a fine one (`coarsening/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CoarseningDocument {
    /// The mesh that the numbers belong to, in words.
    pub mesh: String,
    /// The mesh that it follows.
    pub fine: String,
    /// Nodes of the fine and of the coarse body.
    pub nodes: [usize; 2],
    /// The numbers.
    pub numbers: Vec<BoundNumber>,
    /// Root mean square distance between points of both bodies with the fine one's numbers [m].
    pub before: f64,
    /// With those found [m].
    pub after: f64,
    /// The same in a second motion; absent where nothing moves the body in another way, and when interrupted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub check: Option<Check>,
    /// True where the fit was stopped before its end.
    pub interrupted: bool,
    /// What deserves attention.
    pub warnings: Vec<String>,
}

impl Document for CoarseningDocument {
    const FORMAT: &'static str = "coarsening/1";
}

/// A number that belongs to a mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BoundNumber {
    /// Its path.
    pub path: String,
    /// The fine body's value.
    pub fine: f64,
    /// The coarse body's.
    pub coarse: f64,
    /// SI unit.
    pub unit: String,
}

/// Root mean square distances in a second motion [m].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// The motion, in words.
    pub motion: String,
    /// With the fine body's numbers.
    pub before: f64,
    /// With those found for the first motion.
    pub transferred: f64,
    /// With numbers that are fitted to this motion.
    pub refitted: f64,
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, round_trip};
    use super::*;

    #[test]
    fn a_coarsening_is_what_it_was_when_it_is_read_again() {
        let file = round_trip(&CoarseningDocument {
            mesh: "5 cells".into(),
            fine: "320 cells".into(),
            nodes: [525, 24],
            numbers: vec![BoundNumber {
                path: "material.youngs_modulus".into(),
                fine: 1e5,
                coarse: 1.0 / 3.0,
                unit: "Pa".into(),
            }],
            before: 0.01,
            after: 0.001,
            check: Some(Check { motion: "a shake".into(), before: 0.02, transferred: 0.003, refitted: 0.002 }),
            interrupted: false,
            warnings: vec!["w".into()],
        });
        assert_eq!(
            keys(&file),
            ["after", "before", "check", "fine", "format", "interrupted", "mesh", "nodes", "numbers", "warnings"]
        );
    }
}
