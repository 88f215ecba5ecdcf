//! Effects that act on points (nodes, surface patches, patches at planes).
//!
//! The loop knows no effect by name: a law gives a potential and its derivatives at one point
//! ([`palpate_model::effects::law`]), this file spreads them over the nodes.

use super::products::Parts;
use super::{Context, Curvature, Forces, PastChange, PastGradient, Term};
use crate::linear::matrix::Matrix;
use glam::{DMat3, DVec3};
use palpate_model::effects::driven::DrivenSites;
use palpate_model::effects::law::{Asks, COMMON, Followed, GRAVITY, MOST, OLD, PLANE, Place, Point, STIFFNESS, TIME, VELOCITY};
use palpate_model::effects::{Law, Site};
use palpate_model::mechanics::contact;
use palpate_model::mechanics::normal::Turned;
use palpate_model::mechanics::path::Path;
use palpate_model::mechanics::plane::PlaneNow;
use palpate_model::params::coefficients::{Coefficients, Sought};
use palpate_model::plan::{Physics, Plan};
use palpate_model::space::stencil::Stencil;
use std::sync::Arc;

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
    /// What it follows.
    path: Option<Arc<Path>>,
    /// What drives it, and the number of the effect, by which the places of its points are found.
    driven: Option<(usize, Arc<DrivenSites>)>,
}

impl std::fmt::Debug for Acting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {:?}", self.law.kind, self.values)
    }
}

/// The effects of a member.
pub fn acting(plan: &Plan, physics: &Physics) -> Vec<Acting> {
    let make = |(number, ((law, _), values)): (usize, ((&'static Law, _), &Vec<f64>))| {
        let shares = match law.site {
            Site::Nodes(point) => point.shares(&plan.body.nodes, &plan.body.node_volume, values),
            _ => None,
        };
        let path = plan.followed.get(number).cloned().flatten();
        let driven = plan.driven.get(number).cloned().flatten().map(|sites| (number, sites));
        Acting { law, values: values.clone(), shares, absent: law.is_absent(values), path, driven }
    };
    plan.layout.effects().zip(&physics.effects).enumerate().map(make).collect()
}

/// One point that an effect acts on, at one instant.
struct At<'a> {
    point: &'static dyn Point,
    place: Place,
    z: &'a [f64],
    stencil: Stencil<'a>,
    /// Node number for effects of nodes.
    node: usize,
    /// Number of the patch for effects of the surface.
    patch: Option<usize>,
    /// Numbers of effect and point for effects of driven points.
    driven: Option<(usize, usize)>,
    /// Number of the plane for effects of contact.
    plane: Option<usize>,
    /// How the body deforms there, and the normal in the old state, of laws that ask for it.
    turned: Option<(Stencil<'a>, Turned)>,
}

impl At<'_> {
    fn mean(&self, v: &[DVec3]) -> DVec3 {
        self.stencil.at(v)
    }

    fn add(&self, f: [f64; 3], out: &mut [DVec3]) {
        self.stencil.spread(DVec3::from_array(f), out);
    }

    /// Change of the old normal for a change of the past displacement; zero where nobody asks for it.
    fn normal_along(&self, u: &[DVec3]) -> DVec3 {
        self.turned.as_ref().map_or(DVec3::ZERO, |(frame, turned)| turned.along(frame.gradient_of(u)))
    }

    /// Its transpose, for derivatives `w` by the normal.
    fn pull_normal(&self, w: DVec3, out: &mut [DVec3]) {
        let Some((frame, turned)) = &self.turned else { return };
        let by_f = turned.pull(w);
        for (n, g) in frame.nodes.iter().zip(frame.gradient) {
            out[*n as usize] += by_f * *g;
        }
    }
}

fn put(z: &mut [f64], at: usize, v: DVec3) {
    z[at..at + 3].copy_from_slice(&v.to_array());
}

/// The term.
pub struct PointLaws<'a> {
    /// What it reads.
    pub c: Context<'a>,
}

impl<'a> PointLaws<'a> {
    /// The effects that do something.
    fn present(&self) -> impl Iterator<Item = &'a Acting> + use<'a> {
        self.c.effects.iter().filter(|a| !a.absent)
    }

    /// Those whose force depends on a state.
    fn felt(&self) -> impl Iterator<Item = &'a Acting> + use<'a> {
        self.present().filter(|a| !a.law.is_load())
    }

