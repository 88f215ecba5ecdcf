//! What cells do beyond linear elasticity: effects that are laws of cells, the material where it is not linear, and its viscosity. Force,
//! potential and derivatives follow from scalar functions of a cell's deformation.
//!
//! A law gives ψ(s) and φ(d, a₀) of scalars s = (a, ε) (see [`palpate_model::effects::cell`]). With θ the weight of the new state, the
//! incremental potential is E V [θ ψ(s₁) + φ] + (1 − θ) f(x₀)·x₁, and all derivatives follow from those of ψ and φ by the chain rule
//! through q: ∇a = Kq/V, ∇ε constant, and q(x) by [`CellPose`].

mod derivatives;
pub(in crate::terms) mod material;
mod viscosity;

use super::{Cells, Corners, dot24 as dot, pick};
use glam::DVec3;
use palpate_model::cutcells::corotation::{CellPose, M24, V24, flatten, multiply};
use palpate_model::effects::Site;
use palpate_model::effects::cell::{Cell, ENERGY, LOSS, MOST, Part};
use palpate_model::materials::Solid;
use palpate_model::materials::stretching::PAIRS;
use palpate_model::mechanics::lame::{lame, lame_by_nu};
use palpate_model::plan::{Physics, Plan};
use viscosity::{Flow, FlowState};

/// A law of cells with its parameters.
#[derive(Clone)]
pub struct CellActing {
    /// Number of the effect in the scene.
    pub effect: usize,
    pub(in crate::terms) law: &'static dyn Cell,
    pub(in crate::terms) p: Vec<f64>,
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

/// The cell laws of one solve.
#[derive(Clone, Copy)]
pub(super) struct CellLaws<'a> {
    cells: Cells<'a>,
    laws: &'a [CellActing],
    /// The material where it is not linear.
    material: Option<&'a dyn Solid>,
    /// λ and μ over E, and their derivatives by Poisson's ratio.
    lame: [(f64, f64); 2],
    /// 1/ℓ [1/s]; 0 in a static problem.
    rate: f64,
}

/// What the tangent needs of a cell's laws at the displacement of the last residual.
#[derive(Clone, Copy)]
pub(super) struct LawState {
    /// Body-frame forces that go with the new pose [N].
    pub stress: V24,
    /// Factor on the cell's matrix for E = 1 Pa [Pa].
    pub scale: f64,
    /// Second derivatives by the scalars, times E and the weight of the new state, over the volume.
    second: [[f64; ENERGY]; ENERGY],
    /// K(q₁ − q̃) and the factor of its square.
    loss: (V24, f64),
    /// Of the material's viscosity.
    flow: Option<FlowState>,
}

impl Default for LawState {
    fn default() -> LawState {
        LawState { stress: [0.0; 24], scale: 0.0, second: [[0.0; ENERGY]; ENERGY], loss: ([0.0; 24], 0.0), flow: None }
    }
}

/// Derivatives of ψ: first, and second (symmetric).
#[derive(Clone, Copy, Default)]
struct Slopes {
    first: [f64; ENERGY],
    second: [[f64; ENERGY]; ENERGY],
}

/// One state of a cell: pose, q, Kq, scalars. The past's q is the weighted sum over its states; its pose is that of the newest.
struct Side {
    pose: CellPose,
    q: V24,
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
    /// Gradient weights of the corners in the mean strain [1/m].
    gradient: &'a [DVec3; 8],
    new: Side,
    old: Option<Side>,
    /// K(q₁ − q₀).
    kd: V24,
    d: f64,
    loss: Loss,
    flow: Flow,
}

fn add(a: &mut V24, factor: f64, b: &V24) {
    a.iter_mut().zip(b).for_each(|(a, b)| *a += factor * b);
}

