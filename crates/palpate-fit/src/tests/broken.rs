//! A device that fails: the search ends with its best so far, and a resumed fit knows nothing of it.

use super::fits::{ALL, settings};
use super::models::*;
use crate::*;
use palpate_engine::{Evaluate, Evaluation, Failure, FailureKind, ParamBatch, Request, Wanted};
use std::path::Path;

/// Physics that breaks once, in its call number `calls`: the members from `from` on have no result.
struct Fragile {
    inner: Box<dyn Evaluate>,
    calls: usize,
    from: usize,
    kind: FailureKind,
}

impl Evaluate for Fragile {
    fn parameters(&self) -> usize {
        self.inner.parameters()
    }

    fn evaluate(&mut self, theta: &ParamBatch, request: &Request) -> Vec<Evaluation> {
        let mut all = self.inner.evaluate(theta, request);
        self.calls = self.calls.saturating_sub(1);
        if self.calls == 0 {
            self.calls = usize::MAX;
            let failure = Failure { hint: "less".into(), ..Failure::new(self.kind, 0.0, "out of memory") };
            all.iter_mut().skip(self.from).for_each(|e| *e = Evaluation::failed(failure.clone()));
        }
        all
    }

    fn has_products(&self) -> bool {
        self.inner.has_products()
    }

    fn product(&mut self, at: &ParamBatch, v: &[f64], wanted: &Wanted) -> Result<Vec<f64>, Failure> {
        self.inner.product(at, v, wanted)
    }
}

/// The oscillator on a device that breaks so.
fn fragile(calls: usize, from: usize) -> Problem<'static> {
    failing(calls, from, FailureKind::Device)
}

fn failing(calls: usize, from: usize, kind: FailureKind) -> Problem<'static> {
    let truth = oscillator(4.0, 0.3, 60);
    let model = LeastSquares::new(2, move |t| {
        (t[0] < 400.0).then(|| oscillator(t[0], t[1], 60).iter().zip(&truth).map(|(a, b)| (a - b) / 0.01).collect())
    });
    let evaluate = Box::new(Fragile { inner: Box::new(model), calls, from, kind });
    let scene = FitScene { name: "toy".into(), fingerprint: "toy".into(), base: vec![2.0, 0.1], evaluate };
    Problem::new(vec![scene], oscillator_problem().free().to_vec()).expect("the problem is valid")
}

fn with_journal<'a>(path: &Path, resume: bool) -> Hooks<'a> {
    Hooks { journal: Some(JournalFile { path: path.into(), resume }), ..Hooks::default() }
}

fn rounds(path: &Path) -> usize {
    std::fs::read_to_string(path).expect("the journal is there").lines().count() - 1
}

#[test]
fn a_device_that_fails_ends_the_search_and_a_resumed_fit_goes_on_as_if_it_had_not() {
    for optimizer in ALL {
        let settings = Settings { starts: 4, iterations: 40, ..settings(optimizer) };
        let timeless = |r: FitResult| FitResult { seconds: 0.0, ..r };
        let whole = timeless(fit(&mut oscillator_problem(), &settings, Hooks::default()).expect("it can be evaluated"));
        assert_eq!(whole.broken, None);
        // All members of a round, and only the later ones of a batch in two parts.
        for from in [0, 2] {
            let folder = tempfile::tempdir().expect("a folder");
            let path = folder.path().join("journal.jsonl");
            let part = fit(&mut fragile(3, from), &settings, with_journal(&path, false)).expect("two rounds were evaluated");
            let why = part.broken.as_deref().expect("the device failed");
            assert_eq!(why, "toy: the device failed: out of memory (hint: less)", "{optimizer:?}");
            assert!(
                part.runs.iter().all(|r| matches!(&r.status, Status::Broken(w) if w == why)),
                "{optimizer:?}: {:?}",
                part.runs
            );
            assert!(part.cost.is_finite() && part.cost <= part.initial_cost && part.evaluations < whole.evaluations);
            assert_eq!(rounds(&path), 2, "{optimizer:?}: the round that broke is not kept");
            let resumed = timeless(fit(&mut oscillator_problem(), &settings, with_journal(&path, true)).expect("it fits"));
            assert_eq!(resumed, whole, "{optimizer:?}: to the last bit");
        }
    }
}

#[test]
fn a_device_that_fails_at_once_or_at_the_end_says_so() {
    let settings = Settings { starts: 2, iterations: 5, ..settings(palpate_model::scene::Optimizer::Lbfgs) };
    let error = fit(&mut fragile(1, 0), &settings, Hooks::default()).expect_err("nothing was evaluated");
    assert!(matches!(&error, FitError::Broken(why) if why.contains("out of memory")), "{error}");

    // The last evaluation is that of the curvature: without it there are no standard errors, and all else is there.
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("journal.jsonl");
    let whole = fit(&mut oscillator_problem(), &settings, with_journal(&path, false)).expect("it can be evaluated");
    let cut = fit(&mut fragile(rounds(&path) + 1, 0), &settings, Hooks::default()).expect("the search went through");
    assert!(cut.broken.is_some_and(|why| why.contains("out of memory")));
    assert_eq!((cut.cost, cut.parameters[0].standard_error), (whole.cost, None));
    assert!(cut.warnings.iter().any(|w| w.contains("no standard errors: toy: the device failed")), "{:?}", cut.warnings);
}

#[test]
fn an_evaluation_cut_short_is_an_interruption_and_no_failed_start() {
    for optimizer in ALL {
        let settings = Settings { starts: 4, iterations: 40, ..settings(optimizer) };
        let timeless = |r: FitResult| FitResult { seconds: 0.0, ..r };
        let whole = timeless(fit(&mut oscillator_problem(), &settings, Hooks::default()).expect("it can be evaluated"));
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("journal.jsonl");
        let mut cut = failing(3, 0, FailureKind::Stopped);
        let part = fit(&mut cut, &settings, with_journal(&path, false)).expect("two rounds were evaluated");
        assert!(part.runs.iter().all(|r| r.status == Status::Interrupted), "{optimizer:?}: {:?}", part.runs);
        assert!(part.broken.is_none() && part.cost.is_finite() && part.cost <= part.initial_cost);
        assert_eq!(rounds(&path), 2, "{optimizer:?}: the round that was cut short is not kept");
        let resumed = timeless(fit(&mut oscillator_problem(), &settings, with_journal(&path, true)).expect("it fits"));
        assert_eq!(resumed, whole, "{optimizer:?}: to the last bit");
        let first = fit(&mut failing(1, 0, FailureKind::Stopped), &settings, Hooks::default());
        assert!(matches!(first, Err(FitError::Interrupted)), "{optimizer:?}");
    }
}
