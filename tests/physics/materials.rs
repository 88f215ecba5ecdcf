//! Bodies of every material: what all of them share at small strains, and what they do when they are squeezed.

use glam::DVec3;
use palpate_model::materials;
use palpate_model::scene::*;
use support::{run, scenes};

/// A ball of five cells across, cut everywhere but in its middle, falls on the ground: pressed from little to flat. On a cell that is cut
/// the mean strain of what is inside differs from the strain at the cell's centre.
#[test]
fn coarse_balls_of_every_material_fall_and_bounce() {
    let mut linear = [0.0; 2];
    for model in materials::ALL {
        let squeezed = [100e3, 5e3].map(|young| {
            let mut s = scenes::body(Analytic::Ball { radius: 0.1, center: DVec3::new(0.0, 0.0, 0.13) }, 0.045);
            (s.material.model, s.material.youngs_modulus) = (model, young);
            s.gravity = DVec3::new(0.0, 0.0, -9.81);
            s.planes = vec![scenes::plane(DVec3::ZERO, DVec3::Z)];
            s.time = Time { step: 0.01, steps: 40, start: 0.0, ..Time::weighted(0.6) };
            let plan = scenes::plan(&s);
            let body = &plan.body;
            let height = |s: &palpate_engine::Snapshot| {
                let tops = body.patches.iter().zip(body.surface.iter()).map(|(p, place)| (p.point + place.at(&s.displacement)).z);
                tops.fold(f64::NEG_INFINITY, f64::max)
            };
            1.0 - run::states(&plan).iter().map(height).fold(f64::INFINITY, f64::min) / 0.2
        });
        println!(
            "{}: pressed flat by {:.1} % at 100 kPa, {:.1} % at 5 kPa",
            model.name,
            100.0 * squeezed[0],
            100.0 * squeezed[1]
        );
        if model.is_linear {
            linear = squeezed;
            continue;
        }
        // At strains of some ten percent quadratic terms are of that size; pressed to half its height, a body of the others keeps more of it.
        assert!((squeezed[0] / linear[0] - 1.0).abs() < 0.1, "{}: {squeezed:?} of {linear:?}", model.name);
        assert!(squeezed[1] < 0.95 * linear[1], "{}: {squeezed:?} of {linear:?}", model.name);
    }
}
