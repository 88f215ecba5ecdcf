//! Ties: what is named, and what explains the recording as well. The measurement that a diagnosis proposes next is made, of the same truth, and both
//! recordings are diagnosed together.

use super::answer::Answer;
use super::case::{Case, GROUPS};
use super::hidden::same;
use super::methods::{Method, options};
use super::score;
use crate::real::report::Made;
use crate::{rows, table};
use palpate::{Error, diagnose};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Duration;

/// What a diagnosis said.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Said {
    /// Verdict.
    pub verdict: String,
    /// What was named, in order.
    pub named: Vec<String>,
    /// Names that cannot be told from the first.
    pub as_good: Vec<String>,
    /// Names by how well they predict, the best first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ranking: Vec<String>,
    /// 1 right, ½ said to be as good as what is named first, 0 wrong.
    pub score: f64,
}

/// So many names of a ranking are kept.
const FIRST: usize = 6;

/// A case that was diagnosed, with the measurement that was made then.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// When, and by what.
    #[serde(flatten)]
    pub made: Made,
    /// Name of the case.
    pub case: String,
    /// Its group.
    pub group: String,
    /// What is hidden.
    pub hidden: Vec<String>,
    /// Of the recording alone.
    pub first: Said,
    /// The proposed measurement in words.
    pub next: Option<String>,
    /// The rivals that it is said to tell.
    pub from: Vec<String>,
    /// Of both recordings together, where one was proposed.
    pub then: Option<Said>,
    /// Time of both diagnoses [s].
    pub seconds: f64,
}

/// True where two names, of one effect or of several, mean the same physics.
fn alike(a: &str, b: &str) -> bool {
    let parts = |name: &str| name.split(" + ").map(String::from).collect::<Vec<_>>();
    let (a, b) = (parts(a), parts(b));
    let within = |a: &[String], b: &[String]| a.iter().all(|x| b.iter().any(|y| same(x, y)));
    within(&a, &b) && within(&b, &a)
}

/// Those of some names that are other physics than what a recording's diagnosis named. A rival of a later round stands beside a part of what is
/// named, so that a name counts as the same where all its parts are named.
fn rivals(said: &Said, names: &[String]) -> Vec<String> {
    let named = |name: &String| name.split(" + ").all(|part| said.named.iter().any(|n| same(n, part)));
    names.iter().filter(|n| !named(n)).cloned().collect()
}

impl Row {
    /// True where the recording alone left rivals of other physics, and a measurement was proposed that tells one of them.
    fn is_tie(&self) -> bool {
        self.is_open() && !rivals(&self.first, &self.from).is_empty()
    }

    /// True where other physics is as good as what is named first.
    fn is_open(&self) -> bool {
        !rivals(&self.first, &self.first.as_good).is_empty()
    }

    /// True where both recordings together name something, and nothing that the measurement is said to tell is as good: neither one of the rivals
    /// nor, where one of them is named now, what was named first.
    fn is_told(&self) -> bool {
        let named = self.first.named.join(" + ");
        let from = || self.from.iter().chain([&named]);
        let open = |then: &Said| rivals(then, &then.as_good).iter().any(|n| from().any(|r| alike(r, n)));
        self.is_tie() && self.then.as_ref().is_some_and(|then| then.verdict == "missing-effect" && !open(then))
    }

    /// True where that is right: what is hidden is what is named.
    fn is_settled(&self) -> bool {
        self.is_told() && self.then.as_ref().is_some_and(|then| then.score == 1.0)
    }
}

