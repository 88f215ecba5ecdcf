//! Right names, honest silence, and a false-alarm rate that is the stated one.

use super::bench::{Bench, NOISE};
use crate::cells::Cells;
use crate::change::candidates;
use crate::diagnosis::{Diagnosis, Verdict};
use crate::judgement::density::{Blocks, Linear};
use crate::judgement::prior::Prior;
use crate::judgement::rule::Judged;
use crate::judgement::stack::{SIZES, stacked};
use crate::laboratory::{LabError, Laboratory};
use crate::linear::dot;
use crate::noise::design_effect;
use crate::null::Frame;
use crate::{Options, diagnose};
use palpate_model::effects::{ALL, find};

#[test]
fn hidden_effects_are_named_and_the_gap_closes() {
    for kind in ["coulomb-friction", "uniform-force", "air-drag"] {
        let pattern = Bench::first_pattern(kind);
        // Upwards: the amplitudes of friction and drag may not be negative, and residuals are model minus truth.
        let mut bench = Bench::new(5, &[(&pattern, -1.5 * NOISE)], false);
        let baseline = bench.baseline();
        let d = diagnose(&mut bench, baseline, &Options::default()).unwrap();
        assert_eq!(d.verdict, Verdict::MissingEffect, "{kind}: {}", d.sentence());
        let first = &d.effects[0];
        assert_eq!(first.kind, kind, "{}", d.sentence());
        // Noise leaves 1/√5760 of 1 mm on the amplitude.
        assert!((first.parameters[0].1 / (1.5 * NOISE) - 1.0).abs() < 0.05, "{:?}", first.parameters);
        assert!(d.gap_closed > 0.9 && first.held_out_gain > 0.9, "{} {}", d.gap_closed, first.held_out_gain);
        assert!(d.places.iter().map(|p| p.share).sum::<f64>() > 0.5 && d.missing.0 > 0.0);
        assert!(d.effects.iter().filter(|e| e.accepted).count() == 1);
    }
}

#[test]
fn two_hidden_effects_are_both_named() {
    let (a, b) = (Bench::first_pattern("coulomb-friction"), Bench::first_pattern("depth-bias"));
    let mut bench = Bench::new(8, &[(&a, -2.0 * NOISE), (&b, 1.5 * NOISE)], false);
    let baseline = bench.baseline();
    let d = diagnose(&mut bench, baseline, &Options::default()).unwrap();
    let kinds: Vec<&str> = d.effects.iter().filter(|e| e.accepted).map(|e| e.kind.as_str()).collect();
    assert!(kinds.contains(&"coulomb-friction") && kinds.contains(&"depth-bias"), "{}", d.sentence());
    // In one round, as a pair: neither alone explains the recording.
    let pairs = |t: &&crate::diagnosis::Tried| t.kind.contains(" + ") && t.held_out_gain.is_some();
    let pair = d.tried.iter().find(pairs).unwrap_or_else(|| panic!("{:?}", d.tried));
    assert!(pair.round == 1 && pair.kind.contains("coulomb-friction") && pair.kind.contains("depth-bias"), "{pair:?}");
    // What the pair is, with something beside it, is no other explanation.
    assert!(d.effects.iter().all(|e| e.indistinguishable_from.is_empty()), "{:?}", d.effects);
}

#[test]
fn a_plain_effect_and_a_freer_one_are_both_found() {
    let drag = Bench::first_pattern("air-drag");
    let mut bench = Bench::new(8, &[(&drag, -1.5 * NOISE), ("camera-pose 1 []", 1.5 * NOISE)], false);
    let baseline = bench.baseline();
    let d = diagnose(&mut bench, baseline, &Options::default()).unwrap();
    let mut kinds: Vec<&str> = d.effects.iter().filter(|e| e.accepted).map(|e| e.kind.as_str()).collect();
    kinds.sort_unstable();
    assert_eq!(kinds, ["air-drag", "camera-pose"], "{}", d.sentence());
}

