//! Measurement effects: adjoint = sensitivities = differences, for each and for all at once.

use super::effects::{check, with};
use super::gradients::{away_from_kinks, ball, observed};
use glam::DVec3;
use palpate_model::effects::{ALL, Effect, Family};
use palpate_model::observation::Camera;
use palpate_model::plan::Plan;
use palpate_model::scene::Scene;
use std::sync::Arc;

/// The scene watched by two cameras from outside; no frame lies on a step boundary, with or without a time offset.
fn watched(scene: &Scene) -> Plan {
    let mut plan = observed(scene, &[0.027, 0.0437, 0.058]);
    let middle = DVec3::new(0.0, 0.0, 0.06);
    let camera = |center: DVec3| Camera::Pinhole { center, axis: (middle + DVec3::new(0.02, 0.0, -0.01) - center).normalize() };
    let observation = Arc::make_mut(&mut plan.observation);
    observation.cameras = vec![camera(DVec3::new(0.35, -0.3, 0.25)), camera(DVec3::new(-0.3, -0.4, 0.1))];
    let patches = &plan.body.patches;
    for frame in &mut observation.frames {
        // Patches and points come in the same order; those well turned towards a camera stay visible through small changes.
        let mut kept = Vec::new();
        for (point, patch) in frame.points.iter().zip(patches) {
            for (number, c) in observation.cameras.iter().enumerate() {
                if patch.normal.dot(-c.line(point.position)) > 0.6 {
                    kept.push(palpate_model::observation::ObservedPoint { camera: number as u32, ..*point });
                }
            }
        }
        assert!(kept.len() > 20, "{} points", kept.len());
        frame.points = kept;
    }
    // Other cameras find other places for some points.
    away_from_kinks(plan)
}

#[test]
fn each_alone() {
    let mut found = 0;
    for law in (0..ALL.len()).filter(|l| ALL[*l].family == Family::Measurement) {
        check(&watched(&with(law)), ALL[law].kind);
        found += 1;
    }
    assert!(found >= 7, "{found} measurement effects");
}

#[test]
fn all_at_once() {
    let mut scene = ball();
    scene.effects = (0..ALL.len())
        .filter(|l| ALL[*l].family == Family::Measurement)
        .map(|law| {
            let mut effect: Effect = with(law).effects.remove(0);
            // Small enough together to stay in the band.
            for (value, p) in effect.values.iter_mut().zip(ALL[law].params).filter(|(_, p)| p.default == absent()) {
                *value = Some(0.1 * p.typical);
            }
            effect
        })
        .collect();
    check(&watched(&scene), "all");
}

fn absent() -> palpate_model::effects::Unstated {
    palpate_model::effects::Unstated::Absent(0.0)
}
