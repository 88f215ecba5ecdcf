//! One member's start and stages, with their adjoints and tangents.

use crate::ahead::Ahead;
use crate::kept::{self, Kept};
use crate::linear::Purpose;
use crate::linear::matrix::Matrix;
use crate::linear::vector::{Nodes, add_scaled, is_finite};
use crate::newton::{self, Effort, Reason};
use crate::quasi_static;
use crate::stress_free;
use crate::terms::jets::Lag;
use crate::terms::{Context, Curvature, Equation, Past, PastChange, Rates, Weights, zeros};
use crate::world::{Gradient, Member, MemberState, MemberTangent, Rated, Shared};
use glam::DVec3;
use palpate_engine::{Direction, FailureKind, number};
use palpate_model::params::coefficients::Coefficients;
use palpate_model::plan::WORLD_SIZE;
use palpate_model::plan::scheme::Stage;
use palpate_model::scene::InitialShape;
use std::sync::Arc;

/// The past of a stage: the weighted sum of past states, and each of them.
pub(crate) struct Start<'a> {
    u: Nodes,
    v: Nodes,
    each: Vec<(f64, &'a [DVec3])>,
    /// State that jets are taken at; `None` = ũ.
    lag: Option<Lag>,
}

impl<'a> Start<'a> {
    /// From the past states that a stage names.
    pub(crate) fn new(stage: &Stage, past: &[&'a MemberState]) -> Start<'a> {
        let sum = |pick: fn(&MemberState) -> &Nodes| combined(stage, past.iter().map(|s| pick(s)));
        let each = stage.from.iter().zip(past).map(|(f, s)| (f.1, s.u.as_slice())).collect();
        Start { u: sum(|s| &s.u), v: sum(|s| &s.v), each, lag: None }
    }

    /// Of a static problem: nothing.
    pub(crate) fn still(n: usize) -> Start<'a> {
        Start { u: zeros(n), v: zeros(n), each: Vec::new(), lag: None }
    }

    /// The same with jets taken at a state.
    pub(crate) fn swept(lag: Lag) -> Start<'a> {
        let n = lag.u.len();
        Start { lag: Some(lag), ..Start::still(n) }
    }

    /// What the nozzles of jets were found to see, where that was looked at.
    pub(crate) fn into_seen(self) -> Option<Vec<Vec<bool>>> {
        self.lag.and_then(|l| l.seen)
    }

    /// ũ and ṽ.
    #[cfg(test)]
    pub(crate) fn sums(&self) -> (&[DVec3], &[DVec3]) {
        (&self.u, &self.v)
    }

    fn past(&'a self) -> Past<'a> {
        Past { u: &self.u, v: &self.v, each: &self.each, lag: self.lag.as_ref() }
    }
}

/// Σ weight · vector over a stage's past.
fn combined<'v>(stage: &Stage, vectors: impl Iterator<Item = &'v Nodes>) -> Nodes {
    let mut sum: Option<Nodes> = None;
    for ((_, weight), v) in stage.from.iter().zip(vectors) {
        match &mut sum {
            // A single state has the weight one.
            None if *weight == 1.0 => sum = Some(v.clone()),
            None => sum = Some(v.iter().map(|x| *weight * *x).collect()),
            Some(sum) => add_scaled(sum, *weight, v),
        }
    }
    sum.unwrap_or_default()
}

/// The equation of a stage, or of the static problem at the start (`None`).
pub(crate) fn equation<'a>(shared: &'a Shared, member: &'a Member, stage: Option<&Stage>, start: &'a Start<'a>) -> Equation<'a> {
    Equation::new(context(shared, member, stage, start))
}

/// What the terms of an equation read.
pub(crate) fn context<'a>(shared: &'a Shared, member: &'a Member, stage: Option<&Stage>, start: &'a Start<'a>) -> Context<'a> {
    let p = &member.coefficients.physics;
    let (inertia, weights, time) = match stage {
        None => (None, Weights::STATIC, p.start),
        Some(&Stage { still: true, time, .. }) => (None, Weights::STATIC, p.start + time),
        Some(&Stage { length, theta, time, .. }) => (
            Some(Rates { displacement: 1.0 / (theta * length * length), velocity: 1.0 / (theta * length), rate: 1.0 / length }),
            Weights { new: theta, old: 1.0 - theta, rate: p.stiffness_damping / length },
            p.start + time,
        ),
    };
    Context {
        plan: &shared.plan,
        pattern: &shared.pattern,
        places: &shared.places,
        elements: &member.elements,
        strains: shared.strains.as_ref(),
        coefficients: &member.coefficients,
        masses: &member.masses,
        springs: &member.springs,
        planes: &member.planes,
        effects: &member.effects,
        altered: &member.altered,
        inertia,
        weights,
        time,
        past: start.past(),
    }
}

