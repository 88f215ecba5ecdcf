//! Journals: a resumed fit equals an uninterrupted one, bit for bit.

use super::fits::{ALL, settings};
use super::models::*;
use crate::*;
use palpate_model::scene::Optimizer;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

fn with_journal<'a>(path: &Path, resume: bool) -> Hooks<'a> {
    Hooks { journal: Some(JournalFile { path: path.into(), resume }), ..Hooks::default() }
}

fn timeless(result: FitResult) -> FitResult {
    FitResult { seconds: 0.0, ..result }
}

#[test]
fn a_resumed_fit_equals_an_uninterrupted_one() {
    for optimizer in ALL {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("journal.jsonl");
        let settings = Settings { starts: 4, iterations: 40, ..settings(optimizer) };
        let whole = timeless(fit(&mut oscillator_problem(), &settings, Hooks::default()).expect("it can be evaluated"));

        let flag = Arc::new(AtomicBool::new(false));
        let mut stop = |p: &Progress| flag.store(p.iteration >= 5 || flag.load(Ordering::SeqCst), Ordering::SeqCst);
        let hooks = Hooks { on_iteration: Some(&mut stop), interrupt: flag.clone().into(), ..with_journal(&path, false) };
        let part = fit(&mut oscillator_problem(), &settings, hooks).expect("something was evaluated");
        assert!(part.evaluations < whole.evaluations);
        // A crash in the middle of writing a line.
        let mut text = std::fs::read_to_string(&path).expect("the journal is there");
        text.push_str("{\"round\":[{\"start\":0,\"eval");
        std::fs::write(&path, &text).expect("the journal is writable");

        let (mut problem, batches) = counted_oscillator();
        let resumed = timeless(fit(&mut problem, &settings, with_journal(&path, true)).expect("the journal fits"));
        assert_eq!(resumed, whole, "{optimizer:?}");
        let fresh: usize = batches.lock().expect("not poisoned").iter().sum();
        assert_eq!(fresh, whole.evaluations - part.evaluations, "{optimizer:?}: journalled evaluations are not repeated");

        // Now everything is in the journal but the curvature at the end, which Gauss–Newton has already.
        let left: &[usize] = if optimizer == Optimizer::GaussNewton { &[] } else { &[1] };
        let (mut problem, batches) = counted_oscillator();
        assert_eq!(timeless(fit(&mut problem, &settings, with_journal(&path, true)).expect("the journal fits")), whole);
        assert_eq!(*batches.lock().expect("not poisoned"), left);
    }
}

#[test]
fn more_iterations_go_on_from_the_journal() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("journal.jsonl");
    let short = Settings { starts: 2, iterations: 5, ..settings(Optimizer::Lbfgs) };
    let long = Settings { starts: 3, iterations: 40, ..short.clone() };
    let part = fit(&mut oscillator_problem(), &short, with_journal(&path, false)).expect("it can be evaluated");
    let whole = timeless(fit(&mut oscillator_problem(), &long, Hooks::default()).expect("it can be evaluated"));
    let (mut problem, batches) = counted_oscillator();
    assert_eq!(timeless(fit(&mut problem, &long, with_journal(&path, true)).expect("the journal fits")), whole);
    // The one extra evaluation is the curvature of the short fit, which is not in its journal.
    assert_eq!(batches.lock().expect("not poisoned").iter().sum::<usize>(), whole.evaluations - part.evaluations + 1);
}

#[test]
fn a_journal_of_another_fit_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("journal.jsonl");
    let base = Settings { iterations: 3, ..settings(Optimizer::Rprop) };
    fit(&mut oscillator_problem(), &base, with_journal(&path, false)).expect("it can be evaluated");
    let refused = |problem: &mut Problem, settings: &Settings| {
        fit(problem, settings, with_journal(&path, true)).expect_err("the journal is of another fit").to_string()
    };
    let message = refused(&mut oscillator_problem(), &Settings { seed: 9, ..base.clone() });
    assert!(message.contains("journal.jsonl, line 1") && message.contains("seed differs"), "{message}");
    assert!(refused(&mut oscillator_problem(), &settings(Optimizer::Lbfgs)).contains("optimizer differs"));
    assert!(refused(&mut rosenbrock(), &base).contains("free parameters differ)"));

    let text = std::fs::read_to_string(&path).expect("the journal is there");
    // One digit of a cost or place is lost: the line is complete but cannot be read.
    std::fs::write(&path, text.replacen("\"z\":\"", "\"z\":\"x", 1)).expect("writable");
    assert!(refused(&mut oscillator_problem(), &base).contains("line 2: evaluation 0 of start 0 is damaged"));
    std::fs::write(&path, text.replacen("\"z\":\"3", "\"z\":\"4", 1)).expect("writable");
    assert!(refused(&mut oscillator_problem(), &base).contains("made at another point"));
    std::fs::write(&path, "{\"no\": \"journal\"}\n").expect("writable");
    assert!(refused(&mut oscillator_problem(), &base).contains("not a fit's journal"));
    std::fs::write(&path, "hello\n").expect("writable");
    assert!(refused(&mut oscillator_problem(), &base).contains("line 1"));
    // Without resuming the file is simply replaced.
    fit(&mut oscillator_problem(), &base, with_journal(&path, false)).expect("it can be evaluated");
    assert_eq!(std::fs::read_to_string(&path).expect("the journal is there"), text);
}

#[test]
fn a_journal_that_cannot_be_written_is_an_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let hooks = with_journal(&folder.path().join("no/such/folder.jsonl"), false);
    let error = fit(&mut rosenbrock(), &settings(Optimizer::Rprop), hooks).expect_err("the folder does not exist");
    assert!(error.to_string().contains("folder.jsonl"), "{error}");
}
