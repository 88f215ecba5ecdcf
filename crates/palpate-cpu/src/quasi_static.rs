//! One member's sequence of equilibria: stages without inertia, in which nothing depends on a rate or on the past.
//!
//! A state is Newton's starting point for the next one. Where that does not lead there, the way is halved in time: loads, clamps and
//! attachments between both are part of the problem. What is found is an equilibrium by itself, so its derivatives need no other state:
//! one linear solve each with the exact tangent. A state whose tangent has a negative eigenvalue is no place where a body stays.

use crate::ahead;
use crate::back;
use crate::kept::{self, BACK};
use crate::linear::Purpose;
use crate::linear::matrix::Matrix;
use crate::linear::vector::Nodes;
use crate::newton::{self, Effort, Reason};
use crate::simulate::{Start, check, equation, minus, with_matrix};
use crate::terms::{Curvature, Equation, jets};
use crate::world::{Gradient, Member, MemberState, MemberTangent, Shared, Waiting};
use glam::DVec3;
use palpate_engine::FailureKind;
use palpate_model::plan::STATIC_ITERATIONS;
use palpate_model::plan::scheme::Stage;

/// Times that the way to a state is halved at most.
const HALVINGS: u32 = 6;

/// Finds the equilibrium of a static problem from the guess in `u`: of a stage, or of the start (`None`).
pub(crate) fn settle(
    shared: &Shared,
    member: &Member,
    stage: Option<&Stage>,
    matrix: &mut Matrix,
    u: &mut Nodes,
    effort: &mut Effort,
) -> Result<(), Reason> {
    let solver = shared.plan.solver;
    let iterations = solver.newton_iterations.max(STATIC_ITERATIONS);
    let mut solve = |start: &Start, u: &mut Nodes| {
        let mut e = equation(shared, member, stage, start);
        newton::solve(&mut e, &shared.solvers, matrix, Purpose::Static, u, solver.tolerance, iterations, effort).map_err(
            |(kind, detail)| match kind {
                FailureKind::NewtonStalled | FailureKind::LinearSolve => (FailureKind::NoEquilibrium, detail),
                _ => (kind, detail),
            },
        )
    };
    if !jets::blow(&shared.plan) {
        return solve(&Start::still(u.len()), u);
    }
    jets::swept(shared, member, stage, u, solve)
}

/// A right-hand side for n nodes. Conjugate gradients meet a negative curvature where it has a part in it: no symmetry rules that out of this one.
pub(crate) fn probe(n: usize) -> Nodes {
    let mixed = |i: usize, a: usize| ((i * 3 + a) as f64 * 0.618_034).fract() - 0.5;
    (0..n).map(|i| DVec3::new(mixed(i, 0), mixed(i, 1), mixed(i, 2))).collect()
}

/// Refuses an equilibrium that the smallest push would end.
pub(crate) fn check_stable(shared: &Shared, e: &mut Equation, u: &[DVec3], state: usize) -> Result<(), Reason> {
    e.residual(u);
    let solved = newton::with_tangent(e, &shared.solvers, u, &[Curvature::Exact], |_, prepared| {
        prepared.solve_many(&mut [probe(u.len())], 1e-3).is_ok()
    });
    if solved == Some(true) {
        return Ok(());
    }
    Err((FailureKind::Unstable, format!("state {state} of the sequence: its stiffness matrix is not positive definite")))
}

/// The next state of a sequence.
pub(crate) fn step(
    shared: &Shared,
    member: &mut Member,
    stage: &Stage,
    now: &MemberState,
    next: &mut MemberState,
) -> Result<(), Reason> {
    next.v.fill(DVec3::ZERO);
    if kept::applies(shared)
        && let Some(u) = ahead::next(shared, member, stage, &now.u)
    {
        next.u = u;
        return check(shared, next);
    }
    next.u.copy_from_slice(&now.u);
    let times = &shared.plan.times;
    let [from, to] = [stage.step, stage.step + 1].map(|k| times.get(k).copied().unwrap_or(stage.time) - times[0]);
    let mut effort = member.effort;
    with_matrix(member, |member, matrix| {
        let still = Start::still(next.u.len());
        let at = |time: f64| Stage { time, ..stage.clone() };
        // Times that are still to be reached, the next one last.
        let (mut waiting, mut reached) = (vec![(to, 0)], from);
        while let Some((time, halved)) = waiting.pop() {
            let mut u = next.u.clone();
            match settle(shared, member, Some(&at(time)), matrix, &mut u, &mut effort) {
                Ok(()) => (next.u, reached) = (u, time),
                Err((FailureKind::NoEquilibrium | FailureKind::NotFinite, _)) if halved < HALVINGS => {
                    waiting.extend([(time, halved + 1), (0.5 * (reached + time), halved + 1)]);
                }
                Err(reason) => return Err(reason),
            }
        }
        let mut e = equation(shared, member, Some(stage), &still);
        check_stable(shared, &mut e, &next.u, stage.step + 1)
    })?;
    member.effort = effort;
    check(shared, next)
}

