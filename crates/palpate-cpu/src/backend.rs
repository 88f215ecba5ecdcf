//! [`Backend`] on the CPU: every pass over all members of the batch, side by side.

use crate::ahead;
use crate::costs::{Along, Instant, blend};
use crate::linear::vector::{self, Nodes};
use crate::newton;
use crate::simulate;
use crate::terms::zeros;
use crate::world::{Adjoint, Gradient, Member, MemberState, MemberTally, MemberTangent, State, Tally, Tangent, World};
use glam::{DMat3, DVec3};
use palpate_engine::{Backend, BuildError, Curvature, Direction, Evaluation, Failure, FrameResiduals, ParamBatch, Request, Rows};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::scheme::Stage;
use rayon::prelude::*;
use std::sync::Arc;

/// The reference backend.
#[derive(Clone, Copy, Debug, Default)]
pub struct CpuBackend;

impl CpuBackend {
    /// Stiffness of one member at a state without inertia (clamps, contact and ghost penalty included): blocks (row node, column
    /// node, 3 × 3) [N/m], for studies of conditioning and vibration.
    pub fn stiffness(&self, world: &mut World, state: &State, member: usize) -> Vec<(usize, usize, DMat3)> {
        let u = state.members[member].u.clone();
        self.statics(world, &u, member).1
    }

    /// Forces of one member at a displacement `[N]` without inertia [N], in the direction that resists it, and their derivative as
    /// [`CpuBackend::stiffness`] gives it: for studies that bring loads of their own.
    pub fn statics(&self, world: &mut World, u: &[DVec3], member: usize) -> (Vec<DVec3>, Vec<(usize, usize, DMat3)>) {
        let (forces, matrix) = simulate::statics(&world.shared, &mut world.members[member], u);
        let rows = &world.shared.pattern.blocks;
        let of_row = |a: usize| (rows.rows[a]..rows.rows[a + 1]).map(move |k| (a, k));
        let blocks = (0..rows.len()).flat_map(of_row).map(|(a, k)| (a, rows.columns[k] as usize, matrix.values[k]));
        (forces, blocks.collect())
    }
}

impl CpuBackend {
    /// Displacement W of the stress-free shape from the one given `[N]` [m], of a plan whose given shape is the equilibrium.
    ///
    /// # Errors
    /// There is none.
    pub fn stress_free(&self, plan: &Plan, theta: &[f64]) -> Result<Vec<DVec3>, Failure> {
        let mut world = World::new(plan);
        world.set_params(&ParamBatch::from_rows(&[theta.to_vec()]));
        let mut first = State { members: blank(&world) };
        let (shared, member) = (&world.shared, &mut world.members[0]);
        simulate::start(shared, member, &mut first.members[0]).map_err(|reason| newton::at(0.0)(reason).in_plan(plan, theta))?;
        Ok(world.members.remove(0).coefficients.changes.rest.unwrap_or_default())
    }
}

/// The past states of one member.
fn of_member<'a>(past: &[&'a State], member: usize) -> Vec<&'a MemberState> {
    past.iter().map(|s| &s.members[member]).collect()
}

fn blank(world: &World) -> Vec<MemberState> {
    let n = world.shared.plan.body.nodes.len();
    world.members.iter().map(|_| MemberState { u: zeros(n), v: zeros(n) }).collect()
}

fn displacement(at: &Instant, now: &MemberState, next: &MemberState) -> Vec<DVec3> {
    blend(&at.value, [&now.u, &now.v, &next.u, &next.v])
}

/// Derivatives of a frame's displacement along the tangent directions, `[Q][N]`.
fn derivatives(
    at: &Instant,
    shifts: &[usize],
    directions: &[Direction],
    s: [&MemberState; 2],
    d: [&MemberTangent; 2],
) -> Vec<Nodes> {
    (0..directions.len())
        .map(|q| {
            let mut du = blend(&at.value, [&d[0].du[q], &d[0].dv[q], &d[1].du[q], &d[1].dv[q]]);
            let shift: f64 = shifts.iter().map(|p| directions[q].component(*p)).sum();
            if shift != 0.0 {
                // A later start, or stamps that are further ahead, mean an earlier place on the curve.
                vector::add_scaled(&mut du, -shift, &velocity(at, s));
            }
            du
        })
        .collect()
}

/// Velocity of the curve at a frame [m/s].
fn velocity(at: &Instant, s: [&MemberState; 2]) -> Nodes {
    blend(&at.rate, [&s[0].u, &s[0].v, &s[1].u, &s[1].v])
}

