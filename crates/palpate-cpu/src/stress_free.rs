//! The stress-free shape of a body whose given shape is its equilibrium (Wang et al. 2015, eq. 7): X + W with r(u = 0; W) = 0, where r is the static
//! residual with all loads and supports.
//!
//! W is a function of the parameters. It is solved for whenever these are set, so that the equilibrium holds for every trial of a fit, and W is
//! no unknown of the fit (the paper alternates between both). With J = ∂r/∂W at u = 0:
//!
//! `J dW = −∂r/∂p dp` for tangents, and `Jᵀ y = dJ/dW`, `dJ/dp −= y · ∂r/∂p` for the adjoint.
//!
//! A shape that was measured with errors is the equilibrium only about: where effects change the stress-free shape by D, that is X + W + D, and the start
//! is its own equilibrium. W stays what balances in the shape given.
//!
//! J is not symmetric, and close to minus the tangent stiffness, whose factor preconditions it.

use crate::CpuBackend;
use crate::linear::gmres;
use crate::linear::vector::{Nodes, add_scaled, is_finite};
use crate::newton::{self, EVER_TAMER, Reason};
use crate::simulate::{Start, context, make_stress_free};
use crate::terms::altered::Altered;
use crate::terms::{Equation, zeros};
use crate::world::{Balanced, Gradient, Member, Shared, World};
use glam::DVec3;
use palpate_engine::{Failure, FailureKind, ParamBatch, StressFree, StressFreeShapes, number};
use palpate_model::params::changes;
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::plan::Plan;
use palpate_model::scene::InitialShape;
use rayon::prelude::*;

/// Newton iterations at a share of the load. From the share before they converge quadratically, or not at all.
const ITERATIONS: usize = 12;
/// Largest correction at which W is found, over the body's size: the next one would be its square.
const CLOSE: f64 = 1e-9;
/// Smallest step of the load; a shape that exists up to a share alone is within it.
const SMALLEST: f64 = 1.0 / 64.0;
/// What products with J may leave of a right-hand side: of a step of Newton's method, and of a derivative.
const LEFT: [f64; 2] = [1e-6, 1e-11];
/// Products for one solve. Strains of a half take about 30.
const PRODUCTS: usize = 120;

/// True where the shape given is an equilibrium.
pub(crate) fn applies(plan: &Plan) -> bool {
    plan.initial == InitialShape::Given
}

/// Only the stress-free shape changes.
fn only_rest(plan: &Plan, w: Nodes) -> Coefficients {
    let mut c = Coefficients::zero_gradient(plan, &Sought { effects: Vec::new(), ..Sought::default() });
    c.changes.rest = Some(w);
    c
}

/// The static residual at u = 0, and what is asked of it.
struct Balance<'a> {
    equation: Equation<'a>,
    plan: &'a Plan,
    still: Nodes,
}

impl<'a> Balance<'a> {
    fn new(shared: &'a Shared, member: &'a Member, start: &'a Start<'a>) -> (Balance<'a>, Nodes) {
        let still = zeros(shared.plan.body.nodes.len());
        let mut c = context(shared, member, None, start);
        if let Some(balanced) = &member.balanced {
            (c.coefficients, c.altered) = (&balanced.coefficients, &balanced.altered);
        }
        let mut equation = Equation::new(c);
        let residual = equation.residual(&still);
        (Balance { equation, plan: &shared.plan, still }, residual)
    }

    /// J d.
    fn along(&self, d: &[DVec3]) -> Nodes {
        self.equation.by_coefficients(&self.still, &only_rest(self.plan, d.to_vec()))
    }

    /// Jᵀ z.
    fn back(&self, z: &[DVec3]) -> Nodes {
        let mut out = only_rest(self.plan, zeros(z.len()));
        let sought = Sought { rest: true, effects: vec![false; self.plan.layout.effects().count()], ..Sought::default() };
        self.equation.by_coefficients_transposed(&self.still, z, &sought, &mut out);
        out.changes.rest.unwrap_or_default()
    }
}

/// What `solve` makes of K⁻¹, a preconditioner: the tangent stiffness at u = 0, or where that is not positive definite, which a shape on the way
/// need not be, a tangent that is; with `exact` an error instead.
fn with_stiffness<T>(
    shared: &Shared,
    balance: &Balance,
    exact: bool,
    solve: impl FnOnce(&dyn Fn(&[DVec3]) -> Nodes) -> T,
) -> Result<T, Reason> {
    let curvatures = if exact { &EVER_TAMER[..1] } else { &EVER_TAMER[..] };
    let made = newton::with_tangent(&balance.equation, &shared.solvers, &balance.still, curvatures, |_, prepared| {
        solve(&|b: &[DVec3]| {
            let mut x = b.to_vec();
            // Whether the whole has converged is seen outside.
            if prepared.solve(&mut x, 1e-12, 0.0).is_err() {
                return vec![DVec3::NAN; b.len()];
            }
            x
        })
    });
    made.ok_or_else(unstable)
}