#[test]
fn what_no_effect_explains_is_called_unexplained() {
    let mut bench = Bench::new(6, &[("magnet", 2.0 * NOISE)], false);
    let baseline = bench.baseline();
    let d = diagnose(&mut bench, baseline, &Options::default()).unwrap();
    assert_eq!(d.verdict, Verdict::Unexplained, "{}", d.sentence());
    assert!(d.effects.iter().all(|e| !e.accepted) && d.slack.is_some());
    assert_eq!(d.model, d.baseline);
    assert!(d.sentence().contains("; a free load would explain "), "{}", d.sentence());
    // Without time for the slack the answer says that it is missing.
    bench.no_slack = true;
    let baseline = bench.baseline();
    let hurried = diagnose(&mut bench, baseline, &Options::default()).unwrap();
    assert_eq!((hurried.verdict, &hurried.slack), (Verdict::Unexplained, &None));
    assert!(hurried.not_tried.iter().any(|n| n == "slack, what any load could explain: no time left"), "{:?}", hurried.not_tried);
}

#[test]
fn nothing_hidden_is_adequate() {
    // A part of the discretisation's field is no discrepancy.
    let mut bench = Bench::new(7, &[("grid", 2e-4)], false);
    let baseline = bench.baseline();
    let d = diagnose(&mut bench, baseline, &Options::default()).unwrap();
    assert_eq!(d.verdict, Verdict::Adequate, "{}", d.sentence());
    assert!(d.effects.is_empty() && d.places.is_empty());
    assert!((d.before.rms / d.before.noise - 1.0).abs() < 0.05, "{:?}", d.before);
}

#[test]
fn what_is_missing_does_not_hide_behind_the_discretisation() {
    // It looks like what a finer grid changes, only that it is twenty times as large.
    let mut bench = Bench::new(7, &[("grid", 4e-3)], false);
    let baseline = bench.baseline();
    let d = diagnose(&mut bench, baseline, &Options::default()).unwrap();
    assert!(!matches!(d.verdict, Verdict::Adequate), "{}", d.sentence());
    assert!(d.remains, "{:?}", d.missing);
}

#[test]
fn what_bends_to_the_grid_does_not_leave_the_right_effect_behind() {
    let mut bench = Bench::new(5, &[(&Bench::first_pattern("air-drag"), -1.5 * NOISE), ("grid", 3.0 * NOISE)], false);
    bench.grid = -3.0 * NOISE;
    let baseline = bench.baseline();
    let d = diagnose(&mut bench, baseline, &Options::default()).unwrap();
    assert_eq!((d.verdict, d.effects[0].kind.as_str()), (Verdict::MissingEffect, "air-drag"), "{}", d.sentence());
}

#[test]
fn an_answer_says_what_there_was_no_time_for() {
    let (a, b) = (Bench::first_pattern("uniform-force"), Bench::first_pattern("depth-bias"));
    let answer = |second: f64| {
        let mut bench = Bench::new(9, &[(&a, -2.0 * NOISE), (&b, second * NOISE)], false);
        bench.slow = vec!["depth-bias"];
        let baseline = bench.baseline();
        diagnose(&mut bench, baseline, &Options::default()).unwrap()
    };
    let d = answer(0.15);
    assert_eq!((d.verdict, d.effects[0].kind.as_str()), (Verdict::MissingEffect, "uniform-force"), "{}", d.sentence());
    let end = "The search ended before it had tried to the end: depth-bias.";
    assert!(d.sentence().ends_with(end), "{}", d.sentence());
    // Where something remains beside what was found, what was not tried may be it.
    let d = answer(0.25);
    assert_eq!((d.verdict, d.effects[0].kind.as_str()), (Verdict::Undecided, "uniform-force"), "{}", d.sentence());
    assert!(d.remains && d.sentence().contains("the time was over before every known effect was tried"), "{}", d.sentence());
    assert!(d.sentence().contains("Not yet fitted, by what sensitivities promise: depth-bias"), "{}", d.sentence());
}

#[test]
fn a_candidate_that_cannot_follow_a_second_recording_is_no_explanation_and_no_error() {
    let hidden = Bench::first_pattern("uniform-force");
    let answer = |lost| {
        let mut bench = Bench::new(9, &[(&hidden, -2.0 * NOISE)], false);
        bench.lost = lost;
        let baseline = bench.baseline();
        diagnose(&mut bench, baseline, &Options::default()).unwrap()
    };
    let all = answer(Some("air-drag"));
    assert_eq!((all.verdict, all.effects[0].kind.as_str()), (Verdict::MissingEffect, "uniform-force"), "{}", all.sentence());
    let without = answer(Some("uniform-force"));
    assert!(without.not_tried.iter().any(|t| t == "uniform-force: the step did not converge"), "{:?}", without.not_tried);
    assert!(without.effects.iter().all(|e| e.kind != "uniform-force"), "{}", without.sentence());
}

