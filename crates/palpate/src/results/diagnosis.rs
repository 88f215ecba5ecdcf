//! `diagnosis.json` of a diagnosis.

use super::Document;
use super::fit::Parameter;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a model lacks (`diagnosis/2`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DiagnosisDocument {
    /// What computed: `cpu` or `gpu`.
    pub backend: String,
    /// `adequate`, `missing-effect`, `unexplained` or `undecided`.
    pub verdict: String,
    /// The answer in sentences.
    pub sentence: String,
    /// How much better models predict what was left out beside a discrepancy than alone: positive where something is missing.
    pub missing: BeforeAfter,
    /// How far the baseline is from the measurement.
    pub baseline: Level,
    /// Where the baseline fails.
    #[serde(rename = "where")]
    pub places: Vec<Place>,
    /// Effects that were accepted, then those that came closest.
    pub effects: Vec<Effect>,
    /// How far the corrected model is from the measurement.
    pub after: Level,
    /// Distances on data that were left out.
    pub held_out: HeldOut,
    /// Share of the gap that is closed.
    pub gap_closed: Option<f64>,
    /// Values of the free numbers before and after.
    pub parameters: Values,
    /// What the noise was found to be.
    pub noise: Noise,
    /// Every candidate's score.
    pub tried: Vec<Tried>,
    /// Candidates that there was no time for, each with the reason.
    pub not_tried: Vec<String>,
    /// What candidates do to the free numbers.
    pub movements: Vec<Movement>,
    /// Numbers that leave the known world or end at a bound.
    pub strange: Vec<Strange>,
    /// What any load could explain of what the corrected model leaves; only where the verdict is unexplained.
    pub slack: Option<Slack>,
    /// Residual map, block by block.
    pub map: Vec<MapEntry>,
    /// What else must be known, in sentences.
    pub caveats: Vec<String>,
    /// True when what is left still has structure that counts.
    pub something_remains: bool,
    /// True when it was stopped before its end.
    pub interrupted: bool,
    /// Why the device failed, if it did.
    pub error: Option<String>,
    /// Wall-clock time [s].
    pub seconds: f64,
}

impl Document for DiagnosisDocument {
    const FORMAT: &'static str = "diagnosis/2";
}

/// Of two models.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BeforeAfter {
    /// Of the baseline.
    pub before: Nats,
    /// Of the corrected model.
    pub after: Nats,
}

/// A difference of log densities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Nats {
    /// The difference [nats].
    pub nats: Option<f64>,
    /// Its standard error [nats].
    pub error: Option<f64>,
}

/// How far measurement and model are apart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Level {
    /// Root mean square distance of single points [m].
    pub rms: Option<f64>,
    /// What noise and discretisation alone would leave [m].
    pub noise: Option<f64>,
}

/// A stretch of time and a region in which the baseline fails.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// Scene, from 0.
    pub scene: usize,
    /// From when to when [s].
    pub time: [f64; 2],
    /// Where on the body, in words.
    pub region: String,
    /// Share of the squared residual.
    pub share: Option<f64>,
    /// Probability of so much by chance.
    pub p_value: Option<f64>,
}

/// An effect that was fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Effect {
    /// Name of the effect, or of what was freed.
    pub kind: String,
    /// What it means.
    pub sentence: String,
    /// Its numbers by key (`force.x`), in their SI units.
    pub parameters: BTreeMap<String, Option<f64>>,
    /// Their standard errors.
    pub standard_error: BTreeMap<String, Option<f64>>,
    /// How much better the model predicted with it than before [nats], its price paid.
    pub nats: Option<f64>,
    /// Standard error of that [nats].
    pub nats_error: Option<f64>,
    /// Share of the gap that it closed on data left out.
    pub held_out_gain: Option<f64>,
    /// True when it is part of the corrected model.
    pub accepted: bool,
    /// Other candidates that predict data left out as well.
    pub indistinguishable_from: Vec<String>,
    /// The measurement that tells it from the most of them; `None` where none does.
    pub separated_by: Option<SeparatedBy>,
    /// The same in a sentence, which also says where none does.
    pub separation: Option<String>,
}

/// A measurement that tells an effect from others.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeparatedBy {
    /// What would be done.
    pub measurement: String,
    /// Smallest difference that its readings and the known ones leave of a rival fitted to both [m], root mean square.
    pub difference: Option<f64>,
    /// Noise of a single reading [m].
    pub noise: Option<f64>,
    /// What it tells the effect from.
    pub from: Vec<String>,
    /// What it does not tell it from.
    pub not_from: Vec<String>,
}

/// Distances on data that were left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// Of the baseline [m], root mean square.
    pub before: Option<f64>,
    /// Of the corrected model [m].
    pub after: Option<f64>,
    /// What noise and discretisation explain [m].
    pub noise: Option<f64>,
    /// Which data: `second recording` or `blocks of time left out`.
    pub data: String,
}

/// Values of the free numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Values {
    /// Of the baseline.
    pub before: Vec<Parameter>,
    /// Of the corrected model; those of its effects come last.
    pub after: Vec<Parameter>,
}

/// What the noise was found to be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Noise {
    /// Noise of single readings over the stated one.
    pub readings_over_stated: Option<f64>,
    /// Factor by which correlation between readings raises the variance of means.
    pub variance_of_means: Option<f64>,
}

/// A candidate's score.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tried {
    /// Round of the search, from 1.
    pub round: usize,
    /// Its name.
    pub kind: String,
    /// Share of the squared residual that it promised.
    pub promised: Option<f64>,
    /// Share of the gap that it closed on data left out; `None` when it was not fitted.
    pub held_out_gain: Option<f64>,
    /// `fitted`, `not fitted` (it promised too little), or `not yet fitted` (the search ended before).
    pub status: String,
}

