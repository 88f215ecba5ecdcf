//! From experiments to a diagnosis: the baseline fit, and a laboratory that simulates and fits hypotheses for `palpate_diagnose`.

mod checkpoint;
mod hypothesis;
mod lab;
mod laps;
mod limits;
mod others;
mod refined;
mod separate;
mod systematic;
mod walls;
mod world;

use crate::engine::{Backend, with_threads};
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{FitOptions, Fitted, fit};
use crate::interrupt::Interrupt;
use lab::Lab;
use palpate_diagnose::{Change, Diagnosis, Laboratory, Model};
use palpate_io::InputError;
use palpate_model::effects::Effect;
use palpate_model::params::ParamKey;
use palpate_model::scene::ObservationSpec;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Relative decrease of the cost at which the baseline has arrived: what its numbers move by after that is projected out of everything.
const BASELINE: f64 = 1e-6;

/// How to run a diagnosis.
#[derive(Default)]
pub struct DiagnoseOptions<'a> {
    /// What computes the physics.
    pub backend: Backend,
    /// Statistical choices.
    pub statistics: palpate_diagnose::Options,
    /// Time for the search; the stage that runs when it is over is finished. `None` = no limit.
    pub budget: Option<Duration>,
    /// Stops in good order.
    pub interrupt: Interrupt,
    /// Folder for journal and checkpoints, and whether to go on with what they hold.
    pub checkpoints: Option<(PathBuf, bool)>,
    /// Hears what is going on.
    pub on_progress: Option<&'a mut (dyn FnMut(&str) + Send)>,
}

/// A finished diagnosis with what reports need.
#[derive(Clone, Debug)]
pub struct Diagnosed {
    /// The answer.
    pub diagnosis: Diagnosis,
    /// Name of the backend used.
    pub backend: &'static str,
    /// The baseline's fit; `None` when the scenes leave nothing free.
    pub fit: Option<Fitted>,
    /// θ of every scene with the baseline.
    pub theta_before: Vec<Vec<f64>>,
    /// The corrected experiments (effects added, values in place).
    pub experiments: Vec<Experiment>,
    /// Effects that were added.
    pub added: Vec<Effect>,
    /// Found values of every scene's numbers by path, for writing scenes.
    pub values: Vec<Vec<(String, f64)>>,
    /// Why the device failed, if it did: the search ended there, as if it had been interrupted.
    pub broken: Option<String>,
    /// Wall-clock time [s].
    pub seconds: f64,
}

/// Finds what the model of one or several experiments lacks. `held_out` is a recording of the same body that no fit sees.
///
/// # Errors
/// [`Error::Scene`] when there is nothing to compare with or `held_out` shows nothing new, [`Error::File`] when it shows another body,
/// [`Error::Fit`] or [`Error::Diagnosis`] when the baseline cannot be computed, [`Error::Interrupted`] when it was stopped before the
/// baseline was known.
pub fn diagnose(
    experiments: &[Experiment],
    held_out: Option<&Experiment>,
    mut options: DiagnoseOptions,
) -> Result<Diagnosed, Error> {
    let clock = Instant::now();
    let first = experiments.first().ok_or_else(|| Error::Input("no scene is given".into()))?;
    check(experiments, held_out)?;
    let mut told = options.on_progress.take();
    let mut say = |what: &str| {
        if let Some(f) = &mut told {
            f(what);
        }
    };
    let (base, fitted) = baseline(experiments, &options, &mut say)?;
    let plain = hypothesis::prepare(&base, &[])?;
    let threads = first.scene().fit.as_ref().map_or(0, |f| f.threads);
    let (backend, known, free, values) = (options.backend, &base, fitted.as_ref(), plain.own_values());
    let (diagnosis, broken) = with_threads(threads, move || {
        let deadline = options.budget.map(|b| clock + b);
        let lab = Lab::new(known, held_out, &options, deadline, &mut say)?;
        search(lab, free, values, &options.statistics)
    })??;
    let theta_before = (0..base.len()).map(|s| plain.theta(s, &diagnosis.baseline.values)).collect();
    let (experiments, values) = corrected(&base, &diagnosis.model)?;
    let added = diagnosis.model.changes.iter().filter(|c| matches!(c, Change::Effect(_))).count();
    let all = &experiments[0].scene.effects;
    Ok(Diagnosed {
        added: all[all.len() - added..].to_vec(),
        backend: backend.name(),
        fit: fitted,
        theta_before,
        experiments,
        values,
        broken,
        seconds: clock.elapsed().as_secs_f64(),
        diagnosis,
    })
}

