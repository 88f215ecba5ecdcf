//! Contact with planes: a pressure on every surface patch that comes near one.
//!
//! It acts along the way between the states (`palpate_model::mechanics::contact`): its work is never less than its energy's change, so it
//! limits no time step.

use super::{Context, Curvature, Forces, PastChange, PastGradient, Term};
use crate::linear::matrix::Matrix;
use glam::{DMat3, DVec3};
use palpate_model::mechanics::contact;
use palpate_model::mechanics::plane::PlaneNow;
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::space::body::{Body, Patch};
use palpate_model::space::stencil::Stencil;

/// A surface patch that touches a plane within a step: sums over the instants of [`contact::instants`].
pub struct Touch<'a> {
    /// Number of the patch.
    patch: usize,
    /// Its mean place.
    place: Stencil<'a>,
    /// Area [m²].
    pub area: f64,
    /// Pressure [Pa].
    pub pressure: f64,
    /// Its derivatives by the new and by the old gap [Pa/m], negative.
    slopes: [f64; 2],
    /// Slope of the law times the place of the patch's mean point [Pa]: derivative of the pressure by the plane's normal.
    lever: DVec3,
    /// Potential per area whose derivative by the new gap is minus the pressure [J/m²].
    energy: f64,
}

impl Touch<'_> {
    /// Adds −area · f, spread over the nodes.
    fn add(&self, f: DVec3, out: &mut [DVec3]) {
        self.place.spread(-self.area * f, out);
    }
}

/// The term.
pub struct Contact<'a> {
    /// What it reads.
    pub c: Context<'a>,
}

/// Patches of a body that feel a plane in a solve with weight `theta` of the new state, from the old displacement in `u` to the new one
/// before it.
pub fn touches<'s>(
    body: &'s Body,
    plane: &'s PlaneNow,
    theta: f64,
    [u1, u0]: [&'s [DVec3]; 2],
) -> impl Iterator<Item = (&'s Patch, Touch<'s>)> {
    let width = contact::WIDTH * body.length;
    let instants = contact::instants(theta);
    let along = contact::acts_along(theta);
    body.patches.iter().enumerate().filter_map(move |(number, patch)| {
        let place = body.surface.get(number);
        let at = |u: &[DVec3]| patch.point + place.at(u);
        let new = at(u1);
        let old = if along { at(u0) } else { new };
        let n = plane.normal[0];
        if n.dot(new).min(n.dot(old)) - plane.height >= width {
            return None;
        }
        let gaps = [new, old].map(|x| n.dot(x) - plane.height);
        let mut t =
            Touch { patch: number, place, area: patch.area, pressure: 0.0, slopes: [0.0; 2], lever: DVec3::ZERO, energy: 0.0 };
        for (weight, at) in instants.into_iter().filter(|i| i.0 > 0.0) {
            let gap = gaps[0] + (1.0 - at) * (gaps[1] - gaps[0]);
            let (pressure, slope) = contact::pressure(gap, plane.stiffness, width);
            t.pressure += weight * pressure;
            t.slopes[0] += weight * at * slope;
            t.slopes[1] += weight * (1.0 - at) * slope;
            t.lever += weight * slope * (new + (1.0 - at) * (old - new));
            t.energy += weight / at * contact::energy(gap, plane.stiffness, width);
        }
        (t.energy > 0.0).then_some((patch, t))
    })
}

impl<'a> Contact<'a> {
    fn touches<'s>(&self, plane: &'s PlaneNow, u1: &'s [DVec3]) -> impl Iterator<Item = (&'s Patch, Touch<'s>)>
    where
        'a: 's,
    {
        touches(&self.c.plan.body, plane, self.c.weights.new, [u1, self.c.past.u])
    }

    fn force(&self, u1: &[DVec3], out: &mut [DVec3]) {
        for plane in self.c.planes {
            for (_, t) in self.touches(plane, u1) {
                t.add(t.pressure * plane.normal[0], out);
            }
        }
    }

    /// Adds the derivative by the old state, times `d`; symmetric.
    fn old_product(&self, u1: &[DVec3], d: &[DVec3], out: &mut [DVec3]) {
        if !contact::acts_along(self.c.weights.new) {
            return;
        }
        for plane in self.c.planes {
            let n = plane.normal[0];
            for (_, t) in self.touches(plane, u1) {
                t.add(t.slopes[1] * n.dot(t.place.at(d)) * n, out);
            }
        }
    }
}

impl Term for Contact<'_> {
    fn residual(&mut self, u1: &[DVec3], out: &mut [DVec3]) {
        self.force(u1, out);
    }

    fn potential(&self, u1: &[DVec3]) -> f64 {
        let of = |plane: &PlaneNow| self.touches(plane, u1).map(|(_, t)| t.area * t.energy).sum::<f64>();
        self.c.planes.iter().map(of).sum()
    }

    fn tangent(&self, u1: &[DVec3], _curvature: Curvature, matrix: &mut Matrix) {
        for plane in self.c.planes {
            let n = plane.normal[0];
            let nn = DMat3::from_cols(n * n.x, n * n.y, n * n.z);
            for (_, t) in self.touches(plane, u1) {
                let w = t.place.value;
                for (b, place) in self.c.places.patches.of(t.patch).iter().enumerate() {
                    let both = w[b / w.len()] * w[b % w.len()];
                    matrix.values[*place as usize] += nn * (-t.area * t.slopes[0] * both);
                }
            }
        }
    }

    fn by_past(&self, u1: &[DVec3], change: &PastChange, out: &mut [DVec3]) {
        self.old_product(u1, change.u, out);
    }

    fn by_past_transposed(&self, u1: &[DVec3], z: &[DVec3], out: &mut PastGradient) {
        self.old_product(u1, z, &mut out.u);
    }

    fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        let ln_young = rates.physics.youngs_modulus / self.c.physics().youngs_modulus;
        for (plane, [height, theta, phi]) in self.c.planes.iter().zip(&rates.physics.planes) {
            let stiffer = if plane.scales { ln_young } else { 0.0 };
            let n = plane.normal[0];
            let turned = *theta * plane.normal[1] + *phi * plane.normal[2];
            if stiffer == 0.0 && *height == 0.0 && *theta == 0.0 && *phi == 0.0 {
                continue;
            }
            for (_, t) in self.touches(plane, u1) {
                let pressure = stiffer * t.pressure - height * (t.slopes[0] + t.slopes[1]) + turned.dot(t.lever);
                t.add(pressure * n + t.pressure * turned, out);
            }
        }
    }

    fn by_coefficients_transposed(&self, u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        if !sought.planes && !sought.modulus {
            return;
        }
        for (plane, g) in self.c.planes.iter().zip(&mut gradient.physics.planes) {
            let [n, by_theta, by_phi] = plane.normal;
            for (_, t) in self.touches(plane, u1) {
                let z = -t.area * t.place.at(z);
                let along = z.dot(n);
                if plane.scales {
                    gradient.physics.youngs_modulus += t.pressure / self.c.physics().youngs_modulus * along;
                }
                g[0] -= (t.slopes[0] + t.slopes[1]) * along;
                for (g, dn) in g[1..].iter_mut().zip([by_theta, by_phi]) {
                    *g += dn.dot(t.lever) * along + t.pressure * dn.dot(z);
                }
            }
        }
    }

    fn forces(&self, u1: &[DVec3], out: &mut Forces) {
        self.force(u1, &mut out.supports);
    }
}
