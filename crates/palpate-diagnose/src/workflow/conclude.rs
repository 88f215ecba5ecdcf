//! The verdict: levels before and after, the gap that is closed, and what any load could explain where nothing does.

use super::{Progress, Session, State};
use crate::change::{Change, slack};
use crate::crossval::rms;
use crate::diagnosis::{Diagnosis, Level, MapEntry, Slack, SlackWindow, Verdict};
use crate::laboratory::{LabError, Model, Readings};
use crate::linear::{Basis, dot, least_squares};
use crate::null::{Adequacy, Block, extended};
use palpate_engine::Source;

impl Session<'_> {
    /// Distance of a model from the measurement, and what noise and discretisation explain of it.
    pub(super) fn level(&self, state: &State) -> Level {
        self.level_of(&state.readings, self.grid(state))
    }

    /// Mean square of the discretisation's error that refitting leaves, per residual [m²].
    pub(super) fn grid(&self, state: &State) -> f64 {
        let free = Basis::new(state.table.columns.iter());
        let m = self.cells.len() as f64;
        // What free numbers absorb of a discretisation error does not show in residuals.
        state
            .frame
            .fields
            .iter()
            .map(|f| free.without(f).iter().zip(&self.cells.sd).map(|(d, s)| (d * s).powi(2)).sum::<f64>() / m)
            .sum()
    }

    /// The same with a mean square of discretisation per residual [m²].
    pub(super) fn level_of(&self, readings: &Readings, grid: f64) -> Level {
        let (mut sum, mut n) = (0.0, 0.0);
        for r in readings.rows.iter().filter(|r| r.row.value.is_some()) {
            let point = matches!(r.row.source, Source::Point { .. });
            let ratio = if point { self.noise_ratio } else { 1.0 };
            sum += (ratio * r.row.noise * r.row.along_sight).powi(2) + grid;
            n += if point { 1.0 } else { 1.0 / 3.0 };
        }
        let noise = (sum / f64::max(n, 1.0)).sqrt();
        Level { rms: rms(readings.rows.iter().map(|r| (r.row.source, r.row.value))), noise }
    }

    pub(super) fn conclude(
        &mut self,
        baseline: Model,
        before: Level,
        base_predicted: f64,
        state: State,
        adequacy: &Adequacy,
        mut out: Progress,
    ) -> Result<Diagnosis, LabError> {
        let after = self.level(&state);
        let predicted = (base_predicted, state.predicted[0].rms);
        let held_out = match (self.held_out(&baseline), self.held_out(&state.model)) {
            (Ok(Some(b)), Ok(Some(a))) => Some((b, a)),
            _ => None,
        };
        let (b, a, noise) = match held_out {
            Some((b, a)) => (b.rms, a.rms, b.noise),
            None => (predicted.0, predicted.1, before.noise),
        };
        let gap = b * b - noise * noise;
        let gap_closed = if gap > 0.0 { (1.0 - (a * a - noise * noise).max(0.0) / gap).clamp(0.0, 1.0) } else { 0.0 };
        let adequate = adequacy.p_value > self.options.significance;
        let verdict = match (adequate, out.accepted.is_empty()) {
            (true, true) => Verdict::Adequate,
            (true, false) => Verdict::MissingEffect,
            (false, false) if gap_closed >= self.options.enough => Verdict::MissingEffect,
            _ => Verdict::Unexplained,
        };
        let slack = if verdict == Verdict::Unexplained && !out.interrupted { self.slack(&state).ok() } else { None };
        if verdict == Verdict::Unexplained {
            // Part of an explanation is not one: it is shown, but not believed.
            out.accepted.iter_mut().for_each(|f| f.accepted = false);
        }
        let mut effects = out.accepted;
        effects.extend(out.close);
        Ok(Diagnosis {
            verdict,
            p_value: out.p_value,
            p_value_after: adequacy.p_value,
            baseline: baseline.clone(),
            before,
            places: if verdict == Verdict::Adequate { Vec::new() } else { out.places.unwrap_or_default() },
            map: out.blocks.iter().zip(&adequacy.blocks).map(|(b, a)| self.entry(b, a)).collect(),
            effects,
            tried: std::mem::take(&mut self.tried),
            not_tried: std::mem::take(&mut self.not_tried),
            model: if verdict == Verdict::Unexplained { baseline } else { state.model },
            after: if verdict == Verdict::Unexplained { before } else { after },
            held_out,
            predicted,
            gap_closed,
            slack,
            noise_ratio: self.noise_ratio,
            design_effect: self.design_effect,
            interrupted: out.interrupted,
        })
    }

    fn entry(&self, before: &Block, after: &Block) -> MapEntry {
        let times = before.cells.iter().map(|c| self.cells.times[*c]);
        MapEntry {
            scene: before.scene,
            region: before.region,
            place: self.cells.regions.centers[before.region],
            time: times.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(t), b.max(t))),
            before: before.z,
            after: after.z,
        }
    }

    /// What any smooth load could explain of what is left.
    fn slack(&mut self, state: &State) -> Result<Slack, LabError> {
        self.lab.say("slack: what any load could explain");
        let (from, to) = self.cells.times.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(*t), b.max(*t)));
        let changes = slack(self.lab.setting(), from, to, self.options.windows);
        let own = state.model.values.len();
        let mut tries = Vec::new();
        for c in &changes {
            let mut all = state.model.changes.clone();
            all.push(c.clone());
            let numbers = self.lab.numbers(&all)?;
            tries.push((all, state.model.values.iter().copied().chain(numbers[own..].iter().map(|n| n.start)).collect()));
        }
        let n = state.frame.fields.len();
        let mut columns: Vec<(usize, usize, Vec<f64>)> = Vec::new();
        for (w, readings) in self.lab.linearise_new(&tries, own).into_iter().enumerate() {
            let amplitudes = changes[w].amplitudes();
            for (k, c) in self.cells.table(&readings?, None).columns.iter().enumerate().filter(|(k, _)| amplitudes[*k]) {
                columns.push((w, changes[w].free_slots()[k], state.frame.absorbed.without(&extended(c, n))));
            }
        }
        let y = state.frame.left();
        let chosen: Vec<&[f64]> = columns.iter().map(|c| c.2.as_slice()).collect();
        // Smooth rather than exact: a hundredth of a column's weight damps what the data hardly see.
        let x = least_squares(&chosen, &y, 1e-2).ok_or_else(|| LabError::Failed("no slack".into()))?;
        let mut left = y.clone();
        for (x, c) in x.iter().zip(&chosen) {
            left.iter_mut().zip(*c).for_each(|(l, c)| *l += x * c);
        }
        let m = self.cells.len() as f64;
        let excess = (dot(&y, &y) - m).max(0.02 * m);
        let mut windows: Vec<SlackWindow> = changes
            .iter()
            .map(|c| match c {
                Change::Effect(e) => SlackWindow {
                    time: e
                        .law()
                        .params
                        .iter()
                        .zip(&e.values)
                        .find(|(p, _)| p.key == "time")
                        .and_then(|(_, v)| *v)
                        .unwrap_or(0.0),
                    values: e.values.iter().map(|v| v.unwrap_or(0.0)).collect(),
                },
                Change::Freed { .. } => SlackWindow { time: 0.0, values: Vec::new() },
            })
            .collect();
        for ((w, slot, _), x) in columns.iter().zip(&x) {
            windows[*w].values[*slot] = *x;
        }
        Ok(Slack { share: ((dot(&y, &y) - dot(&left, &left)) / excess).clamp(0.0, 1.0), windows })
    }
}
