//! One round: candidates are fitted, judged on data left out, and one of them is chosen, or none.

use super::policy::Policy;
use super::{CandidateId, Fitted, Session, State, Variant, keep_first, most_promising};
use crate::change::Change;
use crate::diagnosis::{Found, Level, Tried};
use crate::laboratory::{LabError, Model, Number};
use crate::movement::{Movement, largest};
use crate::separation::Separated;
use palpate_model::effects::Trial;
use std::rc::Rc;

/// Iterations that a candidate of a race takes in the mean, and fewest candidates that race however little time there is.
const RACE: usize = 9;
const FEWEST: usize = 3;

/// A wall, or another effect at a size, that helps as it stands: what others promise after a fit does not compare.
fn is_wall(policy: &Policy, v: &Variant) -> bool {
    v.blunt.is_some() && v.score.share > policy.walls.1
}

/// The most promising further starts of candidates at unknown places, of variants sorted by what they promise.
fn elsewhere<'v>(policy: &Policy, variants: &'v [Variant], taken: impl Fn(&Variant) -> bool) -> Vec<&'v Variant> {
    let (most, each) = policy.elsewhere;
    let mut out: Vec<&Variant> = Vec::new();
    for v in variants.iter().filter(|v| !v.is_certain() && !taken(v)) {
        if out.len() < most && out.iter().filter(|o| o.candidate == v.candidate).count() < each {
            out.push(v);
        }
    }
    out
}

/// The best prediction first, each candidate once.
pub(super) fn ranked(mut all: Vec<Fitted>) -> Vec<Fitted> {
    all.sort_by(|a, b| b.state.judged.score().total_cmp(&a.state.judged.score()));
    keep_first(&mut all, |f| f.candidate);
    all
}

