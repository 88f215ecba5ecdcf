//! Effects on material, density, rest shape and clamps against closed forms of a bar that hangs along x.
//!
//! ν = 0 makes the bar one-dimensional: a cell at x carries the weight beyond it, and the tip's displacement is the integral of the strain.

use glam::{DQuat, DVec3};
use palpate_model::effects::{self, Effect};
use palpate_model::materials;
use palpate_model::materials::viscosity::Viscosity;
use palpate_model::scene::*;
use studies::real::swing::Swing;
use support::{run, scenes, tets};

const LENGTH: f64 = 0.1;
const CELL: f64 = 0.01;
const YOUNG: f64 = 1e5;
const DENSITY: f64 = 1000.0;
/// Small strains (1e-4) unless a test wants more.
const GRAVITY: f64 = 0.1;

/// An effect of a kind with some of its numbers; a vector's components follow each other.
pub(super) fn effect(kind: &str, values: &[(&str, &[f64])]) -> Effect {
    let law = effects::find(kind).unwrap_or_else(|| panic!("no effect {kind}"));
    let mut e = Effect::absent(law);
    for (key, numbers) in values {
        let first = e.law().params.iter().position(|p| p.key == *key).unwrap_or_else(|| panic!("{kind} has no {key}"));
        for (k, v) in numbers.iter().enumerate() {
            e.values[first + k] = Some(*v);
        }
    }
    e
}

/// A bar of ten whole cells, held at x = 0 and pulled along x by its weight, in equilibrium.
fn bar(effects: Vec<Effect>) -> Scene {
    let shape = Analytic::Box { min: DVec3::ZERO, max: DVec3::new(LENGTH, CELL, CELL) };
    let mut s = scenes::body(shape, CELL);
    s.material.youngs_modulus = YOUNG;
    s.material.poisson_ratio = 0.0;
    s.material.inertia = Inertia::Density(DENSITY);
    s.gravity = DVec3::new(GRAVITY, 0.0, 0.0);
    s.clamps = vec![Clamp::still(DVec3::new(-1.0, -1.0, -1.0), DVec3::new(1e-3 * CELL, 1.0, 1.0))];
    s.initial.state = InitialShape::StaticEquilibrium;
    s.time.steps = 0;
    s.effects = effects;
    s
}

/// Displacement of the tip along x at the end of a scene.
fn tip(scene: &Scene) -> f64 {
    let plan = scenes::plan(scene);
    let node = run::nearest(&plan, DVec3::new(LENGTH, 0.0, 0.0));
    run::states(&plan).last().expect("there is a start").displacement[node].x
}

/// ∫ strain(x, stress) dx for a density ρ(x), by the midpoint rule.
fn elongation(density: impl Fn(f64) -> f64, strain: impl Fn(f64, f64) -> f64) -> f64 {
    let n = 4000;
    let dx = LENGTH / n as f64;
    let (mut stress, mut sum) = (0.0, 0.0);
    for k in (0..n).rev() {
        let x = (k as f64 + 0.5) * dx;
        stress += GRAVITY * density(x) * dx;
        sum += strain(x, stress) * dx;
    }
    sum
}

/// Compares; the grid's ten cells resolve the fields used here to within a per cent.
fn close(what: &str, found: f64, expected: f64) {
    println!("{what}: {found:.6e} expected {expected:.6e}");
    assert!((found / expected - 1.0).abs() < 0.01, "{what}: {found:e} instead of {expected:e}");
}

#[test]
fn bars_of_uneven_stiffness_hang_as_their_integral_says() {
    let from_center = |x: f64| x - 0.5 * LENGTH;
    let cases: [(Effect, &dyn Fn(f64) -> f64); 4] = [
        (effect("stiffness-gradient", &[("slope", &[12.0, 0.0, 0.0])]), &|x| (12.0 * from_center(x)).exp()),
        (effect("two-part-stiffness", &[("ratio", &[1.2]), ("position", &[0.02]), ("direction", &[-3.0, 0.0, 0.0])]), &|x| {
            (0.6 * (1.0 + (2.0 * (-from_center(x) - 0.02) / CELL).tanh())).exp()
        }),
        (effect("inclusion", &[("ratio", &[-1.0]), ("center", &[0.03, 0.005, 0.005]), ("radius", &[0.03])]), &|x| {
            (-(-((x - 0.03) / 0.03).powi(4)).exp()).exp()
        }),
        (effect("stiffness-modes", &[("square", &[0.8, 0.0, 0.0])]), &|x| (0.8 * (2.0 * from_center(x) / LENGTH).powi(2)).exp()),
    ];
    let even = tip(&bar(Vec::new()));
    close("even bar", even, elongation(|_| DENSITY, |_, stress| stress / YOUNG));
    for (e, factor) in cases {
        let kind = e.law().kind;
        let expected = elongation(|_| DENSITY, |x, stress| stress / (YOUNG * factor(x)));
        assert!((expected / even - 1.0).abs() > 0.1, "{kind}: the test would not see it");
        close(kind, tip(&bar(vec![e])), expected);
    }
}

