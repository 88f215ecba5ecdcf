//! The order of questions: is something missing, where, what is it called, how sure, what else, how much of the gap closes; and again.

mod bound;
mod candidate;
mod choose;
mod conclude;
mod linear;
mod needed;
mod own_errors;
mod pairs;
mod policy;
mod prune;
mod race;
mod ranking;
mod replace;
mod rounds;
mod session;
mod state;
mod variants;

use crate::cells::{Cells, Table};
use crate::change::Change;
use crate::crossval::{Predicted, predict};
use crate::diagnosis::{Diagnosis, Found, Tried};
use crate::judgement::density::Blocks;
use crate::judgement::prior::{Prior, Strange};
use crate::judgement::rule::Judged;
use crate::laboratory::{Field, LabError, Laboratory, Model, Reading, Readings};
use crate::locate::{Place, locate};
use crate::movement::Movement;
use crate::noise::{Shapes, design_effect, neighbour_ratio};
use crate::null::{Block, Frame, extended, map};
use crate::score::Score;
use crate::still::still_ratio;
use candidate::CandidateId;
pub use policy::Policy;
use ranking::{Early, Ranked};
use variants::{Variant, most_promising};

/// How to diagnose.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// How the search spends its time.
    pub search: Policy,
    /// Stretches of time that residuals are looked at in.
    pub bins: usize,
    /// Windows of time of the slack force.
    pub windows: usize,
    /// Seed of the draws.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Options {
        Options { search: Policy::default(), bins: 8, windows: 5, seed: 1 }
    }
}

/// A model with everything that is known about its residuals.
#[derive(Clone)]
struct State {
    model: Model,
    readings: Readings,
    table: Table,
    fields: Vec<Field>,
    frame: Frame,
    predicted: Vec<Predicted>,
    /// Residuals of data that no fit has seen, where there are any.
    held_out: Option<Readings>,
    /// What finer computations would change in those residuals.
    held_out_finer: Vec<Field>,
    /// Why there are none although there is such data.
    elsewhere: Option<String>,
    /// True where the fields are of this very model.
    own: bool,
    /// By how much its fit would still move its numbers, where it has not arrived.
    unmet: Vec<f64>,
    /// Numbers that the recording asks for, of every change.
    needed: Vec<usize>,
    /// What is strange about its numbers.
    strange: Vec<Strange>,
    /// How it predicts what was left out.
    judged: Judged,
}

impl State {
    /// Sum of squares that the model leaves, but for what its free numbers and the discretisation explain.
    fn squares(&self) -> f64 {
        self.frame.squares()
    }
}

/// A fitted candidate.
struct Fitted {
    candidate: CandidateId,
    state: State,
    /// How it predicted beside the errors of grid and step that the model before has.
    lent: Judged,
    /// How much better it predicts than the model before, and the standard error of that [nats].
    nats: (f64, f64),
    gain: f64,
    freedom: usize,
    /// Of these, numbers that the recording asks for.
    needed: usize,
    /// Effects that it adds.
    effects: usize,
}

impl Fitted {
    /// What it adds to the model.
    fn changes(&self) -> &[Change] {
        let all = &self.state.model.changes;
        &all[all.len() - self.effects..]
    }

    /// Its name, of two joined by a plus.
    fn kind(&self) -> String {
        Change::kinds(self.changes())
    }

    /// True if another adds everything that this one does.
    fn is_within(&self, other: &Fitted) -> bool {
        self.changes().iter().all(|c| other.changes().iter().any(|o| o.kind() == c.kind()))
    }
}

/// What stays the same during a diagnosis.
struct Session<'a> {
    lab: &'a mut dyn Laboratory,
    options: &'a Options,
    cells: Cells,
    folds: Vec<Vec<usize>>,
    /// Blocks of cells that are left out.
    blocks: Blocks,
    /// The same of a second recording.
    second: Option<(Cells, Blocks)>,
    /// Number of candidates.
    candidates: usize,
    noise_ratio: f64,
    design_effect: f64,
    noise: Shapes,
    /// Variants of the baseline, scored while the noise was being found out; the first round takes them over.
    scored: Option<Vec<Variant>>,
    /// Candidates from the first look at the baseline.
    early: Early,
    /// Candidates by what their sensitivities promise.
    ranked: Vec<Ranked>,
    /// What candidates that were fitted, and are no worse than the model without them, do to the free numbers.
    rivals: Vec<Movement>,
    /// The baseline, which movements begin at.
    base: Model,
    /// True where there was no time to find out what cells and step explain of the baseline.
    unrefined: bool,
    /// Answers of [`Session::finer`], with the models that it was asked about: a candidate that is chosen was measured already.
    finer: Vec<(Model, Vec<Field>)>,
    tried: Vec<Tried>,
    not_tried: Vec<String>,
    /// True when the time was over before everything was tried.
    no_time: bool,
}

