//! What a diagnosis leaves behind: `diagnosis.json` (`diagnosis/1`), its report, and a few lines for the terminal.

use super::html::{STYLE, base64, escape};
use super::pictures::FramePicture;
use super::plots::{Curve, curves};
use super::result::number;
use crate::diagnosing::Diagnosed;
use crate::residuals::ResidualSummary;
use palpate_diagnose::{Found, FoundNumber, Level, MapEntry, Model, Separated, Verdict, direction, millimetres, stated};
use palpate_model::params::unit_behind;
use serde_json::{Map, Value, json};
use std::fmt::Write;

fn finite(x: f64) -> Value {
    if x.is_finite() { json!(x) } else { Value::Null }
}

fn level(l: &Level) -> Value {
    json!({ "rms": finite(l.rms), "noise": finite(l.noise) })
}

/// Key of a number inside its effect: `effect.2.force.x` is `force.x`.
fn short(path: &str) -> &str {
    if path.starts_with("effect.") { path.splitn(3, '.').last().unwrap_or(path) } else { path }
}

fn effect(f: &Found) -> Value {
    let map = |value: &dyn Fn(&FoundNumber) -> Value| -> Value {
        Value::Object(f.parameters.iter().map(|p| (short(&p.0).to_string(), value(p))).collect::<Map<_, _>>())
    };
    json!({
        "kind": f.kind,
        "sentence": f.sentence,
        "parameters": map(&|p| finite(p.1)),
        "standard_error": map(&|p| p.2.map_or(Value::Null, finite)),
        "p_value": f.p_value,
        "held_out_gain": finite(f.held_out_gain),
        "accepted": f.accepted,
        "indistinguishable_from": f.indistinguishable_from,
        "separated_by": f.separated_by.as_ref().filter(|s| !s.from.is_empty()).map(|s| json!({
            "measurement": s.measurement, "difference": finite(s.difference), "noise": finite(s.noise),
            "from": s.from, "not_from": s.not_from,
        })),
        "separation": f.separated_by.as_ref().map(Separated::sentence),
    })
}

/// `diagnosis.json`. Beyond the format's keys it holds what was tried, the baseline's and the corrected model's values, the noise found,
/// the residual map, and the slack force where nothing explains the residual.
pub fn diagnosis_json(done: &Diagnosed) -> Value {
    let d = &done.diagnosis;
    let values = |m: &palpate_diagnose::Model| -> Value {
        let one = |(k, n): (usize, &palpate_diagnose::Number)| json!({ "path": n.path, "value": finite(m.values[k]), "standard_error": m.errors[k].map_or(Value::Null, finite), "unit": n.unit });
        m.numbers.iter().enumerate().map(one).collect()
    };
    let held_out = match &d.held_out {
        Some((b, a)) => {
            json!({ "before": finite(b.rms), "after": finite(a.rms), "noise": finite(b.noise), "data": "second recording" })
        }
        None => json!({ "before": finite(d.predicted.0), "after": finite(d.predicted.1), "noise": finite(d.before.noise),
                        "data": "blocks of time left out" }),
    };
    json!({
        "format": "diagnosis/1",
        "backend": done.backend,
        "verdict": d.verdict.name(),
        "sentence": d.sentence(),
        "p_value": d.p_value,
        "p_value_after": d.p_value_after,
        "structure": { "before": finite(d.structure.0), "after": finite(d.structure.1) },
        "baseline": level(&d.before),
        "where": d.places.iter().map(|p| json!({
            "scene": p.scene, "time": [p.time.0, p.time.1], "region": p.region, "share": finite(p.share), "p_value": p.p_value,
        })).collect::<Vec<_>>(),
        "effects": d.effects.iter().map(effect).collect::<Vec<_>>(),
        "after": level(&d.after),
        "held_out": held_out,
        "gap_closed": finite(d.gap_closed),
        "parameters": { "before": values(&d.baseline), "after": values(&d.model) },
        "noise": { "readings_over_stated": finite(d.noise_ratio), "variance_of_means": finite(d.design_effect) },
        "tried": d.tried.iter().map(|t| json!({
            "round": t.round, "kind": t.kind, "promised": finite(t.promised), "p_value": finite(t.p_value),
            "held_out_gain": t.held_out_gain.map_or(Value::Null, finite),
        })).collect::<Vec<_>>(),
        "not_tried": d.not_tried,
        "slack": d.slack.as_ref().map(|s| json!({
            "share": finite(s.share), "direction": s.words(),
            "windows": s.windows.iter().map(|w| json!({ "time": w.time, "values": w.values })).collect::<Vec<_>>(),
        })),
        "map": d.map.iter().map(|m| json!({
            "scene": m.scene, "sensor": sensor(done, m.scene, m.sensor), "region": m.place.to_array(), "time": [m.time.0, m.time.1], "before": finite(m.before), "after": finite(m.after),
        })).collect::<Vec<_>>(),
        "caveats": d.caveats,
        "something_remains": d.remains,
        "interrupted": d.interrupted,
        "error": done.broken,
        "seconds": done.seconds,
    })
}

