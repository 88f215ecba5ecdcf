//! Backward elimination: what was accepted first may be a stand-in for what was found later.

use super::{Session, State};
use crate::change::Change;
use crate::diagnosis::Found;
use crate::laboratory::{LabError, Start};

/// Iterations and tolerance of a fit without an effect, which starts from a fit with it.
const EFFORT: (usize, f64) = (20, 2e-5);

impl Session<'_> {
    /// Leaves out every effect but the newest in turn, fits the others again, and drops it when the recording is predicted as well without it, but for
    /// the price of its numbers. `accepted` are the effects of the state's changes, in their order.
    pub(super) fn prune(&mut self, mut state: State, accepted: &mut Vec<Found>) -> State {
        let first = state.model.changes.len() - accepted.len();
        let mut k = 0;
        // Asked to stop: what is left is there to be shown.
        while k + 1 < accepted.len() && !self.lab.interrupted() {
            self.lab.say(&format!("is {} still needed?", accepted[k].kind));
            if let Ok(Some(less)) = self.without(&state, first + k) {
                state = less;
                accepted.remove(k);
            } else {
                k += 1;
            }
        }
        let places = self.places(&state.model.changes).unwrap_or_default();
        for (found, place) in accepted.iter_mut().zip(places.into_iter().skip(first)) {
            found.parameters = place.map(|i| state.model.found(i)).collect();
        }
        state
    }

    /// The model before a round at the numbers that the round's `added` effects led to, refined, if it explains as much there without them: the fit
    /// had ended in another valley, and what looks like an effect only showed the way out of it.
    pub(super) fn better_baseline(&mut self, before: &State, next: &State, added: usize) -> Option<State> {
        let size = |k: usize| before.model.values[k].abs().max(before.model.numbers[k].scale);
        let far = self.options.search.strayed.0;
        let has_moved = |to: &State| {
            (0..before.model.values.len()).any(|k| (to.model.values[k] - before.model.values[k]).abs() > far * size(k))
        };
        if self.lab.interrupted() || !has_moved(next) {
            return None;
        }
        self.lab.say("is the effect needed, or only the numbers that were fitted with it?");
        let changes = next.model.changes.len();
        let newest: Vec<usize> = (changes - added..changes).collect();
        let mut less = self.refitted_without(next, &newest).ok()?;
        self.refine(&mut less);
        // Back where it was, or no better: the same round would follow for ever.
        let is_better = has_moved(&less) && less.judged.over(&before.judged).is_clear();
        if !is_better || next.judged.over(&less.judged).is_clear() {
            return None;
        }
        Some(less)
    }

    /// The state without one of its changes, if that one is not worth its numbers.
    fn without(&mut self, state: &State, k: usize) -> Result<Option<State>, LabError> {
        let places = self.places(&state.model.changes)?;
        let freedom = places[k].len();
        // With enough numbers anything is followed: a freer effect does not take the place of a plainer one, unless it says the same more exactly.
        let kin = state.model.changes.last().is_some_and(|newest| newest.is_kin(&state.model.changes[k]));
        if places.last().is_some_and(|newest| newest.len() > freedom) && !kin {
            return Ok(None);
        }
        let mut less = self.refitted_without(state, &[k])?;
        if state.judged.over(&less.judged).is_clear() {
            return Ok(None);
        }
        self.refine(&mut less);
        Ok((!state.judged.over(&less.judged).is_clear()).then_some(less))
    }

    /// The state without some of its changes, fitted again.
    pub(super) fn refitted_without(&mut self, state: &State, dropped: &[usize]) -> Result<State, LabError> {
        let places = self.places(&state.model.changes)?;
        let left = state.model.changes.iter().enumerate().filter(|(k, _)| !dropped.contains(k));
        let kept = (0..state.model.values.len()).filter(|i| dropped.iter().all(|k| !places[*k].contains(i)));
        let changes = left.map(|(_, c)| c.clone()).collect();
        let values = kept.map(|i| state.model.values[i]).collect();
        let start = Start { changes, values, reach: f64::INFINITY };
        let fit = super::one(self.lab.fit(&[start], EFFORT.0, EFFORT.1))?;
        let readings = super::one(self.lab.linearise(&[(fit.model.changes.clone(), fit.model.values.clone())]))?;
        self.beside(state, fit.model, readings)
    }

    /// Where the numbers of every change stand among all.
    fn places(&self, changes: &[Change]) -> Result<Vec<std::ops::Range<usize>>, LabError> {
        let ends =
            (0..=changes.len()).map(|n| Ok(self.lab.numbers(&changes[..n])?.len())).collect::<Result<Vec<_>, LabError>>()?;
        Ok(ends.windows(2).map(|w| w[0]..w[1]).collect())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::cells::Cells;
    use crate::crossval::foldings;
    use crate::laboratory::Laboratory;
    use crate::tests::bench::{Bench, NOISE};
    use palpate_model::effects::{Effect, find};

    /// A step that may leave out some of what was accepted.
    pub(in crate::workflow) type Step = fn(&mut Session, State, &mut Vec<Found>) -> State;

    const PRUNE: Step = |s, state, accepted| s.prune(state, accepted);

    /// Kinds that a step leaves of two that were accepted, and the stated number of the last.
    pub(in crate::workflow) fn left(step: Step, accepted: [&str; 2], hidden: &[(&str, f64)]) -> (Vec<String>, f64) {
        left_of(Bench::new(11, hidden, false), step, accepted)
    }

    /// The same of any laboratory.
    pub(in crate::workflow) fn left_of(mut bench: Bench, step: Step, accepted: [&str; 2]) -> (Vec<String>, f64) {
        let effect = |kind: &str| Change::Effect(Effect::absent(find(kind).unwrap()));
        let changes = accepted.map(effect).to_vec();
        let values = bench.numbers(&changes).unwrap().iter().map(|n| n.start).collect();
        let start = Start { changes, values, reach: f64::INFINITY };
        let model = bench.fit(&[start], 1, 0.0).remove(0).unwrap().model;
        let readings = bench.linearise(&[(model.changes.clone(), model.values.clone())]).remove(0).unwrap();
        let cells = Cells::new(&readings);
        let options = crate::Options::default();
        let mut s = Session {
            folds: foldings(&cells),
            blocks: crate::judgement::density::Blocks::new(&cells),
            second: None,
            candidates: 60,
            lab: &mut bench,
            options: &options,
            cells,
            noise_ratio: 1.0,
            design_effect: 1.0,
            noise: Default::default(),
            scored: None,
            early: Default::default(),
            ranked: Vec::new(),
            rivals: Vec::new(),
            base: model.clone(),
            unrefined: false,
            finer: Vec::new(),
            tried: Vec::new(),
            not_tried: Vec::new(),
            no_time: false,
        };
        let state = s.state(model, readings).unwrap();
        let found = |kind: &str| Found {
            kind: kind.into(),
            sentence: String::new(),
            parameters: Vec::new(),
            nats: (0.0, 0.0),
            held_out_gain: 1.0,
            accepted: true,
            indistinguishable_from: Vec::new(),
            movements: Vec::new(),
            separated_by: None,
        };
        let mut accepted = accepted.map(found).to_vec();
        let state = step(&mut s, state, &mut accepted);
        assert_eq!(state.model.changes.len(), accepted.len());
        (accepted.iter().map(|f| f.kind.clone()).collect(), accepted.last().unwrap().parameters.first().map_or(f64::NAN, |p| p.1))
    }

    #[test]
    fn what_a_later_effect_explains_is_dropped_and_what_is_needed_stays() {
        let (bias, drag) = (Bench::first_pattern("depth-bias"), Bench::first_pattern("air-drag"));
        let both = ["depth-bias", "air-drag"];
        let (kinds, number) = left(PRUNE, both, &[(&drag, -1.5 * NOISE)]);
        assert_eq!(kinds, ["air-drag"]);
        // Noise leaves 1/√5760 of 1 mm on the amplitude.
        assert!((number / (1.5 * NOISE) - 1.0).abs() < 0.05, "{number}");
        assert_eq!(left(PRUNE, both, &[(&drag, -1.5 * NOISE), (&bias, 1.5 * NOISE)]).0, both);
    }

    #[test]
    fn a_freer_effect_takes_the_place_of_a_plainer_one_of_its_kind_only() {
        let (parts, force) = (Bench::first_pattern("two-part-stiffness"), Bench::first_pattern("uniform-force"));
        let kin = ["stiffness-gradient", "two-part-stiffness"];
        assert_eq!(left(PRUNE, kin, &[(&parts, -1.5 * NOISE)]).0, ["two-part-stiffness"]);
        let strange = ["depth-bias", "uniform-force"];
        assert_eq!(left(PRUNE, strange, &[(&force, -1.5 * NOISE)]).0, strange);
    }
}
