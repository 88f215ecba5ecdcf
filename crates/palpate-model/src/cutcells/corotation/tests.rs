//! Derivatives against differences, invariance and balance, at random rotations, stretches and hourglass modes.

use super::*;
use crate::mechanics::rotation::tests::Noise;

const H: f64 = 0.13;

/// A random positive semi-definite matrix whose null space is the six infinitesimal rigid motions.
fn stiffness(noise: &mut Noise) -> M24 {
    let mut rigid: Vec<V24> = Vec::new();
    for m in 0..6 {
        let e = DVec3::from_array(std::array::from_fn(|a| if a == m % 3 { 1.0 } else { 0.0 }));
        let corner = |i: usize| if m < 3 { e } else { e.cross(DVec3::from_array(SIGNS[i])) };
        let mut v = flatten(&std::array::from_fn(corner));
        for r in &rigid {
            let p = dot(r, &v);
            v.iter_mut().zip(r).for_each(|(v, r)| *v -= p * r);
        }
        let norm = dot(&v, &v).sqrt();
        rigid.push(v.map(|x| x / norm));
    }
    let mut k = [0.0; 576];
    for _ in 0..24 {
        let mut a: V24 = std::array::from_fn(|_| noise.uniform(-1.0, 1.0));
        for r in &rigid {
            let p = dot(r, &a);
            a.iter_mut().zip(r).for_each(|(a, r)| *a -= p * r);
        }
        for i in 0..576 {
            k[i] += a[i / 24] * a[i % 24];
        }
    }
    k
}

/// Corners of a turned, stretched (0.6 to 1.6), sheared and hourglassed cell.
fn shape(noise: &mut Noise) -> [DVec3; 8] {
    let v = noise.rotation();
    let s = DMat3::from_diagonal(DVec3::from_array([0; 3].map(|_| noise.uniform(0.6, 1.6))));
    let f = noise.rotation() * (v.transpose() * s * v);
    let at = noise.vector(3.0);
    let glass = [noise.vector(0.15), noise.vector(0.15), noise.vector(0.15), noise.vector(0.15)];
    std::array::from_fn(|i| {
        let [x, y, z] = SIGNS[i];
        let modes = glass[0] * (x * y) + glass[1] * (y * z) + glass[2] * (z * x) + glass[3] * (x * y * z);
        at + (f * DVec3::from_array(SIGNS[i]) + modes) * (0.5 * H)
    })
}

fn direction(noise: &mut Noise) -> [DVec3; 8] {
    std::array::from_fn(|_| noise.vector(H))
}

fn moved(x: &[DVec3; 8], d: &[DVec3; 8], t: f64) -> [DVec3; 8] {
    std::array::from_fn(|i| x[i] + d[i] * t)
}

fn scaled(v: &V24, s: f64) -> V24 {
    v.map(|x| s * x)
}

fn inner(a: &[DVec3; 8], b: &[DVec3; 8]) -> f64 {
    dot(&flatten(a), &flatten(b))
}

fn size(a: &[DVec3; 8]) -> f64 {
    inner(a, a).sqrt()
}

fn random(noise: &mut Noise) -> V24 {
    std::array::from_fn(|_| noise.uniform(-1.0, 1.0))
}

/// Step of central differences relative to h: truncation 1e-10, rounding 1e-16 · |x|/h / 1e-5 ≈ 3e-10.
const STEP: f64 = 1e-5;

#[test]
fn strain_rate_is_the_derivative_of_q_and_force_its_transpose() {
    let mut noise = Noise(11);
    for _ in 0..200 {
        let (x, d, y) = (shape(&mut noise), direction(&mut noise), random(&mut noise));
        let pose = CellPose::new(&x, H);
        let rate = pose.strain_rate(&d);
        let (a, b) = (CellPose::new(&moved(&x, &d, STEP), H).q, CellPose::new(&moved(&x, &d, -STEP), H).q);
        for i in 0..24 {
            assert!(((a[i] - b[i]) / (2.0 * STEP) - rate[i]).abs() < 1e-7 * H);
        }
        assert!((dot(&rate, &y) - inner(&pose.force(&y), &d)).abs() < 1e-13 * size(&d));
    }
}

