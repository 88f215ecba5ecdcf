//! A load that the library does not know: a magnet, which pulls every part of the body with a force per volume ∝ 1/r⁴ towards a hidden point.
//!
//! The simulator has no such law, and shall not: the field is put into the true scene as stretches of time of an affine force field
//! (`slack`), fitted over the nodes to the magnet's field where they are at that time, and simulated again until both agree.

use glam::{DMat3, DVec3};
use palpate::{Backend, Error, Experiment};
use palpate_model::effects::{Effect, find};
use palpate_model::scene::Scene;

/// Stretches of time.
const WINDOWS: usize = 16;
/// Simulations until field and motion agree.
const ROUNDS: usize = 4;

/// Where the magnet is [m], by scene.
pub const PLACES: [(&str, [f64; 3]); 4] =
    [("ball", [0.08, 0.065, 0.04]), ("blob", [0.12, 0.05, 0.22]), ("beam", [0.24, 0.08, 0.05]), ("plate", [0.06, 0.14, -0.03])];

/// Force per volume of a magnet of amplitude one at its unit distance [N/m³], a tenth of the weight of water.
const FORCE: f64 = 1e3;

/// A magnet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Magnet {
    /// Where it is [m].
    pub place: DVec3,
    /// Force per volume at the distance [`Magnet::UNIT`] [N/m³].
    pub force: f64,
}

impl Magnet {
    /// Distance at which the force is stated [m].
    pub const UNIT: f64 = 0.1;

    /// The magnet beside a scene.
    ///
    /// # Errors
    /// Nothing says where it is.
    pub fn near(scene: &str, amplitude: f64) -> Result<Magnet, Error> {
        let place = PLACES.iter().find(|p| p.0 == scene).ok_or_else(|| Error::Input(format!("no magnet beside {scene}")))?;
        Ok(Magnet { place: DVec3::from(place.1), force: amplitude * FORCE })
    }

    /// Force per volume at a point [N/m³].
    pub fn at(&self, x: DVec3) -> DVec3 {
        let d = self.place - x;
        let r = d.length().max(0.2 * Magnet::UNIT);
        self.force * (Magnet::UNIT / r).powi(4) * d / r
    }

    /// The scene with the magnet near it.
    ///
    /// # Errors
    /// The scene cannot be simulated.
    pub fn apply(&self, scene: &Scene) -> Result<Scene, Error> {
        let law = find("slack").ok_or_else(|| Error::Failed("the library has no free force field".into()))?;
        let bare = Scene { observation: None, fit: None, ..scene.clone() };
        let mut out = bare.clone();
        let (from, length) = (scene.time.start, scene.time.step * scene.time.steps as f64);
        let spacing = length / (WINDOWS - 1) as f64;
        for _ in 0..ROUNDS {
            let e = Experiment::new(out, String::new(), Vec::new())?;
            let motion = e.simulate(Backend::Cpu)?;
            let body = &e.plan().body;
            out = bare.clone();
            for w in 0..WINDOWS {
                let time = w as f64 * spacing;
                let at = |s: &palpate_engine::Snapshot| (s.time - time).abs();
                let state = motion.snapshots.iter().min_by(|a, b| at(a).total_cmp(&at(b)));
                let Some(state) = state else { continue };
                let points: Vec<(DVec3, DVec3)> =
                    body.nodes.iter().zip(&state.displacement).map(|(x, u)| (*x - body.center, self.at(*x + *u))).collect();
                let (force, gradient) = affine(&points);
                let mut effect = Effect::absent(law);
                for (slot, v) in [force, gradient.x_axis, gradient.y_axis, gradient.z_axis].into_iter().enumerate() {
                    (0..3).for_each(|a| effect.values[3 * slot + a] = Some(v[a]));
                }
                for (slot, p) in effect.law().params.iter().enumerate() {
                    match p.key {
                        "time" => effect.values[slot] = Some(from + time),
                        "width" => effect.values[slot] = Some(spacing),
                        _ => {}
                    }
                }
                out.effects.push(effect);
            }
        }
        Ok(out)
    }
}

/// Least-squares f ≈ f₀ + G x over points (x, f): f₀ and G by columns.
fn affine(points: &[(DVec3, DVec3)]) -> (DVec3, DMat3) {
    let n = points.len().max(1) as f64;
    let mean = points.iter().fold((DVec3::ZERO, DVec3::ZERO), |m, p| (m.0 + p.0 / n, m.1 + p.1 / n));
    let (mut xx, mut fx) = (DMat3::ZERO, DMat3::ZERO);
    for (x, f) in points {
        let (x, f) = (*x - mean.0, *f - mean.1);
        xx += DMat3::from_cols(x * x.x, x * x.y, x * x.z);
        fx += DMat3::from_cols(f * x.x, f * x.y, f * x.z);
    }
    let gradient = fx * xx.inverse();
    (mean.1 - gradient * mean.0, gradient)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_affine_field_is_met_and_a_magnet_pulls_with_the_fourth_power() {
        let g = DMat3::from_cols(DVec3::new(1.0, 2.0, 3.0), DVec3::new(-1.0, 0.5, 0.0), DVec3::new(0.0, 4.0, 1.0));
        let f = |x: DVec3| DVec3::new(5.0, 6.0, 7.0) + g * x;
        let at = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, 2.0, -1.0), DVec3::new(-2.0, 0.3, 1.0)];
        let (force, gradient) = affine(&at.map(|x| (x, f(x))));
        assert!((force - f(DVec3::ZERO)).length() < 1e-12);
        assert!((gradient.x_axis - g.x_axis).length() + (gradient.z_axis - g.z_axis).length() < 1e-12);
        let m = Magnet { place: DVec3::new(0.3, 0.0, 0.0), force: 2.0 };
        assert!((m.at(DVec3::new(0.2, 0.0, 0.0)) - DVec3::new(2.0, 0.0, 0.0)).length() < 1e-12);
        assert!((m.at(DVec3::new(0.1, 0.0, 0.0)).x - 2.0 / 16.0).abs() < 1e-12);
    }
}
