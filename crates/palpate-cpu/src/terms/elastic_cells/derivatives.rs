//! Derivatives of the cells' force by the past and by the coefficients, each with its transpose.
//!
//! A body-frame force y acts on the corners as Pᵀy, and P turns a motion of the corners into a change of q; so every transpose is the same
//! chain read backwards.

use super::{Corners, ElasticCells, dot24, pick, times};
use glam::DVec3;
use palpate_model::cutcells::corotation::V24;
use palpate_model::params::coefficients::{Coefficients, Sought};

/// Derivatives of z · force of one cell.
#[derive(Clone, Copy, Default)]
struct Pull {
    /// By the logarithm of its modulus.
    ln_young: f64,
    poisson: f64,
    /// By its own stiffness damping.
    stiffness_damping: f64,
}

impl ElasticCells<'_> {
    /// Adds the symmetric derivative of the old state's own force, times `d`.
    #[inline(always)]
    fn add_own(&self, e: usize, u: &[DVec3], d: &Corners, out: &mut Corners) {
        let old = self.cells.c.weights.old;
        if old == 0.0 {
            return;
        }
        let (pose, k, scale) = (self.cells.pose(e, u), self.cells.stiffness(e), self.cells.young_of(e) * old);
        let own = pose.hessian_product(k, scale, &times(k, &pose.q, scale), d);
        out.iter_mut().zip(own).for_each(|(f, g)| *f += g);
    }

    /// Adds the derivative along a change `d` of past state `i`.
    pub(super) fn along_past(&self, i: usize, d: &[DVec3], out: &mut [DVec3]) {
        let (cells, (weight, u)) = (&self.cells, self.cells.c.past.each[i]);
        if !cells.c.weights.sees_past() {
            return;
        }
        cells.gather(
            #[inline(always)]
            |e| {
                let b = cells.c.weights_of(e).factors().1 * weight;
                let d = pick(cells.body(), e, d);
                let rate = times(cells.stiffness(e), &cells.pose(e, u).strain_rate(&d), cells.young_of(e) * b);
                let mut f = self.posed[e].pose.force(&rate);
                self.add_own(e, u, &d, &mut f);
                f
            },
            out,
        );
    }

    /// Its transpose.
    pub(super) fn pull_past(&self, i: usize, z: &[DVec3], out: &mut [DVec3]) {
        let (cells, (weight, u)) = (&self.cells, self.cells.c.past.each[i]);
        if !cells.c.weights.sees_past() {
            return;
        }
        cells.gather(
            #[inline(always)]
            |e| {
                let b = cells.c.weights_of(e).factors().1 * weight;
                let z = pick(cells.body(), e, z);
                let rate = times(cells.stiffness(e), &self.posed[e].pose.strain_rate(&z), cells.young_of(e) * b);
                let mut f = cells.pose(e, u).force(&rate);
                self.add_own(e, u, &z, &mut f);
                f
            },
            out,
        );
    }

    /// q that the new pose's force is made of: a q₁ + b q̃.
    #[inline(always)]
    fn mixed(&self, e: usize) -> V24 {
        let (a, b) = self.cells.c.weights_of(e).factors();
        let (new, old) = (&self.posed[e].pose.q, self.before.q.get(e).unwrap_or(&[0.0; 24]));
        std::array::from_fn(|i| a * new[i] + b * old[i])
    }

    /// q₁ − q̃.
    #[inline(always)]
    fn way(&self, e: usize) -> V24 {
        // Without damping the past is not kept; it is a single state or many all the same.
        let mut way = self.posed[e].pose.q;
        match self.before.q.get(e) {
            Some(old) => way.iter_mut().zip(old).for_each(|(w, o)| *w -= o),
            None => {
                for (weight, u) in self.cells.c.past.each {
                    way.iter_mut().zip(self.cells.pose(e, u).q).for_each(|(w, o)| *w -= weight * o);
                }
            }
        }
        way
    }

    /// Adds the derivative along a change of the coefficients.
    pub(super) fn along_coefficients(&self, rates: &Coefficients, out: &mut [DVec3]) {
        let (cells, d) = (&self.cells, &rates.physics);
        let ln_young = cells.c.ln_young_along(rates);
        let rate = cells.c.inertia.map_or(0.0, |t| t.rate);
        let undamped = rate == 0.0 || (d.stiffness_damping == 0.0 && rates.changes.damping.is_none());
        let rest = rates.changes.rest.as_deref().filter(|_| cells.c.altered.rest.is_some());
        let still = ln_young == 0.0 && d.poisson_ratio == 0.0 && undamped;
        if still && rest.is_none() && rates.changes.modulus.is_none() {
            return;
        }
        cells.gather(|e| self.cell_along(e, ln_young, rate, rest, rates), out);
    }

    fn cell_along(&self, e: usize, ln_young: f64, rate: f64, rest: Option<&[DVec3]>, rates: &Coefficients) -> Corners {
        let (cells, posed, k, young) = (&self.cells, &self.posed[e], self.cells.stiffness(e), self.cells.young_of(e));
        let (weights, by_nu) = (&cells.c.weights, rates.physics.poisson_ratio);
        let ln = ln_young + cells.c.ln_factor_along(rates, e);
        // Body-frame forces of the new pose and, without its weight, of the old one.
        let mut new = posed.stress.map(|y| ln * y);
        let mut old = [0.0; 24];
        let before = (weights.old != 0.0).then(|| cells.pose(e, cells.c.past.u));
        let add = |to: &mut V24, y: V24| to.iter_mut().zip(y).for_each(|(t, y)| *t += y);
        if by_nu != 0.0 {
            add(&mut new, times(cells.by_poisson(e), &self.mixed(e), young * by_nu));
        }
        let damping = rate * cells.c.damping_along(rates, e);
        if damping != 0.0 {
            add(&mut new, times(k, &self.way(e), young * damping));
        }
        if let Some(before) = &before {
            old = times(k, &before.q, young * ln);
            if by_nu != 0.0 {
                add(&mut old, times(cells.by_poisson(e), &before.q, young * by_nu));
            }
        }
        if let (Some(dw), Some(shape)) = (rest, &cells.c.altered.rest) {
            // The rate's part does not see it: all states shift alike.
            let y = times(k, &shape[e].strain_rate(&pick(cells.body(), e, dw)), -young);
            add(&mut new, y.map(|y| weights.new * y));
            add(&mut old, y);
        }
        let mut f = posed.pose.force(&new);
        if let Some(guard) = posed.pose.guard() {
            let scale = ln * cells.guard_scale(e);
            f.iter_mut().zip(guard.force()).for_each(|(f, g)| *f += scale * g);
        }
        if let Some(before) = &before {
            f.iter_mut().zip(before.force(&old)).for_each(|(f, g)| *f += weights.old * g);
        }
        f
    }

    /// Its transpose.
    pub(super) fn pull_coefficients(&self, z: &[DVec3], sought: &Sought, gradient: &mut Coefficients) {
        let (cells, damped) = (&self.cells, sought.damping[1]);
        let rate = cells.c.inertia.map_or(0.0, |t| t.rate);
        if sought.modulus || sought.poisson || (damped && rate != 0.0) {
            let parts = cells.each_cell(
                #[inline(always)]
                |e| self.cell_pull(e, &pick(cells.body(), e, z), sought, rate),
            );
            parts.iter().for_each(|part| gradient.physics.poisson_ratio += part.poisson);
            cells.c.pull_damping(parts.iter().map(|p| p.stiffness_damping).enumerate(), gradient);
            if sought.modulus {
                cells.c.pull_modulus(parts.iter().map(|p| p.ln_young).enumerate(), gradient);
            }
        }
        if let (Some(out), Some(shape)) = (&mut gradient.changes.rest, &cells.c.altered.rest) {
            let weights = &cells.c.weights;
            cells.gather(
                |e| {
                    let z = pick(cells.body(), e, z);
                    let mut s = self.posed[e].pose.strain_rate(&z).map(|s| weights.new * s);
                    if weights.old != 0.0 {
                        let old = cells.pose(e, cells.c.past.u).strain_rate(&z);
                        s.iter_mut().zip(old).for_each(|(s, o)| *s += weights.old * o);
                    }
                    shape[e].force(&times(cells.stiffness(e), &s, -cells.young_of(e)))
                },
                out,
            );
        }
    }

    #[inline(always)]
    fn cell_pull(&self, e: usize, z: &Corners, sought: &Sought, rate: f64) -> Pull {
        let (cells, posed, young) = (&self.cells, &self.posed[e], self.cells.young_of(e));
        let weights = &cells.c.weights;
        let new = posed.pose.strain_rate(z);
        let before = (weights.old != 0.0).then(|| cells.pose(e, cells.c.past.u));
        let old = before.as_ref().map(|b| (b, b.strain_rate(z)));
        let mut pull = Pull { ln_young: z.iter().zip(&posed.force).map(|(z, f)| z.dot(*f)).sum(), ..Pull::default() };
        if let Some((before, z)) = &old {
            pull.ln_young += weights.old * young * dot24(z, &times(cells.stiffness(e), &before.q, 1.0));
        }
        if sought.poisson {
            let by_nu = cells.by_poisson(e);
            pull.poisson = dot24(&new, &times(by_nu, &self.mixed(e), young));
            if let Some((before, z)) = &old {
                pull.poisson += weights.old * young * dot24(z, &times(by_nu, &before.q, 1.0));
            }
        }
        if sought.damping[1] && rate != 0.0 {
            pull.stiffness_damping = dot24(&new, &times(cells.stiffness(e), &self.way(e), young * rate));
        }
        pull
    }
}
