//! One member's start and steps, with their adjoints and tangents.

use crate::linear::Purpose;
use crate::linear::vector::{Nodes, dot, is_finite};
use crate::newton::{self, Effort, Reason};
use crate::passes::balance::{Balance, Inertia, States};
use crate::passes::cells::{Mix, zeros};
use crate::world::{Member, MemberState, MemberTangent, Shared};
use glam::DVec3;
use palpate_engine::{Direction, FailureKind, number};
use palpate_model::params::ParamKey;
use palpate_model::params::changes;
use palpate_model::plan::scheme::Stage;
use palpate_model::plan::{STATIC_ITERATIONS, WORLD_SIZE};
use palpate_model::scene::InitialShape;

/// The balance of a stage, or of the static problem (`None`).
pub(crate) fn balance<'a>(shared: &'a Shared, member: &'a Member, stage: Option<&Stage>) -> Balance<'a> {
    let p = &member.physics;
    let (inertia, mix, time) = match stage {
        None => (None, Mix::STATIC, p.start),
        Some(&Stage { length, theta, time, .. }) => (
            Some(Inertia { displacement: 1.0 / (theta * length * length), velocity: 1.0 / (theta * length), rate: 1.0 / length }),
            Mix { new: theta, old: 1.0 - theta, rate: p.stiffness_damping / length },
            p.start + time,
        ),
    };
    Balance {
        plan: &shared.plan,
        pattern: &shared.pattern,
        places: &shared.places,
        elements: &member.elements,
        physics: p,
        planes: &member.planes,
        effects: &member.effects,
        altered: &member.altered,
        inertia,
        mix,
        time,
    }
}

/// The static stiffness at a state.
pub fn stiffness(shared: &Shared, member: &mut Member, s: &MemberState) -> crate::linear::matrix::Matrix {
    let zero = zeros(s.u.len());
    let mut matrix = crate::linear::matrix::Matrix::default();
    balance(shared, member, None).tangent(States { u1: &s.u, u0: &zero, v0: &zero }, false, &mut matrix);
    matrix
}

/// Takes the scratch matrix out of a member, so that a balance can borrow the rest.
fn with_matrix<T>(member: &mut Member, f: impl FnOnce(&Member, &mut crate::linear::matrix::Matrix) -> T) -> T {
    let mut matrix = std::mem::take(&mut member.matrix);
    let result = f(member, &mut matrix);
    member.matrix = matrix;
    result
}

fn check(shared: &Shared, s: &MemberState) -> Result<(), Reason> {
    if !is_finite(&s.u) || !is_finite(&s.v) {
        return Err((FailureKind::NotFinite, "displacement or velocity of a node".into()));
    }
    let body = &shared.plan.body;
    let size = body.grid.h * body.grid.size.iter().max().copied().unwrap_or(1) as f64;
    let far = s.u.iter().map(|u| u.length()).fold(0.0, f64::max);
    if far > WORLD_SIZE * size {
        return Err((
            FailureKind::FellOut,
            format!("a node moved {} m, {} times the body's size", number(far), number((far / size).round())),
        ));
    }
    Ok(())
}

/// The initial state.
pub fn start(shared: &Shared, member: &mut Member, s: &mut MemberState) -> Result<(), Reason> {
    let plan = &shared.plan;
    let p = &member.physics;
    let positive = [(p.youngs_modulus, "material.youngs_modulus"), (p.density, "material.density")];
    if let Some((value, path)) = positive.iter().find(|(v, _)| v.is_nan() || *v <= 0.0) {
        return Err((FailureKind::BadParameter, format!("{path} = {} must be positive", number(*value))));
    }
    if !(p.poisson_ratio > -1.0 && p.poisson_ratio < 0.5) {
        return Err((
            FailureKind::BadParameter,
            format!("material.poisson_ratio = {} must lie in (-1, 0.5)", number(p.poisson_ratio)),
        ));
    }
    s.u.fill(DVec3::ZERO);
    if let (InitialShape::Rest, Some(w)) = (plan.initial, &member.altered.changes.rest) {
        // At rest is where nothing is strained.
        s.u.copy_from_slice(w);
    }
    for ((v, x), u) in s.v.iter_mut().zip(&plan.body.nodes).zip(&s.u) {
        *v = p.velocity + p.angular_velocity.cross(*x + *u - plan.pivot);
    }
    if plan.initial == InitialShape::StaticEquilibrium {
        if plan.clamps.is_empty() {
            return Err((FailureKind::NoEquilibrium, "no clamp holds the body".into()));
        }
        let zero = zeros(s.u.len());
        with_matrix(member, |member, matrix| {
            let b = balance(shared, member, None);
            let iterations = plan.solver.newton_iterations.max(STATIC_ITERATIONS);
            let effort = &mut Effort::default();
            newton::solve(
                &b,
                &shared.solvers,
                matrix,
                Purpose::Static,
                &mut s.u,
                &zero,
                &zero,
                plan.solver.tolerance,
                iterations,
                effort,
            )
        })
        .map_err(|(kind, detail)| match kind {
            FailureKind::NewtonStalled | FailureKind::LinearSolve => (FailureKind::NoEquilibrium, detail),
            _ => (kind, detail),
        })?;
    }
    check(shared, s)
}

