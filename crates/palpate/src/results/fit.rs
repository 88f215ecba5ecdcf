//! `result.json` of a fit.

use super::Document;
pub use super::found::{FoundCurve, FoundNormal};
use palpate_fit::AtBound;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a fit found (`fit/2`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitDocument {
    /// What it is worth: the first that there is to know.
    pub verdict: Verdict,
    /// Version of the program.
    pub version: String,
    /// What computed: `cpu` or `gpu`.
    pub backend: String,
    /// The first scene's file.
    pub scene: Option<String>,
    /// Files of all scenes.
    pub scenes: Vec<String>,
    /// Name of the optimiser.
    #[serde(default)]
    pub optimizer: String,
    /// How it ended.
    pub status: FitStatus,
    /// Why it broke off, if it did.
    pub error: Option<String>,
    /// The numbers found.
    pub parameters: Vec<Parameter>,
    /// The fields found; their values lie in array files.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fields: Vec<FieldReference>,
    /// Curves of stiffness of which factors were free.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub curves: Vec<FoundCurve>,
    /// Normals of planes of which an angle was free.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub normals: Vec<FoundNormal>,
    /// Correlation matrix of the numbers' errors `[q][q]`, of the logarithms where these are fitted.
    pub correlation: Vec<Vec<Option<f64>>>,
    /// Cost per scalar residual at the first start and at the best point.
    pub cost: Cost,
    /// Mean square residual over the squared noise: 1 where the model is right and the noise as stated.
    pub reduced_chi_square: Option<f64>,
    /// How many independent readings the data are worth.
    pub independent_readings: Option<f64>,
    /// Distance between measurement and model with the numbers found.
    pub residual: Residual,
    /// The same at the first start; `None` where that cannot be computed.
    pub residual_before: Option<ResidualBefore>,
    /// Distances from the frames that the fit saw and from those that it did not, where the scene keeps some from it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<super::frames::Frames>,
    /// Place in `runs` of the best.
    pub best: usize,
    /// One search per start.
    pub runs: Vec<Run>,
    /// What was chosen for this fit and why, in sentences.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// What a fit of tracked points found, from which this one started.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub from_tracks: Vec<Tracked>,
    /// What deserves attention, in sentences.
    pub warnings: Vec<String>,
    /// Simulations of all searches together.
    pub evaluations: usize,
    /// Wall-clock time [s].
    pub seconds: f64,
}

impl Document for FitDocument {
    const FORMAT: &'static str = "fit/2";
}

/// A number as tracked points alone give it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tracked {
    /// Path in the scene file.
    pub path: String,
    /// Number of its scene, where scenes do not share it.
    pub scene: Option<usize>,
    /// Value in SI.
    pub value: Option<f64>,
    /// Its standard error, by noise alone.
    pub standard_error: Option<f64>,
    /// How far it is from what was found at last, in standard errors of the difference.
    pub distance: Option<f64>,
}

/// What a fit is worth.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// In a word.
    pub word: VerdictWord,
    /// Why, in sentences; none of a fit that converged.
    pub reasons: Vec<String>,
}

/// What a fit is worth, in a word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum VerdictWord {
    /// The best point was found, and nothing speaks against it.
    #[default]
    Converged,
    /// It was cut short; the reasons say what is missing.
    Interrupted,
    /// A bound holds a number: the best value may lie beyond it.
    AtABound,
    /// The numbers should not be believed.
    NotToBeTrusted,
}

impl VerdictWord {
    /// As files, pages and the terminal write it.
    pub fn name(self) -> &'static str {
        match self {
            VerdictWord::Converged => "converged",
            VerdictWord::Interrupted => "interrupted",
            VerdictWord::AtABound => "at-a-bound",
            VerdictWord::NotToBeTrusted => "not-to-be-trusted",
        }
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(self.word.name())?;
        if self.reasons.is_empty() { Ok(()) } else { write!(f, ": {}", self.reasons.join("; ")) }
    }
}

/// How a fit ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FitStatus {
    /// All searches came to their end.
    Complete,
    /// It was interrupted; the best until then is kept.
    Interrupted,
    /// The device failed; the best until then is kept.
    BrokenOff,
}

