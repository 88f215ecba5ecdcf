//! The judgement by prediction beside the F-test that it took the place of, on the cases that both answered.

use super::case::GROUPS;
use super::methods::Method;
use super::report::{group_of, latest};
use super::score::Row;
use crate::table;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Answers of the rule before, by the last commit that had it, to the same recordings.
const BEFORE: &str = "f-test-709412b";

/// A group.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// Group.
    pub group: String,
    /// Cases that both answered.
    pub cases: usize,
    /// Sum of the scores of the rule before, and of the rule now.
    pub score: [f64; 2],
    /// Cases that only the rule before has right, and only the rule now.
    pub only: [usize; 2],
}

/// Groups in their order.
pub fn lines(rows: &[Row]) -> Vec<Line> {
    let all = latest(rows);
    let before: BTreeMap<&str, f64> = all.iter().filter(|r| r.method == BEFORE).map(|r| (r.case.as_str(), r.score)).collect();
    let now: Vec<&Row> = all.into_iter().filter(|r| r.method == Method::Palpate.name()).collect();
    let groups = GROUPS.into_iter().chain(["faint"]).map(|group| {
        let of = now.iter().filter(|r| group_of(r) == group);
        let scores: Vec<[f64; 2]> = of.filter_map(|r| Some([*before.get(r.case.as_str())?, r.score])).collect();
        Line {
            group: group.into(),
            cases: scores.len(),
            score: [0, 1].map(|k| scores.iter().map(|s| s[k]).sum()),
            only: [0, 1].map(|k| scores.iter().filter(|s| s[k] == 1.0 && s[1 - k] < 1.0).count()),
        }
    });
    groups.filter(|l| l.cases > 0).collect()
}

/// The table as `docs/suite.md` holds it.
pub fn markdown(lines: &[Line]) -> String {
    let head =
        "| group | cases | F-test: score | now | only the F-test right | only now |\n| --- | --- | --- | --- | --- | --- |\n";
    let row = |l: &Line| {
        let [before, now] = l.score;
        format!("| {} | {} | {before:.1} | {now:.1} | {} | {} |\n", l.group, l.cases, l.only[0], l.only[1])
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
    table::publish("docs/suite.md", "rules", &lines, &text)
}
