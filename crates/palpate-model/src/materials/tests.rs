//! Every material by itself: derivatives, objectivity, small strains, what happens as volume vanishes.

use super::*;
use crate::mechanics::lame::lame;
use glam::{DMat3, DQuat, DVec3};

const NU: f64 = 0.4;

/// Numbers in [-1, 1], reproducible.
fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut s = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        s ^= s << 13;
        s ^= s >> 7;
        s ^= s << 17;
        2.0 * (s >> 11) as f64 / (1u64 << 53) as f64 - 1.0
    }
}

fn gradients(size: f64) -> Vec<Gradient<f64>> {
    (1..6)
        .map(|seed| {
            let mut next = random(seed);
            std::array::from_fn(|_| std::array::from_fn(|_| size * next()))
        })
        .collect()
}

fn moved(h: &Gradient<f64>, k: usize, by: f64) -> Gradient<f64> {
    let mut h = *h;
    h[k / 3][k % 3] += by;
    h
}

#[test]
fn stress_and_tangent_are_derivatives_of_the_energy() {
    let (lambda, mu) = lame(1.0, NU);
    for m in ALL {
        for h in gradients(0.3) {
            let (stress, tangent) = m.law.stress(&h, lambda, mu);
            let d = 1e-5;
            for k in 0..9 {
                let at = |by: f64| m.law.value(&moved(&h, k, by), lambda, mu);
                assert!(((at(d) - at(-d)) / (2.0 * d) - stress[k]).abs() < 1e-8, "{} P {k}", m.name);
                let at = |by: f64| m.law.stress(&moved(&h, k, by), lambda, mu).0;
                for (i, (a, b)) in at(d).iter().zip(at(-d)).enumerate() {
                    assert!(((a - b) / (2.0 * d) - tangent[i][k]).abs() < 1e-8, "{} dP {i} {k}", m.name);
                }
            }
            let first = m.law.first(&h, lambda, mu);
            assert!(first.iter().zip(stress).all(|(a, b)| (a - b).abs() < 1e-15), "{}: P alone", m.name);
            let by = m.law.by_moduli(&h, lambda, mu);
            for k in 0..9 {
                // P is linear in both moduli, but for the stable material's logarithm, which is too.
                let total = lambda * by[0][k] + mu * by[1][k];
                assert!((total - stress[k]).abs() < 1e-12 * stress[k].abs().max(1.0), "{}", m.name);
            }
        }
    }
}

#[test]
fn formulas_give_what_dual_numbers_give() {
    fn check<L: Hyperelastic>(law: &L) {
        let (lambda, mu) = lame(1.0, NU);
        // Stretched along one axis alone: an iteration for the rotation that looks at the others thinks that it is done.
        let along = (0..3).map(|k| moved(&[[0.0; 3]; 3], 4 * k, 0.6));
        for h in gradients(0.3).into_iter().chain(along) {
            let (p, t) = law.stress_by_formula(&h, lambda, mu).expect("the material has a formula");
            let (p2, t2) = by_dual_numbers(law, &h, lambda, mu);
            assert!(p.iter().zip(p2).all(|(a, b)| (a - b).abs() < 1e-12));
            assert!(t.iter().flatten().zip(t2.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-11));
        }
    }
    check(&corotated_linear::CorotatedLinear);
    check(&neo_hookean::NeoHookean);
    check(&neo_hookean_log::NeoHookeanLog);
    check(&stable_neo_hookean::StableNeoHookean);
}

#[test]
fn names_find_materials_and_tell_them_apart() {
    for (i, a) in ALL.iter().enumerate() {
        assert_eq!(find(a.name), Some(a));
        assert!(ALL.iter().enumerate().all(|(j, b)| (a == b) == (i == j)) && format!("{a:?}") == a.name);
        assert_eq!((a.has_twin(), a.has_curves), (a.name != "principal-stretch", a.name == "principal-stretch"));
    }
    assert_eq!(find("neo-hooke"), None);
}

#[test]
fn only_a_material_of_curves_has_factors() {
    for m in ALL {
        assert!(m.law.by_curves(&gradients(0.3)[0], 1.0, 1.0).is_empty(), "{}: none are stated", m.name);
    }
}

