//! Every local derivative of the balance by itself, at random states: against central differences, and transposes against
//! products.

use crate::linear::matrix::{Operator, Packed};
use crate::passes::balance::{Balance, States};
use crate::passes::cells::{corners, zeros};
use crate::simulate::balance;
use crate::world::World;
use glam::{DAffine3, DVec3};
use palpate_engine::ParamBatch;
use palpate_model::cutcells::corotation::CellPose;
use palpate_model::effects::{ALL, Effect, Site};
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::observation::Observation;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::plan::scheme::Stage;
use palpate_model::scene::*;

/// Every effect that changes the body, its material or its clamps, at a size that matters.
fn altering() -> Vec<Effect> {
    let alters = |site: &Site| {
        let of_body = matches!(site, Site::Modulus(_) | Site::Density(_) | Site::Aging(_) | Site::Rest(_) | Site::Cells(_));
        of_body || matches!(site, Site::Clamps(_) | Site::Edges(_))
    };
    let make = |law: usize| {
        let mut effect = Effect::absent(law);
        for (value, p) in effect.values.iter_mut().zip(ALL[law].params) {
            // Cell laws three times stronger, to show beside the linear material at these strains.
            let size = if matches!(ALL[law].site, Site::Cells(_)) { 3.0 } else { 0.3 };
            *value = value.map(|v| (v + size * p.typical).clamp(p.lower, p.upper));
        }
        effect
    };
    (0..ALL.len()).filter(|l| alters(&ALL[*l].site)).map(make).collect()
}

fn plan(effects: Vec<Effect>) -> Plan {
    let motion = RigidMotion {
        times: vec![-1.0, 0.0, 1.0],
        translations: vec![DVec3::ZERO, DVec3::new(0.003, 0.001, 0.0), DVec3::new(0.01, 0.0, 0.02)],
        rotations: vec![glam::DQuat::IDENTITY, glam::DQuat::from_rotation_z(0.1), glam::DQuat::from_rotation_y(0.4)],
    };
    let scene = Scene {
        path: "in-code.toml".into(),
        title: String::new(),
        object: Object {
            source: BodySource::Analytic(Analytic::Ball { radius: 0.05, center: DVec3::new(0.003, 0.001, 0.045) }),
            pose: DAffine3::IDENTITY,
            resolution: Resolution::CellSize(0.03),
        },
        material: Material {
            inertia: Inertia::Density(1000.0),
            youngs_modulus: 5000.0,
            poisson_ratio: 0.4,
            mass_damping: 0.3,
            stiffness_damping: 0.004,
        },
        gravity: DVec3::new(0.4, -0.3, -9.0),
        clamps: vec![Clamp {
            min: DVec3::new(-1.0, -1.0, 0.07),
            max: DVec3::ONE,
            object_frame: false,
            motion: Some(motion),
            motion_path: None,
        }],
        planes: vec![Plane { point: DVec3::ZERO, normal: DVec3::new(0.1, 0.05, 1.0).normalize(), stiffness: None }],
        masses: vec![PointMass { point: DVec3::new(0.0, 0.02, 0.07), mass: 0.02 }],
        effects,
        initial: Initial {
            velocity: DVec3::ZERO,
            angular_velocity: DVec3::ZERO,
            pivot: None,
            state: InitialShape::StaticEquilibrium,
        },
        time: Time { step: 0.01, steps: 3, start: 0.05, theta: 0.55, ..Time::default() },
        solver: Solver::default(),
        observation: None,
        fit: None,
    };
    build_plan(&scene, Observation::default(), &[]).unwrap_or_else(|e| panic!("{e}"))
}

/// Random vectors in a cube of half edge `size`, reproducible.
fn random(n: usize, size: f64, seed: u64) -> Vec<DVec3> {
    let mut s = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut next = || {
        s ^= s << 13;
        s ^= s >> 7;
        s ^= s << 17;
        size * (2.0 * (s >> 11) as f64 / (1u64 << 53) as f64 - 1.0)
    };
    (0..n).map(|_| DVec3::new(next(), next(), next())).collect()
}

