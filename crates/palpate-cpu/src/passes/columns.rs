//! Derivatives of the balance by its parameters, one column each.

use crate::linear::vector::Nodes;
use crate::passes::balance::{Balance, States};
use crate::passes::cells::{Matrices, Mix, zeros};
use crate::passes::supports::{self, PlaneNow};
use glam::DVec3;
use palpate_model::params::ParamKey;

impl<'a> Balance<'a> {
    /// ∂r/∂p at fixed states, or `None` when the residual does not depend on p.
    pub fn column(&self, key: ParamKey, s: States<'a>) -> Option<Nodes> {
        let n = s.u1.len();
        let mut out = zeros(n);
        let young = self.physics.youngs_modulus;
        let elements = self.elements;
        match key {
            ParamKey::YoungsModulus | ParamKey::PoissonRatio => {
                let (which, factor, shear) = match key {
                    ParamKey::YoungsModulus => (Matrices::Stiffness, self.aging(), elements.shear[0]),
                    _ => (Matrices::ByPoisson, self.young(), young * elements.shear[1]),
                };
                self.elasticity().force(&self.mix, which, factor, s.u1, s.u0, &mut out);
                match (self.materials(), which) {
                    (Some(m), Matrices::Stiffness) => m.force(factor, s.u1, s.u0, &mut out),
                    (Some(m), Matrices::ByPoisson) => m.poisson_column(s.u1, s.u0, &mut out),
                    (None, _) => {}
                }
                self.ghost(shear, &self.mix, s, &mut out);
                self.clamps(which, factor, 0.0, s, &mut out);
                if which == Matrices::Stiffness {
                    for plane in self.planes.iter().filter(|p| p.scales) {
                        self.contact_column(plane, s, |t| (t.pressure / young) * plane.normal[0], &mut out);
                    }
                }
            }
            ParamKey::Density => {
                let rho = self.physics.density;
                let g = self.physics.gravity;
                let drag = self.physics.mass_damping;
                let acceleration = |i: usize| match self.inertia {
                    None => -g,
                    Some(t) => (t.displacement + drag * t.rate) * (s.u1[i] - s.u0[i]) - t.velocity * s.v0[i] - g,
                };
                self.masses(|i| acceleration(i) / rho, |_| DVec3::ZERO, &mut out);
            }
            ParamKey::MassDamping => {
                let t = self.inertia?;
                self.masses(|i| t.rate * (s.u1[i] - s.u0[i]), |_| DVec3::ZERO, &mut out);
            }
            ParamKey::StiffnessDamping => {
                let t = self.inertia?;
                let mix = Mix { new: 0.0, old: 0.0, rate: t.rate };
                self.elasticity().force(&mix, Matrices::Stiffness, self.young(), s.u1, s.u0, &mut out);
                self.ghost(young * elements.shear[0], &mix, s, &mut out);
            }
            ParamKey::Gravity(a) => self.masses(|_| -DVec3::AXES[a as usize], |_| -DVec3::AXES[a as usize], &mut out),
            ParamKey::PointMass(k) => {
                let site = &self.plan.masses[k as usize];
                let g = self.physics.gravity;
                let mut a = -g;
                if let Some(t) = self.inertia {
                    for i in 0..8 {
                        let m = site.nodes[i] as usize;
                        a += site.weights[i] * (t.displacement * (s.u1[m] - s.u0[m]) - t.velocity * s.v0[m]);
                    }
                }
                for i in 0..8 {
                    out[site.nodes[i] as usize] += site.weights[i] * a;
                }
            }
            ParamKey::PlaneHeight(k) => {
                let plane = &self.planes[k as usize];
                self.contact_column(plane, s, |t| -(t.slopes[0] + t.slopes[1]) * plane.normal[0], &mut out);
            }
            ParamKey::PlaneTheta(k) | ParamKey::PlanePhi(k) => {
                let plane = &self.planes[k as usize];
                let dn = plane.normal[if matches!(key, ParamKey::PlaneTheta(_)) { 1 } else { 2 }];
                self.contact_column(plane, s, |t| dn.dot(t.lever) * plane.normal[0] + t.pressure * dn, &mut out);
            }
            ParamKey::TimeStart => {
                let moving = self.plan.clamps.iter().any(|c| c.motion.is_some());
                if !moving && self.effects.is_empty() {
                    return None;
                }
                // The prescribed motion is a smooth curve: central differences over a microsecond leave about 1e-10.
                let d = 1e-6;
                for sign in [1.0, -1.0].into_iter().filter(|_| moving) {
                    self.clamps(Matrices::Stiffness, sign * self.young() / (2.0 * d), sign * d, s, &mut out);
                }
            }
            ParamKey::Effect { effect, slot, .. } => {
                self.add_altered_column(usize::from(effect), usize::from(slot), s, &mut out);
            }
            ParamKey::Velocity(_) | ParamKey::AngularVelocity(_) => return None,
        }
        self.add_effects_column(key, s, &mut out);
        Some(out)
    }

    /// Adds −area · weight · f(touch) over the patches that touch a plane.
    fn contact_column(&self, plane: &'a PlaneNow, s: States<'a>, f: impl Fn(&supports::Touch) -> DVec3, out: &mut [DVec3]) {
        for (_, t) in self.contact(plane, s).touches() {
            let v = t.area * f(&t);
            for i in 0..8 {
                out[t.nodes[i] as usize] -= t.weights[i] * v;
            }
        }
    }
}