/// Diagnoses a case, makes the measurement that is proposed, and diagnoses both recordings.
///
/// # Errors
/// Something cannot be recorded or diagnosed.
pub fn measure(made: &Made, c: &Case, folder: &Path, budget: Duration, say: &mut (dyn FnMut(&str) + Send)) -> Result<Row, Error> {
    let truth = c.truth()?;
    let said = |a: &Answer| {
        let row = score::score(made, Method::Palpate.name(), c, &truth, a);
        let ranking = a.ranking.iter().take(FIRST).cloned().collect();
        Said { verdict: row.verdict, named: row.named, as_good: row.as_good, ranking, score: row.score }
    };
    let recorded = c.record(folder)?;
    let other = recorded.other.as_ref();
    let clock = rows::processor_clock();
    let found = diagnose(std::slice::from_ref(&recorded.seen), other, options(budget, &clock, say))?;
    let proposed = found.diagnosis.effects.iter().find(|e| e.accepted).and_then(|e| e.separated_by.clone());
    let mut row = Row {
        made: made.clone(),
        case: c.name.clone(),
        group: c.group.clone(),
        hidden: c.hidden.iter().map(|h| h.what.clone()).collect(),
        first: said(&Answer::of(&c.name, &found)),
        next: proposed.as_ref().map(|p| p.measurement.clone()),
        from: proposed.as_ref().map(|p| p.from.clone()).unwrap_or_default(),
        then: None,
        seconds: clock.elapsed().as_secs_f64(),
    };
    if let Some(way) = proposed.filter(|_| row.is_tie()).map(|p| p.way) {
        say("the proposed measurement");
        let next = c.next(&way, folder)?;
        // Two recordings cost twice as much.
        let clock = rows::processor_clock();
        let found = diagnose(&[recorded.seen.clone(), next], other, options(2 * budget, &clock, say))?;
        row.then = Some(said(&Answer::of(&c.name, &found)));
        row.seconds += clock.elapsed().as_secs_f64();
    }
    row.seconds = (10.0 * row.seconds).round() / 10.0;
    Ok(row)
}

/// One case on one line.
pub fn line(r: &Row) -> String {
    let said = |s: &Said| {
        let as_good = if s.as_good.is_empty() { String::new() } else { format!(" (as good: {})", s.as_good.join(", ")) };
        format!("{} {}{as_good}", s.verdict, s.named.join(" + "))
    };
    let next = match (&r.next, &r.then) {
        (Some(next), Some(then)) => format!("; {next}, against {}: {}", r.from.join(", "), said(then)),
        _ if r.is_open() => "; no measurement is proposed".into(),
        _ => String::new(),
    };
    let end = match (r.is_open(), r.is_settled()) {
        (false, _) => "no tie",
        (true, false) => "open",
        (true, true) => "settled",
    };
    format!("{}{next}, {:.1} s, {end}", said(&r.first), r.seconds)
}

/// A line of the table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// Group.
    pub group: String,
    /// Commits that were measured.
    pub commit: String,
    /// Ties for which a measurement was proposed.
    pub ties: usize,
    /// Those in which what is hidden is named or as good.
    pub among: usize,
    /// Those in which both recordings together leave none of the rivals that the measurement is said to tell.
    pub told: usize,
    /// Those in which they name what is hidden besides.
    pub settled: usize,
}

/// The newest row of every case, counted by group, and together.
pub fn lines(all: &[Row]) -> Vec<Line> {
    let newest = rows::newest(all.iter(), |r| r.case.as_str());
    let line = |group: &str, of: Vec<&Row>| {
        let count = |f: fn(&Row) -> bool| of.iter().filter(|r| f(r)).count();
        Line {
            group: group.into(),
            commit: rows::commits(of.iter().map(|r| r.made.commit.as_str())),
            ties: of.len(),
            among: count(|r| r.first.score > 0.0),
            told: count(Row::is_told),
            settled: count(Row::is_settled),
        }
    };
    let ties = |group: Option<&str>| {
        newest.iter().copied().filter(|r| r.is_tie() && group.is_none_or(|g| r.group == g)).collect::<Vec<_>>()
    };
    let by_group = GROUPS.iter().map(|g| line(g, ties(Some(g))));
    by_group.chain([line("all", ties(None))]).filter(|l| l.ties > 0).collect()
}

/// The table as `docs/suite.md` holds it.
pub fn markdown(lines: &[Line]) -> String {
    let head = "| group | measured | ties | hidden effect among them | told apart | and rightly |\n| --- | --- | --- | --- | --- | --- |\n";
    let row = |l: &Line| {
        let share = |n: usize| format!("{n} ({:.0} %)", 100.0 * n as f64 / l.ties as f64);
        format!("| {} | {} | {} | {} | {} | {} |\n", l.group, l.commit, l.ties, l.among, share(l.told), share(l.settled))
    };
    lines.iter().fold(head.to_string(), |all, l| all + &row(l))
}

