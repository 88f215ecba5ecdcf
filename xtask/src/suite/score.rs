//! How an answer is scored against the truth, and the row that is kept of it.

use super::answer::Answer;
use super::case::{Case, Truth};
use crate::real::report::Made;
use serde::{Deserialize, Serialize};

/// One method's answer to one case, scored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// When, and by what.
    #[serde(flatten)]
    pub made: Made,
    /// Name of the method.
    pub method: String,
    /// Name of the case.
    pub case: String,
    /// Its group.
    pub group: String,
    /// Who simulated it.
    pub simulator: super::case::Simulator,
    /// Strength of what is hidden [σ]; 0 for nothing.
    pub strength: f64,
    /// What is hidden.
    pub hidden: Vec<String>,
    /// Verdict.
    pub verdict: String,
    /// What was named, in order.
    pub named: Vec<String>,
    /// Names that cannot be told from the first.
    pub as_good: Vec<String>,
    /// Place of the right name (of several: of the last of them) in the ranking, from 1; `None` where it is not in it or nothing has a name.
    pub rank: Option<usize>,
    /// 1 right, ½ said to be as good as what is named first, 0 wrong.
    pub score: f64,
    /// Relative error of the hidden numbers, where they are stated.
    pub size_error: Option<f64>,
    /// F1 over regions × time.
    pub f1: Option<f64>,
    /// Relative error of Young's modulus before and after.
    pub modulus_error: [Option<f64>; 2],
    /// Share of the gap closed on data left out.
    pub gap_closed: Option<f64>,
    /// How much better data left out are predicted beside a discrepancy, before and after [nats].
    #[serde(default)]
    pub missing: Option<[f64; 2]>,
    /// Distance of measurement and model before and after, and what noise and discretisation explain [m].
    pub distance: Option<[f64; 3]>,
    /// Cosine between the pull that the answer states and the direction to a magnet.
    pub points_at: Option<f64>,
    /// Time of the method [s].
    pub seconds: f64,
    /// The answer in words, cut short.
    pub sentence: String,
}

/// Letters that are kept of a sentence.
const WORDS: usize = 240;

/// Scores an answer.
pub fn score(made: &Made, method: &str, case: &Case, truth: &Truth, a: &Answer) -> Row {
    let named: Vec<String> = a.named.iter().map(|n| n.kind.clone()).collect();
    let right = |k: usize, name: &String| truth.names[k].contains(name);
    let place = |k: usize| a.ranking.iter().position(|n| right(k, n)).map(|p| p + 1);
    let ranks: Option<Vec<usize>> = (0..truth.names.len()).map(place).collect();
    let points = if a.verdict != truth.verdict {
        0.0
    } else if truth.names.is_empty() {
        1.0
    } else {
        // Of so many things hidden, all must be among as many named first.
        let first = &named[..named.len().min(truth.names.len())];
        match (0..truth.names.len()).all(|k| first.iter().any(|n| right(k, n))) {
            true => 1.0,
            false if truth.names.len() == 1 && a.as_good.iter().any(|n| right(0, n)) => 0.5,
            false => 0.0,
        }
    };
    let error = |v: Option<f64>| v.map(|v| (v / truth.modulus - 1.0).abs());
    let points_at = a.pull.zip(case.pole()).map(|(pull, to)| glam::DVec3::from(pull).normalize_or_zero().dot(to));
    Row {
        made: made.clone(),
        method: method.into(),
        case: case.name.clone(),
        group: case.group.clone(),
        simulator: case.simulator,
        strength: case.strength.unwrap_or(0.0),
        hidden: case.hidden.iter().map(|h| h.what.clone()).collect(),
        verdict: a.verdict.clone(),
        rank: ranks.filter(|r| !r.is_empty()).and_then(|r| r.into_iter().max()),
        score: points,
        size_error: size_error(truth, a),
        f1: if a.map.is_empty() { None } else { truth.bins.f1(&truth.acts, &a.map) },
        modulus_error: a.modulus.map(error),
        gap_closed: a.gap_closed,
        missing: a.missing,
        distance: a.distance,
        points_at,
        seconds: (10.0 * a.seconds).round() / 10.0,
        sentence: a.sentence.chars().take(WORDS).collect(),
        as_good: a.as_good.clone(),
        named,
    }
}

