//! What a local law is: an incremental potential of one point, written once for any number type.
//!
//! A point of the body (a node, or the middle of a surface patch) moves from `old` to `x` in a step. A law gives the potential
//! Π(x; old, velocity, parameters) whose gradient by x is minus the force on the point at the new state; what is not
//! conservative (friction, drag) is written as a dissipation potential with everything else taken at the old state. Second
//! derivatives are therefore symmetric, Newton's line search has something to descend, and the adjoint needs no transposed
//! matrix. Derivatives come from hyper-dual numbers (Fike & Alonso, AIAA 2011-886), exact to rounding.

use crate::mechanics::contact;
use crate::mechanics::path::Path;
use crate::mechanics::series::Series;
use glam::DVec3;
use num_dual::{DualNum, HyperDual64};

/// A number that a law is written for: f64 or a dual number.
pub trait Number: DualNum<Primitive = f64> + Copy {}
impl<T: DualNum<Primitive = f64> + Copy> Number for T {}

/// Entries of a point's input before the law's own parameters; see [`Input`].
pub const COMMON: usize = 19;
/// Place of x in the input [m].
pub const X: usize = 0;
/// Place of the old position [m].
pub const OLD: usize = 3;
/// Place of the old velocity [m/s].
pub const VELOCITY: usize = 6;
/// Place of gravity [m/s²].
pub const GRAVITY: usize = 9;
/// Place of the default contact stiffness, 20 E/h [Pa/m].
pub const STIFFNESS: usize = 12;
/// Place of the plane's unit normal (3), height [m] and penalty stiffness [Pa/m]; zero where there is no plane. Laws that ask for
/// [`Asks::Normal`] find the patch's own outward normal in the old state there.
pub const PLANE: usize = 13;
/// Place of the time of the new state on the recording's clock [s].
pub const TIME: usize = 18;

/// Most parameters of a point law.
pub const MOST: usize = 22;

/// What a point is, the same at every step: no derivative is taken by it.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Rest position [m].
    pub rest: DVec3,
    /// Outward unit normal at rest; zero inside the body.
    pub normal: DVec3,
    /// Volume [m³] of a node, area [m²] of a patch, share of the whole of a node that shares one load.
    pub measure: f64,
    /// Half width of the contact law's blend [m].
    pub width: f64,
    /// 1/Δt [1/s]; 0 in a static problem.
    pub rate: f64,
    /// Factor 1/(θΔt²) of (x − old) in the acceleration of the θ-scheme; 0 in a static problem.
    pub inertia: f64,
    /// Factor 1/(θΔt) of −velocity in the acceleration; 0 in a static problem.
    pub momentum: f64,
    /// The point that the law follows, where it asks for one.
    pub followed: Followed,
}

/// What a law needs that the kernels of a device do not have: only the CPU backend has such laws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asks {
    /// Nothing.
    Nothing,
    /// A path that the scene states beside its numbers.
    Path,
    /// A vector at points of the body for every time, which a scene's file holds.
    Series,
    /// The patch's normal in the old state.
    Normal,
}

/// A point on a path, at both ends of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Followed {
    /// Time of the new state on the recording's clock [s].
    pub time: f64,
    /// Place [m] and velocity [m/s] then.
    pub new: [DVec3; 2],
    /// The same in the old state.
    pub old: [DVec3; 2],
}

impl Followed {
    /// On a path, at the end `time` [s] of a step of `rate` = 1/Δt; a static problem, of rate 0, has one state.
    pub fn of(path: &Path, time: f64, rate: f64) -> Followed {
        let before = if rate > 0.0 { time - 1.0 / rate } else { time };
        Followed { time, new: path.at(time), old: path.at(before) }
    }

    /// Of a point of a series, likewise; NaN where it has none.
    pub fn of_series(series: &Series, point: usize, time: f64, rate: f64) -> Followed {
        let before = if rate > 0.0 { time - 1.0 / rate } else { time };
        Followed { time, new: series.at(point, time), old: series.at(point, before) }
    }