fn unstable() -> Reason {
    (FailureKind::NoEquilibrium, "the shape given is no stable equilibrium: its stiffness there is not positive definite".into())
}

fn unsolved() -> Reason {
    (FailureKind::LinearSolve, format!("{PRODUCTS} products with the derivative by the stress-free shape were not enough"))
}

/// J d = b by K⁻¹J.
fn solved(balance: &Balance, inverse: &dyn Fn(&[DVec3]) -> Nodes, b: &[DVec3], relative: f64) -> Result<Nodes, Reason> {
    let apply = |v: &[DVec3]| inverse(&balance.along(v));
    gmres::solve(apply, &inverse(b), relative, PRODUCTS).ok_or_else(unsolved)
}

/// Jᵀ y = b by Jᵀ K⁻¹, K being symmetric.
fn solved_back(balance: &Balance, inverse: &dyn Fn(&[DVec3]) -> Nodes, b: &[DVec3], relative: f64) -> Result<Nodes, Reason> {
    let apply = |v: &[DVec3]| balance.back(&inverse(v));
    gmres::solve(apply, b, relative, PRODUCTS).map(|v| inverse(&v)).ok_or_else(unsolved)
}

/// Puts W in place, with what follows from it.
fn place(shared: &Shared, member: &mut Member, w: Nodes) {
    member.coefficients.changes.rest = Some(w);
    member.altered = Altered::new(&shared.plan, &member.coefficients, &member.elements);
}

/// Solves for W of a member, whose parameters have been set.
///
/// # Errors
/// There is no such shape, no clamp holds the body, or its stiffness is not positive definite.
pub(crate) fn solve(shared: &Shared, member: &mut Member) -> Result<(), Reason> {
    let plan = &shared.plan;
    if plan.clamps.is_empty() {
        return Err((FailureKind::NoEquilibrium, "no clamp holds the body whose shape is given as an equilibrium".into()));
    }
    (member.balanced, member.rates) = (None, None);
    let mut w = zeros(plan.body.nodes.len());
    place(shared, member, w.clone());
    let start = Start::still(w.len());
    let load = Balance::new(shared, member, &start).1;
    // Shares of the load: what W = 0 leaves unbalanced is taken away but for this part.
    let (mut share, mut step) = (0.0, 1.0f64);
    while share < 1.0 {
        let next = (share + step).min(1.0);
        match approached(shared, member, &w, &load, next) {
            Ok(found) => {
                (w, share, step) = (found, next, 2.0 * step);
            }
            Err(reason) => {
                step *= 0.5;
                if step < SMALLEST {
                    return Err(refused(member, share, reason));
                }
            }
        }
    }
    place(shared, member, w);
    // The body stays in the shape given only if it is stable there.
    let (balance, _) = Balance::new(shared, member, &start);
    with_stiffness(shared, &balance, true, |_| ())?;
    drop(balance);
    if let Some(mut d) = changes::rest_of_effects(plan, &member.coefficients.physics) {
        let coefficients = member.coefficients.clone();
        add_scaled(&mut d, 1.0, coefficients.changes.rest.as_deref().unwrap_or_default());
        let altered = std::mem::take(&mut member.altered);
        member.balanced = Some(Box::new(Balanced { coefficients, altered }));
        place(shared, member, d);
    }
    Ok(())
}

/// Why no shape was found. Loads of a share and the whole modulus balance as the whole loads and a larger modulus do.
fn refused(member: &Member, share: f64, (kind, detail): Reason) -> Reason {
    let kind = if kind == FailureKind::LinearSolve { kind } else { FailureKind::NoEquilibrium };
    if share == 0.0 {
        return (kind, format!("no stress-free shape was found for the shape given at any part of its load: {detail}"));
    }
    let young = member.coefficients.physics.youngs_modulus;
    let least = number(format!("{:.2e}", young / share).parse().unwrap_or(young / share));
    (
        kind,
        format!(
            "no stress-free shape was found for the shape given; from a material.youngs_modulus of about {least} Pa on there is one: {detail}"
        ),
    )
}

