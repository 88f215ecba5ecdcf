//! Gauss–Newton with Levenberg–Marquardt damping in a box.
//!
//! After a step that is taken, damping follows Nielsen's rule (Madsen, Nielsen & Tingleff, Methods for Non-Linear Least Squares
//! Problems, 2nd ed. 2004, eq. 2.21); after one that is refused, it makes the next half as long. It counts in each number's own
//! curvature (Marquardt, J. SIAM 11, 1963, § 4), so that a number that the data say a thousandth as much of moves as early as the
//! others. A step may also not exceed a length in z: parameters far from their optimum otherwise jump
//! into regions where a simulation fails. Where the cost jumps, a [`Watchdog`] looks at the other side.
//!
//! It ends where a free step promises less than a hundredth of a standard error ([`crate::Tolerance::decrement`]): what is left to gain
//! says nothing that the noise does not hide.
//!
//! The model of the cost is a matrix from forward sensitivities, or products with it ([`super::conjugate`]): the way is the same.

use super::conjugate::{self, Model};
use super::metric::{self, Metric};
use super::watchdog::{Stand, Watchdog};
use super::{Sample, Search, Status, Stop};
use crate::dense::{box_step, dot, max_abs};
use crate::settings::Walk;

/// Added to the diagonal, relative to its largest entry, so that undetermined directions stay put.
const FLOOR: f64 = 1e-12;
/// With more damping than this nothing moves.
const MOST_DAMPING: f64 = 1e20;
/// Damping of a step that counts as free.
const FREE: f64 = 1e-9;
/// If an undamped step promises less than this share of the cost, rejections come from the accuracy of the cost itself.
const COST_NOISE: f64 = 1e-5;
/// Two costs that differ by less of themselves are the same in single precision.
const SAME_COST: f64 = 1e-6;
/// So many rejected steps in a row that changed nothing, where nothing is promised either, are the end: shorter ones only follow rounding.
const LEVEL: u32 = 2;

/// How the curvature of the cost is known.
enum Curvature {
    /// As the matrix of every sample.
    Matrix,
    /// By products; its size along the first gradient stands for the largest diagonal entry.
    /// With priors of fields it is measured in their precision, of size one.
    Products { size: f64, steepest: f64, numbers: Vec<(usize, f64)> },
}

impl Curvature {
    /// What damping counts in: each number's own curvature where all are known, and the size of one that is not.
    fn unit(&self) -> f64 {
        match self {
            Curvature::Matrix => 1.0,
            Curvature::Products { size, .. } => *size,
        }
    }

    /// Damping at the start. A start value is a guess, from which half the step of the linear model is taken. One size for all directions
    /// has to let those of far less curvature move.
    fn first(&self) -> f64 {
        match self {
            Curvature::Matrix => 1.0,
            Curvature::Products { size, .. } => 1e-3 * size,
        }
    }
}

/// With the curvature of forward sensitivities.
pub fn minimise(search: &mut Search, z: Vec<f64>, at: Sample) -> Result<Status, Stop> {
    walk(search, z, at, &Curvature::Matrix)
}

/// With products by tangent and adjoint, for very many parameters.
pub fn minimise_by_products(search: &mut Search, z: Vec<f64>, at: Sample) -> Result<Status, Stop> {
    let g = search.projected_gradient(&z, &at.gradient);
    if search.priors.is_some() {
        let numbers = metric::numbers(search, &z, &at)?;
        let steepest = Metric::new(search, &z, &at, &numbers)?.steepness(&g);
        return walk(search, z, at, &Curvature::Products { size: 1.0, steepest, numbers });
    }
    let square = dot(&g, &g);
    let size = if square > 0.0 { dot(&g, &search.product(&z, &g)?) / square } else { 0.0 };
    walk(search, z, at, &Curvature::Products { size, steepest: square.sqrt(), numbers: Vec::new() })
}

