//! Effects that are laws of cells: their force, potential and derivatives, from scalar functions of a cell's deformation.
//!
//! A law gives ψ(s) and φ(d, a₀) of scalars s = (a, ε) (see [`palpate_model::effects::cell`]). With θ the weight of the new state, the
//! incremental potential is E V [θ ψ(s₁) + φ] + (1 − θ) f(x₀)·x₁, and all derivatives follow from those of ψ and φ by the chain rule
//! through q: ∇a = Kq/V, ∇ε constant, and q(x) by [`CellPose`].

use crate::passes::cells::{Corners, Elasticity, Mix, pick};
use glam::DVec3;
use palpate_model::cutcells::corotation::{CellPose, M24, V24, flatten, multiply};
use palpate_model::cutcells::grid::SIGNS;
use palpate_model::effects::Site;
use palpate_model::effects::cell::{Cell, ENERGY, LOSS, MOST, Part};
use palpate_model::plan::{Physics, Plan};

/// A law of cells with its parameters.
#[derive(Clone)]
pub struct CellActing {
    /// Number of the effect in the scene.
    pub effect: usize,
    law: &'static dyn Cell,
    p: Vec<f64>,
    /// Its amplitudes are zero: it has no energy, only derivatives by them.
    pub absent: bool,
}

impl std::fmt::Debug for CellActing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "cell law {} {:?}", self.effect, self.p)
    }
}

/// The cell laws of a member.
pub fn cell_laws(plan: &Plan, physics: &Physics) -> Vec<CellActing> {
    let all = plan.layout.effects().zip(&physics.effects).enumerate();
    all.filter_map(|(effect, ((law, _), p))| match law.site {
        Site::Cells(cell) => Some(CellActing { effect, law: cell, p: p.clone(), absent: law.is_absent(p) }),
        _ => None,
    })
    .collect()
}

/// The cell laws of a balance.
#[derive(Clone, Copy)]
pub struct Materials<'a> {
    /// Body, matrices, stiffness.
    pub elasticity: Elasticity<'a>,
    /// The laws.
    pub laws: &'a [CellActing],
    /// How the states enter.
    pub mix: Mix,
    /// 1/Δt [1/s]; 0 in a static problem.
    pub rate: f64,
}

/// Derivatives of ψ: first, and second (symmetric).
#[derive(Clone, Copy, Default)]
struct Slopes {
    value: f64,
    first: [f64; ENERGY],
    second: [[f64; ENERGY]; ENERGY],
}

/// One state of a cell: pose, Kq, scalars.
struct Side {
    pose: CellPose,
    kq: V24,
    s: [f64; ENERGY],
    slopes: Slopes,
}

/// φ with its derivatives by d and a₀.
#[derive(Clone, Copy, Default)]
struct Loss {
    value: f64,
    by_d: f64,
    by_dd: f64,
    by_da: f64,
}

/// A cell with all that its laws need.
struct Local<'a> {
    k: &'a M24,
    volume: f64,
    /// Factor that turns energy densities over E into Pa.
    young: f64,
    /// Number of scalars that any law depends on.
    n: usize,
    /// 1/(4h): factor of the corner signs in the mean strain.
    gradient: f64,
    new: Side,
    old: Option<Side>,
    /// K(q₁ − q₀).
    kd: V24,
    d: f64,
    loss: Loss,
}

fn dot(a: &V24, b: &V24) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add(a: &mut V24, factor: f64, b: &V24) {
    a.iter_mut().zip(b).for_each(|(a, b)| *a += factor * b);
}

/// Rows and columns of the strain components xx, yy, zz, yz, zx, xy.
const PAIRS: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [1, 2], [2, 0], [0, 1]];

/// Gradient of mean strain component c by q.
fn strain_row(c: usize, gradient: f64) -> V24 {
    let [a, b] = PAIRS[c];
    let mut row = [0.0; 24];
    for i in 0..8 {
        row[3 * i + a] += 0.5 * gradient * SIGNS[i][b];
        row[3 * i + b] += 0.5 * gradient * SIGNS[i][a];
    }
    row
}

