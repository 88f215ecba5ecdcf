//! Candidates race: all are fitted for an iteration, and only those within reach of the leader go on (successive halving; Jamieson &
//! Talwalkar, *AISTATS* 2016).

use super::policy::Policy;
use super::{Session, State, Variant, keep_first};
use crate::laboratory::{Fit, LabError, Number, Readings, Start};
use crate::linear::least_squares;

/// Iterations that a fit takes after a lap, in the mean, and fewest that go on however little time there is.
const TO_THE_END: usize = 6;
const FEWEST: usize = 2;
/// Largest change of a fitted number by a linear answer, relative to its size.
const MOVES: f64 = 0.3;
/// Ridge of the fitted numbers' linear answer.
const RIDGE: f64 = 1e-3;

impl Session<'_> {
    /// Fits variants side by side, each from the state that it was scored at and along the first of the shares of its linear estimate that
    /// helps; those that arrived, the lowest cost first, at most one for each candidate. After every lap those go on whose curvature promises most:
    /// a fit that is still far away has gained little, and may end lowest.
    pub(super) fn race<'v>(
        &mut self,
        state: &State,
        tries: &[(&State, &'v Variant)],
        shares: &[f64],
    ) -> Result<Vec<(&'v Variant, Fit)>, LabError> {
        let policy = self.options.search.clone();
        let mut jobs = self.starts(tries, shares);
        let mut running: Vec<Runner> = tries.iter().map(|(_, v)| (*v, None)).collect();
        let laps = policy.laps.len();
        for (lap, iterations) in policy.laps.into_iter().enumerate() {
            let last = lap + 1 == laps;
            let goes_on = |i: &usize| last || running[*i].1.as_ref().is_none_or(|f| !f.settled);
            let open: Vec<usize> = (0..running.len()).filter(goes_on).collect();
            self.lab.say(&format!("fitting {} candidates, lap {} of {laps}", open.len(), lap + 1));
            let starts: Vec<Start> = open.iter().map(|i| jobs[*i].clone()).collect();
            let answers = self.lab.fit(&starts, iterations, policy.tolerance[lap / 2]);
            for (&i, answer) in open.iter().zip(answers) {
                match answer {
                    Ok(fit) => {
                        jobs[i].values.clone_from(&fit.model.values);
                        jobs[i].reach = fit.reach;
                        // A lap that gained nothing leaves what was reached before.
                        match &mut running[i].1 {
                            Some(before) if before.cost < fit.cost => before.promised = fit.promised,
                            reached => *reached = Some(fit),
                        }
                    }
                    Err(LabError::Interrupted) => return Err(LabError::Interrupted),
                    Err(why) => self.missed(&running[i].0.kind(), &why),
                }
            }
            let mut stays = if last { vec![true; running.len()] } else { going_on(&policy, state.readings.cost, &running) };
            if !last {
                self.spare(state, &running, policy.lag, &mut stays);
                self.hurry(&running, &mut stays);
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
    fn spare(&mut self, state: &State, running: &[Runner], lag: f64, stays: &mut [bool]) {
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
    fn hurry(&mut self, running: &[Runner], stays: &mut [bool]) {
        let most = (self.lab.iterations_left() / TO_THE_END).max(FEWEST);
        let fits_on = |i: &usize| stays[*i] && running[*i].1.as_ref().is_none_or(|f| !f.settled);
        let mut left: Vec<usize> = (0..running.len()).filter(fits_on).collect();
        left.sort_by(|a, b| promise(&running[*a]).total_cmp(&promise(&running[*b])));
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

/// A variant on its way.
type Runner<'v> = (&'v Variant, Option<Fit>);

/// The cost that the curvature where it is promises; nothing of what could not be computed.
fn promise(runner: &Runner) -> f64 {
    runner.1.as_ref().map_or(f64::INFINITY, |f| f.cost - if f.settled { 0.0 } else { f.promised })
}

/// Who goes on: those whose promise reaches the leader, and of those on the way the better half. A variant competes with those that have no
/// more numbers: what has more always costs less in the end, and whether these are worth it the judgement says, not the cost.
fn going_on(policy: &Policy, before: f64, running: &[Runner]) -> Vec<bool> {
    let on_the_way = |r: &Runner| r.1.as_ref().is_some_and(|f| !f.settled);
    let goes_on = |me: &Runner| {
        let class: Vec<&Runner> = running.iter().filter(|r| r.0.columns.len() <= me.0.columns.len()).collect();
        let reached = class.iter().filter_map(|r| r.1.as_ref()).map(|f| f.cost).fold(f64::INFINITY, f64::min);
        let worst = reached + policy.lag * (before - reached).max(0.0);
        let mine = promise(me);
        let promises: Vec<f64> = class.into_iter().filter(|r| on_the_way(r)).map(promise).collect();
        let (share, least) = policy.kept;
        let most = ((share * promises.len() as f64).ceil() as usize).max(least);
        mine <= worst && (!on_the_way(me) || promises.iter().filter(|p| **p < mine).count() < most)
    };
    running.iter().map(goes_on).collect()
}

/// By how much a state's numbers move, were they fitted to residuals `y` in its cells: a linear answer.
fn free_moves(state: &State, y: &[f64]) -> Vec<f64> {
    let columns: Vec<&[f64]> = state.table.columns.iter().map(Vec::as_slice).collect();
    least_squares(&columns, y, RIDGE).unwrap_or_else(|| vec![0.0; columns.len()])
}

/// Residuals beside a candidate at these steps.
fn beside(state: &State, v: &Variant, step: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut y = state.table.y.clone();
    for (k, c) in v.columns.iter().enumerate() {
        y.iter_mut().zip(c).for_each(|(y, c)| *y += step(k) * c);
    }
    y
}

/// Where a candidate takes a state's numbers by its linear estimate: along the logarithm of what has a size, within bounds.
pub(super) fn linear_moves(state: &State, v: &Variant) -> Vec<f64> {
    let alone = free_moves(state, &state.table.y);
    let moves = free_moves(state, &beside(state, v, |k| v.score.step[k]));
    let to = |(((v, d), alone), n): (((&f64, &f64), &f64), &Number)| {
        // What they move by without it is no doing of the candidate.
        let d = d - alone;
        let to = if n.bounds.0 >= 0.0 && *v > 0.0 { v * (d / v).exp() } else { v + d };
        to.clamp(n.bounds.0, n.bounds.1)
    };
    state.model.values.iter().zip(&moves).zip(&alone).zip(&state.model.numbers).map(to).collect()
}

/// By how much a state's numbers move, were they fitted to residuals `y` in its cells: a linear answer, within bounds.
pub(super) fn moves(state: &State, y: &[f64]) -> Vec<f64> {
    let moves = free_moves(state, y);
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
    let y = beside(state, v, step);
    // Of what is tried by its size nobody knows how the residuals go with it.
    let with = if v.blunt.is_some() { vec![0.0; state.model.values.len()] } else { moves(state, &y) };
    let own = state.model.values.iter().zip(with).map(|(v, d)| v + d);
    let values = own.chain((0..v.numbers.len()).map(|k| v.numbers[k].after(step(k)))).collect();
    Start { changes, values, reach: f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laboratory::Model;
    use crate::workflow::CandidateId;

    /// A variant of so many numbers.
    fn variant(freedom: usize) -> Variant {
        Variant {
            candidate: CandidateId::Single(freedom),
            changes: Vec::new(),
            columns: vec![Vec::new(); freedom],
            amplitudes: Vec::new(),
            numbers: Vec::new(),
            blunt: None,
            score: crate::score::Score::default(),
        }
    }

    fn at(cost: f64) -> Option<Fit> {
        let model = Model { changes: Vec::new(), values: Vec::new(), numbers: Vec::new(), errors: Vec::new() };
        Some(Fit { model, cost, promised: 0.0, reach: f64::INFINITY, settled: false })
    }

    #[test]
    fn a_variant_competes_with_those_that_have_no_more_numbers() {
        let (one, six) = (variant(1), variant(6));
        let policy = Policy { kept: (0.5, 2), lag: 0.1, ..Policy::default() };
        let ends = |costs: &[(&'static str, f64)]| -> Vec<bool> {
            let of = |name: &str| if name == "one" { &one } else { &six };
            let running: Vec<Runner> = costs.iter().map(|(name, cost)| (of(name), at(*cost))).collect();
            going_on(&policy, 10.0, &running)
        };
        // With one number the best of its class goes on, though four with six numbers are far ahead; what is behind in its own class does not.
        let six_ahead = [("six", 1.0), ("six", 1.1), ("six", 1.2), ("six", 1.3), ("one", 4.0), ("one", 8.0)];
        assert_eq!(ends(&six_ahead), [true, true, true, false, true, false]);
        // With six it must be as good as what has one.
        assert_eq!(ends(&[("one", 1.0), ("six", 4.0), ("six", 1.2)]), [true, false, true]);
    }
}