/// Adds dJ/du at a frame to both ends of its step.
fn pull_back(at: &Instant, g: &[DVec3], to_now: &mut MemberState, to_next: &mut MemberState) {
    for i in 0..g.len() {
        to_now.u[i] += at.value[0] * g[i];
        to_now.v[i] += at.value[1] * g[i];
        to_next.u[i] += at.value[2] * g[i];
        to_next.v[i] += at.value[3] * g[i];
    }
}

/// Places in θ of numbers that shift the simulation against the frames.
fn shifts(plan: &Plan, m: &Member) -> Vec<usize> {
    m.sensors.clocks().iter().copied().chain([plan.layout.index(ParamKey::TimeStart)]).collect()
}

impl Backend for CpuBackend {
    type World = World;
    type State = State;
    type Adjoint = Adjoint;
    type Tangent = Tangent;
    type Tally = Tally;

    fn name(&self) -> String {
        "cpu".into()
    }

    fn build(&self, plan: &Plan, _members: usize) -> Result<World, BuildError> {
        // One factorisation at a time per member: parallel ones would make results depend on the number of threads.
        faer::set_global_parallelism(faer::Par::Seq);
        Ok(World::new(plan))
    }

    fn set_params(&self, world: &mut World, theta: &ParamBatch) {
        world.set_params(theta);
    }

    fn new_state(&self, world: &World) -> State {
        State { members: blank(world) }
    }

    fn new_adjoint(&self, world: &World) -> Adjoint {
        Adjoint { members: blank(world) }
    }

    fn new_tangent(&self, world: &World, directions: &[Direction]) -> Tangent {
        let n = world.shared.plan.body.nodes.len();
        let blank = |(b, m): (usize, &Member)| {
            let own: Vec<Direction> = directions.iter().take(m.own.unwrap_or(directions.len())).map(|d| d.of(b)).collect();
            MemberTangent {
                rates: simulate::rates(&world.shared, m, &own),
                du: vec![zeros(n); own.len()],
                dv: vec![zeros(n); own.len()],
                directions: Arc::new(own),
            }
        };
        Tangent { members: world.members.iter().enumerate().map(blank).collect() }
    }

    fn new_tally(&self, world: &World, request: &Request) -> Tally {
        let requested = request.sensitivities.len();
        let evaluation = |m: &Member| {
            let q = m.own.unwrap_or(requested);
            Evaluation {
                gradient: vec![0.0; world.shared.plan.layout.len()],
                curvature: (requested > 0).then(|| Curvature { gradient: vec![0.0; q], matrix: vec![0.0; q * q] }),
                residuals: m.viewed.residuals(),
                ..Evaluation::default()
            }
        };
        let plan = &world.shared.plan;
        let gradient = request.gradient.any().then(|| Box::new(Gradient::new(plan, request.gradient.mask(plan.layout.len()))));
        let blank = |m: &Member| MemberTally { evaluation: evaluation(m), gradient: gradient.clone(), compared: Vec::new() };
        Tally { members: world.members.iter().map(blank).collect() }
    }

    fn start(&self, world: &mut World, first: &mut State, tally: &mut Tally) {
        let shared = &world.shared;
        (&mut world.members, &mut first.members, &mut tally.members).into_par_iter().for_each(|(m, s, t)| {
            if let Err(reason) = simulate::start(shared, m, s) {
                t.fail(newton::at(0.0)(reason), &shared.plan, &m.theta);
            }
        });
    }

    fn step(&self, world: &mut World, stage: &Stage, past: &[&State], next: &mut State, tally: &mut Tally) {
        let shared = &world.shared;
        (&mut world.members, &mut next.members, &mut tally.members).into_par_iter().enumerate().for_each(|(b, (m, next, t))| {
            if t.failed() || !m.takes(stage) {
                return;
            }
            if let Err(reason) = simulate::step(shared, m, stage, &of_member(past, b), next) {
                t.fail(newton::at(stage.time)(reason), &shared.plan, &m.theta);
            }
            t.gradient.iter_mut().for_each(|g| ahead::hand_on(m, stage, g));
        });
    }

    fn observe(&self, world: &World, k: usize, now: &State, next: &State, tally: &mut Tally) {
        let shared = &world.shared;
        (&world.members, &now.members, &next.members, &mut tally.members).into_par_iter().for_each(|(m, a, b, t)| {
            if t.failed() {
                return;
            }
            for at in m.instants(shared, k) {
                let compared = m.compare(shared, at.frame, displacement(&at, a, b));
                let (e, sums) = (&mut t.evaluation, compared.sums);
                e.cost += m.scale * sums.cost;
                e.matched += sums.matched;
                e.sum_squares += sums.squares;
                e.sum_signed += sums.signed;
                t.compared.push(compared);
            }
        });
    }

