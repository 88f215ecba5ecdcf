//! The table of `docs/speed.md`: times and memory by size, of one stored run.

use crate::table::stored;
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;

/// The run that the page shows, `bench/NAME.json`.
pub const SHOWN: &str = "bench-2026-11-23";

/// A number in two digits, or as many as it has before its point.
fn short(x: f64) -> String {
    if x < 9.95 { format!("{x:.1}") } else { format!("{x:.0}") }
}

/// A time in the largest unit that it fills.
fn time(seconds: f64) -> String {
    let [value, unit] = match seconds {
        s if s >= 0.9995 => [short(s), "s".into()],
        s if s >= 0.9995e-3 => [short(1e3 * s), "ms".into()],
        s => [short(1e6 * s), "µs".into()],
    };
    format!("{value} {unit}")
}

fn memory(bytes: f64) -> String {
    if bytes >= 0.9995e9 { format!("{} GB", short(bytes / 1e9)) } else { format!("{} MB", short(bytes / 1e6)) }
}

/// A count with its thousands apart.
fn count(n: u64) -> String {
    if n < 1000 { n.to_string() } else { format!("{} {:03}", n / 1000, n % 1000) }
}

/// The table of a run, by size.
///
/// # Errors
/// The run has not what the table shows.
pub fn markdown(run: &Value) -> Result<String, String> {
    let mut lines: Vec<&Value> = run["lines"].as_array().into_iter().flatten().collect();
    // A body alone; one with more in its scene has that behind a comma.
    lines.retain(|l| l["name"].as_str().is_none_or(|name| !name.contains(',')));
    lines.sort_by_key(|l| l["nodes"].as_u64());
    let mut out = String::from(
        "| body | nodes | step | a node | cost | adjoint | Newton | CG | memory |\n|---|---|---|---|---|---|---|---|---|\n",
    );
    for line in lines {
        let lacks = |key: &str| format!("bench/{SHOWN}.json: a line has no {key}");
        let number = |value: &Value, key: &str| value.as_f64().ok_or_else(|| lacks(key));
        let median = |key: &str| number(&line[key]["median"], key);
        let (name, nodes) = (line["name"].as_str().ok_or_else(|| lacks("name"))?, number(&line["nodes"], "nodes")?);
        let step = median("forward")?;
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} | {} | {} | {:.1} | {:.0} | {} |",
            name.split(' ').next().unwrap_or(name),
            count(nodes as u64),
            time(step),
            time(step / nodes),
            time(median("cost")?),
            time(median("adjoint")?),
            number(&line["newton"], "newton")?,
            number(&line["linear"], "linear")?,
            memory(number(&line["peak"], "peak")?),
        );
    }
    Ok(out)
}

/// The table of the run that the page shows.
///
/// # Errors
/// The file cannot be read, or lacks something.
pub fn shown(root: &Path) -> Result<String, String> {
    markdown(&stored(root, SHOWN)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_becomes_a_table_by_size() {
        let line = |name: &str, nodes: u64, step: f64| {
            let at = serde_json::json!({ "median": step });
            serde_json::json!({ "name": name, "nodes": nodes, "forward": at, "cost": at, "adjoint": at, "newton": 5.36, "linear": 134.6, "peak": 1.07e9 })
        };
        let table =
            markdown(&serde_json::json!({ "lines": [line("ball 10k", 10_251, 4.72), line("dragon", 999, 0.0999), line("dragon, every effect", 999, 1.0)] })).unwrap();
        let rows: Vec<&str> = table.lines().skip(2).collect();
        let all = [
            "| dragon | 999 | 100 ms | 100 µs | 100 ms | 100 ms | 5.4 | 135 | 1.1 GB |",
            "| ball | 10 251 | 4.7 s | 460 µs | 4.7 s | 4.7 s | 5.4 | 135 | 1.1 GB |",
        ];
        assert_eq!(rows, all);
        assert!(markdown(&serde_json::json!({ "lines": [{ "name": "ball", "nodes": 5 }] })).unwrap_err().contains("no forward"));
    }
}
