//! One body, moved to the readings of one frame after another: Gauss–Newton's method on the potential of a prior over its temperature plus the
//! cost of the readings (`palpate_engine::tracking`).
//!
//! Everything is counted in joules: with temperature η the function is `Ψ(u) = V(u) + η D(u)` and its curvature `K + η JᵀWJ`. K, the tangent
//! stiffness of the prior, is factorised; conjugate gradients with K⁻¹ then take one iteration for every direction that the readings determine.

mod correspond;
mod cubes;
mod draws;
mod mixture;
mod pull;
mod surface;
#[cfg(test)]
mod tests;

use crate::costs::Look;
use crate::linear::Prepared;
use crate::linear::conjugate_gradient::{self, CgEnd, Precondition};
use crate::linear::matrix::{Operator, Packed};
use crate::linear::vector::{Nodes, add_scaled, dot, is_finite};
use crate::newton::{self, EVER_TAMER, Reason};
use crate::simulate::{self, Start, equation};
use crate::terms::{Equation, zeros};
use crate::world::{Member, MemberState, Shared, World};
pub use correspond::Correspondence;
use glam::DVec3;
use palpate_engine::tracking::{Certainty, Correspond, Follow, Met, Place, Pose, Prior, Problem, Pull, Sighting};
use palpate_engine::{Failure, FailureKind, ParamBatch};
use palpate_model::observation::ReadingKind;
use palpate_model::plan::Plan;
use palpate_model::plan::scheme::Stage;
use palpate_model::scene::InitialShape;
use pull::{ByCost, ByMixture, Pulls};
use surface::Places;

/// Accuracy of a direction: the next step is another linearisation anyway.
const DIRECTION: f64 = 1e-2;
/// Most iterations for one.
const ITERATIONS: usize = 400;
/// Part of the decrease that the slope promises and a step must give (Armijo 1966).
const ARMIJO: f64 = 1e-4;
/// Times that a step is halved.
const HALVINGS: usize = 20;
/// Most that a step changes the deformation gradient of an element: what is linear in the displacement stretches where it should turn.
const TURN: f64 = 0.5;

/// A body on its way from frame to frame.
#[derive(Debug)]
pub struct Tracker {
    world: World,
    places: Places,
    who: Box<dyn Correspond>,
}

impl Tracker {
    /// A body with the plan's own parameter values.
    pub fn new(plan: &Plan) -> Tracker {
        Tracker::with(plan, Box::new(Correspondence))
    }

    /// The same, with somebody else to say which readings belong to which part of the surface.
    pub fn with(plan: &Plan, who: Box<dyn Correspond>) -> Tracker {
        faer::set_global_parallelism(faer::Par::Seq);
        let mut world = World::new(plan);
        world.set_params(&ParamBatch::of(&plan.theta));
        Tracker { world, places: Places::new(&plan.body), who }
    }

    /// Mean distance of neighbouring places of the surface [m].
    pub fn spacing(&self) -> f64 {
        self.places.spacing
    }

    fn failure(&self, frame: usize) -> impl Fn(Reason) -> Failure + '_ {
        let plan = &self.world.shared.plan;
        let time = plan.observation.frames.get(frame).map_or(0.0, |f| f.time - self.world.members[0].first_stamp());
        move |reason| newton::at(time)(reason)
    }
}

/// A frame's points against places of the surface.
fn sighting<'a>(look: Look<'a>, places: &'a [Place], spacing: f64) -> Sighting<'a> {
    let (points, cameras, noise) = (&look.seen().points, &look.observation.cameras, look.observation.noise(ReadingKind::Depth));
    Sighting { points, cameras, places, spacing, noise }
}

/// The prior's equation at a frame, from where it starts.
fn prior<'a>(shared: &'a Shared, member: &'a Member, problem: &Problem, start: &'a Start<'a>) -> Equation<'a> {
    let time = shared.plan.observation.frames[problem.frame].time - member.first_stamp();
    equation(shared, member, stage(problem, time).as_ref(), start)
}

/// The stage that a step of backward Euler is.
fn stage(problem: &Problem, time: f64) -> Option<Stage> {
    let (Prior::Step(_, length) | Prior::Held(_, length)) = problem.prior else { return None };
    Some(Stage { number: 0, step: 0, from: vec![(0, 1.0)], length, theta: 1.0, time, completes: Some(0), still: false })
}

