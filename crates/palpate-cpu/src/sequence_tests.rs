//! Sequences of equilibria that are found side by side: what they are equal to, that bits do not depend on threads, and their tangents as products.

use crate::CpuBackend;
use crate::kept::Kept;
use crate::linear::matrix::{Matrix, Operator, Packed};
use crate::local_bodies::{Made, ball, cloud};
use crate::simulate::{Start, equation};
use crate::terms::Curvature;
use crate::world::World;
use glam::DVec3;
use palpate_engine::{Evaluate, Evaluation, ParamBatch, Request, Rollout, Wanted};
use palpate_model::effects::Effect;
use palpate_model::materials;
use palpate_model::observation::{Channel, Frame, Observation, ObservedMarker, ReadingKind, TrackRest};
use palpate_model::params::fields::{Basis, FieldSpec, Scale, Varied};
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::plan::scheme::QUASI_STATIC;
use palpate_model::scene::{BodySource, LinearSolver, Scene, Solver, Time};

/// Tracks of two places at so many times, up to the end of the clamp's motion.
fn tracks(frames: usize) -> Observation {
    let rest = vec![DVec3::new(0.0, 0.0, 0.03), DVec3::new(-0.02, 0.02, 0.04)];
    let markers = |t: f64| {
        let moved = |p: &DVec3| *p + t * DVec3::new(0.008, 0.002, 0.017);
        (0..).zip(&rest).map(|(site, p)| ObservedMarker { site, position: moved(p) }).collect()
    };
    let times = (0..frames).map(|k| k as f64 / (frames - 1) as f64);
    Observation {
        frames: times.map(|time| Frame { time, markers: markers(time), ..Frame::default() }).collect(),
        channels: vec![Channel::new(ReadingKind::Track, 1e-3)],
        tracks: TrackRest { places: rest.clone(), tolerance: None },
        ..Observation::default()
    }
}

/// A body that hangs on a clamp which moves and turns; it leaves the plane, where there is one.
fn scene(source: BodySource, plane: bool) -> Scene {
    let basis = if matches!(source, BodySource::Cloud(_)) { Basis::Points } else { Basis::Cells };
    let field = FieldSpec { varied: Varied::Modulus, basis, scale: Scale::Log, values: None, prior: None };
    let mut s = Made { fields: vec![field], ..Made::of(source, Vec::<Effect>::new()) }.scene();
    s.material.model = materials::find("neo-hookean").expect("it is in the table");
    s.material.youngs_modulus = 2e4;
    if !plane {
        s.planes.clear();
    }
    s.time = Time { scheme: &QUASI_STATIC, steps: 0, ..Time::default() };
    s.solver = Solver { tolerance: 1e-12, ..Solver::default() };
    s
}

fn planned(scene: &Scene, frames: usize) -> Plan {
    build_plan(scene, tracks(frames), &[]).unwrap_or_else(|e| panic!("{e}"))
}

/// Cost and gradient, and the iterations of conjugate gradients on the way forward and back.
fn evaluated(plan: &Plan) -> (Evaluation, [usize; 2]) {
    let mut rollout = Rollout::new(CpuBackend, plan, 1).unwrap();
    let request = Request { gradient: Wanted::All, ..Request::default() };
    let found = rollout.evaluate(&ParamBatch::of(&plan.theta), &request).remove(0);
    assert!(found.failure.is_none(), "{:?}", found.failure);
    let effort = rollout.world_mut().effort(0);
    (found, [effort.linear, effort.adjoint])
}

/// A plan's world at its own parameters.
fn opened(plan: &Plan) -> World {
    let mut world = World::new(plan);
    world.set_params(&ParamBatch::of(&plan.theta));
    world
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
    norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / norm(&mut b.iter().copied())
}

