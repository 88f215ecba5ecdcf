//! Jets of air on the patches that they reach (`palpate_model::effects::jet`).
//!
//! A jet's force depends on where the surface is and how it is turned, and that derivative is not symmetric. So it is lagged. In a time step it
//! is taken at the state that the step starts from: an explicit load, whose derivatives go by the past. An equilibrium is swept: it is solved
//! under the force of the last state, again and again, until nothing changes. What is found does not depend on the sweeps, and its
//! derivatives are those of the whole balance, (K + J) du = −∂r/∂p with J by the jets, by GMRES behind K's factor.
//!
//! Which patches the nozzle sees is a lagged choice without a derivative: of the step's start, or of the first sweeps.

use super::seen::seen;
use super::{Context, Curvature, Forces, PastChange, PastGradient, Term, zeros};
use crate::linear::matrix::Matrix;
use crate::linear::vector::Nodes;
use crate::linear::{Solvers, gmres};
use crate::newton::{self, Reason};
use crate::simulate::{Start, context};
use crate::terms::Equation;
use crate::world::{Member, Shared};
use glam::{DMat3, DVec3};
use palpate_engine::FailureKind;
use palpate_model::effects::Site;
use palpate_model::effects::jet::{Blown, Meeting, OFFSET, SPREAD, THRUST};
use palpate_model::mechanics::motion::Pose;
use palpate_model::mechanics::normal::{carried, carried_along, carried_pull};
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::plan::scheme::Stage;
use palpate_model::plan::{Physics, Plan};
use palpate_model::space::body::Patch;
use palpate_model::space::stencil::Stencil;

/// Sweeps after which what the nozzle sees is kept: patches at an outline could come and go for ever.
const LOOKS: usize = 3;
/// Most sweeps. Each leaves of an error as much as the jet's stiffness is of the body's: 60 suffice for two thirds.
const SWEEPS: usize = 60;
/// Change of the last sweep, in parts of an element. Where the residual is within Newton's tolerance nothing changes at all.
const STILL: f64 = 1e-13;
/// What products may leave of a derivative's right-hand side, and how many there are.
const LEFT: f64 = 1e-11;
/// See [`LEFT`].
const PRODUCTS: usize = 120;

/// State that jets are taken at in an equilibrium.
#[derive(Clone, Debug)]
pub struct Lag {
    /// Displacement `[N]` [m].
    pub u: Nodes,
    /// Patches that each jet's nozzle sees; `None` = those of this state.
    pub seen: Option<Vec<Vec<bool>>>,
}

/// True where a plan has a jet.
pub fn blow(plan: &Plan) -> bool {
    plan.layout.effects().any(|(law, _)| matches!(law.site, Site::Jet))
}

/// What an equilibrium with displacement `u` starts from.
pub(crate) fn at<'a>(shared: &Shared, u: &[DVec3]) -> Start<'a> {
    if blow(&shared.plan) { Start::swept(Lag { u: u.to_vec(), seen: None }) } else { Start::still(u.len()) }
}

/// Solves for an equilibrium again and again under the force at the last one.
pub(crate) fn swept(
    shared: &Shared,
    member: &Member,
    stage: Option<&Stage>,
    u: &mut Nodes,
    mut solve: impl FnMut(&Start, &mut Nodes) -> Result<(), Reason>,
) -> Result<(), Reason> {
    let (mut kept, mut change) = (None, 0.0);
    for sweep in 0..SWEEPS {
        let mut start = Start::swept(Lag { u: u.clone(), seen: kept.take() });
        if sweep < LOOKS {
            let seen = Jets::new(context(shared, member, stage, &start)).map(|j| j.all.into_iter().map(|n| n.seen).collect());
            start = Start::swept(Lag { u: u.clone(), seen });
        }
        let before = u.clone();
        solve(&start, u)?;
        change = u.iter().zip(&before).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        if change <= STILL * shared.plan.body.length {
            return Ok(());
        }
        kept = start.into_seen();
    }
    let length = shared.plan.body.length;
    let text = format!(
        "the body and the jet on it do not settle: the last of {SWEEPS} rounds still moved it by {:.1e} of a cell (it may flutter; the thrust may \
         be too large for it)",
        change / length
    );
    Err((FailureKind::NoEquilibrium, text))
}

/// A jet within a solve.
struct Now {
    effect: usize,
    pose: Pose,
    /// Axis and place of the virtual origin in the nozzle's coordinates.
    axis: DVec3,
    offset: DVec3,
    seen: Vec<bool>,
    /// Patches that it blows on.
    blown: Vec<(usize, Blown)>,
}

