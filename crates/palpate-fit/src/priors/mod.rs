//! Priors of fields: what is expected of many values together before the recording is looked at.
//!
//! A problem with n residuals and data cost J has the cost `J + (t/n) Σ E(m)` with m the logarithms of a field's values and E minus the
//! logarithm of its prior's density. t says how many residuals count as one reading of the stated noise: the design effect times the
//! reduced χ² where that is above one. So n/t times the cost is minus the logarithm of the posterior density. t is measured on the way
//! ([`choose`]).
//!
//! Of a field this room knows what each value stands for and which lie beside each other.

pub(crate) mod choose;
mod evidence;
mod factor;
mod grid;
mod lowrank;
mod mixture;
mod posterior;
mod precision;
#[cfg(test)]
mod precision_tests;
#[cfg(test)]
mod tests;

pub use evidence::Tried;
pub use posterior::FieldPosterior;
pub(crate) use posterior::{UNDETERMINED, assess};
pub use precision::Mean;
pub(crate) use precision::Precision;

use crate::problem::Problem;
use palpate_model::params::Transform;
use palpate_model::params::fields::PriorKind;
use palpate_model::space::neighbours::Neighbours;
use std::ops::Range;
use std::sync::Arc;

/// What is expected of the values of a field, fitted as logarithms.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldPrior {
    /// What each value stands for, and which lie beside each other.
    pub around: Arc<Neighbours>,
    /// How neighbours go together.
    pub kind: PriorKind,
    /// Length over which values are alike; `None` = the data choose.
    pub length: Option<f64>,
    /// Standard deviation of logarithms, or typical height of their steps; `None` = the data choose.
    pub deviation: Option<f64>,
    /// Of the logarithms' mean.
    pub mean: Mean,
}

impl FieldPrior {
    /// All that decides what it does, in a line.
    pub(crate) fn text(&self) -> String {
        let numbers = self.around.volume.iter().copied().chain(self.around.links.iter().flat_map(|l| [l.area, l.distance]));
        // FNV-1a.
        let hash = numbers.fold(0xcbf2_9ce4_8422_2325_u64, |h, x| (h ^ x.to_bits()).wrapping_mul(0x0100_0000_01b3));
        format!("{} {:?} {:?} {:?} {hash:016x}", self.kind.name(), self.length, self.deviation, self.mean)
    }
}

/// Numbers that a prior has.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hyper {
    /// Length over which values are alike; 0 of edge-preserving priors.
    pub length: f64,
    /// Standard deviation of logarithms, or typical height of their steps.
    pub deviation: f64,
}

/// The prior of one field of a problem.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    /// Places of the field's values among the q.
    pub range: Range<usize>,
    pub prior: FieldPrior,
    pub hyper: Hyper,
    /// m − z.
    offset: f64,
    /// Of an edge-preserving prior at a constant field.
    base: Arc<Precision>,
}

/// All priors of a problem.
#[derive(Clone, Debug)]
pub(crate) struct Priors {
    pub placed: Vec<Placed>,
    /// Residuals that count as one reading of the stated noise.
    pub temper: f64,
}

/// Precisions at a point, with the places of their values.
pub(crate) type Blocks = Vec<(Range<usize>, Arc<Precision>)>;

impl Placed {
    /// m at z `[q]`.
    pub fn logarithms(&self, z: &[f64]) -> Vec<f64> {
        z[self.range.clone()].iter().map(|z| z + self.offset).collect()
    }

    fn is_matern(&self) -> bool {
        self.prior.kind == PriorKind::Matern
    }

    /// The precision that touches the prior at z `[q]`.
    fn at(&self, z: &[f64]) -> Result<Arc<Precision>, String> {
        match self.is_matern() {
            true => Ok(self.base.clone()),
            false => Precision::new(&self.prior, self.hyper, &self.logarithms(z)).map(Arc::new),
        }
    }

    fn set(&mut self, hyper: Hyper) -> Result<(), String> {
        self.base = Arc::new(match self.is_matern() && hyper.length == self.hyper.length {
            true => self.base.with_deviation(hyper.deviation),
            false => Precision::new(&self.prior, hyper, &vec![0.0; self.range.len()])?,
        });
        self.hyper = hyper;
        Ok(())
    }
}

impl Priors {
    /// Of the free parameters with their places.
    ///
    /// # Errors
    /// What is wrong with a prior, with the path of its field.
    pub fn new<'f>(fields: impl Iterator<Item = (&'f crate::FreeParameter, Range<usize>)>) -> Result<Priors, String> {
        let mut placed = Vec::new();
        for (f, range) in fields {
            let Some(prior) = f.prior.clone() else { continue };
            let wrong = |message: String| format!("parameter {}: {message}", f.path);
            let n = prior.around.volume.len();
            if f.transform != Transform::Log {
                return Err(wrong("a prior of a field is one of logarithms; it is not fitted as its logarithm".into()));
            }
            if n != f.count || n < 2 {
                return Err(wrong(format!("its prior is one of {n} values, it has {}; a prior needs two at least", f.count)));
            }
            let hyper = grid::first(&prior);
            let base = Arc::new(Precision::new(&prior, hyper, &vec![0.0; n]).map_err(wrong)?);
            placed.push(Placed { range, prior, hyper, offset: f.typical.ln(), base });
        }
        Ok(Priors { placed, temper: 1.0 })
    }

    /// True without priors.
    pub fn is_empty(&self) -> bool {
        self.placed.is_empty()
    }

    /// Σ E and its gradient by z `[q]`, at z `[q]`.
    pub fn energy(&self, z: &[f64]) -> (f64, Vec<f64>) {
        let (mut sum, mut gradient) = (0.0, vec![0.0; z.len()]);
        for p in &self.placed {
            let (e, g) = p.base.energy(&p.prior, p.hyper, &p.logarithms(z));
            sum += e;
            gradient[p.range.clone()].copy_from_slice(&g);
        }
        (sum, gradient)
    }

    /// Precisions that touch the priors at z `[q]`: exact ones of Gaussian priors.
    ///
    /// # Errors
    /// One cannot be factorised.
    pub fn at(&self, z: &[f64]) -> Result<Blocks, String> {
        self.placed.iter().map(|p| Ok((p.range.clone(), p.at(z)?))).collect()
    }

    /// Product of their curvature at z `[q]` with a direction `[q]`; of an edge-preserving prior that of the precision which touches it,
    /// positive semi-definite and never below the exact one (lagged diffusivity; Vogel & Oman, SIAM J. Sci. Comput. 17, 1996).
    pub fn product(&self, z: &[f64], v: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; z.len()];
        for p in &self.placed {
            let along = p.base.curvature(&p.prior, p.hyper, &p.logarithms(z), &v[p.range.clone()]);
            out[p.range.clone()].copy_from_slice(&along);
        }
        out
    }
}

impl Problem<'_> {
    /// Sets hyperparameters, one a prior, and how many residuals count as one.
    ///
    /// # Errors
    /// A prior's matrix cannot be factorised.
    pub(crate) fn set_priors(&mut self, hypers: &[Hyper], temper: f64) -> Result<(), String> {
        let priors = self.priors_mut();
        priors.temper = temper;
        priors.placed.iter_mut().zip(hypers).try_for_each(|(p, h)| p.set(*h))
    }
}
