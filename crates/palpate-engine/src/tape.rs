//! What a rollout keeps on its way: numbered states, and adjoints that are made when something is added to them.

use crate::backend::Backend;
use palpate_model::plan::scheme::Stage;

/// Numbered values of which the oldest are given up once nothing needs them any more.
pub(crate) struct Tape<T> {
    values: Vec<Option<T>>,
    /// By stage, the oldest number that it or a later one needs; empty = everything is kept.
    oldest: Vec<usize>,
    forgotten: usize,
}

impl<T> Tape<T> {
    /// A tape for these stages; with `all` nothing is given up.
    pub(crate) fn new(stages: &[Stage], first: T, all: bool) -> Tape<T> {
        let mut oldest = if all { Vec::new() } else { vec![usize::MAX; stages.len()] };
        let mut least = usize::MAX;
        for (slot, s) in oldest.iter_mut().zip(stages).rev() {
            least = s.from.iter().map(|f| f.0).chain(s.completes).fold(least, usize::min);
            *slot = least;
        }
        Tape { values: vec![Some(first)], oldest, forgotten: 0 }
    }

    /// A value that is still needed.
    pub(crate) fn get(&self, number: usize) -> &T {
        self.values[number].as_ref().expect("a state is kept as long as a stage needs it")
    }

    /// The values that a stage starts from.
    pub(crate) fn past(&self, stage: &Stage) -> Vec<&T> {
        stage.from.iter().map(|f| self.get(f.0)).collect()
    }

    /// The newest value.
    pub(crate) fn last(&self) -> &T {
        self.get(self.values.len() - 1)
    }

    /// Keeps what a stage gave.
    pub(crate) fn push(&mut self, value: T) {
        self.values.push(Some(value));
    }

    /// Gives up what no stage from `next` on needs, and returns one of it for another use.
    pub(crate) fn forget(&mut self, next: usize) -> Option<T> {
        let needed = self.oldest.get(next).copied().unwrap_or(0).min(self.values.len());
        let mut spare = None;
        for number in self.forgotten..needed {
            spare = self.values[number].take().or(spare);
            self.forgotten = number + 1;
        }
        spare
    }

    /// Gives up the newest value.
    pub(crate) fn pop(&mut self) {
        self.values.pop();
    }
}

/// dJ/d(state) of numbered states; zero until something is added.
pub(crate) struct Adjoints<B: Backend> {
    values: Vec<Option<B::Adjoint>>,
    spare: Vec<B::Adjoint>,
}

impl<B: Backend> Adjoints<B> {
    /// Of so many states.
    pub(crate) fn new(states: usize) -> Adjoints<B> {
        Adjoints { values: (0..states).map(|_| None).collect(), spare: Vec::new() }
    }

    /// Takes the adjoint of a state out; [`Adjoints::put`] brings it back.
    pub(crate) fn take(&mut self, backend: &B, world: &B::World, number: usize) -> B::Adjoint {
        self.values[number].take().unwrap_or_else(|| match self.spare.pop() {
            Some(mut spare) => {
                backend.clear_adjoint(&mut spare);
                spare
            }
            None => backend.new_adjoint(world),
        })
    }

    /// Brings an adjoint back.
    pub(crate) fn put(&mut self, number: usize, adjoint: B::Adjoint) {
        self.values[number] = Some(adjoint);
    }

    /// The adjoint of a stage: passes dJ/d(what it gave), `adj`, on to what it started from.
    pub(crate) fn back(
        &mut self,
        backend: &B,
        world: &mut B::World,
        stage: &Stage,
        (states, next): (&Tape<B::State>, &B::State),
        adj: B::Adjoint,
        tally: &mut B::Tally,
    ) {
        let mut past: Vec<B::Adjoint> = stage.from.iter().map(|f| self.take(backend, world, f.0)).collect();
        backend.step_adjoint(world, stage, &states.past(stage), next, &adj, &mut past, tally);
        stage.from.iter().zip(past).for_each(|(f, a)| self.put(f.0, a));
        self.done(adj);
    }

    /// An adjoint that is done with: its memory serves another state.
    fn done(&mut self, adjoint: B::Adjoint) {
        self.spare.push(adjoint);
    }
}