#[test]
fn bars_of_uneven_density_hang_as_their_integral_says() {
    let slope = effect("density-gradient", &[("slope", &[12.0, 0.0, 0.0])]);
    let by = |factor: &dyn Fn(f64) -> f64| elongation(|x| DENSITY * factor(x), |_, stress| stress / YOUNG);
    close("density-gradient", tip(&bar(vec![slope])), by(&|x| (12.0 * (x - 0.5 * LENGTH)).exp()));
    // Nodes stand at the corners of the section, 5 mm from the axis both ways.
    let off_axis = |x: f64| ((x - 0.07).powi(2) + 2.0 * 0.005_f64.powi(2)) / 0.03_f64.powi(2);
    let spot = effect("density-inclusion", &[("ratio", &[1.0]), ("center", &[0.07, 0.005, 0.005]), ("radius", &[0.03])]);
    close("density-inclusion", tip(&bar(vec![spot])), by(&|x| (-off_axis(x).powi(2)).exp().exp()));
}

#[test]
fn strained_bar_stiffens() {
    // Twenty per cent of strain at the top: c ε² reaches 0.4.
    let mut s = bar(vec![effect("strain-stiffening", &[("coefficient", &[10.0])])]);
    let pull = 0.2 * YOUNG / (DENSITY * LENGTH * GRAVITY);
    s.gravity *= pull;
    let strain = |_: f64, stress: f64| {
        let (mut lo, mut hi) = (0.0, stress * pull / YOUNG);
        for _ in 0..60 {
            let e = 0.5 * (lo + hi);
            if YOUNG * e * (1.0 + 10.0 * e * e) < stress * pull { lo = e } else { hi = e }
        }
        lo
    };
    close("strain-stiffening", tip(&s), elongation(|_| DENSITY, strain));
}

#[test]
fn fibres_stiffen_along_their_direction_only() {
    // Between the third cell and the end: the clamp's traction does not know of fibres, so the first cell gives a tenth of a cell more.
    let stretch = |effects: Vec<Effect>| {
        let plan = scenes::plan(&bar(effects));
        let u = &run::states(&plan)[0].displacement;
        let at = |x: f64| u[run::nearest(&plan, DVec3::X * x)].x;
        at(LENGTH) - at(0.3 * LENGTH)
    };
    let even = stretch(Vec::new());
    let with = |fibre: [f64; 3]| stretch(vec![effect("transverse-anisotropy", &[("stiffness", &[1.5]), ("fibre", &fibre)])]);
    close("fibres along", with([2.0, 0.0, 0.0]), even / 2.5);
    close("fibres across", with([0.0, 0.0, 1.0]), even);
}

#[test]
fn linear_power_law_is_stiffness_damping() {
    let swing = |effects: Vec<Effect>, damping: f64| {
        let mut s = bar(effects);
        s.initial.state = InitialShape::Rest;
        s.gravity = DVec3::new(3.0, 1.0, 0.0);
        s.material.stiffness_damping = damping;
        s.time = Time { step: 0.002, steps: 40, start: 0.0, ..Time::weighted(0.5) };
        tip(&s)
    };
    let law = effect("power-law-viscosity", &[("coefficient", &[0.003]), ("exponent", &[1.0])]);
    let (a, b, free) = (swing(vec![law], 0.0), swing(Vec::new(), 0.003), swing(Vec::new(), 0.0));
    // Both are solved to 1e-8 of the forces in each of 40 steps. Ghost lines, which only Rayleigh's damping sees, a full bar has none.
    assert!((a - b).abs() < 1e-5 * b.abs(), "{a:e} {b:e}");
    assert!((a - free).abs() > 0.01 * b.abs(), "damping must matter: {a:e} {free:e}");
}

