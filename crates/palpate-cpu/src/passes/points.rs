//! Effects that act on points (nodes, surface patches, patches at planes): their share of every term of the balance.
//!
//! The loop knows no effect by name: a law gives a potential and its derivatives at one point
//! ([`palpate_model::effects::law`]), this file spreads them over the nodes.

use crate::linear::matrix::Matrix;
use crate::passes::balance::{Balance, States};
use crate::passes::supports::PlaneNow;
use glam::{DMat3, DVec3};
use palpate_model::effects::law::{COMMON, GRAVITY, MOST, OLD, PLANE, Place, Point, STIFFNESS, TIME, VELOCITY};
use palpate_model::effects::{Law, Site};
use palpate_model::mechanics::contact;
use palpate_model::params::ParamKey;
use palpate_model::plan::{Physics, Plan};

/// An effect of one member with its parameters, ready to act.
#[derive(Clone)]
pub struct Acting {
    law: &'static Law,
    /// Parameters `[K]`.
    values: Vec<f64>,
    /// Shares of the nodes and their derivatives by the parameters, `[N]` and `[K, N]`, for laws that share one load.
    shares: Option<(Vec<f64>, Vec<Vec<f64>>)>,
    /// It does nothing with these parameters; only derivatives by its amplitudes are not zero.
    absent: bool,
}

impl std::fmt::Debug for Acting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {:?}", self.law.kind, self.values)
    }
}

/// The effects of a member.
pub fn acting(plan: &Plan, physics: &Physics) -> Vec<Acting> {
    let make = |((law, _), values): ((&'static Law, _), &Vec<f64>)| {
        let shares = match law.site {
            Site::Nodes(point) => point.shares(&plan.body.nodes, &plan.body.node_volume, values),
            _ => None,
        };
        Acting { law, values: values.clone(), shares, absent: law.is_absent(values) }
    };
    plan.layout.effects().zip(&physics.effects).map(make).collect()
}

/// One point that an effect acts on, at one instant.
struct At<'a> {
    point: &'static dyn Point,
    place: Place,
    z: &'a [f64],
    nodes: &'a [u32],
    weights: &'a [f64],
    /// Node number for effects of nodes.
    node: usize,
    /// Cell of the patch.
    cell: Option<usize>,
    /// Number of the plane for effects of contact.
    plane: Option<usize>,
}

impl At<'_> {
    fn mean(&self, v: &[DVec3]) -> DVec3 {
        self.nodes.iter().zip(self.weights).map(|(n, w)| *w * v[*n as usize]).sum()
    }

    fn add(&self, f: [f64; 3], out: &mut [DVec3]) {
        let f = DVec3::from_array(f);
        for (n, w) in self.nodes.iter().zip(self.weights) {
            out[*n as usize] += *w * f;
        }
    }
}

fn put(z: &mut [f64], at: usize, v: DVec3) {
    z[at..at + 3].copy_from_slice(&v.to_array());
}

