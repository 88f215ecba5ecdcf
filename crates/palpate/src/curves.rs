//! Curves of stiffness that a fit found: their corners with errors, and the stretches that the motion went through. Where no stretch came, a factor
//! is what the scene or a prior says of it.

use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::Fitted;
use crate::results::finite;
use crate::results::fit::FoundCurve;
use glam::{DMat3, DVec3};
use palpate_model::cutcells::grid::SIGNS;
use palpate_model::materials::Gradient;
use palpate_model::materials::curve::Curve;
use palpate_model::materials::principal_stretch::stretches;
use palpate_model::plan::Plan;
use std::ops::ControlFlow;

/// States that are looked at.
const STATES: usize = 40;

/// A matrix by row and column.
pub(crate) fn matrix(of: impl Fn(usize, usize) -> f64) -> DMat3 {
    DMat3::from_cols_array_2d(&std::array::from_fn(|j| std::array::from_fn(|i| of(i, j))))
}

/// Displacement gradient in the middle of every cell at displacements `[N]`.
fn of_cells<'a>(plan: &'a Plan, u: &'a [DVec3]) -> impl Iterator<Item = DMat3> + 'a {
    let h = plan.body.length;
    plan.body.cells().iter().map(move |c| {
        let mut m = DMat3::ZERO;
        for (n, s) in c.nodes.iter().zip(SIGNS) {
            let (v, g) = (u[*n as usize], DVec3::from_array(s.map(f64::from)) * (0.25 / h));
            m += DMat3::from_cols(v * g.x, v * g.y, v * g.z);
        }
        m
    })
}

/// Displacement gradient of every element: in the middle of a cell, the mean of a tetrahedron.
pub(crate) fn middles<'a>(plan: &'a Plan, u: &'a [DVec3]) -> impl Iterator<Item = DMat3> + 'a {
    of_cells(plan, u).chain(plan.body.points.means().map(|s| s.gradient_of(u)))
}

/// The same row by row, in the middle of a cell and at every elastic point.
fn gradients<'a>(plan: &'a Plan, u: &'a [DVec3]) -> impl Iterator<Item = Gradient<f64>> + 'a {
    let rows = |m: DMat3| std::array::from_fn(|i| std::array::from_fn(|j| m.col(j)[i]));
    of_cells(plan, u).chain(plan.body.points.stencils.iter().map(|s| s.gradient_of(u))).map(rows)
}

/// Smallest and largest principal stretch, and ratio of volumes, over a simulation's elements and states.
fn ranges(plan: &Plan, theta: &[f64], backend: Backend) -> Result<[[f64; 2]; 2], Error> {
    let every = plan.clock.steps.div_ceil(STATES).max(1);
    let mut out = [[1.0f64; 2]; 2];
    backend.visit(plan, theta, |k, state, _| {
        if k % every == 0 || k == plan.clock.steps {
            for h in gradients(plan, &state.displacement) {
                let Some(s) = stretches(&h) else { continue };
                s.iter().for_each(|s| out[0] = [out[0][0].min(*s), out[0][1].max(*s)]);
                let j: f64 = s.iter().product();
                out[1] = [out[1][0].min(j), out[1][1].max(j)];
            }
        }
        ControlFlow::Continue(())
    })?;
    Ok(out)
}

/// The curves of every scene of which some factor was free.
///
/// # Errors
/// What was found cannot be simulated.
pub(crate) fn found(experiments: &[Experiment], fitted: &Fitted, backend: Backend) -> Result<Vec<FoundCurve>, Error> {
    let mut out = Vec::new();
    for (scene, e) in experiments.iter().enumerate() {
        let names = ["material.stretch_curve.factors", "material.volume_curve.factors"];
        let error = |path: &str| {
            let named = |n: &crate::FreeNumber| n.path == path && n.scene.is_none_or(|s| s == scene);
            let p = fitted.free.iter().zip(&fitted.result.parameters).find(|(n, _)| named(n));
            p.map(|(_, p)| p.standard_error.and_then(finite))
        };
        let is_free = |name: &str| fitted.free.iter().any(|n| n.path.starts_with(name));
        if !names.iter().any(|n| is_free(n)) {
            continue;
        }
        let (plan, theta) = (e.plan(), &fitted.result.theta[scene]);
        let all = ranges(plan, theta, backend)?;
        let corners = [&plan.curves.stretch, &plan.curves.volume];
        for (((name, curve), places), range) in names.iter().zip(corners).zip(plan.layout.curves()).zip(all) {
            if !is_free(name) {
                continue;
            }
            let errors = (0..curve.stretches.len()).map(|k| error(&format!("{name}.{k}")).flatten()).collect();
            let (corners, factors) = (curve.stretches.clone(), theta[places].to_vec());
            out.push(FoundCurve { path: name.trim_end_matches(".factors").into(), scene, corners, factors, errors, range });
        }
    }
    Ok(out)
}

impl FoundCurve {
    /// The factor, and one standard error above and below, over the corners' stretches.
    pub(crate) fn band(&self) -> [Vec<(f64, f64)>; 3] {
        let moved = |sign: f64| {
            let factor = |(f, e): (&f64, &Option<f64>)| f * (sign * e.unwrap_or(0.0) / f).exp();
            let factors = self.factors.iter().zip(&self.errors).map(factor).collect();
            Curve { stretches: self.corners.clone(), factors }
        };
        let first = self.corners.iter().fold(self.range[0].min(1.0), |m, c| m.min(*c));
        let last = self.corners.iter().fold(self.range[1].max(1.0), |m, c| m.max(*c));
        [0.0, 1.0, -1.0].map(|sign| {
            let curve = moved(sign);
            let at = |k: usize| (first.ln() + (last / first).ln() * k as f64 / 120.0).exp();
            (0..=120).map(|k| (at(k), curve.integrals(at(k).ln()).value)).collect()
        })
    }

    /// Corners that lie beyond the stretches that occurred, and beyond their neighbours within: the motion says nothing of them.
    pub(crate) fn unseen(&self) -> Vec<f64> {
        let [low, high] = self.range;
        // The corner next to the range still moves the curve within.
        let above = self.corners.iter().filter(|c| **c > high.max(1.0)).skip(1);
        let below = self.corners.iter().rev().filter(|c| **c < low.min(1.0)).skip(1);
        below.chain(above).copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_band_is_that_of_the_factors_and_corners_beyond_the_range_are_named() {
        let c = FoundCurve {
            path: "material.stretch_curve".into(),
            scene: 0,
            corners: vec![0.5, 0.8, 1.2, 1.5, 2.0],
            factors: vec![1.0, 2.0, 3.0, 1.0, 1.0],
            errors: vec![None, Some(0.2), Some(0.3), None, None],
            range: [0.9, 1.3],
        };
        assert_eq!(c.unseen(), [0.5, 2.0]);
        let [middle, upper, lower] = c.band();
        let at = |v: &[(f64, f64)], s: f64| v.iter().min_by(|a, b| (a.0 - s).abs().total_cmp(&(b.0 - s).abs())).unwrap().1;
        assert!((at(&middle, 1.2) - 3.0).abs() < 0.1 && (at(&upper, 1.2) / at(&middle, 1.2) - 0.1f64.exp()).abs() < 0.02);
        assert!(lower.iter().zip(&upper).all(|(l, u)| l.1 <= u.1) && middle.iter().all(|p| p.1.is_finite()));
        // At rest the factor is 1 and has no error.
        assert!((at(&upper, 1.0) - at(&lower, 1.0)).abs() < 0.1);
    }
}