/// What a report of a diagnosis is made of, scene by scene.
pub struct DiagnosisInput<'a> {
    /// The diagnosis.
    pub done: &'a Diagnosed,
    /// Residuals before and after.
    pub residuals: Vec<(ResidualSummary, ResidualSummary)>,
    /// Pictures before and after.
    pub pictures: Vec<(Vec<FramePicture>, Vec<FramePicture>)>,
    /// The command that reproduces it.
    pub command: String,
}

/// The whole page.
pub fn diagnosis_html(input: &DiagnosisInput) -> String {
    let mut page = String::new();
    // Writing to a string cannot fail.
    let _ = write_page(&mut page, input);
    page
}

fn write_page(p: &mut String, input: &DiagnosisInput) -> std::fmt::Result {
    let d = &input.done.diagnosis;
    let title = match d.verdict {
        Verdict::Adequate => "Diagnosis: nothing is missing",
        Verdict::MissingEffect => "Diagnosis: an effect is missing",
        Verdict::Unexplained => "Diagnosis: something is missing that no known effect explains",
        Verdict::Undecided if d.unsure => "Diagnosis: interrupted before anything was known",
        Verdict::Undecided => "Diagnosis: something is missing, and the search is not finished",
    };
    writeln!(
        p,
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title><style>{STYLE}</style></head><body>\
         <h1>{title}</h1><p>{}</p>",
        escape(&d.sentence())
    )?;
    if let Some(why) = &input.done.broken {
        writeln!(p, "<p class=\"w\">The search was broken off ({}); this is what was known until then.</p>", escape(why))?;
    } else if d.interrupted {
        writeln!(p, "<p class=\"w\">The diagnosis was interrupted; this is what was known until then.</p>")?;
    }
    writeln!(
        p,
        "<h2>Before and after</h2><p>Distances, root mean square, and what noise and grid explain of them.</p><table><tr><th>data\
         <th class=\"n\">before<th class=\"n\">explained<th class=\"n\">ratio<th class=\"n\">after<th class=\"n\">explained<th class=\"n\">ratio\
         </tr>"
    )?;
    let mut row = |name: &str, b: Level, a: Level| {
        write!(p, "<tr><td>{name}")?;
        for l in [b, a] {
            write!(
                p,
                "<td class=\"n\">{}<td class=\"n\">{}<td class=\"n\">{:.2}",
                millimetres(l.rms),
                millimetres(l.noise),
                l.rms / l.noise
            )?;
        }
        writeln!(p, "</tr>")
    };
    row("fitted", d.before, d.after)?;
    let left_out = |rms: f64| Level { rms, noise: d.before.noise };
    row("blocks of time left out", left_out(d.predicted.0), left_out(d.predicted.1))?;
    if let Some((b, a)) = d.held_out {
        row("second recording", b, a)?;
    }
    writeln!(p, "</table>")?;
    effects(p, input)?;
    values(p, input)?;
    if !d.places.is_empty() {
        writeln!(
            p,
            "<h2>Where the baseline fails</h2><table><tr><th>time<th>where<th class=\"n\">share<th class=\"n\">p-value</tr>"
        )?;
        for w in &d.places {
            writeln!(
                p,
                "<tr><td>{:.3} to {:.3} s<td>{}<td class=\"n\">{:.0} %<td class=\"n\">{:.1e}</tr>",
                w.time.0,
                w.time.1,
                escape(&w.region),
                100.0 * w.share,
                w.p_value
            )?;
        }
        writeln!(p, "</table>")?;
    }
    map(p, input.done)?;
    for (s, (before, after)) in input.residuals.iter().enumerate() {
        let curve = |label: &str, r: &ResidualSummary| Curve {
            label: label.into(),
            points: r.frames.iter().map(|f| (f.time, f.rms * 1e3)).collect(),
        };
        if let Some(svg) = curves(&[curve("after", after), curve("before", before)], "time [s]", "rms distance [mm]", false) {
            writeln!(p, "<h2>Residual over time, scene {}</h2>{svg}", s + 1)?;
        }
        let Some((before, after)) = input.pictures.get(s) else { continue };
        for (b, a) in before.iter().zip(after) {
            writeln!(p, "<figure class=\"pair\">")?;
            for x in [b, a] {
                writeln!(p, "<img alt=\"\" src=\"data:image/png;base64,{}\">", base64(&x.picture.png()))?;
            }
            writeln!(p, "<figcaption>t = {:.4} s, before and after</figcaption></figure>", a.time)?;
        }
    }
    if let Some(slack) = &d.slack {
        writeln!(
            p,
            "<h2>What any load could explain</h2><p>A free force field, affine over the body and smooth in time, would explain {:.0} % of \
             what is left; at the body's centre it {}. Its force per volume there:</p><table><tr><th>time<th class=\"n\">x [N/m³]\
             <th class=\"n\">y<th class=\"n\">z<th>towards</tr>",
            100.0 * slack.share,
            slack.words()
        )?;
        for w in slack.windows.iter().filter(|w| w.values.len() >= 3) {
            let [x, y, z] = [0, 1, 2].map(|a| number(w.values[a]));
            let towards = direction(w.force());
            writeln!(p, "<tr><td>{:.3} s<td class=\"n\">{x}<td class=\"n\">{y}<td class=\"n\">{z}<td>{towards}</tr>", w.time)?;
        }
        writeln!(p, "</table>")?;
    }
    tried(p, input)?;
    writeln!(
        p,
        "<h2>Reproduce</h2><pre>{}</pre><p>palpate {}, backend {}, {:.1} s.</p></body></html>",
        escape(&input.command),
        env!("CARGO_PKG_VERSION"),
        input.done.backend,
        input.done.seconds
    )
}

