//! Laws of fields and of cells: what they are by the formula of their files, and their derivatives by central differences.

use super::cell::{Cell, ENERGY, LOSS, Part};
use super::field::{Field, Spot};
use super::{ALL, Law, Site, Unstated, find};
use crate::mechanics::rotation::tests::Noise;
use glam::DVec3;

const CENTER: DVec3 = DVec3::new(0.1, -0.2, 0.3);
const ANCHOR: DVec3 = DVec3::new(0.0, 0.1, 0.5);
const CELL: f64 = 0.02;

fn spot(rest: DVec3, elapsed: f64) -> Spot {
    Spot { rest, center: CENTER, anchor: ANCHOR, size: 0.25, cell: CELL, elapsed }
}

fn law(kind: &str) -> &'static Law {
    &ALL[find(kind).expect("the law is in the table")]
}

/// A law of a factor on stiffness or density at a spot.
fn factor(kind: &str, spot: &Spot, p: &[f64]) -> f64 {
    let law = law(kind);
    assert_eq!(p.len(), law.params.len());
    match law.site {
        Site::Modulus(f) | Site::Density(f) | Site::Aging(f) | Site::Edges(f) => f.at(spot, p)[0],
        _ => panic!("{kind} is no factor"),
    }
}

fn cell(kind: &str) -> &'static dyn Cell {
    match law(kind).site {
        Site::Cells(c) => c,
        _ => panic!("{kind} is no law of cells"),
    }
}

/// Random numbers of a law, places near the body's centre.
fn numbers(law: &Law, noise: &mut Noise) -> Vec<f64> {
    let one = |p: &super::EffectParam, noise: &mut Noise| match p.default {
        Unstated::OnBody | Unstated::Center | Unstated::Reference => {
            CENTER[usize::from(p.axis.unwrap_or(0))] + noise.uniform(-0.02, 0.02)
        }
        _ => p.typical * noise.uniform(0.5, 1.5),
    };
    law.params.iter().map(|p| one(p, noise)).collect()
}

fn slopes_match<const M: usize>(law: &Law, field: &dyn Field<M>, noise: &mut Noise) {
    for _ in 0..20 {
        let (spot, p) = (spot(CENTER + noise.vector(0.05), noise.uniform(0.0, 2.0)), numbers(law, noise));
        for i in 0..p.len() {
            // A thousandth of a size that matters: the difference's error is a millionth of the third derivative.
            let step = 1e-4 * law.params[i].typical.min(CELL);
            let at = |s: f64| {
                let mut p = p.clone();
                p[i] += s * step;
                field.at(&spot, &p)
            };
            let (more, less, slope) = (at(1.0), at(-1.0), field.slope(&spot, &p, i));
            for k in 0..M {
                let difference = (more[k] - less[k]) / (2.0 * step);
                let close = 1e-6 * slope[k].abs() + 1e-8 / law.params[i].typical;
                assert!((difference - slope[k]).abs() < close, "{} {}: {difference} {}", law.kind, law.params[i].key, slope[k]);
            }
        }
    }
}

#[test]
fn slopes_of_fields_match_central_differences() {
    let mut noise = Noise(11);
    for law in ALL {
        match law.site {
            Site::Modulus(f) | Site::Density(f) | Site::Aging(f) | Site::Edges(f) => slopes_match(law, f, &mut noise),
            Site::Rest(f) => slopes_match(law, f, &mut noise),
            Site::Clamps(f) => slopes_match(law, f, &mut noise),
            _ => {}
        }
    }
}

fn same(found: f64, exact: f64) {
    assert!((found - exact).abs() <= 1e-13 * exact.abs().max(1.0), "{found} is not {exact}");
}

