//! Bodies of tetrahedra: what is exact on them is met, and what they cannot do is known.

use glam::{DAffine3, DVec3};
use palpate_model::materials;
use palpate_model::scene::*;
use support::{run, scenes, tets};

/// A column of 10 × 2 × 2 cm that stands on, or hangs from, its lowest nodes.
fn column(model: &'static materials::Model) -> Scene {
    let mut s = scenes::body(Analytic::Ball { radius: 0.01, center: DVec3::ZERO }, 0.01);
    s.object = Object { source: tets::bar(DVec3::ZERO, 0.01, [10, 2, 2]), pose: DAffine3::IDENTITY, resolution: Resolution::Own };
    s.material.model = model;
    s.material.youngs_modulus = 1e5;
    s.material.poisson_ratio = 0.0;
    s.clamps = vec![Clamp {
        min: DVec3::new(-0.001, -1.0, -1.0),
        max: DVec3::new(0.001, 1.0, 1.0),
        object_frame: false,
        motion: None,
        motion_path: None,
    }];
    s.initial.state = InitialShape::StaticEquilibrium;
    s.time.steps = 0;
    s
}

#[test]
fn a_hanging_bar_stretches_by_its_weight() {
    for model in materials::ALL {
        let mut s = column(model);
        s.gravity = DVec3::new(0.5, 0.0, 0.0);
        let plan = scenes::plan(&s);
        let end = run::states(&plan).pop().unwrap();
        let far = plan.body.nodes.iter().zip(&end.displacement).filter(|(x, _)| x.x > 0.099);
        let stretch: Vec<f64> = far.map(|(_, u)| u.x).collect();
        let mean = stretch.iter().sum::<f64>() / stretch.len() as f64;
        // ρ g L²/2E; strains of half a thousandth, in which materials differ by as much.
        let exact = 1000.0 * 0.5 * 0.01 / (2.0 * 1e5);
        assert!((mean / exact - 1.0).abs() < 2e-3, "{}: {mean} for {exact}", model.name);
    }
}

#[test]
fn a_spin_neither_strains_nor_brakes_a_free_body() {
    // Chords instead of arcs take a part of (ωΔt)² a step from a spin, whatever the scheme; a damper that saw the turn would stop it.
    for (scheme, close) in [("theta", 5e-3), ("tr-bdf2", 5e-3), ("bdf2", 5e-3)] {
        let mut s = column(&materials::ALL[1]);
        (s.clamps, s.gravity) = (Vec::new(), DVec3::ZERO);
        s.material.youngs_modulus = 1e7;
        s.material.stiffness_damping = 0.01;
        s.initial.state = InitialShape::Rest;
        s.initial.angular_velocity = DVec3::new(0.0, 0.0, 5.0);
        let scheme = palpate_model::plan::scheme::find(scheme).unwrap();
        // A sixth of a turn.
        s.time = Time { step: 0.005, steps: 40, theta: 0.5, scheme, ..Time::default() };
        let plan = scenes::plan(&s);
        let states = run::states(&plan);
        let m = run::masses(&plan, 1000.0);
        let energy = |k: usize| states[k].velocity.iter().zip(&m).map(|(v, m)| 0.5 * m * v.length_squared()).sum::<f64>();
        let kept = energy(states.len() - 1) / energy(0);
        println!("{}: {kept:.6} of the spin's energy after a sixth of a turn", scheme.name);
        assert!((kept - 1.0).abs() < close, "{}: {kept}", scheme.name);
    }
}
