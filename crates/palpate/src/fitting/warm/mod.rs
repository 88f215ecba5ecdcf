//! Start values that are not guessed: from vibrations ([`modal`]) and from a body that was tracked.
//!
//! A recording by depth cameras has no correspondences, and a fit from far off may end anywhere. Where the scene's own values leave a frame
//! with few readings that meet the body, it is tracked first, which needs no values; what was tracked has vibrations, and a fit to it, whose
//! readings are met wherever the body is, leads to the depth readings:
//!
//! ```text
//! every frame's share of met readings ≥ NEAR:  start as stated
//! else:                                        track → vibrations → fit of the tracked points → start
//! ```

mod modal;

use super::{FitOptions, FreeNumber, fit};
use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::interrupt::Interrupt;
use crate::residuals::ResidualSummary;
use crate::tracking;
use modal::{Asked, told};
use palpate_engine::number;
use palpate_fit::FreeParameter;
use palpate_io::recording::Recording;
use palpate_model::observation::ReadingKind;
use palpate_model::params::fields::Varied;
use palpate_model::scene::WarmStart;
use std::ops::ControlFlow;

/// Share of a frame's depth readings that meet the body from which on a fit needs no tracking.
const NEAR: f64 = 0.9;

/// A number as a fit of tracked points found it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FromTracks {
    /// Value in SI.
    pub value: f64,
    /// Its standard error, by noise alone.
    pub standard_error: Option<f64>,
}

/// What a fit starts from.
#[derive(Default)]
pub(super) struct Warm {
    /// How the start values were found, in sentences.
    pub notes: Vec<String>,
    /// What a fit of tracked points found, by free number; empty where nothing was tracked.
    pub tracked: Vec<FromTracks>,
}

/// Moves the starts of free numbers.
pub(super) fn warm(
    experiments: &[Experiment],
    numbers: &[FreeNumber],
    free: &mut [FreeParameter],
    options: &mut FitOptions,
) -> Result<Warm, Error> {
    let wish = |e: &Experiment| e.scene().fit.as_ref().map_or(WarmStart::Stated, |f| f.warm_start);
    let mut all = Warm::default();
    let given = !options.tracked.is_empty();
    if given || experiments.iter().any(|e| wish(e) == WarmStart::Tracked) {
        return by_tracking(experiments, numbers, free, options);
    }
    let Some(e) = experiments.iter().find(|e| wish(e) == WarmStart::Modal) else { return Ok(all) };
    if !tells(e) {
        let text = "needs markers or tracked points, which the recording does not have or the scene's cost does not use; \
                    \"tracked\" finds them in depth images";
        return Err(e.fault("fit.warm_start", format!("= \"modal\" {text}")));
    }
    by_vibrations(experiments, numbers, free, &mut all.notes);
    Ok(all)
}

/// Whether there is anything to read vibrations off.
fn tells(e: &Experiment) -> bool {
    let o = &e.plan().observation;
    [ReadingKind::Marker, ReadingKind::Track, ReadingKind::Displacement].iter().any(|k| o.readings(*k) > 0)
}

/// Starts by the vibrations of the first experiment that shows some.
fn by_vibrations(experiments: &[Experiment], numbers: &[FreeNumber], free: &mut [FreeParameter], notes: &mut Vec<String>) {
    let mut why = String::from("nothing was tracked");
    for (s, e) in experiments.iter().enumerate().filter(|(_, e)| tells(e)) {
        let named = |path: &str| numbers.iter().position(|n| n.path == path && n.scene.is_none_or(|k| k == s));
        let modulus = named("material.youngs_modulus");
        let values: Vec<usize> = match modulus {
            Some(k) => vec![k],
            None => {
                let field = e.scene().fields.iter().position(|f| f.varied == Varied::Modulus);
                let own = |n: &FreeNumber| field.is_some_and(|f| format!("{}.", n.path).starts_with(&format!("field.{f}.")));
                (0..numbers.len()).filter(|k| own(&numbers[*k]) && numbers[*k].scene.is_none_or(|x| x == s)).collect()
            }
        };
        let dampings = ["material.mass_damping", "material.stiffness_damping"].map(named);
        let asked = Asked { stiffness: !values.is_empty(), damping: dampings.map(|d| d.is_some()) };
        if !asked.stiffness && asked.damping == [false, false] {
            why = "neither stiffness nor damping is free".into();
            continue;
        }
        match told(e, asked, modulus.is_none()) {
            Err(reason) => why = reason,
            Ok(told) => {
                notes.extend(told.notes);
                let begins = |f: &mut FreeParameter, value: f64| {
                    let value = value.clamp(f.bounds.0, f.bounds.1);
                    f.start = (value, value);
                    format!("{} {}", f.path, number(value))
                };
                let stated = e.plan();
                let mut set = Vec::new();
                for k in &values {
                    let value = stated.theta[free[*k].slots[0].place] / free[*k].slots[0].factor;
                    set.push(begins(&mut free[*k], told.stiffness * value));
                }
                for (k, value) in dampings.iter().zip(told.damping) {
                    set.extend(k.zip(value).map(|(k, v)| begins(&mut free[k], v)));
                }
                notes.push(format!("starts by vibrations: {}", set.join(", ")));
                return;
            }
        }
    }
    notes.push(format!("no start by vibrations: {why}"));
}

