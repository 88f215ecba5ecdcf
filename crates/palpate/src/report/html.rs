//! The report: one page that needs nothing else.

use super::pictures::FramePicture;
use super::plots::{Curve, curves};
use super::result::{number, worth};
use crate::experiment::Experiment;
use crate::fitting::{Fitted, total};
use crate::residuals::ResidualSummary;
use std::fmt::Write;

/// What a report is made of.
pub struct ReportInput<'a> {
    /// The fit.
    pub fitted: &'a Fitted,
    /// Its scenes.
    pub experiments: &'a [Experiment],
    /// Pictures scene by scene: at the first start, and with the values found.
    pub pictures: Vec<(Vec<FramePicture>, Vec<FramePicture>)>,
    /// Residual at which colours are saturated [m].
    pub scale: f64,
    /// The command that reproduces the fit.
    pub command: String,
}

pub(super) const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;color:#222;max-width:1020px;margin:2em auto;padding:0 1em}\
h1{font-size:1.6em}h2{font-size:1.2em;margin-top:2em;border-bottom:1px solid #ddd}\
table{border-collapse:collapse}td,th{padding:.25em .8em;text-align:left;border-bottom:1px solid #eee}\
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}.w{background:#fff6e0;border-left:4px solid #e0a000;padding:.4em .8em;margin:.4em 0}\
code,pre{background:#f4f4f4;padding:.1em .3em}pre{padding:.8em;overflow-x:auto}figure{display:inline-block;margin:.3em}\
figcaption{font-size:.85em;color:#555}img{max-width:100%}.pair img{width:320px}";

/// Text as HTML.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Bytes as base64 (RFC 4648).
pub fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = (0..3).fold(0u32, |w, i| w << 8 | u32::from(chunk.get(i).copied().unwrap_or(0)));
        for i in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * i) & 63) as usize] as char;
            out.push(if i <= chunk.len() { digit } else { '=' });
        }
    }
    out
}

/// The whole page.
pub fn html(input: &ReportInput) -> String {
    let mut page = String::new();
    // Writing to a string cannot fail.
    let _ = write_page(&mut page, input);
    page
}

fn write_page(p: &mut String, input: &ReportInput) -> std::fmt::Result {
    let (fitted, experiments) = (input.fitted, input.experiments);
    let titles: Vec<&str> = experiments.iter().map(|e| e.scene().title.as_str()).filter(|t| !t.is_empty()).collect();
    let title = if titles.is_empty() { "Fit".to_string() } else { titles.join(" + ") };
    writeln!(
        p,
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>{}</title><style>{STYLE}</style></head><body>",
        escape(&title)
    )?;
    writeln!(p, "<h1>{}</h1>", escape(&title))?;
    if fitted.interrupted {
        writeln!(p, "<p class=\"w\">The fit was interrupted; these are the best values found until then.</p>")?;
    }
    if let Some(why) = &fitted.result.broken {
        writeln!(p, "<p class=\"w\">The fit broke off; these are the best values found until then. {}</p>", escape(why))?;
    }
    let (rms, noise, points) = fitted.residual();
    let before: Option<Vec<ResidualSummary>> = fitted.before.iter().cloned().collect();
    let before = before.map_or("not computable".to_string(), |b| format!("{:.3} mm", total(&b, |r| r.rms) * 1e3));
    writeln!(
        p,
        "<p>Root mean square distance between measurement and model: <b>{before}</b> at the first start, <b>{:.3} mm</b> with the \
         values found; measurement noise, and the shape's rounding by cells, would leave {:.3} mm ({points} points); what cells and \
         time step change, <code>--grid-check</code> tells.</p>",
        rms * 1e3,
        noise * 1e3
    )?;
    if let Some(worth) = worth(fitted) {
        writeln!(p, "<p>{}.</p>", escape(&worth))?;
    }
    parameters(p, fitted)?;
    writeln!(p, "<h2>Warnings</h2>")?;
    if fitted.warnings.is_empty() {
        writeln!(p, "<p>None.</p>")?;
    }
    for w in &fitted.warnings {
        writeln!(p, "<p class=\"w\">{}</p>", escape(w))?;
    }
    correlation(p, fitted)?;
    progress(p, fitted)?;
    for (s, e) in experiments.iter().enumerate() {
        scene(p, input, s, e)?;
    }
    runs(p, fitted)?;
    writeln!(p, "<h2>Reproduce</h2><pre>{}</pre>", escape(&input.command))?;
    writeln!(
        p,
        "<p>palpate {}, backend {}, {} evaluations in {:.1} s.</p></body></html>",
        env!("CARGO_PKG_VERSION"),
        fitted.backend,
        fitted.result.evaluations,
        fitted.result.seconds
    )
}

