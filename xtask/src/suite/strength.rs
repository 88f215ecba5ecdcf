//! How far a hidden effect moves readings, in standard deviations, once everything that is free has been fitted again; and the amplitude
//! at which it moves them by so much.
//!
//! The diagnosis' own grid without noise. To first order: r(a) are the residuals of a recording with nothing hidden against the scene with
//! amplitude a, and the columns S of the free numbers, projected out of d = (r(a) − r(0))/σ, are what refitting them absorbs. The strength is
//! the root mean square of what is left of a recording with amplitude a when the scene without it is really fitted, which first order only
//! leads to.

use super::record::{Maker, observed};
use super::regions::{Moved, rms};
use super::setup::Setup;
use palpate::{Error, Experiment, FitOptions, fit};
use palpate_cpu::CpuBackend;
use palpate_engine::{Linearised, ResidualRow, Rollout};
use palpate_model::scene::Scene;
use std::path::{Path, PathBuf};

/// Most simulations of a search for an amplitude.
const TRIES: usize = 10;
/// Fits that make up for what strengths to first order miss, and their iterations.
const REFITS: usize = 4;
/// See [`REFITS`].
const REFIT: usize = 8;
/// Logarithm of the strength over the one aimed at that is close enough after a refit.
const CLOSE: f64 = 0.3;
/// Largest amplitude: effects beyond so many times their typical size are not what anybody would look for.
const MOST: f64 = 10.0;
/// Relative accuracy of the strength; strengths of 3 and 10 stay far apart.
const NEAR: f64 = 0.12;

/// The ruler of a scene: its residuals with nothing hidden, and what its free numbers absorb.
pub struct Ruler<'a> {
    setup: &'a Setup,
    folder: PathBuf,
    scene: Scene,
    rows: Vec<ResidualRow>,
    times: Vec<f64>,
    /// Orthonormal columns `[Q][R]`.
    free: Vec<Vec<f64>>,
}

