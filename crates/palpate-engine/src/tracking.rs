//! Tracking: the body at every frame of a recording, without knowing what moved it (Wang et al. 2015, section 4).
//!
//! A frame's displacement u is the one of largest posterior probability. With the potential V of a prior [J], the temperature η [J] and the cost D
//! of the readings, it is the least of
//!
//! `Φ(u) = V(u)/η + D(u)`.
//!
//! The prior is a step of backward Euler from the frame before, or the equilibrium under the loads. η says how far the prior may be wrong: η is
//! that of the largest evidence, `η = 2 ΔV/γ` for γ well-determined directions (MacKay, *Neural Computation* 4, 1992).
//!
//! Far from the readings D is that of a mixture: every reading belongs to all visible parts of the surface within a reach that shrinks. Near them
//! D is the cost that a fit has, in a band that shrinks.

use crate::failure::{Failure, FailureKind};
use glam::DVec3;
use std::ops::ControlFlow;

/// Displacements and velocities of all nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// Displacement [m] `[N]`.
    pub displacement: Vec<DVec3>,
    /// Velocity [m/s] `[N]`.
    pub velocity: Vec<DVec3>,
}

/// What holds a body together while readings draw it.
#[derive(Clone, Copy, Debug)]
pub enum Prior<'a> {
    /// Elasticity and loads alone: the equilibrium.
    Equilibrium,
    /// A step of backward Euler from a pose, of so many seconds.
    Step(&'a Pose, f64),
    /// The same body with the same inertia, but at the pose itself: whatever acts there is balanced by something unknown.
    Held(&'a Pose, f64),
}

/// What draws it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pull {
    /// Depth points belong to visible places of the surface by a Gaussian of this standard deviation [m], or by a share of outliers to none.
    Mixture {
        /// Standard deviation [m].
        spread: f64,
        /// Share of points that belong to nothing, 0 to 1.
        outliers: f64,
    },
    /// The cost of a fit, in a band of this half width [m].
    Surface {
        /// Half width [m].
        band: f64,
    },
}

/// The problem of one frame.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// Number of the frame in the plan's recording.
    pub frame: usize,
    /// What holds the body.
    pub prior: Prior<'a>,
    /// η [J].
    pub temperature: f64,
}

/// How well readings are met.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Met {
    /// Scalar residuals of the frame.
    pub readings: usize,
    /// Those that met the body.
    pub matched: usize,
    /// Root mean square of these [m].
    pub rms: f64,
    /// D(u).
    pub cost: f64,
}

impl Met {
    /// Share of the readings that met the body; one without any.
    pub fn share(&self) -> f64 {
        if self.readings == 0 { 1.0 } else { self.matched as f64 / self.readings as f64 }
    }
}

/// What is known of a pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Certainty {
    /// Draws of the posterior, less its mean [m] `[S, N]`; empty where the body is too large for a factor.
    pub posterior: Vec<Vec<DVec3>>,
    /// The same of the prior.
    pub prior: Vec<Vec<DVec3>>,
    /// γ: the number of directions that the readings determine.
    pub determined: f64,
    /// ΔV: potential of the prior above its least value [J], to second order.
    pub excess: f64,
    /// Potential of elasticity, loads and contact [J].
    pub energy: f64,
}

/// A backend that moves a body to readings.
pub trait Follow {
    /// The pose at the start.
    ///
    /// # Errors
    /// There is none.
    fn start(&mut self) -> Result<Pose, Failure>;
    /// One step of Gauss–Newton's method with a line search on Φ; returns by how much its model says that Φ falls.
    ///
    /// # Errors
    /// A solve fails.
    fn approach(&mut self, problem: &Problem, pull: Pull, u: &mut Vec<DVec3>) -> Result<f64, Failure>;
    /// How well the frame's readings are met at u, in a band of this half width [m].
    fn look(&mut self, frame: usize, u: &[DVec3], band: f64) -> Met;
    /// Draws of the posterior at u from standard normal draws `[S, N]`.
    ///
    /// # Errors
    /// A solve fails.
    fn certainty(&mut self, problem: &Problem, band: f64, u: &[DVec3], draws: &[Vec<DVec3>]) -> Result<Certainty, Failure>;
    /// Share of the frame's rays that pass through the body at u, and so prove that it is not there, over all rays that meet it.
    fn pierced(&mut self, frame: usize, u: &[DVec3]) -> f64;
    /// Which patches of the surface have a reading on their line of sight `[patches]`.
    fn seen(&mut self, frame: usize, u: &[DVec3]) -> Vec<bool>;
}

