//! Solves an equation by Newton's method with the exact symmetric tangent and a line search on the potential. Close to the solution a tangent
//! serves as long as it brings the residual down fast enough.

use crate::linear::cholesky::Factor;
use crate::linear::coarse::Level;
use crate::linear::jacobi::BlockJacobi;
use crate::linear::matrix::Matrix;
use crate::linear::vector::{Nodes, add_scaled, dot, is_finite};
use crate::linear::{Digits, Prepared, Purpose, Solvers, Task, Trouble};
use crate::terms::{Curvature, Equation};
use glam::DVec3;
use palpate_engine::{Failure, FailureKind};

/// A failure without its time.
pub type Reason = (FailureKind, String);

/// Accuracy that linear solves for derivatives cannot usefully pass in f64.
const FINEST: f64 = 1e-12;
/// Accuracy of the first Newton direction: that of the tangent at the guess.
pub(crate) const FIRST: f64 = 0.03;
/// Accuracy of a later one far from the solution: contact and rotation leave more error than this anyway.
const COARSEST: f64 = 0.1;

/// Newton iterations of a time step that share the second level of the preconditioner: the body barely moves between them.
const REFRESH: usize = 8;

/// A step of Newton's method that leaves less than this part of the residual shows that the tangent hardly changes any more: the
/// next direction takes it over.
const KEEP: f64 = 0.02;
/// The same of a tangent that is factorised: a factor costs as much as several solves with the residuals between them.
/// Where one does not bring the residual down as much, none is kept for the rest of the solve.
const KEEP_FACTOR: f64 = 0.3;
/// Residual, over the forces, from which on a factor may serve again: further away contact sets in from one step to the next, and an old
/// tangent does not know of it.
const CLOSE: f64 = 0.01;
/// A step of Newton's method that leaves more than this part of the residual is followed by one with the majorised tangent. Alone that one
/// converges linearly, the exact one hops about kinks for dozens of steps: in turn they end within ten.
const KINKED: f64 = 0.5;
/// Share of the tolerance that steps with a factor from before must reach.
const STRICT: f64 = 0.01;

/// Part of the slope at the beginning of a step that is left at its end where the step is too short: a tangent that is right leaves none, a
/// solve for the direction that is as coarse as it may be a tenth.
const STEEP: f64 = 0.5;
/// Times that such a step is doubled.
const MOST_DOUBLINGS: usize = 10;

/// Times that a guess is halved: from a whole step to a millionth of it.
const RETREATS: usize = 20;

/// Attaches the time of the simulation to a reason.
pub fn at(time: f64) -> impl Fn(Reason) -> Failure {
    move |(kind, detail)| Failure::new(kind, time, detail)
}

fn trouble(t: Trouble) -> Reason {
    match t {
        Trouble::Indefinite(what) => (FailureKind::LinearSolve, format!("the matrix is not positive definite ({what})")),
        Trouble::Unconverged(left) => {
            (FailureKind::LinearSolve, format!("conjugate gradients stopped at a relative residual of {left:.1e}"))
        }
    }
}

fn not_positive(node: usize) -> Reason {
    (FailureKind::LinearSolve, format!("the stiffness of node {node} is not positive"))
}

/// A linear problem of an equation with the matrix at displacement `u`.
fn task<'a>(
    equation: &Equation<'a>,
    matrix: &'a Matrix,
    diagonal: &'a BlockJacobi,
    u: &'a [DVec3],
    purpose: Purpose,
    digits: Digits,
) -> Task<'a> {
    let inertia = equation.share_of_inertia(matrix);
    let c = &equation.context;
    Task { body: &c.plan.body, pattern: c.pattern, matrix, diagonal, u, purpose, digits, inertia }
}

/// A tangent made ready for directions; the matrix is what it was made from.
struct TangentStiffness {
    diagonal: BlockJacobi,
    /// Its factor where solves are direct.
    factor: Option<Factor>,
}