/// The residual of the static problem at a displacement, and its derivative.
pub fn statics(shared: &Shared, member: &mut Member, u: &[DVec3]) -> (Nodes, Matrix) {
    let (start, mut matrix) = (Start::still(u.len()), Matrix::default());
    let mut e = equation(shared, member, None, &start);
    let residual = e.residual(u);
    e.tangent(u, Curvature::Exact, &mut matrix);
    (residual, matrix)
}

/// Takes the scratch matrix out of a member, so that an equation can borrow the rest.
pub(crate) fn with_matrix<T>(member: &mut Member, f: impl FnOnce(&Member, &mut Matrix) -> T) -> T {
    let mut matrix = std::mem::take(&mut member.matrix);
    let result = f(member, &mut matrix);
    member.matrix = matrix;
    result
}

pub(crate) fn check(shared: &Shared, s: &MemberState) -> Result<(), Reason> {
    let far = s.u.iter().map(|u| u.length()).fold(0.0, f64::max);
    if !far.is_finite() || !is_finite(&s.u) || !is_finite(&s.v) {
        return Err((FailureKind::NotFinite, "displacement or velocity of a node".into()));
    }
    let body = &shared.plan.body;
    let size = body.size();
    if far > WORLD_SIZE * size {
        return Err((
            FailureKind::FellOut,
            format!("a node moved {} m, {} times the body's size", number(far), number((far / size).round())),
        ));
    }
    Ok(())
}

/// Refuses coefficients that the model is not defined for.
fn check_parameters(member: &Member) -> Result<(), Reason> {
    let p = &member.coefficients.physics;
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
    if member.altered.points.as_ref().is_some_and(|p| p.is_folded()) {
        return Err((
            FailureKind::BadParameter,
            "the stress-free shape is folded: rest-shape bends or stretches it too far".into(),
        ));
    }
    Ok(())
}

/// Solves for the stress-free shape of a member whose shape given is its equilibrium.
pub(crate) fn make_stress_free(shared: &Shared, member: &mut Member) -> Result<(), Reason> {
    check_parameters(member)?;
    if stress_free::applies(&shared.plan) { stress_free::solve(shared, member) } else { Ok(()) }
}

/// The initial state.
pub fn start(shared: &Shared, member: &mut Member, s: &mut MemberState) -> Result<(), Reason> {
    let plan = &shared.plan;
    make_stress_free(shared, member)?;
    member.ahead = Ahead::default();
    s.u.fill(DVec3::ZERO);
    if let (InitialShape::Rest, Some(w)) = (plan.initial, &member.coefficients.changes.rest) {
        // At rest is where nothing is strained.
        s.u.copy_from_slice(w);
    }
    let p = &member.coefficients.physics;
    for ((v, x), u) in s.v.iter_mut().zip(&plan.body.nodes).zip(&s.u) {
        *v = p.velocity + p.angular_velocity.cross(*x + *u - plan.pivot);
    }
    if plan.initial == InitialShape::StaticEquilibrium || member.balanced.is_some() {
        // What holds the body of a sequence was looked at when its plan was made.
        if plan.clamps.is_empty() && plan.times.is_empty() {
            return Err((FailureKind::NoEquilibrium, "no clamp holds the body".into()));
        }
        let still = Start::still(s.u.len());
        let kept = with_matrix(member, |member, matrix| {
            quasi_static::settle(shared, member, None, matrix, &mut s.u, &mut Effort::default())?;
            let mut e = equation(shared, member, None, &still);
            // What has a factor is stable.
            let kept = if kept::applies(shared) { Kept::new(shared, &mut e, &s.u, matrix) } else { None };
            if kept.is_none() && !plan.times.is_empty() {
                quasi_static::check_stable(shared, &mut e, &s.u, 0)?;
            }
            Ok(kept)
        })?;
        member.ahead = Ahead::new(kept);
    }
    check(shared, s)
}

