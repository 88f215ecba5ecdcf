//! Damped vibrations of many numbers at once, by variable projection (Golub & Pereyra, *SIAM J. Numer. Anal.* 10, 1973).
//!
//! `y_c(t) = r_c + Σ_m e^(−ζωτ) (a_mc cos ω_d τ + b_mc sin ω_d τ)`, τ = t − t_0, ω_d = ω √(1 − ζ²). For given ω and ζ, what is left is linear, so only those
//! two numbers of each vibration are searched. Vibrations are added one by one as long as Schwarz's criterion (*Ann. Statist.* 6, 1978) is for them.

mod search;
#[cfg(test)]
mod tests;

use faer::{Mat, Side};
use search::{Basis, Pair, refine, scan};
use std::f64::consts::TAU;

/// Components of the motion that are kept, and the singular value, over the largest, below which one tells nothing.
const MOST_COMPONENTS: usize = 12;
const FAINT: f64 = 1e-3;
/// Share of the frame rate up to which a vibration is told from slower ones; above lies what is sampled less than two and a half times.
const FASTEST: f64 = 0.4;
/// Periods that a record holds at least.
const FEWEST_PERIODS: f64 = 0.75;
/// Fewest frames: three unknowns a component and two more, and as many to say how well they fit.
const FEWEST_FRAMES: usize = 8;

/// A damped vibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Vibration {
    /// Undamped angular frequency ω [rad/s].
    pub frequency: f64,
    /// Its standard error [rad/s].
    pub frequency_sd: f64,
    /// Damping ratio ζ.
    pub damping: f64,
    /// Its standard error.
    pub damping_sd: f64,
    /// Amplitudes of the cosine, in the unit of the numbers `[C]`.
    pub cosine: Vec<f64>,
    /// Amplitudes of the sine `[C]`.
    pub sine: Vec<f64>,
    /// Share of the numbers' squares about their means that it makes up.
    pub share: f64,
}

/// The vibrations in a record, the strongest first, `most` of them at most; none where nothing vibrates.
///
/// `times` `[F]` rise [s]; `rows` `[F][C]` are the numbers at each time.
///
/// # Errors
/// Why the record cannot say: too few frames, or nothing moves.
pub fn vibrations(times: &[f64], rows: &[Vec<f64>], most: usize) -> Result<Vec<Vibration>, String> {
    let frames = times.len();
    if frames < FEWEST_FRAMES {
        return Err(format!("{frames} frames are too few to see a vibration in: {FEWEST_FRAMES} are needed"));
    }
    let columns = rows[0].len();
    let since: Vec<f64> = times.iter().map(|t| t - times[0]).collect();
    let length = since[frames - 1];
    let data = centred(rows, columns);
    let reduced = components(&data).ok_or("nothing moves")?;
    let mut gaps: Vec<f64> = times.windows(2).map(|t| t[1] - t[0]).collect();
    gaps.sort_by(f64::total_cmp);
    let range = (TAU * FEWEST_PERIODS / length, TAU * FASTEST / gaps[gaps.len() / 2]);
    if range.0 >= range.1 {
        return Err("the frames are too few, or too far apart, to see a vibration".into());
    }
    let (mut pairs, mut best) = (Vec::new(), Basis::new(&since, &[]).residual(&reduced).1);
    let whole = best;
    for _ in 0..most {
        let Some(next) = scan(&since, &pairs, range, &reduced) else { break };
        let more: Vec<Pair> = pairs.iter().copied().chain([next]).collect();
        let (more, left) = refine(&since, &more, range, &reduced);
        // Each component has two amplitudes more, all of them a frequency and a damping.
        let (n, added) = ((frames * reduced.ncols()) as f64, (2 * reduced.ncols() + 2) as f64);
        let floor = 1e-24 * whole;
        // What is slower or faster than the record can tell ends at the edge of what is searched.
        let inside = |p: &Pair| p.frequency > range.0 * (1.0 + 1e-6) && p.frequency < range.1 * (1.0 - 1e-6);
        if !more.iter().all(inside) || n * (best.max(floor) / left.max(floor)).ln() <= added * n.ln() {
            break;
        }
        (pairs, best) = (more, left);
    }
    let basis = Basis::new(&since, &pairs);
    let errors = search::errors(&since, &pairs, &reduced);
    let amplitudes = basis.coefficients(&data);
    let total: f64 = (0..columns).map(|c| (0..frames).map(|f| data[(f, c)].powi(2)).sum::<f64>()).sum();
    let row = |k: usize| -> Vec<f64> { (0..columns).map(|c| amplitudes[(k, c)]).collect() };
    let mut all: Vec<Vibration> = pairs
        .iter()
        .enumerate()
        .map(|(m, p)| {
            let (cosine, sine) = (row(1 + 2 * m), row(2 + 2 * m));
            let [c, s] = p.waves();
            let part = |f: usize, i: usize| c(since[f]) * cosine[i] + s(since[f]) * sine[i];
            let squares: f64 = (0..columns).map(|i| (0..frames).map(|f| part(f, i).powi(2)).sum::<f64>()).sum();
            Vibration {
                frequency: p.frequency,
                frequency_sd: errors[2 * m],
                damping: p.damping,
                damping_sd: errors[2 * m + 1],
                share: squares / total,
                cosine,
                sine,
            }
        })
        .collect();
    all.sort_by(|a, b| b.share.total_cmp(&a.share));
    Ok(all)
}

/// The numbers less their means `[F, C]`.
fn centred(rows: &[Vec<f64>], columns: usize) -> Mat<f64> {
    let mean: Vec<f64> = (0..columns).map(|c| rows.iter().map(|r| r[c]).sum::<f64>() / rows.len() as f64).collect();
    Mat::from_fn(rows.len(), columns, |f, c| rows[f][c] - mean[c])
}

/// The strongest components of the motion `[F, k]`, by the smaller of the two products of the data with themselves; `None` where all is still.
fn components(data: &Mat<f64>) -> Option<Mat<f64>> {
    let wide = data.ncols() > data.nrows();
    let product = if wide { data * data.transpose() } else { data.transpose() * data };
    let eigen = product.self_adjoint_eigen(Side::Lower).ok()?;
    let n = product.nrows();
    let largest = eigen.S()[n - 1];
    if largest <= 0.0 || largest.is_nan() {
        return None;
    }
    let kept = (0..n).rev().take(MOST_COMPONENTS).take_while(|k| eigen.S()[*k] > FAINT * FAINT * largest).count();
    let vectors = Mat::from_fn(n, kept, |i, k| eigen.U()[(i, n - 1 - k)]);
    Some(match wide {
        true => Mat::from_fn(n, kept, |i, k| vectors[(i, k)] * eigen.S()[n - 1 - k].sqrt()),
        false => data * &vectors,
    })
}