#[test]
fn a_wall_is_tried_for_what_it_does_from_the_first_round_on() {
    let law = &ALL[find("second-plane").unwrap()];
    // Small amplitudes tell nothing of a wall: it is scored at its typical size, and this one stands there.
    let mut bench = Bench::new(5, &[(&Bench::first_pattern("second-plane"), -law.params[0].typical)], false);
    let baseline = bench.baseline();
    let d = diagnose(&mut bench, baseline, &Options::default()).unwrap();
    let tried = d.tried.iter().find(|t| t.kind == "second-plane").unwrap();
    assert!(tried.round == 1 && tried.promised > 0.3 && tried.held_out_gain.is_some(), "{tried:?}");
    assert_eq!((d.verdict, d.effects[0].kind.as_str()), (Verdict::MissingEffect, "second-plane"), "{}", d.sentence());
}

#[test]
fn an_answer_that_surely_leaves_something_says_so_and_is_none_where_time_cut_the_search_short() {
    let hidden = Bench::first_pattern("uniform-force");
    let answer = |slow| {
        let mut bench = Bench::new(6, &[(&hidden, -10.0 * NOISE), ("magnet", 4.0 * NOISE)], false);
        bench.slow = slow;
        let baseline = bench.baseline();
        diagnose(&mut bench, baseline, &Options::default()).unwrap()
    };
    let whole = answer(vec![]);
    let kept: Vec<&str> = whole.effects.iter().filter(|e| e.accepted).map(|e| e.kind.as_str()).collect();
    // Nothing known explains the magnet, and yet the force stays: without it numbers would make up for it.
    assert_eq!((whole.verdict, kept.as_slice()), (Verdict::Unexplained, ["uniform-force"].as_slice()), "{}", whole.sentence());
    assert!(whole.model.changes.len() == 1 && whole.after.rms < 0.2 * whole.before.rms, "{}", whole.sentence());
    assert!(whole.sentence().contains(". The nearest that is known: "), "{}", whole.sentence());
    // Of what the force leaves, which is the magnet's: a load would explain all of the force.
    let share = whole.slack.as_ref().map_or(1.0, |s| s.share);
    assert!(share < 0.8 && whole.sentence().contains(" A free load would explain "), "{share}: {}", whole.sentence());
    // What there was no time for may explain it better.
    let hurried = answer(vec!["depth-bias"]);
    assert_eq!(hurried.verdict, Verdict::Undecided, "{}", hurried.sentence());
    assert!(hurried.sentence().contains("the known effect that helps most, uniform-force ("), "{}", hurried.sentence());
}

#[test]
fn where_the_baseline_went_astray_candidates_start_from_home_first() {
    let mut bench = Bench::new(5, &[(&Bench::first_pattern("uniform-force"), -1.5 * NOISE)], false);
    let mut baseline = bench.baseline();
    // Fifty times the size of a change that matters, where fits stay where they are, and time for three candidates.
    baseline.values[0] = 0.05;
    (bench.marsh, bench.iterations) = (0.02, 27);
    let d = diagnose(&mut bench, baseline, &Options::default()).unwrap();
    let (first, stiffness) = (&d.effects[0], d.model.values[0]);
    assert_eq!((d.verdict, first.kind.as_str()), (Verdict::MissingEffect, "uniform-force"), "{}", d.sentence());
    assert!(stiffness.abs() < NOISE, "the stiffness is back: {stiffness}");
}

#[test]
fn who_stops_before_the_noise_is_known_is_told_no_more_than_that() {
    let mut bench = Bench::new(9, &[(&Bench::first_pattern("uniform-force"), -2.0 * NOISE)], false);
    let baseline = bench.baseline();
    bench.stopped = true;
    let d = diagnose(&mut bench, baseline, &Options::default()).unwrap();
    assert_eq!(d.verdict, Verdict::Undecided);
    assert!(d.interrupted && d.unsure.is_some() && d.effects.is_empty());
    assert!(d.sentence().starts_with("Nothing is decided: the diagnosis was interrupted"), "{}", d.sentence());
}

/// Kinds that an answer lists, fitted or not.
fn listed(d: &Diagnosis) -> std::collections::BTreeSet<String> {
    let named = d.tried.iter().map(|t| t.kind.as_str());
    named.chain(d.not_tried.iter().filter_map(|n| n.split(": ").next())).map(String::from).collect()
}

