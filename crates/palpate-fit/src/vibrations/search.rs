//! Frequencies and dampings of the least residual.

use crate::dense::solve;
use faer::Mat;
use std::f64::consts::TAU;

/// Frequencies that are tried in the time that tells two of them apart, and dampings.
const FINE: f64 = 4.0;
const DAMPINGS: [f64; 3] = [0.01, 0.05, 0.2];
/// Bounds of the damping ratio: below, no record tells it from none; above, nothing swings.
const LEAST: f64 = 1e-5;
const MOST: f64 = 0.95;
/// Most rounds, and the decrease, over the residual, at which they end.
const ROUNDS: usize = 100;
const ARRIVED: f64 = 1e-12;
/// Part of a basis vector beside the others below which it says nothing of its own.
const DEPENDENT: f64 = 1e-8;

/// Frequency [rad/s] and damping ratio of a vibration.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    pub frequency: f64,
    pub damping: f64,
}

impl Pair {
    /// Its damped cosine and sine as functions of time.
    pub fn waves(self) -> [impl Fn(f64) -> f64; 2] {
        let (decay, swing) = (self.damping * self.frequency, self.frequency * (1.0 - self.damping * self.damping).sqrt());
        [0.0, 0.25].map(|turn| move |t: f64| (-decay * t).exp() * (swing * t - TAU * turn).cos())
    }

    /// Their derivatives by ln ω and by ln ζ.
    fn slopes(self) -> [[impl Fn(f64) -> f64; 2]; 2] {
        let (w, z) = (self.frequency, self.damping);
        let root = (1.0 - z * z).sqrt();
        // Rates of decay and swing by the logarithms.
        [(z * w, w * root), (z * w, -w * z * z / root)].map(|(decay, swing)| {
            [0.0, 0.25].map(|turn| {
                move |t: f64| {
                    let phase = w * root * t - TAU * turn;
                    -(-z * w * t).exp() * t * (decay * phase.cos() + swing * phase.sin())
                }
            })
        })
    }
}

/// The functions of time that the numbers are made of, one and two a vibration `[F]`, and an orthonormal basis of them.
pub struct Basis {
    /// The functions.
    functions: Vec<Vec<f64>>,
    orthonormal: Vec<Vec<f64>>,
    /// Which function each of them was made of, and the functions' parts along them `[functions][orthonormal]`.
    of: Vec<usize>,
    parts: Vec<Vec<f64>>,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

impl Basis {
    pub fn new(times: &[f64], pairs: &[Pair]) -> Basis {
        let mut functions = vec![vec![1.0; times.len()]];
        for p in pairs {
            functions.extend(p.waves().map(|w| times.iter().map(|t| w(*t)).collect()));
        }
        let mut b = Basis { orthonormal: Vec::new(), of: Vec::new(), parts: Vec::new(), functions };
        for (k, f) in b.functions.iter().enumerate() {
            let mut v = f.clone();
            let mut parts = vec![0.0; b.orthonormal.len()];
            // Twice is enough (Kahan & Parlett).
            for _ in 0..2 {
                for (q, part) in b.orthonormal.iter().zip(&mut parts) {
                    let s = dot(q, &v);
                    *part += s;
                    v.iter_mut().zip(q).for_each(|(x, y)| *x -= s * y);
                }
            }
            let length = dot(&v, &v).sqrt();
            if length > DEPENDENT * dot(f, f).sqrt() {
                v.iter_mut().for_each(|x| *x /= length);
                b.orthonormal.push(v);
                b.of.push(k);
                parts.push(length);
            }
            b.parts.push(parts);
        }
        b
    }

    /// What is left of the columns, and the sum of its squares.
    pub fn residual(&self, data: &Mat<f64>) -> (Mat<f64>, f64) {
        let mut left = data.clone();
        for c in 0..data.ncols() {
            for q in &self.orthonormal {
                let s: f64 = q.iter().enumerate().map(|(f, x)| x * left[(f, c)]).sum();
                q.iter().enumerate().for_each(|(f, x)| left[(f, c)] -= s * x);
            }
        }
        let squares = (0..data.ncols()).map(|c| (0..data.nrows()).map(|f| left[(f, c)].powi(2)).sum::<f64>()).sum();
        (left, squares)
    }

    /// Coefficients of the functions `[functions, C]`, by least squares.
    pub fn coefficients(&self, data: &Mat<f64>) -> Mat<f64> {
        let mut all = Mat::zeros(self.functions.len(), data.ncols());
        for c in 0..data.ncols() {
            let along: Vec<f64> =
                self.orthonormal.iter().map(|q| q.iter().enumerate().map(|(f, x)| x * data[(f, c)]).sum()).collect();
            for j in (0..self.of.len()).rev() {
                let behind: f64 = (j + 1..self.of.len()).map(|i| self.parts[self.of[i]][j] * all[(self.of[i], c)]).sum();
                all[(self.of[j], c)] = (along[j] - behind) / self.parts[self.of[j]][j];
            }
        }
        all
    }

