//! What the models of the measured recordings lack, and what is known of that otherwise.

use super::report::Made;
use super::{open, studies};
use crate::rows;
use palpate::{DiagnoseOptions, Diagnosed, Error, Experiment, diagnose};
use palpate_diagnose::{FoundNumber, Verdict, in_words, stated};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;
use std::time::Duration;

/// Time for one diagnosis, of all processors together: what was not tried then is said.
const BUDGET: Duration = Duration::from_secs(36 * 60);

/// Most numbers of an effect that its row of the table says.
const FEW: usize = 4;

/// Changes of one scene's text.
type Changes = Vec<(String, String)>;

/// Recordings that are diagnosed together.
struct Case {
    name: &'static str,
    /// Scenes of `assets/scenes`, and what is replaced in each.
    scenes: Vec<(&'static str, Changes)>,
    /// What whoever made the recordings says is missing in the scenes, or what an earlier study found.
    known: &'static str,
}

fn beam(which: usize) -> (&'static str, Changes) {
    let beam = &studies::BEAMS[which];
    (beam.scene, beam.whole.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect())
}

/// The states at rest: their places on the recording's clock [s], and the load of each [kg].
pub(crate) const STATES: [(f64, f64); 6] =
    [(0.0, 0.0), (1.0, 0.0), (2.0, 0.052_02), (3.0, 0.052_02), (4.0, 0.102_03), (5.0, 0.102_03)];

/// The beam at rest in one of them.
pub(crate) fn at_rest((time, load): (f64, f64)) -> (&'static str, Changes) {
    let share = |part: f64| (format!("mass  = {:.6} #", 0.052 * part), format!("mass  = {:.9} #", load * part));
    let mut changes = vec![("start    = 2.0".into(), format!("start    = {time:?}"))];
    changes.push(("{ from = 2.0, to = 2.0 }".into(), format!("{{ from = {time:?}, to = {time:?} }}")));
    changes.extend([0.125, 0.25].map(share));
    ("beam-static", changes)
}

fn cases() -> Vec<Case> {
    let plain = |scene: &'static str| vec![(scene, Changes::new())];
    // The shortest first.
    vec![
        Case {
            name: "the beam at rest under 0, 52 and 102 g",
            scenes: STATES.into_iter().map(at_rest).collect(),
            known: "held shape straight to 1 mm; one load of 102 g hung 2 mm aside",
        },
        Case {
            name: "Ecoflex cantilever, bias taken off",
            scenes: plain("cantilever-ecoflex-hanging"),
            known: "the block guides the bar from 57 mm on",
        },
        Case {
            name: "Ecoflex cantilever, as recorded",
            scenes: plain("cantilever-ecoflex-hanging-raw"),
            known: "camera reads 23 ± 3 mm too far",
        },
        Case {
            name: "two materials, biases taken off",
            scenes: plain("cantilever-two-materials-hanging"),
            known: "one half 2 to 5 times as stiff; the block guides the bar from 63 mm on",
        },
        Case {
            name: "two materials, as recorded",
            scenes: plain("cantilever-two-materials-hanging-raw"),
            known: "camera reads one half 23 mm too far, the other 1 mm",
        },
        Case {
            name: "beam, own weight, 4 s",
            scenes: vec![beam(0)],
            known: "damping 0.051 of critical at 7.7 Hz; sinks on by 5 %",
        },
        Case {
            name: "beam with 52 g, 5 s",
            scenes: vec![beam(1)],
            known: "damping 0.058 of critical at 4.3 Hz; sinks on by 3 %",
        },
        Case {
            name: "both beams together",
            scenes: vec![beam(0), beam(1)],
            known: "nearly the same damping ratio at both frequencies; sink on",
        },
    ]
}

/// An effect of the answer.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Effect {
    /// Name.
    pub kind: String,
    /// Its numbers, with standard errors and units.
    pub numbers: Vec<FoundNumber>,
    /// How much better data left out are predicted with it, and the standard error of that [nats].
    pub nats: (f64, f64),
    /// What explains the recording as well.
    pub as_good: Vec<String>,
}

/// One diagnosis.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Answer {
    /// When and by what it was found.
    pub made: Made,
    /// The recordings.
    pub name: String,
    /// What is known of them.
    pub known: String,
    /// The verdict.
    pub verdict: String,
    /// What was added.
    pub effects: Vec<Effect>,
    /// What came closest, where nothing was added.
    pub closest: Vec<String>,
    /// E before and after, each with its standard error [Pa].
    pub youngs_modulus: [(f64, Option<f64>); 2],
    /// Distance of measurement and model before and after, and what noise and grid explain at the end [m].
    pub rms: [f64; 3],
    /// How much better the last model predicts beside a discrepancy than alone, and the standard error of that [nats].
    pub missing: (f64, f64),
    /// The sentence.
    pub sentence: String,
    /// Wall-clock time [s].
    pub seconds: f64,
}

