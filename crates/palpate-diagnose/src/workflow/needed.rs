//! How many of a candidate's numbers a recording asks for. A clamp that slips may be displaced, turned, drifting and turning on, twelve
//! numbers in all; where it is only turned it is as plain an explanation as any other with three. A load on a slender beam is a mass at a
//! distance from the clamp: where in the cross-section it hangs is not seen.

use super::{Session, State};
use crate::change::{Aim, Change};
use crate::judgement::prior::Prior;
use crate::laboratory::Number;
use crate::linear::dot;
use crate::null::absorbed_by;
use std::collections::BTreeMap;

/// Numbers of a change that are moved away from the optimum, by place among its own: by how much.
type Moved = BTreeMap<usize, f64>;

/// One change of a model with the place of its first number.
struct Part<'a> {
    change: &'a Change,
    first: usize,
    numbers: &'a [Number],
    values: &'a [f64],
    amplitudes: Vec<bool>,
}

impl State {
    /// Its changes with their numbers, which come last, in their order.
    fn parts(&self) -> Vec<Part<'_>> {
        let m = &self.model;
        let mut first = m.values.len() - m.changes.iter().map(|c| c.free_slots().len()).sum::<usize>();
        let mut out = Vec::new();
        for change in &m.changes {
            let own = first..first + change.free_slots().len();
            first = own.end;
            let (start, numbers, values) = (own.start, &m.numbers[own.clone()], &m.values[own]);
            out.push(Part { change, first: start, numbers, values, amplitudes: change.amplitudes() });
        }
        out
    }
}

impl Session<'_> {
    /// Of every change, its numbers but for those that leave no more than their price when they are not fitted, around the optimum: the
    /// vectors and amplitudes that go back to "absent" one after the other, coordinates of a place that may be anywhere on the body, and
    /// components of a direction that may point anywhere; one of each stays. To have picked some vectors out of more counts as one number:
    /// an effect that has no others is plainer.
    pub(super) fn needed(&self, state: &State) -> Vec<usize> {
        // A model that leaves more than noise has readings that weigh less.
        let misfit = (state.squares() / self.cells.len() as f64).max(1.0);
        let price = Prior { candidates: self.candidates, readings: self.cells.len() };
        let each = 2.0 * price.number() * misfit;
        state.parts().iter().map(|part| asked_for(state, part, each)).collect()
    }
}

/// How many numbers of a change are worth their price.
fn asked_for(state: &State, part: &Part, each: f64) -> usize {
    let mut count = part.numbers.len();
    let mut moved = Moved::new();
    let mut chosen = false;
    loop {
        let left = rise(state, part.first, &moved);
        let back = |k: usize| (k, part.numbers[k].start - part.values[k]);
        let vectors = removable(part, &moved).into_iter().map(|g| (g.into_iter().map(back).collect(), true));
        let coordinates = vague(part, &moved).into_iter().map(|(k, by)| (Moved::from([(k, by)]), false));
        let cost = |more: &Moved| {
            let with = moved.iter().chain(more).map(|(k, by)| (*k, *by)).collect();
            (rise(state, part.first, &with) - left) / more.len() as f64
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

/// Vectors and amplitudes of a change that keeps another one without them.
fn removable(part: &Part, moved: &Moved) -> Vec<Vec<usize>> {
    let mut open: Vec<(String, Vec<usize>)> = Vec::new();
    let groups = part.change.groups().into_iter().enumerate();
    for (k, name) in groups.filter(|(k, _)| part.amplitudes[*k] && !moved.contains_key(k)) {
        match open.iter_mut().find(|g| g.0 == name) {
            Some((_, members)) => members.push(k),
            None => open.push((name, vec![k])),
        }
    }
    if open.len() > 1 { open.into_iter().map(|g| g.1).collect() } else { Vec::new() }
}

/// Coordinates of places on the body and components of directions, with how far one that may be anywhere, or point anywhere, is from its
/// mean, root mean square. One of every place and direction stays: it has been chosen.
fn vague(part: &Part, moved: &Moved) -> Vec<(usize, f64)> {
    let aims = part.change.aims();
    let mut out = Vec::new();
    for aim in [Aim::Place, Aim::Direction] {
        let all: Vec<usize> = (0..aims.len()).filter(|k| aims[*k] == Some(aim)).collect();
        let length = all.iter().map(|k| part.values[*k].powi(2)).sum::<f64>().sqrt();
        let spread = |n: &Number| match aim {
            Aim::Place => (n.bounds.1 - n.bounds.0) / 12f64.sqrt(),
            Aim::Direction => length / 3f64.sqrt(),
        };
        let open: Vec<usize> = all.into_iter().filter(|k| !moved.contains_key(k)).collect();
        if open.len() > 1 {
            out.extend(open.into_iter().map(|k| (k, spread(&part.numbers[k]))));
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
        assert_eq!(s.needed(&state)[1], COUNT, "{}", state.model.changes[1].kind());
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
