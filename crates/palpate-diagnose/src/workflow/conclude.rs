//! The verdict: levels before and after, and the gap that is closed.

use super::{Progress, Session, State};
use crate::crossval::rms;
use crate::diagnosis::{Diagnosis, Found, Instant, Level, MapEntry, Verdict};
use crate::laboratory::{Field, LabError, Model, Reading, Readings};
use crate::linear::least_squares;
use crate::movement::{Movement, largest};
use crate::null::{Block, LARGEST};
use crate::quantity::millimetres;
use palpate_engine::Source;
use std::collections::{BTreeMap, BTreeSet};

/// Standard deviations outside the known world from which on an answer says so.
const WORTH_SAYING: f64 = 2.0;
/// Distance over what noise and discretisation explain beyond which a recording that no fit has seen counts as not met: bodies simulated
/// by another method, with nothing missing, stay below 1.2.
const MET: f64 = 1.5;
/// Ridge that keeps errors of the discretisation apart that look the same.
const SMALL: f64 = 1e-3;

impl Session<'_> {
    /// Distance of a model from the measurement, and what noise and discretisation explain of it.
    pub(super) fn level(&self, state: &State) -> Level {
        self.level_of(&state.readings, self.grid(state), &[])
    }

    /// Mean square of the discretisation's error that refitting leaves, per residual [m²].
    pub(super) fn grid(&self, state: &State) -> f64 {
        let m = self.cells.len() as f64;
        let mean_square = |f: &Vec<f64>| f.iter().zip(&self.cells.sd).map(|(d, s)| (d * s).powi(2)).sum::<f64>() / m;
        state.frame.visible().iter().map(mean_square).sum()
    }

    /// The same with a mean square of discretisation per residual [m²], or with what finer computations would change: as much of each is
    /// added, up to [`LARGEST`] times its size, as brings the residuals nearest to zero, and the share of it that is not known stays.
    pub(super) fn level_of(&self, readings: &Readings, grid: f64, finer: &[Field]) -> Level {
        let (mut sum, mut n) = (0.0, 0.0);
        let grid = grid + finer.iter().map(|f| f.rough.powi(2) * f.mean_square()).sum::<f64>();
        for r in readings.rows.iter().filter(|r| r.row.value.is_some()) {
            sum += self.variance(r) + grid;
            n += r.row.source.share();
        }
        let noise = (sum / f64::max(n, 1.0)).sqrt();
        let columns: Vec<Vec<f64>> = finer.iter().map(|f| f.change.iter().map(|c| c.unwrap_or(0.0)).collect()).collect();
        let chosen: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let mut y: Vec<f64> = readings.rows.iter().map(|r| r.row.value.unwrap_or(0.0)).collect();
        for (x, c) in least_squares(&chosen, &y, SMALL).unwrap_or_default().into_iter().zip(&chosen) {
            y.iter_mut().zip(*c).for_each(|(y, c)| *y += x.clamp(-LARGEST, LARGEST) * c);
        }
        let values = readings.rows.iter().zip(y).map(|(r, y)| (r.row.source, r.row.value.map(|_| y)));
        Level { rms: rms(values), noise }
    }

    /// The answer, from the baseline with its level, and the state that the rounds led to.
    pub(super) fn conclude(
        &mut self,
        (mut base, before): (State, Level),
        state: State,
        blocks: &[Block],
        mut out: Progress,
    ) -> Diagnosis {
        let after = self.level(&state);
        let predicted = (base.predicted[0].rms, state.predicted[0].rms);
        let held_out = self.held_out(&base).zip(self.held_out(&state));
        // Each with what finer computations would change of it.
        let (b, a) = held_out.unwrap_or_else(|| {
            let noise = before.noise;
            (Level { rms: predicted.0, noise }, Level { rms: predicted.1, noise })
        });
        let gap_closed = if b.gap() > 0.0 { (1.0 - a.gap() / b.gap()).clamp(0.0, 1.0) } else { 0.0 };
        // The noise may have become known better since.
        self.remeasure(&mut base);
        let remains = state.may_lack();
        let stopped = out.interrupted || self.no_time;
        let stays = state.judged.explains(&base.judged);
        let verdict = match out.accepted.len() {
            0 if !(state.lacks() || out.taken_back || out.open || out.cut) => Verdict::Adequate,
            _ if out.unsure.is_some() => Verdict::Undecided,
            1.. if stays && !(state.lacks() || stopped && remains) => Verdict::MissingEffect,
            // What was not tried may explain it.
            _ if stopped => Verdict::Undecided,
            _ => Verdict::Unexplained,
        };
        // Less than half of an explanation is shown, but not believed.
        let dropped = verdict == Verdict::Unexplained && !stays;
        let answer = if dropped { &base } else { &state };
        let slack = if verdict == Verdict::Unexplained { self.slack_or_why(answer) } else { None };
        let mut caveats =
            caveats(held_out, !out.accepted.is_empty() && !dropped, base.elsewhere.as_ref().or(state.elsewhere.as_ref()));
        let strange = if dropped { &base.strange } else { &state.strange };
        caveats.extend(strange.iter().filter(|s| s.deviations >= WORTH_SAYING).map(|s| format!("The fit ends with {}.", s.what)));
        if verdict == Verdict::Adequate {
            caveats.extend(state.judged.chance());
            caveats.extend(self.not_excluded().map(|m| format!("Not excluded: {}", m.sentence())));
        }
        if stopped {
            self.note_open(if out.interrupted { &LabError::Interrupted } else { &LabError::NoTime });
        }
        let baseline = base.model.clone();
        if dropped {
            out.accepted.iter_mut().for_each(|f| f.accepted = false);
        }
        let mut effects = out.accepted;
        effects.extend(out.close);
        let told = if verdict == Verdict::Adequate { &[] } else { effects.as_slice() };
        let mut movements = named_movements(&baseline, &state.model, told);
        movements.extend(if stopped { self.open_movements() } else { Vec::new() });
        let course = course(&base.readings, if dropped { &base.readings } else { &state.readings });
        Diagnosis {
            verdict,
            missing: base.judged.missing().parts(),
            missing_after: state.judged.missing().parts(),
            baseline: baseline.clone(),
            before,
            places: if verdict == Verdict::Adequate { Vec::new() } else { out.places.unwrap_or_default() },
            map: out.blocks.iter().zip(blocks).map(|(b, a)| self.entry(b, a)).collect(),
            effects,
            tried: std::mem::take(&mut self.tried),
            not_tried: std::mem::take(&mut self.not_tried),
            movements,
            strange: (base.strange, if dropped { Vec::new() } else { state.strange }),
            course,
            model: if dropped { baseline } else { state.model },
            after: if dropped { before } else { after },
            held_out,
            predicted,
            gap_closed,
            slack,
            noise_ratio: self.noise_ratio,
            design_effect: self.design_effect,
            caveats,
            remains,
            interrupted: out.interrupted,
            unsure: out.unsure,
        }
    }

    /// The answer where nothing is known but of the start: the search ended in the baseline's fit, or before the fitted values were simulated.
    pub(super) fn conclude_early(&mut self, start: State, fitted: Model, mut out: Progress, why: &LabError) -> Diagnosis {
        out.interrupted = matches!(why, LabError::Interrupted);
        self.no_time |= !out.interrupted;
        let ended = if out.interrupted { "the diagnosis was interrupted" } else { "the time was over" };
        out.unsure.get_or_insert_with(|| format!("{ended} before the baseline was known"));
        (out.cut, out.open) = (true, true);
        let blocks = self.map(&start);
        out.blocks.clone_from(&blocks);
        let before = self.level(&start);
        let mut d = self.conclude((start.clone(), before), start, &blocks, out);
        if d.model.values != fitted.values {
            d.caveats.push("Distances and candidates are those of the starting values, numbers the best of the fit.".into());
        }
        (d.baseline, d.model) = (fitted.clone(), fitted);
        d
    }

    fn entry(&self, before: &Block, after: &Block) -> MapEntry {
        let times = before.cells.iter().map(|c| self.cells.times[*c]);
        MapEntry {
            scene: before.scene,
            stream: before.stream,
            region: before.region,
            place: self.cells.regions.centers[before.region],
            time: times.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(t), b.max(t))),
            before: before.z,
            after: after.z,
        }
    }
}