#[test]
fn whatever_stops_it_there_is_a_ranking_from_the_first_residuals_on() {
    let hidden = Bench::first_pattern("uniform-force");
    let kinds = candidates(Bench::new(9, &[], false).setting()).iter().map(|c| c.kind().to_string()).collect();
    for why in [LabError::NoTime, LabError::Interrupted] {
        let mut cut = 0;
        for simulations in [0, 1, 2, 4, 8, 9, 10, 11, 12, 13, 14, 20, 40] {
            let mut bench = Bench::new(9, &[(&hidden, -2.0 * NOISE)], false);
            (bench.unfitted, bench.limit) = (true, Some((simulations, why.clone())));
            let start = bench.start();
            let answer = diagnose(&mut bench, start, &Options::default());
            if simulations == 0 {
                assert!(answer.is_err(), "not even the starting model is known");
                continue;
            }
            let d = answer.unwrap();
            let said = d.sentence();
            assert_eq!(d.verdict, Verdict::Undecided, "{simulations}: {said}");
            assert_eq!(d.interrupted, matches!(why, LabError::Interrupted), "{simulations}: {said}");
            let all: std::collections::BTreeSet<String> = listed(&d);
            assert!(all.is_superset(&kinds), "{simulations}: {all:?}");
            let early = said.starts_with("Nothing is decided: the baseline's fit was cut short: the search was stopped after ");
            cut += usize::from(early);
            // One simulation tells of eight candidates.
            assert!(simulations < 2 || d.not_yet_fitted().len() >= 8, "{simulations}: {said}");
            if simulations > 10 {
                let best = d.not_yet_fitted()[0];
                assert_eq!(best.kind, "uniform-force", "{simulations}: {said}");
                assert!(best.promised > 0.8 && d.movements.iter().any(|m| m.candidate == best.kind && !m.fitted));
            }
        }
        // Each of its three iterations, and those in which nothing is left for it.
        assert!(cut >= 3, "{cut}");
    }
}

#[test]
fn a_fit_of_the_baseline_on_the_way_changes_nothing_where_there_is_time() {
    let hidden = [(Bench::first_pattern("uniform-force"), -1.5 * NOISE)];
    let hidden: Vec<(&str, f64)> = hidden.iter().map(|(n, x)| (n.as_str(), *x)).collect();
    let mut bench = Bench::new(5, &hidden, false);
    let baseline = bench.baseline();
    let fitted = diagnose(&mut bench, baseline, &Options::default()).unwrap();
    (bench.unfitted, bench.limit) = (true, None);
    let start = bench.start();
    let whole = diagnose(&mut bench, start, &Options::default()).unwrap();
    assert_eq!((whole.verdict, whole.effects.len()), (Verdict::MissingEffect, fitted.effects.len()), "{}", whole.sentence());
    assert_eq!(whole.tried.iter().map(|t| &t.kind).collect::<Vec<_>>(), fitted.tried.iter().map(|t| &t.kind).collect::<Vec<_>>());
    assert!(whole.tried.iter().all(|t| !t.open) && whole.not_tried.is_empty(), "{:?}", whole.not_tried);
}

#[test]
fn what_is_named_is_said_to_move_the_free_numbers() {
    // A force, as the second pattern of which a share is what stiffness does.
    let force = Bench::first_pattern("uniform-force");
    let mut bench = Bench::new(5, &[(&force, -20.0 * NOISE)], false);
    let mut baseline = bench.baseline();
    baseline.errors = vec![Some(1e-5); baseline.values.len()];
    let d = diagnose(&mut bench, baseline, &Options::default()).unwrap();
    assert_eq!((d.verdict, d.effects[0].kind.as_str()), (Verdict::MissingEffect, "uniform-force"), "{}", d.sentence());
    let moved = &d.movements[0];
    let k = d.baseline.numbers.iter().position(|n| n.path == moved.path).unwrap();
    assert!(moved.fitted && moved.before == d.baseline.values[k] && moved.after == d.model.values[k], "{moved:?}");
    let farthest = (0..2).map(|k| (d.model.values[k] - d.baseline.values[k]).abs()).fold(0.0, f64::max);
    assert!((moved.after - moved.before).abs() == farthest && d.sentence().contains(&moved.sentence()), "{}", d.sentence());
}

