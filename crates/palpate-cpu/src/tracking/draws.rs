//! How well a pose is known: draws of its posterior, from the directions that readings determine.
//!
//! With the prior's covariance ηK⁻¹ and eigenvectors `η JᵀWJ v = λ K v`, vᵀKv = 1, the posterior's covariance is `η (K⁻¹ − Σ λ/(1 + λ) v vᵀ)`
//! (Spantini et al., *SIAM J. Sci. Comput.* 37, 2015). Lanczos' method in the inner product of K finds those of the largest λ; the others
//! say little. A draw of the prior is √η K^(−½) ξ, and one of the posterior shortens it by 1 − (1 + λ)^(−½) along every v.

use super::Stiffness;
use super::pull::Pulls;
use crate::linear::conjugate_gradient::Precondition;
use crate::linear::matrix::Operator;
use crate::linear::vector::{Nodes, add_scaled, dot};
use crate::linear::{Prepared, Trouble};
use crate::terms::zeros;
use faer::{Mat, Side};
use glam::DVec3;
use palpate_engine::tracking::Certainty;

/// Most directions.
const DIRECTIONS: usize = 240;
/// Directions between two looks at the eigenvalues.
const LOOK: usize = 20;
/// Growth of γ from look to look at which what is left says nothing.
const GROWTH: f64 = 0.01;

/// Directions that readings determine, and the eigenvalue λ of each.
struct Spectrum {
    vectors: Vec<Nodes>,
    values: Vec<f64>,
}

/// γ, ΔV and draws; `residual` is dV/du.
pub fn certainty(
    k: &Stiffness,
    temperature: f64,
    pulls: &dyn Pulls,
    residual: &[DVec3],
    draws: &[Vec<DVec3>],
    energy: f64,
) -> Certainty {
    let inverse = |b: &[DVec3]| solved(k.prepared, b);
    let spectrum = spectrum(&inverse, |v| scaled(temperature, &pulls.product(v)), draws.first().map_or(&[][..], |d| d));
    let excess = inverse(residual).map_or(0.0, |x| 0.5 * dot(&x, residual));
    let determined = determined(&spectrum.values);
    let (mut posterior, mut prior) = (Vec::new(), Vec::new());
    if let Prepared::Direct(factor) = k.prepared {
        let root = temperature.sqrt();
        for draw in draws {
            let mut x = factor.solve_half(draw);
            x.iter_mut().for_each(|v| *v *= root);
            prior.push(x.clone());
            let mut force = zeros(x.len());
            k.matrix.multiply(&x, &mut force);
            for (v, l) in spectrum.vectors.iter().zip(&spectrum.values) {
                let along = dot(v, &force);
                add_scaled(&mut x, along * ((1.0 + l).sqrt().recip() - 1.0), v);
            }
            posterior.push(x);
        }
    }
    Certainty { posterior, prior, determined, excess, energy }
}

/// γ = Σ λ/(1 + λ); it grows with every direction of Lanczos' method.
fn determined(values: &[f64]) -> f64 {
    values.iter().map(|l| l.max(0.0)).map(|l| l / (1.0 + l)).sum()
}

fn scaled(factor: f64, v: &[DVec3]) -> Nodes {
    v.iter().map(|x| factor * *x).collect()
}

/// K⁻¹ b.
fn solved(prepared: &Prepared, b: &[DVec3]) -> Option<Nodes> {
    let mut x = b.to_vec();
    if let Prepared::Direct(_) = prepared {
        let mut z = zeros(b.len());
        prepared.apply(b, &mut z);
        return Some(z);
    }
    match prepared.solve(&mut x, 1e-8, 0.0) {
        Ok(_) => Some(x),
        Err(Trouble::Indefinite(_) | Trouble::Unconverged(_)) => None,
    }
}

/// Lanczos' method with full reorthogonalisation, from what the readings make of a draw.
fn spectrum(inverse: &dyn Fn(&[DVec3]) -> Option<Nodes>, b: impl Fn(&[DVec3]) -> Nodes, draw: &[DVec3]) -> Spectrum {
    let mut found = Spectrum { vectors: Vec::new(), values: Vec::new() };
    let (mut basis, mut forces): (Vec<Nodes>, Vec<Nodes>) = (Vec::new(), Vec::new());
    let (mut diagonal, mut beside): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    let mut force = b(draw);
    let Some(mut next) = inverse(&force) else { return found };
    let first = dot(&next, &force).max(0.0).sqrt();
    if first == 0.0 {
        return found;
    }
    let mut length = first;
    let (mut eigen, mut known) = (None, 0.0);
    while basis.len() < DIRECTIONS.min(3 * draw.len()) {
        basis.push(scaled(1.0 / length, &next));
        forces.push(scaled(1.0 / length, &force));
        let q = basis.last().expect("just pushed");
        force = b(q);
        diagonal.push(dot(q, &force));
        let Some(image) = inverse(&force) else { break };
        next = image;
        // Twice: once leaves what rounding made of a projection.
        for _ in 0..2 {
            for (v, f) in basis.iter().zip(&forces) {
                let along = dot(&next, f);
                add_scaled(&mut next, -along, v);
                add_scaled(&mut force, -along, f);
            }
        }
        length = dot(&next, &force).max(0.0).sqrt();
        let exhausted = length <= 1e-12 * first;
        if exhausted || basis.len().is_multiple_of(LOOK) || basis.len() == DIRECTIONS {
            eigen = tridiagonal(&diagonal, &beside);
            let now = eigen.as_ref().map_or(known, |(values, _)| determined(values));
            if exhausted || now - known <= GROWTH * now {
                break;
            }
            known = now;
        }
        beside.push(length);
    }
    let Some((values, vectors)) = eigen.filter(|(v, _)| v.len() == basis.len()).or_else(|| tridiagonal(&diagonal, &beside))
    else {
        return found;
    };
    for (j, l) in values.iter().enumerate().filter(|(_, l)| **l > 0.0) {
        let mut v = zeros(draw.len());
        for (i, q) in basis.iter().enumerate() {
            add_scaled(&mut v, vectors[(i, j)], q);
        }
        found.vectors.push(v);
        found.values.push(*l);
    }
    found
}

/// Eigenvalues and eigenvectors of a symmetric tridiagonal matrix.
fn tridiagonal(diagonal: &[f64], beside: &[f64]) -> Option<(Vec<f64>, Mat<f64>)> {
    let n = diagonal.len();
    let entry = |i: usize, j: usize| match i.abs_diff(j) {
        0 => diagonal[i],
        1 => beside[i.min(j)],
        _ => 0.0,
    };
    let eigen = Mat::from_fn(n, n, entry).self_adjoint_eigen(Side::Lower).ok()?;
    Some(((0..n).map(|k| eigen.S()[k]).collect(), eigen.U().to_owned()))
}