#[test]
fn stiffness_and_density_are_what_their_formulas_say() {
    let here = |from: DVec3| spot(CENTER + from, 0.0);
    let d = DVec3::new(0.02, -0.03, 0.05);
    for kind in ["stiffness-gradient", "density-gradient"] {
        same(factor(kind, &here(d), &[2.0, 3.0, -4.0]), (0.04f64 - 0.09 - 0.2).exp());
    }
    // A spot: its whole ratio in the middle, 1/e of its logarithm at the radius, and a flat top.
    for kind in ["inclusion", "density-inclusion"] {
        let middle = CENTER + d;
        let p = [0.7, middle.x, middle.y, middle.z, 0.03];
        same(factor(kind, &here(d), &p), 0.7f64.exp());
        for axis in DVec3::AXES {
            same(factor(kind, &here(d + 0.03 * axis), &p), (0.7 * (-1f64).exp()).exp());
            same(factor(kind, &here(d + 0.015 * axis), &p), (0.7 * (-1f64 / 16.0).exp()).exp());
        }
    }
    // Two parts: half of the logarithm in the plane, all of it behind, blended by tanh over half a cell; a direction of any length.
    let n = DVec3::new(1.0, 2.0, 2.0) / 3.0;
    let p = [0.5, 0.01, 2.0 * n.x, 2.0 * n.y, 2.0 * n.z];
    for (ahead, part) in [(0.0, 0.5), (0.5 * CELL, 0.5 + 0.5 * 1f64.tanh()), (10.0 * CELL, 1.0), (-10.0 * CELL, 0.0)] {
        same(factor("two-part-stiffness", &here(n * (0.01 + ahead)), &p), (0.5 * part).exp());
    }
    // Modes in units of half the body: squares, and products of the two other axes.
    let x = d / 0.25;
    let log = 0.1 * x.x * x.x + 0.2 * x.y * x.y + 0.3 * x.z * x.z + 0.4 * x.y * x.z + 0.5 * x.z * x.x + 0.6 * x.x * x.y;
    same(factor("stiffness-modes", &here(d), &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]), log.exp());
    // Creep: nothing at the start, 63 % of the fraction after its time, all of it in the end.
    for (elapsed, lost) in [(0.0, 0.0), (0.5, 1.0 - (-1f64).exp()), (1.0, 1.0 - (-2f64).exp()), (50.0, 1.0)] {
        same(factor("creep", &spot(CENTER, elapsed), &[0.2, 0.5]), 1.0 - 0.2 * lost);
    }
    same(factor("clamp-edge", &here(d), &[0.003]), 0.003);
}