/// Where ν = 0 the modulus C of stiffness damping is 2μ I, and βC ε̇ is a Newtonian fluid's 2η ε̇ with η = βμ.
#[test]
fn newtonian_viscosity_without_poisson_effect_is_stiffness_damping() {
    let swing = |viscosity: Option<Viscosity>, damping: f64, tets: bool| {
        let mut s = bar(Vec::new());
        if tets {
            let source = support::tets::bar(DVec3::ZERO, CELL, [10, 1, 1]);
            s.object = Object { source, pose: glam::DAffine3::IDENTITY, resolution: Resolution::Own };
        }
        s.initial.state = InitialShape::Rest;
        s.gravity = DVec3::new(3.0, 1.0, 0.0);
        s.material.viscosity = viscosity;
        s.material.stiffness_damping = damping;
        s.time = Time { step: 0.002, steps: 40, start: 0.0, ..Time::weighted(0.5) };
        tip(&s)
    };
    for tets in [false, true] {
        let flow = Viscosity { coefficient: 0.003 * 0.5 * YOUNG, exponent: 1.0 };
        let (a, b, free) = (swing(Some(flow), 0.0, tets), swing(None, 0.003, tets), swing(None, 0.0, tets));
        assert!((a - b).abs() < 1e-5 * b.abs(), "{a:e} {b:e}");
        assert!((a - free).abs() > 0.01 * b.abs(), "damping must matter: {a:e} {free:e}");
    }
}

#[test]
fn structural_damping_does_not_depend_on_frequency() {
    let loss = 0.2;
    let ratio = |young: f64| {
        // A heavy mass on a light spring: one frequency.
        let mut s = bar(vec![effect("structural-damping", &[("loss", &[loss])])]);
        s.gravity = DVec3::ZERO;
        s.material.youngs_modulus = young;
        s.material.inertia = Inertia::Density(10.0);
        s.masses = vec![PointMass { point: DVec3::new(LENGTH, 0.5 * CELL, 0.5 * CELL), mass: 0.05 }];
        let omega = (young * CELL * CELL / LENGTH / 0.05).sqrt();
        let period = std::f64::consts::TAU / omega;
        s.initial.state = InitialShape::Rest;
        // Amplitude 4 % of the length.
        s.initial.velocity = DVec3::new(0.04 * LENGTH * omega, 0.0, 0.0);
        s.time = Time { step: period / 60.0, steps: 240, start: 0.0, ..Time::weighted(0.5) };
        let plan = scenes::plan(&s);
        let node = run::nearest(&plan, DVec3::new(LENGTH, 0.0, 0.0));
        let samples: Vec<(f64, f64)> =
            run::states(&plan).iter().enumerate().map(|(k, s)| (k as f64 / 60.0, s.displacement[node].x)).collect();
        Swing::fit(&samples[30..], 1.0).damping_ratio()
    };
    let (slow, fast) = (ratio(1e4), ratio(4e5));
    let expected = loss / std::f64::consts::PI;
    println!("damping ratios {slow:.4} {fast:.4}, expected {expected:.4}");
    // The fit's exponential stands for a decay in steps, and slow strain rates are viscous: a tenth.
    assert!((slow / expected - 1.0).abs() < 0.1 && (fast / expected - 1.0).abs() < 0.1, "{slow} {fast} {expected}");
    assert!((slow / fast - 1.0).abs() < 0.05, "{slow} at a sixth of the frequency of {fast}");
}

#[test]
fn creeping_bar_gives_way_to_the_end() {
    let mut s = bar(vec![effect("creep", &[("fraction", &[0.5]), ("time", &[0.05])])]);
    s.material.mass_damping = 200.0;
    s.time = Time { step: 0.01, steps: 60, start: 3.0, ..Time::weighted(0.6) };
    close("creep", tip(&s), 2.0 * tip(&bar(Vec::new())));
}

#[test]
fn stress_free_shape_is_found_and_kept() {
    let shape = [("stretch", &[0.05, 0.0, -0.02][..]), ("bend_x_to_y", &[2.0])];
    // Held at its end the body takes the shape by itself; the anchor is the middle of the held cells.
    let mut held = bar(vec![effect("rest-shape", &shape)]);
    held.gravity = DVec3::ZERO;
    // Free, it starts there and stays.
    let mut free = held.clone();
    free.clamps = Vec::new();
    free.initial.state = InitialShape::Rest;
    free.time = Time { step: 0.01, steps: 5, start: 0.0, ..Time::weighted(0.6) };
    // The same of tetrahedra, of which the end's nodes are held; quadratic ones follow the shape exactly.
    let of_tets = |s: &Scene| Scene {
        object: Object { source: tets::bar(DVec3::ZERO, CELL, [10, 1, 1]), resolution: Resolution::Own, ..s.object.clone() },
        material: Material { model: &materials::ALL[1], ..s.material },
        ..s.clone()
    };
    let cases = [
        ("held tetrahedra", of_tets(&held), 0.0),
        ("free tetrahedra", of_tets(&free), 0.5 * LENGTH),
        ("held", held, 0.5 * CELL),
        ("free", free, 0.5 * LENGTH),
    ];
    for (name, scene, anchor) in cases {
        let plan = scenes::plan(&scene);
        let states = run::states(&plan);
        let last = states.last().expect("there is a start");
        let mut off: f64 = 0.0;
        for (x, u) in plan.body.nodes.iter().zip(&last.displacement) {
            let s = *x - DVec3::new(anchor, 0.5 * CELL, 0.5 * CELL);
            let w = DVec3::new(0.05 * s.x - 2.0 * s.x * s.y, s.x * s.x, -0.02 * s.z);
            off = off.max((*u - w).length());
        }
        // Newton stops at 1e-8 of the forces; the shape moves points by some 5 mm.
        assert!(off < 1e-7, "{name}: {off:e} m away from the stress-free shape");
    }
}