/// What the effects that are named, and those that are as good, do to the baseline's numbers.
fn named_movements(baseline: &Model, model: &Model, effects: &[Found]) -> Vec<Movement> {
    let accepted: Vec<&Found> = effects.iter().filter(|f| f.accepted).collect();
    let mut all: Vec<Movement> = Vec::new();
    // All of them together do what the table of values shows.
    if !accepted.is_empty() {
        let kinds: Vec<&str> = accepted.iter().map(|f| f.kind.as_str()).collect();
        all.extend(largest(&kinds.join(" + "), baseline, &model.values, &model.errors, true));
    }
    all.extend(effects.iter().flat_map(|f| f.movements.iter().cloned()));
    let mut seen = BTreeSet::new();
    all.retain(|m| seen.insert(m.candidate.clone()));
    all
}

/// Time and residuals of a frame.
type Frame = (f64, Vec<(Source, Option<f64>)>);

/// Root mean square distances of every instant of two models.
fn course(before: &Readings, after: &Readings) -> Vec<Instant> {
    let by_frame = |readings: &Readings| {
        let mut frames: BTreeMap<(usize, usize), Frame> = BTreeMap::new();
        let put = |r: &Reading| {
            let frame = frames.entry((r.scene, r.row.frame)).or_insert((r.time, Vec::new()));
            frame.1.push((r.row.source, r.row.value));
        };
        readings.rows.iter().for_each(put);
        frames
    };
    let (before, after) = (by_frame(before), by_frame(after));
    let met = |values: &[(Source, Option<f64>)]| values.iter().any(|(_, v)| v.is_some());
    let both = before.into_iter().filter_map(|(key, b)| Some((key.0, b, after.get(&key)?)));
    let seen = both.filter(|(_, b, a)| met(&b.1) && met(&a.1));
    let instant = |(scene, b, a): (usize, Frame, &Frame)| Instant {
        scene,
        time: b.0,
        before: rms(b.1.into_iter()),
        after: rms(a.1.iter().copied()),
    };
    let mut all: Vec<Instant> = seen.map(instant).collect();
    all.sort_by(|a, b| (a.scene, a.time).partial_cmp(&(b.scene, b.time)).unwrap_or(std::cmp::Ordering::Equal));
    all
}

/// What to know of the second recording: distances before and after, and why it could not be simulated, if so.
fn caveats(held_out: Option<(Level, Level)>, corrected: bool, failure: Option<&String>) -> Vec<String> {
    let level = held_out.map(|(before, after)| if corrected { after } else { before });
    let missed = level.filter(|l| l.rms > MET * l.noise).map(|l| {
        let (apart, explained) = (millimetres(l.rms), millimetres(l.noise));
        format!("The second recording is not explained: it is {apart} apart, noise and grid explain {explained}.")
    });
    let failed = failure.map(|e| format!("The second recording took no part: {e}."));
    missed.into_iter().chain(failed).collect()
}