/// Gradient of mean strain component c by q.
fn strain_row(c: usize, gradient: &[DVec3; 8]) -> V24 {
    let [a, b] = PAIRS[c];
    let mut row = [0.0; 24];
    for i in 0..8 {
        row[3 * i + a] += 0.5 * gradient[i][b];
        row[3 * i + b] += 0.5 * gradient[i][a];
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
pub(in crate::terms) fn input(scalars: &[f64], p: &[f64]) -> ([f64; ENERGY + MOST], usize) {
    let mut z = [0.0; ENERGY + MOST];
    z[..scalars.len()].copy_from_slice(scalars);
    z[scalars.len()..scalars.len() + p.len()].copy_from_slice(p);
    (z, scalars.len() + p.len())
}

impl<'a> CellLaws<'a> {
    pub(super) fn new(cells: Cells<'a>) -> CellLaws<'a> {
        let (model, nu) = (cells.c.plan.model, cells.c.physics().poisson_ratio);
        CellLaws {
            cells,
            laws: &cells.c.altered.laws,
            material: (!model.is_linear).then(|| cells.c.law()),
            lame: [lame(1.0, nu), lame_by_nu(1.0, nu)],
            rate: cells.c.inertia.map_or(0.0, |t| t.rate),
        }
    }

    /// True where something acts.
    pub(super) fn act(&self) -> bool {
        self.material.is_some() || self.acting().next().is_some() || self.viscous().is_some()
    }

    fn loss_part(&self) -> Part {
        Part::Loss { rate: self.rate }
    }

    /// The laws that are not absent.
    fn acting(&self) -> impl Iterator<Item = &'a CellActing> {
        self.laws.iter().filter(|l| !l.absent)
    }

    /// Number of scalars that the energy of any acting law depends on; the density comes first.
    fn needs(&self) -> usize {
        let of_laws = self.acting().map(|l| l.law.needs(Part::Energy)).max().unwrap_or(1);
        if self.material.is_some() { ENERGY } else { of_laws }
    }

    /// True where some law dissipates.
    fn lossy(&self) -> bool {
        self.rate > 0.0 && self.laws.iter().any(|l| l.law.needs(self.loss_part()) > 0)
    }

    /// True where the force that goes with the new pose depends on the past.
    fn sees_past(&self) -> bool {
        self.lossy() || self.viscous().is_some()
    }

    /// K q, which is zero where nothing asks for it, and the first `n` scalars of a deformation.
    fn scalars(&self, k: &M24, volume: f64, q: &V24, n: usize, gradient: &[DVec3; 8]) -> (V24, [f64; ENERGY]) {
        let (mut kq, mut s) = ([0.0; 24], [0.0; ENERGY]);
        // A material sees strains alone.
        if !self.laws.is_empty() {
            kq = multiply(k, q);
            s[0] = 0.5 * dot(q, &kq) / volume;
        }
        for (c, s) in s.iter_mut().skip(1).enumerate().take(n - 1) {
            *s = dot(&strain_row(c, gradient), q);
        }
        (kq, s)
    }

    /// ψ of the laws that act, and of the material beyond the linear one.
    fn energy(&self, s: &[f64; ENERGY]) -> f64 {
        let of_laws = self.acting().map(|l| {
            let (z, len) = input(s, &l.p);
            l.law.value(Part::Energy, &z[..len])
        });
        self.material.map_or(0.0, |law| self.material_energy(law, s)) + of_laws.sum::<f64>()
    }

    fn side(&self, k: &M24, volume: f64, pose: CellPose, q: V24, n: usize, gradient: &[DVec3; 8]) -> Side {
        let (kq, s) = self.scalars(k, volume, &q, n, gradient);
        let mut slopes = Slopes::default();
        if let Some(law) = self.material {
            self.add_material(law, &s, &mut slopes);
        }
        for l in self.acting() {
            let (z, len) = input(&s, &l.p);
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
        Side { pose, q, kq, s, slopes }
    }

    fn local(&self, e: usize, u1: &[DVec3]) -> Local<'a> {
        self.local_with(self.needs(), e, u1)
    }

    /// Volume of a cell that deforms [m³].
    fn volume(&self, e: usize) -> f64 {
        self.cells.c.elements.fractions[e] * self.cells.body().cut().grid.h.powi(3)
    }

    /// Gradient weights of the corners in a cell's mean strain [1/m].
    fn gradient(&self, e: usize) -> &'a [DVec3; 8] {
        self.cells.c.elements.gradient(e)
    }

    /// The past's pose and q̃.
    fn past(&self, e: usize) -> Option<(CellPose, V24)> {
        let mut q = [0.0; 24];
        let mut newest = None;
        for (weight, u) in self.cells.c.past.each {
            let pose = self.cells.pose(e, u);
            add(&mut q, *weight, &pose.q);
            newest.get_or_insert(pose);
        }
        Some((newest?, q))
    }

    /// The same with at least `n` scalars, and with the past where it has a force of its own or what is lost depends on it.
    fn local_with(&self, n: usize, e: usize, u1: &[DVec3]) -> Local<'a> {
        let seen = self.cells.c.weights.old != 0.0 || self.sees_past();
        self.local_at(n, e, self.cells.pose(e, u1), if seen { self.past(e) } else { None })
    }

    /// The same for the force that goes with the new pose alone.
    fn local_new(&self, e: usize, pose: CellPose) -> Local<'a> {
        self.local_at(self.needs(), e, pose, if self.sees_past() { self.past(e) } else { None })
    }

    fn local_at(&self, n: usize, e: usize, pose: CellPose, past: Option<(CellPose, V24)>) -> Local<'a> {
        let cells = &self.cells;
        let (k, volume, gradient) = (cells.stiffness(e), self.volume(e), self.gradient(e));
        let new = self.side(k, volume, pose, pose.q, n, gradient);
        let old = past.map(|(pose, q)| self.side(k, volume, pose, q, n, gradient));
        let (mut kd, mut d, mut loss) = ([0.0; 24], 0.0, Loss::default());
        if let (Some(old), true) = (&old, self.lossy()) {
            kd = std::array::from_fn(|i| new.kq[i] - old.kq[i]);
            d = 0.5 * (0..24).map(|i| kd[i] * (new.q[i] - old.q[i])).sum::<f64>() / volume;
            for l in self.acting().filter(|l| l.law.needs(self.loss_part()) > 0) {
                let (z, len) = input(&[d, old.s[0]], &l.p);
                let [by_d, _, by_dd] = l.law.slopes(self.loss_part(), &z[..len], 0, 0);
                loss.value += l.law.value(self.loss_part(), &z[..len]);
                loss.by_d += by_d;
                loss.by_dd += by_dd;
                loss.by_da += l.law.slopes(self.loss_part(), &z[..len], 0, 1)[2];
            }
        }
        let flow = old.as_ref().map(|old| self.flow(e, volume, &new, old)).unwrap_or_default();
        Local { k, volume, young: cells.young_of(e), n, gradient, new, old, kd, d, loss, flow }
    }

    /// The laws at a pose of a cell, and their forces on the corners that go with it.
    pub(super) fn state(&self, e: usize, pose: &CellPose) -> (LawState, Corners) {
        // The old state's own force is computed once a solve.
        let l = self.local_new(e, *pose);
        let weight = self.cells.c.weights.new;
        let mut stress = l.force_new(weight);
        add(&mut stress, l.flow.by_d, &l.flow.kd);
        let state = LawState {
            stress,
            scale: l.young * (weight * l.new.slopes.first[0] + l.loss.by_d),
            second: l.new.slopes.second.map(|row| row.map(|v| v * weight * l.young / l.volume)),
            loss: (l.kd, l.loss.by_dd * l.young / l.volume),
            flow: self.viscous().map(|_| l.flow.state(l.volume)),
        };
        (state, l.new.pose.force(&stress))
    }

    /// Adds (1 − θ) times the laws' force at the old state.
    pub(super) fn add_old_force(&self, out: &mut [DVec3]) {
        let weight = self.cells.c.weights.old;
        if weight == 0.0 {
            return;
        }
        self.cells.gather(
            |e| {
                let l = self.local(e, self.cells.c.past.u);
                l.new.pose.force(&l.stress(&l.new, &l.new.slopes.first)).map(|f| weight * f)
            },
            out,
        );
    }

    /// Potential whose gradient by u₁ is the laws' force that goes with the new pose, up to a constant [J].
    pub(super) fn potential(&self, u1: &[DVec3]) -> f64 {
        let weight = self.cells.c.weights.new;
        let cell = |e: usize| {
            let (pose, volume) = (self.cells.pose(e, u1), self.volume(e));
            let (loss, flow) = if self.sees_past() {
                let l = self.local_new(e, pose);
                (l.loss.value, l.flow.value)
            } else {
                (0.0, 0.0)
            };
            let s = self.scalars(self.cells.stiffness(e), volume, &pose.q, self.needs(), self.gradient(e)).1;
            self.cells.young_of(e) * volume * (weight * self.energy(&s) + loss) + volume * flow
        };
        self.cells.each_cell(cell).iter().sum()
    }

    /// The matrix that goes with the pose, world frame left to it: `scale` times K, and K₀ times what the viscosity makes of it [N/m].
    pub(super) fn matrix(&self, e: usize, state: &LawState, scale: f64) -> Option<M24> {
        let (flow, still) = (state.flow?, self.flow_matrix(e)?);
        let k = self.cells.stiffness(e);
        Some(std::array::from_fn(|i| scale * k[i] + flow.scale * still[i]))
    }

    /// Adds the part of the tangent of cell e that no matrix K has: Σ E V ψ_kl ∇s_k ∇s_lᵀ and E V φ_dd ∇d ∇dᵀ, world frame, blocks
    /// (i, j ≥ i) of the symmetric 24 × 24 matrix. `convex` is the factor on K [Pa] where the sum with K must be positive semi-definite.
    pub(super) fn add_upper_tangent(&self, e: usize, pose: &CellPose, state: &LawState, convex: Option<f64>, out: &mut M24) {
        let (volume, gradient) = (self.volume(e), self.gradient(e));
        let mut rank_one = |c: f64, a: &V24, b: &V24| {
            for i in 0..24 {
                let s = c * a[i];
                for j in 3 * (i / 3)..24 {
                    out[24 * i + j] += s * b[j];
                }
            }
        };
        let n = self.needs();
        let row = |k: usize| match k {
            0 => multiply(self.cells.stiffness(e), &pose.q),
            _ => strain_row(k - 1, gradient).map(|v| volume * v),
        };
        let first = if state.second[0].iter().any(|v| *v != 0.0) { 0 } else { 1 };
        let second = convex.map_or(state.second, |scale| self.convex(state.second, scale / volume));
        let rows: Vec<V24> = (first..n).map(|k| flatten(&pose.force(&row(k)))).collect();
        for (k, a) in rows.iter().enumerate() {
            let mut b = [0.0; 24];
            rows.iter().enumerate().for_each(|(l, other)| add(&mut b, second[first + k][first + l], other));
            rank_one(1.0, a, &b);
        }
        let flow = state.flow.map_or(([0.0; 24], 0.0), |f| (f.kd, f.second));
        for (kd, second) in [state.loss, flow].iter().filter(|(_, second)| *second != 0.0) {
            let turned = flatten(&pose.force(kd));
            rank_one(*second, &turned, &turned);
        }
    }
}