/// The jets of a member.
pub struct Jets<'a> {
    c: Context<'a>,
    all: Vec<Now>,
    /// Their forces at the nodes `[N]` [N].
    force: Nodes,
}

impl Now {
    /// Those of a member at `time` [s], on a body with displacement `u`; `known` says what their nozzles see.
    fn all(plan: &Plan, physics: &Physics, time: f64, u: &[DVec3], known: Option<&Vec<Vec<bool>>>) -> Vec<Now> {
        let body = &plan.body;
        let mut all: Vec<Now> = Vec::new();
        for (effect, (law, _)) in plan.layout.effects().enumerate() {
            let moving = plan.moving.get(effect).and_then(Option::as_ref);
            let (Site::Jet, Some(moving)) = (&law.site, moving) else { continue };
            let values = &physics.effects[effect];
            let (offset, pose) = (DVec3::from_slice(&values[OFFSET..OFFSET + 3]), moving.motion.pose(time));
            let (origin, axis) = (pose.rotation * offset + pose.translation, pose.rotation * moving.axis);
            let places: Vec<DVec3> = body.pieces().map(|(p, place)| p.point + place.at(u) - origin).collect();
            let area =
                |(patch, frame): (&Patch, Stencil)| patch.area * carried(patch.normal, DMat3::IDENTITY + frame.gradient_of(u));
            let areas: Vec<DVec3> = body.patches.iter().zip(plan.frames.iter()).map(area).collect();
            let known = known.map(|seen| seen[all.len()].clone());
            let seen = known.unwrap_or_else(|| seen(body, &places, &areas, axis, values[SPREAD]));
            let mut blown = Vec::new();
            for (number, area) in areas.into_iter().enumerate().filter(|(n, _)| seen[*n]) {
                let at = Meeting { way: places[number], area, axis, thrust: values[THRUST], spread: values[SPREAD] };
                blown.extend(Blown::new(at).map(|b| (number, b)));
            }
            all.push(Now { effect, pose, axis: moving.axis, offset, seen, blown });
        }
        all
    }

    /// Change of what a patch meets for a later time.
    fn later(&self) -> Meeting {
        let turned = self.pose.rotation_rate;
        Meeting { way: -(turned * self.offset + self.pose.velocity), axis: turned * self.axis, ..Meeting::default() }
    }
}

/// Forces of a scene's jets on a body with displacement `u` `[N]` [m] at `time` [s], one for each jet [N].
pub fn forces(plan: &Plan, physics: &Physics, time: f64, u: &[DVec3]) -> Vec<DVec3> {
    let of = |n: &Now| n.blown.iter().map(|b| b.1.force).sum();
    Now::all(plan, physics, time, u, None).iter().map(of).collect()
}

impl<'a> Jets<'a> {
    /// Those that a member has; `None` without any.
    pub fn new(c: Context<'a>) -> Option<Jets<'a>> {
        let lag = c.past.lag.map_or(c.past.u, |l| &l.u[..]);
        // Where the scheme weights the other forces.
        let time = c.time - (1.0 - c.weights.new) * c.length();
        let all = Now::all(c.plan, c.physics(), time, lag, c.past.lag.and_then(|l| l.seen.as_ref()));
        if all.is_empty() {
            return None;
        }
        let mut force = zeros(c.plan.body.nodes.len());
        for (number, blown) in all.iter().flat_map(|n| &n.blown) {
            c.plan.body.surface.get(*number).spread(blown.force, &mut force);
        }
        Some(Jets { c, all, force })
    }

    /// Adds the derivative of the residual along a change of the state that the jets are taken at.
    fn by_lag(&self, du: &[DVec3], out: &mut [DVec3]) {
        let (plan, lag) = (self.c.plan, self.lag());
        for (number, blown) in self.all.iter().flat_map(|n| &n.blown) {
            let (patch, place, frame) = (&plan.body.patches[*number], plan.body.surface.get(*number), plan.frames.get(*number));
            let (f, d) = (DMat3::IDENTITY + frame.gradient_of(lag), frame.gradient_of(du));
            let area = patch.area * carried_along(patch.normal, f, d);
            let change = blown.along(&Meeting { way: place.at(du), area, ..Meeting::default() });
            place.spread(-change, out);
        }
    }

    /// Its transpose.
    fn by_lag_transposed(&self, z: &[DVec3], out: &mut [DVec3]) {
        let (plan, lag) = (self.c.plan, self.lag());
        for (number, blown) in self.all.iter().flat_map(|n| &n.blown) {
            let (patch, place, frame) = (&plan.body.patches[*number], plan.body.surface.get(*number), plan.frames.get(*number));
            let by = blown.pull(-place.at(z));
            place.spread(by.way, out);
            let f = DMat3::IDENTITY + frame.gradient_of(lag);
            frame.spread_gradient(carried_pull(patch.normal, f, patch.area * by.area), out);
        }
    }

    fn lag(&self) -> &'a [DVec3] {
        self.c.past.lag.map_or(self.c.past.u, |l| &l.u[..])
    }