/// Choices of a tracker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// The prior is a step from the frame before; else the equilibrium.
    pub dynamic: bool,
    /// η [J]; `None` = that of the largest evidence.
    pub temperature: Option<f64>,
    /// Share of points that belong to nothing.
    pub outliers: f64,
    /// Spread at which the first phase begins [m]; `None` = by how far the readings are away.
    pub spread: Option<f64>,
    /// Half width of the band at its widest [m]: that of the plan.
    pub widest: f64,
    /// Distance between neighbouring places of the surface [m].
    pub spacing: f64,
    /// Noise of a reading [m].
    pub noise: f64,
    /// Size of the body [m].
    pub size: f64,
}

/// Factor of the reach from one round to the next.
const SHRINK: f64 = 0.85;
/// Factor of the band; its matches are exact, so that it may shrink faster.
const NARROW: f64 = 0.7;
/// Share of matched readings from which on a guess needs no mixture.
const NEAR: f64 = 0.95;
/// Half width of the last band over the noise: Tukey's biweight then keeps 95 % of the efficiency under Gaussian noise.
const BAND: f64 = 4.685;
/// The last band is no narrower than this over the spacing: a coarse body is never where its readings are to their noise.
const COARSE: f64 = 0.25;
/// A pose is found when a step promises to lower Φ, which is a logarithm of a probability, by less.
const SETTLED: f64 = 0.1;
/// Most steps in the last band.
const STEPS: usize = 20;
/// Standard deviation of the body under the first temperature, over the noise of a reading. What is too cold says so by its residuals and is heated;
/// what is too hot crumples, and has many minima.
const LOOSE: f64 = 1.0;
/// What a frame's temperature counts for the next: half after three frames.
const MEMORY: f64 = 0.8;
/// A frame whose own temperature is this many times higher is solved again with it.
const HOTTER: f64 = 2.0;
/// Times that this may happen.
const REHEATS: usize = 4;

/// What is wrong with a tracked frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Doubt {
    /// Share of matched readings, against the median of the sequence.
    Unmatched(f64),
    /// Root mean square of the matched readings [m].
    Far(f64),
    /// Share of rays that pass through the body.
    Pierced(f64),
    /// Elastic energy over that of the frame before.
    Jumped(f64),
    /// No reading at all: the prior's own.
    Unseen,
}

/// A tracked frame.
#[derive(Clone, Debug)]
pub struct Tracked {
    /// Number of the frame in the recording.
    pub frame: usize,
    /// Time on the recording's clock [s].
    pub time: f64,
    /// The pose.
    pub pose: Pose,
    /// How well the readings are met.
    pub met: Met,
    /// What is known of it.
    pub certainty: Certainty,
    /// Which patches of the surface have a reading on their line of sight.
    pub seen: Vec<bool>,
    /// Temperature that it was found at [J].
    pub temperature: f64,
    /// Steps of Gauss–Newton's method.
    pub steps: usize,
    /// True where the first phase was needed.
    pub cold: bool,
    /// What is wrong.
    pub doubts: Vec<Doubt>,
}

/// The temperature as frames teach it.
#[derive(Clone, Copy, Debug, Default)]
struct Temperature {
    excess: f64,
    determined: f64,
}

impl Temperature {
    fn learn(&mut self, c: &Certainty) {
        self.excess = MEMORY * self.excess + c.excess;
        self.determined = MEMORY * self.determined + c.determined;
    }

    fn now(&self) -> Option<f64> {
        (self.determined > 0.0).then(|| 2.0 * self.excess / self.determined)
    }
}

/// Least temperature over the first guess: a frame at rest says little of the motion that follows.
const COLDEST: f64 = 1e-4;

