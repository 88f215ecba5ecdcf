//! Many starts at once: every start runs an optimiser on its own thread, and a broker gathers what they ask for into batches.
//!
//! A round waits until every live start either asks for an evaluation or has ended; the batch is ordered by start. What is
//! computed, and in which company, therefore depends on the problem and the seed, never on timing.

use crate::chart::Chart;
use crate::fit::{FitError, Hooks, Progress};
use crate::journal::Journal;
use crate::optimise::{Outcome, Sample, Search, Status, Stop, is_unmoved, want};
use crate::priors::Priors;
use crate::problem::{FreeParameter, Problem};
use crate::settings::{Settings, Walk};
use palpate_engine::FailureKind;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::sync::mpsc::{Receiver, Sender, channel};

/// A start whose first evaluation fails is drawn anew so many times.
const REDRAWS: usize = 4;
/// Stack of a start's thread; optimisers keep their vectors on the heap.
const STACK: usize = 1 << 20;

/// One start and what came of it.
#[derive(Clone, Debug)]
pub struct StartRun {
    /// z of the start `[q]`.
    pub start: Vec<f64>,
    /// The search from there.
    pub outcome: Outcome,
}

/// What a start asks for.
enum Ask {
    /// Cost and derivatives at z `[q]`.
    Sample(Vec<f64>),
    /// Product with the curvature at z, both `[q]`.
    Product(Vec<f64>, Vec<f64>),
}

/// What it gets.
enum Answer {
    Sample(Sample),
    Product(Vec<f64>),
}

enum Message {
    Ask(Ask),
    Iteration(usize, f64, Vec<f64>),
    Done(Box<StartRun>),
}

/// Draws the start of a run in physical values `[q]`: log-uniform for parameters fitted as logarithms (of 1 + v for relative changes), else uniform.
pub fn draw(free: &[FreeParameter], charts: &[Chart], rng: &mut ChaCha8Rng) -> Vec<f64> {
    let one = |(f, c): (&FreeParameter, &Chart)| {
        let share: f64 = rng.random();
        let (a, b) = (f.start.0.max(f.bounds.0), f.start.1.min(f.bounds.1));
        c.between((a, b), share)
    };
    by_value(free).zip(charts).map(one).collect()
}

/// The parameter of every free value `[q]`.
fn by_value(free: &[FreeParameter]) -> impl Iterator<Item = &FreeParameter> {
    free.iter().flat_map(|f| std::iter::repeat_n(f, f.count))
}

/// The scene's own values where they lie in the start range, the drawn ones elsewhere.
fn first_start(free: &[FreeParameter], own: &[f64], drawn: Vec<f64>) -> Vec<f64> {
    let inside = |f: &FreeParameter, v: f64| v >= f.start.0.max(f.bounds.0) && v <= f.start.1.min(f.bounds.1);
    let pairs = by_value(free).zip(own).zip(drawn);
    pairs.map(|((f, own), drawn)| if inside(f, *own) { *own } else { drawn }).collect()
}

/// What one start needs to know.
struct Runner<'a> {
    number: usize,
    /// Its place among those that run together.
    line: usize,
    free: &'a [FreeParameter],
    charts: &'a [Chart],
    priors: &'a Priors,
    own: &'a [f64],
    lower: &'a [f64],
    upper: &'a [f64],
    settings: &'a Settings,
    /// Where it starts, if not where the draw says; and then it goes on whether it sees anything or not.
    given: Option<&'a Vec<f64>>,
    sight: bool,
    /// What the starts are part of, for who traces: each has a thread of its own.
    within: tracing::Span,
}