/// Refuses experiments that have nothing to compare with, and a second recording of another body or of nothing new.
fn check(experiments: &[Experiment], held_out: Option<&Experiment>) -> Result<(), Error> {
    for e in experiments.iter().chain(held_out) {
        if e.plan().observation.residuals() == 0 {
            let message = "is missing or has no data to compare with; name a recording";
            return Err(Error::scene(&e.scene().path, "observation", message));
        }
    }
    held_out.map_or(Ok(()), |other| same_body(experiments, other))
}

/// The experiments with the values that fit best as they are, and that fit; `None` where they leave nothing free.
fn baseline(
    experiments: &[Experiment],
    options: &DiagnoseOptions,
    say: &mut dyn FnMut(&str),
) -> Result<(Vec<Experiment>, Option<Fitted>), Error> {
    let is_free = |e: &Experiment| e.scene().fit.as_ref().is_some_and(|f| !f.parameters.is_empty());
    let mut base = experiments.to_vec();
    if !experiments.iter().any(is_free) {
        return Ok((base, None));
    }
    say("baseline fit");
    let fitted = fit(
        experiments,
        FitOptions {
            backend: options.backend,
            tolerance: Some(BASELINE),
            interrupt: options.interrupt.clone(),
            journal: options.checkpoints.as_ref().map(|(folder, resume)| (folder.join("journal.jsonl"), *resume)),
            ..FitOptions::default()
        },
    )?;
    if let Some(why) = &fitted.result.broken {
        return Err(Error::Failed(format!("the baseline's fit: {why}")));
    }
    for (e, theta) in base.iter_mut().zip(&fitted.result.theta) {
        e.plan.theta.clone_from(theta);
    }
    Ok((base, Some(fitted)))
}

/// The answer, from the baseline's values and their errors; and why the device failed on the way, if it did.
fn search(
    mut lab: Lab,
    fitted: Option<&Fitted>,
    values: Vec<f64>,
    statistics: &palpate_diagnose::Options,
) -> Result<(Diagnosis, Option<String>), Error> {
    let numbers = lab.numbers(&[])?;
    let errors = numbers.iter().map(|n| {
        let parameters = fitted.iter().flat_map(|f| f.free.iter().zip(&f.result.parameters));
        parameters.filter(|(f, _)| f.label() == n.path).find_map(|(_, p)| p.standard_error)
    });
    let model = Model { changes: Vec::new(), values, errors: errors.collect(), numbers };
    let found = palpate_diagnose::diagnose(&mut lab, model, statistics);
    match (found, lab.broken()) {
        (Ok(diagnosis), broken) => Ok((diagnosis, broken)),
        (Err(_), Some(why)) => Err(Error::Failed(why)),
        (Err(e), None) => Err(e.into()),
    }
}

/// Experiments with the effects and values of a model, and the values of every scene's free numbers by path.
type Corrected = (Vec<Experiment>, Vec<Vec<(String, f64)>>);

fn corrected(base: &[Experiment], model: &Model) -> Result<Corrected, Error> {
    let ready = hypothesis::prepare(base, &model.changes)?;
    let mut experiments = ready.experiments.clone();
    for (s, e) in experiments.iter_mut().enumerate() {
        e.plan.theta = ready.theta(s, &model.values);
        for (place, key) in e.plan.layout.keys.iter().enumerate() {
            if let ParamKey::Effect { effect, slot, .. } = *key {
                e.scene.effects[usize::from(effect)].values[usize::from(slot)] = Some(e.plan.theta[place]);
            }
        }
    }
    let values = (0..base.len()).map(|s| ready.values_of(s, &model.values)).collect();
    Ok((experiments, values))
}

/// Share of its volume by which a second recording's body may differ: grids cut the same body a little differently.
const SAME: f64 = 0.01;

/// What one body taught says nothing of another.
fn same_body(experiments: &[Experiment], other: &Experiment) -> Result<(), Error> {
    let volume = |e: &Experiment| e.plan().body.volume;
    let path = &other.scene().path;
    if experiments.iter().all(|e| (volume(other) / volume(e) - 1.0).abs() > SAME) {
        let cm3 = |e: &Experiment| 1e6 * volume(e);
        let (given, own) = (cm3(&experiments[0]), cm3(other));
        let known = experiments[0].scene().path.display();
        let message = format!(
            "the body has {own:.3} cm³ and that of {known} {given:.3} cm³; --held-out wants another recording of the same body"
        );
        return Err(InputError::file(path, message).into());
    }
    let absolute = |p: &std::path::Path| p.canonicalize().unwrap_or_else(|_| p.into());
    let used = |e: &Experiment| {
        e.scene().observation.as_ref().map(|o| ObservationSpec { recording: absolute(&o.recording), ..o.clone() })
    };
    if experiments.iter().any(|e| used(e) == used(other)) {
        let message = "is the one that is fitted; --held-out wants a recording that no fit sees";
        return Err(Error::scene(path, "observation.recording", message));
    }
    Ok(())
}