/// Standard deviations outside the known world from which on a number is evidence that something is missing.
const STRANGE: f64 = 3.0;
/// Share of the baseline's readings that a model must meet for its residuals to tell of the noise.
const KEPT: f64 = 0.95;
/// Diagnoses a scene from where the fit of its own numbers starts, or from their fitted values. From the first residuals on there is an answer,
/// and whatever ends the search ends with what is known by then: a ranking of candidates by their sensitivities at the start, the same at the
/// fitted values, and then what the rounds bring.
///
/// # Errors
/// The starting model or the baseline cannot be computed, or it was stopped before anything was known.
pub fn diagnose(lab: &mut dyn Laboratory, start: Model, options: &Options) -> Result<Diagnosis, LabError> {
    lab.say("residuals of the model");
    let mut s = Session::new(lab, options, &start);
    let (mut baseline, mut out) = (start, Progress::default());
    let readings = if s.lab.is_fitted() {
        one(s.lab.linearise(&[(baseline.changes.clone(), baseline.values.clone())]))?
    } else {
        let early = s.first_look(&baseline)?;
        let fitted = s.lab.baseline(baseline)?;
        out.cut = fitted.cut.is_some();
        out.unsure = fitted.cut.map(|why| format!("the baseline's fit was cut short: {why}"));
        baseline = fitted.model;
        match (s.lab.last_look(&baseline), early) {
            (Ok(readings), _) => readings,
            // What is known is known of the start.
            (Err(why @ (LabError::NoTime | LabError::Interrupted)), Some(early)) => {
                return Ok(s.conclude_early(early, baseline, out, &why));
            }
            (Err(why), _) => return Err(why),
        }
    };
    s.begin(&baseline, &readings)?;
    let mut state = s.state(baseline.clone(), readings)?;
    let complete = s.look(&state, 1, !out.cut)?;
    s.no_time |= !complete && !s.lab.interrupted();
    if !out.cut {
        state.fields = s.finer(&baseline);
        state.held_out_finer = s.held_out_finer(&state);
        s.remeasure(&mut state);
    }
    if s.unrefined {
        let why = if s.lab.interrupted() { "the diagnosis was interrupted" } else { "the time was over" };
        out.unsure.get_or_insert_with(|| format!("{why} before the baseline and its noise were known"));
    }
    s.correlate(&mut state, complete && !out.cut);
    s.look_elsewhere(&mut state);
    let mut first = (state.readings.clone(), s.grid(&state));
    let mut blocks;
    let mut base = state.clone();
    let mut rounds: Vec<(State, Vec<Found>)> = Vec::new();
    loop {
        let began = s.lab.seconds();
        blocks = s.map(&state);
        s.keep_back(began);
        if out.places.is_none() {
            out.places = Some(locate(&s.cells, &blocks, s.lab.setting()));
            out.blocks.clone_from(&blocks);
        }
        out.interrupted = s.lab.interrupted();
        let wanted = out.cut || (s.is_worth_a_look(&state) && out.accepted.len() < options.search.rounds);
        if !wanted {
            break;
        }
        if out.interrupted || out.cut || s.lab.out_of_time() {
            out.open = true;
            s.no_time |= !out.interrupted;
            if !out.accepted.is_empty() && !out.interrupted {
                s.not_tried.push("whatever a further round would have tried: no time left".into());
            }
            break;
        }
        match s.round(&state, out.accepted.len() + 1) {
            Ok((Some((found, next)), _)) => {
                if let Some(better) = s.better_baseline(&state, &next, found.len()) {
                    state = better;
                    if out.accepted.is_empty() {
                        (base, out.places) = (state.clone(), None);
                        s.base = base.model.clone();
                        first = (state.readings.clone(), s.grid(&state));
                    }
                    continue;
                }
                // Nothing is named where nothing is missing: what helps there follows errors of the grid more closely than their fields do.
                if out.accepted.is_empty() && !state.may_lack() {
                    break;
                }
                let before = (state.clone(), out.accepted.clone());
                out.accepted.extend(found);
                state = s.prune(next, &mut out.accepted);
                if let Some(mut other) = s.replace(&state, &mut out.accepted) {
                    s.refine(&mut other);
                    state = s.prune(other, &mut out.accepted);
                }
                // A round that ends no better than it began would follow itself for ever.
                if !state.judged.over(&before.0.judged).is_clear() {
                    (state, out.accepted) = before;
                    break;
                }
                s.settle(&mut state, met(&base.readings));
                rounds.push(before);
            }
            Ok((None, close)) => {
                out.close = close;
                break;
            }
            Err(LabError::Interrupted) => {
                out.interrupted = true;
                break;
            }
            Err(e) => return Err(e),
        }
    }
    // With enough effects anything is followed roughly: the last one must explain more of what was missing than it leaves.
    while let Some((mut before, accepted)) = rounds.pop() {
        s.remeasure(&mut before);
        if state.judged.explains(&before.judged) {
            break;
        }
        out.close = std::mem::replace(&mut out.accepted, accepted).into_iter().last().into_iter().collect();
        out.close.iter_mut().for_each(|f| f.accepted = false);
        out.taken_back = true;
        state = before;
        blocks = s.map(&state);
    }
    // Both levels in the noise as it is known at the end.
    let before = s.level_of(&first.0, first.1, &[]);
    Ok(s.conclude((base, before), state, &blocks, out))
}

