//! The report of a fit.

use super::{Column, figure, heads, over_time, page, plot, reproduce, unit};
use crate::experiment::Experiment;
use crate::fitting::{Fitted, total};
use crate::report::fit::{beforehand, field_line, grid_line, number, other_way, parts, posterior_lines, worth};
use crate::report::pictures::FramePicture;
use crate::report::plots::Curve;
use crate::residuals::ResidualSummary;
use crate::results::fit::{FieldReference, FoundCurve, VerdictWord};
use maud::{Markup, html};
use palpate_model::observation::ReadingKind;

/// What a report is made of.
pub struct ReportInput<'a> {
    /// The fit.
    pub fitted: &'a Fitted,
    /// Its scenes.
    pub experiments: &'a [Experiment],
    /// The fields found.
    pub fields: &'a [FieldReference],
    /// The curves of stiffness found.
    pub curves: &'a [FoundCurve],
    /// Pictures scene by scene: at the first start, and with the values found.
    pub pictures: Vec<(Vec<FramePicture>, Vec<FramePicture>)>,
    /// Residual at which colours are saturated [m].
    pub scale: f64,
    /// The command that reproduces the fit.
    pub command: String,
}

/// The whole page.
pub fn fit_html(input: &ReportInput) -> String {
    let (fitted, experiments) = (input.fitted, input.experiments);
    let titles: Vec<&str> = experiments.iter().map(|e| e.scene().title.as_str()).filter(|t| !t.is_empty()).collect();
    let title = if titles.is_empty() { "Fit".to_string() } else { titles.join(" + ") };
    let effort = format!("{} evaluations in {:.1} s", fitted.result.evaluations, fitted.result.seconds);
    let body = html! {
        (verdict(fitted))
        (distances(fitted))
        (parameters(fitted))
        (fields(input))
        @for c in input.curves { (curve(c)) }
        (warnings(fitted))
        (correlation(fitted))
        (progress(fitted))
        @for (s, e) in experiments.iter().enumerate() {
            (scene(input, s, e))
        }
        (runs(fitted))
        (reproduce(&input.command, fitted.backend, &effort))
    };
    page(&title, &body)
}

/// The verdict, in the words of `result.json` and the terminal.
fn verdict(fitted: &Fitted) -> Markup {
    let good = fitted.verdict.word == VerdictWord::Converged;
    html! {
        p.verdict.w[!good] { b { (fitted.verdict.word.name()) } @if !good { ": " (fitted.verdict.reasons.join("; ")) "." } }
    }
}

/// How far measurement and model are apart, before and after, and what noise would leave.
fn distances(fitted: &Fitted) -> Markup {
    let (rms, noise, points) = fitted.residual();
    let before: Option<Vec<ResidualSummary>> = fitted.before.iter().cloned().collect();
    let mm = |x: f64| format!("{:.3} mm", x * 1e3);
    let before = before.map_or("not computable".to_string(), |b| mm(total(&b, |r| r.rms)));
    html! {
        p {
            "Root mean square distance between measurement and model: " b { (before) } " at the first start, " b { (mm(rms)) }
            " with the values found; measurement noise, and the shape's rounding by cells, would leave " (mm(noise)) " (" (points)
            " points)."
        }
        @if let Some(h) = &fitted.held_out {
            p { "Frames: " (h.sentence()) "." }
        }
        @if let Some(worth) = worth(fitted) {
            p { (worth) "." }
        }
    }
}

fn parameters(fitted: &Fitted) -> Markup {
    use Column::{Number, Text};
    html! {
        h2 { "Parameters" }
        table {
            (heads(&[("parameter", Text), ("value", Number), ("± standard error", Number), ("unit", Text), ("parts of ±", Text)]))
            @for (i, (n, f)) in fitted.free.iter().zip(&fitted.result.parameters).enumerate() {
                @let h = fitted.headline(i);
                tr {
                    td { code { (n.label()) } }
                    td.n { (number(h.value)) @if f.at_bound.is_some() { " (at its bound)" } }
                    td.n { (h.parts.map_or("–".to_string(), |p| number(p.total()))) }
                    td { (unit(&f.unit)) }
                    td { (parts(fitted, i)) }
                }
            }
        }
        @for (n, f) in fitted.free.iter().zip(&fitted.result.parameters).filter(|(_, f)| f.known.is_some()) {
            p { code { (n.label()) } ": " (beforehand(f)) "." }
        }
        p { (grid_line(fitted)) "." }
    }
}

/// Fields by their extent; the values lie in files.
fn fields(input: &ReportInput) -> Markup {
    html! {
        @for f in input.fields {
            p { (field_line(f)) "." }
            @for line in posterior_lines(f) {
                p { (line) "." }
            }
            (evidence(f))
        }
        @for note in input.fitted.notes.iter().cloned().chain(other_way(input.fitted)) {
            p { (note) "." }
        }
    }
}

/// A curve with its band, and where the motion says nothing of it.
fn curve(found: &FoundCurve) -> Markup {
    let labels = ["factor", "+ one standard error", "− one standard error"];
    let lines: Vec<Curve> =
        labels.into_iter().zip(found.band()).map(|(label, points)| Curve { label: label.into(), points }).collect();
    let what = if found.path.ends_with("volume_curve") { "ratio of volumes" } else { "principal stretch" };
    let unseen: Vec<String> = found.unseen().iter().map(|c| number(*c)).collect();
    html! {
        h2 { "Stiffness over that at rest: " code { (found.path) } }
        @if let Some(drawing) = plot(&lines, what, "factor", false) { (drawing) }
        p {
            "In the motion it went from " (number(found.range[0])) " to " (number(found.range[1])) "."
            @if !unseen.is_empty() { " Of the corners at " (unseen.join(", ")) " the recording says nothing." }
        }
    }
}