    /// Solves (K + J) x = b at an equilibrium, for every column.
    pub(crate) fn solve_along(&self, e: &Equation, solvers: &Solvers, u: &[DVec3], columns: &mut [Nodes]) -> Result<(), Reason> {
        self.solve(e, solvers, u, columns, false).map(|_| ())
    }

    /// Solves (K + Jᵀ) x = b there; the solves with K that it took.
    pub(crate) fn solve_back(
        &self,
        e: &Equation,
        solvers: &Solvers,
        u: &[DVec3],
        columns: &mut [Nodes],
    ) -> Result<usize, Reason> {
        self.solve(e, solvers, u, columns, true)
    }

    /// With x = K⁻¹ y it is y + J K⁻¹ y = b, close to the identity.
    fn solve(&self, e: &Equation, solvers: &Solvers, u: &[DVec3], columns: &mut [Nodes], back: bool) -> Result<usize, Reason> {
        let count = std::cell::Cell::new(0);
        let solved = newton::with_tangent(e, solvers, u, &[Curvature::Exact], |_, prepared| {
            let inverse = |b: &[DVec3]| {
                count.set(count.get() + 1);
                let mut x = b.to_vec();
                // Whether the whole has converged is seen outside.
                if prepared.solve(&mut x, 1e-13, 0.0).is_err() {
                    return vec![DVec3::NAN; b.len()];
                }
                x
            };
            let apply = |y: &[DVec3]| {
                let (x, mut out) = (inverse(y), y.to_vec());
                if back {
                    self.by_lag_transposed(&x, &mut out)
                } else {
                    self.by_lag(&x, &mut out)
                }
                out
            };
            columns.iter_mut().all(|b| match gmres::solve(apply, b, LEFT, PRODUCTS) {
                Some(y) => {
                    *b = inverse(&y);
                    true
                }
                None => false,
            })
        });
        match solved {
            Some(true) => Ok(count.get()),
            Some(false) => {
                Err((FailureKind::LinearSolve, format!("{PRODUCTS} products with a jet's derivative were not enough")))
            }
            None => Err((FailureKind::Unstable, "the tangent stiffness under the jet is not positive definite".into())),
        }
    }
}

