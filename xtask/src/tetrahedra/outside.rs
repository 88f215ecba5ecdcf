//! What no law of the library is. Each acts between the steps: it sets forces on nodes, growth and stiffness of tetrahedra, the ground, gravity
//! or what is held from the state that the body has, for the step that comes. Steps are short against all that they change.

use super::body::Body;
use super::integrator::State;
use glam::{DQuat, DVec3};
use std::f64::consts::TAU;

/// What it is. Times are in seconds, frequencies in hertz.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "the line of each kind says what its places, directions, times and frequencies are")]
pub enum Kind {
    /// A magnet at a place: a force per volume ∝ 1/r⁴, of this size at 0.1 m [N/m³].
    Magnet { at: DVec3 },
    /// A thread pulls at a place of the body with a constant force [N] towards another, until it breaks.
    Thread { on: DVec3, towards: DVec3, until: f64 },
    /// The half of the body on this side of its middle grows, by this part in the end.
    Swelling { side: DVec3, time: f64 },
    /// The half of the body on this side contracts and relaxes, by this part.
    Actuator { side: DVec3, frequency: f64 },
    /// A weight [kg] that runs along the body from one place to another and back.
    Runner { from: DVec3, to: DVec3, frequency: f64 },
    /// The ground moves up and down by this way [m].
    Heave { frequency: f64 },
    /// Air turns about an axis through a place with this angular velocity [rad/s] and drags the body along.
    Vortex { about: DVec3, axis: DVec3 },
    /// Gravity turns about an axis with this angular velocity [rad/s].
    Turning { axis: DVec3 },
    /// The material hardens where it is strained: its stiffness grows by this part per strain of a tenth.
    Hardening,
    /// A patch of the surface sticks to where it was with this stiffness [N/m] and lets go.
    Patch { on: DVec3, until: f64 },
    /// What is held shakes along a direction by this way [m].
    Shaking { along: DVec3, frequency: f64 },
    /// A wind that comes and goes: a force per volume [N/m³].
    Gusts { along: DVec3, frequency: f64 },
    /// The first camera drifts with this speed [m/s].
    Drift { along: DVec3 },
    /// Depth readings are off by a wave over the image [m].
    Ripple { pixels: f64 },
}

/// Something of a size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outside {
    /// What.
    pub kind: Kind,
    /// Its number, in the unit that [`Kind`] says.
    pub size: f64,
}

/// Parts of the body that are the same all the time.
pub struct Parts {
    middle: DVec3,
    extent: f64,
    volumes: Vec<f64>,
    stiffness: Vec<f64>,
    gravity: DVec3,
    height: f64,
    hardened: Vec<f64>,
}

impl Parts {
    /// Of a body at rest.
    pub fn new(body: &Body) -> Parts {
        let nodes = &body.mesh.nodes;
        let low = nodes.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = nodes.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let mut volumes = vec![0.0; nodes.len()];
        for (tet, products) in body.mesh.tets.iter().zip(&body.elements.products) {
            for (n, row) in tet.iter().zip(products) {
                volumes[*n] += row.iter().sum::<f64>();
            }
        }
        Parts {
            middle: 0.5 * (low + high),
            extent: (high - low).length(),
            volumes,
            stiffness: body.stiffness.clone(),
            gravity: body.loads.gravity,
            height: body.loads.plane.map_or(0.0, |p| p.height),
            hardened: vec![0.0; body.mesh.tets.len()],
        }
    }

    /// Nodes near a place at rest, each with its share; they are as far as a tenth of the body.
    pub(super) fn near(&self, body: &Body, place: DVec3) -> Vec<(usize, f64)> {
        let radius = 0.1 * self.extent;
        let weight = |x: &DVec3| (-(x.distance_squared(place)) / (radius * radius)).exp();
        let all: Vec<f64> = body.mesh.nodes.iter().zip(&self.volumes).map(|(x, v)| weight(x) * v.max(0.0)).collect();
        let sum: f64 = all.iter().sum();
        all.iter().enumerate().filter(|(_, w)| **w > 1e-6 * sum).map(|(n, w)| (n, w / sum)).collect()
    }