impl Local<'_> {
    /// V ∇s_k by q at one state.
    fn row(&self, side: &Side, k: usize) -> V24 {
        if k == 0 { side.kq } else { strain_row(k - 1, self.gradient).map(|v| self.volume * v) }
    }

    /// E Σ V ∇s_k c_k: the body-frame force that goes with coefficients c.
    fn stress(&self, side: &Side, c: &[f64; ENERGY]) -> V24 {
        let mut y = [0.0; 24];
        for k in (0..self.n).filter(|&k| c[k] != 0.0) {
            add(&mut y, self.young * c[k], &self.row(side, k));
        }
        y
    }

    /// Derivative of [`Local::stress`] at its own coefficients, times a change of q.
    fn stress_rate(&self, side: &Side, dq: &V24) -> V24 {
        let ds: [f64; ENERGY] = std::array::from_fn(|k| if k < self.n { dot(&self.row(side, k), dq) / self.volume } else { 0.0 });
        let c = std::array::from_fn(|k| (0..self.n).map(|l| side.slopes.second[k][l] * ds[l]).sum());
        let mut y = self.stress(side, &c);
        add(&mut y, self.young * side.slopes.first[0], &multiply(self.k, dq));
        y
    }

    /// Body-frame force that goes with the new pose, for a weight of the new state.
    fn force_new(&self, weight: f64) -> V24 {
        let mut y = self.stress(&self.new, &self.new.slopes.first.map(|v| weight * v));
        add(&mut y, self.young * self.loss.by_d, &self.kd);
        y
    }

    /// Change of [`Local::force_new`] when the old deformation changes by `dq` (only the loss sees it).
    fn by_old(&self, dq: &V24) -> V24 {
        let Some(old) = &self.old else { return [0.0; 24] };
        let (kd, k0) = (dot(&self.kd, dq) / self.volume, dot(&old.kq, dq) / self.volume);
        let mut y = multiply(self.k, dq).map(|v| -self.young * self.loss.by_d * v);
        add(&mut y, self.young * (self.loss.by_da * k0 - self.loss.by_dd * kd), &self.kd);
        y
    }

    /// The transpose of [`Local::by_old`].
    fn by_old_transposed(&self, dq: &V24) -> V24 {
        let Some(old) = &self.old else { return [0.0; 24] };
        let kd = self.young * dot(&self.kd, dq) / self.volume;
        let mut y = multiply(self.k, dq).map(|v| -self.young * self.loss.by_d * v);
        add(&mut y, -self.loss.by_dd * kd, &self.kd);
        add(&mut y, self.loss.by_da * kd, &old.kq);
        y
    }

    /// World-frame force of body-frame parts `new` and, weighted, `old`.
    fn world(&self, new: &V24, old: Option<(f64, V24)>) -> Corners {
        let mut f = self.new.pose.force(new);
        if let (Some(side), Some((weight, y))) = (&self.old, old) {
            for (f, g) in f.iter_mut().zip(side.pose.force(&y)) {
                *f += weight * g;
            }
        }
        f
    }
}

/// Input of a law: scalars, then parameters.
fn input(scalars: &[f64], p: &[f64]) -> ([f64; ENERGY + MOST], usize) {
    let mut z = [0.0; ENERGY + MOST];
    z[..scalars.len()].copy_from_slice(scalars);
    z[scalars.len()..scalars.len() + p.len()].copy_from_slice(p);
    (z, scalars.len() + p.len())
}

impl<'a> Materials<'a> {
    fn loss_part(&self) -> Part {
        Part::Loss { rate: self.rate }
    }