/// Its adjoint: the past states have no part in it.
pub(crate) fn step_adjoint(
    shared: &Shared,
    member: &mut Member,
    stage: &Stage,
    next: &MemberState,
    adj: &MemberState,
    gradient: &mut Gradient,
) -> Result<(), Reason> {
    if adj.u.iter().all(|u| *u == DVec3::ZERO) {
        return Ok(());
    }
    pull(shared, member, Some(stage), next, adj, gradient)
}

/// Derivatives of J through an equilibrium, that of a stage or of the start (`None`): adds to `gradient`, at once or in [`pull_waiting`].
pub(crate) fn pull(
    shared: &Shared,
    member: &mut Member,
    stage: Option<&Stage>,
    at: &MemberState,
    adj: &MemberState,
    gradient: &mut Gradient,
) -> Result<(), Reason> {
    if !kept::applies(shared) {
        return pull_alone(shared, member, stage, &at.u, &adj.u, gradient);
    }
    gradient.waiting.push(Waiting { stage: stage.cloned(), at: at.u.clone(), by_u: adj.u.clone() });
    if gradient.waiting.len() == BACK { pull_waiting(shared, member, gradient) } else { Ok(()) }
}

/// Derivatives of J through all equilibria that wait, side by side: adds to `gradient`.
pub(crate) fn pull_waiting(shared: &Shared, member: &mut Member, gradient: &mut Gradient) -> Result<(), Reason> {
    let mut waiting = std::mem::take(&mut gradient.waiting);
    while !waiting.is_empty() {
        let solved = with_matrix(member, |member, matrix| back::solve(shared, member, matrix, &mut gradient.kept, &waiting));
        for (w, z) in waiting.drain(..solved.len()).zip(solved) {
            match z {
                Some((z, iterations)) => {
                    member.effort.adjoint += iterations;
                    back::take(shared, member, &w, &z, gradient);
                }
                None => pull_alone(shared, member, w.stage.as_ref(), &w.at, &w.by_u, gradient)?,
            }
        }
    }
    Ok(())
}

/// The same of one equilibrium, with a factor of its own.
fn pull_alone(
    shared: &Shared,
    member: &mut Member,
    stage: Option<&Stage>,
    at: &[DVec3],
    by_u: &[DVec3],
    gradient: &mut Gradient,
) -> Result<(), Reason> {
    let start = jets::at(shared, at);
    let mut z = [by_u.to_vec()];
    let iterations = with_matrix(member, |member, matrix| {
        let mut e = equation(shared, member, stage, &start);
        e.residual(at);
        let iterations = match jets::Jets::new(e.context) {
            None => newton::solve_exact(&e, &shared.solvers, matrix, Purpose::Static, at, &mut z)?,
            Some(jets) => jets.solve_back(&e, &shared.solvers, at, &mut z)?,
        };
        gradient.take(&e, at, &z[0]);
        Ok(iterations)
    })?;
    member.effort.adjoint += iterations;
    Ok(())
}

/// Its tangent.
pub(crate) fn step_tangent(
    shared: &Shared,
    member: &mut Member,
    stage: &Stage,
    next: &MemberState,
    t: &mut MemberTangent,
) -> Result<(), Reason> {
    t.dv.iter_mut().for_each(|v| v.fill(DVec3::ZERO));
    along(shared, member, Some(stage), next, t)
}

/// Displacements of an equilibrium, that of a stage or of the start (`None`), along `t`'s directions.
pub(crate) fn along(
    shared: &Shared,
    member: &mut Member,
    stage: Option<&Stage>,
    at: &MemberState,
    t: &mut MemberTangent,
) -> Result<(), Reason> {
    let start = jets::at(shared, &at.u);
    with_matrix(member, |member, matrix| {
        let mut e = equation(shared, member, stage, &start);
        e.residual(&at.u);
        t.du = t.rates.iter().map(|r| minus(e.by_coefficients(&at.u, r))).collect();
        match jets::Jets::new(e.context) {
            None => newton::solve_exact(&e, &shared.solvers, matrix, Purpose::Static, &at.u, &mut t.du).map(|_| ()),
            Some(jets) => jets.solve_along(&e, &shared.solvers, &at.u, &mut t.du),
        }
    })
}
