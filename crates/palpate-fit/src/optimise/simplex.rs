//! The simplex method of Nelder & Mead (1965), on the cost of the nearest point in the box.
//!
//! A simplex of q + 1 corners walks by reflecting its worst corner at the centroid of the others, and expands, contracts or shrinks
//! by what it finds there. Coefficients depend on q as Gao & Han (2012) propose: with fixed ones the simplex flattens where there
//! are many parameters. For one and two parameters they are the classical 1, 2, ½, ½.
//!
//! A point that cannot be computed has an infinite cost and is a bad corner like any other.

use super::{Sample, Search, Status, Stop};

/// Edge of the first simplex in z.
const EDGE: f64 = 0.5;
/// Edge of the simplex around a point that looks converged, to see whether the first one had collapsed.
const SECOND_EDGE: f64 = 0.05;

/// How far points lie from the centroid, or corners from the best one, over how far they were.
struct Coefficients {
    expansion: f64,
    contraction: f64,
    shrinkage: f64,
}

impl Coefficients {
    /// For q parameters. Theirs shrink to a point for q = 1, so that it counts as two.
    fn new(q: usize) -> Coefficients {
        let n = q.max(2) as f64;
        Coefficients { expansion: 1.0 + 2.0 / n, contraction: 0.75 - 0.5 / n, shrinkage: 1.0 - 1.0 / n }
    }
}

/// A point of the simplex `[q]`, which may lie outside the box, and the cost of the nearest one inside.
#[derive(Clone)]
struct Corner {
    z: Vec<f64>,
    cost: f64,
}

impl Corner {
    fn at(search: &mut Search, z: Vec<f64>) -> Result<Corner, Stop> {
        let cost = search.evaluate(&search.project(&z))?.cost;
        Ok(Corner { z, cost })
    }
}

/// q + 1 corners, the best one first.
struct Simplex {
    corners: Vec<Corner>,
    by: Coefficients,
}

pub fn minimise(search: &mut Search, z: Vec<f64>, at: Sample) -> Result<Status, Stop> {
    let first = descend(search, z, at.cost, EDGE)?;
    let Some((best, Sample { cost, .. })) = search.best.clone() else { return Ok(first) };
    if first != Status::Converged {
        return Ok(first);
    }
    descend(search, best, cost, SECOND_EDGE)
}

/// Walks from a simplex with one corner at z, whose cost is known.
fn descend(search: &mut Search, z: Vec<f64>, cost: f64, edge: f64) -> Result<Status, Stop> {
    let mut simplex = Simplex::around(search, Corner { z, cost }, edge)?;
    loop {
        if simplex.has_converged(search) {
            return Ok(Status::Converged);
        }
        if search.out_of_iterations() {
            return Ok(Status::IterationLimit);
        }
        simplex.step(search)?;
        if let Some((z, Sample { cost, .. })) = search.best.clone() {
            search.iterated(cost, &z);
        }
    }
}

impl Simplex {
    /// A corner and one more along every axis.
    fn around(search: &mut Search, first: Corner, edge: f64) -> Result<Simplex, Stop> {
        let q = first.z.len();
        let mut corners = vec![first];
        for i in 0..q {
            let mut z = corners[0].z.clone();
            // Away from a bound that is near.
            z[i] += if z[i] + edge <= search.upper[i] { edge } else { -edge };
            corners.push(Corner::at(search, z)?);
        }
        let mut simplex = Simplex { corners, by: Coefficients::new(q) };
        simplex.sort();
        Ok(simplex)
    }

    /// Of equal corners the older one stays first.
    fn sort(&mut self) {
        self.corners.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    }

    /// True where all corners cost the same, or are the same point of the box.
    fn has_converged(&self, search: &Search) -> bool {
        let (best, worst) = (&self.corners[0], &self.corners[self.corners.len() - 1]);
        let tolerance = &search.settings.tolerance;
        let middle = search.project(&best.z);
        let near = |c: &Corner| search.project(&c.z).iter().zip(&middle).all(|(a, b)| (a - b).abs() <= tolerance.step);
        worst.cost - best.cost <= tolerance.cost * best.cost.abs() || self.corners.iter().all(near)
    }