    /// Visits every point of an effect that is not idle.
    fn points(&self, acting: &Acting, u1: &[DVec3], mut visit: impl FnMut(&At)) {
        let (body, k, past) = (&self.c.plan.body, acting.values.len(), &self.c.past);
        let mut z = [0.0; COMMON + MOST];
        let z = &mut z[..COMMON + k];
        z[COMMON..].copy_from_slice(&acting.values);
        put(z, GRAVITY, self.c.physics().gravity);
        z[TIME] = self.c.time;
        z[STIFFNESS] = contact::DEFAULT_STIFFNESS * self.c.physics().youngs_modulus / body.length;
        let rate = self.c.inertia.map_or(0.0, |t| t.rate);
        let place = Place {
            rest: DVec3::ZERO,
            normal: DVec3::ZERO,
            measure: 0.0,
            width: contact::WIDTH * body.length,
            rate,
            inertia: self.c.inertia.map_or(0.0, |t| t.displacement),
            momentum: self.c.inertia.map_or(0.0, |t| t.velocity),
            followed: acting.path.as_ref().map_or(Followed::default(), |path| Followed::of(path, self.c.time, rate)),
        };
        let mut patches = |point: &'static dyn Point, plane: Option<(usize, &PlaneNow)>, z: &mut [f64]| {
            for (number, (patch, stencil)) in body.patches.iter().zip(body.surface.iter()).enumerate() {
                let at = |v: &[DVec3]| stencil.at(v);
                put(z, 0, patch.point + at(u1));
                put(z, OLD, patch.point + at(past.u));
                put(z, VELOCITY, at(past.v));
                let turned = (point.asks() == Asks::Normal).then(|| {
                    let frame = self.c.plan.frames.get(number);
                    (frame, Turned::new(patch.normal, DMat3::IDENTITY + frame.gradient_of(past.u)))
                });
                turned.iter().for_each(|t| put(z, PLANE, t.1.normal));
                let place = Place { rest: patch.point, normal: patch.normal, measure: patch.area, ..place };
                if !point.skips(&place, z) {
                    let (plane, patch) = (plane.map(|p| p.0), Some(number));
                    visit(&At { point, place, z, stencil, node: 0, patch, driven: None, plane, turned });
                }
            }
        };
        match acting.law.site {
            Site::Surface(point) | Site::Nodes(point) if point.sleeps(&place, z) => {}
            Site::Surface(point) => patches(point, None, z),
            Site::Contact(point) => {
                for (i, plane) in self.c.planes.iter().enumerate() {
                    put(z, PLANE, plane.normal[0]);
                    (z[PLANE + 3], z[PLANE + 4]) = (plane.height, plane.stiffness);
                    patches(point, Some((i, plane)), z);
                }
            }
            Site::Nodes(point) => {
                for (i, x) in body.nodes.iter().enumerate() {
                    put(z, 0, *x + u1[i]);
                    put(z, OLD, *x + past.u[i]);
                    put(z, VELOCITY, past.v[i]);
                    let measure = acting.shares.as_ref().map_or(body.node_volume[i], |s| s.0[i]);
                    let place = Place { rest: *x, measure, ..place };
                    if !point.skips(&place, z) {
                        let stencil = Stencil { nodes: &[i as u32], value: &[1.0], gradient: &[] };
                        visit(&At { point, place, z, stencil, node: i, patch: None, driven: None, plane: None, turned: None });
                    }
                }
            }
            Site::Driven(point) => {
                let Some((effect, sites)) = &acting.driven else { return };
                for (number, (stencil, rest)) in sites.stencils.iter().zip(&sites.rest).enumerate() {
                    let mut followed = Followed::of_series(&sites.series, number, self.c.time, rate);
                    if place.theta() == 1.0 {
                        // The old state's force has no weight, and need not be known.
                        followed.old = followed.new;
                    }
                    // A point that is not seen at one of these times is left alone.
                    if followed.new[0].is_nan() || followed.old[0].is_nan() {
                        continue;
                    }
                    put(z, 0, *rest + stencil.at(u1));
                    put(z, OLD, *rest + stencil.at(past.u));
                    put(z, VELOCITY, stencil.at(past.v));
                    let place = Place { rest: *rest, measure: 1.0, followed, ..place };
                    let driven = Some((*effect, number));
                    visit(&At { point, place, z, stencil, node: 0, patch: None, driven, plane: None, turned: None });
                }
            }
            // Everything else does not act on points.
            _ => {}
        }
    }

    /// Adds the effects' forces.
    fn force(&self, u1: &[DVec3], out: &mut [DVec3]) {
        for a in self.present() {
            self.points(a, u1, |at| at.add(at.point.gradient(&at.place, at.z), out));
        }
    }

    /// Change of a point's input along `rates`, but for the effect's own numbers; false where there is none.
    fn input_along(&self, rates: &Coefficients, plane: Option<usize>, d: &mut [f64]) -> bool {
        let p = &rates.physics;
        put(d, GRAVITY, p.gravity);
        d[TIME] = p.start;
        d[STIFFNESS] = self.stiffness_by_young() * p.youngs_modulus;
        if let Some(i) = plane {
            let (now, [height, theta, phi]) = (&self.c.planes[i], p.planes[i]);
            put(d, PLANE, theta * now.normal[1] + phi * now.normal[2]);
            d[PLANE + 3] = height;
            d[PLANE + 4] = if now.scales { d[STIFFNESS] } else { 0.0 };
        }
        d[GRAVITY..COMMON].iter().any(|v| *v != 0.0)
    }

    /// Default contact stiffness per Pa of Young's modulus [1/m].
    fn stiffness_by_young(&self) -> f64 {
        contact::DEFAULT_STIFFNESS / self.c.plan.body.length
    }

    /// Adds what derivatives by a point's input, from GRAVITY on, make of the coefficients.
    fn pull_input(&self, plane: Option<usize>, by: &[f64], gradient: &mut Coefficients) {
        let (p, at) = (&mut gradient.physics, |k: usize| by[k - GRAVITY]);
        p.gravity += DVec3::from_slice(&by[..3]);
        p.start += at(TIME);
        p.youngs_modulus += self.stiffness_by_young() * at(STIFFNESS);
        if let Some(i) = plane {
            let now = &self.c.planes[i];
            let by_normal = DVec3::new(at(PLANE), at(PLANE + 1), at(PLANE + 2));
            p.planes[i][0] += at(PLANE + 3);
            p.planes[i][1] += by_normal.dot(now.normal[1]);
            p.planes[i][2] += by_normal.dot(now.normal[2]);
            if now.scales {
                p.youngs_modulus += self.stiffness_by_young() * at(PLANE + 4);
            }
        }
    }
}

