//! The simulator against what is known: patch test, differences of its energy, free fall, a cantilever.

use super::body::{Body, Motion};
use super::integrator::Integrator;
use super::loads::{Loads, Plane};
use super::material::Material;
use super::mesh::Mesh;
use glam::{DMat3, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Planes that cut a length into equal parts.
fn cut(length: f64, parts: u32) -> Vec<f64> {
    (0..=parts).map(|k| length * f64::from(k) / f64::from(parts)).collect()
}

fn block(bricks: [u32; 3]) -> Body {
    let [x, y, z] = [(0.1, bricks[0]), (0.03, bricks[1]), (0.04, bricks[2])].map(|(l, n)| cut(l, n));
    Body::new(Mesh::block([&x, &y, &z]), Material::new(2.0e4, 0.4), 1000.0)
}

fn random(n: usize, size: f64, seed: u64) -> Vec<DVec3> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..n).map(|_| DVec3::from([0; 3].map(|_| size * rng.random_range(-1.0..1.0)))).collect()
}

fn at_rest(body: &Body) -> Motion {
    let zero = vec![DVec3::ZERO; body.mesh.nodes.len()];
    let before_strain = body.strains(&zero);
    let (before, before_velocity) = (zero.clone(), zero.clone());
    Motion { rate: 0.0, step: 0.0, old: zero, before, before_velocity, before_strain, pressures: Vec::new() }
}

/// Under any affine deformation the stress is uniform: what the elements of an inner node feel cancels.
#[test]
fn affine_deformations_leave_inner_nodes_in_balance() {
    let mesh = Mesh::ball(DVec3::ZERO, 0.05, 2, 1);
    let inner: Vec<bool> = (0..mesh.nodes.len()).map(|n| !mesh.faces.iter().flatten().any(|f| *f == n)).collect();
    let straight = block([3, 2, 2]);
    let all = |n: usize| straight.mesh.faces.iter().flatten().all(|f| *f != n);
    let flat: Vec<bool> = (0..straight.mesh.nodes.len()).map(all).collect();
    let a = DMat3::from_cols(DVec3::new(1.2, 0.1, -0.2), DVec3::new(0.05, 0.8, 0.3), DVec3::new(-0.1, 0.2, 1.1));
    // Where sides are curved the four points no longer integrate the gradients of shape functions exactly.
    for (body, inner, within) in [(straight, flat, 1e-12), (Body::new(mesh, Material::new(2.0e4, 0.4), 1e3), inner, 0.02)] {
        let u: Vec<DVec3> = body.mesh.nodes.iter().map(|x| a * *x - *x).collect();
        let (_, g) = body.derivatives(&at_rest(&body), &u, |_, _, _| {});
        let most = |of: bool| g.iter().zip(&inner).filter(|(_, i)| **i == of).map(|(g, _)| g.length()).fold(0.0, f64::max);
        assert!(inner.iter().filter(|i| **i).count() > 20);
        assert!(most(true) < within * most(false), "{} of {}", most(true), most(false));
    }
}

/// Everything at once: elasticity, viscosity, inertia, weight, drag, contact, friction, magnet.
#[test]
fn derivatives_are_those_of_the_energy() {
    let mut body = block([2, 1, 1]);
    let n = body.mesh.nodes.len();
    (body.mass_damping, body.stiffness_damping) = (0.5, 0.01);
    body.stiffness.iter_mut().step_by(2).for_each(|s| *s = 0.4);
    body.attach(0.01, |c| c.iter().all(|c| c.x > 0.099));
    let plane = Plane { normal: DVec3::new(0.2, 0.1, 1.0).normalize(), height: 0.012, stiffness: 1e8, friction: 0.4 };
    body.loads = Loads {
        gravity: DVec3::new(0.0, 1.0, -9.81),
        force: DVec3::new(200.0, 0.0, 0.0),
        drag: 7.2,
        magnet: Some((DVec3::new(0.05, 0.1, 0.1), 1e4)),
        plane: Some(plane),
    };
    let m = Motion {
        rate: 600.0,
        step: 0.0025,
        old: random(n, 1e-3, 1),
        before: random(n, 1e-3, 2),
        before_velocity: random(n, 1.0, 3),
        before_strain: body.strains(&random(n, 1e-3, 4)),
        pressures: body.pressures(&random(n, 1e-3, 5)),
    };
    let (u, way) = (random(n, 2e-3, 6), random(n, 1.0, 7));
    let along = |t: f64| u.iter().zip(&way).map(|(u, w)| *u + t * *w).collect::<Vec<_>>();
    let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
    let mut curved = vec![DVec3::ZERO; n];
    let (_, g) = body.derivatives(&m, &u, |i, j, block| {
        curved[i] += block * way[j];
        if i != j {
            curved[j] += block.transpose() * way[i];
        }
    });
    // Central differences over a thousandth of the deformation.
    let t = 1e-6;
    let slope = (body.energy(&m, &along(t)) - body.energy(&m, &along(-t))) / (2.0 * t);
    assert!((slope / dot(&g, &way) - 1.0).abs() < 1e-6, "{slope} {}", dot(&g, &way));
    let [plus, minus] = [t, -t].map(|t| body.derivatives(&m, &along(t), |_, _, _| {}).1);
    let largest = curved.iter().map(|c| c.length()).fold(0.0, f64::max);
    for ((c, p), q) in curved.iter().zip(&plus).zip(&minus) {
        let difference = (*p - *q) / (2.0 * t);
        assert!(c.distance(difference) < 1e-5 * largest, "{c} {difference}");
    }
}