/// What the rounds have brought so far.
#[derive(Default)]
struct Progress {
    accepted: Vec<Found>,
    close: Vec<Found>,
    places: Option<Vec<Place>>,
    /// The baseline's residuals in blocks.
    blocks: Vec<Block>,
    interrupted: bool,
    /// True where an effect helped and was no explanation.
    taken_back: bool,
    /// True where the baseline's fit ended before its end.
    cut: bool,
    /// True where there was a reason to look for what is missing, and no time.
    open: bool,
    /// Why it is not even sure that something is missing.
    unsure: Option<String>,
}

/// Noise of single depth readings over the stated one, by whichever look at it finds more.
fn noise_over_stated(lab: &dyn Laboratory, readings: &Readings) -> f64 {
    neighbour_ratio(readings).max(still_ratio(readings, &lab.setting().still))
}

/// Keeps the first entry of every candidate.
fn keep_first<T>(entries: &mut Vec<T>, candidate: impl Fn(&T) -> CandidateId) {
    let mut seen = std::collections::BTreeSet::new();
    entries.retain(|e| seen.insert(candidate(e)));
}

/// Readings that met the simulated body.
fn met(readings: &Readings) -> usize {
    readings.rows.iter().filter(|r| r.row.value.is_some()).count()
}

fn one<T>(answers: Vec<Result<T, LabError>>) -> Result<T, LabError> {
    answers.into_iter().next().unwrap_or_else(|| Err(LabError::failed("the laboratory gave no answer")))
}

