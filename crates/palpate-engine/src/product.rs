//! Products with the Gauss–Newton matrix of a rollout, without the matrix: one tangent forward and one adjoint back over kept states.

use crate::backend::Backend;
use crate::evaluate::{Direction, Evaluation, ParamBatch, Request, Wanted};
use crate::failure::Failure;
use crate::rollout::stopped;
use crate::stop::Stop;
use crate::tape::{Adjoints, Tape};
use palpate_model::plan::scheme::Stage;

/// Every state of one member.
pub(crate) struct Held<B: Backend> {
    pub(crate) at: ParamBatch,
    pub(crate) states: Tape<B::State>,
}

/// H v at the world's θ: forward over the states with the tangent along `v`, and back with the adjoint of the residuals' change.
pub(crate) fn product<B: Backend>(
    b: &B,
    w: &mut B::World,
    (stages, stop): (&[Stage], &Stop),
    states: &Tape<B::State>,
    v: &[f64],
    wanted: &Wanted,
) -> Result<Vec<f64>, Failure> {
    let mut tally = b.new_tally(w, &Request { gradient: wanted.clone(), ..Request::default() });
    let along = [Direction::Dense(v.to_vec())];
    let mut first = b.new_tangent(w, &along);
    b.start_tangent(w, states.get(0), &mut first, &mut tally);
    let mut tangents = Tape::new(stages, first, true);
    for s in stages {
        if stop.can_end() {
            b.keep_pace(w);
        }
        if stop.is_over() {
            b.read(w, &tally);
            return Err(stopped());
        }
        let next = states.get(s.number + 1);
        if let Some(now) = s.completes {
            b.observe(w, s.step, states.get(now), next, &mut tally);
        }
        let mut t = b.new_tangent(w, &along);
        b.step_tangent(w, s, &states.past(s), next, &tangents.past(s), &mut t, &mut tally);
        tangents.push(t);
    }
    let mut adjoints = Adjoints::<B>::new(stages.len() + 1);
    if stages.is_empty() {
        let (u, t) = (states.get(0), tangents.get(0));
        b.observe(w, 0, u, u, &mut tally);
        let (mut adj, mut adj_now) = (b.new_adjoint(w), adjoints.take(b, w, 0));
        b.observe_product(w, 0, u, u, t, t, &mut adj, &mut adj_now, &mut tally);
        adjoints.put(0, adj_now);
    }
    for s in stages.iter().rev() {
        if stop.can_end() {
            b.keep_pace(w);
        }
        if stop.is_over() {
            b.read(w, &tally);
            return Err(stopped());
        }
        let (next, mut adj) = (states.get(s.number + 1), adjoints.take(b, w, s.number + 1));
        if let Some(now) = s.completes {
            let mut adj_now = adjoints.take(b, w, now);
            let (t, t_next) = (tangents.get(now), tangents.get(s.number + 1));
            b.observe_product(w, s.step, states.get(now), next, t, t_next, &mut adj, &mut adj_now, &mut tally);
            adjoints.put(now, adj_now);
        }
        adjoints.back(b, w, s, (states, next), adj, &mut tally);
    }
    let adj = adjoints.take(b, w, 0);
    b.start_adjoint(w, states.get(0), &adj, &mut tally);
    let Evaluation { gradient, failure, .. } = b.read(w, &tally).remove(0);
    failure.map_or(Ok(gradient), Err)
}
