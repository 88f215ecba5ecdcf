//! Motion in time: the two-step backward differentiation formula (BDF2; Curtiss & Hirschfelder, *PNAS* 38, 1952), whose first step is backward
//! Euler, each step the minimum of an energy found by Newton's method.

use super::body::{Body, Motion};
use super::matrix::Pattern;
use glam::{DMat3, DVec3};

/// Newton's method ends with a step below this part of the body's size: what is left is no more than that ([`SHRINK`]).
const TOLERANCE: f64 = 3e-7;
/// Length of a step over the one before from which on the matrix is made anew.
const SHRINK: f64 = 0.5;
/// Most steps of Newton's method.
const ITERATIONS: usize = 60;
/// How often a step solves again with the pressure that it found, where friction counts with it.
const LAGS: usize = 2;

/// A state.
#[derive(Clone, Debug)]
pub struct State {
    /// Displacements [m].
    pub u: Vec<DVec3>,
    /// Velocities [m/s].
    pub v: Vec<DVec3>,
}

/// A body on its way.
pub struct Integrator {
    body: Body,
    pattern: Pattern,
    step: f64,
    now: State,
    before: Option<(State, Vec<[DMat3; 4]>)>,
    size: f64,
    kept: Option<Kept>,
}

/// A matrix that was factorised.
struct Kept {
    /// Of the [`Motion`] that it belongs to [1/s].
    rate: f64,
    factor: Vec<f64>,
}

impl Integrator {
    /// Starts at rest with these velocities; held nodes have none.
    ///
    /// # Errors
    /// The body's matrix has no pattern that can be factorised.
    pub fn new(body: Body, mut v: Vec<DVec3>, step: f64) -> Result<Integrator, String> {
        v.iter_mut().zip(&body.held).filter(|(_, h)| **h).for_each(|(v, _)| *v = DVec3::ZERO);
        let nodes = &body.mesh.nodes;
        let low = nodes.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = nodes.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let now = State { u: vec![DVec3::ZERO; nodes.len()], v };
        let pattern = Pattern::new(&body.mesh.tets, &body.held)?;
        Ok(Integrator { size: (high - low).length(), body, pattern, step, now, before: None, kept: None })
    }

    /// The body.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// The body, to change what acts on it in the steps that come.
    pub fn body_mut(&mut self) -> &mut Body {
        &mut self.body
    }

    /// The state.
    pub fn state(&self) -> &State {
        &self.now
    }