/// u₁ = g h², then 3u_n − 4u_{n−1} + u_{n−2} = 2h v_n with v_n = g n h: u_n = g h² (n²/2 + ¾ (1 − 3⁻ⁿ)).
#[test]
fn a_body_falls_as_the_formula_says() {
    let mut body = block([1, 1, 1]);
    let g = DVec3::new(0.0, 0.0, -9.81);
    (body.loads.gravity, body.stiffness_damping) = (g, 0.01);
    let h = 0.01;
    let mut motion = Integrator::new(body.clone(), vec![DVec3::ZERO; body.mesh.nodes.len()], h).unwrap();
    for n in 1..=10 {
        motion.advance().unwrap();
        let exact = g * (h * h * (0.5 * f64::from(n * n) + 0.75 * (1.0 - 3f64.powi(-n))));
        assert!(motion.state().u.iter().all(|u| u.distance(exact) < 1e-9), "step {n}");
    }
}

/// Deflection under a uniform load of a clamped beam: q L⁴/8EI, and q L²/2κGA by shear (Timoshenko, κ = 5/6). The clamp holds the sides
/// as well, which a beam's theory does not know: nothing at ν = 0, more the shorter the beam.
#[test]
fn a_cantilever_bends_as_a_beam() {
    for (nu, within) in [(0.0, 0.003), (0.3, 0.02)] {
        let (e, length, side) = (2.4e5, 0.36, 0.03);
        let across = cut(side, 2);
        let mut body = Body::new(Mesh::block([&cut(length, 18), &across, &across]), Material::new(e, nu), 1000.0);
        body.held = body.mesh.nodes.iter().map(|x| x.x < 1e-9).collect();
        // A thousandth of the weight, so that formula and simulator are both linear.
        body.loads.gravity = DVec3::new(0.0, 0.0, -0.00981);
        let mut motion = Integrator::new(body.clone(), vec![DVec3::ZERO; body.mesh.nodes.len()], 0.01).unwrap();
        motion.settle().unwrap();
        let q = 1000.0 * 0.00981 * side * side;
        let shear = e / (2.0 * (1.0 + nu)) * side * side * 5.0 / 6.0;
        let exact = q * length.powi(4) / (8.0 * e * side.powi(4) / 12.0) + q * length * length / (2.0 * shear);
        let middle = DVec3::new(length, 0.5 * side, 0.5 * side);
        let tip = body.mesh.nodes.iter().position(|x| x.distance(middle) < 1e-9).unwrap();
        let found = -motion.state().u[tip].z;
        assert!((found / exact - 1.0).abs() < within, "{found} instead of {exact}");
    }
}

/// A body that feels nothing but drag k v² slows down as v₀/(1 + k v₀ t).
#[test]
fn drag_brakes_as_the_drag_equation_says() {
    let mut body = block([1, 1, 1]);
    body.loads.drag = 7.2;
    let area = 2.0 * (0.1 * 0.03 + 0.1 * 0.04 + 0.03 * 0.04);
    let k = 7.2 * area / body.total_mass();
    let mut motion = Integrator::new(body.clone(), vec![DVec3::X * 5.0; body.mesh.nodes.len()], 0.0025).unwrap();
    (0..80).for_each(|_| motion.advance().unwrap());
    let mean = motion.state().v.iter().map(|v| v.x).sum::<f64>() / body.mesh.nodes.len() as f64;
    let exact = 5.0 / (1.0 + k * 5.0 * 0.2);
    assert!((mean / exact - 1.0).abs() < 1e-3, "{mean} instead of {exact}");
}