#[test]
fn an_adequate_answer_says_what_it_does_not_exclude() {
    // The larger what is hidden, the further it moves the free numbers; on the brink of being named it moves them by more than they are known to.
    let adequate = (0..12).map_while(|k| {
        let hidden = -0.02 * f64::from(k) * NOISE;
        let mut bench = Bench::new(7, &[(&Bench::first_pattern("uniform-force"), hidden)], false);
        let baseline = bench.baseline();
        let d = diagnose(&mut bench, baseline, &Options::default()).unwrap();
        println!("{hidden} {}", d.sentence());
        (d.verdict == Verdict::Adequate).then(|| d.sentence())
    });
    let adequate: Vec<String> = adequate.collect();
    assert!(adequate.len() < 12 && !adequate[0].contains("Not excluded: "), "{adequate:?}");
    assert!(adequate.iter().any(|s| s.contains("Not excluded: ") && s.contains(" standard errors")), "{adequate:?}");
}

#[test]
fn what_scatters_more_than_one_reading_is_no_noise() {
    let mut bench = Bench::new(1000, &[], true);
    let model = bench.baseline();
    let readings = bench.linearise(&[(Vec::new(), model.values)]).remove(0).unwrap();
    let cells = Cells::new(&readings);
    let y = cells.table(&readings, None).y;
    let factor = |times: f64| design_effect(&cells, &y.iter().map(|y| times * y).collect::<Vec<_>>(), |_| 0.0).0;
    // Readings of the same noise: all of a cell are off alike where the variance of its mean is their number times that of independent ones.
    let number = readings.rows.len() as f64 / cells.len() as f64;
    assert!((cells.alike / number - 1.0).abs() < 0.2 && number > 4.0, "{} of {number}", cells.alike);
    assert!(factor(1.0) < cells.alike && factor(100.0) == cells.alike, "{} {}", factor(1.0), factor(100.0));
}

#[test]
fn false_alarms_are_as_rare_as_stated_under_correlated_pixels() {
    let (mut alarms, mut factors) = (0, Vec::new());
    const RECORDINGS: u64 = 120;
    // A discrepancy is one of twenty things that a scene may need.
    const STATED: f64 = 0.05;
    for seed in 0..RECORDINGS {
        let mut bench = Bench::new(1000 + seed, &[], true);
        let model = bench.baseline();
        let readings = bench.linearise(&[(Vec::new(), model.values.clone())]).remove(0).unwrap();
        let field = bench.finer(&[], &model.values).unwrap().remove(0);
        let mut cells = Cells::new(&readings);
        let frame = Frame::new(&cells.table(&readings, None), &[cells.means(&field.change)], &[field.times]);
        let (factor, _) = design_effect(&cells, &frame.left(), |i| frame.absorbed.leverage(i));
        factors.push(factor);
        cells.sd.iter_mut().for_each(|s| *s *= factor.sqrt());
        let (table, change, blocks) = (cells.table(&readings, None), cells.means(&field.change), Blocks::new(&cells));
        let times = |c: &[f64], by: f64| c.iter().map(|c| by * c).collect::<Vec<f64>>();
        // Nothing is known of the two numbers; of the field what it is.
        let mut moves: Vec<Vec<f64>> = table.columns.iter().map(|c| times(c, 100.0 / dot(c, c).sqrt())).collect();
        moves.push(times(&change, field.times.1));
        let model = Linear {
            y: table.y.iter().zip(&change).map(|(y, c)| y + field.times.0 * c).collect(),
            moves,
            known: vec![false, false, true],
            rough: vec![times(&change, field.rough), times(&blocks.size(&change), field.rough)],
            unmet: Vec::new(),
        };
        let seen = SIZES.map(|tau| model.left_out(&blocks, tau).iter().map(|d| d.seen).collect());
        let judged = Judged {
            beside: stacked(&seen).0,
            alone: seen[0].clone(),
            price: Prior { candidates: 1, readings: cells.len() }.discrepancy(),
            ..Judged::default()
        };
        alarms += usize::from(judged.may_be_missing());
    }
    let rate = alarms as f64 / RECORDINGS as f64;
    let factor = factors.iter().sum::<f64>() / factors.len() as f64;
    println!("stated {STATED}, found {rate}; variance of means {factor:.2} times that of independent pixels");
    // Independent pixels would leave a factor 1; patches of ten, cut by regions, most of ten.
    assert!(factor > 1.5, "{factor}");
    // Three standard deviations of a binomial of 120.
    assert!(rate < STATED + 3.0 * (STATED * (1.0 - STATED) / RECORDINGS as f64).sqrt(), "{rate}");
}
