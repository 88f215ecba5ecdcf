//! Motions that are made: forces of free handles that lead a body through keyframes, and close loops.
//!
//! Space-time constraints (Witkin & Kass, *Spacetime Constraints*, SIGGRAPH 1988): minimise ½ Σ |s(t_k) − s*_k|²/σ_k² + ½ Σ |f|²/q² over the
//! coefficients f of cubic B-splines, one spline for each component of each handle's force. A spline of forces is a row of the effect
//! "impulse", so that the coefficients are numbers of the scene like any others: exact derivatives, optimisers and priors are those of
//! [`crate::fit`], and the motion found is a scene that `palpate simulate` repeats.

use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{FitOptions, Fitted, fit};
use crate::interrupt::Interrupt;
use crate::residuals::spread;
use glam::DVec3;
use palpate_engine::Misfit;
use palpate_fit::Progress;
use palpate_model::effects::{Effect, find, impulse};
use palpate_model::observation::target::Target;
use palpate_model::observation::{Channel, Frame, Observation, ObservedDisplacement, ReadingKind};
use palpate_model::scene::{FitParameter, FitSpec, Scene, WarmStart};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// Nodes at which the ends of a loop are compared: more would only weigh more.
const COMPARED: usize = 64;

/// A scene with free handles whose forces are sought.
pub(crate) struct Search {
    /// The scene with every control as an effect, compared with its wishes.
    pub(crate) experiment: Experiment,
    /// Number of the first control's effect.
    first: usize,
    /// Numbers of the free handles.
    handles: Vec<usize>,
    knots: usize,
    /// Time between knots [s].
    spacing: f64,
    /// Time that velocities are multiplied by where a loop closes [s].
    drift: f64,
}

/// What was found.
pub(crate) struct Led {
    /// Coefficients of every free handle's force `[H][K]` [N].
    pub(crate) forces: Vec<Vec<DVec3>>,
    /// How keyframes are met, by time.
    pub(crate) met: Vec<Met>,
    /// How the loop closes: largest distance [m] and difference of velocities [m/s].
    pub(crate) closed: Option<[f64; 2]>,
    /// The search.
    pub(crate) fitted: Fitted,
}

/// How a keyframe is met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Met {
    /// When [s].
    pub(crate) time: f64,
    /// Points.
    pub(crate) points: usize,
    /// Root mean square distance [m].
    pub(crate) rms: f64,
    /// Largest distance [m].
    pub(crate) worst: f64,
}

impl Search {
    /// Prepares the search for an experiment's wishes; `None` where it has none.
    ///
    /// # Errors
    /// More knots than steps, a start that cannot be computed, points off the body.
    pub(crate) fn new(base: &Experiment, backend: Backend) -> Result<Option<Search>, Error> {
        let wishes = &base.scene().synthesis;
        let handles: Vec<usize> = (0..wishes.handles.len()).filter(|h| wishes.handles[*h].follows.is_none()).collect();
        if handles.is_empty() {
            return Ok(None);
        }
        let clock = &base.plan().clock;
        let length = clock.step * clock.steps as f64;
        let spacing = length / (wishes.knots - 3) as f64;
        if spacing < clock.step * (1.0 - 1e-9) {
            let message = format!(
                "{} knots are {spacing:.3e} s apart, less than a step of {:.3e} s: give at most {}",
                wishes.knots,
                clock.step,
                clock.steps + 3
            );
            return Err(base.fault("synthesize.knots", message));
        }
        let mut search =
            Search { experiment: base.clone(), first: 0, handles, knots: wishes.knots, spacing, drift: length / TAU };
        let mut scene = base.scene().clone();
        search.first = scene.effects.len();
        scene.effects.extend(search.controls(base.scene(), |_, _| DVec3::ZERO));
        scene.fit = Some(search.sought(base.scene()));
        let observation = search.wishes(base, backend)?;
        search.experiment = base.compared(scene, observation)?;
        Ok(Some(search))
    }

    /// Time at which the spline of knot k begins [s].
    fn begin(&self, scene: &Scene, knot: usize) -> f64 {
        scene.time.start + (knot as f64 - 3.0) * self.spacing
    }

    /// The controls as effects, handle by handle; `force` of (free handle, knot) [N].
    fn controls(&self, scene: &Scene, force: impl Fn(usize, usize) -> DVec3) -> Vec<Effect> {
        let law = find(impulse::KIND).expect("the law is in the table");
        let one = |h: usize, knot: usize| {
            let handle = &scene.synthesis.handles[self.handles[h]];
            let (p, x) = (force(h, knot) * self.spacing, handle.point);
            let values = [p.x, p.y, p.z, x.x, x.y, x.z, handle.radius, self.begin(scene, knot), 4.0 * self.spacing];
            Effect { values: values.map(Some).to_vec(), ..Effect::absent(law) }
        };
        (0..self.handles.len()).flat_map(|h| (0..self.knots).map(move |k| (h, k))).map(|(h, k)| one(h, k)).collect()
    }

    /// What is free: the momentum of every control, which is known to be as small as the scene's force.
    fn sought(&self, scene: &Scene) -> FitSpec {
        let sd = scene.synthesis.force.unwrap_or(f64::INFINITY) * self.spacing;
        let one = |effect: usize, axis: &str| FitParameter {
            path: format!("effect.{effect}.momentum.{axis}"),
            start: (0.0, 0.0),
            bounds: (f64::NEG_INFINITY, f64::INFINITY),
            known: Some((0.0, sd)),
            per_scene: false,
        };
        let all = self.first..self.first + self.handles.len() * self.knots;
        FitSpec {
            optimizer: None,
            iterations: scene.synthesis.iterations,
            starts: 1,
            seed: 1,
            threads: 0,
            warm_start: WarmStart::Stated,
            frames: None,
            parameters: all.flat_map(|e| ["x", "y", "z"].map(|axis| one(e, axis))).collect(),
        }
    }

