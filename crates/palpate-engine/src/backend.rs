//! What a backend does: whole time steps, observations, and the adjoint and tangent of each, for a batch.

use crate::evaluate::{Direction, Evaluation, ParamBatch, Request};
use crate::residuals::FrameResiduals;
use crate::rows::Rows;
use glam::DVec3;
use palpate_model::plan::Plan;
use palpate_model::plan::scheme::Stage;

/// Why a backend refused a plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message} (hint: {hint})")]
pub struct BuildError {
    /// What is missing or too small, with numbers.
    pub message: String,
    /// The way out.
    pub hint: String,
    /// True where the device broke: nothing is wrong with the plan, and no other plan would be taken.
    pub broken: bool,
}

/// Computes simulations of B members that share a [`Plan`] and differ in θ and in the recordings that they are compared with. State stays where the backend keeps it;
/// nothing between [`Backend::set_params`] and [`Backend::read`] needs to wait for a result.
///
/// Shapes: B members, N simulation nodes, P parameters, Q tangent directions.
pub trait Backend: Send {
    /// Constants of a rollout: the plan, θ, and the state that passes need beside u and v.
    type World: Send;
    /// Displacement u [m] and velocity v [m/s] at one instant, `[B, N, 3]` each.
    type State: Send;
    /// dJ/du, dJ/dv on their way back, `[B, N, 3]` each.
    type Adjoint: Send;
    /// du/dθ_q, dv/dθ_q on their way forward, `[B, Q, N, 3]` each.
    type Tangent: Send;
    /// Everything that is read at the end: cost `[B]`, dJ/dθ `[B, P]`, curvature `[B, Q, Q]`, health `[B]`.
    type Tally: Send;

    /// Name for messages and result files.
    fn name(&self) -> String;
    /// Prepares a plan for up to `members` simulations at once.
    fn build(&self, plan: &Plan, members: usize) -> Result<Self::World, BuildError>;
    /// Sets θ `[B, P]` and what each member is compared with; B may be anything up to the `members` of [`Backend::build`]. A member whose
    /// recording takes fewer steps than the plan may be left where it is after them: nothing asks for its later states.
    fn set_params(&self, world: &mut Self::World, theta: &ParamBatch);
    /// Memory for a state of the current batch.
    fn new_state(&self, world: &Self::World) -> Self::State;
    /// Zeroed memory for an adjoint.
    fn new_adjoint(&self, world: &Self::World) -> Self::Adjoint;
    /// Zeroed memory for tangents along `directions`.
    fn new_tangent(&self, world: &Self::World, directions: &[Direction]) -> Self::Tangent;
    /// A zeroed tally with room for what is requested.
    fn new_tally(&self, world: &Self::World, request: &Request) -> Self::Tally;

    /// Runs `body`, a whole rollout from [`Backend::start`] to [`Backend::read`]. A backend that gives its solves a limited effort may run it
    /// again with more, unless it is `watched`: what somebody looks at on the way cannot be computed twice.
    fn rollout<T>(&self, world: &mut Self::World, _watched: bool, mut body: impl FnMut(&mut Self::World) -> T) -> T {
        body(world)
    }

    /// The initial state: rest or static equilibrium, with its velocity.
    fn start(&self, world: &mut Self::World, first: &mut Self::State, tally: &mut Self::Tally);
    /// One solve of a step, from the `past` states that the stage names, in its order, to `next`.
    fn step(
        &self,
        world: &mut Self::World,
        stage: &Stage,
        past: &[&Self::State],
        next: &mut Self::State,
        tally: &mut Self::Tally,
    );
    /// Adds the cost of every frame that lies in step k: `(k Δt, (k + 1) Δt]` on the simulation's clock. Frames at or before
    /// the start belong to step 0, frames after the end to the last step (both held); in a static problem all belong to step 0
    /// with `now` = `next`.
    fn observe(&self, world: &Self::World, k: usize, now: &Self::State, next: &Self::State, tally: &mut Self::Tally);

