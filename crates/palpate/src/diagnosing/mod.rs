//! From experiments to a diagnosis: the baseline fit, and a laboratory that simulates and fits hypotheses for `palpate_diagnose`.

mod checkpoint;
mod hypothesis;
mod lab;
mod limits;
mod others;
mod refined;
mod separate;
mod systematic;
mod walls;

use crate::engine::{Backend, with_threads};
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{FitOptions, Fitted, fit};
use crate::interrupt::Interrupt;
use lab::Lab;
use palpate_diagnose::{Change, Diagnosis, Laboratory, Model};
use palpate_io::InputError;
use palpate_model::effects::Effect;
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
    for e in experiments.iter().chain(held_out) {
        if e.plan().observation.residuals() == 0 {
            let message = "is missing or has no data to compare with; name a recording";
            return Err(Error::scene(&e.scene().path, "observation", message));
        }
    }
    if let Some(other) = held_out {
        same_body(experiments, other)?;
    }
    let mut told = options.on_progress.take();
    let mut say = |what: &str| {
        if let Some(f) = &mut told {
            f(what);
        }
    };
    let is_free = |e: &Experiment| e.scene().fit.as_ref().is_some_and(|f| !f.parameters.is_empty());
    let mut base = experiments.to_vec();
    let mut fitted = None;
    if experiments.iter().any(is_free) {
        say("baseline fit");
        let journal = options.checkpoints.as_ref().map(|(folder, resume)| (folder.join("journal.jsonl"), *resume));
        let f = fit(
            experiments,
            FitOptions {
                backend: options.backend,
                tolerance: Some(BASELINE),
                interrupt: options.interrupt.clone(),
                journal,
                ..FitOptions::default()
            },
        )?;
        if let Some(why) = &f.result.broken {
            return Err(Error::Failed(format!("the baseline's fit: {why}")));
        }
        for (e, theta) in base.iter_mut().zip(&f.result.theta) {
            e.plan.theta.clone_from(theta);
        }
        fitted = Some(f);
    }
    let threads = first.scene().fit.as_ref().map_or(0, |f| f.threads);
    let (backend, known, free) = (options.backend, &base, &fitted);
    let plain = hypothesis::prepare(&base, &[])?;
    let values = plain.own_values();
    let (diagnosis, broken) = with_threads(threads, move || {
        let deadline = options.budget.map(|b| clock + b);
        let mut lab = Lab::new(known, held_out, &options, deadline, &mut say)?;
        let numbers = lab.numbers(&[])?;
        let errors = numbers.iter().map(|n| {
            let parameters = free.iter().flat_map(|f| f.free.iter().zip(&f.result.parameters));
            parameters.filter(|(f, _)| f.label() == n.path).find_map(|(_, p)| p.standard_error)
        });
        let model = Model { changes: Vec::new(), values, errors: errors.collect(), numbers };
        let found = palpate_diagnose::diagnose(&mut lab, model, &options.statistics);
        match (found, lab.broken()) {
            (Ok(diagnosis), broken) => Ok((diagnosis, broken)),
            (Err(_), Some(why)) => Err(Error::Failed(why)),
            (Err(e), None) => Err(e.into()),
        }
    })??;
    let theta_before = (0..base.len()).map(|s| plain.theta(s, &diagnosis.baseline.values)).collect();
    let model = &diagnosis.model;
    let ready = hypothesis::prepare(&base, &model.changes)?;
    let mut corrected = ready.experiments.clone();
    let mut values = vec![Vec::new(); base.len()];
    for (s, e) in corrected.iter_mut().enumerate() {
        e.plan.theta = ready.theta(s, &model.values);
        e.scene.effects.iter_mut().enumerate().for_each(|(i, effect)| {
            for (slot, v) in effect.values.iter_mut().enumerate() {
                let key = |k: &palpate_model::params::ParamKey| {
                    matches!(k, palpate_model::params::ParamKey::Effect { effect: e, slot: s, .. }
                        if usize::from(*e) == i && usize::from(*s) == slot)
                };
                *v = e.plan.layout.keys.iter().position(key).map(|p| e.plan.theta[p]);
            }
        });
        values[s] = ready.values_of(s, &model.values);
    }
    let added = model.changes.iter().filter_map(|c| if let Change::Effect(_) = c { Some(()) } else { None }).count();
    let all = &corrected[0].scene.effects;
    Ok(Diagnosed {
        added: all[all.len() - added..].to_vec(),
        backend: backend.name(),
        fit: fitted,
        theta_before,
        experiments: corrected,
        values,
        broken,
        seconds: clock.elapsed().as_secs_f64(),
        diagnosis,
    })
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