/// The past of a prior.
fn past(problem: &Problem) -> Option<MemberState> {
    match problem.prior {
        Prior::Equilibrium => None,
        Prior::Step(pose, _) | Prior::Held(pose, _) => {
            Some(MemberState { u: pose.displacement.clone(), v: pose.velocity.clone() })
        }
    }
}

fn begun<'a>(problem: &Problem, past: &'a Option<MemberState>, nodes: usize) -> Start<'a> {
    match (past, stage(problem, 0.0)) {
        (Some(past), Some(stage)) => Start::new(&stage, &[past]),
        _ => Start::still(nodes),
    }
}

/// What unknown forces balance at the pose that a body is held at.
fn balance(problem: &Problem, equation: &mut Equation) -> Option<Nodes> {
    match problem.prior {
        Prior::Held(pose, _) => Some(equation.residual(&pose.displacement)),
        Prior::Equilibrium | Prior::Step(..) => None,
    }
}

/// The prior's tangent stiffness K and its factor or preconditioner at a displacement.
struct Stiffness<'a> {
    matrix: Packed<'a, f64>,
    prepared: &'a Prepared<'a>,
}

impl Precondition for Prepared<'_> {
    fn apply(&self, r: &[DVec3], z: &mut [DVec3]) {
        match self {
            Prepared::Direct(factor) => {
                z.copy_from_slice(r);
                factor.solve(&mut [z]);
            }
            Prepared::Iterative(_, precondition, _) => precondition.apply(r, z),
        }
    }
}

/// Hands K at u, of which the equation has computed the residual, to `f`: the exact one, or where that is not positive definite one that is.
fn with_stiffness<T>(
    shared: &Shared,
    equation: &Equation,
    u: &[DVec3],
    f: impl FnOnce(&Stiffness) -> Result<T, Reason>,
) -> Result<T, Reason> {
    let rows = &equation.context.pattern.blocks;
    newton::with_tangent(equation, &shared.solvers, u, &EVER_TAMER, |matrix, prepared| {
        f(&Stiffness { matrix: Packed::new(rows, matrix, |v| v), prepared })
    })
    .ok_or_else(|| {
        let detail = "the prior's stiffness is not positive definite; a clamp, or track.prior = \"dynamic\", holds it";
        (FailureKind::LinearSolve, detail.into())
    })?
}

/// K + η JᵀWJ.
struct Total<'a> {
    stiffness: &'a Packed<'a, f64>,
    temperature: f64,
    pulls: &'a dyn Pulls,
}

impl Operator for Total<'_> {
    fn multiply(&self, x: &[DVec3], y: &mut [DVec3]) {
        self.stiffness.multiply(x, y);
        add_scaled(y, self.temperature, &self.pulls.product(x));
    }
}

/// One step of Gauss–Newton's method; how far its model says that Φ falls.
fn step(
    shared: &Shared,
    places: &Places,
    equation: &mut Equation,
    problem: &Problem,
    pulls: &dyn Pulls,
    u: &mut Nodes,
) -> Result<f64, Reason> {
    let temperature = problem.temperature;
    let balance = balance(problem, equation);
    let mut slope = equation.residual(u);
    balance.iter().for_each(|b| add_scaled(&mut slope, -1.0, b));
    add_scaled(&mut slope, temperature, &pulls.gradient());
    if !is_finite(&slope) {
        return Err((FailureKind::NotFinite, "the prior's forces at the guess".into()));
    }
    let minus: Nodes = slope.iter().map(|v| -*v).collect();
    let mut direction = zeros(u.len());
    with_stiffness(shared, equation, u, |k| {
        let total = Total { stiffness: &k.matrix, temperature, pulls };
        match conjugate_gradient::solve(&total, k.prepared, &minus, &mut direction, DIRECTION, 0.0, ITERATIONS) {
            // What is left after so many iterations is a direction that leads down all the same.
            CgEnd::Converged(_) | CgEnd::Unconverged(_) if is_finite(&direction) => Ok(()),
            _ => Err((FailureKind::LinearSolve, "no direction for a tracked frame".into())),
        }
    })?;
    let promised = dot(&slope, &direction);
    let start = u.clone();
    let value = |u: &[DVec3], equation: &Equation| {
        equation.potential(u) - balance.as_ref().map_or(0.0, |b| dot(b, u)) + temperature * pulls.value(u)
    };
    let before = value(&start, equation);
    let mut length = (TURN / places.largest_gradient(&direction)).min(1.0);
    for _ in 0..HALVINGS {
        u.copy_from_slice(&start);
        add_scaled(u, length, &direction);
        let after = value(u, equation);
        // Close to the solution the change drowns in rounding.
        let rounding = 1e-12 * (before.abs() + after.abs());
        if after <= before + ARMIJO * length * promised + rounding {
            break;
        }
        length *= 0.5;
    }
    Ok(-0.5 * length * promised / temperature)
}

