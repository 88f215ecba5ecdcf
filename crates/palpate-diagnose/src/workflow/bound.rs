//! Slack: what any smooth load could explain where no known effect does.

use super::{Session, State};
use crate::change::{Change, slack};
use crate::diagnosis::{Slack, SlackWindow};
use crate::laboratory::LabError;
use crate::linear::{dot, least_squares_in};
use crate::null::extended;

/// The first numbers of the field are forces, the others their gradients.
const FORCES: usize = 3;
/// Ridges, the smallest field first.
const RIDGES: [f64; 8] = [1.0, 0.3, 0.1, 0.03, 0.01, 1e-3, 1e-4, 1e-6];
/// The smallest field with this share of what any of them explains is shown.
const ENOUGH: f64 = 0.95;

impl Session<'_> {
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
        // Forces count alike in every window and direction, and so do their gradients: what hardly shows, such as a pressure towards the
        // ground, stays small.
        let kind = |slot: usize| usize::from(slot >= FORCES);
        let mut largest = [0.0f64; 2];
        columns.iter().for_each(|c| largest[kind(c.1)] = largest[kind(c.1)].max(dot(&c.2, &c.2).sqrt()));
        let size: Vec<f64> = columns.iter().map(|c| largest[kind(c.1)]).collect();
        let remains = |x: &[f64]| {
            let mut left = y.clone();
            x.iter().zip(&chosen).for_each(|(x, c)| left.iter_mut().zip(*c).for_each(|(l, c)| *l += x * c));
            dot(&left, &left)
        };
        let solved: Vec<(Vec<f64>, f64)> = RIDGES
            .iter()
            .filter_map(|ridge| least_squares_in(&chosen, &y, *ridge, &size))
            .map(|x| (remains(&x), x))
            .map(|(left, x)| (x, dot(&y, &y) - left))
            .collect();
        let most = solved.iter().map(|s| s.1).fold(0.0, f64::max);
        let plainest = solved.into_iter().find(|s| s.1 >= ENOUGH * most);
        let (x, gain) = plainest.ok_or_else(|| LabError::failed("no slack"))?;
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
        Ok(Slack { share: (gain / excess).clamp(0.0, 1.0), windows })
    }

    /// The same, or a line in `not_tried` that says why there is none.
    pub(super) fn slack_or_why(&mut self, state: &State) -> Option<Slack> {
        let slack = self.slack(state);
        if let Err(why) = &slack {
            self.not_tried.push(format!("slack, what any load could explain: {why}"));
        }
        slack.ok()
    }
}