/// Where a node starts, away from the given shape [m]: the stress-free shape of a body that starts at rest.
fn rest_offset(shared: &Shared, member: &Member, node: usize) -> DVec3 {
    match &member.altered.changes.rest {
        Some(w) if shared.plan.initial == InitialShape::Rest => w[node],
        _ => DVec3::ZERO,
    }
}

/// dJ/dθ of the start: adds to `gradient` `[P]`.
pub fn start_adjoint(
    shared: &Shared,
    member: &mut Member,
    s: &MemberState,
    adj: &MemberState,
    gradient: &mut [f64],
) -> Result<(), Reason> {
    let plan = &shared.plan;
    for (p, key) in plan.layout.keys.iter().enumerate() {
        match key {
            ParamKey::Velocity(a) => gradient[p] += adj.v.iter().map(|v| v[*a as usize]).sum::<f64>(),
            ParamKey::AngularVelocity(a) => {
                let arm = |i: usize| plan.body.nodes[i] + rest_offset(shared, member, i) - plan.pivot;
                gradient[p] += adj.v.iter().enumerate().map(|(i, v)| arm(i).cross(*v)[*a as usize]).sum::<f64>();
            }
            ParamKey::Effect { effect, slot, .. } if plan.initial == InitialShape::Rest => {
                if let Some(dw) = changes::rest_slope(plan, &member.physics, usize::from(*effect), usize::from(*slot)) {
                    let spin = member.physics.angular_velocity;
                    gradient[p] += dot(&adj.u, &dw) + adj.v.iter().zip(&dw).map(|(v, w)| v.dot(spin.cross(*w))).sum::<f64>();
                }
            }
            _ => {}
        }
    }
    if plan.initial == InitialShape::Rest {
        return Ok(());
    }
    let zero = zeros(s.u.len());
    with_matrix(member, |member, matrix| {
        let b = balance(shared, member, None);
        let states = States { u1: &s.u, u0: &zero, v0: &zero };
        let mut z = [adj.u.clone()];
        newton::solve_exact(&b, &shared.solvers, matrix, Purpose::Static, states, &mut z)?;
        add_columns(&b, states, &z[0], gradient);
        Ok(())
    })
}

/// gradient −= z · ∂r/∂p for every parameter.
fn add_columns(b: &Balance, s: States, z: &[DVec3], gradient: &mut [f64]) {
    for (p, key) in b.plan.layout.keys.iter().enumerate() {
        if let Some(column) = b.column(*key, s) {
            gradient[p] -= dot(z, &column);
        }
    }
}

/// (∂r/∂θ) dθ.
fn column(b: &Balance, direction: &Direction, s: States) -> Nodes {
    let mut sum = zeros(s.u1.len());
    for (p, d) in direction.entries() {
        if let Some(column) = b.column(b.plan.layout.keys[p], s) {
            crate::linear::vector::add_scaled(&mut sum, d, &column);
        }
    }
    sum
}

/// Derivatives of the start along some directions.
pub fn start_tangent(
    shared: &Shared,
    member: &mut Member,
    s: &MemberState,
    directions: &[Direction],
    t: &mut MemberTangent,
) -> Result<(), Reason> {
    let plan = &shared.plan;
    for (q, direction) in directions.iter().enumerate() {
        for (p, d) in direction.entries() {
            match plan.layout.keys[p] {
                ParamKey::Velocity(a) => t.dv[q].iter_mut().for_each(|v| *v += d * DVec3::AXES[a as usize]),
                ParamKey::AngularVelocity(a) => {
                    for (i, v) in t.dv[q].iter_mut().enumerate() {
                        let arm = plan.body.nodes[i] + rest_offset(shared, member, i) - plan.pivot;
                        *v += d * DVec3::AXES[a as usize].cross(arm);
                    }
                }
                ParamKey::Effect { effect, slot, .. } if plan.initial == InitialShape::Rest => {
                    if let Some(dw) = changes::rest_slope(plan, &member.physics, usize::from(effect), usize::from(slot)) {
                        let spin = member.physics.angular_velocity;
                        t.dv[q].iter_mut().zip(&dw).for_each(|(v, w)| *v += d * spin.cross(*w));
                        t.du[q].iter_mut().zip(&dw).for_each(|(u, w)| *u += d * *w);
                    }
                }
                _ => {}
            }
        }
    }
    if plan.initial == InitialShape::Rest {
        return Ok(());
    }
    let zero = zeros(s.u.len());
    with_matrix(member, |member, matrix| {
        let b = balance(shared, member, None);
        let states = States { u1: &s.u, u0: &zero, v0: &zero };
        t.du = directions.iter().map(|d| minus(column(&b, d, states))).collect();
        newton::solve_exact(&b, &shared.solvers, matrix, Purpose::Static, states, &mut t.du)
    })
}