/// Prints the table, stores it, and writes it into its page.
///
/// # Errors
/// A file cannot be read or written.
pub fn write(all: &[Row]) -> Result<(), String> {
    let lines = lines(all);
    let text = markdown(&lines);
    println!("\n{text}");
    table::publish("docs/suite.md", "settle", &lines, &text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec3};
    use palpate_diagnose::Way;

    fn said(named: &[&str], as_good: &[&str], score: f64) -> Said {
        let all = |names: &[&str]| names.iter().map(|n| n.to_string()).collect();
        Said { verdict: "missing-effect".into(), named: all(named), as_good: all(as_good), ranking: Vec::new(), score }
    }

    fn row(first: Said, from: &[&str], then: Option<Said>) -> Row {
        Row {
            made: Made::default(),
            case: format!("{:?} {from:?} {then:?}", first.named),
            group: "weak".into(),
            hidden: vec!["depth-scale".into()],
            first,
            next: Some("the camera elsewhere".into()),
            from: from.iter().map(|n| n.to_string()).collect(),
            then,
            seconds: 1.0,
        }
    }

    #[test]
    fn a_tie_is_told_when_no_rival_is_left_and_settled_when_that_is_right() {
        let tie = || said(&["depth-bias"], &["depth-scale"], 0.5);
        let of = |then: Option<Said>| row(tie(), &["depth-scale"], then);
        let right = of(Some(said(&["depth-scale"], &[], 1.0)));
        let wrong = of(Some(said(&["depth-bias"], &[], 0.0)));
        let open = of(Some(said(&["depth-scale"], &["depth-bias"], 1.0)));
        let same = of(Some(said(&["depth-bias"], &["depth-scale"], 0.5)));
        let lost = of(Some(Said { verdict: "unexplained".into(), ..said(&["depth-bias"], &[], 0.0) }));
        assert!(right.is_tie() && right.is_told() && right.is_settled());
        assert!(wrong.is_told() && !wrong.is_settled());
        // Who was named first is a rival of whoever is named now.
        assert!(!open.is_told() && !same.is_told() && !lost.is_told());
        assert!(!of(None).is_told());
        let lines = lines(&[right, wrong, open, same, lost]);
        assert_eq!((lines[0].ties, lines[0].among, lines[0].told, lines[0].settled), (5, 5, 2, 1));
        // Also where the rival is a part of what was named.
        let part =
            row(said(&["clamp-edge", "inclusion"], &["two-part-stiffness"], 0.5), &["inclusion", "two-part-stiffness"], None);
        assert!(!Row { then: Some(said(&["two-part-stiffness"], &["inclusion"], 1.0)), ..part }.is_told());
        assert_eq!(lines[1].group, "all");
    }

    #[test]
    fn two_names_of_the_same_physics_are_no_tie() {
        assert!(!row(said(&["uniform-force"], &["gravity"], 1.0), &["gravity"], None).is_tie());
        assert!(
            !row(said(&["depth-bias", "gravity"], &["depth-bias + uniform-force"], 1.0), &["depth-bias + uniform-force"], None)
                .is_tie()
        );
        assert!(
            row(said(&["depth-bias", "gravity"], &["depth-scale + gravity"], 1.0), &["depth-scale + gravity"], None).is_tie()
        );
        assert!(!row(said(&["tether"], &["point-mass"], 1.0), &[], None).is_tie());
    }

    #[test]
    fn the_next_recording_is_made_as_it_was_proposed() {
        let folder = tempfile::tempdir().unwrap();
        let list = super::super::list::List::read().unwrap().cases().unwrap();
        let of = |name: &str| list.iter().find(|c| c.name == name).unwrap();
        let turn = DQuat::from_axis_angle(DVec3::X, std::f64::consts::FRAC_PI_2);
        let way = Way { spin: DVec3::new(0.0, 0.0, 0.5), turn, ..Way::default() };
        for name in ["gravity plate strong", "gravity rod weak"] {
            let c = of(name);
            let (before, next) = (c.setup().unwrap(), c.next(&way, &folder.path().join(name)).unwrap());
            let stated = before.truth(false).unwrap();
            assert!((next.scene().gravity - turn * stated.gravity).length() < 1e-9, "{name}");
            assert!((next.scene().initial.angular_velocity - stated.initial.angular_velocity - way.spin).length() < 1e-9);
        }
        let setup = of("depth-bias ball weak").setup().unwrap();
        let here = setup.cameras().unwrap()[0].world_from_camera;
        let there = glam::DAffine3 { translation: here.translation + DVec3::X, ..here };
        let moved = setup.moved(&Way { cameras: vec![(0, there)], ..Way::default() });
        assert_eq!(moved.cameras().unwrap()[0].world_from_camera, there);
    }
}
