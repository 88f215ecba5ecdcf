//! Derivatives of what cells do beyond linear elasticity, by the past and by the coefficients, each with its transpose.

use super::{CellActing, CellLaws, Corners, LOSS, Local, Part, Side, V24, add, dot, input, multiply, pick};
use glam::DVec3;
use palpate_model::params::coefficients::{Coefficients, Sought};

impl CellLaws<'_> {
    /// Adds the symmetric derivative of the old state's own force by itself, times `d`.
    fn old_own(&self, l: &Local, d: &Corners, out: &mut Corners) {
        let weight = self.cells.c.weights.old;
        let (Some(old), true) = (&l.old, weight != 0.0) else { return };
        let y = l.stress(old, &old.slopes.first);
        let first = old.pose.force(&l.stress_rate(old, &old.pose.strain_rate(d)));
        let second = old.pose.second(&y, d);
        for i in 0..8 {
            out[i] += weight * (first[i] + second[i]);
        }
    }

    /// Adds the derivative along a change `d` of past state `i`.
    pub(in crate::terms::elastic_cells) fn along_past(&self, i: usize, u1: &[DVec3], d: &[DVec3], out: &mut [DVec3]) {
        let (weight, u) = self.cells.c.past.each[i];
        self.cells.gather(
            |e| {
                let (l, d) = (self.local(e, u1), pick(self.cells.body(), e, d));
                let dq = self.cells.pose(e, u).strain_rate(&d).map(|q| weight * q);
                let mut y = l.by_old(&dq);
                self.flow_by_old(e, &l, &dq, &mut y);
                let mut f = l.new.pose.force(&y);
                self.old_own(&l, &d, &mut f);
                f
            },
            out,
        );
    }

    /// Its transpose.
    pub(in crate::terms::elastic_cells) fn pull_past(&self, i: usize, u1: &[DVec3], z: &[DVec3], out: &mut [DVec3]) {
        let (weight, u) = self.cells.c.past.each[i];
        self.cells.gather(
            |e| {
                let (l, z) = (self.local(e, u1), pick(self.cells.body(), e, z));
                let rate = l.new.pose.strain_rate(&z);
                let mut y = l.by_old_transposed(&rate);
                self.flow_by_old(e, &l, &rate, &mut y);
                let mut f = self.cells.pose(e, u).force(&y.map(|y| weight * y));
                self.old_own(&l, &z, &mut f);
                f
            },
            out,
        );
    }

    /// Body-frame forces, of the new pose and, without its weight, of the old one, that number `slot` of an effect changes.
    fn by_number(&self, l: &Local, acting: &CellActing, slot: usize) -> [V24; 2] {
        let by = |part: Part, scalars: &[f64], k: usize| {
            let (z, len) = input(scalars, &acting.p);
            acting.law.slopes(part, &z[..len], k, scalars.len() + slot)[2]
        };
        let energy = |side: &Side| {
            let c = std::array::from_fn(|k| if k < l.n { by(Part::Energy, &side.s, k) } else { 0.0 });
            l.stress(side, &c)
        };
        let mut new = energy(&l.new).map(|v| self.cells.c.weights.new * v);
        if let (Some(old), true) = (&l.old, self.rate > 0.0) {
            let scalars: [f64; LOSS] = [l.d, old.s[0]];
            add(&mut new, l.young * by(self.loss_part(), &scalars, 0), &l.kd);
        }
        [new, l.old.as_ref().map_or([0.0; 24], energy)]
    }

    /// The same by every factor of the material's curves.
    fn by_curves(&self, l: &Local) -> Vec<[V24; 2]> {
        let at = |side: &Side| self.material_by_curves(&side.s).into_iter().map(|c| l.stress(side, &c)).collect::<Vec<V24>>();
        let old = l.old.as_ref().map(at).unwrap_or_default();
        let both = |(k, y): (usize, V24)| [y.map(|v| self.cells.c.weights.new * v), old.get(k).copied().unwrap_or([0.0; 24])];
        at(&l.new).into_iter().enumerate().map(both).collect()
    }

    /// The same by Poisson's ratio.
    fn by_poisson(&self, e: usize, l: &Local) -> [V24; 2] {
        let k_nu = self.cells.by_poisson(e);
        let energy = |side: &Side| {
            let kq = multiply(k_nu, &side.q);
            let a = 0.5 * dot(&side.q, &kq) / l.volume;
            let by_material = self.material_by_poisson(&side.s);
            let c = std::array::from_fn(|k| side.slopes.second[k][0] * a + by_material[k]);
            let mut y = l.stress(side, &c);
            add(&mut y, l.young * side.slopes.first[0], &kq);
            (y, a)
        };
        let mut new = energy(&l.new).0.map(|v| self.cells.c.weights.new * v);
        let old = l.old.as_ref().map(|old| (old, energy(old)));
        if let (Some((old, (_, a0))), true) = (&old, self.lossy()) {
            let dq: V24 = std::array::from_fn(|i| l.new.q[i] - old.q[i]);
            let kd = multiply(k_nu, &dq);
            let d = 0.5 * dot(&dq, &kd) / l.volume;
            add(&mut new, l.young * l.loss.by_d, &kd);
            add(&mut new, l.young * (l.loss.by_dd * d + l.loss.by_da * a0), &l.kd);
        }
        [new, old.map_or([0.0; 24], |(_, (y, _))| y)]
    }

    /// Adds the derivative along a change of the coefficients, by absent laws' own numbers as well.
    pub(in crate::terms::elastic_cells) fn along_coefficients(&self, u1: &[DVec3], rates: &Coefficients, out: &mut [DVec3]) {
        let (d, weights) = (&rates.physics, &self.cells.c.weights);
        let moved = |l: &&CellActing| d.effects[l.effect].iter().any(|r| *r != 0.0);
        let own = self.laws.iter().filter(moved).map(|l| l.law.needs(Part::Energy)).max();
        let ln_young = self.cells.c.ln_young_along(rates);
        let present = self.act();
        let rest = rates.changes.rest.as_deref().filter(|_| self.cells.c.altered.rest.is_some());
        let through = ln_young != 0.0 || d.poisson_ratio != 0.0 || rest.is_some() || rates.changes.modulus.is_some();
        let flow = d.viscosity.filter(|r| self.viscous().is_some() && (r.coefficient != 0.0 || r.exponent != 0.0));
        let curves: Vec<f64> = d.curves.iter().flatten().copied().collect();
        let bent = curves.iter().any(|r| *r != 0.0);
        if own.is_none() && flow.is_none() && !bent && !(present && through) {
            return;
        }
        let n = self.needs().max(own.unwrap_or(0));
        self.cells.gather(
            |e| {
                let l = self.local_with(n, e, u1);
                let (mut new, mut old) = ([0.0; 24], [0.0; 24]);
                let mut sum = |[y, y0]: [V24; 2], scale: f64| {
                    add(&mut new, scale, &y);
                    add(&mut old, scale, &y0);
                };
                let ln = ln_young + self.cells.c.ln_factor_along(rates, e);
                let own = |side: &Side| l.stress(side, &side.slopes.first);
                sum([l.force_new(weights.new), l.old.as_ref().map_or([0.0; 24], own)], ln);
                if d.poisson_ratio != 0.0 {
                    sum(self.by_poisson(e, &l), d.poisson_ratio);
                }
                if bent {
                    self.by_curves(&l).into_iter().zip(&curves).for_each(|(y, rate)| sum(y, *rate));
                }
                if let Some(rates) = &flow {
                    sum([self.flow_along(&l, rates), [0.0; 24]], 1.0);
                }
                for acting in self.laws.iter().filter(moved) {
                    for (slot, rate) in d.effects[acting.effect].iter().enumerate().filter(|(_, r)| **r != 0.0) {
                        sum(self.by_number(&l, acting, slot), *rate);
                    }
                }
                if let (Some(dw), Some(shape)) = (rest, &self.cells.c.altered.rest) {
                    let dq = shape[e].strain_rate(&pick(self.cells.body(), e, dw)).map(|v| -v);
                    let mut y = l.stress_rate(&l.new, &dq).map(|v| weights.new * v);
                    let mut y0 = [0.0; 24];
                    if let Some(old) = &l.old {
                        add(&mut y, l.young * l.loss.by_da * dot(&old.kq, &dq) / l.volume, &l.kd);
                        y0 = l.stress_rate(old, &dq);
                    }
                    sum([y, y0], 1.0);
                }
                l.world(&new, Some((weights.old, old)))
            },
            out,
        );
    }

    /// Its transpose.
    pub(in crate::terms::elastic_cells) fn pull_coefficients(
        &self,
        u1: &[DVec3],
        z: &[DVec3],
        sought: &Sought,
        gradient: &mut Coefficients,
    ) {
        let asked: Vec<&CellActing> = self.laws.iter().filter(|l| sought.effects[l.effect]).collect();
        let present = self.act();
        let through = sought.modulus || sought.poisson || gradient.changes.rest.is_some();
        let flows = sought.viscosity && self.viscous().is_some();
        if !(!asked.is_empty() || flows || sought.curves || present && through) {
            return;
        }
        let n = asked.iter().map(|l| l.law.needs(Part::Energy)).fold(self.needs(), usize::max);
        let weights = self.cells.c.weights;
        let shape = self.cells.c.altered.rest.as_ref().filter(|_| gradient.changes.rest.is_some());
        let parts = self.cells.each_cell(|e| {
            let (l, z) = (self.local_with(n, e, u1), pick(self.cells.body(), e, z));
            let (s1, s0) = (l.new.pose.strain_rate(&z), l.old.as_ref().map_or([0.0; 24], |o| o.pose.strain_rate(&z)));
            let work = |[y, y0]: [V24; 2]| dot(&y, &s1) + weights.old * dot(&y0, &s0);
            let own = |side: &Side| l.stress(side, &side.slopes.first);
            let rest = shape.map(|shape| {
                let mut t = l.stress_rate(&l.new, &s1).map(|v| weights.new * v);
                if let Some(old) = &l.old {
                    add(&mut t, weights.old, &l.stress_rate(old, &s0));
                    add(&mut t, l.young * l.loss.by_da / l.volume * dot(&l.kd, &s1), &old.kq);
                }
                shape[e].force(&t.map(|v| -v))
            });
            LawPull {
                ln_young: work([l.force_new(weights.new), l.old.as_ref().map_or([0.0; 24], own)]),
                poisson: if sought.poisson { work(self.by_poisson(e, &l)) } else { 0.0 },
                curves: if sought.curves { self.by_curves(&l).into_iter().map(work).collect() } else { Vec::new() },
                flow: if flows { self.flow_by_numbers(&l).map(|g| g * dot(&l.flow.kd, &s1)) } else { [0.0; 2] },
                numbers: asked.iter().flat_map(|a| (0..a.p.len()).map(|slot| work(self.by_number(&l, a, slot)))).collect(),
                rest: rest.unwrap_or_default(),
            }
        });
        for part in &parts {
            gradient.physics.poisson_ratio += part.poisson;
            self.cells.c.pull_curves(&part.curves, gradient);
            if let Some(v) = gradient.physics.viscosity.as_mut().filter(|_| flows) {
                v.coefficient += part.flow[0];
                v.exponent += part.flow[1];
            }
            let slots = asked.iter().flat_map(|a| (0..a.p.len()).map(|slot| (a.effect, slot)));
            part.numbers.iter().zip(slots).for_each(|(g, (effect, slot))| gradient.physics.effects[effect][slot] += g);
        }
        if sought.modulus {
            self.cells.c.pull_modulus(parts.iter().map(|p| p.ln_young).enumerate(), gradient);
        }
        if let (Some(out), true) = (&mut gradient.changes.rest, shape.is_some()) {
            self.cells.sum_corners(|e, i| parts[e].rest[i], out);
        }
    }
}

/// Derivatives of z · force of one cell's laws.
#[derive(Clone, Default)]
struct LawPull {
    /// By the logarithm of its modulus.
    ln_young: f64,
    poisson: f64,
    /// By the factors of the material's curves.
    curves: Vec<f64>,
    /// By the viscosity's numbers.
    flow: [f64; 2],
    /// By the numbers of the effects that are asked for, one after another.
    numbers: Vec<f64>,
    /// By the stress-free shape at the corners.
    rest: Corners,
}
