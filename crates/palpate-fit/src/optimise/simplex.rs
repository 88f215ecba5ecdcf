//! Nelder–Mead, from argmin, on the cost of the nearest point in the box.
//!
//! argmin's solver is stepped by hand, because its executor cannot be stopped from outside and it unwraps errors of the first
//! simplex; a search that must stop sees infinite costs until the step returns.

use super::{Sample, Search, Status, Stop};
use argmin::core::{CostFunction, IterState, Problem, Solver, State};
use argmin::solver::neldermead::NelderMead;
use std::cell::RefCell;
use std::collections::VecDeque;

/// Edge of the first simplex in z.
const EDGE: f64 = 0.5;
/// Edge of the simplex around a point that looks converged, to see whether the first one had collapsed.
const SECOND_EDGE: f64 = 0.05;

struct Shared<'s, 'a> {
    search: RefCell<(&'s mut Search<'a>, Option<Stop>)>,
    /// The last points tried: argmin does not show its simplex, but tries points no farther apart than its corners.
    tried: RefCell<VecDeque<Vec<f64>>>,
}

impl CostFunction for &Shared<'_, '_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, z: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        let mut shared = self.search.borrow_mut();
        let (search, stopped) = &mut *shared;
        if stopped.is_some() {
            return Ok(f64::INFINITY);
        }
        let z = search.project(z);
        let mut tried = self.tried.borrow_mut();
        tried.push_back(z.clone());
        if tried.len() > 4 * (z.len() + 1) {
            tried.pop_front();
        }
        match search.evaluate(&z) {
            Ok(sample) => Ok(sample.cost),
            Err(stop) => {
                *stopped = Some(stop);
                Ok(f64::INFINITY)
            }
        }
    }
}

pub fn minimise(search: &mut Search, z: Vec<f64>, at: Sample) -> Result<Status, Stop> {
    let first = descend(search, z, at.cost, EDGE)?;
    let Some((best, Sample { cost, .. })) = search.best.clone() else { return Ok(first) };
    if first != Status::Converged {
        return Ok(first);
    }
    descend(search, best, cost, SECOND_EDGE)
}

fn descend(search: &mut Search, z: Vec<f64>, cost: f64, edge: f64) -> Result<Status, Stop> {
    let q = z.len();
    let tolerance = search.settings.tolerance.clone();
    let mut corners = vec![z.clone()];
    for i in 0..q {
        let mut corner = z.clone();
        // Away from a bound that is near.
        corner[i] += if corner[i] + edge <= search.upper[i] { edge } else { -edge };
        corners.push(corner);
    }
    type Simplex = NelderMead<Vec<f64>, f64>;
    type At = IterState<Vec<f64>, (), (), (), (), f64>;
    let shared = Shared { search: RefCell::new((search, None)), tried: RefCell::default() };
    let mut problem = Problem::new(&shared);
    let broken = |e: argmin::core::Error| Status::Failed(format!("Nelder-Mead: {e}"));
    let mut solver = Simplex::new(corners);
    let mut state = At::new();
    state = match solver.init(&mut problem, state) {
        Ok((state, _)) => state,
        Err(e) => return Ok(broken(e)),
    };
    let mut reference = cost;
    loop {
        // Costs of all corners within the tolerance of the best one; argmin's test is on their standard deviation.
        let spread = (tolerance.cost * reference).max(f64::MIN_POSITIVE);
        solver = match solver.with_sd_tolerance(spread) {
            Ok(solver) => solver,
            Err(e) => return Ok(broken(e)),
        };
        {
            let mut borrowed = shared.search.borrow_mut();
            if let Some(stop) = borrowed.1.take() {
                return Err(stop);
            }
            if <Simplex as Solver<&Shared, At>>::terminate(&mut solver, &state).terminated() {
                return Ok(Status::Converged);
            }
            if borrowed.0.out_of_iterations() {
                return Ok(Status::IterationLimit);
            }
            if let Some((z, Sample { cost, .. })) = borrowed.0.best.clone() {
                let tried = shared.tried.borrow();
                let far = |t: &Vec<f64>| t.iter().zip(&z).any(|(a, b)| (a - b).abs() > tolerance.step);
                if tried.len() == 4 * (q + 1) && !tried.iter().any(far) {
                    return Ok(Status::Converged);
                }
                reference = cost;
                borrowed.0.iterated(cost, &z);
            }
        }
        state = match solver.next_iter(&mut problem, state) {
            Ok((state, _)) => state,
            Err(e) => return Ok(broken(e)),
        };
    }
}