impl Session<'_> {
    /// One round: the accepted effect with its state (two effects where there is room for them), or the candidates that came closest.
    #[expect(clippy::type_complexity, reason = "one caller, which takes it apart at once")]
    pub(super) fn round(&mut self, state: &State, round: usize) -> Result<(Option<(Vec<Found>, State)>, Vec<Found>), LabError> {
        let mut variants = match self.scored.take() {
            Some(v) => v,
            None => self.variants(state)?,
        };
        variants.sort_by(most_promising);
        let mut seen: Vec<CandidateId> = Vec::new();
        let mut tries: Vec<(&State, &Variant)> = Vec::new();
        let policy = self.options.search.clone();
        let fits = if self.cells.few_instants() { 2 * policy.fits } else { policy.fits };
        for v in &variants {
            let before = seen.iter().filter(|c| **c == v.candidate).count();
            seen.push(v.candidate);
            if before == 0 {
                self.note(round, v);
            }
            // The best start of a candidate, a second one where it acts at an unknown place, and several of walls.
            let starts = match v {
                wall if is_wall(&policy, wall) => policy.walls.0,
                certain if certain.is_certain() => 1,
                _ => 2,
            };
            if before < starts && (tries.len() < fits + fits / 2 || is_wall(&policy, v)) {
                tries.push((state, v));
            }
        }
        let starts: Vec<f64> = state.model.numbers.iter().map(|n| n.start).collect();
        let lost = strayed(state, &starts, policy.strayed.1);
        let home = if round == 1 && (lost || self.affordable() > tries.len()) { self.home(state)? } else { None };
        if let Some((home, variants)) = &home {
            let place = if lost { 0 } else { tries.len() };
            tries.splice(place..place, variants.iter().map(|v| (home, v)));
        }
        self.shorten(&mut tries);
        let mut fitted = self.fitted(state, &tries, &policy.starts, Vec::new())?;
        if !self.explained(&fitted) && !self.lab.out_of_time() {
            // A patchwork is worse than one effect that was not found because its fits started in the wrong places.
            let others = elsewhere(&policy, &variants, |v| tries.iter().any(|t| std::ptr::eq(t.1, v)));
            let further: Vec<(&State, &Variant)> = others.into_iter().map(|v| (state, v)).collect();
            if !further.is_empty() {
                fitted = self.fitted(state, &further, &policy.starts[1..], fitted)?;
            }
        }
        if round == 1
            && !self.lab.out_of_time()
            && let Some((there, variants)) = self.there(state, &fitted)?
        {
            let tries: Vec<(&State, &Variant)> = variants.iter().map(|v| (&there, v)).collect();
            fitted = self.fitted(state, &tries, &policy.starts, fitted)?;
        }
        let explained = self.explained(&fitted);
        let mut fitted = ranked(fitted);
        // There must be room for both.
        if round < policy.rounds && !self.lab.out_of_time() {
            let named = self.choose(state, &fitted).map_or(usize::MAX, |(w, _)| fitted[w].needed);
            let fewer_than = if explained { named } else { usize::MAX };
            let pairs = self.pairs(state, &fitted, &variants, fewer_than)?;
            fitted = self.with_pairs((state, round), &pairs, fitted)?;
            if self.choose(state, &fitted).is_none() && !self.lab.out_of_time() {
                let pairs = self.freer_pairs(state, &variants);
                fitted = self.with_pairs((state, round), &pairs, fitted)?;
            }
        }
        for f in &fitted {
            let kind = f.kind();
            let mine = self.tried.iter_mut().find(|t| t.round == round && t.kind == kind && t.held_out_gain.is_none());
            mine.into_iter().for_each(|t| t.held_out_gain = Some(f.gain));
        }
        self.decide(state, fitted)
    }

    /// Notes pairs in a round, fits them and ranks them among what was fitted before.
    fn with_pairs(
        &mut self,
        (state, round): (&State, usize),
        pairs: &[(Rc<State>, Variant)],
        before: Vec<Fitted>,
    ) -> Result<Vec<Fitted>, LabError> {
        pairs.iter().for_each(|(_, p)| self.note(round, p));
        if pairs.is_empty() {
            return Ok(before);
        }
        let tries: Vec<(&State, &Variant)> = pairs.iter().map(|(from, v)| (from.as_ref(), v)).collect();
        let starts = self.options.search.starts;
        Ok(ranked(self.fitted(state, &tries, &starts, before)?))
    }

    /// Candidates that there is time to fit: a few that arrive say more than many that do not.
    fn affordable(&self) -> usize {
        (self.lab.iterations_left() / RACE).max(FEWEST)
    }

    /// Leaves out what there is no time for: of every candidate the best start comes before a second one of any. Half of the time is for the
    /// first lap, in which all of them run.
    fn shorten(&mut self, tries: &mut Vec<(&State, &Variant)>) {
        let affordable = (self.lab.iterations_left() / (2 * self.options.search.laps[0])).max(FEWEST);
        if affordable < tries.len() {
            let mut seen = Vec::new();
            tries.sort_by_cached_key(|(_, v)| {
                seen.push(v.candidate);
                seen.iter().filter(|c| **c == v.candidate).count()
            });
            for (_, v) in tries.split_off(affordable) {
                self.missed(&v.kind(), &LabError::NoTime);
            }
        }
    }

    /// Notes that a candidate is looked at.
    fn note(&mut self, round: usize, v: &Variant) {
        self.tried.push(Tried { round, kind: v.kind(), promised: v.score.share, held_out_gain: None, open: false });
    }

    /// Fits variants, judges what arrives, and adds it to what was fitted before.
    pub(super) fn fitted(
        &mut self,
        state: &State,
        tries: &[(&State, &Variant)],
        shares: &[f64],
        before: Vec<Fitted>,
    ) -> Result<Vec<Fitted>, LabError> {
        let arrived = self.race(state, tries, shares)?;
        let jobs: Vec<(Vec<Change>, Vec<f64>)> =
            arrived.iter().map(|(_, f)| (f.model.changes.clone(), f.model.values.clone())).collect();
        self.lab.say(&format!("judging {} candidates", jobs.len()));
        let mut fitted = before;
        for ((v, fit), readings) in arrived.into_iter().zip(self.lab.linearise(&jobs)) {
            match readings.and_then(|readings| self.beside(state, fit.model, readings)) {
                Ok(new) => fitted.push(self.compared(state, v, new)),
                Err(LabError::Interrupted) => return Err(LabError::Interrupted),
                Err(why) => self.missed(&v.kind(), &why),
            }
        }
        self.measure_rivals(state, &mut fitted);
        Ok(fitted)
    }

    /// The scene where the baseline's fit started, with the candidates that promise most there, where that is far away: the numbers that
    /// make up best for what is missing may lie where nothing else can be seen any more.
    fn home(&mut self, state: &State) -> Result<Option<(State, Vec<Variant>)>, LabError> {
        let values: Vec<f64> = state.model.numbers.iter().map(|n| n.start).collect();
        if strayed(state, &values, self.options.search.strayed.0) { self.seen_from(state, values) } else { Ok(None) }
    }

    /// The same scene where the best candidate has its numbers, if that is far away: others may explain as much once these do not make up for
    /// what is missing any more.
    fn there(&mut self, state: &State, fitted: &[Fitted]) -> Result<Option<(State, Vec<Variant>)>, LabError> {
        let best = fitted.iter().max_by(|a, b| a.state.judged.score().total_cmp(&b.state.judged.score()));
        let Some(best) = best.filter(|f| f.state.judged.score() > state.judged.score()) else { return Ok(None) };
        let values = best.state.model.values[..state.model.values.len()].to_vec();
        if !strayed(state, &values, self.options.search.strayed.0) {
            return Ok(None);
        }
        let (best, found) = (best.candidate, self.seen_from(state, values)?);
        Ok(found.map(|(there, variants)| (there, variants.into_iter().filter(|v| v.candidate != best).collect())))
    }

    /// A state with other values of its numbers, and the candidates that promise most there.
    fn seen_from(&mut self, state: &State, values: Vec<f64>) -> Result<Option<(State, Vec<Variant>)>, LabError> {
        let (model, policy) = (&state.model, self.options.search.clone());
        let Some(Ok(readings)) = self.lab.linearise(&[(model.changes.clone(), values.clone())]).pop() else { return Ok(None) };
        let table = self.cells.table(&readings, Some(&state.table));
        let frame = self.frame(&table, &state.fields);
        let there = State { model: Model { values, ..model.clone() }, readings, table, frame, ..state.clone() };
        let mut variants = self.variants(&there)?;
        // So far from what was fitted little of an effect tells nothing of more: a load that halves the frequency brings every swing out of step.
        variants.extend(self.sized(&there, &variants, Trial::Starts, &policy.sizes));
        variants.sort_by(most_promising);
        let (mut walls, mut others): (Vec<Variant>, Vec<Variant>) =
            variants.into_iter().partition(|v| is_wall(&policy, v) && !v.changes.iter().all(|c| c.is_tried(Trial::Starts)));
        walls.truncate(policy.walls.0);
        keep_first(&mut others, |v| v.candidate);
        others.truncate(policy.fits * 3 / 4);
        others.extend(walls);
        Ok(Some((there, others)))
    }

    /// A fitted candidate beside the state that it competes with.
    fn compared(&self, before: &State, v: &Variant, state: State) -> Fitted {
        let effects = v.changes.len();
        let needed = state.needed[state.needed.len() - effects..].iter().sum();
        let (gain, nats) = (self.gain(before, &state), state.judged.over(&before.judged).parts());
        let lent = state.judged.clone();
        Fitted { candidate: v.candidate, state, lent, nats, gain, freedom: v.columns.len(), needed, effects }
    }

    /// Share of the gap that one model leaves which another closes, on data left out, in whichever way of leaving some out it is least.
    pub(super) fn gain(&self, state: &State, new: &State) -> f64 {
        let gains = state.predicted.iter().zip(&new.predicted);
        let gains = gains.map(|(b, a)| (b.loss() - a.loss()) / (b.loss() - b.floor).max(0.02 * b.floor));
        let gain = gains.fold(1.0, f64::min);
        match (self.held_out(state), self.held_out(new)) {
            (Some(b), Some(a)) => gain.min((b.rms * b.rms - a.rms * a.rms) / b.gap().max(0.02 * b.noise * b.noise)),
            _ => gain,
        }
    }

    /// Distance of a model from the data that no fit has seen, but for errors of the discretisation.
    pub(super) fn held_out(&self, state: &State) -> Option<Level> {
        state.held_out.as_ref().map(|r| self.level_of(r, 0.0, &state.held_out_finer))
    }

    /// Chooses among fitted candidates, best prediction first.
    #[expect(clippy::type_complexity, reason = "as `round`")]
    fn decide(&mut self, state: &State, fitted: Vec<Fitted>) -> Result<(Option<(Vec<Found>, State)>, Vec<Found>), LabError> {
        let Some((winner, equal)) = self.choose(state, &fitted) else {
            let rivals = fitted.iter().filter(|f| f.state.judged.over(&state.judged).is_as_good());
            self.rivals = rivals.filter_map(|f| self.movement(f)).collect();
            return Ok((None, fitted.iter().take(3).flat_map(|f| self.found(f, false)).collect()));
        };
        let mut found = self.found(&fitted[winner], true);
        // The winner itself, and the same with something added to it, are nothing else.
        let others: Vec<&Fitted> = equal.iter().map(|i| &fitted[*i]).filter(|f| !fitted[winner].is_within(f)).collect();
        found[0].indistinguishable_from.extend(others.iter().map(|f| f.kind()));
        found[0].movements.extend(others.iter().filter_map(|f| self.movement(f)));
        if !others.is_empty() {
            self.lab.say("looking for a measurement that separates candidates");
            let rivals: Vec<&Model> = others.iter().map(|f| &f.state.model).collect();
            let ways = self.lab.separations(&fitted[winner].state.model, &rivals);
            found[0].separated_by = Separated::best(&ways, &found[0].indistinguishable_from);
            // It takes its share of a limited time only.
            let limited = self.lab.iterations_left() < usize::MAX;
            if found[0].separated_by.is_none() && limited {
                self.not_tried.push("a measurement that separates what is indistinguishable: no time left".into());
            }
        }
        let mut fitted = fitted;
        let mut next = fitted.swap_remove(winner).state;
        if !next.own {
            self.refine(&mut next);
        }
        Ok((Some((found, next)), Vec::new()))
    }

    /// What a candidate does to the baseline's numbers, with what was added before.
    fn movement(&self, f: &Fitted) -> Option<Movement> {
        let model = &f.state.model;
        largest(&Change::kinds(&model.changes), &self.base, &model.values, &model.errors, true)
    }

    /// What a candidate adds, effect by effect.
    pub(super) fn found(&self, f: &Fitted, accepted: bool) -> Vec<Found> {
        let model = &f.state.model;
        let mut next = model.values.len() - f.freedom;
        let mut found = |change: &Change| {
            let own = next..next + change.free_slots().len();
            next = own.end;
            Found {
                kind: change.kind().into(),
                sentence: change.sentence().into(),
                parameters: own.map(|k| model.found(k)).collect(),
                nats: f.nats,
                held_out_gain: f.gain.clamp(0.0, 1.0),
                accepted,
                indistinguishable_from: Vec::new(),
                movements: self.movement(f).into_iter().collect(),
                separated_by: None,
            }
        };
        f.changes().iter().map(&mut found).collect()
    }
}

