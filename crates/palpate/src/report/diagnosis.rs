//! What a diagnosis found, for its result file and in a few lines for the terminal.

use crate::diagnosing::Diagnosed;
use crate::results::diagnosis::{self as results, BeforeAfter, DiagnosisDocument, HeldOut, Nats, Noise, SeparatedBy, Values};
use crate::results::finite;
use crate::results::fit::Parameter;
use palpate_diagnose::{
    Diagnosis, Found, FoundNumber, Level, MapEntry, Model, Movement, Number, Place, Separated, Slack, SlackWindow, Strange,
    Tried, stated,
};
use palpate_engine::Stream;
use palpate_model::params::unit_behind;
use std::collections::BTreeMap;

/// Candidates that were not yet fitted which the terminal lists.
const LISTED: usize = 8;

fn level(l: &Level) -> results::Level {
    results::Level { rms: finite(l.rms), noise: finite(l.noise) }
}

/// Key of a number inside its effect: `effect.2.force.x` is `force.x`.
fn short(path: &str) -> &str {
    if path.starts_with("effect.") { path.splitn(3, '.').last().unwrap_or(path) } else { path }
}

fn effect(f: &Found) -> results::Effect {
    let by_key = |value: &dyn Fn(&FoundNumber) -> Option<f64>| -> BTreeMap<String, Option<f64>> {
        f.parameters.iter().map(|p| (short(&p.0).to_string(), value(p))).collect()
    };
    let told = f.separated_by.as_ref().filter(|s| !s.from.is_empty());
    results::Effect {
        kind: f.kind.clone(),
        sentence: f.sentence.clone(),
        parameters: by_key(&|p| finite(p.1)),
        standard_error: by_key(&|p| p.2.and_then(finite)),
        nats: finite(f.nats.0),
        nats_error: finite(f.nats.1),
        held_out_gain: finite(f.held_out_gain),
        accepted: f.accepted,
        indistinguishable_from: f.indistinguishable_from.clone(),
        separated_by: told.map(|s| SeparatedBy {
            measurement: s.measurement.clone(),
            difference: finite(s.difference),
            noise: finite(s.noise),
            from: s.from.clone(),
            not_from: s.not_from.clone(),
        }),
        separation: f.separated_by.as_ref().map(Separated::sentence),
    }
}

fn values(m: &Model) -> Vec<Parameter> {
    let one = |(k, n): (usize, &Number)| Parameter {
        path: n.path.clone(),
        value: finite(m.values[k]),
        standard_error: m.errors[k].and_then(finite),
        unit: n.unit.clone(),
        ..Parameter::default()
    };
    m.numbers.iter().enumerate().map(one).collect()
}

fn held_out(d: &Diagnosis) -> HeldOut {
    let (before, after, noise, data) = match &d.held_out {
        Some((b, a)) => (b.rms, a.rms, b.noise, "second recording"),
        None => (d.predicted.0, d.predicted.1, d.before.noise, "blocks of time left out"),
    };
    HeldOut { before: finite(before), after: finite(after), noise: finite(noise), data: data.into() }
}

fn place(p: &Place) -> results::Place {
    let time = [p.time.0, p.time.1];
    results::Place { scene: p.scene, time, region: p.region.clone(), share: finite(p.share), p_value: finite(p.p_value) }
}

fn tried(t: &Tried) -> results::Tried {
    results::Tried {
        round: t.round,
        kind: t.kind.clone(),
        promised: finite(t.promised),
        held_out_gain: t.held_out_gain.and_then(finite),
        status: match t {
            t if t.held_out_gain.is_some() => "fitted",
            t if t.open => "not yet fitted",
            _ => "not fitted",
        }
        .into(),
    }
}

fn movement(m: &Movement) -> results::Movement {
    results::Movement {
        candidate: m.candidate.clone(),
        fitted: m.fitted,
        path: m.path.clone(),
        unit: m.unit.clone(),
        before: finite(m.before),
        after: finite(m.after),
        factor: m.factor().and_then(finite),
        standard_errors: m.standard_errors().and_then(finite),
        sentence: m.sentence(),
    }
}

fn strange<'a>(model: &'a str, all: &'a [Strange]) -> impl Iterator<Item = results::Strange> + 'a {
    let one = move |s: &Strange| results::Strange {
        model: model.into(),
        path: s.path.clone(),
        deviations: finite(s.deviations),
        what: s.what.clone(),
    };
    all.iter().filter(|s| s.is_evidence()).map(one)
}