    fn observe_adjoint(
        &self,
        world: &World,
        k: usize,
        now: &State,
        next: &State,
        adj: &mut Adjoint,
        adj_now: &mut Adjoint,
        tally: &mut Tally,
    ) {
        let shared = &world.shared;
        (&world.members, &now.members, &next.members, &mut adj.members, &mut adj_now.members, &mut tally.members)
            .into_par_iter()
            .for_each(|(m, a, b, to_next, to_now, t)| {
                if t.failed() {
                    return;
                }
                let shifts = shifts(&shared.plan, m);
                for at in m.instants(shared, k) {
                    let MemberTally { evaluation, compared, .. } = &mut *t;
                    let found = MemberTally::find(compared, at.frame);
                    let g = found.gradient(m.look(shared, at.frame), m.scale, &mut evaluation.gradient);
                    let later = vector::dot(&g, &velocity(&at, [a, b]));
                    shifts.iter().for_each(|p| evaluation.gradient[*p] -= later);
                    pull_back(&at, &g, to_now, to_next);
                }
            });
    }

    fn step_adjoint(
        &self,
        world: &mut World,
        stage: &Stage,
        past: &[&State],
        next: &State,
        adj: &Adjoint,
        adj_past: &mut [Adjoint],
        tally: &mut Tally,
    ) {
        let shared = &world.shared;
        let mut to: Vec<Vec<&mut MemberState>> = world.members.iter().map(|_| Vec::new()).collect();
        for adjoint in adj_past {
            to.iter_mut().zip(&mut adjoint.members).for_each(|(to, m)| to.push(m));
        }
        (&mut world.members, &next.members, &adj.members, &mut to, &mut tally.members).into_par_iter().enumerate().for_each(
            |(b, (m, next, from, to, t))| {
                if t.failed() || !m.takes(stage) {
                    return;
                }
                let gradient = t.gradient.as_mut().expect("an adjoint goes with a gradient");
                if let Err(reason) = simulate::step_adjoint(shared, m, stage, &of_member(past, b), next, from, to, gradient) {
                    t.fail(newton::at(stage.time)(reason), &shared.plan, &m.theta);
                }
            },
        );
    }

    fn start_adjoint(&self, world: &mut World, first: &State, adj: &Adjoint, tally: &mut Tally) {
        let shared = &world.shared;
        (&mut world.members, &first.members, &adj.members, &mut tally.members).into_par_iter().for_each(|(m, s, a, t)| {
            if t.failed() {
                return;
            }
            let gradient = t.gradient.as_mut().expect("an adjoint goes with a gradient");
            if let Err(reason) = simulate::start_adjoint(shared, m, s, a, gradient) {
                return t.fail(newton::at(0.0)(reason), &shared.plan, &m.theta);
            }
            let out = &mut t.evaluation.gradient;
            m.coefficients.pull_back(&shared.plan, &gradient.coefficients, &gradient.wanted, out);
        });
    }

    fn clear_adjoint(&self, adj: &mut Adjoint) {
        for m in &mut adj.members {
            m.u.fill(DVec3::ZERO);
            m.v.fill(DVec3::ZERO);
        }
    }

    fn start_tangent(&self, world: &mut World, first: &State, tangent: &mut Tangent, tally: &mut Tally) {
        let shared = &world.shared;
        (&mut world.members, &first.members, &mut tangent.members, &mut tally.members).into_par_iter().for_each(
            |(m, s, d, t)| {
                if !t.failed()
                    && let Err(reason) = simulate::start_tangent(shared, m, s, d)
                {
                    t.fail(newton::at(0.0)(reason), &shared.plan, &m.theta);
                }
            },
        );
    }

    fn step_tangent(
        &self,
        world: &mut World,
        stage: &Stage,
        past: &[&State],
        next: &State,
        tangent_past: &[&Tangent],
        tangent_next: &mut Tangent,
        tally: &mut Tally,
    ) {
        let shared = &world.shared;
        (&mut world.members, &next.members, &mut tangent_next.members, &mut tally.members).into_par_iter().enumerate().for_each(
            |(b, (m, next, d_next, t))| {
                let before: Vec<&MemberTangent> = tangent_past.iter().map(|d| &d.members[b]).collect();
                if !t.failed()
                    && m.takes(stage)
                    && let Err(reason) = simulate::step_tangent(shared, m, stage, &of_member(past, b), next, &before, d_next)
                {
                    t.fail(newton::at(stage.time)(reason), &shared.plan, &m.theta);
                }
            },
        );
    }