impl Runner<'_> {
    fn run(&self, tell: &Sender<(usize, Message)>, answers: &Receiver<Result<Answer, Stop>>) -> StartRun {
        let _span = tracing::info_span!(parent: &self.within, "start", number = self.number).entered();
        let mut rng = ChaCha8Rng::seed_from_u64(self.settings.seed);
        rng.set_stream(self.number as u64);
        let fixed = self.given.is_some() || self.free.iter().all(|f| f.start.0 == f.start.1);
        let mut spent = 0;
        let mut attempt = 0;
        loop {
            let mut values = draw(self.free, self.charts, &mut rng);
            if self.number == 0 && attempt == 0 {
                values = first_start(self.free, self.own, values);
            }
            if let Some(given) = self.given {
                values.clone_from(given);
            }
            let start: Vec<f64> = self.charts.iter().zip(&values).map(|(c, &v)| c.coordinate(v)).collect();
            let ask = |what: Ask| {
                let sent = tell.send((self.line, Message::Ask(what)));
                // A broker that is gone cannot answer any more: the same as an interruption.
                sent.map_err(|_| Stop::Interrupted)?;
                answers.recv().unwrap_or(Err(Stop::Interrupted))
            };
            let mut evaluate = |z: &[f64]| match ask(Ask::Sample(z.to_vec()))? {
                Answer::Sample(sample) => Ok(sample),
                Answer::Product(_) => Err(Stop::Broken("a product was given for a sample".into())),
            };
            let mut product = |z: &[f64], v: &[f64]| match ask(Ask::Product(z.to_vec(), v.to_vec()))? {
                Answer::Product(product) => Ok(product),
                Answer::Sample(sample) => Err(Stop::Broken(sample.failure.unwrap_or_default())),
            };
            let mut progress = |n: usize, cost: f64, z: &[f64]| {
                // Without a broker nobody listens, and the next evaluation ends the search.
                let _ = tell.send((self.line, Message::Iteration(n, cost, z.to_vec())));
            };
            let search = Search::new(&mut evaluate, &mut progress, self.lower, self.upper, self.settings);
            let search =
                search.with_products(&mut product).with_priors(self.priors).with_sight(self.sight && self.given.is_none());
            let mut outcome = search.run(self.settings.optimizer, &start);
            spent += outcome.evaluations;
            attempt += 1;
            let lost = matches!(outcome.status, Status::Failed(_)) && outcome.cost.is_infinite();
            if lost && attempt <= REDRAWS && !fixed {
                continue;
            }
            outcome.evaluations = spent;
            return StartRun { start, outcome };
        }
    }
}

/// Runs all starts, the first from `first` where that is given; the result is ordered by start. Starts that see nothing are led to where they do,
/// where the hooks have who leads.
pub fn run(
    problem: &mut Problem,
    settings: &Settings,
    hooks: &mut Hooks,
    mut journal: Option<&mut Journal>,
    first: Option<Begin>,
) -> Result<Vec<StartRun>, FitError> {
    // Fixed starts are all the same.
    let fixed = problem.free().iter().all(|f| f.start.0 == f.start.1);
    let mut all: Vec<Begin> = (0..if fixed { 1 } else { settings.starts.max(1) }).map(Begin::drawn).collect();
    all.iter_mut().zip(first).for_each(|(begin, first)| *begin = first);
    let mut runs = run_some(problem, settings, hooks, journal.as_deref_mut(), &all)?;
    let blind: Vec<usize> = (0..runs.len()).filter(|s| runs[*s].outcome.status == Status::Blind).collect();
    let Some(lead) = hooks.lead.as_mut().filter(|_| !blind.is_empty()) else { return Ok(runs) };
    let values: Vec<Vec<f64>> = blind.iter().map(|s| problem.values(&runs[*s].start)).collect();
    let led = lead(&values);
    let again: Vec<Begin> = blind
        .iter()
        .zip(values.into_iter().zip(led))
        .map(|(&s, (own, led))| Begin {
            number: s,
            served: runs[s].outcome.evaluations,
            ..Begin::given(led.unwrap_or(own), 0, 0)
        })
        .collect();
    let mut found = run_some(problem, settings, hooks, journal.as_deref_mut(), &again)?;
    // A way that ended above where it was to begin was none: clutter has few readings that belong to the body, and is followed by a wide band.
    let astray: Vec<usize> = (0..again.len())
        .filter(|k| found[*k].outcome.sample.is_some() && found[*k].outcome.cost > runs[again[*k].number].outcome.start_cost)
        .collect();
    if !astray.is_empty() {
        let own = |k: &usize| {
            let first = &runs[again[*k].number];
            let served = first.outcome.evaluations + found[*k].outcome.evaluations;
            Begin { number: again[*k].number, served, ..Begin::given(problem.values(&first.start), 0, 0) }
        };
        let back: Vec<Begin> = astray.iter().map(own).collect();
        for (k, mut run) in astray.iter().zip(run_some(problem, settings, hooks, journal, &back)?) {
            run.outcome.evaluations += found[*k].outcome.evaluations;
            found[*k] = run;
        }
    }
    for (begin, mut run) in again.iter().zip(found) {
        let first = &mut runs[begin.number];
        if run.outcome.sample.is_none() {
            // Stopped before it could look again: its first look is what there is.
            first.outcome.status = run.outcome.status;
            continue;
        }
        // A search that never saw anything has not converged, whatever ended it.
        if run.outcome.sample.as_ref().is_some_and(is_unmoved) {
            run.outcome.status = Status::Blind;
        }
        (run.start, run.outcome.start_cost) = (first.start.clone(), first.outcome.start_cost);
        run.outcome.evaluations += first.outcome.evaluations;
        *first = run;
    }
    Ok(runs)
}