fn effects(p: &mut String, input: &DiagnosisInput) -> std::fmt::Result {
    for f in &input.done.diagnosis.effects {
        let mark = if f.accepted { "added" } else { "not accepted" };
        writeln!(p, "<h2>{} ({mark})</h2><p>{}.", escape(&f.kind), escape(&f.sentence))?;
        writeln!(p, " Closes {:.0} % of the gap on data left out; p = {:.1e}.", 100.0 * f.held_out_gain, f.p_value)?;
        if !f.indistinguishable_from.is_empty() {
            writeln!(p, " These data cannot tell it from <b>{}</b>.", escape(&f.indistinguishable_from.join(", ")))?;
        }
        if let Some(s) = &f.separated_by {
            writeln!(p, " {}", escape(&s.sentence()))?;
        }
        writeln!(p, "</p><table>")?;
        for (path, value, error, unit) in &f.parameters {
            let unit = if unit == "1" { "" } else { unit };
            writeln!(p, "<tr><td><code>{}</code><td class=\"n\">{}<td>{unit}</tr>", escape(path), stated(*value, *error))?;
        }
        writeln!(p, "</table>")?;
    }
    Ok(())
}

/// A fitted number with its standard error.
fn fitted(m: &Model, k: usize) -> String {
    stated(m.values[k], m.errors[k])
}

fn values(p: &mut String, input: &DiagnosisInput) -> std::fmt::Result {
    let d = &input.done.diagnosis;
    let same = d.model == d.baseline;
    if d.baseline.numbers.is_empty() {
        return Ok(());
    }
    if same {
        writeln!(p, "<h2>Fitted values</h2><table><tr><th>number<th class=\"n\">value<th>unit</tr>")?;
    } else {
        writeln!(
            p,
            "<h2>Fitted values before and after</h2><p>A missing effect pulls the other values along.</p><table><tr><th>number\
             <th class=\"n\">before<th class=\"n\">after<th>unit</tr>"
        )?;
    }
    for (k, n) in d.baseline.numbers.iter().enumerate() {
        let after = if same { String::new() } else { format!("<td class=\"n\">{}", fitted(&d.model, k)) };
        let unit = if n.unit == "1" { "" } else { &n.unit };
        writeln!(p, "<tr><td><code>{}</code><td class=\"n\">{}{after}<td>{unit}</tr>", escape(&n.path), fitted(&d.baseline, k))?;
    }
    writeln!(p, "</table>")
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
    let model = if done.experiments.len() == 1 { "model.toml" } else { "model-1.toml …" };
    let what = if d.model == d.baseline { "scene with these values" } else { "corrected scene" };
    text + &format!("  {what}: {}\n  report: {}", folder.join(model).display(), folder.join("report.html").display())
}

