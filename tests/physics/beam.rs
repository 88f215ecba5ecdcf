//! Cantilever beams against Timoshenko's theory (Timoshenko 1921; shear coefficient of Cowper 1966).

use glam::{DVec3, DVec4};
use palpate_model::plan::Plan;
use palpate_model::scene::*;
use std::f64::consts::TAU;
use support::{modes, run, scenes};

/// Ten times the thickness: a fully held end also stops Poisson's contraction, which beam theory does not know; what that adds
/// to the stiffness falls with t / L (at L / t = 5 and ν = 0.49 it is 6 % of the deflection).
const LENGTH: f64 = 0.2;
const THICK: f64 = 0.02;
const YOUNG: f64 = 2.0e5;
const DENSITY: f64 = 1000.0;

/// A beam along x, clamped at x = 0, with `cells` cells through its square section.
fn beam(cells: usize, nu: f64) -> Scene {
    let h = THICK / cells as f64;
    let mut s = scenes::body(Analytic::Box { min: DVec3::ZERO, max: DVec3::new(LENGTH, THICK, THICK) }, h);
    s.material.youngs_modulus = YOUNG;
    s.material.poisson_ratio = nu;
    s.material.inertia = Inertia::Density(DENSITY);
    s.clamps = vec![Clamp::still(DVec3::new(-0.01, -1.0, -1.0), DVec3::new(1e-3 * h, 1.0, 1.0))];
    s
}

fn section() -> (f64, f64) {
    (THICK * THICK, THICK.powi(4) / 12.0)
}

/// Shear stiffness κGA.
fn shear(nu: f64) -> f64 {
    10.0 * (1.0 + nu) / (12.0 + 11.0 * nu) * YOUNG / (2.0 * (1.0 + nu)) * section().0
}

/// Tip deflection under own weight over Timoshenko's.
fn deflection(cells: usize, nu: f64) -> f64 {
    sag(beam(cells, nu), LENGTH, nu)
}

/// Tip deflection of a beam held `length` before its end, over Timoshenko's.
fn sag(mut s: Scene, length: f64, nu: f64) -> f64 {
    // A hundredth of gravity: small deflections, as the theory wants.
    let g = 0.0981;
    s.gravity = DVec3::new(0.0, 0.0, -g);
    s.initial.state = InitialShape::StaticEquilibrium;
    s.time.steps = 0;
    let plan = scenes::plan(&s);
    let tip = run::nearest(&plan, DVec3::new(LENGTH, THICK / 2.0, THICK / 2.0));
    let sag = -run::states(&plan)[0].displacement[tip].z;
    let (area, inertia) = section();
    let q = DENSITY * area * g;
    sag / (q * length.powi(4) / (8.0 * YOUNG * inertia) + q * length.powi(2) / (2.0 * shear(nu)))
}

/// First bending frequency over Timoshenko's: stiffness and masses alone, so that no time step takes part.
fn frequency(cells: usize, nu: f64) -> f64 {
    modes::first(&scenes::plan(&beam(cells, nu)), DVec3::Z).omega / timoshenko(nu)
}

/// By how much lumped masses lower the first frequency of a clamped-free beam, to leading order: half of what the trapezoidal rule
/// adds to ∫w² along the beam, h²/6 w(L)w'(L) with w(L)w'(L) = 5.51 ∫w²/L², and to its section's second moment, 2/n² of I with
/// n = t/h cells and ∫w'² = 4.65 ∫w²/L², for the first mode w.
fn lumped(cells: usize) -> f64 {
    let h = THICK / cells as f64;
    0.5 * (5.51 / 6.0 + 4.65 / 6.0) * (h / LENGTH).powi(2)
}

/// Root of a function between two places where its signs differ.
fn root(f: impl Fn(f64) -> f64, mut lo: f64, mut hi: f64) -> f64 {
    assert!(f(lo) * f(hi) < 0.0, "the root is bracketed");
    for _ in 0..80 {
        let mid = 0.5 * (lo + hi);
        if f(lo) * f(mid) <= 0.0 { hi = mid } else { lo = mid }
    }
    0.5 * (lo + hi)
}

/// First circular frequency of a clamped-free Bernoulli beam.
fn bernoulli() -> f64 {
    let (area, inertia) = section();
    3.516 / (LENGTH * LENGTH) * (YOUNG * inertia / (DENSITY * area)).sqrt()
}

