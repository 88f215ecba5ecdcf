//! The report of a fit.

use super::{Column, chart, heads, page, reproduce, scene::scene};
use crate::experiment::Experiment;
use crate::fitting::{Fitted, total};
use crate::report::fit::{beforehand, field_line, grid_line, number, other_way, posterior_lines, worth};
use crate::report::quantity::{millimetres, name, quantity, size as short};
use crate::residuals::ResidualSummary;
use crate::results::fit::{FieldReference, FoundCurve, VerdictWord};
use crate::results::report::{ReportData, Topic};
use maud::{Markup, html};

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
    /// What it shows.
    pub data: ReportData,
    /// The command that reproduces the fit.
    pub command: String,
}

/// Title of a fit's report.
pub fn title(experiments: &[Experiment]) -> String {
    let titles: Vec<&str> = experiments.iter().map(|e| e.scene().title.as_str()).filter(|t| !t.is_empty()).collect();
    if titles.is_empty() { "Fit".to_string() } else { titles.join(" + ") }
}

/// The whole page.
pub fn fit_html(input: &ReportInput) -> String {
    let fitted = input.fitted;
    let effort = format!("{} evaluations in {:.1} s", fitted.result.evaluations, fitted.result.seconds);
    let first = html! {
        (verdict(fitted))
        (warnings(fitted))
        (parameters(fitted))
        (distances(fitted))
    };
    let of = |topic: Topic| input.data.charts.iter().filter(move |c| c.topic == topic);
    let body = html! {
        (fields(input))
        @for (c, found) in of(Topic::Curve).zip(input.curves) { (curve(c, found)) }
        @for s in 0..input.data.scenes.len() { (scene(&input.data, s)) }
        @if of(Topic::Search).next().is_some() {
            h2 { "Convergence of all starts" }
            @for c in of(Topic::Search) { (chart(c)) }
        }
        (correlation(fitted))
        h2 { "What was tried" }
        (runs(fitted))
        (reproduce(&input.command, fitted.backend, &effort))
    };
    page(&input.data.title, &first, &body, &input.data)
}

/// The verdict, in the words of `result.json` and the terminal.
fn verdict(fitted: &Fitted) -> Markup {
    let good = fitted.verdict.word == VerdictWord::Converged;
    html! {
        p.verdict.good[good].bad[!good] role="status" {
            span.sign aria-hidden="true" { @if good { "✓" } @else { "!" } }
            span {
                b { (fitted.verdict.word.name()) }
                @if !good { ": " (fitted.verdict.reasons.join("; ")) "." }
                @else { ": the best point was found, and nothing speaks against it." }
            }
        }
    }
}