impl<'a> Balance<'a> {
    /// The effects that do something.
    fn present(&self) -> impl Iterator<Item = &'a Acting> {
        self.effects.iter().filter(|a| !a.absent)
    }

    /// Visits every point of an effect that is not idle.
    fn points(&self, acting: &Acting, s: States, mut visit: impl FnMut(&At)) {
        let (body, k) = (&self.plan.body, acting.values.len());
        let mut z = [0.0; COMMON + MOST];
        let z = &mut z[..COMMON + k];
        z[COMMON..].copy_from_slice(&acting.values);
        put(z, GRAVITY, self.physics.gravity);
        z[TIME] = self.time;
        z[STIFFNESS] = contact::DEFAULT_STIFFNESS * self.physics.youngs_modulus / body.grid.h;
        let place = Place {
            rest: DVec3::ZERO,
            normal: DVec3::ZERO,
            measure: 0.0,
            width: contact::WIDTH * body.grid.h,
            rate: self.inertia.map_or(0.0, |t| t.rate),
            inertia: self.inertia.map_or(0.0, |t| t.displacement),
            momentum: self.inertia.map_or(0.0, |t| t.velocity),
        };
        let mut patches = |point: &'static dyn Point, plane: Option<(usize, &PlaneNow)>, z: &mut [f64]| {
            for patch in &body.patches {
                let nodes = &body.cells[patch.cell as usize].nodes;
                let at = |v: &[DVec3]| -> DVec3 { (0..8).map(|i| patch.weights[i] * v[nodes[i] as usize]).sum() };
                put(z, 0, patch.point + at(s.u1));
                put(z, OLD, patch.point + at(s.u0));
                put(z, VELOCITY, at(s.v0));
                let place = Place { rest: patch.point, normal: patch.normal, measure: patch.area, ..place };
                if !point.skips(&place, z) {
                    let (plane, cell) = (plane.map(|p| p.0), Some(patch.cell as usize));
                    visit(&At { point, place, z, nodes, weights: &patch.weights, node: 0, cell, plane });
                }
            }
        };
        match acting.law.site {
            Site::Surface(point) => patches(point, None, z),
            Site::Contact(point) => {
                for (i, plane) in self.planes.iter().enumerate() {
                    put(z, PLANE, plane.normal[0]);
                    (z[PLANE + 3], z[PLANE + 4]) = (plane.height, plane.stiffness);
                    patches(point, Some((i, plane)), z);
                }
            }
            Site::Nodes(point) => {
                for (i, x) in body.nodes.iter().enumerate() {
                    put(z, 0, *x + s.u1[i]);
                    put(z, OLD, *x + s.u0[i]);
                    put(z, VELOCITY, s.v0[i]);
                    let measure = acting.shares.as_ref().map_or(body.node_volume[i], |s| s.0[i]);
                    let place = Place { rest: *x, measure, ..place };
                    if !point.skips(&place, z) {
                        visit(&At { point, place, z, nodes: &[i as u32], weights: &[1.0], node: i, cell: None, plane: None });
                    }
                }
            }
            // Everything else does not act on points.
            _ => {}
        }
    }

    /// Adds the effects' part of the residual.
    pub(super) fn add_effects(&self, s: States, out: &mut [DVec3]) {
        for a in self.present() {
            self.points(a, s, |at| at.add(at.point.gradient(&at.place, at.z), out));
        }
    }

    /// The effects' part of the potential [J].
    pub(super) fn effects_potential(&self, s: States) -> f64 {
        let mut w = 0.0;
        for a in self.present() {
            self.points(a, s, |at| w += at.point.value(&at.place, at.z));
        }
        w
    }

    /// Adds the effects' part of ∂r/∂u₁; with `convex`, points where it is not positive are left out.
    pub(super) fn add_effects_tangent(&self, s: States, convex: bool, matrix: &mut Matrix) {
        for a in self.present() {
            self.points(a, s, |at| {
                let h = at.point.hessian(&at.place, at.z);
                let h = DMat3::from_cols_array_2d(&h);
                if convex && !positive(h) {
                    return;
                }
                match at.cell {
                    None => matrix.values[self.pattern.blocks.diagonal[at.node]] += h,
                    Some(cell) => {
                        for b in 0..64 {
                            matrix.values[self.places.cells[cell][b] as usize] += h * (at.weights[b / 8] * at.weights[b % 8]);
                        }
                    }
                }
            });
        }
    }

    /// Adds the effects' part of (∂r/∂u₀) du₀ + (∂r/∂v₀) dv₀.
    pub(super) fn add_effects_by_old(&self, s: States, du0: &[DVec3], dv0: &[DVec3], out: &mut [DVec3]) {
        let mut d = [0.0; COMMON + MOST];
        for a in self.present() {
            self.points(a, s, |at| {
                put(&mut d, OLD, at.mean(du0));
                put(&mut d, VELOCITY, at.mean(dv0));
                at.add(at.point.along(&at.place, at.z, &d), out);
            });
        }
    }

    /// Adds the effects' part of (∂r/∂u₀)ᵀ z and (∂r/∂v₀)ᵀ z.
    pub(super) fn add_effects_transposed(&self, s: States, z: &[DVec3], to_u: &mut [DVec3], to_v: &mut [DVec3]) {
        for a in self.present() {
            self.points(a, s, |at| {
                let mut row = [0.0; 6];
                at.point.transposed(&at.place, at.z, at.mean(z).to_array(), OLD..OLD + 6, &mut row);
                at.add([row[0], row[1], row[2]], to_u);
                at.add([row[3], row[4], row[5]], to_v);
            });
        }
    }

    /// Adds the effects' part of ∂r/∂p.
    pub(super) fn add_effects_column(&self, key: ParamKey, s: States, out: &mut [DVec3]) {
        for (e, a) in self.effects.iter().enumerate() {
            let own = match key {
                ParamKey::Effect { effect, slot, .. } if usize::from(effect) == e => Some(usize::from(slot)),
                ParamKey::Gravity(_) | ParamKey::YoungsModulus | ParamKey::TimeStart => None,
                ParamKey::PlaneHeight(_) | ParamKey::PlaneTheta(_) | ParamKey::PlanePhi(_) => None,
                _ => continue,
            };
            if own.is_none() && a.absent {
                continue;
            }
            self.points(a, s, |at| {
                let mut d = [0.0; COMMON + MOST];
                if let Some(slot) = own {
                    d[COMMON + slot] = 1.0;
                    if let Some((_, slopes)) = &a.shares {
                        // Potentials are proportional to their measure.
                        let place = Place { measure: slopes[slot][at.node], ..at.place };
                        at.add(at.point.gradient(&place, at.z), out);
                    }
                } else if !self.input_by(key, at.plane, &mut d) {
                    return;
                }
                at.add(at.point.along(&at.place, at.z, &d), out);
            });
        }
    }

    /// Derivative of a point's input by a parameter that is not the effect's own; false when there is none.
    fn input_by(&self, key: ParamKey, plane: Option<usize>, d: &mut [f64]) -> bool {
        let here = plane.map(|i| &self.planes[i]);
        let at = |k: u16| here.filter(|_| plane == Some(usize::from(k)));
        match key {
            ParamKey::Gravity(a) => d[GRAVITY + usize::from(a)] = 1.0,
            ParamKey::YoungsModulus => {
                d[STIFFNESS] = contact::DEFAULT_STIFFNESS / self.plan.body.grid.h;
                if here.is_some_and(|p| p.scales) {
                    d[PLANE + 4] = d[STIFFNESS];
                }
            }
            ParamKey::TimeStart => d[TIME] = 1.0,
            ParamKey::PlaneHeight(k) if at(k).is_some() => d[PLANE + 3] = 1.0,
            ParamKey::PlaneTheta(k) | ParamKey::PlanePhi(k) => {
                let Some(p) = at(k) else { return false };
                put(d, PLANE, p.normal[if matches!(key, ParamKey::PlaneTheta(_)) { 1 } else { 2 }]);
            }
            _ => return false,
        }
        true
    }
}

/// True for a positive semi-definite symmetric matrix (leading minors, with room for rounding).
fn positive(h: DMat3) -> bool {
    let size = h.x_axis.x.abs().max(h.y_axis.y.abs()).max(h.z_axis.z.abs());
    let minor = h.x_axis.x * h.y_axis.y - h.x_axis.y * h.x_axis.y;
    h.x_axis.x >= -1e-12 * size && minor >= -1e-12 * size * size && h.determinant() >= -1e-12 * size.powi(3)
}