/// First circular frequency of a clamped-free Timoshenko beam: root of its characteristic determinant near Bernoulli's.
fn timoshenko(nu: f64) -> f64 {
    let (area, inertia) = section();
    let (ei, kga, l) = (YOUNG * inertia, shear(nu), LENGTH);
    // Exact characteristic equation (Huang 1961): b² = ρAω²L⁴/EI, r² = I/AL², s² = EI/κGAL².
    let (r2, s2) = (inertia / (area * l * l), ei / (kga * l * l));
    let f = |omega: f64| {
        let b2 = DENSITY * area * omega * omega * l.powi(4) / ei;
        let b = b2.sqrt();
        let root = ((r2 - s2).powi(2) + 4.0 / b2).sqrt();
        let alpha = ((-(r2 + s2) + root) / 2.0).sqrt();
        let beta = (((r2 + s2) + root) / 2.0).sqrt();
        2.0 + (b2 * (r2 - s2).powi(2) + 2.0) * (b * alpha).cosh() * (b * beta).cos()
            - b * (r2 + s2) / (1.0 - b2 * r2 * s2).sqrt() * (b * alpha).sinh() * (b * beta).sin()
    };
    root(f, 0.7 * bernoulli(), 1.05 * bernoulli())
}

/// The same with a point mass [kg] at the tip. Timoshenko's equations for deflection w, turn ψ, moment M and shear force Q,
/// w' = ψ + Q/κGA, ψ' = M/EI, M' = −Q − ρIω²ψ, Q' = −ρAω²w, go from w = ψ = 0 to M = 0 and Q = m ω² w: a determinant of the two
/// free starts. Runge–Kutta's fourth order in 400 steps leaves 1e-10.
fn loaded(nu: f64, mass: f64) -> f64 {
    let (area, inertia) = section();
    let (ei, kga) = (YOUNG * inertia, shear(nu));
    let end = |omega: f64, start: DVec4| {
        let slope = |y: DVec4| {
            let inert = DENSITY * omega * omega;
            DVec4::new(y.y + y.w / kga, y.z / ei, -y.w - inert * inertia * y.y, -inert * area * y.x)
        };
        let h = LENGTH / 400.0;
        let y = (0..400).fold(start, |y, _| {
            let a = slope(y);
            let b = slope(y + 0.5 * h * a);
            let c = slope(y + 0.5 * h * b);
            y + h / 6.0 * (a + 2.0 * b + 2.0 * c + slope(y + h * c))
        });
        (y.z, y.w - mass * omega * omega * y.x)
    };
    let determinant = |omega: f64| {
        let ((a, b), (c, d)) = (end(omega, DVec4::Z), end(omega, DVec4::W));
        a * d - b * c
    };
    // Whatever the mass, below the beam's own frequency, and above that of the mass on a beam half as stiff that weighs nothing.
    let low = (0.5 * 3.0 * ei / LENGTH.powi(3) / (mass + DENSITY * area * LENGTH)).sqrt();
    root(determinant, low, 1.05 * bernoulli())
}

/// Converging: each halving of the cells moves the result less than the one before. What moves is the held end (the changes go with
/// the inverse of the beam's length): the traction there is that of a cell's mean strain, which is of first order, ½, and its edges
/// are singular. Measured 0.51 to 0.64.
fn assert_converging(ratio: &[f64]) {
    assert!((ratio[2] - ratio[1]).abs() < 0.7 * (ratio[1] - ratio[0]).abs(), "{ratio:?}");
}

#[test]
fn deflection_meets_timoshenko() {
    for (nu, allowed) in [(0.3, 0.02), (0.49, 0.04)] {
        let ratio: Vec<f64> = [2, 4, 8].iter().map(|&c| deflection(c, nu)).collect();
        println!("ν = {nu}: deflection over theory at 2, 4, 8 cells {ratio:.4?}");
        assert!((ratio[2] - 1.0).abs() < allowed, "ν = {nu}: {ratio:?}");
        assert_converging(&ratio);
    }
}

#[test]
fn a_clamp_acts_where_its_edge_is() {
    // Two cells of 10 mm through the thickness; the edge lies anywhere in a cell.
    let at = |share: f64| {
        let edge = 0.02 + 0.01 * share;
        let mut s = beam(2, 0.3);
        s.clamps = vec![Clamp::still(DVec3::splat(-1.0), DVec3::new(edge, 1.0, 1.0))];
        sag(s, LENGTH - edge, 0.3)
    };
    let ratio: Vec<f64> = [0.0, 0.05, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99].into_iter().map(at).collect();
    println!("deflection over theory with the edge at 0 to 0.99 of a cell {ratio:.4?}");
    let (low, high) = ratio.iter().fold((f64::INFINITY, 0.0f64), |(a, b), r| (a.min(*r), b.max(*r)));
    // Holding the whole volume instead would move the edge by up to a cell: 20 % of the deflection.
    assert!(high / low < 1.03 && (ratio[3] - 1.0).abs() < 0.03, "{ratio:?}");
}

