//! Vibrations about an equilibrium: `K φ = ω² M φ` with the tangent stiffness K there. A body that droops vibrates about its drooping shape, so K is taken
//! there: at the shape that is free of stress, frequencies of a bar that sags by half its length give a modulus 6 % off (Wang et al. 2015 use the
//! latter).

use crate::CpuBackend;
use crate::linear::jacobi::BlockJacobi;
use crate::linear::matrix::{Matrix, Operator, Packed};
use crate::linear::vector::{Nodes, add_scaled, dot};
use crate::linear::{Digits, Purpose, Task};
use crate::newton::{self, Reason};
use crate::simulate::{self, Start, equation};
use crate::terms::{Curvature, zeros};
use crate::world::{Member, MemberState, Shared, World};
use faer::{Mat, Side};
use glam::DVec3;
use palpate_engine::{Failure, FailureKind, ParamBatch};
use palpate_model::plan::Plan;
use palpate_model::plan::scheme::Stage;
use palpate_model::scene::InitialShape;

/// Vectors that are iterated beyond those that are wanted: the nearest that is left out decides how fast they converge.
const MORE: usize = 6;
/// Most iterations, and the change of the squared frequencies, over the largest wanted one, at which they have converged.
const ITERATIONS: usize = 60;
const SETTLED: f64 = 1e-9;
/// Length of a step so short that its matrix is inertia alone [s].
const INSTANT: f64 = 1e-8;

/// The lowest vibrations of a body that is held.
#[derive(Clone, Debug, PartialEq)]
pub struct Modes {
    /// Displacement at the equilibrium [m] `[N]`.
    pub equilibrium: Vec<DVec3>,
    /// Angular frequencies, rising [rad/s].
    pub frequencies: Vec<f64>,
    /// Shapes with φᵀMφ = 1 [kg^−½], one `[N]` each.
    pub shapes: Vec<Vec<DVec3>>,
}

impl CpuBackend {
    /// The `count` lowest vibrations of a plan about its equilibrium, by subspace iteration (Bathe & Wilson 1972).
    ///
    /// # Errors
    /// There is no stable equilibrium, for one because nothing holds the body.
    pub fn modes(&self, plan: &Plan, theta: &[f64], count: usize) -> Result<Modes, Failure> {
        faer::set_global_parallelism(faer::Par::Seq);
        let initial = if plan.initial == InitialShape::Given { InitialShape::Given } else { InitialShape::StaticEquilibrium };
        let mut world = World::new(&Plan { initial, ..plan.clone() });
        world.set_params(&ParamBatch::of(theta));
        let n = plan.body.nodes.len();
        let mut at = MemberState { u: zeros(n), v: zeros(n) };
        let (shared, member) = (&world.shared, &mut world.members[0]);
        let found = simulate::start(shared, member, &mut at).and_then(|()| {
            let physics = &mut member.coefficients.physics;
            (physics.mass_damping, physics.stiffness_damping) = (0.0, 0.0);
            lowest(shared, member, &at.u, count.min(3 * n))
        });
        let (frequencies, shapes) = found.map_err(|r| newton::at(0.0)(r).in_plan(plan, theta))?;
        Ok(Modes { equilibrium: at.u, frequencies, shapes })
    }
}

/// K and M at u.
fn matrices(shared: &Shared, member: &Member, u: &[DVec3]) -> (Matrix, Matrix) {
    let n = u.len();
    let (still, mut stiffness, mut mass) = (Start::still(n), Matrix::default(), Matrix::default());
    let mut e = equation(shared, member, None, &still);
    e.residual(u);
    e.tangent(u, Curvature::Exact, &mut stiffness);
    let stage = Stage {
        number: 0,
        step: 0,
        from: vec![(0, 1.0)],
        length: INSTANT,
        theta: 1.0,
        time: INSTANT,
        completes: Some(0),
        still: false,
    };
    let at = MemberState { u: u.to_vec(), v: zeros(n) };
    let start = Start::new(&stage, &[&at]);
    let mut e = equation(shared, member, Some(&stage), &start);
    e.residual(u);
    e.tangent(u, Curvature::Exact, &mut mass);
    for (m, k) in mass.values.iter_mut().zip(&stiffness.values) {
        *m = INSTANT * INSTANT * (*m - *k);
    }
    (stiffness, mass)
}

fn unstable() -> Reason {
    (
        FailureKind::NoEquilibrium,
        "the body does not vibrate about this shape: its stiffness there is not positive definite".into(),
    )
}