    /// Keyframes as tracked points, and the end of a loop as displacements and velocities of nodes.
    fn wishes(&self, base: &Experiment, backend: Backend) -> Result<Observation, Error> {
        let wishes = &base.scene().synthesis;
        let targets: Vec<Target> = (wishes.keyframes.iter())
            .map(|k| Target { points: k.points.clone(), positions: k.positions.clone(), time: k.time, tolerance: k.sigma })
            .collect();
        let mut o = Observation::of_targets(&targets);
        if !wishes.closed {
            return Ok(o);
        }
        let plan = base.plan();
        let mut first = None;
        backend.visit(plan, &plan.theta, |_, state, _| {
            first = Some(state);
            ControlFlow::Break(())
        })?;
        let first = first.ok_or_else(|| Error::Failed("the start was not computed".into()))?;
        let smallest = wishes.keyframes.iter().map(|k| k.sigma).fold(f64::INFINITY, f64::min);
        o.channels.push(Channel::new(ReadingKind::Displacement, wishes.gap.unwrap_or(smallest)));
        let nodes = spread(&(0..plan.body.nodes.len()).collect::<Vec<_>>(), COMPARED);
        let of = |values: &[DVec3], scale: f64| {
            nodes.iter().map(|n| ObservedDisplacement { node: *n as u32, value: values[*n] * scale }).collect()
        };
        let time = base.end_time();
        o.frames.push(Frame { time, displacements: of(&first.displacement, 1.0), ..Frame::default() });
        let displacements = of(&first.velocity, self.drift);
        o.frames.push(Frame { time, displacements, drift: Some(self.drift), ..Frame::default() });
        Ok(o)
    }

    /// Finds the forces.
    ///
    /// # Errors
    /// The motion without forces cannot be computed, or the motion found.
    pub(crate) fn run(
        &self,
        backend: Backend,
        interrupt: &Interrupt,
        hear: &mut (dyn FnMut(&Progress) + Send),
    ) -> Result<Led, Error> {
        let options = FitOptions { backend, interrupt: interrupt.clone(), on_iteration: Some(hear), ..FitOptions::default() };
        let fitted = fit(std::slice::from_ref(&self.experiment), options)?;
        let plan = self.experiment.plan();
        let theta = &fitted.result.theta[0];
        let force = |h: usize, knot: usize| {
            let effect = self.first + h * self.knots + knot;
            let at = |slot| theta[plan.layout.index(plan.layout.effect_key(effect, slot))];
            DVec3::new(at(0), at(1), at(2)) / self.spacing
        };
        let forces = (0..self.handles.len()).map(|h| (0..self.knots).map(|k| force(h, k)).collect()).collect();
        let (mut met, mut ends) = (Vec::new(), [f64::NAN; 2]);
        backend.visit(plan, theta, |_, _, residuals| {
            for r in &residuals {
                let frame = &plan.observation.frames[r.frame];
                let off: Vec<f64> = (r.readings.iter())
                    .filter_map(|r| if let Some(Misfit::Offset(v)) = r.misfit { Some(v.length()) } else { None })
                    .collect();
                let worst = off.iter().copied().fold(0.0, f64::max);
                if !frame.markers.is_empty() {
                    let rms = (off.iter().map(|d| d * d).sum::<f64>() / off.len() as f64).sqrt();
                    met.push(Met { time: frame.time, points: off.len(), rms, worst });
                } else if let Some(drift) = frame.drift {
                    ends[1] = worst / drift;
                } else {
                    ends[0] = worst;
                }
            }
            ControlFlow::Continue(())
        })?;
        let closed = self.experiment.scene().synthesis.closed.then_some(ends);
        Ok(Led { forces, met, closed, fitted })
    }

    /// The controls found as effects of a scene.
    pub(crate) fn effects(&self, led: &Led) -> Vec<Effect> {
        self.controls(self.experiment.scene(), |h, k| led.forces[h][k])
    }

    /// The course of the forces as CSV: at every step time and the three components of each free handle, named by its number in the scene.
    pub(crate) fn csv(&self, led: &Led) -> String {
        let (scene, clock) = (self.experiment.scene(), &self.experiment.plan().clock);
        let names: Vec<String> =
            (self.handles.iter()).flat_map(|h| ["x", "y", "z"].map(|axis| format!("handle{h}_{axis}"))).collect();
        let mut text = format!("time,{}\n", names.join(","));
        for k in 0..=clock.steps {
            let time = scene.time.start + k as f64 * clock.step;
            text += &time.to_string();
            for forces in &led.forces {
                let knots = |j: usize| (time - self.begin(scene, j)) / self.spacing;
                let f: DVec3 = forces.iter().enumerate().map(|(j, f)| *f * impulse::spline(knots(j).clamp(0.0, 4.0))).sum();
                f.to_array().iter().for_each(|x| text += &format!(",{x}"));
            }
            text.push('\n');
        }
        text
    }
}

#[cfg(test)]
#[path = "synthesis_tests.rs"]
mod tests;
