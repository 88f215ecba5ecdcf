//! From experiments to a diagnosis: the baseline fit, and a laboratory that simulates and fits hypotheses for `palpate_diagnose`.

pub(crate) mod checkpoint;
mod crowd;
mod hypothesis;
mod lab;
mod laps;
mod limits;
mod others;
mod refined;
mod separate;
mod simulate;
mod systematic;
mod walls;
mod world;

use crate::engine::{Backend, with_threads};
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{self, Fitted, free_parameters};
use crate::interrupt::{Clock, Interrupt};
use crate::memory::{Demand, members_on_cpu};
use lab::Lab;
use palpate_diagnose::{Change, Diagnosis, LabError, Model};
use palpate_io::InputError;
use palpate_model::effects::Effect;
use palpate_model::params::ParamKey;
use palpate_model::scene::{ObservationSpec, Optimizer};
use std::path::PathBuf;
use std::time::Duration;

/// What there is to say where the starting model could not be simulated once.
const TOO_SHORT: &str =
    "the budget was over before the scene had been simulated once: allow more time, or fewer frames or larger cells";

/// How to run a diagnosis.
#[derive(Default)]
pub struct DiagnoseOptions<'a> {
    /// What computes the physics.
    pub backend: Backend,
    /// Statistical choices.
    pub statistics: palpate_diagnose::Options,
    /// Time for everything, the baseline's fit and the answer among it. `None` = no limit.
    pub budget: Option<Duration>,
    /// What the budget is counted by; it begins when the options are made.
    pub clock: Clock,
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

impl Diagnosed {
    /// The experiment number s, which was `given`, with the effects and values that were found in its text.
    ///
    /// # Errors
    /// The text cannot hold them, or what it says then is refused.
    pub fn corrected(&self, s: usize, given: &Experiment) -> Result<Experiment, Error> {
        let extended = palpate_io::append_effects(given.text(), given.scene(), &self.added)?;
        given.reworded(palpate_io::scene_with_values(&extended, self.experiments[s].scene(), &self.values[s])?)
    }
}

/// What a round of a diagnosis asks of its backend at the same time: candidates of every scene, with derivatives by what is free in the baseline.
///
/// # Errors
/// A path that is no number of its scene, or shared parameters that disagree.
pub(crate) fn demand(experiments: &[Experiment], statistics: &palpate_diagnose::Options) -> Result<Demand, Error> {
    let (_, free, _) = free_parameters(experiments)?;
    let starts = statistics.search.fits * experiments.len();
    Ok(Demand { starts, ..fitting::demand(&free, 0, Optimizer::GaussNewton, starts) })
}

/// Finds what the model of one or several experiments lacks. `held_out` is a recording of the same body that no fit sees.
///
/// # Errors
/// [`Error::Scene`] when there is nothing to compare with or `held_out` shows nothing new, [`Error::File`] when it shows another body,
/// [`Error::Fit`] or [`Error::Diagnosis`] when the baseline cannot be computed, [`Error::Interrupted`] or [`Error::Failed`] when it was
/// stopped, or its time was over, before the starting model had been simulated once.
pub fn diagnose(
    experiments: &[Experiment],
    held_out: Option<&Experiment>,
    mut options: DiagnoseOptions,
) -> Result<Diagnosed, Error> {
    let first = experiments.first().ok_or_else(|| Error::Input("no scene is given".into()))?;
    check(experiments, held_out)?;
    let mut told = options.on_progress.take();
    let mut say = |what: &str| {
        if let Some(f) = &mut told {
            f(what);
        }
    };
    let threads = first.scene().fit.as_ref().map_or(0, |f| f.threads);
    let (backend, clock) = (options.backend, options.clock.clone());
    let Searched { diagnosis, base, fitted, broken } = with_threads(threads, move || {
        // Each thread fits a hypothesis: memory for that is asked for once, before anything is simulated.
        let demand = Demand { starts: rayon::current_num_threads(), ..demand(experiments, &options.statistics)? };
        for e in experiments {
            members_on_cpu(e.plan(), &demand, 0)?;
        }
        let lab = Lab::new(experiments, held_out, &options, &mut say)?;
        search(lab, &options.statistics)
    })??;
    let plain = hypothesis::prepare(&base, &[])?;
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

/// What a search leaves.
struct Searched {
    diagnosis: Diagnosis,
    /// The experiments with the baseline's values.
    base: Vec<Experiment>,
    fitted: Option<Fitted>,
    /// Why the device failed on the way, if it did.
    broken: Option<String>,
}

fn search(mut lab: Lab, statistics: &palpate_diagnose::Options) -> Result<Searched, Error> {
    let start = lab.start()?;
    let found = palpate_diagnose::diagnose(&mut lab, start, statistics);
    let broken = lab.broken();
    let (base, fitted, fault) = lab.finish();
    match (found, fault, &broken) {
        (Ok(diagnosis), ..) => Ok(Searched { diagnosis, base, fitted, broken }),
        (Err(_), Some(fault), _) => Err(fault),
        (Err(_), None, Some(why)) => Err(Error::Failed(why.clone())),
        (Err(LabError::NoTime), ..) => Err(Error::Failed(TOO_SHORT.into())),
        (Err(e), ..) => Err(e.into()),
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