/// Tracks the frames, by rising time, and hands each to `visit`; ends when that breaks. `draws` are standard normal `[S, N]`. A frame that is
/// lost is looked for once more without correspondences, from the last frame that was not.
///
/// # Errors
/// The start or a solve fails.
pub fn track(
    body: &mut dyn Follow,
    settings: &Settings,
    frames: &[(usize, f64)],
    start: f64,
    draws: &[Vec<DVec3>],
    mut visit: impl FnMut(Tracked) -> ControlFlow<()>,
) -> Result<(), Failure> {
    let pose = body.start()?;
    let mut course = Course {
        settings,
        draws,
        usual: usual(frames),
        pose,
        now: start,
        energy: None,
        first: None,
        learnt: Temperature::default(),
    };
    for &(frame, time) in frames {
        let mut found = course.find(body, frame, time, false)?;
        if found.is_lost() && !found.cold {
            let again = course.find(body, frame, time, true)?;
            if (again.doubts.len(), again.met.cost) < (found.doubts.len(), found.met.cost) {
                found = again;
            }
        }
        course.learn(&found);
        if visit(found).is_break() {
            break;
        }
    }
    Ok(())
}

impl Tracked {
    /// True where the body is not where it was found.
    fn is_lost(&self) -> bool {
        self.doubts.iter().any(|d| matches!(d, Doubt::Far(_) | Doubt::Pierced(_) | Doubt::Jumped(_)))
    }
}

/// Where the body is on its way through the frames.
struct Course<'a> {
    settings: &'a Settings,
    draws: &'a [Vec<DVec3>],
    /// Mean time between frames [s].
    usual: f64,
    /// Of the last frame that was met.
    pose: Pose,
    /// Its time [s].
    now: f64,
    /// Its elastic energy [J].
    energy: Option<f64>,
    /// The first guess of the temperature [J].
    first: Option<f64>,
    learnt: Temperature,
}

impl Course<'_> {
    /// Finds the body in a frame; `afresh` without trusting any correspondence.
    fn find(&mut self, body: &mut dyn Follow, frame: usize, time: f64, afresh: bool) -> Result<Tracked, Failure> {
        let (settings, draws, passed) = (self.settings, self.draws, time - self.now);
        let prior = match settings.dynamic {
            false => Prior::Equilibrium,
            true if passed > 0.0 => Prior::Step(&self.pose, passed),
            true => Prior::Held(&self.pose, self.usual),
        };
        let mut u = guess(body, settings, &self.pose, frame, passed);
        let first = match settings.temperature.or(self.first) {
            Some(t) => t,
            None => *self.first.insert(loose(body, settings, Problem { frame, prior, temperature: 1.0 }, &u, draws)?),
        };
        let coldest = |t: f64| t.max(COLDEST * first);
        let own = settings.temperature.or_else(|| self.learnt.now().map(coldest));
        let mut problem = Problem { frame, prior, temperature: own.unwrap_or(first) };
        let (mut steps, cold) = settle(body, settings, &problem, afresh, &mut u)?;
        let band = last_band(settings);
        let mut certainty = body.certainty(&problem, band, &u, draws)?;
        for _ in 0..REHEATS {
            let Some(wanted) = own_temperature(&certainty).map(coldest).filter(|_| settings.temperature.is_none()) else { break };
            let cools = own.is_none() && wanted * HOTTER < problem.temperature;
            if wanted < HOTTER * problem.temperature && !cools {
                break;
            }
            problem.temperature = wanted;
            steps += surface(body, settings, &problem, &mut u)?;
            certainty = body.certainty(&problem, band, &u, draws)?;
        }
        let met = body.look(frame, &u, band);
        let velocity = match passed > 0.0 {
            true => u.iter().zip(&self.pose.displacement).map(|(new, old)| (*new - *old) / passed).collect(),
            false => self.pose.velocity.clone(),
        };
        Ok(Tracked {
            frame,
            time,
            met,
            seen: body.seen(frame, &u),
            doubts: doubts(body, settings, frame, &u, &met, (&certainty, problem.temperature, self.energy)),
            temperature: problem.temperature,
            steps,
            cold,
            pose: Pose { displacement: u, velocity },
            certainty,
        })
    }

    /// Goes on from a frame, unless nothing was seen in it or the body was lost.
    fn learn(&mut self, found: &Tracked) {
        if found.met.readings == 0 || found.is_lost() {
            return;
        }
        self.learnt.learn(&found.certainty);
        self.pose = found.pose.clone();
        self.now = found.time;
        self.energy = Some(found.certainty.energy);
    }
}

