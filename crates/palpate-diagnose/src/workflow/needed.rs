//! How many of a candidate's numbers a recording asks for. A clamp that slips may be displaced, turned, drifting and turning on, twelve
//! numbers in all; where it is only turned it is as plain an explanation as any other with three. A load on a slender beam is a mass at a
//! distance from the clamp: where in the cross-section it hangs is not seen.

use super::choose::price;
use super::{Session, State, Variant, met};
use crate::change::{Aim, Change};
use crate::laboratory::Number;
use crate::linear::dot;
use crate::null::absorbed_by;
use std::collections::BTreeMap;

/// Numbers of a candidate that are moved away from the optimum, by place among its own: by how much.
type Moved = BTreeMap<usize, f64>;

impl Session<'_> {
    /// Numbers of a fitted candidate, but for those that leave no more than their price when they are not fitted, around the optimum: the
    /// vectors and amplitudes that go back to "absent" one after the other, coordinates of a place that may be anywhere on the body, and
    /// components of a direction that may point anywhere; of every change one of each stays. To have picked some vectors out of more counts as one number: an effect that has no others is plainer.
    pub(super) fn needed(&self, old: &State, new: &State, v: &Variant) -> usize {
        let mut count = v.columns.len();
        let first = new.model.values.len() - count;
        let each = price(met(&new.readings), &new.predicted[0], &old.predicted[0]);
        let mut moved = Moved::new();
        let mut chosen = false;
        loop {
            let left = rise(new, first, &moved);
            let vectors =
                removable(v, &moved).into_iter().map(|g| (g.into_iter().map(|k| (k, absent(new, first, v, k))).collect(), true));
            let coordinates =
                vague(v, &new.model.values[first..], &moved).into_iter().map(|(k, by)| (Moved::from([(k, by)]), false));
            let cost = |more: &Moved| {
                let with = moved.iter().chain(more).map(|(k, by)| (*k, *by)).collect();
                (rise(new, first, &with) - left) / more.len() as f64
            };
            let open = vectors.chain(coordinates).map(|(more, vector): (Moved, bool)| (cost(&more), more, vector));
            let Some((_, more, vector)) = open.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(cost, ..)| *cost < each) else {
                return count + usize::from(chosen);
            };
            count -= more.len();
            chosen |= vector;
            moved.extend(more);
        }
    }
}

/// How far a candidate's number is from where it was before.
fn absent(state: &State, first: usize, v: &Variant, k: usize) -> f64 {
    v.numbers[k].start - state.model.values[first + k]
}

/// Vectors and amplitudes of changes that keep another one without them.
fn removable(v: &Variant, moved: &Moved) -> Vec<Vec<usize>> {
    let mut next = 0;
    let mut out = Vec::new();
    for groups in v.changes.iter().map(Change::groups) {
        let own = next..next + groups.len();
        next = own.end;
        let mut open: Vec<(&String, Vec<usize>)> = Vec::new();
        for (name, k) in groups.iter().zip(own).filter(|(_, k)| v.amplitudes[*k] && !moved.contains_key(k)) {
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

/// Coordinates of places on the body and components of directions, with how far one that may be anywhere, or point anywhere, is from its
/// mean, root mean square. One of every place and direction stays: it has been chosen. `values` are those of the candidate's numbers.
fn vague(v: &Variant, values: &[f64], moved: &Moved) -> Vec<(usize, f64)> {
    let mut next = 0;
    let mut out = Vec::new();
    for aims in v.changes.iter().map(Change::aims) {
        let own = next..next + aims.len();
        next = own.end;
        for aim in [Aim::Place, Aim::Direction] {
            let all: Vec<usize> = own.clone().zip(&aims).filter(|(_, a)| **a == Some(aim)).map(|(k, _)| k).collect();
            let length = all.iter().map(|k| values[*k].powi(2)).sum::<f64>().sqrt();
            let spread = |n: &Number| match aim {
                Aim::Place => (n.bounds.1 - n.bounds.0) / 12f64.sqrt(),
                Aim::Direction => length / 3f64.sqrt(),
            };
            let open: Vec<usize> = all.into_iter().filter(|k| !moved.contains_key(k)).collect();
            if open.len() > 1 {
                out.extend(open.into_iter().map(|k| (k, spread(&v.numbers[k]))));
            }
        }
    }
    out
}

/// Sum of squares that remains when some of a candidate's numbers are moved and all others are fitted again; `first` is the place of its
/// first number among the model's.
fn rise(state: &State, first: usize, moved: &Moved) -> f64 {
    let mut y = state.frame.y.clone();
    for (k, by) in moved {
        y.iter_mut().zip(&state.table.columns[first + k]).for_each(|(y, c)| *y += by * c);
    }
    let kept = (0..).zip(&state.table.columns).filter(|(i, _)| *i < first || !moved.contains_key(&(i - first)));
    let left = absorbed_by(kept.map(|(_, c)| c), &state.frame.fields).without(&y);
    dot(&left, &left)
}

#[cfg(test)]
mod tests {
    use super::super::prune::tests::{left, left_of};
    use super::*;
    use crate::diagnosis::Found;
    use crate::tests::bench::{Bench, NOISE};

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

    #[test]
    fn coordinates_that_may_be_anywhere_on_the_body_are_not_counted() {
        for (step, kind) in
            [(needs::<5> as fn(&mut Session, State, &mut Vec<Found>) -> State, "tether"), (needs::<2>, "point-mass")]
        {
            let mut bench = Bench::new(11, &[], false);
            bench.body = 1e-6;
            left_of(bench, step, ["depth-bias", kind]);
        }
    }
}
