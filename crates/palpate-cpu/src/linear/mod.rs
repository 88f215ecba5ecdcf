//! Linear algebra of the backend: the block matrix, direct and iterative solvers, and the choice between them.

pub mod cholesky;
pub mod coarse;
pub mod conjugate_gradient;
pub mod dense;
pub mod gmres;
pub mod jacobi;
pub mod matrix;
pub mod side_by_side;
pub mod simd;
pub mod vector;

use cholesky::{Analysis, Factor};
use coarse::{Coarsening, Level, TwoLevel};
use conjugate_gradient::{CgEnd, Precondition};
use glam::DVec3;
use jacobi::BlockJacobi;
use matrix::{Matrix, Operator, Packed};
use palpate_model::scene::LinearSolver;
use palpate_model::space::body::Body;
use palpate_model::space::pattern::{BlockRows, Pattern};
use std::sync::OnceLock;

/// Most CG iterations; a solve that needs more is a symptom.
const MOST_ITERATIONS: usize = 4000;
/// Largest body (nodes) whose Cholesky factor is worth its cost in a static problem: 3D fill grows like N^(4/3).
const DIRECT_STATIC: usize = 9000;
/// Largest body (nodes) whose factor may be cheaper than the iterations of one solve of a time step, and with several right-hand
/// sides: clamps and ν near ½ cost block-Jacobi hundreds of iterations, a factor of 1000 nodes about 20 ms.
const DIRECT_STEP: [usize; 2] = [900, 1800];
/// Iterations of CG with block-Jacobi times the root of the share of inertia, of a direction of Newton's method and of a derivative. They are as
/// many as 1/√(smallest eigenvalue), and what bends softly resists by its inertia alone. On balls, beams and a torus of 176
/// to 1514 nodes in steps of 1 to 10 ms between 2.5 and 4, and between 15 and 21.
const ITERATIONS: [f64; 2] = [3.5, 20.0];
/// Directions that Newton's method takes in a step for each of its factors.
const DIRECTIONS: f64 = 3.0;
/// Time of a factorisation per entry of the factor, over that of an iteration per block of the matrix (ibid.: 9 to 16 ns over 2.3 to 4.1 ns).
const FACTOR: f64 = 3.7;
/// Time of a solve with a factor, over that of the factorisation.
const SUBSTITUTION: f64 = 0.05;
/// Smallest body (nodes) for which the second level of the preconditioner pays.
const COARSE_FROM: usize = 600;
/// Iterations of CG up to which block-Jacobi alone is faster than with it.
const PLAIN: f64 = 15.0;
/// Edge of a group of nodes on the second level.
const GROUP: i64 = 4;

/// Solves with the matrices of one plan.
#[derive(Debug)]
pub struct Solvers {
    choice: LinearSolver,
    /// Most iterations of CG; tests set it lower.
    pub(crate) most: usize,
    analysis: OnceLock<Result<Analysis, String>>,
    coarsening: OnceLock<Result<Coarsening, String>>,
}

/// What a linear solve is for; decides between direct and iterative.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// No inertia: the matrix is badly conditioned.
    Static,
    /// A time step with so many right-hand sides.
    Step(usize),
}

/// How exactly the matrix must be kept for an iterative solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Digits {
    /// To 6e-8: directions of Newton's method, whose own model is worse.
    Few,
    /// In full: derivatives.
    All,
}

/// A matrix of a body at displacement `u`, and what it is to be solved for.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    /// The body.
    pub body: &'a Body,
    /// Pattern of the matrix.
    pub pattern: &'a Pattern,
    /// The matrix.
    pub matrix: &'a Matrix,
    /// Its inverted diagonal blocks.
    pub diagonal: &'a BlockJacobi,
    /// Displacement [m].
    pub u: &'a [DVec3],
    /// Decides between direct and iterative.
    pub purpose: Purpose,
    /// How exactly CG sees the matrix.
    pub digits: Digits,
    /// Share of inertia in the matrix' diagonal; 0 in a static problem.
    pub inertia: f64,
}

/// A matrix made ready for solves.
pub enum Prepared<'a> {
    /// Factorised.
    Direct(Factor),
    /// With a preconditioner, and the most iterations.
    Iterative(Box<dyn Operator + 'a>, Box<dyn Precondition + 'a>, usize),
}

/// A solve that failed.
#[derive(Clone, Debug, PartialEq)]
pub enum Trouble {
    /// The matrix is not positive definite.
    Indefinite(String),
    /// CG stopped at this relative residual.
    Unconverged(f64),
}

/// True where the matrix of so many nodes may be factorised.
pub(crate) fn is_direct(choice: LinearSolver, nodes: usize, purpose: Purpose) -> bool {
    match (choice, purpose) {
        (LinearSolver::Cholesky, _) => true,
        (LinearSolver::ConjugateGradient, _) => false,
        (LinearSolver::Auto, Purpose::Static) => nodes <= DIRECT_STATIC,
        (LinearSolver::Auto, Purpose::Step(columns)) => nodes <= DIRECT_STEP[usize::from(columns > 2)],
    }
}

/// Memory of solves with the matrices of a plan [B].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Need {
    /// Structures that all solves share.
    pub shared: usize,
    /// What a solve takes: a factor and the work on it, or a copy of the matrix and a second level.
    pub solve: usize,
    /// A factor alone, where there may be one.
    pub factor: Option<usize>,
}

