//! What `palpate place` writes as `placed.json`; the scene with the controls lies beside it.

use super::Document;
use serde::{Deserialize, Serialize};

/// Placed controls (`placement/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlacementDocument {
    /// The scene's file.
    pub scene: String,
    /// `placed`, `one everywhere` or `interrupted`.
    pub verdict: String,
    /// Path of the number that varies.
    pub number: String,
    /// Its SI unit.
    pub unit: String,
    /// Its value where the factor is one.
    pub value: Option<f64>,
    /// How the controls share the body.
    pub blend: String,
    /// Wall-clock time [s].
    pub seconds: f64,
    /// The controls, in the order of the field's regions.
    pub controls: Vec<ControlRow>,
    /// Every fit.
    pub rounds: Vec<PlaceRoundRow>,
}

/// One control.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControlRow {
    /// Centre at rest [m].
    pub center: [f64; 3],
    /// Radius [m].
    pub radius: f64,
    /// Factor on the number.
    pub factor: Option<f64>,
    /// Its standard error.
    pub standard_error: Option<f64>,
}

/// A fit with so many controls.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlaceRoundRow {
    /// Number of controls.
    pub controls: usize,
    /// Cost of its fit.
    pub cost: Option<f64>,
    /// Mean square residual over the squared noise.
    pub reduced_chi_square: Option<f64>,
    /// What one control more would add to the logarithm of the evidence.
    pub gain: Option<f64>,
    /// Places that were tried for it: it is worth more than their logarithm, or it is not placed.
    pub tried: usize,
}

impl Document for PlacementDocument {
    const FORMAT: &'static str = "placement/1";
}

#[cfg(test)]
mod tests {
    use super::super::tests::round_trip;
    use super::*;

    #[test]
    fn placed_controls_are_what_they_were_when_they_are_read_again() {
        let round = PlaceRoundRow { controls: 1, cost: Some(0.5), reduced_chi_square: None, gain: Some(1.0 / 3.0), tried: 276 };
        round_trip(&PlacementDocument {
            scene: "a.toml".into(),
            verdict: "placed".into(),
            number: "material.youngs_modulus".into(),
            unit: "Pa".into(),
            value: Some(5e4),
            blend: "nearest".into(),
            seconds: 1.5,
            controls: vec![ControlRow { center: [0.0, 0.1, 1.0 / 3.0], radius: 0.02, factor: Some(2.0), standard_error: None }],
            rounds: vec![round],
        });
    }
}
