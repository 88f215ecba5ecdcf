//! The report of a diagnosis.

use super::{Column, figure, heads, page, plot, reproduce, unit};
use crate::diagnosing::Diagnosed;
use crate::report::diagnosis::{fitted, stream};
use crate::report::fit::number;
use crate::report::pictures::FramePicture;
use crate::report::plots::Curve;
use maud::{Markup, html};
use palpate_diagnose::{Diagnosis, Found, Instant, Level, MapEntry, Movement, Tried, Verdict, direction, millimetres, stated};

/// What a report of a diagnosis is made of, scene by scene.
pub struct DiagnosisInput<'a> {
    /// The diagnosis.
    pub done: &'a Diagnosed,
    /// Pictures before and after; `None` where there was no time for them.
    pub pictures: Option<Vec<(Vec<FramePicture>, Vec<FramePicture>)>>,
    /// The command that reproduces it.
    pub command: String,
}

/// The whole page.
pub fn diagnosis_html(input: &DiagnosisInput) -> String {
    let (done, d) = (input.done, &input.done.diagnosis);
    let body = html! {
        p { (d.sentence()) }
        (ending(done))
        (distances(d))
        @for f in &d.effects {
            (effect(f))
        }
        (movements(d))
        (values(d))
        (places(d))
        (map(done))
        @for s in 0..done.experiments.len() {
            (scene(input, s))
        }
        (slack(d))
        (tried(d))
        (reproduce(&input.command, done.backend, &format!("{:.1} s", done.seconds)))
    };
    page(title(d), &body)
}

fn title(d: &Diagnosis) -> &'static str {
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
                    td { code { (path) } }
                    td.n { (stated(*value, *error)) }
                    td { (unit(of)) }
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
    use Column::{Number, Text};
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
                (heads(&[("number", Text), ("before", Number), ("after", Number), ("unit", Text)]))
            } @else {
                (heads(&[("number", Text), ("value", Number), ("unit", Text)]))
            }
            @for (k, n) in d.baseline.numbers.iter().enumerate() {
                tr {
                    td { code { (n.path) } }
                    td.n { (fitted(&d.baseline, k)) }
                    @if changed { td.n { (fitted(&d.model, k)) } }
                    td { (unit(&n.unit)) }
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

/// What each sensor saw of each region of the rest surface against time: blue where the measurement lies inside the model, red outside, full
/// colour at six standard deviations.
fn map(done: &Diagnosed) -> Markup {
    let entries = &done.diagnosis.map;
    if entries.is_empty() {
        return Markup::default();
    }
    let key = |e: &MapEntry| (e.scene, e.stream, e.region);
    let mut rows: Vec<_> = entries.iter().map(key).collect();
    rows.sort_unstable();
    rows.dedup();
    let (from, to) = entries.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), e| (a.min(e.time.0), b.max(e.time.1)));
    html! {
        h2 { "Residual map" }
        p {
            "Rows: what a camera saw of a region of the rest surface (its middle in metres), or a coordinate of a marker; columns: stretches "
            "of time from " (format!("{from:.3} to {to:.3} s")) ", before | after. Blue: a point measured inside the model, or a coordinate "
            "larger than simulated; red: the other way round; full colour at six standard deviations of what noise and grid leave."
        }
        table {
            @for row in rows {
                (map_row(done, &entries.iter().filter(|e| key(e) == row).collect::<Vec<_>>()))
            }
        }
    }
}

/// What one sensor saw of one region.
fn map_row(done: &Diagnosed, entries: &[&MapEntry]) -> Markup {
    let first = entries[0];
    let c = first.place;
    let block = |e: &MapEntry, z: f64| {
        html! { td style=(colour(z)) title=(format!("{:.3} s: {z:.1}", e.time.0)) { "\u{a0}" } }
    };
    html! {
        tr {
            td {
                @if done.experiments.len() > 1 { "scene " (first.scene + 1) ", " }
                (stream(done, first.scene, first.stream))
                @if first.stream.sensor.is_spread() { (format!(" ({:.3}, {:.3}, {:.3})", c.x, c.y, c.z)) }
            }
            @for e in entries { (block(e, e.before)) }
            td { "|" }
            @for e in entries { (block(e, e.after)) }
        }
    }
}

/// Colour of a block at so many standard deviations.
fn colour(z: f64) -> String {
    let strength = (z.abs() / 6.0).min(1.0);
    let (r, b) = if z > 0.0 { (178, 43) } else { (33, 172) };
    format!("background:rgba({r},60,{b},{strength:.2})")
}

fn scene(input: &DiagnosisInput, s: usize) -> Markup {
    let course: Vec<&Instant> = input.done.diagnosis.course.iter().filter(|i| i.scene == s).collect();
    let line = |label: &str, rms: fn(&Instant) -> f64| Curve {
        label: label.into(),
        points: course.iter().map(|i| (i.time, rms(i) * 1e3)).collect(),
    };
    let lines = [line("after", |i| i.after), line("before", |i| i.before)];
    let pictures = input.pictures.iter().flat_map(|all| all.get(s)).flat_map(|(b, a)| b.iter().zip(a));
    html! {
        @if let Some(drawing) = plot(&lines, "time [s]", "rms distance [mm]", false) {
            h2 { "Residual over time, scene " (s + 1) }
            (drawing)
        }
        @for (b, a) in pictures {
            (figure([b, a], &format!("t = {:.4} s, before and after", a.time)))
        }
    }
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

/// Why a candidate was not fitted: it promised too little, or the search did not come to it.
fn not_fitted(t: &Tried) -> &'static str {
    if t.open { "not yet fitted" } else { "not fitted" }
}

fn tried(d: &Diagnosis) -> Markup {
    use Column::{Number, Text};
    if d.tried.is_empty() {
        return Markup::default();
    }
    let columns = [
        ("round", Text),
        ("candidate", Text),
        ("promised share of the residual", Number),
        ("gap closed on data left out", Number),
    ];
    html! {
        h2 { "What was tried" }
        table {
            (heads(&columns))
            @for t in &d.tried {
                tr {
                    td { (t.round) }
                    td { (t.kind) }
                    td.n { (format!("{:.1} %", 100.0 * t.promised)) }
                    td.n { (t.held_out_gain.map_or(not_fitted(t).into(), |g| format!("{:.0} %", 100.0 * g))) }
                }
            }
        }
        @for n in &d.not_tried {
            p.w { "Not tried: " (n) }
        }
    }
}