/// Work that solves took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effort {
    /// Newton iterations.
    pub newton: usize,
    /// Iterations of conjugate gradients for their directions; none where solves are direct.
    pub linear: usize,
    /// The same for adjoints of steps.
    pub adjoint: usize,
}

/// Finds u₁ with r(u₁) = 0 from the guess in `u1`. Converged when the residual, scaled by the inverse diagonal blocks,
/// is below `tolerance` times the scaled sizes of the forces that it is the sum of.
pub fn solve(
    equation: &mut Equation,
    solvers: &Solvers,
    matrix: &mut Matrix,
    purpose: Purpose,
    u1: &mut Nodes,
    tolerance: f64,
    most: usize,
    effort: &mut Effort,
) -> Result<(), Reason> {
    let mut residual = equation.residual(u1);
    // A guess at which the material does not exist is drawn back towards the past.
    for _ in 0..RETREATS {
        if is_finite(&residual) {
            break;
        }
        u1.iter_mut().zip(equation.context.past.u).for_each(|(u, old)| *u = 0.5 * (*u + *old));
        residual = equation.residual(u1);
    }
    let (mut scale, mut level) = (None, None);
    let mut history: Vec<f64> = Vec::new();
    let mut forcing = FIRST;
    let (mut kept, mut misled): (Option<TangentStiffness>, bool) = (None, false);
    let mut first = Curvature::Exact;
    for _ in 0..most {
        if !is_finite(&residual) {
            return Err((FailureKind::NotFinite, format!("residual forces after {} Newton iterations", history.len())));
        }
        if purpose == Purpose::Static || history.len().is_multiple_of(REFRESH) {
            level = None;
        }
        // Steps with the last tangent converge linearly: they stop at the tolerance, where Newton's pass it by far.
        let again = kept.as_ref().is_some_and(|t| t.factor.is_some());
        let aim = if again { STRICT * tolerance } else { tolerance };
        let (direction, norm, tangent) = direction(
            equation, solvers, matrix, purpose, u1, &residual, first, forcing, aim, &mut scale, &mut level, effort, kept,
        )?;
        let Some(direction) = direction else { return Ok(()) };
        history.push(norm);
        effort.newton += 1;
        let after;
        (residual, after) = line_search(equation, &tangent.diagonal, u1, &residual, norm, &direction);
        if after <= aim * scale.unwrap_or(0.0) {
            return Ok(());
        }
        // A step that leaves most of the residual has passed a kink of some dissipation, and so would the next, back again.
        let passed = after > KINKED * norm && first == Curvature::Exact;
        first = if passed { Curvature::Majorised } else { Curvature::Exact };
        misled |= again && after > KEEP_FACTOR * norm;
        let serves = match tangent.factor {
            Some(_) => !misled && after <= KEEP_FACTOR * norm && after <= CLOSE * scale.unwrap_or(0.0),
            None => purpose != Purpose::Static && after <= KEEP * norm,
        };
        kept = serves.then_some(tangent);
        forcing = self::forcing(after, norm);
    }
    let reference = scale.unwrap_or(1.0);
    let (first, last) = (history.first().copied().unwrap_or(0.0), history.last().copied().unwrap_or(0.0));
    Err((
        FailureKind::NewtonStalled,
        format!(
            "{most} iterations took the scaled residual from {:.1e} to {:.1e} of the forces",
            first / reference,
            last / reference
        ),
    ))
}

/// Accuracy of the next direction, after a step that took the residual's norm from `norm` to `after`: as accurate as the next step's quadratic
/// model is (Eisenstat & Walker 1996, choice 2).
pub(crate) fn forcing(after: f64, norm: f64) -> f64 {
    (0.9 * (after / norm).powi(2)).clamp(1e-4, COARSEST)
}

/// What conjugate gradients may leave of a residual, a third of what is allowed: the residual after the step decides.
pub(crate) fn slack(tolerance: f64, reference: f64) -> f64 {
    0.3 * tolerance * reference
}