    /// The laws that are not absent.
    fn acting(&self) -> impl Iterator<Item = &'a CellActing> {
        self.laws.iter().filter(|l| !l.absent)
    }

    /// Number of scalars that the energy of any acting law depends on; the density comes first.
    fn needs(&self) -> usize {
        self.acting().map(|l| l.law.needs(Part::Energy)).max().unwrap_or(1)
    }

    fn side(&self, k: &M24, volume: f64, pose: CellPose, n: usize, gradient: f64) -> Side {
        let kq = multiply(k, &pose.q);
        let mut s = [0.0; ENERGY];
        s[0] = 0.5 * dot(&pose.q, &kq) / volume;
        for (c, s) in s.iter_mut().skip(1).enumerate().take(n - 1) {
            *s = dot(&strain_row(c, gradient), &pose.q);
        }
        let mut slopes = Slopes::default();
        for l in self.acting() {
            let (z, len) = input(&s, &l.p);
            slopes.value += l.law.value(Part::Energy, &z[..len]);
            let own = l.law.needs(Part::Energy);
            for i in 0..own {
                for j in 0..=i {
                    let [first, _, second] = l.law.slopes(Part::Energy, &z[..len], i, j);
                    slopes.second[i][j] += second;
                    if i == j {
                        slopes.first[i] += first;
                    } else {
                        slopes.second[j][i] += second;
                    }
                }
            }
        }
        Side { pose, kq, s, slopes }
    }

    fn local(&self, e: usize, u1: &[DVec3], u0: &[DVec3], young: f64) -> Local<'a> {
        self.local_with(self.needs(), e, u1, u0, young)
    }

    /// The same with at least `n` scalars.
    fn local_with(&self, n: usize, e: usize, u1: &[DVec3], u0: &[DVec3], young: f64) -> Local<'a> {
        let el = &self.elasticity;
        let (h, k) = (el.body.grid.h, el.stiffness(e));
        let (volume, gradient) = (el.elements.fractions[e] * h.powi(3), 0.25 / h);
        let (new, old) = el.both(&self.mix, e, u1, u0);
        let new = self.side(k, volume, new, n, gradient);
        let old = old.map(|p| self.side(k, volume, p, n, gradient));
        let (mut kd, mut d, mut loss) = ([0.0; 24], 0.0, Loss::default());
        if let (Some(old), true) = (&old, self.rate > 0.0) {
            kd = std::array::from_fn(|i| new.kq[i] - old.kq[i]);
            d = 0.5 * (0..24).map(|i| kd[i] * (new.pose.q[i] - old.pose.q[i])).sum::<f64>() / volume;
            for l in self.acting() {
                let (z, len) = input(&[d, old.s[0]], &l.p);
                let [by_d, _, by_dd] = l.law.slopes(self.loss_part(), &z[..len], 0, 0);
                loss.value += l.law.value(self.loss_part(), &z[..len]);
                loss.by_d += by_d;
                loss.by_dd += by_dd;
                loss.by_da += l.law.slopes(self.loss_part(), &z[..len], 0, 1)[2];
            }
        }
        Local { k, volume, young: young * el.factor(e), n, gradient, new, old, kd, d, loss }
    }

    /// Adds the laws' force with Young's modulus `young` [Pa] (in which it is linear).
    pub fn force(&self, young: f64, u1: &[DVec3], u0: &[DVec3], out: &mut [DVec3]) {
        self.elasticity.gather(
            |e| {
                let l = self.local(e, u1, u0, young);
                let old = l.old.as_ref().map(|o| (self.mix.old, l.stress(o, &o.slopes.first)));
                l.world(&l.force_new(self.mix.new), old)
            },
            out,
        );
    }

    /// Potential whose gradient by u₁ is [`Materials::force`], up to a constant [J].
    pub fn potential(&self, u1: &[DVec3], u0: &[DVec3]) -> f64 {
        let el = &self.elasticity;
        let cell = |e: usize| {
            let l = self.local(e, u1, u0, el.young);
            let mut w = l.young * l.volume * (self.mix.new * l.new.slopes.value + l.loss.value);
            if let (Some(old), true) = (&l.old, self.mix.old != 0.0) {
                let f0 = old.pose.force(&l.stress(old, &old.slopes.first));
                w += self.mix.old * pick(el.body, e, u1).iter().zip(&f0).map(|(u, f)| u.dot(*f)).sum::<f64>();
            }
            w
        };
        (0..el.body.cells.len()).map(cell).sum()
    }

    /// Adds the derivative of cell e's force by the new state, world frame; with `convex` without the rotation's second derivative.
    pub fn add_tangent(&self, e: usize, u1: &[DVec3], u0: &[DVec3], convex: bool, out: &mut M24) {
        let l = self.local(e, u1, u0, self.elasticity.young);
        let scale = l.young * (self.mix.new * l.new.slopes.first[0] + l.loss.by_d);
        let mut h = [0.0; 576];
        if convex {
            l.new.pose.gauss_newton(l.k, scale, &mut h);
        } else {
            l.new.pose.hessian(l.k, scale, &l.force_new(self.mix.new), &mut h);
        }
        // Σ E V ψ_kl ∇s_k ∇s_lᵀ and E V φ_dd ∇d ∇dᵀ.
        let rows: Vec<V24> = (0..l.n).map(|k| flatten(&l.new.pose.force(&l.row(&l.new, k)))).collect();
        let turned = flatten(&l.new.pose.force(&l.kd));
        let mut rank_one = |c: f64, a: &V24, b: &V24| {
            for i in 0..24 {
                for j in 0..24 {
                    h[24 * i + j] += c * a[i] * b[j];
                }
            }
        };
        for i in 0..l.n {
            for j in 0..l.n {
                let c = self.mix.new * l.new.slopes.second[i][j];
                if c != 0.0 {
                    rank_one(c * l.young / l.volume, &rows[i], &rows[j]);
                }
            }
        }
        if l.loss.by_dd != 0.0 {
            rank_one(l.loss.by_dd * l.young / l.volume, &turned, &turned);
        }
        out.iter_mut().zip(&h).for_each(|(o, h)| *o += h);
    }

    /// Adds the symmetric derivative of the old state's own force by itself, times `d`.
    fn old_own(&self, l: &Local, d: &Corners, out: &mut Corners) {
        let (Some(old), true) = (&l.old, self.mix.old != 0.0) else { return };
        let y = l.stress(old, &old.slopes.first);
        let first = old.pose.force(&l.stress_rate(old, &old.pose.strain_rate(d)));
        let second = old.pose.second(&y, d);
        for i in 0..8 {
            out[i] += self.mix.old * (first[i] + second[i]);
        }
    }

    /// Adds (∂force/∂u₀) du₀.
    pub fn by_old(&self, u1: &[DVec3], u0: &[DVec3], du0: &[DVec3], out: &mut [DVec3]) {
        let el = &self.elasticity;
        el.gather(
            |e| {
                let (l, d) = (self.local(e, u1, u0, el.young), pick(el.body, e, du0));
                let dq = l.old.as_ref().map_or([0.0; 24], |o| o.pose.strain_rate(&d));
                let mut f = l.new.pose.force(&l.by_old(&dq));
                self.old_own(&l, &d, &mut f);
                f
            },
            out,
        );
    }

    /// Adds (∂force/∂u₀)ᵀ z.
    pub fn by_old_transposed(&self, u1: &[DVec3], u0: &[DVec3], z: &[DVec3], out: &mut [DVec3]) {
        let el = &self.elasticity;
        el.gather(
            |e| {
                let (l, d) = (self.local(e, u1, u0, el.young), pick(el.body, e, z));
                let y = l.by_old_transposed(&l.new.pose.strain_rate(&d));
                let mut f = l.old.as_ref().map_or([DVec3::ZERO; 8], |o| o.pose.force(&y));
                self.old_own(&l, &d, &mut f);
                f
            },
            out,
        );
    }

    /// Adds the derivative of the force by number `slot` of effect `effect`.
    pub fn own_column(&self, effect: usize, slot: usize, u1: &[DVec3], u0: &[DVec3], out: &mut [DVec3]) {
        let Some(acting) = self.laws.iter().find(|l| l.effect == effect) else { return };
        let el = &self.elasticity;
        let n = self.needs().max(acting.law.needs(Part::Energy));
        let by = |part: Part, scalars: &[f64], k: usize| {
            let (z, len) = input(scalars, &acting.p);
            acting.law.slopes(part, &z[..len], k, scalars.len() + slot)[2]
        };
        el.gather(
            |e| {
                let l = self.local_with(n, e, u1, u0, el.young);
                let energy = |side: &Side| {
                    let c = std::array::from_fn(|k| if k < l.n { by(Part::Energy, &side.s, k) } else { 0.0 });
                    l.stress(side, &c)
                };
                let mut new = energy(&l.new).map(|v| self.mix.new * v);
                if let (Some(old), true) = (&l.old, self.rate > 0.0) {
                    let scalars: [f64; LOSS] = [l.d, old.s[0]];
                    add(&mut new, l.young * by(self.loss_part(), &scalars, 0), &l.kd);
                }
                l.world(&new, l.old.as_ref().map(|o| (self.mix.old, energy(o))))
            },
            out,
        );
    }

    /// Adds the derivative of the force by Poisson's ratio.
    pub fn poisson_column(&self, u1: &[DVec3], u0: &[DVec3], out: &mut [DVec3]) {
        let el = &self.elasticity;
        el.gather(
            |e| {
                let l = self.local(e, u1, u0, el.young);
                let k_nu = el.by_poisson(e);
                let energy = |side: &Side| {
                    let kq = multiply(k_nu, &side.pose.q);
                    let a = 0.5 * dot(&side.pose.q, &kq) / l.volume;
                    let c = std::array::from_fn(|k| side.slopes.second[k][0] * a);
                    let mut y = l.stress(side, &c);
                    add(&mut y, l.young * side.slopes.first[0], &kq);
                    (y, a)
                };
                let mut new = energy(&l.new).0.map(|v| self.mix.new * v);
                let old = l.old.as_ref().map(|old| (old, energy(old)));
                if let (Some((old, (_, a0))), true) = (&old, self.rate > 0.0) {
                    let dq: V24 = std::array::from_fn(|i| l.new.pose.q[i] - old.pose.q[i]);
                    let kd = multiply(k_nu, &dq);
                    let d = 0.5 * dot(&dq, &kd) / l.volume;
                    add(&mut new, l.young * l.loss.by_d, &kd);
                    add(&mut new, l.young * (l.loss.by_dd * d + l.loss.by_da * a0), &l.kd);
                }
                l.world(&new, old.map(|(_, (y, _))| (self.mix.old, y)))
            },
            out,
        );
    }

    /// Adds the derivative of the force by a change `dw` [m] of the stress-free shape at the nodes.
    pub fn rest_column(&self, u1: &[DVec3], u0: &[DVec3], dw: &[DVec3], out: &mut [DVec3]) {
        let el = &self.elasticity;
        let Some(rest) = el.rest else { return };
        el.gather(
            |e| {
                let l = self.local(e, u1, u0, el.young);
                let dq = rest[e].strain_rate(&pick(el.body, e, dw)).map(|v| -v);
                let mut new = l.stress_rate(&l.new, &dq).map(|v| self.mix.new * v);
                if let Some(old) = &l.old {
                    add(&mut new, l.young * l.loss.by_da * dot(&old.kq, &dq) / l.volume, &l.kd);
                }
                l.world(&new, l.old.as_ref().map(|o| (self.mix.old, l.stress_rate(o, &dq))))
            },
            out,
        );
    }
}