impl Need {
    /// Of what [`Solvers::prepare`] may choose.
    pub fn of(choice: LinearSolver, body: &Body, pattern: &Pattern, purpose: Purpose) -> Need {
        let rows = &pattern.blocks;
        let copy = Packed::<f64>::bytes(rows);
        // Where something cannot be analysed the solve says so.
        if is_direct(choice, rows.len(), purpose)
            && let Ok(analysis) = Analysis::new(rows)
        {
            let factor = analysis.factor_bytes();
            return Need { shared: analysis.bytes(), solve: copy.max(factor + analysis.work_bytes()), factor: Some(factor) };
        }
        let coarsening = if rows.len() < COARSE_FROM { None } else { Coarsening::new(body, pattern, GROUP).ok() };
        let [shared, level] = coarsening.map_or([0; 2], |c| [c.bytes(), c.level_bytes()]);
        Need { shared, solve: copy + level, factor: None }
    }
}

impl Task<'_> {
    /// True if CG takes less time than a factor with so many entries: where steps are short, a few iterations do.
    fn is_easy(&self, entries: usize) -> bool {
        let Purpose::Step(columns) = self.purpose else { return false };
        let factor = FACTOR * entries as f64 / self.pattern.blocks.columns.len() as f64;
        let iterations = self.iterations(self.digits);
        match self.digits {
            Digits::Few => DIRECTIONS * iterations < factor,
            Digits::All => columns as f64 * iterations < factor * (1.0 + SUBSTITUTION * columns as f64),
        }
    }

    /// Iterations of CG with block-Jacobi alone, about: as many as one over the root of inertia's share.
    fn iterations(&self, digits: Digits) -> f64 {
        ITERATIONS[usize::from(digits == Digits::All)] / self.inertia.sqrt()
    }
}

impl Solvers {
    /// Solvers for a choice made in the scene.
    pub fn new(choice: LinearSolver) -> Solvers {
        Solvers { choice, most: MOST_ITERATIONS, analysis: OnceLock::new(), coarsening: OnceLock::new() }
    }

    /// Factorises a matrix.
    pub fn factor(&self, rows: &BlockRows, matrix: &Matrix) -> Result<Factor, Trouble> {
        let analysis = self.analysis.get_or_init(|| Analysis::new(rows));
        analysis.as_ref().map_err(Clone::clone).and_then(|a| a.factor(matrix)).map_err(Trouble::Indefinite)
    }

    /// Factorises or preconditions a matrix. A second level that is there already is used as it is; else it is made.
    pub fn prepare<'a>(&'a self, task: Task<'a>, level: &'a mut Option<Level>) -> Result<Prepared<'a>, Trouble> {
        let rows = &task.pattern.blocks;
        if is_direct(self.choice, rows.len(), task.purpose) {
            let analysis = self.analysis.get_or_init(|| Analysis::new(rows));
            let analysis = analysis.as_ref().map_err(|e| Trouble::Indefinite(e.clone()))?;
            if self.choice == LinearSolver::Cholesky || !task.is_easy(analysis.entries()) {
                return analysis.factor(task.matrix).map(Prepared::Direct).map_err(Trouble::Indefinite);
            }
        }
        let operator: Box<dyn Operator> = match task.digits {
            Digits::Few => Box::new(Packed::new(rows, task.matrix, |v| v as f32)),
            Digits::All => Box::new(Packed::new(rows, task.matrix, |v| v)),
        };
        if rows.len() < COARSE_FROM || task.iterations(Digits::Few) < PLAIN {
            return Ok(Prepared::Iterative(operator, Box::new(task.diagonal), self.most));
        }
        let coarsening = self.coarsening.get_or_init(|| Coarsening::new(task.body, task.pattern, GROUP));
        let coarsening = coarsening.as_ref().map_err(|e| Trouble::Indefinite(e.clone()))?;
        if level.is_none() {
            *level = Some(coarsening.level(task.body, rows, task.matrix, task.u).map_err(Trouble::Indefinite)?);
        }
        let level = level.as_ref().expect("made above");
        Ok(Prepared::Iterative(operator, Box::new(TwoLevel { coarsening, jacobi: task.diagonal, level }), self.most))
    }
}

impl Prepared<'_> {
    /// Solves A x = b in place; the number of iterations.
    pub fn solve(&self, b: &mut Vec<DVec3>, relative: f64, absolute: f64) -> Result<usize, Trouble> {
        match self {
            Prepared::Direct(factor) => {
                factor.solve(&mut [b]);
                Ok(0)
            }
            Prepared::Iterative(matrix, precondition, most) => {
                let mut x = vec![DVec3::ZERO; b.len()];
                let (matrix, precondition) = (matrix.as_ref(), precondition.as_ref());
                match conjugate_gradient::solve(matrix, precondition, b, &mut x, relative, absolute, *most) {
                    CgEnd::Converged(iterations) => {
                        *b = x;
                        Ok(iterations)
                    }
                    CgEnd::Unconverged(left) => Err(Trouble::Unconverged(left)),
                    CgEnd::Indefinite => Err(Trouble::Indefinite("a direction of negative curvature".into())),
                }
            }
        }
    }

    /// The factor, where there is one.
    pub fn into_factor(self) -> Option<Factor> {
        match self {
            Prepared::Direct(factor) => Some(factor),
            Prepared::Iterative(..) => None,
        }
    }

    /// Solves for many right-hand sides in place, from zero guesses; the iterations of all of them.
    pub fn solve_many(&self, columns: &mut [Vec<DVec3>], relative: f64) -> Result<usize, Trouble> {
        match self {
            Prepared::Direct(factor) => {
                factor.solve(&mut columns.iter_mut().map(Vec::as_mut_slice).collect::<Vec<_>>());
                Ok(0)
            }
            Prepared::Iterative(..) => columns.iter_mut().map(|b| self.solve(b, relative, 0.0)).sum(),
        }
    }
}
