//! Numbers and lists as files have them.

use crate::specimen::{Clock, Specimen};
use glam::DVec3;

/// A number in the fewest digits that give it back.
pub fn num(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        a if (1e-4..1e7).contains(&a) => format!("{x}"),
        _ => format!("{x:e}"),
    }
}

/// A number in at most sixteen characters, of ten digits, for files whose fields are short.
pub fn short(x: f64) -> String {
    if x == 0.0 { "0".into() } else { format!("{x:.9e}") }
}

/// A vector with something between its components.
pub fn vector(x: DVec3, between: &str) -> String {
    x.to_array().map(num).join(between)
}

/// Joins items with something between them, so many on a line.
pub fn rows<T: ToString>(items: impl IntoIterator<Item = T>, a_line: usize, between: &str, after_line: &str) -> String {
    let all: Vec<String> = items.into_iter().map(|i| i.to_string()).collect();
    all.chunks(a_line).map(|c| c.join(between)).collect::<Vec<_>>().join(after_line)
}

/// Text within an XML file.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// What stands in the head of every file: what it is, where it comes from, units, gravity, and what it lacks.
pub fn head(s: &Specimen, lost: &[String]) -> Vec<String> {
    let mut lines = vec![s.source.clone()];
    if !s.title.is_empty() {
        lines.push(s.title.replace(['\n', '\r'], " "));
    }
    lines.push("units: m, s, kg, N, Pa; the nodes are the stress-free shape".into());
    lines.push(format!("gravity: {} m/s2", vector(s.gravity, " ")));
    let m = &s.material;
    lines.push(format!(
        "material: {}, E {} Pa, nu {}, {} kg/m3, Rayleigh damping alpha {} 1/s, beta {} s",
        m.model,
        num(m.youngs_modulus),
        num(m.poisson_ratio),
        num(m.density),
        num(m.mass_damping),
        num(m.stiffness_damping)
    ));
    lines.push(match s.clock {
        Clock::Static => "a static problem".into(),
        Clock::Motion { step, steps } => format!("a motion of {steps} steps of {} s", num(step)),
    });
    lines.extend(lost.iter().map(|l| format!("not here: {l}")));
    lines
}

/// The head as an XML comment, in which two dashes may not stand together.
pub fn xml_head(s: &Specimen, lost: &[String]) -> String {
    let lines: Vec<String> = head(s, lost).iter().map(|l| format!("  {}", l.replace("--", "- -"))).collect();
    format!("<!--\n{}\n-->\n", lines.join("\n"))
}