impl Term for PointLaws<'_> {
    fn residual(&mut self, u1: &[DVec3], out: &mut [DVec3]) {
        self.force(u1, out);
    }

    fn potential(&self, u1: &[DVec3]) -> f64 {
        let mut w = 0.0;
        for a in self.present() {
            self.points(a, u1, |at| w += at.point.value(&at.place, at.z));
        }
        w
    }

    fn tangent(&self, u1: &[DVec3], curvature: Curvature, matrix: &mut Matrix) {
        for a in self.felt() {
            self.points(a, u1, |at| {
                let h = at.point.hessian(&at.place, at.z);
                let h = DMat3::from_cols_array_2d(&h);
                if !curvature.keeps() && !positive(h) {
                    return;
                }
                let places = match (at.patch, at.driven) {
                    (Some(patch), _) => self.c.places.patches.of(patch),
                    (None, Some((effect, number))) => self.c.places.driven[effect].of(number),
                    (None, None) => {
                        matrix.values[self.c.pattern.blocks.diagonal[at.node]] += h;
                        return;
                    }
                };
                let w = at.stencil.value;
                for (b, place) in places.iter().enumerate() {
                    matrix.values[*place as usize] += h * (w[b / w.len()] * w[b % w.len()]);
                }
            });
        }
    }

    fn products<'b>(&'b self, _u1: &[DVec3]) -> Parts<'b> {
        // Loads are the same wherever the body is.
        if self.felt().next().is_none() { Parts::Nothing } else { Parts::Matrix }
    }

    fn by_past(&self, u1: &[DVec3], change: &PastChange, out: &mut [DVec3]) {
        let mut d = [0.0; COMMON + MOST];
        for a in self.felt() {
            self.points(a, u1, |at| {
                put(&mut d, OLD, at.mean(change.u));
                put(&mut d, VELOCITY, at.mean(change.v));
                put(&mut d, PLANE, at.normal_along(change.u));
                at.add(at.point.along(&at.place, at.z, &d), out);
            });
        }
    }

    fn by_past_transposed(&self, u1: &[DVec3], z: &[DVec3], out: &mut PastGradient) {
        for a in self.felt() {
            self.points(a, u1, |at| {
                let (mut row, w) = ([0.0; 6], at.mean(z).to_array());
                at.point.transposed(&at.place, at.z, w, OLD..OLD + 6, &mut row);
                at.add([row[0], row[1], row[2]], &mut out.u);
                at.add([row[3], row[4], row[5]], &mut out.v);
                if at.turned.is_some() {
                    let mut by_normal = [0.0; 3];
                    at.point.transposed(&at.place, at.z, w, PLANE..PLANE + 3, &mut by_normal);
                    at.pull_normal(DVec3::from_array(by_normal), &mut out.u);
                }
            });
        }
    }

    fn by_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        let p = &rates.physics;
        let planes = p.planes.iter().flatten().any(|r| *r != 0.0);
        let inputs = planes || p.gravity != DVec3::ZERO || p.start != 0.0 || p.youngs_modulus != 0.0;
        for (a, numbers) in self.c.effects.iter().zip(&p.effects) {
            let own = numbers.iter().any(|r| *r != 0.0);
            if !own && (a.absent || !inputs) {
                continue;
            }
            self.points(a, u1, |at| {
                let mut d = [0.0; COMMON + MOST];
                d[COMMON..COMMON + numbers.len()].copy_from_slice(numbers);
                let common = !a.absent && self.input_along(rates, at.plane, &mut d);
                if !common && !own {
                    return;
                }
                if let (true, Some((_, slopes))) = (own, &a.shares) {
                    // Potentials are proportional to their measure.
                    let measure = slopes.iter().zip(numbers).map(|(s, r)| r * s[at.node]).sum();
                    at.add(at.point.gradient(&Place { measure, ..at.place }, at.z), out);
                }
                at.add(at.point.along(&at.place, at.z, &d), out);
            });
        }
    }

    fn by_coefficients_transposed(&self, u1: &[DVec3], z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        let common = sought.gravity || sought.start || sought.planes || sought.modulus;
        for (e, a) in self.c.effects.iter().enumerate() {
            let (own, common) = (sought.effects[e], common && !a.absent);
            if !own && !common {
                continue;
            }
            self.points(a, u1, |at| {
                let w = at.mean(z).to_array();
                let mut by = [0.0; COMMON + MOST];
                if common {
                    at.point.transposed(&at.place, at.z, w, GRAVITY..COMMON, &mut by[GRAVITY..COMMON]);
                    self.pull_input(at.plane, &by[GRAVITY..COMMON], gradient);
                }
                if !own {
                    return;
                }
                let numbers = &mut gradient.physics.effects[e];
                at.point.transposed(&at.place, at.z, w, COMMON..COMMON + numbers.len(), &mut by[COMMON..]);
                numbers.iter_mut().zip(&by[COMMON..]).for_each(|(g, b)| *g += b);
                if let Some((_, slopes)) = &a.shares {
                    // Potentials are proportional to their measure.
                    let unit = at.point.gradient(&Place { measure: 1.0, ..at.place }, at.z);
                    let work: f64 = w.iter().zip(unit).map(|(w, f)| w * f).sum();
                    numbers.iter_mut().zip(slopes).for_each(|(g, s)| *g += s[at.node] * work);
                }
            });
        }
    }

    fn forces(&self, u1: &[DVec3], out: &mut Forces) {
        self.force(u1, &mut out.supports);
    }
}

/// True for a positive semi-definite symmetric matrix (leading minors, with room for rounding).
fn positive(h: DMat3) -> bool {
    let size = h.x_axis.x.abs().max(h.y_axis.y.abs()).max(h.z_axis.z.abs());
    let minor = h.x_axis.x * h.y_axis.y - h.x_axis.y * h.x_axis.y;
    h.x_axis.x >= -1e-12 * size && minor >= -1e-12 * size * size && h.determinant() >= -1e-12 * size.powi(3)
}
