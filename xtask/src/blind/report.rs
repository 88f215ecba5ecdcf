//! What the blind suite says: a line for every case, the confusion matrix, and rates.

use super::case::Outcome;
use crate::table;
use std::collections::BTreeMap;

/// One case on one line.
pub fn line(o: &Outcome) -> String {
    let percent = |x: Option<f64>| x.map_or("–".to_string(), |v| format!("{:.0} %", 100.0 * v));
    let more =
        if o.indistinguishable.is_empty() { String::new() } else { format!(" (as good: {})", o.indistinguishable.join(", ")) };
    let close = o.close.first().filter(|_| o.named.is_empty()).map_or(String::new(), |c| format!(" close: {} {:.2}", c.0, c.1));
    let slack = o.slack_points.map_or(String::new(), |s| format!(", slack points at it by {s:.2}"));
    let why = if o.verdict == "failed" { format!(" {}", o.sentence) } else { String::new() };
    format!(
        "{:.1} σ: {} {}{more}{close}, p {:.3} → {:.3}, structure {:.2} → {:.2} mm, place {}, parameter off {}, gap closed {:.2}{slack}, {:.0} s, score {}{why}",
        o.strength,
        o.verdict,
        o.named.join(" + "),
        o.p_value.unwrap_or(f64::NAN),
        o.p_value_after.unwrap_or(f64::NAN),
        1e3 * o.structure.0,
        1e3 * o.structure.1,
        percent(o.localisation),
        percent(o.parameter_error),
        o.gap_closed,
        o.seconds,
        o.score(),
    )
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut v: Vec<f64> = values.filter(|x| x.is_finite()).collect();
    v.sort_by(f64::total_cmp);
    (!v.is_empty()).then(|| if v.len() % 2 == 1 { v[v.len() / 2] } else { 0.5 * (v[v.len() / 2 - 1] + v[v.len() / 2]) })
}

/// Strength below which nothing is to be seen, in standard deviations: some effects cannot be made stronger in a scene within what they allow.
const FAINT: f64 = 2.0;

/// The group that a case counts for.
fn group_of(o: &Outcome) -> &str {
    if !o.hidden.is_empty() && o.strength > 0.0 && o.strength < FAINT { "faint" } else { &o.group }
}

/// Prints everything.
pub fn print(all: &[&Outcome]) {
    let mut matrix: BTreeMap<(String, String), usize> = BTreeMap::new();
    for o in all {
        let hidden = if o.hidden.is_empty() { o.group.clone() } else { o.hidden.join(" + ") };
        let said = if o.named.is_empty() { o.verdict.clone() } else { o.named.join(" + ") };
        *matrix.entry((hidden, said)).or_default() += 1;
    }
    let mut rows = vec![vec!["hidden".to_string(), "said".into(), "cases".into()]];
    rows.extend(matrix.into_iter().map(|((h, s), n)| vec![if h == s { format!("{h} ✓") } else { h }, s, n.to_string()]));
    table::print("Confusion (pairs that occur)", &rows);

    let mut rows = vec![
        ["group", "cases", "score", "same physics", "place", "parameter off", "gap closed", "strength / σ"]
            .map(String::from)
            .to_vec(),
    ];
    let number = |x: Option<f64>| x.map_or("–".to_string(), |v| format!("{v:.2}"));
    for group in ["strong", "weak", "faint", "pair", "magnet", "null"] {
        let of: Vec<&&Outcome> = all.iter().filter(|o| group_of(o) == group).collect();
        if of.is_empty() {
            continue;
        }
        let mean = |f: fn(&Outcome) -> f64| of.iter().map(|o| f(o)).sum::<f64>() / of.len() as f64;
        rows.push(vec![
            group.to_string(),
            of.len().to_string(),
            format!("{:.2}", mean(Outcome::score)),
            format!("{:.2}", mean(Outcome::score_of_physics)),
            number(median(of.iter().filter_map(|o| o.localisation))),
            number(median(of.iter().filter_map(|o| o.parameter_error))),
            number(if group == "null" { None } else { median(of.iter().map(|o| o.gap_closed)) }),
            number(median(of.iter().map(|o| o.strength))),
        ]);
    }
    table::print("Rates (medians but for scores)", &rows);
    let seconds = median(all.iter().map(|o| o.seconds)).unwrap_or(0.0);
    let longest = all.iter().map(|o| o.seconds).fold(0.0, f64::max);
    println!("\ntime per case: median {seconds:.0} s, largest {longest:.0} s");
    let wrong: Vec<&&Outcome> = all.iter().filter(|o| o.score() < 1.0).collect();
    if !wrong.is_empty() {
        println!("\nnot right:");
        wrong.iter().for_each(|o| println!("  {}: {}", o.name, line(o)));
    }
}
