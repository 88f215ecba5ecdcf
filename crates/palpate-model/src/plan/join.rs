//! Plans that differ in θ and in their recordings alone, as one: members of one batch may then be compared with any of them.

use super::{ClampSite, Plan};
use crate::observation::{Recording, View};
use std::sync::Arc;

/// Plans as one.
#[derive(Clone, Debug)]
pub struct Joint {
    /// The plan, with the recordings of all.
    pub plan: Plan,
    /// Which plans these are, by their places among those that were joined, and what each of them sees of it.
    pub parts: Vec<(usize, View)>,
}

/// Plans as few as can be, in the order of their first parts.
pub fn join(plans: &[&Plan]) -> Vec<Joint> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (i, plan) in plans.iter().enumerate() {
        match groups.iter_mut().find(|group| plans[group[0]].is_like(plan)) {
            Some(group) => group.push(i),
            None => groups.push(vec![i]),
        }
    }
    groups.into_iter().map(|group| joint(plans, &group)).collect()
}

fn joint(plans: &[&Plan], group: &[usize]) -> Joint {
    // The plan's clock goes as far as the longest of them.
    let steps = |i: usize| plans[i].clock.steps;
    let longest = group.iter().copied().fold(group[0], |a, b| if steps(b) > steps(a) { b } else { a });
    let recording = |i: &usize| Recording { observation: plans[*i].observation.clone(), steps: steps(*i) };
    let others: Vec<usize> = group.iter().copied().filter(|i| *i != longest).collect();
    let number = |i: usize| others.iter().position(|o| *o == i).map_or(0, |place| place + 1);
    Joint {
        plan: Plan { others: others.iter().map(recording).collect(), ..plans[longest].clone() },
        parts: group.iter().map(|i| (*i, View::of(number(*i)))).collect(),
    }
}

impl ClampSite {
    /// The same region of the same body, moved alike.
    fn is_like(&self, other: &ClampSite) -> bool {
        self.cells == other.cells && self.nodes == other.nodes && self.areas == other.areas && self.motion == other.motion
    }
}

impl Plan {
    /// True of plans that differ in θ and in their recordings alone, each with a single one.
    pub fn is_like(&self, other: &Plan) -> bool {
        let (a, b) = (&self.clock, &other.clock);
        self.recordings() == 1
            && other.recordings() == 1
            && std::ptr::eq(self.model, other.model)
            && (a.step, a.theta, a.steps == 0) == (b.step, b.theta, b.steps == 0)
            && a.scheme == b.scheme
            && (self.initial, self.pivot, self.band, self.solver) == (other.initial, other.pivot, other.band, other.solver)
            && (&self.curves, &self.layout, &self.planes) == (&other.curves, &other.layout, &other.planes)
            && (&self.masses, &self.fields, &self.followed) == (&other.masses, &other.fields, &other.followed)
            && self.moving == other.moving
            && (&self.driven, &self.times) == (&other.driven, &other.times)
            && self.clamps.len() == other.clamps.len()
            && self.clamps.iter().zip(&other.clamps).all(|(a, b)| a.is_like(b))
            && (Arc::ptr_eq(&self.body, &other.body) || self.body == other.body)
    }
}