    /// Place in the new state [m]; `time` is that of the new state, and carries the derivative by where the clock starts.
    pub fn now<D: Number>(&self, time: D) -> [D; 3] {
        self.moved(self.new, time)
    }

    /// Place in the old state [m], likewise.
    pub fn old<D: Number>(&self, time: D) -> [D; 3] {
        self.moved(self.old, time)
    }

    /// To first order in time, which is all that first derivatives by it need.
    fn moved<D: Number>(&self, [place, velocity]: [DVec3; 2], time: D) -> [D; 3] {
        let late = time - self.time;
        let (place, velocity): ([D; 3], [D; 3]) = (constant(place), constant(velocity));
        std::array::from_fn(|i| place[i] + velocity[i] * late)
    }
}

impl Place {
    /// How long before the new state forces of a step that are taken between both states act [s].
    pub fn lead(&self) -> f64 {
        if self.rate > 0.0 { (1.0 - self.theta()) / self.rate } else { 0.0 }
    }

    /// Weight θ of the new state in the θ-scheme; 1 in a static problem.
    pub fn theta(&self) -> f64 {
        if self.momentum == 0.0 { 1.0 } else { self.rate / self.momentum }
    }
}

/// The numbers of a point that derivatives are taken by.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a, D> {
    z: &'a [D],
    /// Derivatives by more than x are taken.
    beyond: bool,
}

impl<'a, D: Number> Input<'a, D> {
    /// Wraps an input of [`COMMON`] numbers and the law's parameters.
    pub fn new(z: &'a [D]) -> Self {
        Input { z, beyond: false }
    }

    /// True where derivatives by more than x are taken; else everything that does not depend on x may be computed as plain numbers.
    pub fn is_moved(&self) -> bool {
        self.beyond
    }

    fn three(&self, at: usize) -> [D; 3] {
        [self.z[at], self.z[at + 1], self.z[at + 2]]
    }

    /// New position [m].
    pub fn x(&self) -> [D; 3] {
        self.three(X)
    }

    /// Way of this step, x − old [m].
    pub fn way(&self) -> [D; 3] {
        sub(self.x(), self.old())
    }

    /// Old position [m].
    pub fn old(&self) -> [D; 3] {
        self.three(OLD)
    }

    /// Old velocity [m/s].
    pub fn velocity(&self) -> [D; 3] {
        self.three(VELOCITY)
    }

    /// Gravity [m/s²].
    pub fn gravity(&self) -> [D; 3] {
        self.three(GRAVITY)
    }

    /// Contact stiffness of a plane that states none [Pa/m].
    pub fn default_stiffness(&self) -> D {
        self.z[STIFFNESS]
    }

    /// The plane's unit normal.
    pub fn normal(&self) -> [D; 3] {
        self.three(PLANE)
    }

    /// The plane's height along its normal [m].
    pub fn height(&self) -> D {
        self.z[PLANE + 3]
    }

    /// The plane's penalty stiffness [Pa/m].
    pub fn plane_stiffness(&self) -> D {
        self.z[PLANE + 4]
    }

    /// Old and new distance above the plane [m].
    pub fn gaps(&self) -> [D; 2] {
        [self.old(), self.x()].map(|x| dot(self.normal(), x) - self.height())
    }

    /// Time of the new state on the recording's clock [s].
    pub fn time(&self) -> D {
        self.z[TIME]
    }

    /// The law's parameter `i`.
    pub fn p(&self, i: usize) -> D {
        self.z[COMMON + i]
    }

    /// Three parameters from `i` on, as a vector.
    pub fn vector(&self, i: usize) -> [D; 3] {
        self.three(COMMON + i)
    }
}

/// Potential of what acts along the way from the old `gap` [m] to the new one as contact does (`crate::mechanics::contact`), from its `energy` at
/// a gap: the derivative by the new gap is the mean of the energy's.
pub fn along_way<D: Number>(place: &Place, [old, new]: [D; 2], energy: impl Fn(D) -> D) -> D {
    let acting = contact::instants(place.theta()).into_iter().filter(|i| i.0 > 0.0);
    let parts = acting.map(|(weight, at)| energy(new + (old - new) * (1.0 - at)) * (weight / at));
    parts.fold(D::from(0.0), |sum, part| sum + part)
}

