//! Every effect by itself in a scene where everything acts: adjoint = sensitivities = differences, for all parameters.

use super::gradients::{ball, check_some, observed};
use palpate_model::effects::{self, ALL, Family};
use palpate_model::params::ParamKey::{self, *};

/// The ball with one effect, every amplitude at a size that matters.
fn with(law: usize) -> palpate_model::scene::Scene {
    let mut scene = ball();
    let mut effect = effects::Effect::absent(law);
    for (value, p) in effect.values.iter_mut().zip(ALL[law].params) {
        if let Some(v) = value {
            *v = (*v + 0.3 * p.typical).clamp(p.lower, p.upper);
        }
    }
    scene.effects = vec![effect];
    scene
}

/// The effect's own numbers, and one of each that laws may depend on besides.
fn touched(key: ParamKey) -> bool {
    matches!(key, Effect { .. } | YoungsModulus | Density | Gravity(2) | Velocity(0) | PlaneHeight(0) | PlaneTheta(0) | TimeStart)
}

fn check_family(family: Family) {
    let mut found = 0;
    for law in (0..ALL.len()).filter(|l| ALL[*l].family == family) {
        check_some(&observed(&with(law), &[0.025, 0.0437, 0.06]), ALL[law].kind, touched);
        found += 1;
    }
    assert!(found > 0, "no effect of {family:?}");
}

#[test]
fn contact() {
    check_family(Family::Contact);
}

#[test]
fn loads() {
    check_family(Family::Load);
}

#[test]
fn slack() {
    check_family(Family::Slack);
}