#[test]
fn states_side_by_side_are_those_found_one_by_one() {
    // Of 40 states three windows; of 5 each is as far from the next as Newton's method takes halved ways for.
    for (name, source, plane, frames) in [
        ("cloud", cloud(4), false, 40),
        ("cloud on a plane", cloud(4), true, 40),
        ("cells", ball(), true, 40),
        ("far apart", cloud(4), true, 5),
    ] {
        let mut s = scene(source, plane);
        let (found, iterations) = evaluated(&planned(&s, frames));
        assert!(iterations.iter().all(|n| *n > 0), "{name}: {iterations:?}");
        s.solver.linear = LinearSolver::Cholesky;
        let (alone, direct) = evaluated(&planned(&s, frames));
        assert_eq!(direct, [0; 2], "{name}");
        // States and solves to 1e-12; a soft body's condition takes some digits.
        let (cost, gradient) = ((found.cost / alone.cost - 1.0).abs(), apart(&found.gradient, &alone.gradient));
        println!("{name}: {cost:.1e} {gradient:.1e} {iterations:?}");
        assert!(cost < 1e-9 && gradient < 1e-8, "{name}: {cost} {gradient}");
        // The default tolerance is 1e-8.
        (s.solver.linear, s.solver.tolerance) = (LinearSolver::Auto, Solver::default().tolerance);
        let (loose, _) = evaluated(&planned(&s, frames));
        let gradient = apart(&loose.gradient, &alone.gradient);
        println!("{name}, loose: {gradient:.1e}");
        assert!(gradient < 1e-6, "{name}: {gradient}");
    }
}

#[test]
fn bits_do_not_depend_on_threads() {
    let plan = planned(&scene(cloud(4), false), 40);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| evaluated(&plan))
    };
    let (one, three) = (on(1), on(3));
    assert_eq!(one.0.cost.to_bits(), three.0.cost.to_bits());
    assert!(one.0.gradient.iter().zip(&three.0.gradient).all(|(a, b)| a.to_bits() == b.to_bits()));
}

#[test]
fn products_are_those_with_the_matrix() {
    let plan = planned(&scene(cloud(4), false), 3);
    let world = opened(&plan);
    let (shared, member) = (&world.shared, &world.members[0]);
    let n = plan.body.nodes.len();
    let some = |seed: usize, i: usize| (DVec3::new(0.37, 0.71, 0.13) * (i + seed) as f64).fract() - 0.5;
    let u: Vec<DVec3> = (0..n).map(|i| 2e-3 * some(3, i)).collect();
    let x: Vec<DVec3> = (0..n).map(|i| some(8, i)).collect();
    let (still, mut matrix) = (Start::still(n), Matrix::default());
    let mut e = equation(shared, member, Some(&plan.stages()[0]), &still);
    e.residual(&u);
    assert!(!e.needs_matrix(&u), "a cloud under loads has products");
    e.tangent(&u, Curvature::Exact, &mut matrix);
    let [mut a, mut b] = [vec![DVec3::ZERO; n], vec![DVec3::ZERO; n]];
    e.products(&u).multiply(&x, &mut a);
    Packed::new(&shared.pattern.blocks, &matrix, |v| v).multiply(&x, &mut b);
    let flat = |v: &[DVec3]| v.iter().flat_map(|v| v.to_array()).collect::<Vec<_>>();
    assert!(apart(&flat(&a), &flat(&b)) < 1e-14, "{}", apart(&flat(&a), &flat(&b)));
}

#[test]
fn a_factor_serves_until_another_one_pays() {
    let plan = planned(&scene(cloud(3), false), 3);
    let world = opened(&plan);
    let (shared, member) = (&world.shared, &world.members[0]);
    let u = vec![DVec3::ZERO; plan.body.nodes.len()];
    let still = Start::still(u.len());
    let mut e = equation(shared, member, None, &still);
    let mut kept = Kept::new(shared, &mut e, &u, &mut Matrix::default()).expect("the shape at rest is stable");
    // Of 20 states each may take ten iterations more, and fewer states more.
    for (last, serves) in [(14, true), (15, false), (4, true)] {
        kept.served(&[7, 4, last]);
        assert_eq!((kept.serves(20), kept.serves(10)), (serves, true), "{last}");
    }
    kept.served(&[]);
    assert!(kept.serves(20), "nothing was asked of it");
}
