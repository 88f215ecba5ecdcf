//! Rayleigh damping: what slows a free body, and how fast a mode dies away.

use glam::{DMat3, DVec3};
use palpate_model::scene::*;
use support::modes::Mode;
use support::{modes, run, scenes};

#[test]
fn mass_damping_slows_a_free_body_as_the_scheme_says() {
    let (alpha, gravity, start) = (7.0, DVec3::new(0.5, -1.0, -9.81), DVec3::new(-0.4, 0.3, 2.0));
    for theta in [0.5, 0.6, 0.9] {
        let mut s = scenes::body(Analytic::Ball { radius: 0.03, center: DVec3::splat(0.001) }, 0.012);
        s.material.mass_damping = alpha;
        s.gravity = gravity;
        s.initial.velocity = start;
        // Iterations stop where 1e-8 of the forces is left, 2e-7 of the velocity: this is about the scheme.
        s.solver.linear = LinearSolver::Cholesky;
        s.time = Time { step: 0.01, steps: 60, start: 0.0, ..Time::weighted(theta) };
        let states = run::states(&scenes::plan(&s));
        // (v₁ − v₀)/Δt = g − α (θ v₁ + (1 − θ) v₀): towards g/α by the same factor every step.
        let terminal = gravity / alpha;
        let factor = (1.0 - alpha * (1.0 - theta) * s.time.step) / (1.0 + alpha * theta * s.time.step);
        for (k, state) in states.iter().enumerate() {
            let expected = terminal + (start - terminal) * factor.powi(k as i32);
            let off = state.velocity.iter().map(|v| (*v - expected).length()).fold(0.0, f64::max);
            // Newton's method stops at 1e-8 of the forces; that of a free body needs one exact step and ends far below.
            assert!(off < 1e-10 * start.length(), "θ = {theta}, step {k}: {off:.1e} m/s off");
        }
    }
}

/// A short beam with faces off the lattice, held at its end: ghost penalty and Nitsche's terms take part. A thousandth of gravity:
/// small motions.
fn beam() -> Scene {
    let mut s = scenes::body(Analytic::Box { min: DVec3::ZERO, max: DVec3::new(0.11, 0.023, 0.021) }, 0.01);
    s.material.youngs_modulus = 2.0e5;
    s.clamps = vec![Clamp::still(DVec3::splat(-1.0), DVec3::new(1e-5, 1.0, 1.0))];
    s.gravity = DVec3::new(0.0, 0.0, -0.00981);
    s.solver.tolerance = 1e-11;
    s
}

/// Share of the critical damping that the beam's first mode shows, and its frequency times the step, with `mass` · ω and `stiffness` / ω
/// as Rayleigh's factors for the mode's frequency ω, at this θ.
fn ratio(mode: &Mode, mass: f64, stiffness: f64, theta: f64) -> (f64, f64) {
    let mut s = beam();
    s.material.mass_damping = mass * mode.omega;
    s.material.stiffness_damping = stiffness / mode.omega;
    // A hundred steps a period, three periods.
    s.time = Time { step: std::f64::consts::TAU / mode.omega / 100.0, steps: 300, start: 0.0, ..Time::weighted(theta) };
    let states = run::states(&scenes::plan(&s));
    // The mode's share in the motion, free of all other modes.
    let q: Vec<f64> = states.iter().map(|s| mode.of(&s.displacement)).collect();
    // An oscillator's samples obey q₂ = a q₁ − b q₀ + c, and e^(s Δt) are the roots of z² − a z + b: least squares for a, b, c.
    let (mut m, mut r) = (DMat3::ZERO, DVec3::ZERO);
    for w in q.windows(3).skip(1) {
        let row = DVec3::new(w[1], -w[0], q[1]);
        m += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
        r += row * w[2];
    }
    let x = m.inverse() * r;
    let (decay, turn) = (-0.5 * x.y.ln(), (0.5 * x.x / x.y.sqrt()).acos());
    (decay / decay.hypot(turn), decay.hypot(turn))
}

/// What part of the mode's stiffness is the body's own, which stiffness damping acts on; the rest is the clamp's.
fn own_share(mode: &Mode) -> f64 {
    let s = beam();
    let u: Vec<DVec3> = mode.shape.iter().map(|u| 1e-6 * *u).collect();
    2.0 * support::energy::elastic(&scenes::plan(&s), &s, &u) / (1e-6 * mode.omega).powi(2)
}

#[test]
fn a_mode_dies_away_as_rayleigh_says() {
    let mode = modes::first(&scenes::plan(&beam()), DVec3::Z);
    let own = own_share(&mode);
    println!("{own:.5} of the mode's stiffness is the body's own");
    // Nitsche's terms vanish as cells shrink.
    assert!((own - 1.0).abs() < 0.02, "{own}");
    for (mass, stiffness) in [(0.06, 0.0), (0.0, 0.06), (0.04, 0.08)] {
        let (zeta, turn) = ratio(&mode, mass, stiffness, 0.5);
        let expected = 0.5 * (mass + own * stiffness);
        println!("α = {mass} ω, β = {stiffness} / ω: damping ratio {zeta:.6}, (α/ω + βω)/2 = {expected:.6}, ωΔt = {turn:.5}");
        // The trapezoidal rule takes (ωΔt)²/12 = 3e-4 off frequency and (ωΔt)²/4 off decay, the clamp's cells mix the modes a little.
        assert!((zeta / expected - 1.0).abs() < 2e-3, "{zeta} against {expected}");
    }
}

#[test]
fn the_scheme_itself_damps_by_its_own_formula() {
    let mode = modes::first(&scenes::plan(&beam()), DVec3::Z);
    // The θ-scheme's own share: (θ − ½) ω Δt of the critical damping, to second order in ωΔt = 0.06.
    let (zeta, turn) = ratio(&mode, 0.0, 0.0, 0.6);
    println!("undamped at θ = 0.6: damping ratio {zeta:.6}, (θ − ½) ω Δt = {:.6}", 0.1 * turn);
    assert!((zeta / (0.1 * turn) - 1.0).abs() < 0.004, "{zeta}");
    let (zeta, _) = ratio(&mode, 0.0, 0.0, 0.5);
    println!("undamped at θ = ½: {zeta:.1e}");
    // Newton's tolerance of 1e-11 over three hundred steps, and the strain's second order at motions of 1e-4 of the length.
    assert!(zeta.abs() < 1e-7, "{zeta}");
}