/// Mean time between frames [s]; of one frame that of usual cameras.
fn usual(frames: &[(usize, f64)]) -> f64 {
    match (frames.first(), frames.last()) {
        (Some(first), Some(last)) if last.1 > first.1 => (last.1 - first.1) / (frames.len() - 1) as f64,
        _ => 1.0 / 30.0,
    }
}

/// Where the frame before leads, or that frame where it meets the readings better.
fn guess(body: &mut dyn Follow, settings: &Settings, pose: &Pose, frame: usize, passed: f64) -> Vec<DVec3> {
    let stays = pose.displacement.clone();
    if passed <= 0.0 {
        return stays;
    }
    let goes: Vec<DVec3> = stays.iter().zip(&pose.velocity).map(|(u, v)| *u + passed * *v).collect();
    let cost = |u: &[DVec3], body: &mut dyn Follow| body.look(frame, u, settings.widest).cost;
    if cost(&goes, body) < cost(&stays, body) { goes } else { stays }
}

/// The first temperature: the prior's own uncertainty is then that of a reading.
fn loose(body: &mut dyn Follow, settings: &Settings, unit: Problem, u: &[DVec3], draws: &[Vec<DVec3>]) -> Result<f64, Failure> {
    let certainty = body.certainty(&unit, last_band(settings), u, draws)?;
    let (mut sum, mut count) = (0.0, 0usize);
    for v in certainty.prior.iter().flatten() {
        sum += v.length_squared();
        count += 1;
    }
    if count == 0 || sum <= 0.0 {
        let detail = "the body is too large for the temperature to be found; state track.temperature";
        return Err(Failure::new(FailureKind::Unsupported, 0.0, detail));
    }
    Ok((LOOSE * settings.noise).powi(2) * (3 * count) as f64 / sum)
}

fn own_temperature(c: &Certainty) -> Option<f64> {
    (c.determined > 0.0).then(|| 2.0 * c.excess / c.determined)
}

fn last_band(settings: &Settings) -> f64 {
    (BAND * settings.noise).max(COARSE * settings.spacing).min(settings.widest)
}

/// Both phases; the steps they took, and whether the first was needed.
fn settle(
    body: &mut dyn Follow,
    settings: &Settings,
    problem: &Problem,
    afresh: bool,
    u: &mut Vec<DVec3>,
) -> Result<(usize, bool), Failure> {
    let met = body.look(problem.frame, u, settings.widest);
    let cold = met.readings > 0 && (afresh || met.share() < NEAR - settings.outliers);
    let mut steps = 0;
    if cold {
        // As wide as the body at most: beyond, every place draws alike.
        let mut spread = settings.spread.unwrap_or(0.5 * settings.size).max(4.0 * settings.spacing);
        let finest = (0.25 * settings.spacing).max(settings.noise);
        while spread > finest {
            body.approach(problem, Pull::Mixture { spread, outliers: settings.outliers }, u)?;
            spread *= SHRINK;
            steps += 1;
        }
    }
    Ok((steps + surface(body, settings, problem, u)?, cold))
}

/// The second phase; the steps it took.
fn surface(body: &mut dyn Follow, settings: &Settings, problem: &Problem, u: &mut Vec<DVec3>) -> Result<usize, Failure> {
    let (last, mut steps) = (last_band(settings), 0);
    let met = body.look(problem.frame, u, settings.widest);
    // What a band of several standard deviations of the present distances leaves out is no reading of this place.
    let mut band = (3.0 * met.rms).clamp(last, settings.widest);
    if met.share() < NEAR {
        band = settings.widest;
    }
    while band > last {
        body.approach(problem, Pull::Surface { band }, u)?;
        band *= NARROW;
        steps += 1;
    }
    for _ in 0..STEPS {
        steps += 1;
        if body.approach(problem, Pull::Surface { band: last }, u)? < SETTLED {
            break;
        }
    }
    Ok(steps)
}

/// Distance of matched readings over their noise from which on a frame is doubted.
const FAR: f64 = 3.0;
/// Share of rays through the body beside that of outliers, likewise.
const PIERCED: f64 = 0.02;
/// Rise of the elastic energy from one frame to the next, likewise.
const JUMP: f64 = 5.0;

