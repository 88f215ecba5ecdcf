//! The order of questions: is something missing, where, what is it called, how sure, what else, how much of the gap closes; and again.

mod bound;
mod candidate;
mod choose;
mod conclude;
mod needed;
mod own_errors;
mod pairs;
mod prune;
mod race;
mod replace;
mod rounds;
mod variants;

use crate::cells::{Cells, Table};
use crate::change::Change;
use crate::crossval::{Predicted, foldings, predict};
use crate::diagnosis::{Diagnosis, Found, Tried};
use crate::laboratory::{Field, LabError, Laboratory, Model, Reading, Readings};
use crate::locate::{Place, locate};
use crate::noise::{Shapes, design_effect, neighbour_ratio};
use crate::null::{Adequacy, Block, Frame, extended, test};
use crate::score::Score;
use crate::still::still_ratio;
use candidate::CandidateId;
use variants::{Variant, most_promising};

/// How to diagnose.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// False-alarm rate of the question whether something is missing.
    pub significance: f64,
    /// Smallest structure of residuals that counts, over the noise of single readings. Thousands of readings make a tenth of their noise
    /// significant, but no model of a body is that good.
    pub least_structure: f64,
    /// Smallest share of the gap that an effect must close on data left out.
    pub least_gain: f64,
    /// Share of the gap that all accepted effects together must close, unless nothing remains.
    pub enough: f64,
    /// The same when there are several effects, whatever remains: what takes a patchwork to be followed roughly is not known.
    pub enough_of_several: f64,
    /// Most effects added.
    pub rounds: usize,
    /// Candidates fitted in a round.
    pub fits: usize,
    /// Stretches of time that residuals are looked at in.
    pub bins: usize,
    /// Windows of time of the slack force.
    pub windows: usize,
    /// Seed of the draws.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            significance: 0.01,
            least_structure: 0.25,
            least_gain: 0.3,
            enough: 0.7,
            enough_of_several: 0.9,
            rounds: 3,
            fits: 12,
            bins: 8,
            windows: 5,
            seed: 1,
        }
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
    p_value: f64,
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
    noise_ratio: f64,
    design_effect: f64,
    noise: Shapes,
    /// Variants of the baseline, scored while the noise was being found out; the first round takes them over.
    scored: Option<Vec<Variant>>,
    /// Answers of [`Session::finer`], with the models that it was asked about: a candidate that is chosen was measured already.
    finer: Vec<(Model, Vec<Field>)>,
    tried: Vec<Tried>,
    not_tried: Vec<String>,
    /// True when the time was over before everything was tried.
    no_time: bool,
}