/// Root mean square error of the hidden numbers over their size, of what was named by its own name; a number that is not stated counts as
/// absent.
fn size_error(truth: &Truth, a: &Answer) -> Option<f64> {
    let stated = |kind: &str, path: &str| {
        let of = a.named.iter().filter(|n| n.kind == kind).flat_map(|n| &n.numbers);
        of.filter(|n| n.0 == path).map(|n| n.1).next()
    };
    let off = |sign: f64| {
        let (mut off, mut size) = (0.0, 0.0);
        for (k, n) in &truth.numbers {
            let kind = &truth.names[*k][0];
            // What is named without numbers states no size.
            if !a.named.iter().any(|e| e.kind == *kind && !e.numbers.is_empty()) {
                continue;
            }
            let value = stated(kind, &n.path).map_or(n.absent, |v| sign * v);
            off += ((value - n.truth) / n.scale).powi(2);
            size += ((n.truth - n.absent) / n.scale).powi(2);
        }
        (size > 0.0).then(|| f64::sqrt(off / size))
    };
    let straight = off(1.0)?;
    Some(if truth.mirrored { off(-1.0).map_or(straight, |m| m.min(straight)) } else { straight })
}

#[cfg(test)]
mod tests {
    use super::super::answer::Named;
    use super::super::case::{Put, Simulator};
    use super::*;

    fn case(group: &str, hidden: &[&str]) -> Case {
        let put = |what: &&str| Put { what: what.to_string(), aim: Some(10.0), amplitude: Some(1.0) };
        Case {
            name: "a case".into(),
            group: group.into(),
            scene: "rod".into(),
            simulator: Simulator::Tetrahedra,
            seed: 1,
            held_out: true,
            strength: Some(10.0),
            acts: None,
            hidden: hidden.iter().map(put).collect(),
        }
    }

    fn answer(verdict: &str, named: &[(&str, &[(&str, f64)])], as_good: &[&str]) -> Answer {
        let one = |(kind, numbers): &(&str, &[(&str, f64)])| Named {
            kind: kind.to_string(),
            numbers: numbers.iter().map(|n| (n.0.to_string(), n.1)).collect(),
        };
        let names = named.iter().map(|n| n.0).chain(as_good.iter().copied());
        Answer {
            verdict: verdict.into(),
            named: named.iter().map(one).collect(),
            ranking: names.map(String::from).collect(),
            as_good: as_good.iter().map(|n| n.to_string()).collect(),
            ..Answer::default()
        }
    }

    fn scored(c: &Case, a: &Answer) -> Row {
        score(&Made::default(), "test", c, &c.truth().unwrap(), a)
    }

    #[test]
    fn one_hidden_effect_is_right_named_first_and_half_right_as_good() {
        let c = case("strong", &["point-mass"]);
        let right = scored(&c, &answer("missing-effect", &[("point-mass", &[("mass", 0.012)])], &[]));
        assert_eq!((right.score, right.rank), (1.0, Some(1)));
        // The truth is 10 g.
        assert!((right.size_error.unwrap() - 0.2).abs() < 1e-9);
        let half = scored(&c, &answer("missing-effect", &[("tether", &[])], &["gravity", "point-mass"]));
        assert_eq!((half.score, half.rank, half.size_error), (0.5, Some(3), None));
        let wrong = scored(&c, &answer("missing-effect", &[("tether", &[]), ("point-mass", &[])], &[]));
        assert_eq!((wrong.score, wrong.rank), (0.0, Some(2)));
        assert_eq!(scored(&c, &answer("unexplained", &[], &["point-mass"])).score, 0.0);
        let same = case("strong", &["uniform-force"]);
        assert_eq!(scored(&same, &answer("missing-effect", &[("gravity", &[])], &[])).score, 1.0);
    }

    #[test]
    fn of_a_pair_both_must_be_named_and_what_is_unknown_must_be_said_to_be() {
        let c = case("pair", &["point-mass", "time-offset"]);
        let both = [("release-time", [].as_slice()), ("point-mass", [].as_slice())];
        let row = scored(&c, &answer("missing-effect", &both, &[]));
        assert_eq!((row.score, row.rank), (1.0, Some(2)));
        assert_eq!(scored(&c, &answer("missing-effect", &both[..1], &["point-mass"])).score, 0.0);
        let c = case("outside", &["gusts"]);
        assert_eq!(scored(&c, &answer("unexplained", &[], &[])).score, 1.0);
        assert_eq!(scored(&c, &answer("missing-effect", &[("uniform-force", &[])], &[])).score, 0.0);
        let c = case("null", &[]);
        assert_eq!(
            (scored(&c, &answer("adequate", &[], &[])).score, scored(&c, &answer("undecided", &[], &[])).score),
            (1.0, 0.0)
        );
    }

    #[test]
    fn halves_may_be_told_the_other_way_round() {
        let c = case("strong", &["two-part-stiffness"]);
        let row = scored(&c, &answer("missing-effect", &[("two-part-stiffness", &[("ratio", 0.5)])], &[]));
        assert!(row.size_error.unwrap() < 1e-9);
    }
}