#[test]
fn force_is_the_energy_gradient_and_hessian_its_derivative() {
    let mut noise = Noise(12);
    for _ in 0..200 {
        let (k, x, d) = (stiffness(&mut noise), shape(&mut noise), direction(&mut noise));
        let scale = noise.uniform(0.5, 2.0);
        let at = |t: f64| {
            let pose = CellPose::new(&moved(&x, &d, t), H);
            let y = scaled(&multiply(&k, &pose.q), scale);
            (pose, y, pose.force(&y))
        };
        let (pose, y, f) = at(0.0);
        let (up, down) = (at(STEP), at(-STEP));
        let energy = (up.0.energy(&k, scale) - down.0.energy(&k, scale)) / (2.0 * STEP);
        assert!((energy - inner(&f, &d)).abs() < 1e-7 * size(&f) * size(&d));
        let product = pose.hessian_product(&k, scale, &y, &d);
        let change: [DVec3; 8] = std::array::from_fn(|i| (up.2[i] - down.2[i]) / (2.0 * STEP));
        assert!(size(&std::array::from_fn(|i| change[i] - product[i])) < 1e-6 * size(&product));
    }
}

#[test]
fn second_is_the_derivative_of_force_at_fixed_y() {
    let mut noise = Noise(13);
    for _ in 0..200 {
        let (x, d, y) = (shape(&mut noise), direction(&mut noise), random(&mut noise));
        let exact = CellPose::new(&x, H).second(&y, &d);
        let up = CellPose::new(&moved(&x, &d, STEP), H).force(&y);
        let down = CellPose::new(&moved(&x, &d, -STEP), H).force(&y);
        assert!(size(&std::array::from_fn(|i| (up[i] - down[i]) / (2.0 * STEP) - exact[i])) < 1e-6);
    }
}

#[test]
fn hessian_is_symmetric_and_agrees_with_its_product() {
    let mut noise = Noise(14);
    let (mut full, mut part) = ([0.0; 576], [0.0; 576]);
    for _ in 0..100 {
        let (k, x, d, y) = (stiffness(&mut noise), shape(&mut noise), direction(&mut noise), random(&mut noise));
        let scale = noise.uniform(0.5, 2.0);
        let pose = CellPose::new(&x, H);
        pose.hessian(&k, scale, &y, &mut full);
        pose.gauss_newton(&k, scale, &mut part);
        for i in 0..576 {
            assert_eq!(full[i], full[i % 24 * 24 + i / 24]);
            assert_eq!(part[i], part[i % 24 * 24 + i / 24]);
        }
        let exact = pose.hessian_product(&k, scale, &y, &d);
        let product = corners(&multiply(&full, &flatten(&d)));
        assert!(size(&std::array::from_fn(|i| exact[i] - product[i])) < 1e-12 * size(&exact));
        let second = pose.second(&y, &d);
        let product = corners(&multiply(&part, &flatten(&d)));
        assert!(size(&std::array::from_fn(|i| exact[i] - second[i] - product[i])) < 1e-12 * size(&exact));
        assert!(inner(&product, &d) >= -1e-13 * size(&product) * size(&d), "Gauss-Newton part is semi-definite");
    }
}

#[test]
fn force_has_neither_resultant_nor_moment() {
    let mut noise = Noise(15);
    for _ in 0..200 {
        let (k, x) = (stiffness(&mut noise), shape(&mut noise));
        let pose = CellPose::new(&x, H);
        let f = pose.force(&multiply(&k, &pose.q));
        assert!(f.iter().sum::<DVec3>().length() < 1e-12 * size(&f));
        let moment: DVec3 = (0..8).map(|i| (x[i] - x[0]).cross(f[i])).sum();
        assert!(moment.length() < 1e-12 * size(&f) * H);
    }
}

#[test]
fn energy_is_invariant_under_rigid_motion_and_zero_only_undeformed() {
    let mut noise = Noise(16);
    for _ in 0..200 {
        let (k, x, r, t) = (stiffness(&mut noise), shape(&mut noise), noise.rotation(), noise.vector(1.0));
        let energy = CellPose::new(&x, H).energy(&k, 1.0);
        let turned = CellPose::new(&x.map(|p| r * p + t), H).energy(&k, 1.0);
        // Positions are up to 40 h from the origin: rounding 1e-16 · 40 in q.
        assert!((turned / energy - 1.0).abs() < 1e-12);
        let rigid: [DVec3; 8] = std::array::from_fn(|i| r * DVec3::from_array(SIGNS[i]) * (0.5 * H));
        assert!(CellPose::new(&rigid, H).energy(&k, 1.0) < 1e-26 * k[0] * H * H);
    }
}
