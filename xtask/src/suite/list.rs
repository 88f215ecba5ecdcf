//! The list of cases: `benchmark/cases.toml`.

use super::case::{Case, Simulator};
use super::drawn::KINDS;
use crate::table;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

const HEAD: &str = "# Every case of the benchmark; README.md says what the keys mean. `cargo xtask suite --calibrate` fills in amplitude, strength and\n\
                    # acts of cases that lack them, and leaves the others as they are.\n\n";

/// So many drawn scenes with nothing hidden.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Nulls {
    /// Kind of the scenes.
    pub kind: String,
    /// Number of the first.
    pub first: u64,
    /// How many.
    pub count: u64,
}

/// The file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct List {
    /// Drawn scenes with nothing hidden.
    #[serde(default)]
    pub nulls: Vec<Nulls>,
    /// All others.
    #[serde(default)]
    pub case: Vec<Case>,
}

/// Where the list stands.
pub fn path() -> PathBuf {
    table::root().join("benchmark/cases.toml")
}

impl List {
    /// Reads it.
    ///
    /// # Errors
    /// The file cannot be read or is no list.
    pub fn read() -> Result<List, String> {
        let path = path();
        let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        toml::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
    }

    /// Writes it, whole or not at all.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self) -> Result<(), String> {
        let path = path();
        let fail = |e: std::io::Error| format!("{}: {e}", path.display());
        let new = path.with_extension("new");
        std::fs::write(&new, HEAD.to_string() + &toml::to_string(self).map_err(|e| e.to_string())?).map_err(fail)?;
        std::fs::rename(&new, &path).map_err(fail)
    }

    /// Every case, drawn ones included.
    ///
    /// # Errors
    /// A kind of scene does not exist.
    pub fn cases(&self) -> Result<Vec<Case>, String> {
        let mut all = self.case.clone();
        for n in &self.nulls {
            if !KINDS.contains(&n.kind.as_str()) {
                return Err(format!("{}: there is no kind \"{}\"; there are {}", path().display(), n.kind, KINDS.join(", ")));
            }
            all.extend((n.first..n.first + n.count).map(|i| Case {
                name: format!("null {} {i}", n.kind),
                group: "null".into(),
                scene: format!("drawn {} {i}", n.kind),
                simulator: Simulator::Cells,
                seed: 5000 + i,
                held_out: true,
                strength: None,
                acts: None,
                hidden: Vec::new(),
            }));
        }
        Ok(all)
    }
}