fn lowest(shared: &Shared, member: &Member, u: &[DVec3], count: usize) -> Result<(Vec<f64>, Vec<Nodes>), Reason> {
    let (stiffness, mass) = matrices(shared, member, u);
    let (body, pattern) = (&shared.plan.body, &shared.pattern);
    let diagonal = BlockJacobi::new(&pattern.blocks, &stiffness).map_err(|_| unstable())?;
    let (mut level, purpose, digits) = (None, Purpose::Static, Digits::All);
    let task = Task { body, pattern, matrix: &stiffness, diagonal: &diagonal, u, purpose, digits, inertia: 0.0 };
    let prepared = shared.solvers.prepare(task, &mut level).map_err(|_| unstable())?;
    let mass = Packed::new(&pattern.blocks, &mass, |v| v);
    let times_mass = |x: &Nodes| {
        let mut y = zeros(x.len());
        mass.multiply(x, &mut y);
        y
    };
    let width = (count + MORE).min(3 * u.len());
    let mut vectors = begun(u.len(), width);
    let mut values = vec![0.0; width];
    for _ in 0..ITERATIONS {
        let forces: Vec<Nodes> = vectors.iter().map(times_mass).collect();
        let mut next = forces.clone();
        prepared.solve_many(&mut next, 1e-10).map_err(|_| unstable())?;
        // On the new vectors x = K⁻¹ f: xᵀKx = xᵀf.
        let images: Vec<Nodes> = next.iter().map(times_mass).collect();
        let of = |other: &[Nodes]| Mat::from_fn(width, width, |i, j| 0.5 * (dot(&next[i], &other[j]) + dot(&next[j], &other[i])));
        let (now, weights) = ritz(&of(&forces), &of(&images)).ok_or_else(unstable)?;
        vectors = (0..width)
            .map(|j| {
                let mut v = zeros(u.len());
                next.iter().enumerate().for_each(|(i, x)| add_scaled(&mut v, weights[(i, j)], x));
                v
            })
            .collect();
        let largest = now[count - 1];
        let change = now.iter().zip(&values).take(count).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        values = now;
        if change <= SETTLED * largest {
            break;
        }
    }
    vectors.truncate(count);
    Ok((values[..count].iter().map(|l| l.max(0.0).sqrt()).collect(), vectors))
}

/// Rising λ of A y = λ B y, and y with yᵀBy = 1.
fn ritz(a: &Mat<f64>, b: &Mat<f64>) -> Option<(Vec<f64>, Mat<f64>)> {
    let n = a.nrows();
    let of_b = b.self_adjoint_eigen(Side::Lower).ok()?;
    let root = Mat::from_fn(n, n, |i, j| of_b.U()[(i, j)] / of_b.S()[j].max(f64::MIN_POSITIVE).sqrt());
    let inner = root.transpose() * a * &root;
    let eigen = inner.self_adjoint_eigen(Side::Lower).ok()?;
    Some(((0..n).map(|k| eigen.S()[k]).collect(), &root * eigen.U()))
}