/// How far measurement and model are apart, before and after, and what noise would leave.
fn distances(fitted: &Fitted) -> Markup {
    let (rms, noise, points) = fitted.residual();
    let before: Option<Vec<ResidualSummary>> = fitted.before.iter().cloned().collect();
    let before = before.map_or("not computable".to_string(), |b| millimetres(total(&b, |r| r.rms)));
    html! {
        p {
            "Root mean square distance between measurement and model: " b { (before) } " at the first start, " b { (millimetres(rms)) }
            " with the values found; measurement noise, and the shape's rounding by cells, would leave " (millimetres(noise)) " (" (points)
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
    use Column::Text;
    html! {
        @if !fitted.free.is_empty() {
            div.wide {
                table.values {
                    (heads(&[("found", Text), ("value ± total error", Text), ("parts of the error", Text)]))
                    @for (i, (n, f)) in fitted.free.iter().zip(&fitted.result.parameters).enumerate() {
                        @let h = fitted.headline(i);
                        @let label = n.label();
                        @let words = name(&label);
                        tr {
                            th scope="row" { (words) @if words != label { br; code { (label) } } }
                            td.value {
                                (quantity(h.value, h.parts.map(|p| p.total()), &f.unit))
                                @if h.parts.is_none() { " (no standard error)" }
                                @if f.at_bound.is_some() { " (at its bound)" }
                            }
                            td { (parts(fitted, i)) }
                        }
                    }
                }
            }
            @for (n, f) in fitted.free.iter().zip(&fitted.result.parameters).filter(|(_, f)| f.known.is_some()) {
                p { code { (n.label()) } ": " (beforehand(f)) "." }
            }
            @for n in &fitted.normals {
                p { code { (n.line(fitted.after.len())) } }
            }
            p.small { (grid_line(fitted)) "." }
        }
    }
}

/// The parts of a number's error as lengths of a bar, which add as squares, and what was done to its value.
fn parts(fitted: &Fitted, i: usize) -> Markup {
    let h = fitted.headline(i);
    let unit = &fitted.result.parameters[i].unit;
    let Some(parts) = h.parts else { return Markup::default() };
    let whole = parts.total().powi(2).max(f64::MIN_POSITIVE);
    let mut all = vec![("noise", parts.noise)];
    all.extend(parts.discretisation.map(|d| ("discretisation", d)));
    all.extend((parts.systematic > 0.0).then_some(("systematic", parts.systematic)));
    let order = fitted.grid.as_ref().and_then(|g| g.numbers.get(i)).and_then(|n| n.order);
    html! {
        @for (what, size) in all {
            div.part {
                span.bar aria-hidden="true" { span style={ "width:" (format!("{:.0}", 100.0 * size.powi(2) / whole)) "%" } {} }
                (what) " " (short(size, unit))
            }
        }
        @if let (Some(before), Some(order)) = (h.uncorrected, order) {
            div.small { "corrected from " (quantity(before, None, unit)) " on these cells, order " (format!("{order:.1}")) }
        }
    }
}

/// Fields by their extent; the values lie in files.
fn fields(input: &ReportInput) -> Markup {
    html! {
        @if !input.fields.is_empty() { h2 { "Fields" } }
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
fn curve(drawn: &crate::results::report::Chart, found: &FoundCurve) -> Markup {
    let unseen: Vec<String> = found.unseen().iter().map(|c| number(*c)).collect();
    html! {
        h2 { "Stiffness over that at rest: " code { (found.path) } }
        (chart(drawn))
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
        div.wide {
            table {
                tr {
                    th {}
                    @for l in &lengths { th.n scope="col" { (l.map_or("–".to_string(), number)) } }
                }
                @for d in &deviations {
                    tr {
                        th.n scope="row" { (number(*d)) }
                        @for l in &lengths {
                            @let e = of(*l, *d).unwrap_or(f64::NEG_INFINITY);
                            td.n style=(colour(e)) { (format!("{e:.1}")) }
                        }
                    }
                }
            }
        }
    }
}

fn warnings(fitted: &Fitted) -> Markup {
    html! {
        @for w in &fitted.warnings {
            p.w { (w) }
        }
        @if fitted.warnings.is_empty() {
            p.small { "No warnings." }
        }
    }
}

fn correlation(fitted: &Fitted) -> Markup {
    if fitted.free.len() < 2 {
        return Markup::default();
    }
    // The stronger, the darker.
    let colour = |c: f64| {
        let [r, g, b] = if c > 0.0 { crate::report::plots::BEFORE } else { crate::report::plots::AFTER };
        format!("background:rgba({r},{g},{b},{:.2})", 0.45 * c.abs().powi(2))
    };
    html! {
        h2 { "Correlation of the errors" }
        p { "Orange where two numbers err the same way, blue where one makes up for the other; beyond ±0.9 the recording hardly tells them apart." }
        div.wide {
            table {
                tr {
                    th {}
                    @for k in 0..fitted.free.len() { th.n scope="col" { (k + 1) } }
                }
                @for (k, (n, row)) in fitted.free.iter().zip(&fitted.result.correlation).enumerate() {
                    tr {
                        th scope="row" { (k + 1) ". " (name(&n.label())) }
                        @for c in row { td.n style=(colour(*c)) { (format!("{c:.2}").replace('-', "−")) } }
                    }
                }
            }
        }
    }
}

fn runs(fitted: &Fitted) -> Markup {
    let found: Vec<_> = fitted.free.iter().zip(&fitted.result.parameters).collect();
    let list = |v: &[f64]| {
        let one = |(_, p): &(_, &palpate_fit::FittedParameter)| v.get(p.index).map(|x| quantity(*x, None, &p.unit));
        found.iter().filter_map(one).collect::<Vec<_>>().join(", ")
    };
    let order = found.iter().map(|(n, _)| name(&n.label())).collect::<Vec<_>>().join(", ");
    use Column::{Number, Text};
    let columns = [("start", Text), ("from", Text), ("to", Text), ("cost", Number), ("iterations", Number), ("ended", Text)];
    html! {
        details {
            summary { (fitted.result.runs.len()) @if fitted.result.runs.len() == 1 { " search, " } @else { " searches, " } (fitted.result.evaluations) " evaluations, by " (fitted.optimizer.name()) }
            @if found.len() > 1 { p { "In this order: " (order) "." } }
            div.wide {
                table {
                    (heads(&columns))
                    @for (k, r) in fitted.result.runs.iter().enumerate() {
                        tr {
                            td { (k + 1) @if k == fitted.result.best { " (best)" } }
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
    }
}