/// How an iteration went.
enum Next {
    /// The walk ends here.
    Ended(Status),
    /// A shorter step has to be tried; nothing was evaluated.
    Shorter,
    /// The step was taken.
    Taken,
    /// This point was refused.
    Refused(Vec<f64>, Sample),
}

fn walk(search: &mut Search, z: Vec<f64>, at: Sample, curvature: &Curvature) -> Result<Status, Stop> {
    // The largest finite number stands for no limit in files.
    let reach = Some(search.settings.walk.reach).filter(|r| *r < f64::MAX).unwrap_or(search.settings.max_step);
    let mut stand = Stand { z, at, walk: Walk { reach, ..search.settings.walk } };
    let mut watchdog = Watchdog::default();
    loop {
        let before = stand.walk;
        stand = match iterate(search, &mut stand, curvature)? {
            Next::Shorter => continue,
            Next::Ended(Status::IterationLimit) => return Ok(Status::IterationLimit),
            Next::Ended(status) => match watchdog.back() {
                Some(home) => {
                    stand = home;
                    continue;
                }
                None => return Ok(status),
            },
            Next::Taken => watchdog.taken(stand),
            Next::Refused(z, at) => watchdog.refused(&before, stand, (z, at), COST_NOISE),
        };
        let counts = watchdog.counts(&stand);
        search.walk = counts.walk;
        search.iterated(counts.at.cost, &counts.z);
    }
}

/// One step, taken or refused.
fn iterate(search: &mut Search, stand: &mut Stand, curvature: &Curvature) -> Result<Next, Stop> {
    let Stand { z, at, walk } = stand;
    let q = z.len();
    let tolerance = search.settings.tolerance.clone();
    let unit = curvature.unit();
    // Where λ counts in each number's curvature h, a step g / (h (1 + λ)) becomes half as long.
    let halved = |lambda: f64| 2.0 * lambda + unit;
    if matches!(curvature, Curvature::Matrix) && at.curvature.len() != q * q {
        return Ok(Next::Ended(Status::Failed("no sensitivities were computed".into())));
    }
    if search.is_flat(z, at) {
        return Ok(Next::Ended(Status::Converged));
    }
    if search.out_of_iterations() {
        return Ok(Next::Ended(Status::IterationLimit));
    }
    let scale = match curvature {
        Curvature::Matrix => (0..q).fold(0.0, |m: f64, i| m.max(at.curvature[i * q + i])),
        Curvature::Products { size, .. } => *size,
    };
    if scale <= 0.0 {
        return Ok(Next::Ended(Status::Stalled));
    }
    let longest = walk.reach;
    let lambda = *walk.damping.get_or_insert(curvature.first());
    let Some((p, promised)) = step(search, z, at, curvature, lambda, scale, longest)? else {
        if lambda > MOST_DAMPING * unit {
            return Ok(Next::Ended(Status::Stalled));
        }
        walk.damping = Some(halved(lambda));
        return Ok(Next::Shorter);
    };
    let length = max_abs(&p);
    let limited = length >= longest * (1.0 - 1e-12);
    if length <= tolerance.step || promised <= tolerance.cost * at.cost {
        let ends = settled(search, z, at, curvature, scale)?;
        return Ok(Next::Ended(if ends { Status::Converged } else { Status::Stalled }));
    }
    // A damped step promises less than a free one: that is asked where the first is near the end, as it may cost products.
    if search.decrement(at, promised) <= tolerance.decrement {
        let free = free_step(search, z, at, curvature, scale)?;
        if free.is_some_and(|(_, promised)| search.decrement(at, promised) <= tolerance.decrement) {
            return Ok(Next::Ended(Status::Converged));
        }
    }
    let trial_z = search.project(&(0..q).map(|i| z[i] + p[i]).collect::<Vec<_>>());
    let trial = search.evaluate(&trial_z)?;
    if trial.cost < at.cost {
        let ratio = (at.cost - trial.cost) / promised;
        walk.damping = Some(lambda * (1.0 - (2.0 * ratio - 1.0).powi(3)).clamp(1.0 / 3.0, 2.0));
        if ratio > 0.75 && limited {
            walk.reach *= 2.0;
        }
        walk.level = 0;
        (*z, *at) = (trial_z, trial);
        return Ok(Next::Taken);
    }
    walk.level = if trial.cost <= at.cost * (1.0 + SAME_COST) { walk.level + 1 } else { 0 };
    if walk.level == LEVEL && settled(search, z, at, curvature, scale)? {
        return Ok(Next::Ended(Status::Converged));
    }
    // A failure says nothing about the curvature, only that the step was too long.
    if trial.failure.is_some() {
        walk.reach = 0.25 * length;
    } else {
        walk.damping = Some(halved(lambda));
        walk.reach *= if limited { 0.5 } else { 1.0 };
    }
    Ok(Next::Refused(trial_z, trial))
}

