//! A push of known momentum at a place of the body: a blow, a kick, the ground under a body that was dropped.
//!
//! Force p g(t) on the nodes around the place, by their shares (`point_mass::around`). g is a cubic B-spline over the `duration` (de Boor,
//! *A Practical Guide to Splines*, 1978), so that ∫g = 1 and the force begins and ends smoothly. A body of mass m that falls on hard ground
//! at speed v and leaves it at e v gets p = m v (1 + e). The force is taken at the instant of a step that the scheme weights forces for;
//! with at least [`LEAST_STEPS`] steps the sum over them is the momentum to 0.3 %. Impulses that follow each other by a quarter of their duration
//! are a spline: forces of any course are rows of them. None of it acts in a static problem.

use super::law::{Input, Number, Place, PointLaw, dot};
use super::point_mass::{RADIUS, around};
use super::{EffectParam, Family, Law, Site, Trial, Unstated, component, number};
use glam::DVec3;

/// Fewest steps that an impulse may take: a spline that is sampled less often does not sum to one (by a third with two samples).
pub const LEAST_STEPS: u32 = 4;

/// Kind of this law in scene files.
pub const KIND: &str = "impulse";

/// Place of its duration in its numbers.
pub const DURATION: usize = 8;

pub(super) const LAW: Law = Law {
    kind: KIND,
    family: Family::Load,
    sentence: "a blow of limited time hits the body",
    params: &PARAMS,
    trial: Trial::Never,
    site: Site::Nodes(&Impulse),
};

const MOMENTUM: &str = "force times time that it adds in all";
const POINT: &str = "where it acts, on the body at rest";

const PARAMS: [EffectParam; 9] = [
    component("momentum", 0, "N·s", 0.1, MOMENTUM),
    component("momentum", 1, "N·s", 0.1, MOMENTUM),
    component("momentum", 2, "N·s", 0.1, MOMENTUM),
    EffectParam { default: Unstated::OnBody, ..component("point", 0, "m", 0.05, POINT) },
    EffectParam { default: Unstated::OnBody, ..component("point", 1, "m", 0.05, POINT) },
    EffectParam { default: Unstated::OnBody, ..component("point", 2, "m", 0.05, POINT) },
    RADIUS,
    number("time", "s", [-1e6, 1e6, 0.1], Unstated::Stated(0.0), "when it begins"),
    number("duration", "s", [1e-9, 1e6, 1.0], Unstated::Stated(0.1), "how long it takes, four steps at least"),
];

/// Cubic B-spline of unit integral at u knots from its beginning, 0 to 4.
pub fn spline<D: Number>(u: D) -> D {
    let a = if u.re() < 2.0 { -u + 2.0 } else { u - 2.0 };
    match a.re() {
        r if r < 1.0 => a * a * (a * 0.5 - 1.0) + 2.0 / 3.0,
        r if r < 2.0 => (-a + 2.0).powi(3) * (1.0 / 6.0),
        _ => D::from(0.0),
    }
}

struct Impulse;

impl Impulse {
    /// Knots of the spline since it began.
    fn knots<D: Number>(place: &Place, at: &Input<D>) -> D {
        (at.time() - place.lead() - at.p(7)) / at.p(DURATION) * 4.0
    }
}

impl PointLaw for Impulse {
    const IS_LOAD: bool = true;

    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let course = spline(Impulse::knots(place, &at)) / at.p(DURATION) * 4.0;
        -dot(at.vector(0), at.x()) * course * place.measure
    }

    fn idle(&self, place: &Place, z: &[f64]) -> bool {
        self.asleep(place, z)
    }

    fn asleep(&self, place: &Place, z: &[f64]) -> bool {
        place.rate == 0.0 || !(0.0..4.0).contains(&Impulse::knots(place, &Input::new(z)))
    }

    fn share<D: Number>(&self, rest: DVec3, p: &[D]) -> Option<D> {
        Some(around(rest, [p[3], p[4], p[5]], p[6]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_sum_to_the_momentum() {
        for (steps, close) in [(4.0, 1e-12), (5.0, 3e-3), (6.5, 3e-3), (8.0, 1e-12), (11.0, 1e-3), (40.0, 1e-12)] {
            for phase in [0.0, 0.3, 0.77] {
                let sum: f64 = (0..60).map(|k| spline((f64::from(k) + phase) * 4.0 / steps) * 4.0 / steps).sum();
                assert!((sum - 1.0).abs() < close, "{steps} steps from {phase}: {sum}");
            }
        }
    }

    #[test]
    fn impulses_in_a_row_are_a_spline() {
        for u in [3.0, 3.25, 3.9] {
            let sum: f64 = (0..4).map(|k| spline(u - f64::from(k))).sum();
            assert!((sum - 1.0).abs() < 1e-15, "{u}: {sum}");
        }
    }
}