impl Session<'_> {
    /// Root mean square noise of single residuals [m].
    fn reading_noise(&self, readings: &Readings) -> f64 {
        let known = readings.rows.iter().filter(|r| r.row.value.is_some());
        let (sum, n) = known.fold((0.0, 0.0), |(sum, n), r| (sum + self.variance(r), n + 1.0));
        (sum / f64::max(n, 1.0)).sqrt()
    }

    /// Variance of a residual by noise alone [m²].
    fn variance(&self, r: &Reading) -> f64 {
        let ratio = if r.row.source.is_depth() { self.noise_ratio } else { 1.0 };
        (ratio * r.row.noise * r.row.along_sight).powi(2)
    }

    /// A state's residuals against what noise and discretisation leave.
    fn map(&self, state: &State) -> Vec<Block> {
        map(&self.cells, &state.frame, &self.noise, self.options.bins, self.options.seed)
    }

    /// True when something is missing in a model, or may be: a discrepancy beside it predicts better, its numbers are not of this world, or a
    /// candidate promises more than it costs.
    fn is_worth_a_look(&self, state: &State) -> bool {
        let price = Prior { candidates: self.candidates, readings: self.cells.len() };
        let promises = |v: &Variant| 0.5 * v.score.gain + price.log(&[v.score.freedom], &[]) > 0.0;
        state.may_lack() || self.scored.iter().flatten().any(promises)
    }

    fn frame(&self, table: &Table, fields: &[Field]) -> Frame {
        let means: Vec<Vec<f64>> = fields.iter().map(|f| self.cells.means(&f.change)).collect();
        let times: Vec<(f64, f64)> = fields.iter().map(|f| f.times).collect();
        Frame::new(table, &means, &times)
    }

    fn predict(&self, readings: &Readings, table: &Table, frame: &Frame) -> Vec<Predicted> {
        self.folds.iter().map(|f| predict(&self.cells, readings, table, &frame.fields, f)).collect()
    }

    /// Brings a state up to date after the size of the noise changed.
    fn remeasure(&self, state: &mut State) {
        state.table = self.cells.table(&state.readings, None);
        state.frame = self.frame(&state.table, &state.fields);
        state.predicted = self.predict(&state.readings, &state.table, &state.frame);
        self.judge(state);
    }

    /// Finds how much more cells scatter than independent readings would, beside all candidates or those of the first look, and rescales
    /// everything by it.
    fn correlate(&mut self, state: &mut State, all: bool) {
        let more = if all && !self.lab.interrupted() { self.variants(state).ok() } else { None };
        let variants = more.filter(|v| !v.is_empty()).unwrap_or_else(|| self.early.variants.clone());
        let mut saturated = state.frame.absorbed.clone();
        let mut best: Vec<&Variant> = variants.iter().collect();
        best.sort_by(|a, b| most_promising(a, b));
        for c in best.iter().flat_map(|v| &v.columns) {
            // A third of the cells stays free to show the noise.
            if saturated.rank() * 3 < self.cells.len() {
                saturated.add(&extended(c, state.frame.fields.len()));
            }
        }
        let y = saturated.without(&state.frame.y);
        let (factor, noise) = design_effect(&self.cells, &y, |i| saturated.leverage(i));
        (self.design_effect, self.noise) = (factor, noise);
        self.cells.sd.iter_mut().for_each(|s| *s *= factor.sqrt());
        self.remeasure(state);
        // Columns are in units of the noise, which has just become larger.
        let mut variants = variants;
        for v in &mut variants {
            v.columns.iter_mut().flatten().for_each(|c| *c /= factor.sqrt());
            // What starts from a size was not scored by its columns.
            v.score = if v.blunt.is_none() {
                self.score(state, v)
            } else {
                Score { gain: v.score.share * state.squares(), ..std::mem::take(&mut v.score) }
            };
        }
        self.rank(state, 1, &variants);
        self.early = Early::default();
        self.scored = Some(variants);
    }

    /// Looks at the noise again after an effect was added: what the model missed before may have passed for noise, so that only a
    /// smaller estimate counts. `before` readings met the baseline.
    fn settle(&mut self, state: &mut State, before: usize) {
        // A model that follows fewer readings may follow the quiet ones.
        if (met(&state.readings) as f64) < KEPT * before as f64 {
            return;
        }
        let ratio = noise_over_stated(self.lab, &state.readings).min(self.noise_ratio);
        let old = self.design_effect.sqrt();
        for (sd, k) in self.cells.sd.iter_mut().zip(&self.cells.keys) {
            *sd *= if k.stream.sensor.is_camera() { ratio / self.noise_ratio } else { 1.0 } / old;
        }
        self.noise_ratio = ratio;
        let frame = self.frame(&self.cells.table(&state.readings, None), &state.fields);
        let (factor, noise) = design_effect(&self.cells, &frame.left(), |i| frame.absorbed.leverage(i));
        if factor < self.design_effect {
            (self.design_effect, self.noise) = (factor, noise);
        }
        let new = self.design_effect.sqrt();
        self.cells.sd.iter_mut().for_each(|s| *s *= new);
        self.remeasure(state);
    }
}
