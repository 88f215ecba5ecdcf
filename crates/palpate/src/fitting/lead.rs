//! Starts that see nothing: readings lie beyond the band around the body, and what is free changes none of those that lie within.
//!
//! A band four times as wide is tried, and one sixteen times, on coarser cells where it would be too many of them; from where something is
//! seen a fit goes, and its end is where one with half the band begins, down to the scene's own.

use super::free_parameters;
use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::interrupt::Interrupt;
use palpate_fit::{FitScene, FreeParameter, Hooks, Problem, Settings, fit};
use palpate_model::scene::{ObservationSpec, Resolution};

/// Factor of the band while nothing is seen, and how often it is tried.
const WIDER: f64 = 4.0;
const TRIES: i32 = 2;
/// Widest band in cells: beyond, cells grow up to twofold, for the work grows with its cube.
const MOST: f64 = 32.0;

/// Who leads.
pub(super) struct Guide<'a> {
    pub experiments: &'a [Experiment],
    pub free: &'a [FreeParameter],
    pub backend: Backend,
    pub settings: &'a Settings,
    pub interrupt: &'a Interrupt,
    /// What was done, in sentences.
    pub notes: Vec<String>,
}

impl Guide<'_> {
    /// Where each of these starts sees something, if anywhere.
    pub fn lead(&mut self, starts: &[Vec<f64>]) -> Vec<Option<Vec<f64>>> {
        let led: Vec<Option<(Vec<f64>, f64)>> = starts.iter().map(|s| self.one(s)).collect();
        let widest = led.iter().flatten().map(|l| l.1).fold(0.0, f64::max);
        let (found, all) = (led.iter().flatten().count(), starts.len());
        let starts = |n: usize| if n == 1 { "1 start".to_string() } else { format!("{n} starts") };
        if found > 0 {
            self.notes.push(format!(
                "{} saw nothing of the recording within the band: led there by bands up to {widest:.0} times as wide, then narrower again",
                starts(found)
            ));
        }
        if found < all {
            self.notes.push(format!(
                "{} saw nothing of the recording, in wider bands neither: readings met nothing, or what is free changes none of those that did",
                starts(all - found)
            ));
        }
        led.into_iter().map(|l| l.map(|l| l.0)).collect()
    }

    /// The end of the way of one start, and the widest band on it over the scene's.
    fn one(&self, start: &[f64]) -> Option<(Vec<f64>, f64)> {
        // A start says one value of a field for all its places, so that a fit cannot go on from others.
        if self.free.iter().any(|f| f.count > 1) {
            return None;
        }
        let sees = |k: &i32| self.problem(WIDER.powi(*k), start).is_ok_and(|mut p| p.sees(start, self.settings.optimizer));
        let widest = WIDER.powi((1..=TRIES).take_while(|_| !self.interrupt.is_urgent()).find(sees)?);
        let (mut values, mut width) = (start.to_vec(), widest);
        while width > 1.0 && !self.interrupt.is_urgent() {
            let mut problem = self.problem(width, &values).ok()?;
            let hooks = Hooks { interrupt: self.interrupt.in_turn(), ..Hooks::default() };
            let settings = Settings { starts: 1, ..self.settings.clone() };
            let found = fit(&mut problem, &settings, hooks).ok()?;
            values = found.parameters.iter().map(|p| p.value).collect();
            width *= 0.5;
        }
        Some((values, widest))
    }

    /// The problem with a wider band, which starts at these values.
    fn problem(&self, wider: f64, values: &[f64]) -> Result<Problem<'static>, Error> {
        let mut scenes = Vec::new();
        let wide = self.experiments.iter().map(|e| widened(e, wider)).collect::<Result<Vec<_>, _>>()?;
        // Masses are densities of a volume that the cells round.
        let (_, free, _) = free_parameters(&wide)?;
        for e in &wide {
            scenes.push(FitScene {
                name: e.scene().path.display().to_string(),
                fingerprint: String::new(),
                base: e.plan().theta.clone(),
                evaluate: self.backend.evaluator_until(e.plan(), 1, self.interrupt.at_once())?,
            });
        }
        let at = |(f, v): (&FreeParameter, &f64)| FreeParameter { start: (*v, *v), ..f.clone() };
        Problem::new(scenes, free.iter().zip(values).map(at).collect()).map_err(Error::Failed)
    }
}

/// An experiment with a wider band.
fn widened(e: &Experiment, wider: f64) -> Result<Experiment, Error> {
    let Some(o) = &e.scene().observation else { return Ok(e.clone()) };
    // A body of own elements has no cells that could grow.
    let finer = if e.scene().object.resolution == Resolution::Own { 1.0 } else { (MOST / (o.band * wider)).clamp(0.5, 1.0) };
    e.with_finer_grid(finer, 1.0, Some(ObservationSpec { band: o.band * wider * finer, ..o.clone() }))
}