    /// Adjoint of [`Backend::observe`]: adds to dJ/d(next) in `adj` and to dJ/d(now) in `adj_now`, and to dJ/dθ.
    fn observe_adjoint(
        &self,
        world: &Self::World,
        k: usize,
        now: &Self::State,
        next: &Self::State,
        adj: &mut Self::Adjoint,
        adj_now: &mut Self::Adjoint,
        tally: &mut Self::Tally,
    );
    /// Adjoint of [`Backend::step`]: consumes dJ/d(next) in `adj`, adds the derivatives by the past states to `adj_past`, and adds to dJ/dθ.
    fn step_adjoint(
        &self,
        world: &mut Self::World,
        stage: &Stage,
        past: &[&Self::State],
        next: &Self::State,
        adj: &Self::Adjoint,
        adj_past: &mut [Self::Adjoint],
        tally: &mut Self::Tally,
    );
    /// Adjoint of [`Backend::start`]; ends the way back.
    fn start_adjoint(&self, world: &mut Self::World, first: &Self::State, adj: &Self::Adjoint, tally: &mut Self::Tally);
    /// Sets an adjoint to zero.
    fn clear_adjoint(&self, adj: &mut Self::Adjoint);

    /// Tangent of [`Backend::start`].
    fn start_tangent(&self, world: &mut Self::World, first: &Self::State, tangent: &mut Self::Tangent, tally: &mut Self::Tally);
    /// Tangent of [`Backend::step`]; call directly after it, so that a factorisation can be reused.
    fn step_tangent(
        &self,
        world: &mut Self::World,
        stage: &Stage,
        past: &[&Self::State],
        next: &Self::State,
        tangent_past: &[&Self::Tangent],
        tangent_next: &mut Self::Tangent,
        tally: &mut Self::Tally,
    );
    /// Tangent of [`Backend::observe`]: adds to the Gauss–Newton gradient and matrix.
    fn observe_tangent(
        &self,
        world: &Self::World,
        k: usize,
        now: &Self::State,
        next: &Self::State,
        tangent: &Self::Tangent,
        tangent_next: &Self::Tangent,
        tally: &mut Self::Tally,
    );

    /// Product with the Gauss–Newton matrix of [`Backend::observe`]: adds Jᵀ W J v to dJ/d(next) in `adj`, to dJ/d(now) in `adj_now` and
    /// to dJ/dθ, where the tangents at both ends have the single direction v. Residuals depend on θ also beside the states: by effects on
    /// the measurement, and by where on the curve between the states a frame is.
    fn observe_product(
        &self,
        world: &Self::World,
        k: usize,
        now: &Self::State,
        next: &Self::State,
        tangent: &Self::Tangent,
        tangent_next: &Self::Tangent,
        adj: &mut Self::Adjoint,
        adj_now: &mut Self::Adjoint,
        tally: &mut Self::Tally,
    );

    /// Every residual of the frames in step k of one member with its sensitivities, from what [`Backend::observe`] found; `None`
    /// from a backend that only sums.
    fn rows(
        &self,
        _world: &Self::World,
        _k: usize,
        _states: [&Self::State; 2],
        _tangents: [&Self::Tangent; 2],
        _tally: &Self::Tally,
        _member: usize,
    ) -> Option<Rows> {
        None
    }

    /// Waits until what is still to be computed of the stages that were handed over is no more than a few of them: a rollout that may be
    /// stopped calls it between stages, because nothing that was handed over can be taken back.
    fn keep_pace(&self, _world: &mut Self::World) {}

    /// True when every member has failed, so that the rest of the rollout can be skipped. A backend that would have to
    /// wait for the answer returns `false`.
    fn all_failed(&self, tally: &Self::Tally) -> bool;
    /// Costs, gradients and health; the only wait.
    fn read(&self, world: &Self::World, tally: &Self::Tally) -> Vec<Evaluation>;
    /// Displacements [m] and velocities [m/s] of one member `[N]` each, for reports and tests.
    fn read_state(&self, world: &Self::World, state: &Self::State, member: usize) -> (Vec<DVec3>, Vec<DVec3>);
    /// Residual of every reading of the frames in step k (order of [`Backend::observe`]) of one member, in the order of [`Rows`].
    fn residuals(
        &self,
        world: &Self::World,
        k: usize,
        now: &Self::State,
        next: &Self::State,
        member: usize,
    ) -> Vec<FrameResiduals>;
}