/// a − b.
pub fn sub<D: Number>(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a · b.
pub fn dot<D: Number>(a: [D; 3], b: [D; 3]) -> D {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A constant vector.
pub fn constant<D: Number>(v: DVec3) -> [D; 3] {
    [D::from(v.x), D::from(v.y), D::from(v.z)]
}

/// A law of points. Implement this; everything else follows.
pub trait PointLaw: Sync {
    /// What it needs beside its input.
    const ASKS: Asks = Asks::Nothing;

    /// Its force depends on neither state: it has no stiffness, and remembers nothing.
    const IS_LOAD: bool = false;

    /// Potential of the point [J], up to anything that does not depend on x; proportional to `place.measure`.
    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D;

    /// True when the potential of this input is constant around it, so that the point can be skipped.
    fn idle(&self, _place: &Place, _z: &[f64]) -> bool {
        false
    }

    /// True when it does nothing at any point, whatever that does: of `place` and input it looks at step and time alone.
    fn asleep(&self, _place: &Place, _z: &[f64]) -> bool {
        false
    }

    /// Weight of a node at rest position `rest` [m] in a load that all nodes share (times the node's volume, then divided by the sum
    /// over the body); `None` for laws whose nodes do not share. Parameters only.
    fn share<D: Number>(&self, _rest: DVec3, _p: &[D]) -> Option<D> {
        None
    }
}

/// A [`PointLaw`] with its derivatives, without its type. `z` is the input: [`COMMON`] numbers, then the law's parameters.
pub trait Point: Sync {
    /// Π [J].
    fn value(&self, place: &Place, z: &[f64]) -> f64;
    /// ∂Π/∂x [N].
    fn gradient(&self, place: &Place, z: &[f64]) -> [f64; 3];
    /// ∂²Π/∂x² [N/m].
    fn hessian(&self, place: &Place, z: &[f64]) -> [[f64; 3]; 3];
    /// ∂²Π/∂x∂z · d for a change `d` of the whole input.
    fn along(&self, place: &Place, z: &[f64], d: &[f64]) -> [f64; 3];
    /// wᵀ ∂²Π/∂x∂z for the entries `range` of the input, written to `out`.
    fn transposed(&self, place: &Place, z: &[f64], w: [f64; 3], range: std::ops::Range<usize>, out: &mut [f64]);
    /// As [`PointLaw::ASKS`].
    fn asks(&self) -> Asks;
    /// As [`PointLaw::IS_LOAD`].
    fn is_load(&self) -> bool;
    /// As [`PointLaw::asleep`].
    fn sleeps(&self, place: &Place, z: &[f64]) -> bool;
    /// As [`PointLaw::idle`].
    fn skips(&self, place: &Place, z: &[f64]) -> bool;
    /// Share of a node, with its derivatives by the parameters.
    fn shared(&self, rest: DVec3, p: &[f64]) -> Option<(f64, Vec<f64>)>;

    /// s_i = V_i w_i / Σ V_j w_j of nodes at rest positions `nodes` [m] with volumes `volumes` [m³] `[N]`, with the derivatives by
    /// the parameters `[K][N]`; `None` for laws whose nodes do not share.
    fn shares(&self, nodes: &[DVec3], volumes: &[f64], p: &[f64]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
        let n = nodes.len();
        let (mut values, mut slopes) = (Vec::with_capacity(n), vec![Vec::with_capacity(n); p.len()]);
        for (x, v) in nodes.iter().zip(volumes) {
            let (w, d) = self.shared(*x, p)?;
            values.push(v * w);
            for (s, d) in slopes.iter_mut().zip(d) {
                s.push(v * d);
            }
        }
        // A place so far away that every weight underflows shares nothing instead of dividing by zero.
        let sum: f64 = values.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        values.iter_mut().for_each(|v| *v /= sum);
        for slope in &mut slopes {
            let total: f64 = slope.iter().sum::<f64>() / sum;
            for (s, v) in slope.iter_mut().zip(&values) {
                *s = *s / sum - v * total;
            }
        }
        Some((values, slopes))
    }
}

/// An input as numbers that carry two first derivatives and the mixed second one.
struct Lifted {
    z: [HyperDual64; COMMON + MOST],
    len: usize,
    beyond: bool,
}

impl Lifted {
    fn new(z: &[f64]) -> Lifted {
        let mut lifted = Lifted { z: [HyperDual64::from(0.0); COMMON + MOST], len: z.len(), beyond: false };
        for (h, v) in lifted.z.iter_mut().zip(z) {
            h.re = *v;
        }
        lifted
    }

    fn evaluate(&self, law: &impl PointLaw, place: &Place) -> HyperDual64 {
        law.potential(place, Input { z: &self.z[..self.len], beyond: self.beyond })
    }
}

impl<L: PointLaw> Point for L {
    fn value(&self, place: &Place, z: &[f64]) -> f64 {
        self.potential(place, Input::new(z))
    }

    fn gradient(&self, place: &Place, z: &[f64]) -> [f64; 3] {
        let mut h = Lifted::new(z);
        (h.z[X].eps1, h.z[X + 1].eps2) = (1.0, 1.0);
        let first = h.evaluate(self, place);
        (h.z[X].eps1, h.z[X + 1].eps2, h.z[X + 2].eps1) = (0.0, 0.0, 1.0);
        [first.eps1, first.eps2, h.evaluate(self, place).eps1]
    }

    fn hessian(&self, place: &Place, z: &[f64]) -> [[f64; 3]; 3] {
        let mut h = Lifted::new(z);
        let mut out = [[0.0; 3]; 3];
        for i in 0..3 {
            for j in 0..=i {
                h.z[X + i].eps1 = 1.0;
                h.z[X + j].eps2 = 1.0;
                let v = h.evaluate(self, place).eps1eps2;
                h.z[X + i].eps1 = 0.0;
                h.z[X + j].eps2 = 0.0;
                (out[i][j], out[j][i]) = (v, v);
            }
        }
        out
    }

    fn along(&self, place: &Place, z: &[f64], d: &[f64]) -> [f64; 3] {
        let mut h = Lifted::new(z);
        for (h, d) in h.z.iter_mut().zip(d) {
            h.eps2 = *d;
        }
        h.beyond = true;
        std::array::from_fn(|i| {
            h.z[X + i].eps1 = 1.0;
            let v = h.evaluate(self, place).eps1eps2;
            h.z[X + i].eps1 = 0.0;
            v
        })
    }

    fn transposed(&self, place: &Place, z: &[f64], w: [f64; 3], range: std::ops::Range<usize>, out: &mut [f64]) {
        let mut h = Lifted::new(z);
        for i in 0..3 {
            h.z[X + i].eps1 = w[i];
        }
        h.beyond = true;
        for (j, o) in range.zip(out) {
            h.z[j].eps2 = 1.0;
            *o = h.evaluate(self, place).eps1eps2;
            h.z[j].eps2 = 0.0;
        }
    }

    fn asks(&self) -> Asks {
        L::ASKS
    }

    fn is_load(&self) -> bool {
        L::IS_LOAD
    }

    fn sleeps(&self, place: &Place, z: &[f64]) -> bool {
        self.asleep(place, z)
    }

    fn skips(&self, place: &Place, z: &[f64]) -> bool {
        self.idle(place, z)
    }

    fn shared(&self, rest: DVec3, p: &[f64]) -> Option<(f64, Vec<f64>)> {
        let mut h = Lifted::new(p);
        let value = self.share(rest, &h.z[..p.len()])?.re;
        let slopes = (0..p.len()).map(|i| {
            h.z[i].eps1 = 1.0;
            let v = self.share(rest, &h.z[..p.len()]).map_or(0.0, |v| v.eps1);
            h.z[i].eps1 = 0.0;
            v
        });
        Some((value, slopes.collect()))
    }
}