/// What rounding of the positions alone leaves of the scaled residual: stiff bodies under small loads get no closer.
/// `means` are those of the diagonal of every node's block [N/m].
pub(crate) fn rounding(nodes: &[DVec3], means: impl IntoIterator<Item = f64>, u: &[DVec3]) -> f64 {
    let squares = means.into_iter().zip(nodes.iter().zip(u)).map(|(k, (x, u))| k * (*x + *u).length_squared());
    // Each of the 81 products of a row rounds once; their errors add like a random walk.
    9.0 * f64::EPSILON * squares.sum::<f64>().sqrt()
}

/// Newton direction −A⁻¹ r, or `None` when the residual is small already; the residual's norm, and the tangent. Where the exact one is
/// not positive definite one that is gives a descent direction instead. With an earlier tangent in `kept`, that one is used, and the
/// matrix stays. `first` is the curvature to begin with.
fn direction(
    equation: &Equation,
    solvers: &Solvers,
    matrix: &mut Matrix,
    purpose: Purpose,
    u1: &[DVec3],
    residual: &[DVec3],
    first: Curvature,
    forcing: f64,
    tolerance: f64,
    scale: &mut Option<f64>,
    level: &mut Option<Level>,
    effort: &mut Effort,
    mut kept: Option<TangentStiffness>,
) -> Result<(Option<Nodes>, f64, TangentStiffness), Reason> {
    for curvature in [first, Curvature::Tamed, Curvature::Convex] {
        let last = curvature == Curvature::Convex;
        let mut tangent = match kept.take() {
            Some(tangent) => tangent,
            None => {
                equation.tangent(u1, curvature, matrix);
                match BlockJacobi::new(&equation.context.pattern.blocks, matrix) {
                    Ok(diagonal) => TangentStiffness { diagonal, factor: None },
                    Err(_) if !last => continue,
                    Err(a) => return Err(not_positive(a)),
                }
            }
        };
        let diagonal = &tangent.diagonal;
        let reference = *scale.get_or_insert_with(|| equation.scale(u1, |f| diagonal.norm(f)));
        let norm = diagonal.norm(residual);
        let means = equation.context.pattern.blocks.diagonal.iter().map(|k| matrix.mean_diagonal(*k));
        if norm <= tolerance * reference || norm <= rounding(&equation.context.plan.body.nodes, means, u1) {
            return Ok((None, norm, tangent));
        }
        let mut d: Nodes = residual.iter().map(|r| -*r).collect();
        let solved = match &tangent.factor {
            Some(factor) => {
                factor.solve(&mut [&mut d]);
                Ok(d)
            }
            None => {
                let absolute = slack(tolerance, reference);
                let digits = if purpose == Purpose::Static { Digits::All } else { Digits::Few };
                let prepared = solvers.prepare(task(equation, matrix, diagonal, u1, purpose, digits), level);
                let solved = prepared.and_then(|p| p.solve(&mut d, forcing, absolute).map(|n| (n, p.into_factor())));
                solved.map(|(iterations, factor)| {
                    effort.linear += iterations;
                    tangent.factor = factor;
                    d
                })
            }
        };
        match solved {
            Ok(d) if is_finite(&d) => return Ok((Some(d), norm, tangent)),
            Ok(_) => return Err((FailureKind::NotFinite, "displacement of a Newton step".into())),
            Err(Trouble::Indefinite(_)) if !last => {}
            Err(t) => return Err(trouble(t)),
        }
    }
    unreachable!("the last pass always returns")
}