/// W at a share of the load, from that at a smaller one.
fn approached(shared: &Shared, member: &mut Member, from: &Nodes, load: &[DVec3], share: f64) -> Result<Nodes, Reason> {
    let size = shared.plan.body.size();
    let mut w = from.clone();
    let mut last = f64::INFINITY;
    for _ in 0..ITERATIONS {
        place(shared, member, w.clone());
        if member.altered.points.as_ref().is_some_and(|p| p.is_folded()) {
            return Err((FailureKind::NoEquilibrium, "the stress-free shape is folded".into()));
        }
        let start = Start::still(w.len());
        let (balance, mut r) = Balance::new(shared, member, &start);
        add_scaled(&mut r, share - 1.0, load);
        let step = with_stiffness(shared, &balance, false, |inverse| solved(&balance, inverse, &r, LEFT[0]))??;
        let largest = step.iter().map(|v| v.length()).fold(0.0, f64::max);
        add_scaled(&mut w, -1.0, &step);
        if !is_finite(&w) || largest > size {
            return Err((FailureKind::NewtonStalled, "a step was larger than the body".into()));
        }
        if largest <= CLOSE * size {
            return Ok(w);
        }
        // Twice as far as before: it runs away.
        if largest > 2.0 * last {
            return Err((FailureKind::NewtonStalled, "the steps grow".into()));
        }
        last = last.min(largest);
    }
    Err((FailureKind::NewtonStalled, format!("{ITERATIONS} steps did not do")))
}

/// Adds dW to the coefficients' derivatives along directions.
///
/// # Errors
/// A linear solve fails.
pub(crate) fn along(shared: &Shared, member: &Member, rates: &mut [Coefficients]) -> Result<(), Reason> {
    let start = Start::still(shared.plan.body.nodes.len());
    let (balance, _) = Balance::new(shared, member, &start);
    with_stiffness(shared, &balance, false, |inverse| {
        for rate in rates {
            // That of D alone.
            let mut dw = rate.changes.rest.take();
            let b: Nodes = balance.equation.by_coefficients(&balance.still, rate).into_iter().map(|v| -v).collect();
            if b.iter().any(|v| *v != DVec3::ZERO) {
                let found = solved(&balance, inverse, &b, LEFT[1])?;
                add_scaled(dw.get_or_insert_with(|| zeros(found.len())), 1.0, &found);
            }
            rate.changes.rest = dw;
        }
        Ok(())
    })?
}

/// Turns the derivative by W that an adjoint has summed into derivatives by what W follows from.
///
/// # Errors
/// A linear solve fails.
pub(crate) fn pull(shared: &Shared, member: &Member, gradient: &mut Gradient) -> Result<(), Reason> {
    let Some(by_rest) = gradient.coefficients.changes.rest.take() else { return Ok(()) };
    let start = Start::still(by_rest.len());
    let (balance, _) = Balance::new(shared, member, &start);
    let y = with_stiffness(shared, &balance, false, |inverse| solved_back(&balance, inverse, &by_rest, LEFT[1]))??;
    gradient.take(&balance.equation, &balance.still, &y);
    if member.balanced.is_some() {
        // D's share is the effects'.
        gradient.coefficients.changes.rest = Some(by_rest);
    }
    Ok(())
}

impl StressFree for CpuBackend {
    fn open(&self, plan: &Plan) -> Box<dyn StressFreeShapes> {
        faer::set_global_parallelism(faer::Par::Seq);
        Box::new(World::new(plan))
    }
}

impl World {
    fn failed_at_start(&self, member: usize) -> impl Fn(Reason) -> Failure {
        move |reason| newton::at(0.0)(reason).in_plan(&self.shared.plan, &self.members[member].theta)
    }
}

impl StressFreeShapes for World {
    fn find(&mut self, theta: &ParamBatch) -> Vec<Result<Nodes, Failure>> {
        self.set_params(theta);
        let shared = &self.shared;
        let found: Vec<_> = self.members.par_iter_mut().map(|m| make_stress_free(shared, m)).collect();
        let w = |(b, found): (usize, Result<(), Reason>)| {
            found.map(|()| self.members[b].coefficients.changes.rest.clone().unwrap_or_default()).map_err(self.failed_at_start(b))
        };
        found.into_iter().enumerate().map(w).collect()
    }

    fn along(&self, member: usize, rates: &mut [Coefficients]) -> Result<(), Failure> {
        along(&self.shared, &self.members[member], rates).map_err(self.failed_at_start(member))
    }

    fn pull(&self, member: usize, sought: &Sought, gradient: &mut Coefficients) -> Result<(), Failure> {
        let (coefficients, sought) = (gradient.clone(), sought.clone());
        let mut own = Gradient { coefficients, sought, wanted: Vec::new(), waiting: Vec::new(), kept: None };
        pull(&self.shared, &self.members[member], &mut own).map_err(self.failed_at_start(member))?;
        *gradient = own.coefficients;
        Ok(())
    }
}