/// Name of a sensor: a camera, or a coordinate of a marker.
fn sensor(done: &Diagnosed, scene: usize, sensor: u32) -> String {
    let recording = done.experiments[scene].recording();
    let markers = &done.experiments[scene].plan().observation.markers;
    match sensor.checked_sub(1000) {
        None => recording.and_then(|r| r.cameras.get(sensor as usize)).map_or("camera".into(), |c| c.name.clone()),
        Some(m) => {
            let name = markers.get(m as usize / 3).map_or("marker", |s| s.name.as_str());
            format!("{name}.{}", ["x", "y", "z"][m as usize % 3])
        }
    }
}

/// What each sensor saw of each region of the rest surface against time: blue where the measurement lies inside the model, red outside, full
/// colour at six standard deviations.
fn map(p: &mut String, done: &Diagnosed) -> std::fmt::Result {
    let entries = &done.diagnosis.map;
    if entries.is_empty() {
        return Ok(());
    }
    let colour = |z: f64| {
        let s = (z.abs() / 6.0).min(1.0);
        let (r, b) = if z > 0.0 { (178, 43) } else { (33, 172) };
        format!("rgba({r},60,{b},{s:.2})")
    };
    let key = |e: &MapEntry| (e.scene, e.sensor, e.region);
    let mut rows: Vec<_> = entries.iter().map(key).collect();
    rows.sort_unstable();
    rows.dedup();
    let (from, to) = entries.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), e| (a.min(e.time.0), b.max(e.time.1)));
    writeln!(
        p,
        "<h2>Residual map</h2><p>Rows: what a camera saw of a region of the rest surface (its middle in metres), or a coordinate of a marker; columns: \
         stretches of time from {from:.3} to {to:.3} s, before | after. Blue: a point measured inside the model, or a coordinate larger than \
         simulated; red: the other way round; full colour at six standard deviations of what noise and grid leave.</p><table>"
    )?;
    for row in rows {
        let mine: Vec<&MapEntry> = entries.iter().filter(|e| key(e) == row).collect();
        let scene = if done.experiments.len() > 1 { format!("scene {}, ", row.0 + 1) } else { String::new() };
        let c = mine[0].place;
        let region = if row.1 < 1000 { format!(" ({:.3}, {:.3}, {:.3})", c.x, c.y, c.z) } else { String::new() };
        write!(p, "<tr><td>{scene}{}{region}", escape(&sensor(done, row.0, row.1)))?;
        for (part, z) in [("", (|e| e.before) as fn(&MapEntry) -> f64), ("<td>|", |e| e.after)] {
            write!(p, "{part}")?;
            for e in &mine {
                write!(p, "<td style=\"background:{}\" title=\"{:.3} s: {:.1}\">&nbsp;", colour(z(e)), e.time.0, z(e))?;
            }
        }
        writeln!(p, "</tr>")?;
    }
    writeln!(p, "</table>")
}

fn tried(p: &mut String, input: &DiagnosisInput) -> std::fmt::Result {
    let d = &input.done.diagnosis;
    if d.tried.is_empty() {
        return Ok(());
    }
    writeln!(
        p,
        "<h2>What was tried</h2><table><tr><th>round<th>candidate<th class=\"n\">promised share of the residual<th class=\"n\">p-value\
         <th class=\"n\">gap closed on data left out</tr>"
    )?;
    for t in &d.tried {
        let gain = t.held_out_gain.map_or("not fitted".into(), |g| format!("{:.0} %", 100.0 * g));
        writeln!(
            p,
            "<tr><td>{}<td>{}<td class=\"n\">{:.1} %<td class=\"n\">{:.1e}<td class=\"n\">{gain}</tr>",
            t.round,
            escape(&t.kind),
            100.0 * t.promised,
            t.p_value
        )?;
    }
    writeln!(p, "</table>")?;
    for n in &d.not_tried {
        writeln!(p, "<p class=\"w\">Not tried: {}</p>", escape(n))?;
    }
    Ok(())
}