fn slack(s: &Slack) -> results::Slack {
    let window = |w: &SlackWindow| results::SlackWindow { time: w.time, values: w.values.iter().map(|v| finite(*v)).collect() };
    results::Slack { share: finite(s.share), direction: s.words(), windows: s.windows.iter().map(window).collect() }
}

fn map_entry(done: &Diagnosed, m: &MapEntry) -> results::MapEntry {
    results::MapEntry {
        scene: m.scene,
        sensor: stream(done, m.scene, m.stream),
        region: m.place.to_array(),
        time: [m.time.0, m.time.1],
        before: finite(m.before),
        after: finite(m.after),
    }
}

fn nats((nats, error): (f64, f64)) -> Nats {
    Nats { nats: finite(nats), error: finite(error) }
}

/// What `diagnosis.json` says of a diagnosis.
pub fn diagnosis_document(done: &Diagnosed) -> DiagnosisDocument {
    let d = &done.diagnosis;
    DiagnosisDocument {
        backend: done.backend.into(),
        verdict: d.verdict.name().into(),
        sentence: d.sentence(),
        missing: BeforeAfter { before: nats(d.missing), after: nats(d.missing_after) },
        baseline: level(&d.before),
        places: d.places.iter().map(place).collect(),
        effects: d.effects.iter().map(effect).collect(),
        after: level(&d.after),
        held_out: held_out(d),
        gap_closed: finite(d.gap_closed),
        parameters: Values { before: values(&d.baseline), after: values(&d.model) },
        noise: Noise { readings_over_stated: finite(d.noise_ratio), variance_of_means: finite(d.design_effect) },
        tried: d.tried.iter().map(tried).collect(),
        not_tried: d.not_tried.clone(),
        movements: d.movements.iter().map(movement).collect(),
        strange: strange("before", &d.strange.0).chain(strange("after", &d.strange.1)).collect(),
        slack: d.slack.as_ref().map(slack),
        map: d.map.iter().map(|m| map_entry(done, m)).collect(),
        caveats: d.caveats.clone(),
        something_remains: d.remains,
        interrupted: d.interrupted,
        error: done.broken.clone(),
        seconds: done.seconds,
    }
}

/// A fitted number with its standard error.
fn fitted(m: &Model, k: usize) -> String {
    stated(m.values[k], m.errors[k])
}

/// A few lines for the terminal: the answer, values before and after, what would decide between equals, and where everything is.
pub fn diagnosis_summary(done: &Diagnosed, folder: &std::path::Path) -> String {
    let d = &done.diagnosis;
    let mut text = format!("{}\n", d.sentence());
    let width = d.baseline.numbers.iter().map(|n| n.path.chars().count()).max().unwrap_or(0);
    for (k, n) in d.baseline.numbers.iter().enumerate() {
        let after = if d.model == d.baseline { String::new() } else { format!("  →  {}", fitted(&d.model, k)) };
        text += &format!("  {:width$}  {}{after}{}\n", n.path, fitted(&d.baseline, k), unit_behind(&n.unit));
    }
    for f in d.effects.iter().filter(|f| f.accepted) {
        if let Some(next) = &f.separated_by {
            text += &format!("  {}: {}\n", f.kind, next.sentence());
        }
    }
    // The first one is part of the answer.
    let told = d.sentence();
    for m in d.movements.iter().map(Movement::sentence).filter(|m| !told.contains(m.as_str())) {
        text += &format!("  {m}\n");
    }
    for t in d.not_yet_fitted().into_iter().take(LISTED) {
        text += &format!("  not yet fitted: {}, which promises {:.0} % of the squared residual\n", t.kind, 100.0 * t.promised);
    }
    let model = if done.experiments.len() == 1 { "model.toml" } else { "model-1.toml …" };
    let what = if d.model == d.baseline { "scene with these values" } else { "corrected scene" };
    text + &format!("  {what}: {}\n  report: {}", folder.join(model).display(), folder.join("report.html").display())
}

/// Name of a stream: a camera, or a coordinate of something else.
pub(super) fn stream(done: &Diagnosed, scene: usize, stream: Stream) -> String {
    let name = done.experiments[scene].plan().observation.name(stream.sensor);
    if stream.sensor.is_depth() { name } else { format!("{name}.{}", ["x", "y", "z"][usize::from(stream.axis)]) }
}
