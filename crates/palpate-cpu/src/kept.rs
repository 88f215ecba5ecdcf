//! A factorised tangent that serves the states around it, as the preconditioner of their own exact tangents.
//!
//! Conjugate gradients behind the factor of a tangent nearby take a few iterations for each state, and many states share each reading of the factor
//! ([`crate::linear::side_by_side`]). What is solved for is that of the exact tangents; the factor decides how long it takes.

use crate::linear::cholesky::RoughFactor;
use crate::linear::jacobi::BlockJacobi;
use crate::linear::matrix::{Matrix, Packed};
use crate::linear::side_by_side::GROUP;
use crate::linear::{Purpose, is_direct};
use crate::terms::{Curvature, Equation, jets};
use crate::world::Shared;
use glam::DVec3;
use palpate_model::scene::LinearSolver;

/// Iterations of one state that take as long as a factorisation, with two threads. On a busy machine one of 3100 points takes 1.6 s on one thread, and nine
/// iterations of 32 states take 1.9 s on both. The ratio grows with the body, so smaller ones keep their factors a little too long.
const FACTORISATION: f64 = 200.0;
/// Most iterations of a state: behind a factor that needs more, another one is faster.
pub(crate) const MOST: usize = 100;

/// The tangent at some state, and how well it has served.
#[derive(Clone, Debug)]
pub(crate) struct Kept {
    pub(crate) factor: RoughFactor,
    pub(crate) diagonal: BlockJacobi,
    /// Of every node, the mean of its block's diagonal [N/m].
    means: Vec<f64>,
    /// Iterations that the last states took: the fewest, and those of the last one.
    last: Option<(usize, usize)>,
}

/// True where states of a plan are solved side by side: a sequence whose tangents are factorised unless somebody said otherwise. A jet's
/// tangent is not symmetric.
pub(crate) fn applies(shared: &Shared) -> bool {
    let (plan, nodes) = (&shared.plan, shared.pattern.blocks.len());
    let chosen = plan.solver.linear == LinearSolver::Auto && is_direct(plan.solver.linear, nodes, Purpose::Static);
    !plan.times.is_empty() && chosen && !jets::blow(plan)
}

impl Kept {
    /// The exact tangent of an equation at `u`, where it is positive definite.
    pub(crate) fn new(shared: &Shared, e: &mut Equation, u: &[DVec3], matrix: &mut Matrix) -> Option<Kept> {
        e.residual(u);
        e.tangent(u, Curvature::Exact, matrix);
        let rows = &shared.pattern.blocks;
        let diagonal = BlockJacobi::new(rows, matrix).ok()?;
        let factor = shared.solvers.factor(rows, matrix).ok()?.rough();
        let means = rows.diagonal.iter().map(|k| matrix.mean_diagonal(*k)).collect();
        Some(Kept { factor, diagonal, means, last: None })
    }

    /// Mean of the diagonal of a node's block [N/m].
    pub(crate) fn means(&self) -> &[f64] {
        &self.means
    }

    /// Notes the iterations of states in a row.
    pub(crate) fn served(&mut self, iterations: &[usize]) {
        let fewest = iterations.iter().filter(|n| **n > 0).min();
        self.last = fewest.copied().zip(iterations.last().copied()).or(self.last);
    }

    /// False where another factor saves more than it costs: m states that each take as many iterations as the last one, not as few as the one that the
    /// factor suits best, m (n_last − n_least) > [`FACTORISATION`].
    pub(crate) fn serves(&self, states: usize) -> bool {
        let more = self.last.map_or(0, |(least, last)| last.saturating_sub(least));
        (states * more) as f64 <= FACTORISATION
    }
}

/// States whose tangents are kept side by side, at most so many: without a matrix they are small; matrices may take as much as the factor.
pub(crate) fn side_by_side(shared: &Shared, e: &Equation, u: &[DVec3], kept: &Kept, most: usize) -> usize {
    if !e.needs_matrix(u) {
        return most;
    }
    let matrix = Packed::<f64>::bytes(&shared.pattern.blocks);
    (kept.factor.bytes() / matrix).clamp(1, most)
}

/// States of one solve for derivatives: groups for two threads.
pub(crate) const BACK: usize = 2 * GROUP;