/// Share of the baseline's readings that a model must meet for its residuals to tell of the noise.
const KEPT: f64 = 0.95;
/// Diagnoses a scene from its fitted baseline.
///
/// # Errors
/// The baseline cannot be computed, or it was interrupted before anything was known.
pub fn diagnose(lab: &mut dyn Laboratory, baseline: Model, options: &Options) -> Result<Diagnosis, LabError> {
    lab.say("residuals of the baseline");
    let readings = one(lab.linearise(&[(baseline.changes.clone(), baseline.values.clone())]))?;
    let mut cells = Cells::new(&readings);
    if cells.is_empty() {
        return Err(LabError::failed("no part of the recording meets the simulated body: nothing can be diagnosed"));
    }
    let noise_ratio = noise_over_stated(lab, &readings);
    for (sd, k) in cells.sd.iter_mut().zip(&cells.keys) {
        *sd *= if k.stream.sensor.is_camera() { noise_ratio } else { 1.0 };
    }
    let folds = foldings(&cells);
    let mut s = Session {
        lab,
        options,
        cells,
        folds,
        noise_ratio,
        design_effect: 1.0,
        noise: Shapes::default(),
        scored: None,
        finer: Vec::new(),
        tried: Vec::new(),
        not_tried: Vec::new(),
        no_time: false,
    };
    let fields = s.finer(&baseline);
    let unsure = s.lab.interrupted();
    let mut state = s.state(baseline.clone(), readings, fields, None)?;
    state.held_out_finer = s.held_out_finer(&state);
    s.correlate(&mut state);
    let mut first = (state.readings.clone(), s.grid(&state));
    let mut out = Progress { unsure, ..Progress::default() };
    let mut adequacy;
    let mut base = state.clone();
    loop {
        adequacy = s.adequacy(&state);
        if out.places.is_none() {
            out.places = Some(locate(&s.cells, &adequacy, s.lab.setting()));
            (out.p_value, out.structure) = (adequacy.p_value, adequacy.structure);
            out.blocks.clone_from(&adequacy.blocks);
        }
        out.interrupted = s.lab.interrupted();
        if !s.is_missing(&adequacy, &state) || out.accepted.len() >= options.rounds || out.interrupted {
            break;
        }
        if s.lab.out_of_time() {
            s.no_time = true;
            s.not_tried.push("whatever a further round would have tried: no time left".into());
            break;
        }
        match s.round(&state, out.accepted.len() + 1) {
            Ok((Some((found, next)), _)) => {
                if let Some(better) = s.better_baseline(&state, &next, found.len()) {
                    state = better;
                    if out.accepted.is_empty() {
                        (base, out.places) = (state.clone(), None);
                        first = (state.readings.clone(), s.grid(&state));
                    }
                    continue;
                }
                out.accepted.extend(found);
                state = s.prune(next, &mut out.accepted);
                s.settle(&mut state, met(&base.readings));
                if let Some(mut other) = s.replace(&state, &mut out.accepted) {
                    s.refine(&mut other);
                    state = s.prune(other, &mut out.accepted);
                    s.settle(&mut state, met(&base.readings));
                }
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
    // Both levels in the noise as it is known at the end.
    let before = s.level_of(&first.0, first.1, &[]);
    Ok(s.conclude((base, before), state, &adequacy, out))
}

/// What the rounds have brought so far.
#[derive(Default)]
struct Progress {
    accepted: Vec<Found>,
    close: Vec<Found>,
    places: Option<Vec<Place>>,
    /// The baseline's residuals in blocks.
    blocks: Vec<Block>,
    p_value: f64,
    structure: f64,
    interrupted: bool,
    unsure: bool,
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
    /// What a finer grid and half the step would change, and what the recording's systematic errors may have changed. A scene that is too
    /// large to be refined, or fails there, has no estimate, and neither has one whose diagnosis was asked to stop.
    fn finer(&mut self, model: &Model) -> Vec<Field> {
        let same = |of: &Model| (&of.changes, &of.values) == (&model.changes, &model.values);
        if let Some((_, known)) = self.finer.iter().find(|(of, _)| same(of)) {
            return known.clone();
        }
        self.lab.say("discretisation error: finer grid, half step");
        let mut all = self.lab.finer(&model.changes, &model.values).unwrap_or_default();
        all.extend(self.lab.systematic(&model.changes, &model.values).unwrap_or_default());
        if !self.lab.interrupted() {
            self.finer.push((model.clone(), all.clone()));
        }
        all
    }

    /// Brings errors of the discretisation up to date: with another effect in place they are others.
    fn refine(&mut self, state: &mut State) {
        state.fields = self.finer(&state.model);
        state.held_out_finer = self.held_out_finer(state);
        self.remeasure(state);
    }

    /// Everything known about a model; means of cells that it lost are taken over from another one's.
    fn state(
        &mut self,
        model: Model,
        readings: Readings,
        fields: Vec<Field>,
        fallback: Option<&Table>,
    ) -> Result<State, LabError> {
        let table = self.cells.table(&readings, fallback);
        let frame = self.frame(&table, &fields);
        let predicted = self.predict(&readings, &table, &frame);
        let (held_out, elsewhere) = match self.lab.held_out(&model) {
            Ok(readings) => (readings, None),
            Err(LabError::Interrupted) => return Err(LabError::Interrupted),
            // A model that cannot follow the other recording is judged by this one.
            Err(e) => (None, Some(e.to_string())),
        };
        Ok(State { model, readings, table, fields, frame, predicted, held_out, held_out_finer: Vec::new(), elsewhere })
    }

    /// Everything known about another model of the same recordings, with the errors that finer computations showed of this one.
    fn beside(&mut self, state: &State, model: Model, readings: Readings) -> Result<State, LabError> {
        let mut new = self.state(model, readings, state.fields.clone(), Some(&state.table))?;
        new.held_out_finer.clone_from(&state.held_out_finer);
        Ok(new)
    }

    /// What finer computations would change in a state's residuals of data that no fit has seen.
    fn held_out_finer(&mut self, state: &State) -> Vec<Field> {
        let Some(coarse) = &state.held_out else { return Vec::new() };
        let moves: Vec<_> = state.fields.iter().zip(&state.frame.fields).map(|(f, y)| (f.name, race::moves(state, y))).collect();
        self.lab.held_out_finer(&state.model, &moves, coarse).unwrap_or_default()
    }

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

    /// Structure of a state's residuals against what noise and discretisation leave.
    fn adequacy(&self, state: &State) -> Adequacy {
        test(&self.cells, &state.frame, &self.noise, self.options.bins, self.options.seed)
    }

    /// True when residuals have structure that is no chance and counts: because it is large, or because more than twice what noise and
    /// discretisation explain is left. What swings within a block does not show in its mean, and what errors of the discretisation could
    /// just make up for, taken twice each, not in the test at all: more than four times as much is missing something in any case.
    fn is_missing(&self, found: &Adequacy, state: &State) -> bool {
        let least = self.options.least_structure * self.reading_noise(&state.readings);
        let level = self.level(state);
        level.is_far() || found.p_value <= self.options.significance && (found.structure >= least || !level.is_close())
    }

    fn frame(&self, table: &Table, fields: &[Field]) -> Frame {
        let means = fields.iter().map(|f| self.cells.means(&f.change)).collect();
        Frame::new(table, means, fields.iter().map(|f| f.rough).collect())
    }

    fn predict(&self, readings: &Readings, table: &Table, frame: &Frame) -> Vec<Predicted> {
        self.folds.iter().map(|f| predict(&self.cells, readings, table, &frame.fields, f)).collect()
    }

    /// Brings a state up to date after the size of the noise changed.
    fn remeasure(&self, state: &mut State) {
        state.table = self.cells.table(&state.readings, None);
        state.frame = self.frame(&state.table, &state.fields);
        state.predicted = self.predict(&state.readings, &state.table, &state.frame);
    }

    /// Finds how much more cells scatter than independent readings would, and rescales everything by it.
    fn correlate(&mut self, state: &mut State) {
        // Asked to stop: what is known without any candidate.
        let variants = self.variants(state).unwrap_or_default();
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