/// Vectors in no direction in particular, the same ones every time.
fn begun(n: usize, width: usize) -> Vec<Nodes> {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut next = || {
        // xorshift64 (Marsaglia 2003).
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    (0..width).map(|_| (0..n).map(|_| DVec3::new(next(), next(), next())).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_model::observation::Observation;
    use palpate_model::params::ParamKey;
    use palpate_model::plan::Clock;
    use palpate_model::plan::build::build_plan;
    use palpate_model::scene::*;

    /// A bar along x, held at one end.
    fn bar(length: f64, edge: f64, gravity: f64) -> Plan {
        let (min, max) = (DVec3::ZERO, DVec3::new(length, edge, edge));
        let source = BodySource::Analytic(Analytic::Box { min, max });
        let object = Object { source, pose: glam::DAffine3::IDENTITY, resolution: Resolution::CellSize(0.5 * edge) };
        let damped = Material { mass_damping: 3.0, stiffness_damping: 0.01, ..Material::undamped(1e6, 0.3) };
        let mut scene = Scene::at_rest("in-code.toml", object, damped);
        scene.gravity = DVec3::new(0.0, 0.0, -gravity);
        scene.clamps = vec![Clamp::still(DVec3::splat(-1.0), DVec3::new(1e-4, 1.0, 1.0))];
        build_plan(&scene, Observation::default(), &[]).unwrap()
    }

    fn undamped(plan: &Plan) -> World {
        let mut world = World::new(&Plan { initial: InitialShape::StaticEquilibrium, ..plan.clone() });
        world.set_params(&ParamBatch::of(&plan.theta));
        let physics = &mut world.members[0].coefficients.physics;
        (physics.mass_damping, physics.stiffness_damping) = (0.0, 0.0);
        world
    }

    #[test]
    fn a_bar_has_the_frequencies_of_beam_theory() {
        let (length, edge) = (0.4, 0.02);
        let plan = bar(length, edge, 0.0);
        let modes = CpuBackend.modes(&plan, &plan.theta, 4).unwrap();
        // ω = β² √(EI/ρAL⁴) with β = 1.875 and 4.694, each in both directions across.
        let unit = (1e6 * edge * edge / (12.0 * 1000.0 * length.powi(4))).sqrt();
        for (k, beta) in [(0, 1.875_104), (1, 1.875_104), (2, 4.694_091), (3, 4.694_091)] {
            let expected = f64::powi(beta, 2) * unit;
            // Shear and rotational inertia take 2 % of the second pair at a slenderness of 20; the clamp holds Poisson's contraction back.
            assert!((modes.frequencies[k] / expected - 1.0).abs() < 0.03, "{k}: {} {expected}", modes.frequencies[k]);
        }
        let world = undamped(&plan);
        let (k, m) = matrices(&world.shared, &world.members[0], &modes.equilibrium);
        let rows = &world.shared.pattern.blocks;
        let (k, m) = (Packed::new(rows, &k, |v| v), Packed::new(rows, &m, |v| v));
        for (shape, omega) in modes.shapes.iter().zip(&modes.frequencies) {
            let (mut force, mut inertia) = (zeros(shape.len()), zeros(shape.len()));
            k.multiply(shape, &mut force);
            m.multiply(shape, &mut inertia);
            assert!((dot(shape, &inertia) - 1.0).abs() < 1e-9);
            assert!((dot(shape, &force) / (omega * omega) - 1.0).abs() < 1e-6);
        }
        // All of the mass is there: that of a rigid shift.
        let (shift, mut inertia) = (vec![DVec3::X; plan.body.nodes.len()], zeros(plan.body.nodes.len()));
        m.multiply(&shift, &mut inertia);
        assert!((dot(&shift, &inertia) / (1000.0 * length * edge * edge) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn a_sagging_bar_vibrates_about_its_equilibrium() {
        let plan = bar(0.4, 0.02, 9.81);
        let mut modes = CpuBackend.modes(&plan, &plan.theta, 2).unwrap();
        let sag = modes.equilibrium.iter().map(|u| -u.z).fold(0.0, f64::max);
        assert!(sag > 0.1, "{sag}");
        // Up and down, not sideways.
        let upright = |k: &usize| modes.shapes[*k].iter().map(|v| v.z.abs()).sum::<f64>();
        let k = [0, 1].into_iter().max_by(|a, b| upright(a).total_cmp(&upright(b))).unwrap();
        (modes.frequencies, modes.shapes) = (vec![modes.frequencies[k]], vec![modes.shapes[k].clone()]);
        // A small pluck, simulated without damping. Along the shape of the vibration the motion is a sine, of which half a period is seen.
        let mut plucked = plan.clone();
        plucked.initial = InitialShape::StaticEquilibrium;
        let half = std::f64::consts::PI / modes.frequencies[0];
        plucked.clock = Clock { step: half / 100.0, steps: 110, ..plucked.clock };
        let mut theta = plucked.theta.clone();
        for (key, value) in [(ParamKey::MassDamping, 0.0), (ParamKey::StiffnessDamping, 0.0), (ParamKey::Velocity(2), 0.01)] {
            theta[plan.layout.index(key)] = value;
        }
        let world = undamped(&plan);
        let m =
            Packed::new(&world.shared.pattern.blocks, &matrices(&world.shared, &world.members[0], &modes.equilibrium).1, |v| v);
        let mut weights = zeros(plan.body.nodes.len());
        m.multiply(&modes.shapes[0], &mut weights);
        let mut along = Vec::new();
        let mut rollout = palpate_engine::Rollout::new(CpuBackend, &plucked, 1).unwrap();
        let visit = |_: usize, s: palpate_engine::Snapshot, _: Vec<palpate_engine::FrameResiduals>| {
            let moved: Nodes = s.displacement.iter().zip(&modes.equilibrium).map(|(u, e)| *u - *e).collect();
            along.push((s.time, dot(&moved, &weights)));
            std::ops::ControlFlow::Continue(())
        };
        rollout.visit(&theta, visit).unwrap();
        let sign = along[10].1.signum();
        let k = (10..along.len()).find(|k| along[*k].1 * sign < 0.0).unwrap();
        let ((t0, a), (t1, b)) = (along[k - 1], along[k]);
        let crossed = t0 + (t1 - t0) * a / (a - b);
        // A hundred steps of second order for half a period: (π/100)²/12; the pluck is a hundredth of the sag.
        assert!((crossed / half - 1.0).abs() < 2e-3, "{crossed} {half}");
    }

    #[test]
    fn a_body_that_nothing_holds_is_refused() {
        let mut plan = bar(0.2, 0.04, 0.0);
        plan.clamps.clear();
        let failure = CpuBackend.modes(&plan, &plan.theta, 2).unwrap_err();
        assert!(failure.message().contains("no clamp"), "{}", failure.message());
    }
}
