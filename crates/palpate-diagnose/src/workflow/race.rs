//! Candidates race: all are fitted for an iteration, and only those within reach of the leader go on (successive halving; Jamieson &
//! Talwalkar, *AISTATS* 2016).

use super::{Session, State, Variant, keep_first};
use crate::laboratory::{Fit, LabError, Number, Readings, Start};
use crate::linear::least_squares;

/// Iterations of a lap, the relative decrease of the cost at which a fit is settled, and by what share of the leader's gain others may lag
/// behind after it and still go on. The last lap brings what is compared to its optimum.
pub(super) const LAPS: [(usize, f64, f64); 4] = [(2, 2e-4, 0.4), (3, 2e-4, 0.05), (8, 2e-5, 0.02), (25, 2e-5, 1.0)];
/// Iterations that a fit takes after a lap, in the mean, and fewest that go on however little time there is.
const TO_THE_END: usize = 6;
const FEWEST: usize = 2;
/// A fit may gain as many times again what it gained in a lap.
const STAMINA: f64 = 2.0;
/// Shares of the linear estimate that a fit may start from: the first at which the cost is lower than without.
pub(super) const STARTS: [f64; 3] = [1.0, 0.3, 0.1];
/// The same of a fit that starts carefully: far out an effect is no longer linear, and what is found there may be another valley.
pub(super) const CAREFUL: [f64; 2] = [0.3, 0.1];
/// A lap that gained less than this share of the cost may have spent itself on finding the length of a step.
const NO_GAIN: f64 = 0.02;
/// Laps after which such a fit goes on if it promised nearly as much as the best, by this share.
const PATIENCE: (usize, f64) = (2, 0.8);
/// Largest change of a fitted number by a linear answer, relative to its size.
const MOVES: f64 = 0.3;
/// Ridge of the fitted numbers' linear answer.
const RIDGE: f64 = 1e-3;