#[test]
fn compliant_clamp_gives_like_its_layer() {
    let even = tip(&bar(Vec::new()));
    for layer in [0.0005, 0.01, 0.1] {
        let found = tip(&bar(vec![effect("compliant-clamp", &[("layer", &[layer])])])) - even;
        // ν = 0: the layer gives stress times thickness over E.
        close("compliant-clamp", found, layer * DENSITY * GRAVITY * LENGTH / YOUNG);
    }
}

#[test]
fn slipped_clamp_takes_the_body_along() {
    let (offset, turn) = (DVec3::new(0.003, -0.002, 0.001), DVec3::new(0.1, 0.3, -0.2));
    let mut s = bar(vec![effect("clamp-slip", &[("offset", &offset.to_array()), ("turn", &turn.to_array())])]);
    s.gravity = DVec3::ZERO;
    let plan = scenes::plan(&s);
    let c = DVec3::splat(0.5 * CELL);
    let r = DQuat::from_axis_angle(turn.normalize(), 2.0 * (0.5 * turn.length()).atan());
    let states = run::states(&plan);
    let off = plan.body.nodes.iter().zip(&states[0].displacement).map(|(x, u)| {
        let wanted = c + offset + r * (*x - c);
        (*x + *u - wanted).length()
    });
    let off = off.fold(0.0, f64::max);
    assert!(off < 1e-7, "{off:e} m away from the rigid motion");
}

#[test]
fn an_edge_further_along_is_a_clamp_that_reaches_further() {
    // A bar that hangs: what is held does not stretch, so that its tip sinks by ρ g (L − s)² / 2E.
    let law = |shift: f64| 0.5 * DENSITY * GRAVITY * (LENGTH - shift).powi(2) / YOUNG;
    for shift in [0.005, 0.02, 0.033] {
        let found = tip(&bar(vec![effect("clamp-edge", &[("shift", &[shift])])]));
        println!("clamp-edge {shift}: {found:e}, closed form {:e}", law(shift));
        // Held volume is held by a penalty of 10 (λ + 2μ)/h²: its edge gives way as much as some hundredths of a cell (3 mm) more length would.
        assert!((found / law(shift) - 1.0).abs() < 2.0 * 0.003 / LENGTH, "{shift}: {found:e} instead of {:e}", law(shift));
    }
    // A cantilever in a clamp of 25 mm with an edge 5 mm further, or before: those of 30 and 20 mm.
    let cantilever = |held: f64, shift: f64| {
        let effects = if shift == 0.0 { Vec::new() } else { vec![effect("clamp-edge", &[("shift", &[shift])])] };
        let mut s = bar(effects);
        s.gravity = DVec3::new(0.0, 0.0, -GRAVITY);
        s.clamps = vec![Clamp::still(DVec3::splat(-1.0), DVec3::new(held, 1.0, 1.0))];
        let plan = scenes::plan(&s);
        let node = run::nearest(&plan, DVec3::new(LENGTH, 0.0, 0.0));
        run::states(&plan).last().expect("there is a start").displacement[node].z
    };
    let even = cantilever(0.025, 0.0);
    for shift in [0.005, -0.005] {
        let (found, moved) = (cantilever(0.025, shift), cantilever(0.025 + shift, 0.0));
        println!("cantilever {shift}: {found:e}, moved box {moved:e}, without {even:e}");
        // What the edge frees turns with the clamp instead of with the cell: off by the square of the angle, 0.01 here.
        assert!((found / moved - 1.0).abs() < 1e-5, "{shift}: {found:e}, with a moved box {moved:e}");
        assert!((found / even - 1.0).abs() > 0.05, "{shift}: the edge matters");
    }
}