/// Takes the full step where it halves the residual; otherwise the longest of the steps 1, ½, ¼ … that lowers the potential
/// (Armijo 1966), or one of 2, 4, 8 … while the potential falls nearly as fast at the end of the step as at its beginning: there the tangent,
/// made positive where contact squeezes a cell flat, is far too stiff, and thirty full steps were seen to lead nowhere. Returns the residual
/// there and its norm.
pub(crate) fn line_search(
    equation: &mut Equation,
    diagonal: &BlockJacobi,
    u1: &mut Nodes,
    residual: &[DVec3],
    norm: f64,
    d: &[DVec3],
) -> (Nodes, f64) {
    let start = u1.clone();
    add_scaled(u1, 1.0, d);
    let full = equation.residual(u1);
    let full_norm = diagonal.norm(&full);
    if full_norm <= 0.5 * norm {
        return (full, full_norm);
    }
    let slope = dot(residual, d);
    let before = equation.potential(&start);
    let mut step = 1.0;
    let mut after = equation.potential(u1);
    for _ in 0..30 {
        // Close to the solution the change drowns in rounding; then the step is as good as any.
        let rounding = 1e-12 * (before.abs() + after.abs());
        if after <= before + 1e-4 * step * slope + rounding {
            break;
        }
        step *= 0.5;
        u1.copy_from_slice(&start);
        add_scaled(u1, step, d);
        after = equation.potential(u1);
    }
    let mut residual = if step == 1.0 { full } else { equation.residual(u1) };
    if step == 1.0 {
        for _ in 0..MOST_DOUBLINGS {
            if dot(&residual, d) > STEEP * slope {
                break;
            }
            let mut farther = start.clone();
            add_scaled(&mut farther, 2.0 * step, d);
            let there = equation.potential(&farther);
            let found = equation.residual(&farther);
            // False for NaN as well.
            if !(there < after && is_finite(&found)) {
                break;
            }
            (step, after, residual) = (2.0 * step, there, found);
            u1.copy_from_slice(&farther);
        }
    }
    let norm = diagonal.norm(&residual);
    (residual, norm)
}

/// Curvatures from the exact one to the one that is positive definite for certain.
pub const EVER_TAMER: [Curvature; 3] = [Curvature::Exact, Curvature::Tamed, Curvature::Convex];

/// Hands the tangent stiffness at u to `f`, made ready for solves as that of a static problem: by the first of these curvatures for which it is
/// positive definite; `None` where it is for none. The residual has been computed there.
pub fn with_tangent<T>(
    equation: &Equation,
    solvers: &Solvers,
    u: &[DVec3],
    curvatures: &[Curvature],
    f: impl FnOnce(&Matrix, &Prepared) -> T,
) -> Option<T> {
    let (body, pattern) = (&equation.context.plan.body, equation.context.pattern);
    for curvature in curvatures {
        let mut matrix = Matrix::default();
        equation.tangent(u, *curvature, &mut matrix);
        let Ok(diagonal) = BlockJacobi::new(&pattern.blocks, &matrix) else { continue };
        let (mut level, purpose, digits) = (None, Purpose::Static, Digits::All);
        let task = Task { body, pattern, matrix: &matrix, diagonal: &diagonal, u, purpose, digits, inertia: 0.0 };
        let Ok(prepared) = solvers.prepare(task, &mut level) else { continue };
        return Some(f(&matrix, &prepared));
    }
    None
}

/// Accuracy of linear solves for derivatives of states that are found to `tolerance`.
pub(crate) fn accuracy_of_derivatives(tolerance: f64) -> f64 {
    tolerance.clamp(FINEST, 1e-6)
}

/// Solves A x = b with the exact tangent at a converged state, for derivatives; the iterations that took. The residual has been computed
/// there.
pub fn solve_exact(
    equation: &Equation,
    solvers: &Solvers,
    matrix: &mut Matrix,
    purpose: Purpose,
    u1: &[DVec3],
    columns: &mut [Vec<DVec3>],
) -> Result<usize, Reason> {
    equation.tangent(u1, Curvature::Exact, matrix);
    let diagonal = BlockJacobi::new(&equation.context.pattern.blocks, matrix).map_err(not_positive)?;
    let mut level = None;
    let task = task(equation, matrix, &diagonal, u1, purpose, Digits::All);
    let prepared: Prepared = solvers.prepare(task, &mut level).map_err(trouble)?;
    prepared.solve_many(columns, accuracy_of_derivatives(equation.context.plan.solver.tolerance)).map_err(trouble)
}