    fn observe_tangent(
        &self,
        world: &World,
        k: usize,
        now: &State,
        next: &State,
        tangent: &Tangent,
        tangent_next: &Tangent,
        tally: &mut Tally,
    ) {
        let shared = &world.shared;
        (&world.members, &now.members, &next.members, &tangent.members, &tangent_next.members, &mut tally.members)
            .into_par_iter()
            .for_each(|(m, a, b, d0, d1, t)| {
                if t.failed() {
                    return;
                }
                let (shifts, directions) = (shifts(&shared.plan, m), &d0.directions[..]);
                for at in m.instants(shared, k) {
                    let du = derivatives(&at, &shifts, directions, [a, b], [d0, d1]);
                    let MemberTally { evaluation, compared, .. } = &mut *t;
                    let c = evaluation.curvature.as_mut().expect("tangents go with a curvature");
                    let along = Along { directions, du: &du };
                    let found = MemberTally::find(compared, at.frame);
                    found.gauss_newton(m.look(shared, at.frame), along, m.scale, &mut c.gradient, &mut c.matrix);
                }
            });
    }

    fn observe_product(
        &self,
        world: &World,
        k: usize,
        now: &State,
        next: &State,
        tangent: &Tangent,
        tangent_next: &Tangent,
        adj: &mut Adjoint,
        adj_now: &mut Adjoint,
        tally: &mut Tally,
    ) {
        let shared = &world.shared;
        let states = (&world.members, &now.members, &next.members, &tangent.members, &tangent_next.members);
        let added = (&mut adj.members, &mut adj_now.members, &mut tally.members);
        (states, added).into_par_iter().for_each(|((m, a, b, d0, d1), (to_next, to_now, t))| {
            if t.failed() {
                return;
            }
            let (shifts, directions) = (shifts(&shared.plan, m), &d0.directions[..]);
            for at in m.instants(shared, k) {
                let du = derivatives(&at, &shifts, directions, [a, b], [d0, d1]);
                let MemberTally { evaluation, compared, .. } = &mut *t;
                let found = MemberTally::find(compared, at.frame);
                let along = Along { directions, du: &du };
                let g = found.product(m.look(shared, at.frame), along, m.scale, &mut evaluation.gradient);
                let later = vector::dot(&g, &velocity(&at, [a, b]));
                shifts.iter().for_each(|p| evaluation.gradient[*p] -= later);
                pull_back(&at, &g, to_now, to_next);
            }
        });
    }

    fn rows(
        &self,
        world: &World,
        k: usize,
        states: [&State; 2],
        tangents: [&Tangent; 2],
        tally: &Tally,
        member: usize,
    ) -> Option<Rows> {
        let shared = &world.shared;
        let (m, t) = (&world.members[member], &tally.members[member]);
        let (directions, shifts) = (&tangents[0].members[member].directions[..], shifts(&shared.plan, m));
        let mut out = Rows::default();
        for at in m.instants(shared, k) {
            let s = states.map(|s| &s.members[member]);
            let du = derivatives(&at, &shifts, directions, s, tangents.map(|t| &t.members[member]));
            let along = Along { directions, du: &du };
            let rows = MemberTally::find(&t.compared, at.frame).rows(m.look(shared, at.frame), along);
            out.residuals.extend(rows.residuals);
            out.sensitivity.extend(rows.sensitivity);
        }
        Some(out)
    }

    fn all_failed(&self, tally: &Tally) -> bool {
        tally.members.iter().all(MemberTally::failed)
    }

    fn read(&self, _world: &World, tally: &Tally) -> Vec<Evaluation> {
        tally
            .members
            .iter()
            .map(|t| {
                let mut e = t.evaluation.clone();
                if let Some(gradient) = &t.gradient {
                    // Frames add by every number that they depend on.
                    e.gradient.iter_mut().zip(&gradient.wanted).filter(|(_, w)| !**w).for_each(|(g, _)| *g = 0.0);
                }
                if t.failed() {
                    e.cost = f64::INFINITY;
                }
                e
            })
            .collect()
    }

    fn read_state(&self, _world: &World, state: &State, member: usize) -> (Vec<DVec3>, Vec<DVec3>) {
        let s = &state.members[member];
        (s.u.clone(), s.v.clone())
    }

    fn residuals(&self, world: &World, k: usize, now: &State, next: &State, member: usize) -> Vec<FrameResiduals> {
        let shared = &world.shared;
        let (m, a, b) = (&world.members[member], &now.members[member], &next.members[member]);
        m.instants(shared, k)
            .iter()
            .map(|at| m.compare(shared, at.frame, displacement(at, a, b)).residuals(m.look(shared, at.frame)))
            .collect()
    }
}