fn parameters(p: &mut String, fitted: &Fitted) -> std::fmt::Result {
    writeln!(p, "<h2>Parameters</h2><table><tr><th>parameter<th class=\"n\">value<th class=\"n\">± standard error<th>unit</tr>")?;
    for (n, f) in fitted.free.iter().zip(&fitted.result.parameters) {
        let error = f.standard_error.map_or("–".to_string(), number);
        let bound = f.at_bound.map_or("", |_| " (at its bound)");
        writeln!(
            p,
            "<tr><td><code>{}</code><td class=\"n\">{}{bound}<td class=\"n\">{error}<td>{}</tr>",
            escape(&n.label()),
            number(f.value),
            if f.unit == "1" { "" } else { &f.unit }
        )?;
    }
    writeln!(p, "</table>")?;
    if let Some(shift) = &fitted.grid_shift {
        let each: Vec<String> = fitted
            .free
            .iter()
            .zip(&fitted.result.parameters)
            .zip(shift)
            .map(|((n, f), s)| format!("<code>{}</code> by {:+.1} %", escape(&n.label()), 100.0 * s / f.value.abs()))
            .collect();
        writeln!(
            p,
            "<p>The standard errors hold noise only. Cells and time step half as large would move {}.</p>",
            each.join(", ")
        )?;
    }
    Ok(())
}

fn correlation(p: &mut String, fitted: &Fitted) -> std::fmt::Result {
    if fitted.free.len() < 2 {
        return Ok(());
    }
    writeln!(p, "<h2>Correlation of the errors</h2><table><tr><th>")?;
    for k in 0..fitted.free.len() {
        writeln!(p, "<th class=\"n\">{}", k + 1)?;
    }
    for (k, (n, row)) in fitted.free.iter().zip(&fitted.result.correlation).enumerate() {
        writeln!(p, "</tr><tr><td>{}. <code>{}</code>", k + 1, escape(&n.label()))?;
        for c in row {
            // The stronger, the darker.
            writeln!(p, "<td class=\"n\" style=\"background:rgba(178,24,43,{:.2})\">{c:.2}", 0.4 * c.abs().powi(2))?;
        }
    }
    writeln!(p, "</tr></table>")
}

fn progress(p: &mut String, fitted: &Fitted) -> std::fmt::Result {
    let many = fitted.result.runs.len() > 8;
    let lines: Vec<Curve> = (0..fitted.result.runs.len())
        .map(|run| {
            let mine = fitted.history.iter().filter(|h| h.start == run);
            Curve {
                label: if many { String::new() } else { format!("run {run}") },
                points: mine.map(|h| (h.iteration as f64, h.cost)).collect(),
            }
        })
        .collect();
    if let Some(svg) = curves(&lines, "iteration", "cost", true) {
        writeln!(p, "<h2>Cost of every run</h2>{svg}")?;
    }
    Ok(())
}

fn scene(p: &mut String, input: &ReportInput, s: usize, e: &Experiment) -> std::fmt::Result {
    writeln!(p, "<h2>Residual: {}</h2>", escape(&e.scene().path.display().to_string()))?;
    let curve = |label: &str, r: &ResidualSummary| Curve {
        label: label.into(),
        points: r.frames.iter().map(|f| (f.time, f.rms * 1e3)).collect(),
    };
    let after = &input.fitted.after[s];
    let mut lines = vec![curve("after", after)];
    lines.extend(input.fitted.before[s].iter().map(|b| curve("before", b)));
    let ends = after.frames.first().zip(after.frames.last());
    if let Some((a, b)) = ends {
        let mm = after.noise * 1e3;
        lines.push(Curve { label: "noise".into(), points: vec![(a.time, mm), (b.time, mm)] });
    }
    if let Some(svg) = curves(&lines, "time [s]", "rms distance [mm]", false) {
        writeln!(p, "{svg}")?;
    }
    let Some((before, found)) = input.pictures.get(s) else { return Ok(()) };
    if found.is_empty() {
        return Ok(());
    }
    writeln!(
        p,
        "<p>Model in grey; measured points blue where they lie inside it, white on it, red outside (full colour at {:.2} mm), black \
         where they met nothing. Left of each pair: first start; right: values found.</p>",
        input.scale * 1e3
    )?;
    for (k, f) in found.iter().enumerate() {
        writeln!(p, "<figure class=\"pair\">")?;
        for x in before.get(k).into_iter().chain([f]) {
            writeln!(p, "<img alt=\"\" src=\"data:image/png;base64,{}\">", base64(&x.picture.png()))?;
        }
        writeln!(p, "<figcaption>t = {:.4} s</figcaption></figure>", f.time)?;
    }
    Ok(())
}

fn runs(p: &mut String, fitted: &Fitted) -> std::fmt::Result {
    writeln!(p, "<h2>Runs</h2><table><tr><th>run<th>start<th>end<th class=\"n\">cost<th class=\"n\">iterations<th>status</tr>")?;
    let list = |v: &[f64]| v.iter().map(|x| number(*x)).collect::<Vec<_>>().join(", ");
    for (k, r) in fitted.result.runs.iter().enumerate() {
        let best = if k == fitted.result.best { " (best)" } else { "" };
        writeln!(
            p,
            "<tr><td>{k}{best}<td>{}<td>{}<td class=\"n\">{}<td class=\"n\">{}<td>{}</tr>",
            list(&r.start),
            list(&r.end),
            number(r.cost),
            r.iterations,
            r.status.name()
        )?;
    }
    writeln!(p, "</table>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_and_escapes_follow_their_rules() {
        // Test vectors of RFC 4648, section 10.
        for (text, code) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg=="), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(base64(text.as_bytes()), code);
        }
        assert_eq!(escape("<a href=\"x\">&"), "&lt;a href=&quot;x&quot;&gt;&amp;");
    }
}
