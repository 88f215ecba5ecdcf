//! The report of a diagnosis.

use super::map::map;
use super::{Column, chart, heads, page, reproduce, scene::scene};
use crate::diagnosing::Diagnosed;
use crate::report::fit::number;
use crate::report::quantity::{name, quantity};
use crate::results::report::{Chart, ReportData, Role, Series, Style, Topic};
use maud::{Markup, html};
use palpate_diagnose::{Diagnosis, Found, Instant, Level, Model, Movement, Tried, Verdict, direction, millimetres};

/// What a report of a diagnosis is made of, scene by scene.
pub struct DiagnosisInput<'a> {
    /// The diagnosis.
    pub done: &'a Diagnosed,
    /// What it shows; without scenes where there was no time to simulate them.
    pub data: ReportData,
    /// The command that reproduces it.
    pub command: String,
}

/// The whole page.
pub fn diagnosis_html(input: &DiagnosisInput) -> String {
    let (done, d) = (input.done, &input.done.diagnosis);
    let good = d.verdict == Verdict::Adequate;
    let first = html! {
        p.verdict.good[good].bad[!good] role="status" {
            span.sign aria-hidden="true" { @if good { "✓" } @else { "!" } }
            span { b { (d.verdict.name()) } ": " (d.sentence()) }
        }
        (ending(done))
        (distances(d))
    };
    let courses: Vec<Chart> = match input.data.scenes.is_empty() {
        true => (0..done.experiments.len()).filter_map(|s| course(done, s)).collect(),
        false => Vec::new(),
    };
    let body = html! {
        @for f in &d.effects {
            (effect(f))
        }
        (movements(d))
        (values(d))
        (places(d))
        (map(done))
        @for s in 0..input.data.scenes.len() {
            (scene(&input.data, s))
        }
        @for c in &courses { (chart(c)) }
        (slack(d))
        (tried(d))
        (reproduce(&input.command, done.backend, &format!("{:.1} s", done.seconds)))
    };
    page(title(d), &first, &body, &input.data)
}

/// Title of a diagnosis's report.
pub(crate) fn title(d: &Diagnosis) -> &'static str {
    match d.verdict {
        Verdict::Adequate => "Diagnosis: nothing is missing",
        Verdict::MissingEffect => "Diagnosis: an effect is missing",
        Verdict::Unexplained => "Diagnosis: something is missing that no known effect explains",
        Verdict::Undecided if d.unsure.is_some() => "Diagnosis: nothing is decided",
        Verdict::Undecided => "Diagnosis: something is missing, and the search is not finished",
    }
}

/// A word where the search did not come to its end.
fn ending(done: &Diagnosed) -> Markup {
    html! {
        @if let Some(why) = &done.broken {
            p.w { "The search was broken off (" (why) "); this is what was known until then." }
        } @else if done.diagnosis.interrupted {
            p.w { "The diagnosis was interrupted; this is what was known until then." }
        }
    }
}

/// How far measurement and model are apart, on the data that were fitted and on others.
fn distances(d: &Diagnosis) -> Markup {
    use Column::{Number, Text};
    let left_out = |rms: f64| Level { rms, noise: d.before.noise };
    let mut rows =
        vec![("fitted", d.before, d.after), ("blocks of time left out", left_out(d.predicted.0), left_out(d.predicted.1))];
    rows.extend(d.held_out.map(|(b, a)| ("second recording", b, a)));
    let columns = [
        ("data", Text),
        ("before", Number),
        ("explained", Number),
        ("ratio", Number),
        ("after", Number),
        ("explained", Number),
        ("ratio", Number),
    ];
    html! {
        h2 { "Before and after" }
        p { "Distances, root mean square, and what noise and grid explain of them." }
        table {
            (heads(&columns))
            @for (name, before, after) in rows {
                tr {
                    td { (name) }
                    @for l in [before, after] {
                        td.n { (millimetres(l.rms)) }
                        td.n { (millimetres(l.noise)) }
                        td.n { (format!("{:.2}", l.rms / l.noise)) }
                    }
                }
            }
        }
    }
}

fn effect(f: &Found) -> Markup {
    let (nats, error) = f.nats;
    let gain = format!(
        "Closes {:.0} % of the gap on data left out, which it predicts better by {nats:.1} ± {error:.1} nats, its price paid.",
        100.0 * f.held_out_gain
    );
    html! {
        h2 { (f.kind) @if f.accepted { " (added)" } @else { " (not accepted)" } }
        p {
            (f.sentence) ". " (gain)
            @if !f.indistinguishable_from.is_empty() {
                " These data cannot tell it from " b { (f.indistinguishable_from.join(", ")) } "."
            }
            @if let Some(s) = &f.separated_by { " " (s.sentence()) }
        }
        table {
            @for (path, value, error, of) in &f.parameters {
                tr {
                    th scope="row" { code { (path) } }
                    td.value { (quantity(*value, *error, of)) }
                }
            }
        }
    }
}

/// What candidates do to the free numbers.
fn movements(d: &Diagnosis) -> Markup {
    let list = |fitted: bool| -> Vec<&Movement> { d.movements.iter().filter(|m| m.fitted == fitted).collect() };
    html! {
        @if !d.movements.is_empty() {
            h2 { "What it does to the answer" }
            ul {
                @for m in list(true) { li { (m.sentence()) } }
            }
            @if !list(false).is_empty() {
                p { "Not yet fitted, by sensitivities alone:" }
                ul {
                    @for m in list(false) { li { (m.sentence()) } }
                }
            }
        }
    }
}