/// Minimiser of the damped model within the box and the longest step, and the decrease that the undamped model promises for it; `None`
/// where the model is not positive definite. Damping counts in [`Curvature::unit`].
fn step(
    search: &mut Search,
    z: &[f64],
    at: &Sample,
    curvature: &Curvature,
    damping: f64,
    scale: f64,
    longest: f64,
) -> Result<Option<(Vec<f64>, f64)>, Stop> {
    let q = z.len();
    if let Curvature::Products { steepest, numbers, .. } = curvature {
        let metric = Metric::new(search, z, at, numbers)?;
        let damping = damping + FLOOR * scale;
        let model = Model { z, gradient: &at.gradient, damping, longest, steepest: *steepest, metric: &metric };
        return conjugate::step(search, &model).map(Some);
    }
    let mut h = at.curvature.clone();
    (0..q).for_each(|i| h[i * q + i] += damping * at.curvature[i * q + i] + FLOOR * scale);
    let lower: Vec<f64> = (0..q).map(|i| (search.lower[i] - z[i]).clamp(-longest, 0.0)).collect();
    let upper: Vec<f64> = (0..q).map(|i| (search.upper[i] - z[i]).clamp(0.0, longest)).collect();
    let promise = |p: Vec<f64>| {
        let hp: Vec<f64> = (0..q).map(|i| dot(&at.curvature[i * q..(i + 1) * q], &p)).collect();
        let promised = -dot(&at.gradient, &p) - 0.5 * dot(&p, &hp);
        (p, promised)
    };
    Ok(box_step(&h, &at.gradient, &lower, &upper).map(promise))
}

/// A step that is hardly damped.
fn free_step(
    search: &mut Search,
    z: &[f64],
    at: &Sample,
    curvature: &Curvature,
    scale: f64,
) -> Result<Option<(Vec<f64>, f64)>, Stop> {
    step(search, z, at, curvature, FREE * curvature.unit(), scale, search.settings.max_step)
}

/// The decrease of the cost that a free step from a sample promises; 0 where it has no curvature that leads down.
pub fn promised(search: &mut Search, z: &[f64], at: &Sample) -> f64 {
    let q = z.len();
    if at.curvature.len() != q * q {
        return 0.0;
    }
    let scale = (0..q).fold(0.0, |m: f64, i| m.max(at.curvature[i * q + i]));
    let free = free_step(search, z, at, &Curvature::Matrix, scale);
    free.ok().flatten().map_or(0.0, |(_, promised)| promised.max(0.0))
}

/// True if even a free step would gain next to nothing.
fn settled(search: &mut Search, z: &[f64], at: &Sample, curvature: &Curvature, scale: f64) -> Result<bool, Stop> {
    let tolerance = search.settings.tolerance.step;
    Ok(free_step(search, z, at, curvature, scale)?
        .is_some_and(|(p, promised)| max_abs(&p) <= tolerance || promised <= COST_NOISE * at.cost))
}
