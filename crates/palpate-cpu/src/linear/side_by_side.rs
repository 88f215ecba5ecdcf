//! Conjugate gradients with several matrices that lie close together, side by side, behind the factor of one like them.
//!
//! The factor is read once for a group of right-hand sides: its triangles are far larger than what they are multiplied with, so a group costs
//! little more than a single one. Groups have a fixed size, so no bit depends on the number of threads.

use super::Trouble;
use super::cholesky::RoughFactor;
use super::matrix::Operator;
use super::vector::{Nodes, add_scaled, dot};
use glam::DVec3;
use rayon::prelude::*;

/// Right-hand sides that go through the factor together. Of a factor with 13 million entries sixteen take 55 ms, eight 50 and a single one 27.
pub const GROUP: usize = 16;

/// One problem A x = b.
pub struct Column<'a> {
    /// A.
    pub operator: &'a (dyn Operator + Send + Sync),
    /// b.
    pub rhs: Nodes,
    /// Stops when `‖r‖ ≤ max(relative·‖b‖, absolute)` in the norm `sqrt(rᵀ M⁻¹ r)`, M the factor's matrix.
    pub relative: f64,
    /// Ibid.
    pub absolute: f64,
}

/// x, and the iterations that it took.
pub type Solved = Result<(Nodes, usize), Trouble>;

/// A column on its way.
struct Way<'a> {
    operator: &'a (dyn Operator + Send + Sync),
    x: Nodes,
    r: Nodes,
    z: Nodes,
    p: Nodes,
    q: Nodes,
    /// r·M⁻¹r.
    rz: f64,
    scale: f64,
    target: f64,
    /// Length of the last step.
    alpha: f64,
    iterations: usize,
    end: Option<Result<(), Trouble>>,
}

impl<'a> Way<'a> {
    fn new(column: &Column<'a>) -> Way<'a> {
        let blank = vec![DVec3::ZERO; column.rhs.len()];
        Way {
            operator: column.operator,
            x: blank.clone(),
            r: column.rhs.clone(),
            z: column.rhs.clone(),
            p: blank.clone(),
            q: blank,
            rz: 0.0,
            scale: 0.0,
            target: 0.0,
            alpha: 0.0,
            iterations: 0,
            end: None,
        }
    }

    /// From here z = M⁻¹ b.
    fn begin(&mut self, column: &Column) {
        self.rz = dot(&self.r, &self.z);
        self.scale = self.rz.max(0.0).sqrt();
        self.target = (column.relative * self.scale).max(column.absolute);
        self.p.copy_from_slice(&self.z);
        if self.scale == 0.0 {
            self.end = Some(Ok(()));
        }
    }

    /// One step along p; true where a new z is wanted.
    fn advance(&mut self, most: usize) -> bool {
        if self.end.is_some() {
            return false;
        }
        let left = self.rz.max(0.0).sqrt();
        if left <= self.target {
            self.end = Some(Ok(()));
            return false;
        }
        if self.iterations == most {
            self.end = Some(Err(Trouble::Unconverged(left / self.scale)));
            return false;
        }
        self.operator.multiply(&self.p, &mut self.q);
        let curvature = dot(&self.p, &self.q);
        // False for NaN as well.
        if !(curvature > 0.0 && curvature.is_finite()) {
            let indefinite = || Trouble::Indefinite("a direction of negative curvature".into());
            self.end = Some(Err(if curvature.is_finite() { indefinite() } else { Trouble::Unconverged(f64::NAN) }));
            return false;
        }
        self.alpha = self.rz / curvature;
        add_scaled(&mut self.x, self.alpha, &self.p);
        add_scaled(&mut self.r, -self.alpha, &self.q);
        self.z.copy_from_slice(&self.r);
        self.iterations += 1;
        true
    }

    /// The next p, from z = M⁻¹ r. β = z·(r − r₀)/(r₀·z₀) of Polak and Ribière, where r − r₀ = −α q, keeps p conjugate to the last one though
    /// M⁻¹ rounds.
    fn turn(&mut self) {
        let beta = -self.alpha * dot(&self.q, &self.z) / self.rz;
        self.rz = dot(&self.r, &self.z);
        self.p.iter_mut().zip(&self.z).for_each(|(p, z)| *p = *z + beta * *p);
    }
}

/// Solves all of them from zero guesses, each in at most so many iterations.
pub fn solve(factor: &RoughFactor, columns: &[Column], most: usize) -> Vec<Solved> {
    columns.par_chunks(GROUP).flat_map_iter(|group| solve_group(factor, group, most)).collect()
}

fn solve_group(factor: &RoughFactor, columns: &[Column], most: usize) -> Vec<Solved> {
    let mut ways: Vec<Way> = columns.iter().map(Way::new).collect();
    factor.solve(&mut ways.iter_mut().map(|w| w.z.as_mut_slice()).collect::<Vec<_>>());
    ways.iter_mut().zip(columns).for_each(|(w, c)| w.begin(c));
    loop {
        let mut going: Vec<&mut Way> = ways.par_iter_mut().filter_map(|w| w.advance(most).then_some(w)).collect();
        if going.is_empty() {
            break;
        }
        factor.solve(&mut going.iter_mut().map(|w| w.z.as_mut_slice()).collect::<Vec<_>>());
        going.iter_mut().for_each(|w| w.turn());
    }
    let ended = |w: Way| w.end.expect("every column ends").map(|()| (w.x, w.iterations));
    ways.into_iter().map(ended).collect()
}
