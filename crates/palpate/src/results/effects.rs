//! What `palpate inspect --effects --json` prints: the library of effects.

use super::Document;
use serde::{Deserialize, Serialize};

/// Every law that a scene can add (`effects/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EffectsDocument {
    /// The laws, in the order of the library.
    pub effects: Vec<EffectLaw>,
}

impl Document for EffectsDocument {
    const FORMAT: &'static str = "effects/1";
}

/// A law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EffectLaw {
    /// Name in scene files.
    pub kind: String,
    /// What it competes with.
    pub family: String,
    /// One plain sentence, without full stop.
    pub sentence: String,
    /// How a diagnosis tries it.
    pub trial: String,
    /// Its keys.
    pub parameters: Vec<EffectKey>,
}

/// A key of a law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EffectKey {
    /// Key in the scene file.
    pub key: String,
    /// 3 for a vector, 1 for a number.
    pub components: usize,
    /// SI unit, `1` for none.
    pub unit: String,
    /// Smallest allowed value; `None` where there is no bound.
    pub lower: Option<f64>,
    /// Largest allowed value; `None` where there is no bound.
    pub upper: Option<f64>,
    /// A size at which it matters.
    pub typical: f64,
    /// Value where the scene does not say it; `None` for the body's centre of mass.
    pub default: Option<f64>,
    /// True where the effect does nothing at that value.
    pub absent: bool,
    /// What it means.
    pub doc: String,
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, round_trip};
    use crate::catalogue::document;

    #[test]
    fn the_library_is_what_it_was_when_it_is_read_again() {
        let file = round_trip(&document());
        assert_eq!(keys(&file["effects"][0]), ["family", "kind", "parameters", "sentence", "trial"]);
        let all = ["absent", "components", "default", "doc", "key", "lower", "typical", "unit", "upper"];
        assert_eq!(keys(&file["effects"][0]["parameters"][0]), all);
    }
}
