//! What a method says about a case: the one form that every method's answer takes, palpate's, the baselines' and others' read from a file.

use palpate::Diagnosed;
use palpate_diagnose::MapEntry;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};

/// False-discovery rate of blocks (Benjamini & Hochberg, *J. R. Stat. Soc. B* 57, 1995).
const RATE: f64 = 0.01;

/// A number of what is named: the end of its path in the effect's table, or a path of the scene.
pub type Stated = (String, f64);

/// Something that is named.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Named {
    /// Name of the effect, or of the group of numbers.
    pub kind: String,
    /// Its numbers.
    #[serde(default)]
    pub numbers: Vec<Stated>,
}

/// A region of the body during a stretch of time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Block {
    /// Its middle on the rest shape [m].
    pub place: [f64; 3],
    /// First and last time [s].
    pub time: [f64; 2],
    /// True where the model lacks something there.
    pub missing: bool,
}

/// An answer.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// Name of the case.
    pub case: String,
    /// adequate, missing-effect, unexplained or undecided.
    pub verdict: String,
    /// What the model lacks, in the order found.
    #[serde(default)]
    pub named: Vec<Named>,
    /// Names in the order of belief, those of `named` first.
    #[serde(default)]
    pub ranking: Vec<String>,
    /// Names that cannot be told from the first one.
    #[serde(default)]
    pub as_good: Vec<String>,
    /// Every block that was looked at.
    #[serde(default)]
    pub map: Vec<Block>,
    /// Young's modulus of the model as it is given, fitted, and of the answer's [Pa].
    #[serde(default)]
    pub modulus: [Option<f64>; 2],
    /// The free numbers of the answer's model: path and value.
    #[serde(default)]
    pub parameters: Vec<Stated>,
    /// Direction in which a load that nobody knows pulls, where the method says one.
    #[serde(default)]
    pub pull: Option<[f64; 3]>,
    /// Distance of measurement and model before and after, and what noise and discretisation explain [m].
    #[serde(default)]
    pub distance: Option<[f64; 3]>,
    /// Share of the gap closed on data left out.
    #[serde(default)]
    pub gap_closed: Option<f64>,
    /// How much better data left out are predicted beside a discrepancy, of the model as it is given and of the answer's [nats].
    #[serde(default)]
    pub missing: Option<[f64; 2]>,
    /// Wall-clock time [s].
    #[serde(default)]
    pub seconds: f64,
    /// In words, or why there is no answer.
    #[serde(default)]
    pub sentence: String,
}

/// The end of a path: `effect.0.coefficient` is `coefficient`.
fn end(path: &str) -> String {
    match path.strip_prefix("effect.").and_then(|p| p.split_once('.')) {
        Some((_, end)) => end.into(),
        None => path.into(),
    }
}

impl Answer {
    /// No answer, for this reason.
    pub fn failed(case: &str, why: String) -> Answer {
        Answer { case: case.into(), verdict: "failed".into(), sentence: why, ..Answer::default() }
    }

    /// Palpate's own: the only place that reads its diagnosis.
    pub fn of(case: &str, found: &Diagnosed) -> Answer {
        let d = &found.diagnosis;
        let (accepted, close): (Vec<_>, Vec<_>) = d.effects.iter().partition(|e| e.accepted);
        let named = accepted
            .iter()
            .map(|e| Named { kind: e.kind.clone(), numbers: e.parameters.iter().map(|p| (end(&p.0), p.1)).collect() });
        let as_good = accepted.first().map(|e| e.indistinguishable_from.clone()).unwrap_or_default();
        let mut ranking: Vec<String> = Vec::new();
        let all = accepted.iter().map(|e| &e.kind).chain(&as_good).chain(close.iter().map(|e| &e.kind));
        for kind in all.chain(d.tried.iter().map(|t| &t.kind)) {
            if !ranking.contains(kind) {
                ranking.push(kind.clone());
            }
        }
        let modulus = |numbers: &[palpate_diagnose::Number], values: &[f64]| {
            let all = numbers.iter().zip(values);
            all.filter(|(n, _)| n.path == "material.youngs_modulus").map(|(_, v)| *v).next()
        };
        let pull = d.slack.as_ref().map(|s| s.windows.iter().map(|w| w.force()).sum::<glam::DVec3>().to_array());
        Answer {
            case: case.into(),
            verdict: d.verdict.name().into(),
            named: named.collect(),
            ranking,
            as_good,
            map: blocks(&d.map, d.verdict != palpate_diagnose::Verdict::Adequate),
            modulus: [modulus(&d.baseline.numbers, &d.baseline.values), modulus(&d.model.numbers, &d.model.values)],
            parameters: d.model.numbers.iter().zip(&d.model.values).map(|(n, v)| (n.path.clone(), *v)).collect(),
            pull,
            distance: Some([d.before.rms, d.after.rms, d.after.noise]),
            gap_closed: Some(d.gap_closed),
            missing: Some([d.missing.0, d.missing_after.0]),
            seconds: found.seconds,
            sentence: d.sentence(),
        }
    }
}

/// Blocks of the fitted recording; those that stand out of the null by the false-discovery rate are missing something, if anything does.
fn blocks(map: &[MapEntry], any: bool) -> Vec<Block> {
    let normal = Normal::standard();
    let map: Vec<&MapEntry> = map.iter().filter(|m| m.scene == 0).collect();
    let p: Vec<f64> = map.iter().map(|m| 2.0 * normal.sf(m.before.abs())).collect();
    let mut sorted = p.clone();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len() as f64;
    let passes = |(k, p): &(usize, &f64)| **p <= RATE * (*k + 1) as f64 / n;
    let least = sorted.iter().enumerate().filter(passes).map(|(_, p)| *p).next_back();
    let block = |(m, p): (&&MapEntry, &f64)| Block {
        place: m.place.to_array(),
        time: [m.time.0, m.time.1],
        missing: any && least.is_some_and(|l| *p <= l),
    };
    map.iter().zip(&p).map(block).collect()
}
