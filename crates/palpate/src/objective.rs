//! The cost of a fit as a function of its free values, with its gradient: for other people's optimisers.

use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{check, fingerprint, free_parameters};
use crate::interrupt::Interrupt;
use palpate_engine::Stop;
use palpate_fit::{FitScene, Problem, Sample, Want};
use palpate_io::InputError;
use std::sync::{Arc, Mutex, PoisonError};

/// In which coordinates the free values are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coordinates {
    /// As the scene has them, in SI units. Priors of fields are left out, which are about coordinates of the other kind.
    #[default]
    Physical,
    /// As palpate's own optimisers see them: of order one, a logarithm where a value is positive.
    Scaled,
}

/// What a fit of one or several experiments minimises, over its free values `[q]`: numbers and values of fields in the order of the scene files.
///
/// ```
/// use palpate::{Backend, Coordinates, Experiment, Objective};
///
/// let scene = format!("{}/../../assets/scenes/first-fit.toml", env!("CARGO_MANIFEST_DIR"));
/// let experiment = Experiment::open(scene)?;
/// let mut cost = Objective::new(&[experiment], Backend::Cpu, Coordinates::Physical)?;
/// assert_eq!(cost.names(), ["material.youngs_modulus"]);
/// // The body was recorded with 5e4 Pa.
/// let (_, gradient) = cost.value_and_gradient(&[2.0e5])?;
/// assert!(gradient[0] > 0.0);
/// # Ok::<(), palpate::Error>(())
/// ```
pub struct Objective {
    problem: Problem<'static>,
    coordinates: Coordinates,
    names: Vec<String>,
    /// What evaluations look at.
    interrupt: Arc<Mutex<Interrupt>>,
}

impl Objective {
    /// The cost of experiments that share what their `[fit]` tables share.
    ///
    /// # Errors
    /// As [`crate::fit`] before it begins.
    pub fn new(experiments: &[Experiment], backend: Backend, coordinates: Coordinates) -> Result<Objective, Error> {
        let first = experiments.first().ok_or_else(|| Error::Input("no scene is given".into()))?;
        check(experiments)?;
        let (_, free, _) = free_parameters(experiments)?;
        let backend = backend.resolve(first.plan(), 1).0;
        let interrupt = Arc::new(Mutex::new(Interrupt::default()));
        let current = interrupt.clone();
        let stop = Stop::when(move || current.lock().unwrap_or_else(PoisonError::into_inner).is_urgent());
        let mut scenes = Vec::new();
        for e in experiments {
            scenes.push(FitScene {
                name: e.scene().path.display().to_string(),
                fingerprint: fingerprint(e.plan()),
                base: e.plan().theta.clone(),
                evaluate: backend.evaluator_until(e.plan(), 1, stop.clone())?,
            });
        }
        let problem = Problem::new(scenes, free).map_err(|e| InputError::file(&first.scene().path, e))?;
        let label = |f: &palpate_fit::FreeParameter, k: usize| {
            if f.count == 1 { f.path.clone() } else { format!("{}.{k}", f.path) }
        };
        let names = problem.free().iter().flat_map(|f| (0..f.count).map(move |k| label(f, k))).collect();
        Ok(Objective { problem, coordinates, names, interrupt })
    }

    /// Evaluations from now on end where this is raised.
    pub fn until(&mut self, interrupt: &Interrupt) {
        *self.interrupt.lock().unwrap_or_else(PoisonError::into_inner) = interrupt.clone();
    }

    /// Paths of the free values `[q]`, with the scene's number where it has its own.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// SI units of the physical values `[q]`.
    pub fn units(&self) -> Vec<String> {
        self.problem.blocks().flat_map(|(f, places)| places.map(|_| f.unit.clone())).collect()
    }

    /// The scenes' own values `[q]`, in these coordinates.
    pub fn start(&self) -> Vec<f64> {
        let values = self.problem.own_values();
        match self.coordinates {
            Coordinates::Physical => values,
            Coordinates::Scaled => self.coordinates_of(&values),
        }
    }

    /// Lower and upper bounds `[q]`, in these coordinates; infinite where there is none.
    pub fn bounds(&self) -> Vec<(f64, f64)> {
        match self.coordinates {
            Coordinates::Physical => self.problem.blocks().flat_map(|(f, places)| places.map(|_| f.bounds)).collect(),
            Coordinates::Scaled => self.problem.charts().iter().map(|c| c.range()).collect(),
        }
    }

    /// Physical values `[q]` at x `[q]`.
    pub fn values(&self, x: &[f64]) -> Vec<f64> {
        match self.coordinates {
            Coordinates::Physical => x.to_vec(),
            Coordinates::Scaled => self.problem.values(x),
        }
    }

    /// Scaled coordinates `[q]` of physical values `[q]`, which are moved into their bounds.
    pub fn coordinates_of(&self, values: &[f64]) -> Vec<f64> {
        self.problem.charts().iter().zip(values).map(|(c, v)| c.coordinate(*v)).collect()
    }

    /// The cost at x `[q]`, dimensionless: half the mean squared residual in units of its noise, and what is known beforehand.
    ///
    /// # Errors
    /// [`Error::Input`] for an x of another length or with a value that is not finite, [`Error::Failed`] where x cannot be simulated,
    /// [`Error::Interrupted`].
    pub fn value(&mut self, x: &[f64]) -> Result<f64, Error> {
        Ok(self.sample(x, Want::Cost)?.cost)
    }

    /// The cost and its gradient `[q]`, exact for the discretised motion, by one simulation and one walk back.
    ///
    /// # Errors
    /// As [`Objective::value`].
    pub fn value_and_gradient(&mut self, x: &[f64]) -> Result<(f64, Vec<f64>), Error> {
        let s = self.sample(x, Want::Gradient)?;
        Ok((s.cost, s.gradient))
    }

    /// The gradient `[q]` and the Gauss–Newton approximation of the second derivatives `[q, q]`, row by row.
    ///
    /// # Errors
    /// As [`Objective::value`].
    pub fn gradient_and_curvature(&mut self, x: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let s = self.sample(x, Want::Curvature)?;
        Ok((s.gradient, s.curvature))
    }

    fn sample(&mut self, x: &[f64], want: Want) -> Result<Sample, Error> {
        let q = self.names.len();
        if x.len() != q {
            return Err(Error::Input(format!("{} values are given, {q} are free: {}", x.len(), self.names.join(", "))));
        }
        if let Some(i) = x.iter().position(|v| !v.is_finite()) {
            return Err(Error::Input(format!("{} is {}, which is not finite", self.names[i], x[i])));
        }
        let rows = [x.to_vec()];
        let sample = match self.coordinates {
            Coordinates::Physical => self.problem.evaluate_values(&rows, want),
            Coordinates::Scaled => self.problem.evaluate(&rows, want),
        };
        let sample = sample.into_iter().next().ok_or_else(|| Error::Failed("the backend returned no result".into()))?;
        match &sample.failure {
            Some(_) if sample.stopped => Err(Error::Interrupted),
            Some(why) => Err(Error::Failed(why.clone())),
            None => Ok(sample),
        }
    }
}