    fn beyond(&self, body: &Body, side: DVec3) -> Vec<bool> {
        let center = |t: &[usize; 10]| t.iter().take(4).map(|n| body.mesh.nodes[*n]).sum::<DVec3>() / 4.0;
        body.mesh.tets.iter().map(|t| (center(t) - self.middle).dot(side) > 0.0).collect()
    }
}

fn wave(frequency: f64, time: f64) -> f64 {
    (TAU * frequency * time).sin()
}

impl Outside {
    /// Sets what it does to a body during the step that ends at `time`.
    pub fn act(&self, body: &mut Body, parts: &mut Parts, now: &State, time: f64) {
        let n = body.mesh.nodes.len();
        let at = |k: usize| body.mesh.nodes[k] + now.u[k];
        let mut forces = vec![DVec3::ZERO; n];
        match self.kind {
            Kind::Magnet { at } => body.loads.magnet = Some((at, self.size)),
            Kind::Thread { on, towards, until } => {
                if time < until {
                    for (k, share) in parts.near(body, on) {
                        forces[k] = self.size * share * (towards - at(k)).normalize_or_zero();
                    }
                }
            }
            Kind::Swelling { side, time: whole } => {
                let grown = 1.0 + self.size * (time / whole).min(1.0);
                body.growth = parts.beyond(body, side).into_iter().map(|b| if b { grown } else { 1.0 }).collect();
            }
            Kind::Actuator { side, frequency } => {
                let grown = 1.0 - self.size * wave(frequency, time).max(0.0);
                body.growth = parts.beyond(body, side).into_iter().map(|b| if b { grown } else { 1.0 }).collect();
            }
            Kind::Runner { from, to, frequency } => {
                let place = from.lerp(to, 0.5 - 0.5 * (TAU * frequency * time).cos());
                for (k, share) in parts.near(body, place) {
                    forces[k] = self.size * share * parts.gravity;
                }
            }
            Kind::Heave { frequency } => {
                if let Some(plane) = &mut body.loads.plane {
                    plane.height = parts.height + self.size * wave(frequency, time);
                }
            }
            Kind::Vortex { about, axis } => {
                // A drag of one, on a surface of the size of the volume to two thirds, spread over the nodes as the volume is.
                let volume: f64 = parts.volumes.iter().sum();
                for k in 0..n {
                    let wind = self.size * axis.cross(at(k) - about) - now.v[k];
                    forces[k] = 0.6 * parts.volumes[k] * volume.powf(-1.0 / 3.0) * wind.length() * wind;
                }
            }
            Kind::Turning { axis } => {
                body.loads.gravity = DQuat::from_axis_angle(axis, self.size * time) * parts.gravity;
            }
            Kind::Hardening => {
                let strains = body.strains(&now.u);
                for (k, (s, hard)) in strains.iter().zip(&mut parts.hardened).enumerate() {
                    let size = s.iter().map(|e| e.to_cols_array().iter().map(|x| x * x).sum::<f64>()).sum::<f64>();
                    *hard = hard.max((0.25 * size).sqrt());
                    body.stiffness[k] = parts.stiffness[k] * (1.0 + self.size * *hard / 0.1);
                }
            }
            Kind::Patch { on, until } => {
                if time < until {
                    for (k, share) in parts.near(body, on) {
                        forces[k] = -self.size * share * now.u[k];
                    }
                }
            }
            Kind::Shaking { along, frequency } => body.offset = self.size * wave(frequency, time) * along,
            Kind::Gusts { along, frequency } => {
                let strength = self.size * wave(frequency, time).max(0.0);
                (0..n).for_each(|k| forces[k] = parts.volumes[k] * strength * along);
            }
            Kind::Drift { .. } | Kind::Ripple { .. } => {}
        }
        body.forces = forces;
    }

    /// Way that the first camera has drifted by this time [m].
    pub fn drifted(&self, time: f64) -> DVec3 {
        if let Kind::Drift { along } = self.kind { self.size * time * along } else { DVec3::ZERO }
    }

    /// What it adds to a depth reading [m].
    pub fn added(&self, pixel: [usize; 2]) -> f64 {
        match self.kind {
            Kind::Ripple { pixels } => self.size * wave(1.0 / pixels, (pixel[0] + pixel[1]) as f64),
            _ => 0.0,
        }
    }
}
