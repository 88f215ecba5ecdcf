//! How many of a candidate's numbers a recording asks for. A clamp that slips may be displaced, turned, drifting and turning on, twelve
//! numbers in all; where it is only turned it is as plain an explanation as any other with three.

use super::choose::price;
use super::{Session, State, Variant, met};
use crate::change::Change;
use crate::linear::dot;
use crate::null::absorbed_by;
use std::collections::BTreeSet;

impl Session<'_> {
    /// Numbers of a fitted candidate, but for the vectors and amplitudes that go back to "absent" one after the other without leaving
    /// more than their price, around the optimum; of every change one stays. To have picked some out of more counts as one number: an
    /// effect that has no others is plainer.
    pub(super) fn needed(&self, old: &State, new: &State, v: &Variant) -> usize {
        let mut count = v.columns.len();
        let first = new.model.values.len() - count;
        let each = price(met(&new.readings), &new.predicted[0], &old.predicted[0]);
        let mut dropped: BTreeSet<usize> = BTreeSet::new();
        loop {
            let left = rise(new, first, v, &dropped);
            let cost = |group: &Vec<usize>| {
                let with = dropped.iter().chain(group).copied().collect();
                (rise(new, first, v, &with) - left) / group.len() as f64
            };
            let open = removable(v, &dropped).into_iter().map(|g| (cost(&g), g)).min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, group)) = open.filter(|(cost, _)| *cost < each) else {
                return count + usize::from(!dropped.is_empty());
            };
            count -= group.len();
            dropped.extend(group);
        }
    }
}

/// Vectors and amplitudes of changes that keep another one without them.
fn removable(v: &Variant, dropped: &BTreeSet<usize>) -> Vec<Vec<usize>> {
    let mut next = 0;
    let mut out = Vec::new();
    for groups in v.changes.iter().map(Change::groups) {
        let own = next..next + groups.len();
        next = own.end;
        let mut open: Vec<(&String, Vec<usize>)> = Vec::new();
        for (name, k) in groups.iter().zip(own).filter(|(_, k)| v.amplitudes[*k] && !dropped.contains(k)) {
            match open.iter_mut().find(|g| g.0 == name) {
                Some((_, members)) => members.push(k),
                None => open.push((name, vec![k])),
            }
        }
        if open.len() > 1 {
            out.extend(open.into_iter().map(|g| g.1));
        }
    }
    out
}

/// Sum of squares that remains when some of a candidate's numbers are where they were before and all others are fitted again; `first` is
/// the place of its first number among the model's.
fn rise(state: &State, first: usize, v: &Variant, dropped: &BTreeSet<usize>) -> f64 {
    let mut y = state.frame.y.clone();
    for k in dropped {
        let back = v.numbers[*k].start - state.model.values[first + k];
        y.iter_mut().zip(&state.table.columns[first + k]).for_each(|(y, c)| *y += back * c);
    }
    let kept = (0..).zip(&state.table.columns).filter(|(i, _)| *i < first || !dropped.contains(&(i - first)));
    let left = absorbed_by(kept.map(|(_, c)| c), &state.frame.fields).without(&y);
    dot(&left, &left)
}

#[cfg(test)]
mod tests {
    use super::super::prune::tests::left;
    use super::*;
    use crate::diagnosis::Found;
    use crate::tests::bench::NOISE;

    /// Counts the numbers that the newest of two changes needs.
    fn needs<const COUNT: usize>(s: &mut Session, state: State, _: &mut Vec<Found>) -> State {
        let kind = state.model.changes[1].kind();
        let old = s.refitted_without(&state, &[1]).unwrap();
        let variant = s.variants_of(&old, |c| c.kind() == kind).unwrap().remove(0);
        assert_eq!(s.needed(&old, &state, &variant), COUNT, "{kind}");
        state
    }

    #[test]
    fn a_vector_that_the_recording_does_not_ask_for_is_not_counted() {
        let camera = ["depth-bias", "camera-pose"];
        let hidden = |slots: &[usize]| -> Vec<(String, f64)> {
            slots.iter().map(|s| (format!("camera-pose {s} []"), 1.5 * NOISE)).collect()
        };
        // Three numbers of the shift, three of the turn.
        for (step, slots) in [
            (needs::<4> as fn(&mut Session, State, &mut Vec<Found>) -> State, &[1][..]),
            (needs::<4>, &[5]),
            (needs::<6>, &[1, 5]),
        ] {
            let hidden = hidden(slots);
            let hidden: Vec<(&str, f64)> = hidden.iter().map(|(n, x)| (n.as_str(), *x)).collect();
            left(step, camera, &hidden);
        }
        // One of them stays where nothing is hidden, and a single vector always.
        left(needs::<4>, camera, &[]);
        left(needs::<3>, ["depth-bias", "uniform-force"], &[]);
    }

    #[test]
    fn places_are_counted_with_the_amplitude_that_they_belong_to() {
        left(needs::<7>, ["depth-bias", "tether"], &[]);
    }
}
