//! What the numbers of the search are worth: the suite with one of them changed, against the suite as it is.

use super::methods::Method;
use super::score::Row;
use crate::table;
use palpate_diagnose::Policy;
use serde::{Deserialize, Serialize};

/// A change of the search.
pub struct Ablation {
    /// In rows and in the table.
    pub name: &'static str,
    /// Makes it.
    pub set: fn(&mut Policy),
}

/// Every number of the search, halved or doubled or taken away, whichever is cheaper: a number that is worth nothing so should go.
pub const ALL: [Ablation; 16] = [
    Ablation { name: "one round", set: |p| p.rounds = 1 },
    Ablation { name: "6 race", set: |p| p.fits = 6 },
    Ablation { name: "24 race", set: |p| p.fits = 24 },
    Ablation { name: "one lap", set: |p| p.laps = [25; 4] },
    Ablation { name: "first laps as exact as the last", set: |p| p.tolerance = [2e-5, 2e-5] },
    Ablation { name: "a quarter goes on", set: |p| p.kept = (0.25, 2) },
    Ablation { name: "no lag", set: |p| p.lag = 0.0 },
    Ablation { name: "starts at the whole estimate", set: |p| p.starts = [1.0; 3] },
    Ablation { name: "2 places", set: |p| p.places = (2, 0.25) },
    Ablation { name: "no walls", set: |p| p.walls = (0, 0.3) },
    Ablation { name: "nowhere else", set: |p| p.elsewhere = (0, 0) },
    Ablation { name: "no valley is another", set: |p| p.strayed = (f64::INFINITY, f64::INFINITY) },
    Ablation { name: "plain effects have one number", set: |p| p.plain = (1, 9) },
    Ablation { name: "no pairs", set: |p| p.pairs = (0, 0, 0) },
    Ablation { name: "no kin", set: |p| p.kin = 0 },
    Ablation { name: "the first is measured beside errors of its own", set: |p| p.rivals = 1 },
];

/// A line of the table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// What was changed.
    pub name: String,
    /// Commit that was measured.
    pub commit: String,
    /// Cases that both answered.
    pub cases: usize,
    /// Sum of scores with the change, and as the search is.
    pub score: [f64; 2],
    /// Time of all these cases with the change, and as the search is [s].
    pub seconds: [f64; 2],
}

/// Every ablation against the search as it is, on the cases that both answered at the same commit.
pub fn lines(rows: &[Row]) -> Vec<Line> {
    let plain: Vec<&Row> = rows.iter().filter(|r| r.method == Method::Palpate.name()).collect();
    let mut out = Vec::new();
    for (k, a) in ALL.iter().enumerate() {
        let mine = rows.iter().filter(|r| r.method == Method::Ablated(k).name());
        let both: Vec<(&Row, &&Row)> =
            mine.filter_map(|r| Some((r, plain.iter().rev().find(|p| p.case == r.case && p.made.is_same(&r.made))?))).collect();
        let Some((last, _)) = both.last() else { continue };
        let both: Vec<_> = both.iter().filter(|(r, _)| r.made.is_same(&last.made)).collect();
        let sum = |of: fn(&Row) -> f64| [both.iter().map(|b| of(b.0)).sum(), both.iter().map(|b| of(b.1)).sum()];
        let (name, commit) = (a.name.into(), last.made.commit.clone());
        out.push(Line { name, commit, cases: both.len(), score: sum(|r| r.score), seconds: sum(|r| r.seconds) });
    }
    out
}

/// The table as `docs/suite.md` holds it.
pub fn markdown(lines: &[Line]) -> String {
    let head = "| search with | measured | cases | score, as it is | time, as it is [min] |\n| --- | --- | --- | --- | --- |\n";
    let row = |l: &Line| {
        let [score, time] = [l.score, l.seconds.map(|s| s / 60.0)];
        format!(
            "| {} | {} | {} | {:.1}, {:.1} | {:.1}, {:.1} |\n",
            l.name, l.commit, l.cases, score[0], score[1], time[0], time[1]
        )
    };
    lines.iter().fold(head.to_string(), |all, l| all + &row(l))
}

/// Prints the table, stores it, and writes it into its page.
///
/// # Errors
/// A file cannot be read or written.
pub fn write(rows: &[Row]) -> Result<(), String> {
    let lines = lines(rows);
    let text = markdown(&lines);
    println!("\n{text}");
    table::publish("docs/suite.md", "ablation", &lines, &text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ablation_changes_the_search_and_has_its_own_name() {
        for (k, a) in ALL.iter().enumerate() {
            let mut policy = Policy::default();
            (a.set)(&mut policy);
            assert_ne!(policy, Policy::default(), "{}", a.name);
            assert!(ALL[..k].iter().all(|b| b.name != a.name), "{}", a.name);
        }
    }
}