#[test]
fn clamps_slip_in_time_and_give_way_by_a_layer() {
    let hold = |kind: &str, p: &[f64]| match law(kind).site {
        Site::Clamps(f) => f.at(&spot(CENTER, 2.0), p),
        _ => panic!("{kind} is no law of clamps"),
    };
    let slip: Vec<f64> = (1..=12).map(f64::from).collect();
    assert_eq!(hold("clamp-slip", &slip), [1.0, 0.0, 15.0, 18.0, 21.0, 24.0, 27.0, 30.0]);
    assert_eq!(hold("compliant-clamp", &[0.004]), [1.0, 0.004, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
}

/// A bend moves the body along its second axis by ½ κ x², and turns sections with it: nothing is sheared.
#[test]
fn rest_shapes_are_stretched_and_bent_without_shear() {
    let law = law("rest-shape");
    let Site::Rest(field) = law.site else { panic!("it has a shape") };
    let x = DVec3::new(0.2, -0.3, 0.4);
    let shape = |p: &[f64], x: DVec3| DVec3::from_array(field.at(&spot(ANCHOR + x, 0.0), p));
    let only = |slot: usize| (0..9).map(|k| f64::from(u8::from(k == slot)) * 0.5).collect::<Vec<_>>();
    for a in 0..3 {
        assert_eq!(shape(&only(a), x), DVec3::AXES[a] * (0.5 * x[a]));
    }
    for (slot, (key, a, d)) in
        [("x_to_y", 0, 1), ("x_to_z", 0, 2), ("y_to_z", 1, 2), ("y_to_x", 1, 0), ("z_to_x", 2, 0), ("z_to_y", 2, 1)]
            .into_iter()
            .enumerate()
    {
        let p = only(3 + slot);
        assert_eq!(law.params[3 + slot].key, format!("bend_{key}"));
        let exact = DVec3::AXES[d] * (0.25 * x[a] * x[a]) - DVec3::AXES[a] * (0.5 * x[a] * x[d]);
        assert!((shape(&p, x) - exact).length() < 1e-15, "{key}");
        let slope = |of: usize, by: usize| {
            let e = DVec3::AXES[by] * 1e-3;
            (shape(&p, x + e) - shape(&p, x - e))[of] / 2e-3
        };
        // Quadratic: differences are exact.
        assert!((slope(a, d) + slope(d, a)).abs() < 1e-12, "{key}");
    }
}

#[test]
fn laws_of_cells_have_the_stresses_of_a_bar() {
    let rate = 50.0;
    // Stress over E of a bar at strain ε: both densities are ½ ε², so that ∂/∂ε is ε times the derivative by the density.
    let stress = |kind: &str, part: Part, z: &[f64], strain: f64| cell(kind).slopes(part, z, 0, 0)[0] * strain;
    let strain: f64 = 0.2;
    let mut z = vec![0.0; ENERGY];
    z[0] = 0.5 * strain * strain;
    z.push(10.0);
    same(stress("strain-stiffening", Part::Energy, &z, strain), 10.0 * strain.powi(3));
    let loss = Part::Loss { rate };
    // A power of the rate where it is fast (the rate that makes it linear is 1e-2, squared over it), and linear where it is slow.
    for (speed, exact, close) in [(3.0, 0.01 * 3f64.sqrt(), 1e-5), (1e-6, 0.01 * 1e-6 / 1e-2f64.sqrt(), 1e-8)] {
        let increment = speed / rate;
        let found = stress("power-law-viscosity", loss, &[0.5 * increment * increment, 0.0, 0.01, 0.5], increment);
        assert!((found / exact - 1.0).abs() < close, "{found} {exact}");
    }
    // The loss times the elastic stress, whatever the speed; half of it is 1/√2 where the speed is that below which the law is viscous.
    for (speed, part) in [(3.0, 1.0), (30.0, 1.0), (1e-2, 0.5f64.sqrt())] {
        let increment = speed / rate;
        let found = stress("structural-damping", loss, &[0.5 * increment * increment, 0.5 * strain * strain, 0.1], increment);
        assert!((found / (0.1 * strain * part) - 1.0).abs() < 1e-5, "{found}");
    }
    // Without a strain before, an amplitude of 1e-4 is taken.
    let found = stress("structural-damping", loss, &[0.5 * 0.06 * 0.06, 0.0, 0.1], 0.06);
    assert!((found / 1e-5 - 1.0).abs() < 1e-5, "{found}");
    // Fibres: ½ k ε² with ε = f·Ef/|f|², for a general E.
    let (e, f) = ([0.1, -0.2, 0.3, 0.05, -0.02, 0.07], DVec3::new(0.5, -1.5, 2.0));
    let along =
        e[0] * f.x * f.x + e[1] * f.y * f.y + e[2] * f.z * f.z + 2.0 * (e[3] * f.y * f.z + e[4] * f.z * f.x + e[5] * f.x * f.y);
    let z: Vec<f64> = std::iter::once(0.0).chain(e).chain([3.0]).chain(f.to_array()).collect();
    same(cell("transverse-anisotropy").value(Part::Energy, &z), 1.5 * (along / f.length_squared()).powi(2));
}

#[test]
fn laws_of_cells_derive_and_depend_on_what_they_say() {
    let mut noise = Noise(12);
    for law in ALL {
        let Site::Cells(cell) = law.site else { continue };
        for part in [Part::Energy, Part::Loss { rate: 50.0 }] {
            let scalars = part.scalars();
            assert_eq!(scalars, if part == Part::Energy { ENERGY } else { LOSS });
            let mut z: Vec<f64> = (0..scalars).map(|_| noise.uniform(0.01, 0.1)).collect();
            z.extend(numbers(law, &mut noise));
            let moved = |i: usize, by: f64| {
                let mut z = z.clone();
                z[i] += by;
                z
            };
            for i in 0..z.len() {
                let step = 1e-5 * z[i];
                for j in 0..z.len() {
                    let [first, second, mixed] = cell.slopes(part, &z, i, j);
                    let value = |by: f64| cell.value(part, &moved(i, by));
                    let difference = (value(step) - value(-step)) / (2.0 * step);
                    assert!((difference - first).abs() <= 1e-8 * (first.abs() + value(0.0).abs() / z[i]), "{} {i}", law.kind);
                    assert_eq!(second, cell.slopes(part, &z, j, i)[0], "{} {i} {j}", law.kind);
                    let slope = |by: f64| cell.slopes(part, &moved(i, by), j, j)[0];
                    let difference = (slope(step) - slope(-step)) / (2.0 * step);
                    assert!((difference - mixed).abs() <= 1e-8 * (mixed.abs() + slope(0.0).abs() / z[i]), "{} {i} {j}", law.kind);
                }
                // What it does not need it does not see.
                if (cell.needs(part)..scalars).contains(&i) {
                    assert_eq!(cell.slopes(part, &z, i, i), [0.0; 3], "{} {i}", law.kind);
                }
            }
        }
    }
    let needs = |kind: &str| [Part::Energy, Part::Loss { rate: 1.0 }].map(|part| cell(kind).needs(part));
    assert_eq!(needs("transverse-anisotropy"), [ENERGY, 0]);
    assert_eq!(needs("strain-stiffening"), [1, 0]);
    assert_eq!(needs("structural-damping"), [1, LOSS]);
    assert_eq!(needs("power-law-viscosity"), [1, LOSS]);
}
