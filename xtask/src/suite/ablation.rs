//! What the numbers of the search are worth: the suite with one of them changed, against the suite as it is.

use super::methods::Method;
use super::score::Row;
use crate::{rows, table};
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
    /// Commit that was measured, or the first and the last of several.
    pub commit: String,
    /// Cases that both answered.
    pub cases: usize,
    /// Sum of scores with the change, and as the search is.
    pub score: [f64; 2],
    /// Time of all these cases with the change, and as the search is [s].
    pub seconds: [f64; 2],
}

/// Every ablation against the search as it is, on the cases that the same code answered both ways: of each case the newest answers.
pub fn lines(rows: &[Row]) -> Vec<Line> {
    let of = |method: Method| rows.iter().filter(move |r| r.method == method.name());
    let mut out = Vec::new();
    for (k, a) in ALL.iter().enumerate() {
        let as_it_is = |r: &Row| of(Method::Palpate).rfind(|p| p.case == r.case && p.made.is_same(&r.made));
        let answered = of(Method::Ablated(k)).filter_map(|r| Some((r, as_it_is(r)?)));
        let both = rows::newest(answered, |(r, _)| r.case.as_str());
        if both.is_empty() {
            continue;
        }
        let sum = |of: fn(&Row) -> f64| [both.iter().map(|b| of(b.0)).sum(), both.iter().map(|b| of(b.1)).sum()];
        out.push(Line {
            name: a.name.into(),
            commit: rows::commits(both.iter().map(|b| b.0.made.commit.as_str())),
            cases: both.len(),
            score: sum(|r| r.score),
            seconds: sum(|r| r.seconds),
        });
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
    fn cases_of_several_commits_are_counted_once_each_where_both_searches_answered() {
        let row = |commit: &str, method: Method, case: &str, score: f64| -> Row {
            let text = format!(
                r#"{{"date":"2026-11-28","commit":"{commit}","code":"{commit}","method":"{}","case":"{case}","group":"strong",
                "simulator":"cells","strength":9,"hidden":[],"verdict":"adequate","named":[],"as_good":[],"rank":null,"score":{score},
                "size_error":null,"f1":null,"modulus_error":[0,0],"gap_closed":0,"missing":[0,0],"distance":[0,0,0],"points_at":null,
                "seconds":60,"sentence":""}}"#,
                method.name()
            );
            serde_json::from_str(&text).unwrap()
        };
        let (whole, changed) = (Method::Palpate, Method::Ablated(0));
        let rows = [
            row("aaaaaaa", whole, "ball", 1.0),
            row("aaaaaaa", changed, "ball", 0.0),
            row("aaaaaaa", whole, "beam", 1.0),
            row("aaaaaaa", changed, "beam", 1.0),
            // Again, and one that only the change has answered there.
            row("bbbbbbb", whole, "ball", 1.0),
            row("bbbbbbb", changed, "ball", 0.5),
            row("bbbbbbb", changed, "rod", 0.0),
        ];
        let line = Line {
            name: ALL[0].name.into(),
            commit: "aaaaaaa to bbbbbbb".into(),
            cases: 2,
            score: [1.5, 2.0],
            seconds: [120.0, 120.0],
        };
        assert_eq!(lines(&rows), [line]);
    }

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