    /// Computes the next state.
    ///
    /// # Errors
    /// Newton's method does not converge.
    pub fn advance(&mut self) -> Result<(), String> {
        let (h, now, strains) = (self.step, &self.now, self.body.strains(&self.now.u));
        let mix = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| (4.0 * *a - *b) / 3.0).collect::<Vec<_>>();
        let mut m = Motion {
            rate: 1.0 / h,
            step: h,
            old: now.u.clone(),
            before: now.u.clone(),
            before_velocity: now.v.clone(),
            before_strain: strains.clone(),
            pressures: Vec::new(),
        };
        if let Some((last, last_strains)) = &self.before {
            m.rate = 1.5 / h;
            m.before = mix(&now.u, &last.u);
            m.before_velocity = mix(&now.v, &last.v);
            for (a, b) in m.before_strain.iter_mut().flatten().zip(last_strains.iter().flatten()) {
                *a = (*a * 4.0 - *b) * (1.0 / 3.0);
            }
        }
        let mut u: Vec<DVec3> = now.u.iter().zip(&now.v).map(|(u, v)| *u + h * *v).collect();
        u.iter_mut().zip(&self.body.held).filter(|(_, h)| **h).for_each(|(u, _)| *u = self.body.offset);
        m.pressures = self.body.pressures(&u);
        u = self.minimum(&m, u)?;
        if !m.pressures.is_empty() {
            for _ in 0..LAGS {
                m.pressures = self.body.pressures(&u);
                u = self.minimum(&m, u)?;
            }
        }
        let v = u.iter().zip(&m.before).map(|(u, b)| m.rate * (*u - *b)).collect();
        self.before = Some((std::mem::replace(&mut self.now, State { u, v }), strains));
        Ok(())
    }

    /// The state of rest under the loads.
    ///
    /// # Errors
    /// Newton's method does not converge.
    #[cfg(test)]
    pub fn settle(&mut self) -> Result<(), String> {
        let zero = vec![DVec3::ZERO; self.now.u.len()];
        let m = Motion {
            rate: 0.0,
            step: 0.0,
            old: zero.clone(),
            before: zero.clone(),
            before_velocity: zero.clone(),
            before_strain: self.body.strains(&zero),
            pressures: Vec::new(),
        };
        let start = self.now.u.clone();
        self.now.u = self.minimum(&m, start)?;
        Ok(())
    }

    /// Newton's method, whose matrix is kept as long as its steps shrink: most steps of time need no new one.
    fn minimum(&mut self, m: &Motion, mut u: Vec<DVec3>) -> Result<Vec<DVec3>, String> {
        let mut last = f64::INFINITY;
        for _ in 0..ITERATIONS {
            let is_new = self.kept.as_ref().is_none_or(|k| k.rate != m.rate);
            let (energy, mut gradient) = if is_new {
                let mut values = self.pattern.zeros();
                let found = self.body.derivatives(m, &u, |i, j, block| self.pattern.add(&mut values, i, j, block));
                self.kept = Some(Kept { rate: m.rate, factor: self.positive(values)? });
                found
            } else {
                self.body.gradient(m, &u)
            };
            gradient.iter_mut().zip(&self.body.held).filter(|(_, h)| **h).for_each(|(g, _)| *g = DVec3::ZERO);
            let back: Vec<DVec3> = gradient.iter().map(|g| -*g).collect();
            let Some(kept) = &self.kept else { return Err("there is no matrix".into()) };
            let way = self.pattern.solve(&kept.factor, &back);
            let slope: f64 = way.iter().zip(&gradient).map(|(w, g)| w.dot(*g)).sum();
            let longest = way.iter().map(|w| w.length()).fold(0.0, f64::max);
            if !longest.is_finite() {
                return Err("Newton's method: the direction is not finite".into());
            }
            let small = longest < TOLERANCE * self.size;
            if !small && !is_new && longest > SHRINK * last {
                // The matrix is too old.
                self.kept = None;
                last = f64::INFINITY;
                continue;
            }
            last = longest;
            let moved = |t: f64| u.iter().zip(&way).map(|(u, w)| *u + t * *w).collect::<Vec<_>>();
            // Where rounding hides the decrease there is nothing to be searched for.
            let (mut t, mut new) = (1.0, moved(1.0));
            let mut stuck = false;
            while !small && self.body.energy(m, &new) > energy + 1e-4 * t * slope + 1e-13 * energy.abs() {
                t *= 0.5;
                stuck = t < 1e-6;
                if stuck {
                    break;
                }
                new = moved(t);
            }
            if stuck && is_new {
                return Err("Newton's method finds no decrease".into());
            }
            if stuck || t < 1.0 {
                self.kept = None;
                last = f64::INFINITY;
            }
            if !stuck {
                u = new;
            }
            if small {
                return Ok(u);
            }
        }
        Err(format!("Newton's method does not converge in {ITERATIONS} steps"))
    }

    /// The factor of a matrix, with something added to the diagonal of one that is not positive definite.
    fn positive(&self, values: Vec<f64>) -> Result<Vec<f64>, String> {
        if let Some(factor) = self.pattern.factor(values.clone()) {
            return Ok(factor);
        }
        let largest = values.iter().copied().fold(0.0, f64::max);
        let mut shift = 1e-6 * largest;
        while shift < 1e3 * largest {
            let mut shifted = values.clone();
            let block = DMat3::from_diagonal(DVec3::splat(shift));
            (0..self.body.held.len()).for_each(|n| self.pattern.add(&mut shifted, n, n, block));
            if let Some(factor) = self.pattern.factor(shifted) {
                return Ok(factor);
            }
            shift *= 10.0;
        }
        Err("the matrix of a step is indefinite".into())
    }
}