    /// A function less what the basis has of it.
    fn beside(&self, mut v: Vec<f64>) -> Vec<f64> {
        for q in &self.orthonormal {
            let s = dot(q, &v);
            v.iter_mut().zip(q).for_each(|(x, y)| *x -= s * y);
        }
        v
    }
}

/// The vibration that, beside those that are there, leaves the least; `None` where no residual is finite.
pub fn scan(times: &[f64], there: &[Pair], range: (f64, f64), data: &Mat<f64>) -> Option<Pair> {
    let step = TAU / (FINE * times[times.len() - 1]);
    let count = ((range.1 - range.0) / step).floor() as usize;
    let frequencies = (0..=count).map(|k| range.0 + step * k as f64);
    let all = frequencies.flat_map(|w| DAMPINGS.map(|z| Pair { frequency: w, damping: z }));
    let worth = |p: &Pair| {
        let with: Vec<Pair> = there.iter().copied().chain([*p]).collect();
        Basis::new(times, &with).residual(data).1
    };
    all.map(|p| (worth(&p), p)).filter(|(r, _)| r.is_finite()).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, p)| p)
}

/// Derivatives of the residual by the logarithms of all frequencies and dampings, with the basis held where it turns within itself
/// (Kaufman, *BIT* 15, 1975) `[2M][F·k]`.
fn jacobian(times: &[f64], pairs: &[Pair], basis: &Basis, data: &Mat<f64>) -> Vec<Vec<f64>> {
    let c = basis.coefficients(data);
    let mut all = Vec::new();
    for (m, p) in pairs.iter().enumerate() {
        for [cosine, sine] in p.slopes() {
            let [cosine, sine] = [
                basis.beside(times.iter().map(|t| cosine(*t)).collect()),
                basis.beside(times.iter().map(|t| sine(*t)).collect()),
            ];
            let of = |k: usize| {
                let (a, b) = (c[(1 + 2 * m, k)], c[(2 + 2 * m, k)]);
                cosine.iter().zip(&sine).map(move |(x, y)| -(a * x + b * y)).collect::<Vec<f64>>()
            };
            all.push((0..data.ncols()).flat_map(of).collect());
        }
    }
    all
}

fn flat(m: &Mat<f64>) -> Vec<f64> {
    (0..m.ncols()).flat_map(|c| (0..m.nrows()).map(move |f| m[(f, c)])).collect()
}

fn normal(j: &[Vec<f64>], damping: f64) -> Vec<f64> {
    let q = j.len();
    let mut a: Vec<f64> = (0..q * q).map(|k| dot(&j[k / q], &j[k % q])).collect();
    (0..q).for_each(|i| a[i * q + i] *= 1.0 + damping);
    a
}

/// The pairs of the least residual near these, and its sum of squares: Gauss–Newton's method with Marquardt's damping.
pub fn refine(times: &[f64], pairs: &[Pair], range: (f64, f64), data: &Mat<f64>) -> (Vec<Pair>, f64) {
    let mut at = pairs.to_vec();
    let mut basis = Basis::new(times, &at);
    let (mut left, mut squares) = basis.residual(data);
    let mut damping = 1e-3;
    for _ in 0..ROUNDS {
        let j = jacobian(times, &at, &basis, data);
        let slope: Vec<f64> = j.iter().map(|d| -dot(d, &flat(&left))).collect();
        let Some(step) = solve(&normal(&j, damping), &slope) else { break };
        let moved = |(m, p): (usize, &Pair)| Pair {
            frequency: (p.frequency * step[2 * m].clamp(-0.5, 0.5).exp()).clamp(range.0, range.1),
            damping: (p.damping * step[2 * m + 1].clamp(-2.0, 2.0).exp()).clamp(LEAST, MOST),
        };
        let next: Vec<Pair> = at.iter().enumerate().map(moved).collect();
        let trial = Basis::new(times, &next);
        let (rest, now) = trial.residual(data);
        if now < squares {
            let arrived = squares - now <= ARRIVED * squares;
            (at, basis, left, squares) = (next, trial, rest, now);
            damping = f64::max(0.2 * damping, 1e-9);
            if arrived {
                break;
            }
        } else if damping > 1e6 {
            break;
        } else {
            damping *= 5.0;
        }
    }
    (at, squares)
}

/// Standard errors of frequency and damping of each pair, from how much is left `[2M]`; infinite where it cannot be said.
pub fn errors(times: &[f64], pairs: &[Pair], data: &Mat<f64>) -> Vec<f64> {
    let basis = Basis::new(times, pairs);
    let squares = basis.residual(data).1;
    let j = jacobian(times, pairs, &basis, data);
    let q = j.len();
    let unknowns = q + basis.orthonormal.len() * data.ncols();
    let freedom = (data.nrows() * data.ncols()).saturating_sub(unknowns).max(1) as f64;
    let a = normal(&j, 0.0);
    let of = |i: usize| {
        let unit: Vec<f64> = (0..q).map(|k| f64::from(u8::from(k == i))).collect();
        let relative = solve(&a, &unit).map_or(f64::INFINITY, |x| (x[i] * squares / freedom).sqrt());
        relative * if i.is_multiple_of(2) { pairs[i / 2].frequency } else { pairs[i / 2].damping }
    };
    (0..q).map(of).collect()
}
