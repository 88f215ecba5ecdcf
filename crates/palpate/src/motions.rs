//! Other motions of a scene's body: clamps that shake, pushes, spins, drops, the setup turned.

use crate::choose::lowest_frequency;
use crate::experiment::Experiment;
use glam::{DQuat, DVec3};
use palpate_model::mechanics::motion::RigidMotion;
use palpate_model::params::ParamKey;
use std::f64::consts::{FRAC_PI_2, TAU};

/// A clamp's shake as a share of the body's size, and its frequencies as multiples of the lowest one.
const SHAKE: f64 = 0.05;
const TUNES: [f64; 2] = [1.0, 2.5];

/// How another motion differs from the scene's own.
pub(crate) struct Motion {
    /// In words.
    pub(crate) what: String,
    /// Added to the velocity at the start [m/s].
    push: DVec3,
    /// Added to the spin at the start [rad/s].
    spin: DVec3,
    /// Turns gravity.
    turn: DQuat,
    /// What clamps are shaken along, as far as they go [m], and how fast [Hz].
    shake: Option<(DVec3, f64)>,
}

impl Motion {
    /// The scene in this motion; its recording stays that of its own.
    pub(crate) fn of(&self, e: &Experiment) -> Experiment {
        let mut other = e.clone();
        let plan = &mut other.plan;
        let place = |key| plan.layout.index(key);
        let gravity = self.turn * DVec3::from_array([0u8, 1, 2].map(|a| plan.theta[place(ParamKey::Gravity(a))]));
        let mut theta = plan.theta.clone();
        for a in 0..3u8 {
            theta[place(ParamKey::Velocity(a))] += self.push[usize::from(a)];
            theta[place(ParamKey::AngularVelocity(a))] += self.spin[usize::from(a)];
            theta[place(ParamKey::Gravity(a))] = gravity[usize::from(a)];
        }
        plan.theta = theta;
        if let Some((way, frequency)) = self.shake {
            let (start, end) = (e.scene().time.start, e.end_time());
            for clamp in &mut plan.clamps {
                clamp.motion = Some(shaken(clamp.motion.as_ref(), way, frequency, start, end));
            }
        }
        other
    }
}

/// A few other motions of the same body: clamps that shake, pushes, spins, drops, the setup turned.
pub(crate) fn motions(e: &Experiment) -> Vec<Motion> {
    let plan = e.plan();
    let (low, high) = e.shape().bounds();
    let size = (high - low).max_element();
    let still = |what: String| Motion { what, push: DVec3::ZERO, spin: DVec3::ZERO, turn: DQuat::IDENTITY, shake: None };
    let (up, gravity) = (e.up(), e.scene().gravity);
    let side = up.any_orthonormal_vector();
    let speed = (2.0 * gravity.length().max(1.0) * size).sqrt();
    let mut out = Vec::new();
    let moves = plan.clock.moves();
    if moves && !plan.clamps.is_empty() {
        let lowest = lowest_frequency(e.scene(), e.shape());
        for (axis, name) in [(DVec3::X, "x"), (DVec3::Y, "y"), (DVec3::Z, "z")] {
            for tune in TUNES {
                let frequency = tune * lowest;
                let what = format!("the clamps shaken along {name} by {:.1} mm at {frequency:.1} Hz", 1e3 * SHAKE * size);
                out.push(Motion { shake: Some((SHAKE * size * axis, frequency)), ..still(what) });
            }
        }
    } else if moves {
        out.push(Motion { push: 0.5 * speed * side, ..still(format!("a push of {:.2} m/s sideways at the start", 0.5 * speed)) });
        let rate = speed / size;
        out.push(Motion {
            spin: rate * side,
            ..still(format!("a spin of {rate:.1} rad/s about a horizontal axis at the start"))
        });
        if !plan.planes.is_empty() {
            out.push(Motion { push: -speed * up, ..still(format!("a drop from {size:.2} m higher")) });
        }
    }
    if gravity != DVec3::ZERO && plan.planes.is_empty() {
        for axis in [side, side.cross(up)] {
            let turn = DQuat::from_axis_angle(axis, FRAC_PI_2);
            let to = palpate_diagnose::direction(turn * gravity);
            out.push(Motion { turn, ..still(format!("the setup turned, so that gravity pulls towards {to}")) });
        }
    }
    out
}

/// A clamp's motion with a shake on top that begins and ends at rest.
fn shaken(own: Option<&RigidMotion>, way: DVec3, frequency: f64, start: f64, end: f64) -> RigidMotion {
    let count = ((end - start) * frequency * 24.0).ceil().clamp(8.0, 20_000.0) as usize;
    let times: Vec<f64> = (0..=count).map(|k| start + (end - start) * k as f64 / count as f64).collect();
    let pose = |t: f64| {
        let (turn, shift) = own.map_or((glam::DMat3::IDENTITY, DVec3::ZERO), |m| m.at(t));
        (shift + 0.5 * way * (1.0 - (TAU * frequency * (t - start)).cos()), DQuat::from_mat3(&turn))
    };
    let (translations, rotations) = times.iter().map(|t| pose(*t)).unzip();
    RigidMotion { times, translations, rotations }
}