impl Term for Jets<'_> {
    fn residual(&mut self, _u1: &[DVec3], out: &mut [DVec3]) {
        out.iter_mut().zip(&self.force).for_each(|(r, f)| *r -= *f);
    }

    fn potential(&self, u1: &[DVec3]) -> f64 {
        -u1.iter().zip(&self.force).map(|(u, f)| u.dot(*f)).sum::<f64>()
    }

    fn tangent(&self, _u1: &[DVec3], _curvature: Curvature, _matrix: &mut Matrix) {}

    fn by_past(&self, _u1: &[DVec3], change: &PastChange, out: &mut [DVec3]) {
        self.by_lag(change.u, out);
    }

    fn by_past_transposed(&self, _u1: &[DVec3], z: &[DVec3], out: &mut PastGradient) {
        self.by_lag_transposed(z, &mut out.u);
    }

    fn by_coefficients(&self, _u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        for now in &self.all {
            let (numbers, start) = (&rates.physics.effects[now.effect], rates.physics.start);
            if start == 0.0 && numbers.iter().all(|r| *r == 0.0) {
                continue;
            }
            let later = now.later();
            let d = Meeting {
                way: start * later.way - now.pose.rotation * DVec3::from_slice(&numbers[OFFSET..OFFSET + 3]),
                axis: start * later.axis,
                thrust: numbers[THRUST],
                spread: numbers[SPREAD],
                ..Meeting::default()
            };
            for (number, blown) in &now.blown {
                self.c.plan.body.surface.get(*number).spread(-blown.along(&d), out);
            }
        }
    }

    fn by_coefficients_transposed(&self, _u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        for now in self.all.iter().filter(|n| sought.effects[n.effect] || sought.start) {
            let later = now.later();
            for (number, blown) in &now.blown {
                let by = blown.pull(-self.c.plan.body.surface.get(*number).at(z));
                gradient.physics.start += by.way.dot(later.way) + by.axis.dot(later.axis);
                let numbers = &mut gradient.physics.effects[now.effect];
                numbers[THRUST] += by.thrust;
                numbers[SPREAD] += by.spread;
                let offset = -(now.pose.rotation.transpose() * by.way);
                (0..3).for_each(|a| numbers[OFFSET + a] += offset[a]);
            }
        }
    }

    fn forces(&self, _u1: &[DVec3], out: &mut Forces) {
        out.supports.iter_mut().zip(&self.force).for_each(|(r, f)| *r -= *f);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CpuBackend;
    use glam::{DAffine3, DQuat};
    use palpate_engine::{Evaluate, ParamBatch, Request, Rollout, Wanted};
    use palpate_model::effects::moving::Moving;
    use palpate_model::effects::{Effect, find};
    use palpate_model::mechanics::motion::RigidMotion;
    use palpate_model::observation::{Channel, Frame, Observation, ObservedMarker, ReadingKind, TrackRest};
    use palpate_model::plan::build::build_plan;
    use palpate_model::plan::scheme::QUASI_STATIC;
    use palpate_model::scene::*;
    use std::sync::Arc;

    #[test]
    fn an_equilibrium_has_the_derivatives_of_its_whole_balance() {
        let shape = Analytic::Box { min: DVec3::ZERO, max: DVec3::new(0.1, 0.03, 0.03) };
        let resolution = Resolution::CellSize(0.0125);
        let object = Object { source: BodySource::Analytic(shape), pose: DAffine3::IDENTITY, resolution };
        let mut s = Scene::at_rest("in-code.toml", object, Material::undamped(2.5e5, 0.45));
        s.clamps = vec![Clamp::still(DVec3::splat(-1.0), DVec3::new(0.006, 1.0, 1.0))];
        s.time = Time { scheme: &QUASI_STATIC, steps: 0, ..Time::default() };
        s.solver.tolerance = 1e-12;
        let from = DVec3::new(0.12, 0.075, 0.2);
        let motion = RigidMotion {
            times: vec![0.0, 2.0],
            translations: vec![from, from - DVec3::new(0.01, 0.0, 0.02)],
            rotations: vec![DQuat::from_rotation_y(0.05), DQuat::from_rotation_x(0.1)],
        };
        // Askew, so that no face lies along it: there the force begins with its square, which spoils differences.
        let moving = Some(Arc::new(Moving::nozzle(DVec3::new(-0.2, -0.35, -1.0).normalize(), motion)));
        let values = [0.6, 0.25, 0.001, -0.002, 0.0005].map(Some).to_vec();
        s.effects = vec![Effect { values, moving, ..Effect::absent(find("jet").expect("it is in the table")) }];
        let rest = vec![DVec3::new(0.1, 0.015, 0.015), DVec3::new(0.07, 0.0, 0.03)];
        let markers = (0..).zip(&rest).map(|(site, p)| ObservedMarker { site, position: *p - 0.01 * DVec3::Z }).collect();
        let observation = Observation {
            frames: vec![Frame { time: 0.7, markers, ..Frame::default() }],
            channels: vec![Channel::new(ReadingKind::Track, 1e-3)],
            tracks: TrackRest { places: rest, tolerance: None },
            ..Observation::default()
        };
        let plan = build_plan(&s, observation, &[]).expect("it can be planned");
        let mut rollout = Rollout::new(CpuBackend, &plan, 1).expect("the CPU takes it");
        let mut cost = |theta: Vec<f64>, gradient| {
            let request = Request { gradient, sensitivities: Vec::new() };
            let e = rollout.evaluate(&ParamBatch::from_rows(&[theta]), &request).remove(0);
            assert!(e.failure.is_none(), "{:?}", e.failure);
            (e.cost, e.gradient)
        };
        let gradient = cost(plan.theta.clone(), Wanted::All).1;
        let is_own = |i: &usize| plan.layout.keys[*i].spec().path.starts_with("load.0.");
        let own: Vec<usize> = (0..plan.theta.len()).filter(is_own).collect();
        assert_eq!(own.len(), 5);
        for i in own {
            let size = plan.layout.keys[i].spec().typical;
            let at = |s: f64| {
                let mut theta = plan.theta.clone();
                theta[i] += s * 1e-4 * size;
                theta
            };
            let c = [-2.0, -1.0, 1.0, 2.0].map(|s| cost(at(s), Wanted::Nothing).0);
            let (difference, exact) = ((c[0] - 8.0 * c[1] + 8.0 * c[2] - c[3]) / 12e-4, gradient[i] * size);
            // Of the largest, by the spread: differences of fourth order, and equilibria to 1e-12 of their forces.
            println!("{i} {exact:e} {difference:e}");
            assert!((difference - exact).abs() < 1e-6 * exact.abs().max(1e-3), "{i}: {exact} {difference}");
        }
    }
}
