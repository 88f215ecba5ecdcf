//! Tracking and fitting in turns (Wang et al. 2015, section 5): what was tracked tells the numbers, and a better prior tracks better.
//!
//! ```text
//! track → fit of the tracked points → values into the scene → track → …
//! settled:  max_i |v_i − v_i of the round before| / standard error_i < SETTLED
//! ```
//!
//! Rounds also end where the model of the last one says more of every place than its readings do: a fit to such places would be one to itself.

use super::{TrackedBody, track_on};
use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{FitOptions, Fitted, check};
use crate::interrupt::Interrupt;
use palpate_model::scene::WarmStart;
use std::ops::ControlFlow;
use std::path::Path;

/// Standard errors that no number moves by in a round after which another one is not worth its time.
pub const SETTLED: f64 = 0.3;

/// One number after a round.
#[derive(Clone, Debug, PartialEq)]
pub struct RoundValue {
    /// Path in the scene file.
    pub path: String,
    /// Value in SI.
    pub value: f64,
    /// Its standard error, by noise alone.
    pub standard_error: Option<f64>,
}

/// A fit to what was tracked.
#[derive(Clone, Debug, PartialEq)]
pub struct Round {
    /// The numbers found.
    pub values: Vec<RoundValue>,
    /// By how many standard errors the one moved that moved most; nothing in the first round.
    pub moved: Option<f64>,
    /// How far the tracked readings lay from the body, root mean square over the frames that nobody doubts [m].
    pub rms: f64,
    /// Mean temperature of these frames [J]: how far the prior was wrong.
    pub temperature: f64,
}

/// A body tracked in rounds.
#[derive(Clone, Debug)]
pub struct Refined {
    /// The body of the last round.
    pub tracked: TrackedBody,
    /// The scene with the values found.
    pub experiment: Experiment,
    /// Its text.
    pub text: String,
    /// Every fit.
    pub rounds: Vec<Round>,
    /// True where the last round moved nothing that counts.
    pub settled: bool,
    /// Why there was nothing to fit after a round, if so.
    pub ended: Option<String>,
}

impl Refined {
    /// A body that was tracked once, in an experiment's recording.
    pub fn once(experiment: Experiment, tracked: TrackedBody) -> Refined {
        Refined { tracked, text: experiment.text().into(), experiment, rounds: Vec::new(), settled: true, ended: None }
    }
}

/// The largest move from one round to the next, in standard errors.
fn moved(before: &[RoundValue], now: &[RoundValue]) -> f64 {
    let one = |(a, b): (&RoundValue, &RoundValue)| match b.standard_error {
        Some(error) if error > 0.0 => (b.value - a.value).abs() / error,
        _ if a.value == b.value => 0.0,
        _ => f64::INFINITY,
    };
    before.iter().zip(now).map(one).fold(0.0, f64::max)
}

fn round(fitted: &Fitted, tracked: &TrackedBody, before: Option<&Round>) -> Round {
    let value = |(n, p): (&crate::fitting::FreeNumber, &palpate_fit::FittedParameter)| RoundValue {
        path: n.path.clone(),
        value: p.value,
        standard_error: p.standard_error,
    };
    let values: Vec<RoundValue> = fitted.free.iter().zip(&fitted.result.parameters).map(value).collect();
    let sound: Vec<_> = tracked.frames.iter().filter(|f| f.doubts.is_empty()).collect();
    let count = sound.len().max(1) as f64;
    Round {
        moved: before.map(|b| moved(&b.values, &values)),
        values,
        rms: (sound.iter().map(|f| f.met.rms.powi(2)).sum::<f64>() / count).sqrt(),
        temperature: sound.iter().map(|f| f.temperature).sum::<f64>() / count,
    }
}

/// Tracks and fits in turns on a backend, `most` fits at most; `hear` is told in words what is being done and may end it.
///
/// # Errors
/// As of [`track_on`] and of a fit: there must be a `[fit]` with free numbers.
pub fn refine(
    experiment: &Experiment,
    most: usize,
    backend: Backend,
    interrupt: &Interrupt,
    folder: &Path,
    mut hear: impl FnMut(&str),
) -> Result<Refined, Error> {
    check(std::slice::from_ref(experiment))?;
    let frames = experiment.plan().observation.frames.len();
    let mut look = |e: &Experiment, number: usize| {
        track_on(e, backend, |done| {
            hear(&format!("round {number}: tracking, frame {done} of {frames}"));
            if interrupt.is_raised() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })
    };
    let (mut at, mut text) = (experiment.clone(), experiment.text().to_string());
    let mut tracked = look(&at, 1)?;
    let (mut rounds, mut settled, mut ended) = (Vec::<Round>::new(), false, None);
    while rounds.len() < most && !settled && !tracked.interrupted {
        let recording = match tracked.recording(&at.scene().title, tracked.noise) {
            Ok(recording) => recording,
            Err(why) if rounds.is_empty() => return Err(why),
            Err(why) => {
                ended = Some(why.to_string());
                break;
            }
        };
        let fitted = started(&at, rounds.last()).measured(recording)?.fit(FitOptions {
            backend,
            interrupt: interrupt.clone(),
            hurried: true,
            ..FitOptions::default()
        })?;
        if fitted.interrupted {
            tracked.interrupted = true;
            break;
        }
        let done = round(&fitted, &tracked, rounds.last());
        settled = done.moved.is_some_and(|m| m < SETTLED);
        rounds.push(done);
        let values = fitted.values_of(0, experiment);
        text = palpate_io::write_scene(experiment.text(), experiment.scene(), &values, folder)?;
        at = Experiment::from_toml(&text, folder.join("scene.toml"))?;
        tracked = look(&at, rounds.len() + 1)?;
    }
    Ok(Refined { tracked, experiment: at, text, rounds, settled, ended })
}

/// The experiment with starts of the round: vibrations in the first one, what was found before in the others.
fn started(e: &Experiment, before: Option<&Round>) -> Experiment {
    e.searched(|f| {
        let Some(before) = before else {
            f.warm_start = WarmStart::Modal;
            return;
        };
        (f.warm_start, f.starts) = (WarmStart::Stated, 1);
        for v in &before.values {
            f.parameters.iter_mut().filter(|p| p.path == v.path).for_each(|p| p.start = (v.value, v.value));
        }
    })
}