/// How a start begins.
pub struct Begin {
    number: usize,
    /// Evaluations and iterations that it has had.
    served: usize,
    iterations: usize,
    /// Values `[q]`, where they are not drawn.
    given: Option<Vec<f64>>,
}

impl Begin {
    fn drawn(number: usize) -> Begin {
        Begin { number, served: 0, iterations: 0, given: None }
    }

    /// The first start from given values `[q]`, after so many evaluations and iterations.
    pub fn given(values: Vec<f64>, served: usize, iterations: usize) -> Begin {
        Begin { number: 0, served, iterations, given: Some(values) }
    }
}

/// Runs some of the starts.
fn run_some(
    problem: &mut Problem,
    settings: &Settings,
    hooks: &mut Hooks,
    journal: Option<&mut Journal>,
    begins: &[Begin],
) -> Result<Vec<StartRun>, FitError> {
    let free = problem.free().to_vec();
    let charts = problem.charts().to_vec();
    let priors = problem.priors().clone();
    let own = problem.own_values();
    let (lower, upper): (Vec<f64>, Vec<f64>) = charts.iter().map(Chart::range).unzip();
    let sight = hooks.lead.is_some();

    std::thread::scope(|scope| {
        let (tell, inbox) = channel();
        let mut lines = Vec::new();
        for (line, Begin { number, given, .. }) in begins.iter().enumerate() {
            let number = *number;
            let (answer, answers) = channel();
            let tell = tell.clone();
            let runner = Runner {
                number,
                free: &free,
                charts: &charts,
                priors: &priors,
                own: &own,
                lower: &lower,
                upper: &upper,
                settings,
                line,
                given: given.as_ref(),
                sight,
                within: tracing::Span::current(),
            };
            let work = move || {
                let run = std::panic::AssertUnwindSafe(|| runner.run(&tell, &answers));
                match std::panic::catch_unwind(run) {
                    Ok(done) => drop(tell.send((line, Message::Done(Box::new(done))))),
                    Err(panic) => {
                        // The broker must not wait for this start; the panic itself surfaces at the end of the scope.
                        let outcome = Outcome {
                            z: Vec::new(),
                            cost: f64::INFINITY,
                            start_cost: f64::INFINITY,
                            iterations: 0,
                            evaluations: 0,
                            products: 0,
                            walk: Walk::default(),
                            promised: 0.0,
                            status: Status::Failed("the optimiser broke off".into()),
                            sample: None,
                        };
                        let run = StartRun { start: Vec::new(), outcome };
                        drop(tell.send((line, Message::Done(Box::new(run)))));
                        std::panic::resume_unwind(panic);
                    }
                }
            };
            std::thread::Builder::new()
                .stack_size(STACK)
                .spawn_scoped(scope, work)
                .map_err(|e| FitError::Threads(format!("start {number} got no thread: {e}")))?;
            lines.push(answer);
        }
        drop(tell);
        broker(problem, settings, hooks, journal, begins, &inbox, &lines)
    })
}