/// What a candidate does to the free number that it moves most.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Movement {
    /// The candidate, with those that were added before it.
    pub candidate: String,
    /// True where a fit says so; false where sensitivities do, as a linear estimate.
    pub fitted: bool,
    /// Path of the number in the scene file.
    pub path: String,
    /// Its SI unit.
    pub unit: String,
    /// Its value in the baseline.
    pub before: Option<f64>,
    /// Its value beside the candidate.
    pub after: Option<f64>,
    /// The second over the first; `None` where the number has no size.
    pub factor: Option<f64>,
    /// By how many standard errors it moves, of whichever value is known worse; `None` where no error is known.
    pub standard_errors: Option<f64>,
    /// The same in words.
    pub sentence: String,
}

/// A number that leaves the known world or ends at a bound.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Strange {
    /// Whose number: that of the model `before` or `after`.
    pub model: String,
    /// Its path in the scene file.
    pub path: String,
    /// By how many standard deviations it counts.
    pub deviations: Option<f64>,
    /// What is strange about it.
    pub what: String,
}

/// What any load could explain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Slack {
    /// Share of the squared residual beyond noise.
    pub share: Option<f64>,
    /// What the force at the body's centre does, in words.
    pub direction: String,
    /// The force field, stretch by stretch.
    pub windows: Vec<SlackWindow>,
}

/// The free force field during one stretch of time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SlackWindow {
    /// Its middle [s].
    pub time: f64,
    /// Numbers of the slack effect in the order of its parameters, the force per volume at the centre [N/m³] first.
    pub values: Vec<Option<f64>>,
}

/// One block of the residual map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapEntry {
    /// Scene, from 0.
    pub scene: usize,
    /// A camera, or a coordinate of a marker.
    pub sensor: String,
    /// Middle of the region on the rest shape [m].
    pub region: [f64; 3],
    /// First and last frame's time [s].
    pub time: [f64; 2],
    /// Residual of the baseline in standard deviations of what noise and grid leave.
    pub before: Option<f64>,
    /// The same of the corrected model.
    pub after: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, round_trip};
    use super::*;

    #[test]
    fn a_diagnosis_is_what_it_was_when_it_is_read_again() {
        let level = Level { rms: Some(2e-3), noise: None };
        let values: BTreeMap<String, Option<f64>> = [("force.x".to_string(), Some(-0.1)), ("force.y".to_string(), None)].into();
        let parameter =
            Parameter { path: "material.density".into(), value: Some(1e3), unit: "kg/m³".into(), ..Parameter::default() };
        let diagnosis = DiagnosisDocument {
            backend: "cpu".into(),
            verdict: "unexplained".into(),
            sentence: "Something is missing.".into(),
            missing: BeforeAfter {
                before: Nats { nats: Some(41.0), error: Some(3.0) },
                after: Nats { nats: None, error: Some(0.1) },
            },
            baseline: level.clone(),
            places: vec![Place { scene: 0, time: [0.1, 0.2], region: "top".into(), share: Some(0.3), p_value: Some(0.01) }],
            effects: vec![Effect {
                kind: "uniform-force".into(),
                sentence: "a force acts on all of it".into(),
                parameters: values.clone(),
                standard_error: values,
                nats: Some(35.0),
                nats_error: Some(6.0),
                held_out_gain: Some(0.97),
                accepted: true,
                indistinguishable_from: vec!["density".into()],
                separated_by: Some(SeparatedBy {
                    measurement: "a drop".into(),
                    difference: Some(4e-3),
                    noise: Some(1e-3),
                    from: vec!["density".into()],
                    not_from: Vec::new(),
                }),
                separation: Some("Next: a drop.".into()),
            }],
            after: level,
            held_out: HeldOut { before: Some(2e-3), after: Some(1e-3), noise: None, data: "second recording".into() },
            gap_closed: Some(0.97),
            parameters: Values { before: vec![parameter.clone()], after: vec![parameter] },
            noise: Noise { readings_over_stated: Some(1.1), variance_of_means: Some(3.0) },
            tried: vec![Tried {
                round: 1,
                kind: "adhesion".into(),
                promised: Some(0.1),
                held_out_gain: None,
                status: "not yet fitted".into(),
            }],
            not_tried: vec!["creep: no time".into()],
            movements: vec![Movement {
                candidate: "uniform-force".into(),
                fitted: true,
                path: "material.density".into(),
                unit: "kg/m³".into(),
                before: Some(1e3),
                after: Some(2e3),
                factor: Some(2.0),
                standard_errors: None,
                sentence: "With uniform-force it is twice as dense.".into(),
            }],
            strange: vec![Strange {
                model: "before".into(),
                path: "world.gravity".into(),
                deviations: Some(50.0),
                what: "gravity of 14.9 m/s²".into(),
            }],
            slack: Some(Slack {
                share: Some(0.6),
                direction: "pulls towards +x".into(),
                windows: vec![SlackWindow { time: 0.1, values: vec![Some(900.0), None] }],
            }),
            map: vec![MapEntry {
                scene: 0,
                sensor: "left".into(),
                region: [0.0, 0.1, -0.2],
                time: [0.0, 0.1],
                before: Some(7.0),
                after: None,
            }],
            caveats: vec!["Mind the noise.".into()],
            something_remains: true,
            interrupted: false,
            error: None,
            seconds: 3.5,
        };
        let file = round_trip(&diagnosis);
        assert!(file["where"].is_array() && file["error"].is_null() && file["missing"]["after"]["nats"].is_null());
        assert_eq!(keys(&file["parameters"]["after"][0]), ["path", "standard_error", "unit", "value"]);
        assert_eq!(keys(&file).len(), 24);
    }
}