/// Place of a node at the start, from the centre of the spin [m].
fn arm(shared: &Shared, member: &Member, node: usize) -> DVec3 {
    let offset = match &member.coefficients.changes.rest {
        Some(w) if shared.plan.initial == InitialShape::Rest => w[node],
        _ => DVec3::ZERO,
    };
    shared.plan.body.nodes[node] + offset - shared.plan.pivot
}

/// Derivatives of J by the start's coefficients: adds to `gradient`.
pub fn start_adjoint(
    shared: &Shared,
    member: &mut Member,
    s: &MemberState,
    adj: &MemberState,
    gradient: &mut Gradient,
) -> Result<(), Reason> {
    let at_rest = shared.plan.initial == InitialShape::Rest;
    let spin = member.coefficients.physics.angular_velocity;
    let g = &mut gradient.coefficients;
    for (i, v) in adj.v.iter().enumerate() {
        g.physics.velocity += *v;
        g.physics.angular_velocity += arm(shared, member, i).cross(*v);
        if let (true, Some(rest)) = (at_rest, &mut g.changes.rest) {
            rest[i] += adj.u[i] + v.cross(spin);
        }
    }
    let given = stress_free::applies(&shared.plan);
    if !at_rest && (!given || member.balanced.is_some()) {
        quasi_static::pull(shared, member, None, s, adj, gradient)?;
    }
    quasi_static::pull_waiting(shared, member, gradient)?;
    if given { stress_free::pull(shared, member, gradient) } else { Ok(()) }
}

/// Derivatives of the coefficients along directions; that of a stress-free shape which follows from others comes with the start's tangent.
pub(crate) fn rates(shared: &Shared, member: &Member, directions: &[Direction]) -> Arc<Vec<Coefficients>> {
    if let Some(known) = &member.rates
        && known.directions[..] == *directions
    {
        return known.rates.clone();
    }
    let plan = &shared.plan;
    Arc::new(directions.iter().map(|d| member.coefficients.along(plan, &d.dense(plan.layout.len()))).collect())
}

/// Derivatives of the start along `t`'s directions.
pub fn start_tangent(shared: &Shared, member: &mut Member, s: &MemberState, t: &mut MemberTangent) -> Result<(), Reason> {
    let at_rest = shared.plan.initial == InitialShape::Rest;
    let spin = member.coefficients.physics.angular_velocity;
    for (q, rates) in t.rates.iter().enumerate() {
        let p = &rates.physics;
        for (i, v) in t.dv[q].iter_mut().enumerate() {
            *v = p.velocity + p.angular_velocity.cross(arm(shared, member, i));
        }
        if let (true, Some(dw)) = (at_rest, &rates.changes.rest) {
            t.dv[q].iter_mut().zip(dw).for_each(|(v, w)| *v += spin.cross(*w));
            t.du[q].copy_from_slice(dw);
        }
    }
    if stress_free::applies(&shared.plan) {
        let mut rates = t.rates.to_vec();
        stress_free::along(shared, member, &mut rates)?;
        t.rates = Arc::new(rates);
        // Tangents of later states are made with them.
        member.rates = Some(Rated { directions: t.directions.clone(), rates: t.rates.clone() });
    }
    // Where nothing departs from the shape given, the start does not move.
    if at_rest || (stress_free::applies(&shared.plan) && member.balanced.is_none()) {
        return Ok(());
    }
    quasi_static::along(shared, member, None, s, t)
}

pub(crate) fn minus(mut v: Nodes) -> Nodes {
    v.iter_mut().for_each(|v| *v = -*v);
    v
}

/// One stage.
pub fn step(
    shared: &Shared,
    member: &mut Member,
    stage: &Stage,
    past: &[&MemberState],
    next: &mut MemberState,
) -> Result<(), Reason> {
    if stage.still {
        return quasi_static::step(shared, member, stage, past[0], next);
    }
    let (length, theta) = (stage.length, stage.theta);
    let from = Start::new(stage, past);
    // Free flight is the guess: exact while nothing touches or deforms.
    let fall = theta * length * length * member.coefficients.physics.gravity;
    for i in 0..next.u.len() {
        next.u[i] = from.u[i] + length * from.v[i] + fall;
    }
    // Nothing that flies a thousand body lengths in a step is caught by what it may meet.
    check(shared, next)?;
    let solver = shared.plan.solver;
    let mut effort = member.effort;
    with_matrix(member, |member, matrix| {
        let mut e = equation(shared, member, Some(stage), &from);
        let (purpose, iterations) = (Purpose::Step(1), solver.newton_iterations);
        newton::solve(&mut e, &shared.solvers, matrix, purpose, &mut next.u, solver.tolerance, iterations, &mut effort)
    })?;
    member.effort = effort;
    let (a, c) = velocity_factors(length, theta);
    for i in 0..next.u.len() {
        next.v[i] = a * (next.u[i] - from.u[i]) - c * from.v[i];
    }
    check(shared, next)
}

