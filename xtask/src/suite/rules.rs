//! The judgement by prediction beside the F-test that it took the place of, on the cases that both answered.

use super::case::GROUPS;
use super::methods::Method;
use super::report::{group_of, latest};
use super::score::Row;
use crate::table;
use serde::{Deserialize, Serialize};

/// Answers of the rule before, at the last commit that had it.
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
    let of = |method: &str, case: &str| all.iter().find(|r| r.method == method && r.case == case).copied();
    let both: Vec<(&Row, &Row)> =
        all.iter().filter_map(|r| Some((of(BEFORE, &r.case)?, *r))).filter(|(_, r)| r.method == Method::Palpate.name()).collect();
    let groups = GROUPS.into_iter().chain(["faint"]).map(|group| {
        let both: Vec<&(&Row, &Row)> = both.iter().filter(|(_, now)| group_of(now) == group).collect();
        let only = |a: fn(&(&Row, &Row)) -> [f64; 2]| both.iter().filter(|b| a(b)[0] == 1.0 && a(b)[1] < 1.0).count();
        Line {
            group: group.into(),
            cases: both.len(),
            score: [both.iter().map(|b| b.0.score).sum(), both.iter().map(|b| b.1.score).sum()],
            only: [only(|b| [b.0.score, b.1.score]), only(|b| [b.1.score, b.0.score])],
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
    println!("\n{}", markdown(&lines));
    println!("written to {}", table::save("rules", &lines)?.display());
    table::replace("docs/suite.md", "rules", &markdown(&lines))
}
