//! What the independent cases say: a line for every case, and a table.

use super::Independent;
use crate::table;

fn percent(x: Option<f64>) -> String {
    x.map_or("–".to_string(), |v| format!("{:.1} %", 100.0 * v))
}

fn said(o: &Independent) -> String {
    let o = &o.outcome;
    match (o.named.is_empty(), o.indistinguishable.is_empty()) {
        (true, _) => o.verdict.clone(),
        (false, true) => o.named.join(" + "),
        (false, false) => format!("{} (as good: {})", o.named.join(" + "), o.indistinguishable.join(", ")),
    }
}

fn distance(o: &Independent) -> String {
    let [before, after, explained] = o.distance.map(|d| 1e3 * d);
    format!("{before:.3} → {after:.3} mm ({explained:.3})")
}

/// One case on one line.
pub fn line(o: &Independent) -> String {
    let c = &o.outcome;
    let why = if c.verdict == "failed" { format!(" {}", c.sentence) } else { String::new() };
    let close = c.close.first().filter(|_| c.named.is_empty()).map_or(String::new(), |c| format!(" close: {} {:.2}", c.0, c.1));
    let fitted = |n: &(String, f64, Option<f64>)| n.2.map(|v| format!(", {} off {:+.1} %", n.0, 100.0 * (v / n.1 - 1.0)));
    let baseline: String = o.baseline.iter().filter_map(fitted).collect();
    let number = |n: &(String, f64, Option<f64>)| n.2.map(|v| format!(", {} {v:.5} instead of {:.5}", n.0, n.1));
    let numbers: String = o.numbers.iter().filter_map(number).collect();
    format!(
        "{}: {}{close}, {}, p {:.3} → {:.3}, structure {:.3} → {:.3} mm{baseline}{numbers}, gap closed {:.2}, {:.0} s + {:.0} s, score {}{why}",
        c.verdict,
        said(o),
        distance(o),
        c.p_value.unwrap_or(f64::NAN),
        c.p_value_after.unwrap_or(f64::NAN),
        1e3 * c.structure.0,
        1e3 * c.structure.1,
        c.gap_closed,
        o.recording_seconds,
        c.seconds,
        o.score(),
    )
}

/// Prints all of them as a table.
pub fn print(all: &[&Independent]) {
    let mut rows = vec![
        ["case", "said", "before → after (explained)", "number off", "gap closed", "time / s", "score"]
            .map(String::from)
            .to_vec(),
    ];
    rows.extend(all.iter().map(|o| {
        vec![
            o.outcome.name.clone(),
            said(o),
            distance(o),
            percent(o.outcome.parameter_error),
            format!("{:.2}", o.outcome.gap_closed),
            format!("{:.0}", o.outcome.seconds),
            o.score().to_string(),
        ]
    }));
    table::print("Bodies simulated by another method", &rows);
    let sum: f64 = all.iter().map(|o| o.score()).sum();
    println!("\nright: {sum} of {}", all.len());
}