/// Serves the starts until all have ended.
fn broker(
    problem: &mut Problem,
    settings: &Settings,
    hooks: &mut Hooks,
    mut journal: Option<&mut Journal>,
    begins: &[Begin],
    inbox: &Receiver<(usize, Message)>,
    answers: &[Sender<Result<Answer, Stop>>],
) -> Result<Vec<StartRun>, FitError> {
    let starts = answers.len();
    let mut done: Vec<Option<StartRun>> = vec![None; starts];
    let mut asked: Vec<Option<Ask>> = (0..starts).map(|_| None).collect();
    let mut served: Vec<usize> = begins.iter().map(|b| b.served).collect();
    let mut residuals = 0;
    let mut broken = None;
    loop {
        let mut heard: Vec<(usize, usize, f64, Vec<f64>)> = Vec::new();
        while (0..starts).any(|s| done[s].is_none() && asked[s].is_none()) {
            let Ok((s, message)) = inbox.recv() else {
                return Err(FitError::Threads("a start ended without a result".into()));
            };
            match message {
                Message::Ask(what) => asked[s] = Some(what),
                Message::Iteration(n, cost, z) => heard.push((s, n, cost, z)),
                Message::Done(run) => done[s] = Some(*run),
            }
        }
        // Messages of one start come in order; a stable sort puts the starts in order.
        heard.sort_by_key(|h| h.0);
        for (start, iteration, cost, z) in heard {
            if let Some(f) = &mut hooks.on_iteration {
                let begin = &begins[start];
                let iteration = begin.iterations + iteration;
                f(&Progress { start: begin.number, iteration, cost, values: problem.values(&z) });
            }
        }
        if asked.iter().all(Option::is_none) {
            return Ok(done.into_iter().flatten().collect());
        }
        let interrupted = hooks.interrupt.is_over();
        let mut stop = broken.clone().map(Stop::Broken).or(interrupted.then_some(Stop::Interrupted));
        // Samples wait for the starts that still want products, so that they are computed together.
        let wait = asked.iter().any(|a| matches!(a, Some(Ask::Product(..))));
        for (ask, answer) in asked.iter_mut().zip(answers) {
            let Some(Ask::Product(z, v)) = ask else { continue };
            let product = match &stop {
                Some(stop) => Err(stop.clone()),
                None => problem.product(z, v).map(Answer::Product).map_err(|f| match f.kind {
                    FailureKind::Stopped => Stop::Interrupted,
                    _ => Stop::Broken(f.to_string()),
                }),
            };
            if let Err(Stop::Broken(why)) = &product {
                broken = Some(why.clone());
                stop = Some(Stop::Broken(why.clone()));
            }
            *ask = None;
            // A start that no longer listens has ended and said so.
            let _ = answer.send(product);
        }
        if wait {
            continue;
        }
        let z_of = |s: usize| match &asked[s] {
            Some(Ask::Sample(z)) => Some(z),
            _ => None,
        };
        let live: Vec<usize> = (0..starts).filter(|s| z_of(*s).is_some()).collect();
        // What an earlier run has computed is served even when the fit is about to end: it costs nothing.
        let mut answered = Vec::new();
        if let Some(journal) = &mut journal {
            for &s in &live {
                if let Some(sample) = z_of(s).map_or(Ok(None), |z| journal.find(begins[s].number, served[s], z))? {
                    answered.push((s, sample));
                }
            }
        }
        let fresh: Vec<usize> = live.iter().copied().filter(|s| answered.iter().all(|(a, _)| a != s)).collect();
        if let Some(stop) = stop {
            for &s in &fresh {
                asked[s] = None;
                let _ = answers[s].send(Err(stop.clone()));
            }
        } else if !fresh.is_empty() {
            let z: Vec<Vec<f64>> = fresh.iter().filter_map(|&s| z_of(s).cloned()).collect();
            let samples = problem.evaluate(&z, want(settings.optimizer));
            broken = samples.iter().find(|s| s.broken).and_then(|s| s.failure.clone());
            // A round that broke or was stopped is computed again by a resumed fit, as a whole.
            let stopped = samples.iter().any(|s| s.stopped);
            if let (Some(journal), None, false) = (&mut journal, &broken, stopped) {
                let entry = |((&s, z), sample): ((&usize, _), _)| (begins[s].number, served[s], Vec::as_slice(z), sample);
                let round: Vec<_> = fresh.iter().zip(&z).zip(&samples).map(entry).collect();
                journal.add(&round)?;
            }
            answered.extend(fresh.iter().copied().zip(samples));
        }
        for (s, sample) in answered {
            if sample.failure.is_none() && residuals != sample.residuals {
                if residuals != 0 {
                    return Err(FitError::Residuals { before: residuals, now: sample.residuals });
                }
                residuals = sample.residuals;
            }
            asked[s] = None;
            served[s] += 1;
            let answer = match sample {
                Sample { broken: true, failure, .. } => Err(Stop::Broken(failure.unwrap_or_default())),
                Sample { stopped: true, .. } => Err(Stop::Interrupted),
                sample => Ok(Answer::Sample(sample)),
            };
            // A start that no longer listens has ended and said so.
            let _ = answers[s].send(answer);
        }
    }
}