fn values(d: &Diagnosis) -> Markup {
    use Column::Text;
    if d.baseline.numbers.is_empty() {
        return Markup::default();
    }
    let changed = d.model != d.baseline;
    html! {
        @if changed {
            h2 { "Fitted values before and after" }
            p { "A missing effect pulls the other values along." }
        } @else {
            h2 { "Fitted values" }
        }
        table {
            @if changed {
                (heads(&[("number", Text), ("before", Text), ("after", Text)]))
            } @else {
                (heads(&[("number", Text), ("value", Text)]))
            }
            @for (k, n) in d.baseline.numbers.iter().enumerate() {
                tr {
                    @let words = name(&n.path);
                    th scope="row" { (words) @if words != n.path { br; code { (n.path) } } }
                    td.value { (fitted(&d.baseline, k)) }
                    @if changed { td.value { (fitted(&d.model, k)) } }
                }
            }
        }
        @for (model, all) in [("before", &d.strange.0), ("after", &d.strange.1)] {
            @for s in all.iter().filter(|s| s.is_evidence() && (changed || model == "before")) {
                p.w { @if changed { "The fit " (model) " ends with " } @else { "The fit ends with " } (s.what) "." }
            }
        }
    }
}

fn places(d: &Diagnosis) -> Markup {
    use Column::{Number, Text};
    if d.places.is_empty() {
        return Markup::default();
    }
    html! {
        h2 { "Where the baseline fails" }
        table {
            (heads(&[("time", Text), ("where", Text), ("share", Number), ("p-value", Number)]))
            @for w in &d.places {
                tr {
                    td { (format!("{:.3} to {:.3} s", w.time.0, w.time.1)) }
                    td { (w.region) }
                    td.n { (format!("{:.0} %", 100.0 * w.share)) }
                    td.n { (format!("{:.1e}", w.p_value)) }
                }
            }
        }
    }
}

/// Residuals over time as the search saw them, where there was no time to simulate both models once more.
fn course(done: &Diagnosed, s: usize) -> Option<Chart> {
    let course: Vec<&Instant> = done.diagnosis.course.iter().filter(|i| i.scene == s).collect();
    let line = |label: &str, role, style, rms: fn(&Instant) -> f64| {
        Series::new(label, role, style, course.iter().map(|i| (i.time, rms(i) * 1e3)))
    };
    (!course.is_empty()).then(|| Chart {
        key: format!("residual-{s}"),
        topic: Topic::Residual,
        title: format!("Distance between measurement and model over time, scene {}", s + 1),
        words: "Root mean square distance over time, before and after.".into(),
        x: "time [s]".into(),
        y: "rms distance [mm]".into(),
        main: true,
        series: vec![
            line("before", Role::Before, Style::Dashed, |i| i.before),
            line("after", Role::After, Style::Line, |i| i.after),
        ],
        ..Chart::default()
    })
}

/// A fitted number with its standard error and unit.
fn fitted(m: &Model, k: usize) -> String {
    quantity(m.values[k], m.errors[k], &m.numbers[k].unit)
}

fn slack(d: &Diagnosis) -> Markup {
    use Column::{Number, Text};
    let Some(slack) = &d.slack else { return Markup::default() };
    let columns = [("time", Text), ("x [N/m³]", Number), ("y", Number), ("z", Number), ("towards", Text)];
    html! {
        h2 { "What any load could explain" }
        p {
            "A free force field, affine over the body and smooth in time, would explain " (format!("{:.0} %", 100.0 * slack.share))
            " of what is left; at the body's centre it " (slack.words()) ". Its force per volume there:"
        }
        table {
            (heads(&columns))
            @for w in slack.windows.iter().filter(|w| w.values.len() >= 3) {
                tr {
                    td { (format!("{:.3} s", w.time)) }
                    @for a in 0..3 { td.n { (number(w.values[a])) } }
                    td { (direction(w.force())) }
                }
            }
        }
    }
}

/// What was fitted in a table, and what was not in a line each round: of those only the promise is known.
fn tried(d: &Diagnosis) -> Markup {
    use Column::{Number, Text};
    if d.tried.is_empty() && d.not_tried.is_empty() {
        return Markup::default();
    }
    let columns = [
        ("round", Text),
        ("candidate", Text),
        ("promised share of the residual", Number),
        ("gap closed on data left out", Number),
    ];
    let fitted: Vec<&Tried> = d.tried.iter().filter(|t| t.held_out_gain.is_some()).collect();
    let others = |open: bool| -> Vec<String> {
        let mut all: Vec<&Tried> = d.tried.iter().filter(|t| t.held_out_gain.is_none() && t.open == open).collect();
        all.sort_by(|a, b| b.promised.total_cmp(&a.promised));
        all.iter().map(|t| format!("{} ({:.1} %)", t.kind, 100.0 * t.promised)).collect()
    };
    html! {
        h2 { "What was tried" }
        details {
            summary { (fitted.len()) " candidates were fitted, " (d.tried.len() - fitted.len()) " were not" }
            @if !fitted.is_empty() {
                div.wide {
                    table {
                        (heads(&columns))
                        @for t in &fitted {
                            tr {
                                td { (t.round) }
                                td { (t.kind) }
                                td.n { (format!("{:.1} %", 100.0 * t.promised)) }
                                td.n { (t.held_out_gain.map_or(String::new(), |g| format!("{:.0} %", 100.0 * g))) }
                            }
                        }
                    }
                }
            }
            @for (open, what) in [(true, "not yet fitted, for the search ended before"), (false, "not fitted")] {
                @let list = others(open);
                @if !list.is_empty() { p { (what) ", with the share of the squared residual that each promised: " (list.join(", ")) "." } }
            }
        }
        @for n in &d.not_tried {
            p.w { "Not tried: " (n) }
        }
    }
}