/// True if one of a state's numbers is further from another value of it than this share of that one's size.
fn strayed(state: &State, from: &[f64], share: f64) -> bool {
    let far =
        |((v, from), n): ((&f64, &f64), &Number)| (v - from).abs() > share * if *from == 0.0 { n.scale } else { from.abs() };
    state.model.values.iter().zip(from).zip(&state.model.numbers).any(far)
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_model::effects::{Effect, find};

    fn variant(candidate: usize, kind: &str, amplitudes: &[bool], share: f64) -> Variant {
        Variant {
            candidate: CandidateId::Single(candidate),
            changes: vec![Change::Effect(Effect::absent(find(kind).unwrap()))],
            columns: Vec::new(),
            amplitudes: amplitudes.to_vec(),
            numbers: Vec::new(),
            blunt: (kind == "second-plane").then(Vec::new),
            score: crate::score::Score { share, ..Default::default() },
        }
    }

    #[test]
    fn further_starts_are_those_of_effects_at_unknown_places() {
        let place = [true, false, false, false];
        let mut all = vec![variant(0, "stiffness-gradient", &[true; 3], 0.9)];
        all.extend((0..6).map(|k| variant(1, "point-mass", &place, 0.8 - 0.01 * f64::from(k))));
        all.extend((0..20).map(|k| variant(2 + k, "inclusion", &place, 0.5)));
        let first = std::ptr::from_ref(&all[1]);
        let policy = Policy::default();
        let chosen = elsewhere(&policy, &all, |v| std::ptr::eq(v, first));
        // The best one was tried already; three of a kind are enough, and ten in all.
        let shares: Vec<f64> = chosen.iter().filter(|v| v.candidate == CandidateId::Single(1)).map(|v| v.score.share).collect();
        assert_eq!(shares, [0.79, 0.78, 0.77]);
        assert!(chosen.len() == policy.elsewhere.0 && chosen.iter().all(|v| v.candidate > CandidateId::Single(0)));
    }

    #[test]
    fn a_wall_is_fitted_for_what_it_does_where_it_stands() {
        assert!(is_wall(&Policy::default(), &variant(0, "second-plane", &[true, false, false, false], 0.4)));
        assert!(!is_wall(&Policy::default(), &variant(0, "second-plane", &[true, false, false, false], 0.2)));
        assert!(!is_wall(&Policy::default(), &variant(0, "point-mass", &[true, false, false, false], 0.9)));
    }
}