    /// The point at `share` of the way from the centroid of all corners but the worst to that one.
    fn towards_worst(&self, share: f64) -> Vec<f64> {
        let (worst, others) = self.corners.split_last().expect("a simplex has corners");
        let middle = |i: usize| others.iter().map(|c| c.z[i]).sum::<f64>() / others.len() as f64;
        (0..worst.z.len()).map(middle).zip(&worst.z).map(|(o, w)| o + share * (w - o)).collect()
    }

    /// Replaces the worst corner by a better one; where none is found, draws all corners towards the best.
    fn step(&mut self, search: &mut Search) -> Result<(), Stop> {
        let last = self.corners.len() - 1;
        let [best, second_worst, worst] = [0, last - 1, last].map(|k| self.corners[k].cost);
        let reflected = Corner::at(search, self.towards_worst(-1.0))?;
        let found = if reflected.cost < best {
            let expanded = Corner::at(search, self.towards_worst(-self.by.expansion))?;
            Some(if expanded.cost < reflected.cost { expanded } else { reflected })
        } else if reflected.cost < second_worst {
            Some(reflected)
        } else {
            // On the better side of the centroid.
            let (side, limit) = if reflected.cost < worst { (-1.0, reflected.cost) } else { (1.0, worst) };
            let contracted = Corner::at(search, self.towards_worst(side * self.by.contraction))?;
            (contracted.cost < limit).then_some(contracted)
        };
        match found {
            Some(corner) => self.corners[last] = corner,
            None => self.shrink(search)?,
        }
        self.sort();
        Ok(())
    }

    fn shrink(&mut self, search: &mut Search) -> Result<(), Stop> {
        let (best, others) = self.corners.split_first_mut().expect("a simplex has corners");
        for corner in others {
            let z = best.z.iter().zip(&corner.z).map(|(b, c)| b + self.by.shrinkage * (c - b)).collect();
            *corner = Corner::at(search, z)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;
    use palpate_model::scene::Optimizer;

    #[test]
    fn coefficients_are_classical_in_two_dimensions_and_change_less_in_more() {
        for (q, all) in [(1, [2.0, 0.5, 0.5]), (2, [2.0, 0.5, 0.5]), (8, [1.25, 0.6875, 0.875])] {
            let c = Coefficients::new(q);
            assert_eq!([c.expansion, c.contraction, c.shrinkage], all, "{q}");
        }
    }

    #[test]
    fn ten_parameters_in_a_bent_valley_are_found_past_points_that_fail() {
        // Rosenbrock's function, chained over ten axes, around 1; nothing can be computed beyond 1.4.
        let cost = |z: &[f64]| 1.0 + z.windows(2).map(|w| (1.0 - w[0]).powi(2) + 5.0 * (w[1] - w[0] * w[0]).powi(2)).sum::<f64>();
        let mut evaluate = |z: &[f64]| -> Result<Sample, Stop> {
            let too_far = z.iter().any(|z| *z > 1.4);
            Ok(if too_far { Sample::failed("too far".into()) } else { Sample { cost: cost(z), ..Sample::default() } })
        };
        let (lower, upper) = ([f64::NEG_INFINITY; 10], [f64::INFINITY; 10]);
        let settings = Settings { iterations: 20_000, ..Settings::new(Optimizer::NelderMead) };
        let mut silent = |_: usize, _: f64, _: &[f64]| {};
        let search = Search::new(&mut evaluate, &mut silent, &lower, &upper, &settings);
        let found = search.run(Optimizer::NelderMead, &[0.3; 10]);
        assert_eq!(found.status, Status::Converged);
        assert!(found.z.iter().all(|z| (z - 1.0).abs() < 1e-3), "{:?}", found.z);
    }
}
