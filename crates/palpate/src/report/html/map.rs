//! The residual map of a diagnosis: what each sensor saw of each region against time, before and after.

use crate::diagnosing::Diagnosed;
use crate::render::residual_colour;
use crate::report::diagnosis::stream;
use glam::DVec3;
use maud::{Markup, PreEscaped, html};
use palpate_diagnose::MapEntry;
use std::fmt::Write;

/// Standard deviations at which a block has full colour.
const FULL: f64 = 6.0;
/// Most rows; those with the strongest residuals are shown.
const ROWS: usize = 40;
/// Width of the names, of each of both maps, and height of a row [pixels].
const NAMES: f64 = 250.0;
const WIDE: f64 = 300.0;
const HIGH: f64 = 18.0;

/// The map as a table of colours with its times and its colour bar.
pub fn map(done: &Diagnosed) -> Markup {
    let entries = &done.diagnosis.map;
    if entries.is_empty() {
        return Markup::default();
    }
    let key = |e: &MapEntry| (e.scene, e.stream, e.region);
    let mut rows: Vec<_> = entries.iter().map(key).collect();
    rows.sort_unstable();
    rows.dedup();
    let all = rows.len();
    let strength = |row: &_| entries.iter().filter(|e| key(e) == *row).map(|e| e.before.abs()).fold(0.0, f64::max);
    if all > ROWS {
        let mut order = rows.clone();
        order.sort_by(|a, b| strength(b).total_cmp(&strength(a)));
        rows = order.into_iter().take(ROWS).collect();
        rows.sort_unstable();
    }
    let rows: Vec<Vec<&MapEntry>> = rows.iter().map(|r| entries.iter().filter(|e| key(e) == *r).collect()).collect();
    html! {
        h2 { "Residual map" }
        figure.map {
            (PreEscaped(drawing(done, &rows)))
            figcaption {
                "Rows: what a sensor saw of a region of the body at rest; columns: stretches of time. Blue: measured inside the model, or a coordinate larger than "
                "simulated; red: the other way round; full colour at six standard deviations of what noise and grid leave."
                @if all > rows.len() { " The " (rows.len()) " rows with the strongest residuals of " (all) "." }
            }
        }
    }
}

fn drawing(done: &Diagnosed, rows: &[Vec<&MapEntry>]) -> String {
    let every = rows.iter().flatten();
    let (from, to) = every.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), e| (a.min(e.time.0), b.max(e.time.1)));
    let width = (to - from).max(1e-9);
    let (w, h) = (NAMES + 2.0 * WIDE + 30.0, 30.0 + HIGH * rows.len() as f64 + 64.0);
    let mut svg = format!(
        "<svg role=\"img\" aria-label=\"Residual map: {} rows from {from:.3} to {to:.3} s, before and after\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\" class=\"ink\">",
        rows.len()
    );
    let text = |svg: &mut String, x: f64, y: f64, anchor: &str, words: &str| {
        let words = words.replace('&', "&amp;").replace('<', "&lt;");
        let _ = write!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{words}</text>");
    };
    let left = |m: usize| NAMES + m as f64 * (WIDE + 20.0);
    for (m, name) in ["before", "after"].into_iter().enumerate() {
        text(&mut svg, left(m), 18.0, "start", name);
    }
    for (k, row) in rows.iter().enumerate() {
        let y = 30.0 + HIGH * k as f64;
        text(&mut svg, NAMES - 8.0, y + 13.0, "end", &row_name(done, row[0]));
        for e in row {
            let x = (e.time.0 - from) / width * WIDE;
            let wide = ((e.time.1 - e.time.0) / width * WIDE).max(2.0);
            for (m, z) in [e.before, e.after].into_iter().enumerate() {
                let [r, g, b] = residual_colour(z, FULL);
                let _ = write!(
                    svg,
                    "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{wide:.1}\" height=\"{}\" fill=\"rgb({r},{g},{b})\"><title>{:.3} to {:.3} s: {z:.1}</title></rect>",
                    left(m) + x,
                    y + 1.0,
                    HIGH - 2.0,
                    e.time.0,
                    e.time.1
                );
            }
        }
    }
    let y = 30.0 + HIGH * rows.len() as f64;
    for m in 0..2 {
        text(&mut svg, left(m), y + 14.0, "start", &format!("{from:.3} s"));
        text(&mut svg, left(m) + WIDE, y + 14.0, "end", &format!("{to:.3} s"));
    }
    for k in 0..60 {
        let [r, g, b] = residual_colour(f64::from(k) / 29.5 - 1.0, 1.0);
        let x = NAMES + f64::from(k) * 5.0;
        let _ = write!(svg, "<rect x=\"{x}\" y=\"{:.1}\" width=\"5.5\" height=\"12\" fill=\"rgb({r},{g},{b})\"/>", y + 26.0);
    }
    for (x, anchor, words) in [(0.0, "start", "−6 σ, inside"), (150.0, "middle", "0"), (300.0, "end", "outside, +6 σ")] {
        text(&mut svg, NAMES + x, y + 54.0, anchor, words);
    }
    svg + "</svg>"
}

/// A row in words: the sensor, and which side of the body it saw.
fn row_name(done: &Diagnosed, e: &MapEntry) -> String {
    let scene = if done.experiments.len() > 1 { format!("scene {}, ", e.scene + 1) } else { String::new() };
    let name = stream(done, e.scene, e.stream);
    if !e.stream.sensor.is_spread() {
        return format!("{scene}{name}");
    }
    let experiment = &done.experiments[e.scene];
    let (lo, hi) = experiment.shape().bounds();
    format!("{scene}{name}: {}", side(e.place, lo, hi, experiment.up()))
}

/// Which part of a body a place is, in words: of each axis the end that it is near to, of the vertical one top or bottom.
fn side(place: DVec3, lo: DVec3, hi: DVec3, up: DVec3) -> String {
    let mut words = Vec::new();
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let t = (place[axis] - lo[axis]) / (hi[axis] - lo[axis]).max(1e-12);
        let end = match t {
            t if t < 1.0 / 3.0 => -1.0,
            t if t > 2.0 / 3.0 => 1.0,
            _ => continue,
        };
        let upright = up[axis] * end;
        match upright {
            u if u > 0.9 => words.insert(0, "top".to_string()),
            u if u < -0.9 => words.insert(0, "bottom".to_string()),
            _ => words.push(format!("{}{name} end", if end > 0.0 { "+" } else { "−" })),
        }
    }
    if words.is_empty() { "middle".into() } else { words.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_have_names_that_people_use() {
        let of = |x, y, z| side(DVec3::new(x, y, z), DVec3::ZERO, DVec3::ONE, DVec3::Z);
        assert_eq!(
            (of(0.9, 0.5, 0.95), of(0.5, 0.5, 0.5), of(0.1, 0.5, 0.1)),
            ("top, +x end".into(), "middle".into(), "bottom, −x end".into())
        );
    }
}