impl Follow for Tracker {
    fn start(&mut self) -> Result<Pose, Failure> {
        let n = self.world.shared.plan.body.nodes.len();
        let mut first = MemberState { u: zeros(n), v: zeros(n) };
        let (shared, member) = (&self.world.shared, &mut self.world.members[0]);
        simulate::start(shared, member, &mut first).map_err(|r| newton::at(0.0)(r).in_plan(&shared.plan, &member.theta))?;
        debug_assert!(shared.plan.initial != InitialShape::Given || member.coefficients.changes.rest.is_some());
        Ok(Pose { displacement: first.u, velocity: first.v })
    }

    fn approach(&mut self, problem: &Problem, pull: Pull, u: &mut Vec<DVec3>) -> Result<f64, Failure> {
        if let Pull::Surface { band } = pull {
            self.world.shared.plan.band = band;
        }
        let (shared, member) = (&self.world.shared, &self.world.members[0]);
        let past = past(problem);
        let start = begun(problem, &past, u.len());
        let mut equation = prior(shared, member, problem, &start);
        let pulls: Box<dyn Pulls> = match pull {
            Pull::Surface { .. } => Box::new(ByCost::new(shared, member, problem.frame, u)),
            Pull::Mixture { spread, outliers } => {
                let look = member.look(shared, problem.frame);
                let places = self.places.at(&shared.plan.body, u);
                let shares = self.who.shares(&sighting(look, &places, self.places.spacing), spread, outliers)?;
                Box::new(ByMixture::new(&shared.plan.body, &shares, look, u))
            }
        };
        step(shared, &self.places, &mut equation, problem, pulls.as_ref(), u).map_err(self.failure(problem.frame))
    }

    fn look(&mut self, frame: usize, u: &[DVec3], band: f64) -> Met {
        self.world.shared.plan.band = band;
        let (shared, member) = (&self.world.shared, &self.world.members[0]);
        let sums = member.compare(shared, frame, u.to_vec()).sums;
        let readings = shared.plan.observation.frames[frame].residuals();
        let rms = if sums.matched > 0 { (sums.squares / sums.matched as f64).sqrt() } else { 0.0 };
        Met { readings, matched: sums.matched, rms, cost: sums.cost }
    }

    fn certainty(&mut self, problem: &Problem, band: f64, u: &[DVec3], draws: &[Vec<DVec3>]) -> Result<Certainty, Failure> {
        self.world.shared.plan.band = band;
        let (shared, member) = (&self.world.shared, &self.world.members[0]);
        let past = past(problem);
        let start = begun(problem, &past, u.len());
        let mut equation = prior(shared, member, problem, &start);
        let balance = balance(problem, &mut equation);
        let mut residual = equation.residual(u);
        balance.iter().for_each(|b| add_scaled(&mut residual, -1.0, b));
        let pulls = ByCost::new(shared, member, problem.frame, u);
        let energy = {
            let still = Start::still(u.len());
            simulate::equation(shared, member, None, &still).strain_energy(u)
        };
        with_stiffness(shared, &equation, u, |k| Ok(draws::certainty(k, problem.temperature, &pulls, &residual, draws, energy)))
            .map_err(self.failure(problem.frame))
    }

    fn pierced(&mut self, frame: usize, u: &[DVec3]) -> Result<f64, Failure> {
        let (shared, member) = (&self.world.shared, &self.world.members[0]);
        let places = self.places.at(&shared.plan.body, u);
        Ok(self.who.rays(&sighting(member.look(shared, frame), &places, self.places.spacing))?.share())
    }

    fn seen(&mut self, frame: usize, u: &[DVec3]) -> Result<Vec<bool>, Failure> {
        let (shared, member) = (&self.world.shared, &self.world.members[0]);
        let places = self.places.at(&shared.plan.body, u);
        self.who.read(&sighting(member.look(shared, frame), &places, self.places.spacing))
    }
}
