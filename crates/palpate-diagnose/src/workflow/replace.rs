//! One effect in the place of others of its family. A stiffness gradient that was accepted first and an inclusion that mends what it leaves
//! can be a body of two parts; so can a gradient that leaves something. Adding the right effect and dropping the others does not get there,
//! because they stand in the wrong valley.

use super::rounds::ranked;
use super::variants::Variant;
use super::{Fitted, Session, State, keep_first, most_promising};
use crate::change::Change;
use crate::diagnosis::Found;
use crate::laboratory::LabError;

impl Session<'_> {
    /// The state with one effect in the place of the newest and an older one of its family or, while something may be missing, of a single one;
    /// `None` if there is none that is as good.
    pub(super) fn replace(&mut self, state: &State, accepted: &mut Vec<Found>) -> Option<State> {
        let first = state.model.changes.len() - accepted.len();
        let is_kin = |a: usize, b: usize| state.model.changes[first + a].is_kin(&state.model.changes[first + b]);
        let newest = accepted.len().checked_sub(1)?;
        let mut places: Vec<Vec<usize>> = (0..newest).filter(|k| is_kin(*k, newest)).map(|k| vec![k, newest]).collect();
        if state.judged.may_be_missing() {
            places.extend((0..=newest).rev().filter(|k| is_kin(*k, *k)).map(|k| vec![k]));
        }
        for old in places {
            if self.lab.interrupted() || self.lab.out_of_time() {
                break;
            }
            let kinds: Vec<&str> = old.iter().map(|k| accepted[*k].kind.as_str()).collect();
            self.lab.say(&format!("what else may {} be?", kinds.join(" + ")));
            let dropped: Vec<usize> = old.iter().map(|k| first + k).collect();
            if let Ok(Some(one)) = self.one_for(state, &dropped) {
                old.iter().rev().for_each(|k| _ = accepted.remove(*k));
                accepted.extend(self.found(&one, true));
                return Some(one.state);
            }
        }
        None
    }

    /// The effect of their family that explains as much as these changes, if there is one.
    fn one_for(&mut self, state: &State, dropped: &[usize]) -> Result<Option<Fitted>, LabError> {
        let old: Vec<&Change> = dropped.iter().map(|k| &state.model.changes[*k]).collect();
        let without = self.refitted_without(state, dropped)?;
        // One for itself is no news.
        let wanted = |c: &Change| c.is_kin(old[0]) && (old.len() > 1 || c.kind() != old[0].kind());
        let mut variants = self.variants_of(&without, wanted)?;
        variants.sort_by(most_promising);
        let mut best: Vec<&Variant> = variants.iter().collect();
        keep_first(&mut best, |v| v.candidate);
        let policy = self.options.search.clone();
        best.truncate(policy.kin);
        let tries: Vec<(&State, &Variant)> = best.into_iter().map(|v| (&without, v)).collect();
        let fitted = ranked(self.fitted(&without, &tries, &policy.starts, Vec::new())?);
        Ok(fitted.into_iter().find(|f| f.state.judged.over(&state.judged).nats >= 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::super::prune::tests::{Step, left};
    use crate::tests::bench::{Bench, NOISE};

    const REPLACE: Step = |s, state, accepted| s.replace(&state, accepted).unwrap_or(state);

    #[test]
    fn two_of_a_family_that_are_one_other_become_it() {
        let [gradient, inclusion, parts] = ["stiffness-gradient", "inclusion", "two-part-stiffness"].map(Bench::first_pattern);
        let two = ["stiffness-gradient", "inclusion"];
        let (kinds, number) = left(REPLACE, two, &[(&parts, -1.5 * NOISE)]);
        assert_eq!(kinds, ["two-part-stiffness"]);
        // Noise leaves 1/√5760 of 1 mm on the amplitude.
        assert!((number / (1.5 * NOISE) - 1.0).abs() < 0.05, "{number}");
        assert_eq!(left(REPLACE, two, &[(&gradient, -1.5 * NOISE), (&inclusion, 1.5 * NOISE)]).0, two);
    }
}