impl<'a> Ruler<'a> {
    /// Makes the ruler of a setup; its recordings are kept in `folder`.
    ///
    /// # Errors
    /// The scene cannot be simulated.
    pub fn new(setup: &'a Setup, folder: &Path) -> Result<Ruler<'a>, Error> {
        let e = observed(setup, &setup.truth(false)?, &Maker::own(), &folder.join("plain"), false)?;
        let scene = e.scene().clone();
        let paths = scene.fit.iter().flat_map(|f| &f.parameters);
        let free: Vec<usize> = paths.flat_map(|p| e.plan().layout.resolve(&p.path)).collect();
        let l = linearise(&e, &e.plan().theta, &free)?;
        let q = free.len();
        let column = |k: usize| -> Vec<f64> {
            let of = |(i, r): (usize, &ResidualRow)| r.value.map_or(0.0, |_| l.rows.sensitivity[i * q + k] / r.noise);
            l.rows.residuals.iter().enumerate().map(of).collect()
        };
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for k in 0..q {
            let mut c = column(k);
            project(&basis, &mut c);
            let norm = c.iter().map(|x| x * x).sum::<f64>().sqrt();
            if norm > 0.0 {
                c.iter_mut().for_each(|x| *x /= norm);
                basis.push(c);
            }
        }
        let times = l.rows.residuals.iter().map(|r| e.plan().observation.frames[r.frame].time).collect();
        Ok(Ruler { setup, folder: folder.to_path_buf(), scene, rows: l.rows.residuals, times, free: basis })
    }

    /// What the scene without a change leaves of a recording with it, once the free numbers are fitted to that.
    ///
    /// # Errors
    /// It cannot be simulated.
    pub fn left(&self, change: impl FnOnce(&mut Scene) -> Result<(), Error>) -> Result<Vec<Moved>, Error> {
        let mut hidden = self.setup.truth(false)?;
        change(&mut hidden)?;
        let e = observed(self.setup, &hidden, &Maker::own(), &self.folder.join("changed"), false)?;
        left(&e)
    }

    /// The same to first order.
    fn moved(&self, change: impl FnOnce(&mut Scene) -> Result<(), Error>) -> Result<Vec<Moved>, Error> {
        let e = self.changed(change)?;
        Ok(self.compare(&linearise(&e, &e.plan().theta, &[])?))
    }

    fn changed(&self, change: impl FnOnce(&mut Scene) -> Result<(), Error>) -> Result<Experiment, Error> {
        let mut scene = self.scene.clone();
        change(&mut scene)?;
        Experiment::new(scene, String::new(), Vec::new())
    }

    fn compare(&self, l: &Linearised) -> Vec<Moved> {
        let difference = |(a, b): (&ResidualRow, &ResidualRow)| match (a.value, b.value) {
            (Some(a), Some(v)) => (a - v) / b.noise,
            _ => 0.0,
        };
        let mut d: Vec<f64> = l.rows.residuals.iter().zip(&self.rows).map(difference).collect();
        project(&self.free, &mut d);
        let moved = |((change, r), time): ((f64, &ResidualRow), &f64)| Moved {
            stream: r.source.stream(),
            rest: r.rest,
            time: *time,
            change,
        };
        d.into_iter().zip(&self.rows).zip(&self.times).map(moved).collect()
    }

    /// Amplitude at which an effect has a strength, as nearly as it can be reached within the allowed values.
    ///
    /// # Errors
    /// No amplitude can be simulated.
    pub fn amplitude(&self, target: f64, put: impl Fn(&mut Scene, f64) -> Result<(), Error>) -> Result<f64, Error> {
        let mut a = self.rough_amplitude(target, &put)?;
        let mut best: Option<(f64, f64)> = None;
        // To first order a refit absorbs less than it really does where numbers move far.
        for _ in 0..REFITS {
            match self.left(|s| put(s, a)) {
                Ok(left) => {
                    let s = rms(&left).max(1e-6);
                    let off = (s / target).ln().abs();
                    if best.is_none_or(|b| off < b.0) {
                        best = Some((off, a));
                    }
                    let next = (a * (target / s).clamp(0.3, 3.0)).min(MOST);
                    if off < CLOSE || next == a {
                        break;
                    }
                    a = next;
                }
                // What no fit can follow is too much.
                Err(_) => a *= 0.6,
            }
        }
        best.map(|b| b.1).ok_or_else(|| Error::Failed("no fit follows any amplitude".into()))
    }

    /// The amplitude by strengths to first order.
    fn rough_amplitude(&self, target: f64, put: &impl Fn(&mut Scene, f64) -> Result<(), Error>) -> Result<f64, Error> {
        let mut a = 1.0;
        let mut best: Option<(f64, f64)> = None;
        // Smallest amplitude that was refused, largest that was too weak, smallest that was too strong.
        let mut ceiling = f64::INFINITY;
        let (mut low, mut high) = (0.0, f64::INFINITY);
        let mut last = None;
        for _ in 0..TRIES {
            match self.moved(|s| put(s, a)) {
                Ok(m) => {
                    let s = rms(&m);
                    let off = |x: f64| (x / target).max(1e-9).ln().abs();
                    if best.is_none_or(|b| off(s) < off(b.1)) {
                        best = Some((a, s));
                    }
                    if (s / target - 1.0).abs() < NEAR {
                        break;
                    }
                    if s < target {
                        low = f64::max(low, a);
                    } else {
                        high = f64::min(high, a);
                    }
                    let next = a * (target / s.max(1e-6)).clamp(0.2, 5.0);
                    let bracketed = low > 0.0 && low < high && high.is_finite();
                    a = match next {
                        // Of what sets in all at once, as a wall that is touched or not.
                        _ if bracketed && !(low..high).contains(&next) => (low * high).sqrt(),
                        _ if next >= ceiling => 0.5 * (a + ceiling),
                        _ if a >= MOST && next >= MOST => break,
                        _ => next.min(MOST),
                    };
                }
                Err(e) => {
                    ceiling = ceiling.min(a);
                    a = best.map_or(0.3 * a, |b| 0.5 * (b.0 + a));
                    last = Some(e);
                }
            }
        }
        best.map(|b| b.0).ok_or_else(|| last.unwrap_or_else(|| Error::Failed("no amplitude was tried".into())))
    }
}

/// What an experiment leaves of its recording once its free numbers are fitted.
///
/// # Errors
/// It cannot be fitted.
pub fn left(e: &Experiment) -> Result<Vec<Moved>, Error> {
    let options = FitOptions { starts: Some(1), iterations: Some(REFIT), ..FitOptions::default() };
    let theta = fit(std::slice::from_ref(e), options)?.result.theta.remove(0);
    let rows = linearise(e, &theta, &[])?.rows.residuals;
    let time = |r: &ResidualRow| e.plan().observation.frames[r.frame].time;
    let moved = |r: &ResidualRow| Moved {
        stream: r.source.stream(),
        rest: r.rest,
        time: time(r),
        change: r.value.map_or(0.0, |v| v / r.noise),
    };
    Ok(rows.iter().map(moved).collect())
}

/// Residuals of an experiment at θ, and their derivatives along some places in it.
fn linearise(e: &Experiment, theta: &[f64], directions: &[usize]) -> Result<Linearised, Error> {
    Ok(Rollout::new(CpuBackend, e.plan(), 1)?.linearise(theta, directions)?)
}

fn project(basis: &[Vec<f64>], v: &mut [f64]) {
    for b in basis {
        let along: f64 = b.iter().zip(v.iter()).map(|(b, v)| b * v).sum();
        v.iter_mut().zip(b).for_each(|(v, b)| *v -= along * b);
    }
}