impl Session<'_> {
    /// Fits variants side by side, each from the state that it was scored at and along the first of the shares of its linear estimate that
    /// helps; those that arrived, the lowest cost first, at most one for each candidate.
    pub(super) fn race<'v>(
        &mut self,
        state: &State,
        tries: &[(&State, &'v Variant)],
        shares: &[f64],
    ) -> Result<Vec<(&'v Variant, Fit)>, LabError> {
        let mut jobs = self.starts(tries, shares);
        let most = tries.iter().map(|(_, v)| v.score.share).fold(0.0, f64::max);
        let mut running: Vec<(&Variant, Option<Fit>)> = tries.iter().map(|(_, v)| (*v, None)).collect();
        for (lap, (iterations, tolerance, lag)) in LAPS.into_iter().enumerate() {
            let last = lap + 1 == LAPS.len();
            let goes_on = |i: &usize| last || running[*i].1.as_ref().is_none_or(|f| !f.settled);
            let open: Vec<usize> = (0..running.len()).filter(goes_on).collect();
            self.lab.say(&format!("fitting {} candidates, lap {} of {}", open.len(), lap + 1, LAPS.len()));
            let answers = self.lab.fit(&open.iter().map(|i| jobs[*i].clone()).collect::<Vec<_>>(), iterations, tolerance);
            for (&i, answer) in open.iter().zip(answers) {
                match answer {
                    Ok(fit) => {
                        jobs[i].values.clone_from(&fit.model.values);
                        jobs[i].reach = fit.reach;
                        // A lap that gained nothing leaves what was reached before.
                        match &mut running[i].1 {
                            Some(before) if before.cost < fit.cost => before.gained = 0.0,
                            reached => *reached = Some(fit),
                        }
                    }
                    Err(LabError::Interrupted) => return Err(LabError::Interrupted),
                    Err(why) => self.missed(&running[i].0.kind(), &why),
                }
            }
            let reached = |r: &(&Variant, Option<Fit>)| r.1.as_ref().map_or(f64::INFINITY, |f| f.cost);
            let best = running.iter().map(reached).fold(f64::INFINITY, f64::min);
            let worst = best + lag * (state.readings.cost - best).max(0.0);
            // Steps have a longest length: who starts far away and still gains with every step is not behind for good.
            let promises = |r: &(&Variant, Option<Fit>)| r.1.as_ref().map_or(f64::INFINITY, |f| f.cost - STAMINA * f.gained);
            let searches = |f: &Fit| !f.settled && f.gained < NO_GAIN * f.cost && f.cost < state.readings.cost;
            let patient = |r: &(&Variant, Option<Fit>)| {
                lap < PATIENCE.0 && r.0.score.share >= PATIENCE.1 * most && r.1.as_ref().is_some_and(searches)
            };
            let mut stays: Vec<bool> = running.iter().map(|r| promises(r) <= worst || patient(r)).collect();
            self.spare(state, &running, lag, &mut stays);
            if !last {
                self.hurry(&running, promises, &mut stays);
            }
            let mut keep = stays.iter();
            jobs.retain(|_| *keep.next().unwrap_or(&false));
            let mut keep = stays.iter();
            running.retain(|_| *keep.next().unwrap_or(&false));
        }
        let mut arrived: Vec<(&Variant, Fit)> = running.into_iter().filter_map(|(v, f)| Some((v, f?))).collect();
        arrived.sort_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
        keep_first(&mut arrived, |(v, _)| v.candidate);
        Ok(arrived)
    }

    /// Lets those go on that have arrived and leave, but for errors of the discretisation, hardly more than the leader. Where these are
    /// larger than noise, a free effect that bends to them costs less than the right one, which cannot.
    fn spare(&mut self, state: &State, running: &[(&Variant, Option<Fit>)], lag: f64, stays: &mut [bool]) {
        if self.grid(state) <= self.reading_noise(&state.readings).powi(2) {
            return;
        }
        let cost = |i: &usize| running[*i].1.as_ref().map_or(f64::INFINITY, |f| f.cost);
        let Some(leader) = (0..running.len()).min_by(|a, b| cost(a).total_cmp(&cost(b))) else { return };
        let arrived = |i: &usize| running[*i].1.as_ref().is_some_and(|f| f.settled) && cost(i) < state.readings.cost;
        let behind: Vec<usize> = (0..running.len()).filter(|i| !stays[*i] && arrived(i)).collect();
        if behind.is_empty() {
            return;
        }
        let open: Vec<usize> = std::iter::once(leader).chain(behind).collect();
        let models =
            open.iter().filter_map(|i| running[*i].1.as_ref()).map(|f| (f.model.changes.clone(), f.model.values.clone()));
        let answers = self.lab.linearise(&models.collect::<Vec<_>>());
        let left: Vec<f64> = answers.into_iter().map(|r| r.map_or(f64::INFINITY, |r| self.left(state, &r))).collect();
        let worst = left[0] + lag * (state.squares() - left[0]).max(0.0);
        open.iter().zip(&left).for_each(|(i, left)| stays[*i] |= *left <= worst);
    }

    /// Where time is short only so many of those that are not at their optimum yet go on as may come to it, those that promise most.
    fn hurry(
        &mut self,
        running: &[(&Variant, Option<Fit>)],
        promises: impl Fn(&(&Variant, Option<Fit>)) -> f64,
        stays: &mut [bool],
    ) {
        let most = (self.lab.iterations_left() / TO_THE_END).max(FEWEST);
        let fits_on = |i: &usize| stays[*i] && running[*i].1.as_ref().is_none_or(|f| !f.settled);
        let mut left: Vec<usize> = (0..running.len()).filter(fits_on).collect();
        left.sort_by(|a, b| promises(&running[*a]).total_cmp(&promises(&running[*b])));
        for i in left.into_iter().skip(most) {
            stays[i] = false;
            self.missed(&running[i].0.kind(), &LabError::NoTime);
        }
    }

    /// Sum of squares that another model of the same recordings leaves, but for what its numbers and the discretisation explain.
    fn left(&self, state: &State, readings: &Readings) -> f64 {
        self.frame(&self.cells.table(readings, Some(&state.table)), &state.fields).squares()
    }

    /// Where each fit starts: along the linear estimate, as far as that lowers the cost.
    fn starts(&mut self, tries: &[(&State, &Variant)], shares: &[f64]) -> Vec<Start> {
        let mut jobs: Vec<_> = tries.iter().map(|(from, v)| start(from, v, shares[0])).collect();
        let mut open: Vec<usize> = (0..jobs.len()).collect();
        self.lab.say(&format!("looking for starts of {} candidates", jobs.len()));
        for share in &shares[1..] {
            let places: Vec<_> = open.iter().map(|i| (jobs[*i].changes.clone(), jobs[*i].values.clone())).collect();
            let costs = self.lab.costs(&places);
            let kept: Vec<bool> = open.iter().zip(costs).map(|(i, c)| c < tries[*i].0.readings.cost).collect();
            open = open.into_iter().zip(kept).filter(|(_, kept)| !kept).map(|(i, _)| i).collect();
            open.iter().for_each(|i| jobs[*i] = start(tries[*i].0, tries[*i].1, *share));
        }
        jobs
    }

    /// Notes that a hypothesis could not be tried.
    pub(super) fn missed(&mut self, kind: &str, why: &LabError) {
        self.no_time |= matches!(why, LabError::NoTime);
        let line = format!("{kind}: {why}");
        if !self.not_tried.contains(&line) {
            self.not_tried.push(line);
        }
    }
}

/// By how much a state's numbers move, were they fitted to residuals `y` in its cells: a linear answer, within bounds.
pub(super) fn moves(state: &State, y: &[f64]) -> Vec<f64> {
    let columns: Vec<&[f64]> = state.table.columns.iter().map(Vec::as_slice).collect();
    let moves = least_squares(&columns, y, RIDGE).unwrap_or_else(|| vec![0.0; columns.len()]);
    let within = |((d, v), n): ((f64, &f64), &Number)| {
        let most = MOVES * v.abs().max(n.scale);
        (v + d.clamp(-most, most)).clamp(n.bounds.0, n.bounds.1) - v
    };
    moves.into_iter().zip(&state.model.values).zip(&state.model.numbers).map(within).collect()
}

/// A candidate at a share of its linear estimate, with the fitted numbers where they best go with it.
fn start(state: &State, v: &Variant, share: f64) -> Start {
    let mut changes = state.model.changes.clone();
    changes.extend_from_slice(&v.changes);
    let step = |k: usize| {
        let (least, most) = v.numbers[k].room();
        share * v.score.step[k].clamp(least, most)
    };
    let mut y = state.table.y.clone();
    for (k, c) in v.columns.iter().enumerate() {
        y.iter_mut().zip(c).for_each(|(y, c)| *y += step(k) * c);
    }
    let own = state.model.values.iter().zip(moves(state, &y)).map(|(v, d)| v + d);
    let values = own.chain((0..v.numbers.len()).map(|k| v.numbers[k].after(step(k)))).collect();
    Start { changes, values, reach: f64::INFINITY }
}