/// v₁ = a (u₁ − ũ) − c ṽ.
fn velocity_factors(length: f64, theta: f64) -> (f64, f64) {
    (1.0 / (theta * length), (1.0 - theta) / theta)
}

/// Adjoint of a stage: adds the derivatives by the past states to `adj_past` and those by the coefficients to `gradient`.
pub fn step_adjoint(
    shared: &Shared,
    member: &mut Member,
    stage: &Stage,
    past: &[&MemberState],
    next: &MemberState,
    adj: &MemberState,
    adj_past: &mut [&mut MemberState],
    gradient: &mut Gradient,
) -> Result<(), Reason> {
    if stage.still {
        return quasi_static::step_adjoint(shared, member, stage, next, adj, gradient);
    }
    let (a, c) = velocity_factors(stage.length, stage.theta);
    let from = Start::new(stage, past);
    let mut z = [adj.u.iter().zip(&adj.v).map(|(u, v)| *u + a * *v).collect::<Nodes>()];
    let iterations = with_matrix(member, |member, matrix| {
        let mut e = equation(shared, member, Some(stage), &from);
        e.residual(&next.u);
        let iterations = newton::solve_exact(&e, &shared.solvers, matrix, Purpose::Step(1), &next.u, &mut z)?;
        let back = e.by_past_transposed(&next.u, &z[0]);
        for ((to, (_, weight)), each) in adj_past.iter_mut().zip(&stage.from).zip(&back.each) {
            for i in 0..next.u.len() {
                to.u[i] -= *weight * (a * adj.v[i] + back.u[i]) + each[i];
                to.v[i] -= *weight * (c * adj.v[i] + back.v[i]);
            }
        }
        gradient.take(&e, &next.u, &z[0]);
        if is_finite(&z[0]) { Ok(iterations) } else { Err((FailureKind::NotFinite, "adjoint of a step".into())) }
    })?;
    member.effort.adjoint += iterations;
    Ok(())
}

/// Tangent of a stage.
pub fn step_tangent(
    shared: &Shared,
    member: &mut Member,
    stage: &Stage,
    past: &[&MemberState],
    next: &MemberState,
    t: &[&MemberTangent],
    t_next: &mut MemberTangent,
) -> Result<(), Reason> {
    if stage.still {
        return quasi_static::step_tangent(shared, member, stage, next, t_next);
    }
    let (a, c) = velocity_factors(stage.length, stage.theta);
    let from = Start::new(stage, past);
    let directions = t_next.rates.len();
    let sums: Vec<[Nodes; 2]> = (0..directions)
        .map(|q| [combined(stage, t.iter().map(|t| &t.du[q])), combined(stage, t.iter().map(|t| &t.dv[q]))])
        .collect();
    with_matrix(member, |member, matrix| {
        let mut e = equation(shared, member, Some(stage), &from);
        e.residual(&next.u);
        let rhs = |(q, [u, v]): (usize, &[Nodes; 2])| {
            let each: Vec<&[DVec3]> = t.iter().map(|t| t.du[q].as_slice()).collect();
            let mut rhs = e.by_past(&next.u, &PastChange { u, v, each: &each });
            add_scaled(&mut rhs, 1.0, &e.by_coefficients(&next.u, &t_next.rates[q]));
            minus(rhs)
        };
        t_next.du = sums.iter().enumerate().map(rhs).collect();
        newton::solve_exact(&e, &shared.solvers, matrix, Purpose::Step(directions), &next.u, &mut t_next.du)
    })?;
    for (q, [u, v]) in sums.iter().enumerate() {
        for i in 0..next.u.len() {
            t_next.dv[q][i] = a * (t_next.du[q][i] - u[i]) - c * v[i];
        }
    }
    Ok(())
}
