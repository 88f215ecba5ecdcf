//! Derivatives through equilibria of a sequence, side by side: none of them needs another one's, so they share the factor of one tangent.

use crate::kept::{BACK, Kept, MOST, side_by_side};
use crate::linear::matrix::Matrix;
use crate::linear::side_by_side::{Column, solve as solve_columns};
use crate::linear::vector::Nodes;
use crate::newton::accuracy_of_derivatives;
use crate::simulate::{Start, equation};
use crate::terms::Equation;
use crate::terms::products::Products;
use crate::world::{Gradient, Member, Shared, Waiting};
use glam::DVec3;
use rayon::prelude::*;

/// H⁻¹ dJ/du of the first of these equilibria, as many as are solved at once and at least one, with the iterations that it took; nothing where
/// conjugate gradients do not get there.
pub(crate) fn solve(
    shared: &Shared,
    member: &Member,
    matrix: &mut Matrix,
    kept: &mut Option<Kept>,
    waiting: &[Waiting],
) -> Vec<Option<(Nodes, usize)>> {
    let still = Start::still(waiting[0].at.len());
    let mut equations: Vec<Equation> =
        waiting.iter().take(BACK).map(|w| equation(shared, member, w.stage.as_ref(), &still)).collect();
    let served = kept.take().filter(|k| k.serves(equations.len()));
    // Where matrices leave room for a few of them only, the others are next.
    let middle = equations.len() / 2;
    let Some(mut own) = served.or_else(|| Kept::new(shared, &mut equations[middle], &waiting[middle].at, matrix)) else {
        return vec![None];
    };
    equations.truncate(side_by_side(shared, &equations[0], &waiting[0].at, &own, BACK));
    equations.par_iter_mut().zip(waiting).for_each(|(e, w)| drop(e.residual(&w.at)));
    let operators: Vec<Products> = equations.par_iter().zip(waiting).map(|(e, w)| e.products(&w.at)).collect();
    let relative = accuracy_of_derivatives(shared.plan.solver.tolerance);
    let columns: Vec<Column> = operators.iter().zip(waiting).map(|(o, w)| column(o, w, relative)).collect();
    let solved: Vec<Option<(Nodes, usize)>> = solve_columns(&own.factor, &columns, MOST).into_iter().map(Result::ok).collect();
    own.served(&solved.iter().flatten().map(|s| s.1).collect::<Vec<_>>());
    // What did not serve one of them is not asked again.
    *kept = solved.iter().all(Option::is_some).then_some(own);
    solved
}

fn column<'a>(operator: &'a Products, waiting: &Waiting, relative: f64) -> Column<'a> {
    Column { operator: operator.as_ref(), rhs: waiting.by_u.clone(), relative, absolute: 0.0 }
}

/// Adds −z·∂r/∂(coefficients) of an equilibrium.
pub(crate) fn take(shared: &Shared, member: &Member, at: &Waiting, z: &[DVec3], gradient: &mut Gradient) {
    let still = Start::still(z.len());
    let mut e = equation(shared, member, at.stage.as_ref(), &still);
    e.residual(&at.at);
    gradient.take(&e, &at.at, z);
}
