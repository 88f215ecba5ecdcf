//! What acts on the body: weight, a constant force, a magnet, drag of the air, and a plane with friction. Each is an energy of the new
//! place of a point, so that its derivatives are symmetric.

use super::element::outer;
use glam::{DMat3, DVec3};

/// Sliding speed [m/s] below which friction fades to zero.
const CREEP: f64 = 2e-3;
/// Distance at which a magnet's force is stated [m].
pub const MAGNET_UNIT: f64 = 0.1;

/// A plane that the body cannot pass.
#[derive(Clone, Copy, Debug)]
pub struct Plane {
    /// From the plane to the side where the body stays.
    pub normal: DVec3,
    /// Its distance from the origin along the normal [m].
    pub height: f64,
    /// Pressure over the square of the penetration [Pa/m²].
    pub stiffness: f64,
    /// Friction force over normal force.
    pub friction: f64,
}

/// Everything that acts.
#[derive(Clone, Copy, Debug, Default)]
pub struct Loads {
    /// Acceleration of gravity [m/s²].
    pub gravity: DVec3,
    /// Constant force per volume [N/m³].
    pub force: DVec3,
    /// Drag per area over the square of the speed, ½ ρ C [kg/m³].
    pub drag: f64,
    /// Place of a magnet, and its force per volume at [`MAGNET_UNIT`] from it [N/m³].
    pub magnet: Option<(DVec3, f64)>,
    /// The ground.
    pub plane: Option<Plane>,
}

/// A point of the surface in a step.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// Area that it stands for [m²].
    pub area: f64,
    /// New place [m].
    pub place: DVec3,
    /// Way since the last step [m].
    pub way: DVec3,
    /// Velocity over `rate` [m].
    pub change: DVec3,
    /// Velocity over [`Contact::change`] [1/s].
    pub rate: f64,
    /// Length of the step [s].
    pub step: f64,
    /// Pressure that friction counts with [Pa].
    pub pressure: f64,
}

/// An energy with its first and second derivative.
pub type Value = (f64, DVec3, DMat3);

fn add(sum: &mut Value, (e, g, h): Value) {
    sum.0 += e;
    sum.1 += g;
    sum.2 += h;
}

impl Plane {
    /// Pressure at a place [Pa].
    pub fn pressure(&self, place: DVec3) -> f64 {
        self.stiffness * (self.height - self.normal.dot(place)).max(0.0).powi(2)
    }

    /// Energy per area of a penetration, a cube: its second derivative has no jump.
    fn push(&self, place: DVec3) -> Value {
        let n = self.normal;
        let depth = (self.height - n.dot(place)).max(0.0);
        let k = self.stiffness;
        (k / 3.0 * depth.powi(3), -k * depth * depth * n, outer(n, n) * (2.0 * k * depth))
    }

    /// Friction's potential per area (Li et al., *Incremental Potential Contact*, ACM TOG 39, 2020, Eqs. 13–16): the force grows to
    /// its full size within a way of ε and then stays.
    fn hold(&self, way: DVec3, pressure: f64, step: f64) -> Value {
        let n = self.normal;
        let slide = way - n * n.dot(way);
        let (y, most) = (slide.length(), CREEP * step);
        let tangential = DMat3::IDENTITY - outer(n, n);
        let f = self.friction * pressure;
        if y >= most {
            let s = slide / y;
            return (f * y, f * s, (tangential - outer(s, s)) * (f / y));
        }
        let s = slide.normalize_or_zero();
        let (over, more) = ((2.0 - y / most) / most, (2.0 - 2.0 * y / most) / most);
        let energy = y * y / most - y.powi(3) / (3.0 * most * most) + most / 3.0;
        (f * energy, f * over * slide, ((tangential - outer(s, s)) * over + outer(s, s) * more) * f)
    }
}

impl Loads {
    /// True where a point of the surface feels nothing.
    pub fn idle(&self, at: &Contact) -> bool {
        let clear = |p: &Plane| p.normal.dot(at.place) >= p.height && (p.friction == 0.0 || at.pressure == 0.0);
        self.drag == 0.0 && self.plane.as_ref().is_none_or(clear)
    }

    /// Energy of a point of the surface.
    pub fn on_surface(&self, at: &Contact) -> Value {
        let mut sum = (0.0, DVec3::ZERO, DMat3::ZERO);
        if let Some(plane) = &self.plane {
            add(&mut sum, plane.push(at.place));
            if plane.friction > 0.0 && at.pressure > 0.0 && at.step > 0.0 {
                add(&mut sum, plane.hold(at.way, at.pressure, at.step));
            }
        }
        let length = at.change.length();
        if self.drag > 0.0 && length > 0.0 {
            // −½ ρ C |v| v of v = rate · change, integrated over the change.
            let k = self.drag * at.rate * at.rate;
            let w = at.change / length;
            let slope = (DMat3::IDENTITY + outer(w, w)) * (k * length);
            add(&mut sum, (k * length.powi(3) / 3.0, k * length * at.change, slope));
        }
        (sum.0 * at.area, sum.1 * at.area, sum.2 * at.area)
    }

    /// Energy per volume of the magnet: a force ∝ 1/r⁴ towards it.
    pub fn in_volume(&self, place: DVec3) -> Option<Value> {
        let (pole, force) = self.magnet?;
        let d = pole - place;
        let r = d.length();
        let k = force * MAGNET_UNIT.powi(4);
        let hessian = (DMat3::IDENTITY - outer(d, d) * (5.0 / (r * r))) * (k / r.powi(5));
        Some((-k / (3.0 * r.powi(3)), -k / r.powi(5) * d, hessian))
    }
}