#[test]
fn first_frequency_meets_timoshenko() {
    for (nu, allowed) in [(0.3, 0.02), (0.49, 0.04)] {
        let ratio: Vec<f64> = [2, 4, 8].iter().map(|&c| frequency(c, nu)).collect();
        println!("ν = {nu}: frequency over theory at 2, 4, 8 cells {ratio:.4?}");
        assert!((ratio[2] - 1.0).abs() < allowed, "ν = {nu}: {ratio:?}");
        // Without what lumping the masses takes away, which hides much of the change from 2 to 4 cells.
        let stiffness: Vec<f64> = [2, 4, 8].iter().zip(&ratio).map(|(&c, r)| r * (1.0 + lumped(c))).collect();
        println!("ν = {nu}: without the error of lumped masses {stiffness:.4?}");
        assert_converging(&stiffness);
    }
}

/// A beam at rest on which a small gravity begins to act swings in its first mode about where it will hang, measured over four swings.
#[test]
fn a_beam_that_is_let_go_swings_as_timoshenko_says() {
    const PER_SWING: f64 = 60.0;
    let mut s = beam(4, 0.3);
    s.gravity = DVec3::new(0.0, 0.0, -0.0981);
    let theory = timoshenko(0.3);
    s.time = Time { step: TAU / theory / PER_SWING, steps: (4.7 * PER_SWING) as usize, start: 0.0, ..Time::weighted(0.5) };
    let plan = scenes::plan(&s);
    let mode = modes::first(&plan, DVec3::Z);
    let swing: Vec<f64> = run::states(&plan).iter().map(|s| mode.of(&s.displacement)).collect();
    let (low, high) = swing.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)));
    let middle = 0.5 * (low + high);
    // Times, in steps, at which it comes through the middle on its way down.
    let at = |k: &usize| *k as f64 + (swing[*k] - middle) / (swing[*k] - swing[k + 1]);
    let down: Vec<f64> = (0..swing.len() - 1).filter(|&k| swing[k] > middle && swing[k + 1] <= middle).map(|k| at(&k)).collect();
    let swings = down.len() - 1;
    let omega = TAU * swings as f64 / ((down[swings] - down[0]) * s.time.step);
    println!("{swings} swings: frequency over theory {:.4}, over the mode's {:.4}", omega / theory, omega / mode.omega);
    assert!(swings >= 3 && (omega / theory - 1.0).abs() < 0.02, "{omega} and {theory}");
    // θ = ½ lengthens a period by (ωΔt)²/12 = 0.09 %; places between steps are known to (ωΔt)²/8 of a step.
    assert!((omega / mode.omega - 1.0).abs() < 0.002, "{omega} and {}", mode.omega);
}

/// Mean upward displacement over the face at the beam's end [m]: no node of its own dent.
fn tip(plan: &Plan, u: &[DVec3]) -> f64 {
    let face = plan.body.pieces().filter(|(p, _)| p.normal.x > 0.9 && p.point.x > 0.99 * LENGTH);
    let (sum, area) = face.fold((0.0, 0.0), |(sum, area), (p, place)| (sum + p.area * place.at(u).z, area + p.area));
    sum / area
}

#[test]
fn a_mass_at_the_tip_bends_and_slows_the_beam() {
    // As heavy as the beam.
    let mass = DENSITY * section().0 * LENGTH;
    assert!((loaded(0.3, 0.0) / timoshenko(0.3) - 1.0).abs() < 1e-7, "without a mass it is Huang's equation");
    let with = |cells: usize, masses: Vec<PointMass>| {
        let mut s = beam(cells, 0.3);
        s.gravity = DVec3::new(0.0, 0.0, -0.00981);
        s.initial.state = InitialShape::StaticEquilibrium;
        s.time.steps = 0;
        s.masses = masses;
        scenes::plan(&s)
    };
    let point = DVec3::new(LENGTH, THICK / 2.0, THICK / 2.0);
    let mut table = [Vec::new(), Vec::new()];
    for cells in [2, 4, 8] {
        let (bare, heavy) = (with(cells, Vec::new()), with(cells, vec![PointMass { point, mass }]));
        let sag = |plan: &Plan| -tip(plan, &run::states(plan)[0].displacement);
        // The load P alone: PL³/3EI + PL/κGA.
        let theory = mass * 0.00981 * (LENGTH.powi(3) / (3.0 * YOUNG * section().1) + LENGTH / shear(0.3));
        table[0].push((sag(&heavy) - sag(&bare)) / theory);
        table[1].push(modes::first(&heavy, DVec3::Z).omega / loaded(0.3, mass));
    }
    println!("with a mass at the tip, over theory at 2, 4, 8 cells: deflection {:.4?}, frequency {:.4?}", table[0], table[1]);
    // The bound of the beam by itself: the dent of some P/Eh under a load on a single node, 8/4000 of PL³/3EI at 8 cells, is
    // not in the deflection of the whole face and takes 0.1 % off the frequency.
    assert!(table.iter().all(|ratio| (ratio[2] - 1.0).abs() < 0.02), "{table:?}");
    assert_converging(&table[0]);
}