/// One fitted number.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Path in the scene file.
    pub path: String,
    /// Its value, in `unit`; in the limit of fine cells and steps where it was corrected to that.
    pub value: Option<f64>,
    /// The whole standard error in the same unit; `None` at a bound or where the data do not say.
    pub standard_error: Option<f64>,
    /// Its parts, which add as squares.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parts: Option<Parts>,
    /// The value that fits the recording on the scene's own cells and step, where `value` is corrected.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncorrected: Option<f64>,
    /// SI unit, `1` for none.
    pub unit: String,
    /// How far cells and time step half as large would move it, where that was looked at.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finer_grid_shift: Option<f64>,
    /// Value and standard deviation that were known beforehand (`known` in the scene).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub known: Option<[f64; 2]>,
    /// The scene that it belongs to, from 0; absent where all scenes share it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene: Option<usize>,
    /// The bound that holds it, if one does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_bound: Option<AtBound>,
}

/// Parts of a standard error, in the number's unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Parts {
    /// What averages out over readings.
    pub noise: Option<f64>,
    /// What cells and step leave open; `None` where that was not looked at.
    pub discretisation: Option<f64>,
    /// What the recording calls systematic.
    pub systematic: Option<f64>,
}

/// A found field: what it is, and where its values lie.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FieldReference {
    /// Path of the field in the scene file, `field.0`.
    pub path: String,
    /// Path of the number that it varies.
    pub varies: String,
    /// What its values belong to: `cells`, `nodes` or `regions`.
    pub basis: String,
    /// Number of values.
    pub count: usize,
    /// The NPZ file beside this document.
    pub file: String,
    /// Name of its array of values; others are `factor` and `place` (of every cell or node) and, where errors are known, `standard_error`. With a
    /// prior also `ln_sd`, `ln_prior_sd`, `gain` and `undetermined`.
    pub array: String,
    /// The VTU file beside this document with the fields on the grid.
    pub grid: String,
    /// Smallest value, a factor.
    pub min: Option<f64>,
    /// Median of the values.
    pub median: Option<f64>,
    /// Largest value.
    pub max: Option<f64>,
    /// What its prior and the recording say of it together, of a field with a prior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub posterior: Option<Posterior>,
    /// The scene that it belongs to, from 0.
    pub scene: usize,
}

/// What a prior and the recording say of a field; deviations are of logarithms of values.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Posterior {
    /// Kind of the prior: `matern` or `edge-preserving`.
    pub prior: String,
    /// Length over which values are alike [m]; absent of edge-preserving priors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
    /// Deviation of the prior.
    pub deviation: Option<f64>,
    /// Which of both the recording chose.
    pub chosen: Vec<String>,
    /// How many residuals count as one reading of the stated noise.
    pub residuals_as_one: Option<f64>,
    /// How many numbers the recording tells of all fields with priors.
    pub effective: Option<f64>,
    /// Smallest, median and largest standard deviation of the values.
    pub sd: [Option<f64>; 3],
    /// Values of whose variance the recording takes less than a tenth.
    pub undetermined: usize,
    /// Their share of the body's volume.
    pub undetermined_share: Option<f64>,
    /// What was tried, with the logarithm of its evidence over that of the best; a deviation of 0 is one value everywhere.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tried: Vec<Tried>,
}

/// Numbers of a prior that were tried.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Tried {
    /// Length [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
    /// Deviation.
    pub deviation: f64,
    /// Logarithm of the evidence over that of the best.
    pub evidence: Option<f64>,
}

/// Cost per scalar residual, half a mean square in units of noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// At the first start.
    pub initial: Option<f64>,
    /// At the best point.
    #[serde(rename = "final")]
    pub last: Option<f64>,
}

/// Distances between measurement and model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Residual {
    /// Root mean square distance of matched points [m].
    pub rms: Option<f64>,
    /// What noise and the shape's rounding by cells would leave [m].
    pub noise: Option<f64>,
    /// Matched points and markers.
    pub points: usize,
    /// Points that met no part of the body.
    pub unmatched: usize,
    /// The same scene by scene; only of the whole.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scenes: Vec<Residual>,
}

/// Distance between measurement and model before the fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ResidualBefore {
    /// Root mean square distance [m].
    pub rms: Option<f64>,
}