fn doubts(
    body: &mut dyn Follow,
    settings: &Settings,
    frame: usize,
    u: &[DVec3],
    met: &Met,
    (certainty, temperature, before): (&Certainty, f64, Option<f64>),
) -> Vec<Doubt> {
    if met.readings == 0 {
        return vec![Doubt::Unseen];
    }
    let mut doubts = Vec::new();
    if met.rms > FAR * settings.noise.max(0.1 * settings.spacing) {
        doubts.push(Doubt::Far(met.rms));
    }
    let pierced = body.pierced(frame, u);
    if pierced > PIERCED + settings.outliers {
        doubts.push(Doubt::Pierced(pierced));
    }
    if let Some(before) = before
        && before > 0.0
        && certainty.energy > JUMP * before
        // What the readings' noise alone puts into the body is no jump.
        && certainty.energy > JUMP * temperature * certainty.determined
    {
        doubts.push(Doubt::Jumped(certainty.energy / before));
    }
    doubts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point on a spring: readings draw it from its place, and the mixture reaches farther than the surface.
    struct Point {
        readings: Vec<Option<f64>>,
        asked: Vec<(usize, Pull)>,
        pierced: Vec<f64>,
    }

    const STIFFNESS: f64 = 1.0;
    const REACH: f64 = 0.3;

    impl Follow for Point {
        fn start(&mut self) -> Result<Pose, Failure> {
            Ok(Pose { displacement: vec![DVec3::ZERO], velocity: vec![DVec3::ZERO] })
        }

        fn approach(&mut self, problem: &Problem, pull: Pull, u: &mut Vec<DVec3>) -> Result<f64, Failure> {
            self.asked.push((problem.frame, pull));
            let from = match problem.prior {
                Prior::Step(pose, _) | Prior::Held(pose, _) => pose.displacement[0].x,
                Prior::Equilibrium => 0.0,
            };
            let near = |goal: f64| match pull {
                Pull::Mixture { .. } => true,
                Pull::Surface { band } => (goal - u[0].x).abs() < band.min(REACH),
            };
            let goal = self.readings[problem.frame].filter(|g| near(*g));
            let weight = problem.temperature * 1e4;
            let best = goal.map_or(from, |g| (STIFFNESS * from + weight * g) / (STIFFNESS + weight));
            let fall = 0.5 * (best - u[0].x).powi(2) * 1e4;
            u[0].x = best;
            Ok(fall)
        }

        fn look(&mut self, frame: usize, u: &[DVec3], band: f64) -> Met {
            let Some(goal) = self.readings[frame] else { return Met::default() };
            let away = (goal - u[0].x).abs();
            let matched = usize::from(away < band.min(REACH));
            Met { readings: 1, matched, rms: away * matched as f64, cost: 0.5e4 * away.min(band).powi(2) }
        }

        fn certainty(&mut self, p: &Problem, _: f64, _: &[DVec3], _: &[Vec<DVec3>]) -> Result<Certainty, Failure> {
            let prior = vec![vec![DVec3::splat((p.temperature / STIFFNESS).sqrt())]];
            Ok(Certainty { posterior: prior.clone(), prior, determined: 1.0, excess: 0.5 * p.temperature, energy: 0.0 })
        }

        fn pierced(&mut self, frame: usize, _: &[DVec3]) -> f64 {
            let cold = self.asked.iter().any(|(f, pull)| *f == frame && matches!(pull, Pull::Mixture { .. }));
            if cold { 0.0 } else { self.pierced[frame] }
        }

        fn seen(&mut self, frame: usize, _: &[DVec3]) -> Vec<bool> {
            vec![self.readings[frame].is_some()]
        }
    }

    fn followed(mut body: Point) -> (Vec<Tracked>, Vec<(usize, Pull)>) {
        let settings = Settings {
            dynamic: true,
            temperature: None,
            outliers: 0.0,
            spread: None,
            widest: 0.1,
            spacing: 0.01,
            noise: 0.01,
            size: 1.0,
        };
        let frames: Vec<(usize, f64)> = (0..body.readings.len()).map(|k| (k, 0.1 * k as f64)).collect();
        let mut all = Vec::new();
        let visit = |t: Tracked| {
            all.push(t);
            ControlFlow::Continue(())
        };
        track(&mut body, &settings, &frames, 0.0, &[vec![DVec3::ONE]], visit).unwrap();
        (all, body.asked)
    }

    fn mixtures(asked: &[(usize, Pull)], frame: usize) -> usize {
        asked.iter().filter(|(f, pull)| *f == frame && matches!(pull, Pull::Mixture { .. })).count()
    }

    #[test]
    fn near_frames_need_no_mixture_and_far_ones_do() {
        let readings = vec![Some(0.0), Some(0.02), Some(0.8)];
        let (all, asked) = followed(Point { pierced: vec![0.0; 3], readings, asked: Vec::new() });
        assert_eq!([0, 1, 2].map(|f| mixtures(&asked, f) > 0), [false, false, true]);
        assert_eq!(all.iter().map(|t| t.cold).collect::<Vec<_>>(), [false, false, true]);
        // What draws has the weight 1e4 of a noise of 1 cm.
        assert!((all[1].pose.displacement[0].x - 0.02).abs() < 0.011, "{:?}", all[1].pose);
        assert!(
            (all[1].pose.velocity[0].x - all[1].pose.displacement[0].x / 0.1 + all[0].pose.displacement[0].x / 0.1).abs() < 1e-12
        );
    }

    #[test]
    fn a_frame_without_readings_is_the_priors_and_the_next_goes_on_from_the_one_before() {
        let readings = vec![Some(0.0), None, Some(0.02)];
        let (all, _) = followed(Point { pierced: vec![0.0; 3], readings, asked: Vec::new() });
        assert_eq!(all[1].doubts, [Doubt::Unseen]);
        // Two intervals passed since the last frame that was met.
        let moved = all[2].pose.displacement[0].x - all[0].pose.displacement[0].x;
        assert!((all[2].pose.velocity[0].x - moved / 0.2).abs() < 1e-12);
    }

    #[test]
    fn a_lost_frame_is_looked_for_afresh() {
        let readings = vec![Some(0.0), Some(0.02)];
        let (all, asked) = followed(Point { pierced: vec![0.0, 0.5], readings, asked: Vec::new() });
        assert!(mixtures(&asked, 1) > 0 && all[1].cold && all[1].doubts.is_empty(), "{:?}", all[1].doubts);
    }

    #[test]
    fn what_stays_lost_moves_nothing() {
        let readings = vec![Some(0.0), Some(0.02), Some(0.0)];
        struct Hopeless(Point);
        impl Follow for Hopeless {
            fn start(&mut self) -> Result<Pose, Failure> {
                self.0.start()
            }
            fn approach(&mut self, problem: &Problem, pull: Pull, u: &mut Vec<DVec3>) -> Result<f64, Failure> {
                self.0.approach(problem, pull, u)
            }
            fn look(&mut self, frame: usize, u: &[DVec3], band: f64) -> Met {
                self.0.look(frame, u, band)
            }
            fn certainty(&mut self, p: &Problem, band: f64, u: &[DVec3], d: &[Vec<DVec3>]) -> Result<Certainty, Failure> {
                self.0.certainty(p, band, u, d)
            }
            fn pierced(&mut self, frame: usize, _: &[DVec3]) -> f64 {
                if frame == 1 { 0.4 } else { 0.0 }
            }
            fn seen(&mut self, frame: usize, u: &[DVec3]) -> Vec<bool> {
                self.0.seen(frame, u)
            }
        }
        let mut body = Hopeless(Point { pierced: vec![0.0; 3], readings, asked: Vec::new() });
        let settings = Settings {
            dynamic: true,
            temperature: Some(1.0),
            outliers: 0.0,
            spread: Some(0.2),
            widest: 0.1,
            spacing: 0.01,
            noise: 0.01,
            size: 1.0,
        };
        let mut all = Vec::new();
        let visit = |t: Tracked| {
            all.push(t);
            ControlFlow::Continue(())
        };
        track(&mut body, &settings, &[(0, 0.0), (1, 0.1), (2, 0.2)], 0.0, &[vec![DVec3::ONE]], visit).unwrap();
        assert_eq!(all[1].doubts, [Doubt::Pierced(0.4)]);
        let moved = all[2].pose.displacement[0].x - all[0].pose.displacement[0].x;
        assert!((all[2].pose.velocity[0].x - moved / 0.2).abs() < 1e-12, "{:?}", all[2].pose);
    }
}