#[test]
fn rotations_cost_nothing_and_change_nothing() {
    let (lambda, mu) = lame(1.0, NU);
    let turn = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), 1.1));
    let rows = |m: DMat3| -> Gradient<f64> {
        std::array::from_fn(|i| std::array::from_fn(|j| m.col(j)[i] - f64::from(u8::from(i == j))))
    };
    let matrix = |h: &Gradient<f64>| {
        DMat3::from_cols_array_2d(&std::array::from_fn(|j| std::array::from_fn(|i| h[i][j]))) + DMat3::IDENTITY
    };
    for m in ALL {
        assert!(m.law.value(&rows(turn), lambda, mu).abs() < 1e-14, "{}", m.name);
        for h in gradients(0.3) {
            let (a, b) = (m.law.value(&h, lambda, mu), m.law.value(&rows(turn * matrix(&h)), lambda, mu));
            assert!((a - b).abs() < 1e-12, "{}: {a} {b}", m.name);
        }
    }
}

#[test]
fn small_strains_are_linear_elasticity_to_every_digit() {
    let (lambda, mu) = lame(1.0, NU);
    for m in ALL {
        for size in [1e-3, 1e-5, 1e-7] {
            for h in gradients(size) {
                let symmetric: Gradient<f64> = std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (h[i][j] + h[j][i])));
                let stress = m.law.stress(&symmetric, lambda, mu).0;
                let trace = symmetric[0][0] + symmetric[1][1] + symmetric[2][2];
                for k in 0..9 {
                    let volumetric = if k % 4 == 0 { lambda * trace } else { 0.0 };
                    let exact = 2.0 * mu * symmetric[k / 3][k % 3] + volumetric;
                    assert!((stress[k] - exact).abs() < 30.0 * size * size + 1e-15, "{} at {size}", m.name);
                }
            }
        }
    }
}

#[test]
fn materials_with_a_barrier_do_not_exist_inside_out_and_the_stable_one_does() {
    let (lambda, mu) = lame(1.0, NU);
    let squeezed = |by: f64| -> Gradient<f64> { [[by, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]] };
    for m in ALL.iter().filter(|m| m.name.starts_with("neo-hookean")) {
        assert!(m.law.value(&squeezed(-0.999), lambda, mu) > m.law.value(&squeezed(-0.9), lambda, mu));
        assert!(m.law.value(&squeezed(-1.5), lambda, mu).is_nan() && m.law.stress(&squeezed(-1.5), lambda, mu).0[0].is_nan());
    }
    let stable = find("stable-neo-hookean").unwrap().law;
    let (stress, _) = stable.stress(&squeezed(-1.5), lambda, mu);
    assert!(stress[0] < 0.0, "what is inside out is pushed back: {}", stress[0]);
}

/// A material of a formula for its energy alone, which is not linear in its moduli.
struct Plain;

impl Hyperelastic for Plain {
    fn energy<D: Number>(&self, h: &Gradient<D>, lambda: D, mu: D) -> D {
        squares(h) * mu * lambda * lambda
    }
}

/// A law of no energy, of which the stress is all that is stated.
struct Stated;

impl Solid for Stated {
    fn value(&self, _: &Gradient<f64>, _: f64, _: f64) -> f64 {
        0.0
    }

    fn stress(&self, h: &Gradient<f64>, _: f64, mu: f64) -> Stress {
        (std::array::from_fn(|k| mu * h[k / 3][k % 3]), [[0.0; 9]; 9])
    }

    fn by_moduli(&self, _: &Gradient<f64>, _: f64, _: f64) -> [[f64; 9]; 2] {
        [[0.0; 9]; 2]
    }
}

#[test]
fn what_a_law_leaves_out_follows_from_what_it_states() {
    let (h, lambda, mu) = (gradients(0.3)[0], 3.0, 2.0);
    let (stress, tangent) = Plain.stress(&h, lambda, mu);
    let by = Plain.by_moduli(&h, lambda, mu);
    for k in 0..9 {
        let entry = h[k / 3][k % 3];
        // 2 μ λ² H, and its derivatives by λ and μ.
        assert!((stress[k] - 36.0 * entry).abs() < 1e-13 && (Plain.first(&h, lambda, mu)[k] - stress[k]).abs() < 1e-13);
        assert!((by[0][k] - 24.0 * entry).abs() < 1e-13 && (by[1][k] - 18.0 * entry).abs() < 1e-13);
        assert!((0..9).all(|l| (tangent[k][l] - if k == l { 36.0 } else { 0.0 }).abs() < 1e-13));
    }
    assert_eq!(Stated.first(&h, lambda, mu), Stated.stress(&h, lambda, mu).0);
    assert!(Stated.by_curves(&h, lambda, mu).is_empty());
}