/// The search from one start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Where it began: values by label (path, and scene where it is not shared).
    pub start: BTreeMap<String, Option<f64>>,
    /// The best point that it found.
    pub end: BTreeMap<String, Option<f64>>,
    /// Cost where it began.
    pub start_cost: Option<f64>,
    /// Cost of the best point.
    pub cost: Option<f64>,
    /// Iterations done.
    pub iterations: usize,
    /// Simulations used.
    pub evaluations: usize,
    /// Products with the Gauss–Newton matrix used, a tangent and an adjoint each.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub products: usize,
    /// How it ended: `converged`, `iteration-limit`, `stalled`, `failed`, `blind`, `interrupted` or `broken-off`.
    pub status: String,
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, round_trip};
    use super::*;

    pub fn residual() -> Residual {
        Residual { rms: Some(1e-3), noise: Some(1.0 / 3e3), points: 70, unmatched: 2, scenes: Vec::new() }
    }

    #[test]
    fn a_fit_is_what_it_was_when_it_is_read_again() {
        let plain = Parameter { path: "material.density".into(), unit: "kg/m³".into(), ..Parameter::default() };
        let held = Parameter {
            value: Some(1.0 / 3.0),
            standard_error: Some(0.1 + 0.2),
            finer_grid_shift: Some(-1e-300),
            known: Some([0.3, 0.1]),
            parts: Some(Parts { noise: Some(0.1), discretisation: None, systematic: Some(0.0) }),
            uncorrected: Some(0.3),
            scene: Some(1),
            at_bound: Some(AtBound::Upper),
            ..plain.clone()
        };
        let values: BTreeMap<String, Option<f64>> = [("a".to_string(), Some(0.1)), ("b [scene 2]".to_string(), None)].into();
        let fit = FitDocument {
            verdict: Verdict { word: VerdictWord::AtABound, reasons: vec!["a is at its upper bound 1".into()] },
            version: "0.1.0".into(),
            backend: "cpu".into(),
            scene: Some("a.toml".into()),
            scenes: vec!["a.toml".into(), "b.toml".into()],
            status: FitStatus::BrokenOff,
            error: Some("the device was \"lost\"".into()),
            optimizer: "gauss-newton".into(),
            parameters: vec![plain, held],
            fields: vec![
                FieldReference { path: "field.0".into(), min: Some(0.5), max: None, ..FieldReference::default() },
                FieldReference {
                    posterior: Some(Posterior {
                        length: Some(0.1),
                        sd: [Some(0.1), None, Some(0.3)],
                        tried: vec![Tried { length: None, deviation: 0.4, evidence: Some(-1.0 / 3.0) }],
                        ..Posterior::default()
                    }),
                    ..FieldReference::default()
                },
            ],
            curves: vec![FoundCurve {
                path: "material.stretch_curve".into(),
                scene: 1,
                corners: vec![0.8, 1.25],
                factors: vec![2.0, 0.5],
                errors: vec![Some(0.1), None],
                range: [0.9, 1.1],
            }],
            normals: vec![FoundNormal { path: "plane.0.normal".into(), scene: 1, normal: [0.0, 0.6, 0.8], standard_error: None }],
            correlation: vec![vec![Some(1.0), None], vec![None, Some(1.0)]],
            cost: Cost { initial: None, last: Some(0.5) },
            reduced_chi_square: Some(1.1),
            independent_readings: None,
            residual: Residual { scenes: vec![residual(), residual()], ..residual() },
            residual_before: Some(ResidualBefore { rms: Some(0.02) }),
            frames: Some(super::super::frames::Frames::default()),
            best: 0,
            runs: vec![Run {
                start: values.clone(),
                end: values,
                start_cost: None,
                cost: Some(0.5),
                iterations: 3,
                evaluations: 7,
                products: 3,
                status: "stalled".into(),
            }],
            notes: vec!["starts by vibrations".into()],
            from_tracks: vec![Tracked {
                path: "material.youngs_modulus".into(),
                scene: None,
                value: Some(5.1e4),
                standard_error: Some(300.0),
                distance: Some(0.3),
            }],
            warnings: vec!["mind the ±".into()],
            evaluations: 7,
            seconds: 0.125,
        };
        let file = round_trip(&fit);
        assert_eq!((&file["status"], &file["parameters"][1]["at_bound"]), (&"broken-off".into(), &"upper".into()));
        assert!(file["parameters"][0]["value"].is_null() && file["cost"]["initial"].is_null() && file["cost"]["final"] == 0.5);
        assert_eq!(keys(&file["parameters"][0]), ["path", "standard_error", "unit", "value"]);
        let all = [
            "backend",
            "best",
            "correlation",
            "cost",
            "curves",
            "error",
            "evaluations",
            "fields",
            "format",
            "frames",
            "from_tracks",
            "independent_readings",
            "normals",
            "notes",
            "optimizer",
            "parameters",
            "reduced_chi_square",
            "residual",
            "residual_before",
            "runs",
            "scene",
            "scenes",
            "seconds",
            "status",
            "verdict",
            "version",
            "warnings",
        ];
        assert_eq!(keys(&file), all);
        assert_eq!(keys(&file["residual"]["scenes"][0]), ["noise", "points", "rms", "unmatched"]);
    }
}
