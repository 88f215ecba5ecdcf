//! Which hyperparameters the data speak for: the Laplace approximation of their evidence (MacKay, Neural Computation 4, 1992).
//!
//! Where the data are taken as quadratic around the field that was found, `minus log-likelihood = const − dᵀm + ½ mᵀAm`, the evidence of a prior of
//! covariance C is `½ dᵀ(A + C⁻¹)⁻¹d − ½ ln det(1 + CA)` but for a constant. With A = Σ μ (Px)(Px)ᵀ ([`super::lowrank`]) and d in the span of
//! the Px all of it is algebra of as many rows as there are μ: `W = (PX)ᵀ C (PX)` holds all that another prior changes, and
//! ½ Σ ln(1 + μ′) is that of its own eigenvalues. So a whole grid of hyperparameters costs no simulation. The search then fits with the best
//! and looks again ([`super::choose`]).

use super::lowrank::{LowRank, Reduced};
use super::{Hyper, Placed, Precision};
use crate::dense::{dot, eigen, solve};

/// One prior that was tried.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tried {
    /// Its numbers; a deviation of 0 is a field of one value.
    pub hyper: Hyper,
    /// Logarithm of the evidence over that of the best.
    pub evidence: f64,
}

/// The data, as quadratic around a found field.
pub(super) struct Quadratic {
    /// μ `[r]`.
    values: Vec<f64>,
    /// d along the directions x `[r]`.
    d: Vec<f64>,
    /// P x by field `[fields][r][N]`.
    against: Vec<Vec<Vec<f64>>>,
}

impl Quadratic {
    /// At the point of `reduced`, with m `[q]` there (zero for numbers) and the data's gradient `[q]` in units of the log-likelihood; `scale` is
    /// what another count of residuals makes of that.
    pub fn new(reduced: &Reduced, low: &LowRank, m: &[f64], gradient: &[f64], scale: f64) -> Quadratic {
        let g = reduced.without_numbers(gradient);
        // d = A m − g along x; xᵀA = μ (Px)ᵀ.
        let along = |k: usize| scale * (low.values[k] * dot(&low.against[k], m) - dot(&low.along[k], &g));
        let by_field =
            |range: &std::ops::Range<usize>| low.against.iter().map(|px| px[range.clone()].to_vec()).collect::<Vec<Vec<f64>>>();
        Quadratic {
            d: (0..low.values.len()).map(along).collect(),
            values: low.values.iter().map(|m| scale * m).collect(),
            against: reduced.blocks.iter().map(|(range, _)| by_field(range)).collect(),
        }
    }

    /// μ `[r]`.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// d along x `[r]`.
    pub fn d(&self) -> &[f64] {
        &self.d
    }

    /// P x of a field `[r][N]`.
    pub fn against(&self, field: usize) -> &[Vec<f64>] {
        &self.against[field]
    }

    /// The part of W `[r, r]` that deviations of one field from its mean leave alone.
    pub fn rest(&self, reduced: &Reduced, field: usize) -> Vec<f64> {
        let r = self.values.len();
        let mut rest = vec![0.0; r * r];
        let mut add = |w: Vec<f64>| rest.iter_mut().zip(w).for_each(|(o, w)| *o += w);
        for (k, (_, p)) in reduced.blocks.iter().enumerate() {
            add(self.mean(k, p));
            if k != field {
                add(self.gram(k, p));
            }
        }
        rest
    }

    /// (PX)ᵀ S (PX) of a field's deviations for a precision `[r, r]`, and the field's share of the mean, (PX)ᵀ 1 `[r]`.
    pub fn gram(&self, field: usize, p: &Precision) -> Vec<f64> {
        let px = &self.against[field];
        let solved = p.deviations(px);
        let r = px.len();
        (0..r * r).map(|k| 0.5 * (dot(&px[k / r], &solved[k % r]) + dot(&px[k % r], &solved[k / r]))).collect()
    }

    /// Variance of a field's mean as it stands in W.
    pub fn mean(&self, field: usize, p: &Precision) -> Vec<f64> {
        let sums: Vec<f64> = self.against[field].iter().map(|px| px.iter().sum()).collect();
        let (r, variance) = (sums.len(), p.mean_deviation().powi(2));
        (0..r * r).map(|k| variance * sums[k / r] * sums[k % r]).collect()
    }

    /// Log-evidence for W `[r, r]`.
    pub fn evidence(&self, w: &[f64]) -> f64 {
        let r = self.values.len();
        let root: Vec<f64> = self.values.iter().map(|m| m.sqrt()).collect();
        let g: Vec<f64> = (0..r * r).map(|k| root[k / r] * w[k] * root[k % r]).collect();
        let Some((own, _)) = eigen(&g, r) else { return f64::NEG_INFINITY };
        let occam: f64 = own.iter().map(|m| m.max(0.0).ln_1p()).sum();
        // dᵀ(A + C⁻¹)⁻¹d = dᵀWd − cᵀ(1 + G)⁻¹c with c = D^½ W d: as dᵀ D^-½ [1 − (1 + G)⁻¹] D^-½ d, free of cancellation.
        let scaled: Vec<f64> = self.d.iter().zip(&root).map(|(d, s)| d / s).collect();
        let one: Vec<f64> = (0..r * r).map(|k| g[k] + if k / r == k % r { 1.0 } else { 0.0 }).collect();
        let Some(rest) = solve(&one, &scaled) else { return f64::NEG_INFINITY };
        0.5 * (dot(&scaled, &scaled) - dot(&scaled, &rest)) - 0.5 * occam
    }
}

/// Every prior of one field that may be chosen with its log-evidence, the others as they are; that of one value last.
///
/// # Errors
/// A prior's matrix cannot be factorised.
pub(super) fn tried(quadratic: &Quadratic, placed: &[Placed], reduced: &Reduced, field: usize) -> Result<Vec<Tried>, String> {
    let rest = quadratic.rest(reduced, field);
    let own = &placed[field];
    let (lengths, deviations) = super::grid::tried(&own.prior);
    let m = own.logarithms(reduced.point());
    let mut out = Vec::new();
    for length in lengths {
        let mut unit: Option<Vec<f64>> = None;
        for deviation in &deviations {
            let hyper = Hyper { length, deviation: *deviation };
            let gram = match (&unit, own.is_matern()) {
                // Only the size differs.
                (Some(unit), true) => unit.iter().map(|u| u * deviation * deviation).collect(),
                _ => {
                    let gram = quadratic.gram(field, &Precision::new(&own.prior, hyper, &m)?);
                    unit = Some(gram.iter().map(|g| g / (deviation * deviation)).collect());
                    gram
                }
            };
            let w: Vec<f64> = rest.iter().zip(&gram).map(|(a, b)| a + b).collect();
            out.push(Tried { hyper, evidence: quadratic.evidence(&w) });
        }
    }
    out.push(Tried { hyper: Hyper::default(), evidence: quadratic.evidence(&rest) });
    Ok(out)
}