fn minus(mut v: Nodes) -> Nodes {
    v.iter_mut().for_each(|v| *v = -*v);
    v
}

/// One stage.
pub fn step(
    shared: &Shared,
    member: &mut Member,
    stage: &Stage,
    now: &MemberState,
    next: &mut MemberState,
) -> Result<(), Reason> {
    let (dt, theta) = (stage.length, stage.theta);
    // Free flight is the guess: exact while nothing touches or deforms.
    let fall = theta * dt * dt * member.physics.gravity;
    for i in 0..now.u.len() {
        next.u[i] = now.u[i] + dt * now.v[i] + fall;
    }
    let solver = shared.plan.solver;
    let mut effort = member.effort;
    with_matrix(member, |member, matrix| {
        let b = balance(shared, member, Some(stage));
        newton::solve(
            &b,
            &shared.solvers,
            matrix,
            Purpose::Step(1),
            &mut next.u,
            &now.u,
            &now.v,
            solver.tolerance,
            solver.newton_iterations,
            &mut effort,
        )
    })?;
    member.effort = effort;
    let (a, c) = velocity_factors(dt, theta);
    for i in 0..now.u.len() {
        next.v[i] = a * (next.u[i] - now.u[i]) - c * now.v[i];
    }
    check(shared, next)
}

/// v₁ = a (u₁ − u₀) − c v₀.
fn velocity_factors(dt: f64, theta: f64) -> (f64, f64) {
    (1.0 / (theta * dt), (1.0 - theta) / theta)
}

/// Adjoint of a stage: adds dJ/d(now) to `adj_now` and dJ/dθ to `gradient`.
pub fn step_adjoint(
    shared: &Shared,
    member: &mut Member,
    stage: &Stage,
    now: &MemberState,
    next: &MemberState,
    adj: &MemberState,
    adj_now: &mut MemberState,
    gradient: &mut [f64],
) -> Result<(), Reason> {
    let (a, c) = velocity_factors(stage.length, stage.theta);
    let mut z = [adj.u.iter().zip(&adj.v).map(|(u, v)| *u + a * *v).collect::<Nodes>()];
    with_matrix(member, |member, matrix| {
        let b = balance(shared, member, Some(stage));
        let states = States { u1: &next.u, u0: &now.u, v0: &now.v };
        newton::solve_exact(&b, &shared.solvers, matrix, Purpose::Step(1), states, &mut z)?;
        let (to_u, to_v) = b.by_old_transposed(states, &z[0]);
        for i in 0..now.u.len() {
            adj_now.u[i] -= a * adj.v[i] + to_u[i];
            adj_now.v[i] -= c * adj.v[i] + to_v[i];
        }
        add_columns(&b, states, &z[0], gradient);
        if is_finite(&z[0]) { Ok(()) } else { Err((FailureKind::NotFinite, "adjoint of a step".into())) }
    })
}

/// Tangent of a stage.
pub fn step_tangent(
    shared: &Shared,
    member: &mut Member,
    stage: &Stage,
    now: &MemberState,
    next: &MemberState,
    directions: &[Direction],
    t: &MemberTangent,
    t_next: &mut MemberTangent,
) -> Result<(), Reason> {
    let (a, c) = velocity_factors(stage.length, stage.theta);
    with_matrix(member, |member, matrix| {
        let b = balance(shared, member, Some(stage));
        let states = States { u1: &next.u, u0: &now.u, v0: &now.v };
        t_next.du = directions
            .iter()
            .enumerate()
            .map(|(q, direction)| {
                let mut rhs = b.by_old(states, &t.du[q], &t.dv[q]);
                rhs.iter_mut().zip(column(&b, direction, states)).for_each(|(r, c)| *r += c);
                minus(rhs)
            })
            .collect();
        newton::solve_exact(&b, &shared.solvers, matrix, Purpose::Step(directions.len()), states, &mut t_next.du)
    })?;
    for q in 0..directions.len() {
        for i in 0..now.u.len() {
            t_next.dv[q][i] = a * (t_next.du[q][i] - t.du[q][i]) - c * t.dv[q][i];
        }
    }
    Ok(())
}