fn answer(case: &Case, made: &Made, d: &Diagnosed) -> Answer {
    let found = &d.diagnosis;
    let effect = |f: &palpate_diagnose::Found| Effect {
        kind: f.kind.clone(),
        numbers: f.parameters.clone(),
        nats: f.nats,
        as_good: f.indistinguishable_from.clone(),
    };
    let modulus = |m: &palpate_diagnose::Model| {
        let at = m.numbers.iter().position(|n| n.path == "material.youngs_modulus");
        at.map_or((f64::NAN, None), |k| (m.values[k], m.errors.get(k).copied().flatten()))
    };
    Answer {
        made: made.clone(),
        name: case.name.into(),
        known: case.known.into(),
        verdict: found.verdict.name().into(),
        effects: found.effects.iter().filter(|f| f.accepted).map(effect).collect(),
        closest: found.effects.iter().filter(|f| !f.accepted).map(|f| f.kind.clone()).collect(),
        youngs_modulus: [modulus(&found.baseline), modulus(&found.model)],
        rms: [found.before.rms, found.after.rms, found.after.noise],
        missing: found.missing_after,
        sentence: found.sentence(),
        seconds: d.seconds,
    }
}

/// Diagnoses those that no row of this very commit answers yet, and hands every answer on as soon as it is there: all of them take an hour.
///
/// # Errors
/// A scene or its recording cannot be read, or its baseline cannot be computed.
pub fn measure(
    data: &Path,
    made: &Made,
    stored: &mut Vec<Answer>,
    keep: &mut dyn FnMut(&[Answer]) -> Result<(), Error>,
) -> Result<(), Error> {
    for case in cases() {
        if stored.iter().any(|a| a.name == case.name && a.made.is_same(made)) {
            continue;
        }
        let experiments = case
            .scenes
            .iter()
            .map(|(scene, changes)| {
                let changes: Vec<(&str, &str)> = changes.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
                open(data, scene, &changes)
            })
            .collect::<Result<Vec<Experiment>, Error>>()?;
        let mut say = |what: &str| eprintln!("{}: {what}", case.name);
        let options = DiagnoseOptions {
            budget: Some(BUDGET),
            clock: rows::processor_clock(),
            on_progress: Some(&mut say),
            ..DiagnoseOptions::default()
        };
        let found = answer(&case, made, &diagnose(&experiments, None, options)?);
        println!("{}: {} ({:.0} s)", case.name, found.sentence, found.seconds);
        stored.retain(|a| a.name != case.name);
        stored.push(found);
        let order = |a: &Answer| cases().iter().position(|c| c.name == a.name);
        stored.retain(|a| order(a).is_some());
        stored.sort_by_key(order);
        keep(stored)?;
    }
    Ok(())
}

/// The table as docs/real-data.md has it.
pub fn markdown(all: &[Answer]) -> String {
    let mut out = String::from(
        "| recordings | known of them | said | nats | E before → after | distance before → after (noise and grid) | still missing |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for a in all {
        let said = match a.effects.as_slice() {
            [] if a.closest.is_empty() => a.verdict.clone(),
            [] => format!("{}; nearest: {}", a.verdict, once_each(&a.closest).join(", ")),
            effects => {
                let all = effects.iter().map(words).collect::<Vec<_>>().join("; ");
                // Beside which nothing is missing; otherwise they are the nearest that is known.
                if a.verdict == Verdict::MissingEffect.name() { all } else { format!("{}; nearest: {all}", a.verdict) }
            }
        };
        let nats = a.effects.iter().map(|e| format!("{:.0} ± {:.0}", e.nats.0, e.nats.1)).collect::<Vec<_>>().join("; ");
        let modulus = a.youngs_modulus.map(|(v, se)| stated(1e-3 * v, se.map(|e| 1e-3 * e)));
        let [before, after, noise] = a.rms.map(|x| 1e3 * x);
        let missing = if a.missing.0 > 0.0 { format!("{:.0} ± {:.0} nats", a.missing.0, a.missing.1) } else { "no".into() };
        let _ = writeln!(
            out,
            "| {} | {} | {said} | {} | {} → {} kPa | {before:.2} → {after:.2} ({noise:.2}) mm | {missing} |",
            a.name,
            a.known,
            if nats.is_empty() { "–" } else { &nats },
            modulus[0],
            modulus[1],
        );
    }
    out
}

/// Names in their order: the same number of two scenes is two candidates of one name.
fn once_each(names: &[String]) -> Vec<&str> {
    let mut seen = BTreeSet::new();
    names.iter().map(String::as_str).filter(|n| seen.insert(*n)).collect()
}

fn words(e: &Effect) -> String {
    let as_good = if e.as_good.is_empty() { String::new() } else { format!(" (as good: {})", e.as_good.join(", ")) };
    // Free-form effects have a dozen numbers, which bench/real.json holds.
    let numbers = if e.numbers.len() <= FEW { format!(": {}", in_words(&e.numbers)) } else { String::new() };
    format!("{}{numbers}{as_good}", e.kind)
}