/// Evidence of every prior that was tried, lengths across and deviations down, the darker the better.
fn evidence(f: &FieldReference) -> Markup {
    let Some(p) = f.posterior.as_ref().filter(|p| p.tried.len() > 2) else { return Markup::default() };
    let (mut lengths, mut deviations) = (Vec::new(), Vec::new());
    for t in p.tried.iter().filter(|t| t.deviation > 0.0) {
        if !lengths.contains(&t.length) {
            lengths.push(t.length);
        }
        if !deviations.contains(&t.deviation) {
            deviations.push(t.deviation);
        }
    }
    let of = |length, deviation| p.tried.iter().find(|t| t.length == length && t.deviation == deviation).and_then(|t| t.evidence);
    let colour = |e: f64| format!("background:rgba(33,102,172,{:.2})", 0.5 * (0.5 * e).exp());
    html! {
        p { "Logarithm of the evidence over that of the best, by length [m] across and deviation of the logarithm down." }
        table {
            tr {
                th {}
                @for l in &lengths { th.n { (l.map_or("–".to_string(), number)) } }
            }
            @for d in &deviations {
                tr {
                    td { (number(*d)) }
                    @for l in &lengths {
                        @let e = of(*l, *d).unwrap_or(f64::NEG_INFINITY);
                        td.n style=(colour(e)) { (format!("{e:.1}")) }
                    }
                }
            }
        }
    }
}

fn warnings(fitted: &Fitted) -> Markup {
    html! {
        h2 { "Warnings" }
        @if fitted.warnings.is_empty() {
            p { "None." }
        }
        @for w in &fitted.warnings {
            p.w { (w) }
        }
    }
}

fn correlation(fitted: &Fitted) -> Markup {
    if fitted.free.len() < 2 {
        return Markup::default();
    }
    // The stronger, the darker.
    let colour = |c: f64| format!("background:rgba(178,24,43,{:.2})", 0.4 * c.abs().powi(2));
    html! {
        h2 { "Correlation of the errors" }
        table {
            tr {
                th {}
                @for k in 0..fitted.free.len() { th.n { (k + 1) } }
            }
            @for (k, (n, row)) in fitted.free.iter().zip(&fitted.result.correlation).enumerate() {
                tr {
                    td { (k + 1) ". " code { (n.label()) } }
                    @for c in row { td.n style=(colour(*c)) { (format!("{c:.2}")) } }
                }
            }
        }
    }
}

fn progress(fitted: &Fitted) -> Markup {
    let many = fitted.result.runs.len() > 8;
    let line = |run: usize| {
        let mine = fitted.history.iter().filter(|h| h.start == run);
        Curve {
            label: if many { String::new() } else { format!("run {run}") },
            points: mine.map(|h| (h.iteration as f64, h.cost)).collect(),
        }
    };
    let lines: Vec<Curve> = (0..fitted.result.runs.len()).map(line).collect();
    html! {
        @if let Some(drawing) = plot(&lines, "iteration", "cost", true) {
            h2 { "Cost of every run" }
            (drawing)
        }
    }
}

fn scene(input: &ReportInput, s: usize, e: &Experiment) -> Markup {
    let after = &input.fitted.after[s];
    let mut lines = vec![over_time("after", after)];
    lines.extend(input.fitted.before[s].iter().map(|b| over_time("before", b)));
    if let Some((a, b)) = after.frames.first().zip(after.frames.last()) {
        let mm = after.noise * 1e3;
        lines.push(Curve { label: "noise".into(), points: vec![(a.time, mm), (b.time, mm)] });
    }
    html! {
        h2 { "Residual: " (e.scene().path.display()) }
        @if let Some(drawing) = plot(&lines, "time [s]", "rms distance [mm]", false) { (drawing) }
        @if let Some((before, found)) = input.pictures.get(s).filter(|p| !p.1.is_empty()) {
            p {
                "Model in grey. "
                @if e.plan().observation.readings(ReadingKind::Depth) > 0 {
                    "Measured points are blue where they lie inside it, white on it, red outside (full colour at "
                    (format!("{:.2}", input.scale * 1e3)) " mm), and black where they met nothing. "
                }
                @if [ReadingKind::Marker, ReadingKind::Track, ReadingKind::Displacement].iter().any(|k| e.plan().observation.readings(*k) > 0) {
                    "Black dots are measured markers and points, each with a line to where the model has it. "
                }
                "Left of each pair: first start; right: values found."
            }
            @for (k, f) in found.iter().enumerate() {
                (figure(before.get(k).into_iter().chain([f]), &format!("t = {:.4} s", f.time)))
            }
        }
    }
}

fn runs(fitted: &Fitted) -> Markup {
    use Column::{Number, Text};
    let found = &fitted.result.parameters;
    let list = |v: &[f64]| found.iter().filter_map(|p| v.get(p.index)).map(|x| number(*x)).collect::<Vec<_>>().join(", ");
    let columns = [("run", Text), ("start", Text), ("end", Text), ("cost", Number), ("iterations", Number), ("status", Text)];
    html! {
        h2 { "Runs" }
        table {
            (heads(&columns))
            @for (k, r) in fitted.result.runs.iter().enumerate() {
                tr {
                    td { (k) @if k == fitted.result.best { " (best)" } }
                    td { (list(&r.start)) }
                    td { (list(&r.end)) }
                    td.n { (number(r.cost)) }
                    td.n { (r.iterations) }
                    td { (r.status.name()) }
                }
            }
        }
    }
}