fn world(plan: &Plan, theta: &[f64]) -> World {
    let mut w = World::new(plan);
    w.set_params(&ParamBatch::from_rows(&[theta.to_vec()]));
    w
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

/// Largest difference over the largest entry.
fn off(a: &[DVec3], b: &[DVec3]) -> f64 {
    let size = b.iter().map(|v| v.length()).fold(1e-30, f64::max);
    a.iter().zip(b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max) / size
}

fn moved(v: &[DVec3], s: f64, d: &[DVec3]) -> Vec<DVec3> {
    v.iter().zip(d).map(|(v, d)| *v + s * *d).collect()
}

/// A displacement that turns the body inside out: z mirrored and shortened a little, and noise.
fn inverted(p: &Plan) -> Vec<DVec3> {
    let mirror = |(u, x): (DVec3, &DVec3)| u - DVec3::Z * (1.75 * (x.z - 0.045));
    random(p.body.nodes.len(), 0.003, 3).into_iter().zip(&p.body.nodes).map(mirror).collect()
}

/// Runs a check for the static balance and for a step, without effects and with all that change
/// the body, at three states each.
fn everywhere(check: impl Fn(&Plan, Option<&Stage>, &[Vec<DVec3>; 3])) {
    for effects in [Vec::new(), altering()] {
        let p = plan(effects);
        let n = p.body.nodes.len();
        let stages = p.clock.stages();
        for step in [None, Some(&stages[1])] {
            // Strains of some 10 % or cells turned inside out, contact active, the old state elsewhere, fast.
            for (seed, u) in [(1, random(n, 0.003, 1)), (2, random(n, 0.003, 2)), (3, inverted(&p))] {
                check(&p, step, &[u, random(n, 0.003, seed + 10), random(n, 0.3, seed + 20)]);
            }
        }
    }
}

// Central differences over 1e-6 of a direction of size 1e-3: truncation 1e-12 of the third derivative, rounding 1e-16 / 1e-9.
const STEP: f64 = 1e-4;
const CLOSE: f64 = 2e-7;

#[test]
fn one_of_the_states_is_guarded_against_inversion() {
    let p = plan(Vec::new());
    let u = inverted(&p);
    let pose = |e: usize| CellPose::new(&corners(&p.body, e, &u), p.body.grid.h);
    let guarded = (0..p.body.cells.len()).filter(|e| pose(*e).guard().is_some()).count();
    assert!(guarded > 0);
    // Clear of the jump itself, where nothing has a derivative.
    assert!((0..p.body.cells.len()).all(|e| pose(e).distance() > 0.01));
}

#[test]
fn residual_is_the_gradient_of_the_potential() {
    everywhere(|p, k, [u1, u0, v0]| {
        let w = world(p, &p.theta);
        let b = balance(&w.shared, &w.members[0], k);
        let d = random(u1.len(), 1e-3, 5);
        let at = |s: f64| b.potential(States { u1: &moved(u1, s, &d), u0, v0 });
        let difference = (at(STEP) - at(-STEP)) / (2.0 * STEP);
        let exact = dot(&b.residual(States { u1, u0, v0 }), &d);
        assert!((difference - exact).abs() < 1e-6 * exact.abs().max(1e-6), "{difference} {exact}");
    });
}

#[test]
fn tangent_and_derivatives_by_the_old_state() {
    everywhere(|p, k, [u1, u0, v0]| {
        let w = world(p, &p.theta);
        let b = balance(&w.shared, &w.members[0], k);
        let n = u1.len();
        let s = States { u1, u0, v0 };
        let (d, e, z) = (random(n, 1e-3, 5), random(n, 1e-1, 6), random(n, 1.0, 7));
        let difference = |f: &dyn Fn(f64) -> Vec<DVec3>| -> Vec<DVec3> {
            f(STEP).iter().zip(f(-STEP)).map(|(a, b)| (*a - b) / (2.0 * STEP)).collect()
        };
        let mut matrix = crate::linear::matrix::Matrix::default();
        b.tangent(s, false, &mut matrix);
        let mut product = zeros(n);
        Packed::new(&w.shared.pattern.blocks, &matrix, |v| v).multiply(&d, &mut product);
        let fd = difference(&|t| b.residual(States { u1: &moved(u1, t, &d), u0, v0 }));
        assert!(off(&product, &fd) < CLOSE, "tangent {:.1e}", off(&product, &fd));
        if k.is_none() {
            return;
        }
        let by_old = b.by_old(s, &d, &e);
        let fd = difference(&|t| b.residual(States { u1, u0: &moved(u0, t, &d), v0: &moved(v0, t, &e) }));
        assert!(off(&by_old, &fd) < CLOSE, "old state {:.1e}", off(&by_old, &fd));
        let (to_u, to_v) = b.by_old_transposed(s, &z);
        let (left, right) = (dot(&z, &by_old), dot(&to_u, &d) + dot(&to_v, &e));
        assert!((left - right).abs() < 1e-11 * left.abs(), "{left} {right}");
    });
}

#[test]
fn columns_of_every_parameter() {
    everywhere(|p, k, [u1, u0, v0]| {
        let w = world(p, &p.theta);
        let s = States { u1, u0, v0 };
        let b: Balance = balance(&w.shared, &w.members[0], k);
        for (i, key) in p.layout.keys.iter().enumerate() {
            let size = p.theta[i].abs().max(key.spec().typical.min(1.0));
            let residual = |t: f64| {
                let mut theta = p.theta.clone();
                theta[i] += t * size;
                let w = world(p, &theta);
                balance(&w.shared, &w.members[0], k).residual(s)
            };
            let d = 1e-5;
            let fd: Vec<DVec3> = residual(d).iter().zip(residual(-d)).map(|(a, b)| (*a - b) / (2.0 * d * size)).collect();
            let column = b.column(*key, s).unwrap_or_else(|| zeros(u1.len()));
            let scale = fd.iter().chain(&column).map(|v| v.length()).fold(0.0, f64::max);
            let forces = b.residual(s).iter().map(|v| v.length()).fold(0.0, f64::max);
            let difference = column.iter().zip(&fd).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
            // Relative to the column, or to what rounding of the forces leaves of a difference.
            assert!(difference < 1e-6 * scale + 1e-9 * forces / size, "{} {difference:.1e} of {scale:.1e}", key.spec().path);
        }
    });
}