/// The smallest share of readings, over all frames, that meet the body with the scene's own values; zero where it cannot be simulated.
fn least_share(e: &Experiment, backend: Backend, interrupt: &Interrupt) -> f64 {
    let stop = interrupt.at_once();
    let Ok(r) = ResidualSummary::new(e, backend, &e.plan().theta, &stop) else { return 0.0 };
    let share = |points: usize, unmatched: usize| points as f64 / (points + unmatched).max(1) as f64;
    let seen = r.frames.iter().filter(|f| f.points + f.unmatched > 0);
    seen.map(|f| share(f.points, f.unmatched)).fold(1.0, f64::min)
}

/// The experiment with tracked points as its measurement, which a fit begins by their vibrations.
fn of_points(e: &Experiment, recording: Recording) -> Result<Experiment, Error> {
    e.searched(|f| f.warm_start = WarmStart::Modal).measured(recording)
}

/// Starts by a fit of what was tracked.
fn by_tracking(
    experiments: &[Experiment],
    numbers: &[FreeNumber],
    free: &mut [FreeParameter],
    options: &mut FitOptions,
) -> Result<Warm, Error> {
    let mut all = Warm::default();
    let given = std::mem::take(&mut options.tracked);
    let (backend, interrupt) = (options.backend, options.interrupt.clone());
    let mut points = Vec::new();
    for (s, e) in experiments.iter().enumerate() {
        let mut say = |text: String| {
            if let Some(told) = &mut options.on_stage {
                told(&text);
            }
        };
        let recording = match given.get(s) {
            Some(r) => r.clone(),
            None if e.plan().observation.readings(ReadingKind::Depth) == 0 => {
                // Markers and tracks are met wherever the body is.
                points.push(e.clone());
                continue;
            }
            None => {
                let share = least_share(e, backend, &interrupt);
                if share >= NEAR {
                    all.notes.push(format!(
                        "start as stated: at least {:.0} % of the readings of every frame meet the body there",
                        100.0 * share
                    ));
                    return Ok(all);
                }
                let frames = e.plan().observation.frames.len();
                let tracked = tracking::track_on(e, backend, |done| {
                    say(format!("tracking, frame {done} of {frames}"));
                    if interrupt.is_raised() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
                })?;
                if tracked.interrupted {
                    return Err(Error::Interrupted);
                }
                all.notes.push(format!(
                    "as stated only {:.0} % of a frame's readings meet the body: it was tracked in {} frames, {} of them doubted",
                    100.0 * share,
                    frames,
                    frames - tracked.sound()
                ));
                tracked.recording(&e.scene().title, tracked.noise)?
            }
        };
        points.push(of_points(e, recording)?);
    }
    if let Some(told) = &mut options.on_stage {
        told("fitting what was tracked");
    }
    let found = fit(
        &points,
        FitOptions {
            backend: options.backend,
            optimizer: options.optimizer,
            iterations: options.iterations,
            seed: options.seed,
            threads: options.threads,
            interrupt: options.interrupt.clone(),
            hurried: true,
            ..FitOptions::default()
        },
    )?;
    all.notes.extend(found.notes.iter().cloned());
    for (i, n) in found.free.iter().enumerate() {
        let p = &found.result.parameters[i];
        all.tracked.push(FromTracks { value: p.value, standard_error: p.standard_error });
        let Some(k) = numbers.iter().position(|m| m == n) else { continue };
        let value = p.value.clamp(free[k].bounds.0, free[k].bounds.1);
        free[k].start = (value, value);
    }
    let text = |(n, p): (&FreeNumber, &palpate_fit::FittedParameter)| format!("{} {}", n.label(), number(p.value));
    let values: Vec<String> = found.free.iter().zip(&found.result.parameters).map(text).collect();
    all.notes.push(format!("starts by a fit of tracked points: {}", values.join(", ")));
    Ok(all)
}
