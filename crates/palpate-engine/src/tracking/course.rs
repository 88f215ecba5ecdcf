//! The way through the frames: when to look how wide, when to stop, what to doubt, and when to look afresh.

use super::{Certainty, Doubt, Follow, Met, Pose, Prior, Problem, Pull, Settings, Tracked};
use crate::failure::{Failure, FailureKind};
use glam::DVec3;
use std::ops::ControlFlow;

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

/// The temperature as frames teach it.
#[derive(Clone, Copy, Debug, Default)]
struct Temperature {
    excess: f64,
    determined: f64,
}

impl Temperature {
    /// That of one frame by itself.
    fn of(c: &Certainty) -> Temperature {
        Temperature { excess: c.excess, determined: c.determined }
    }

    fn learn(&mut self, c: &Certainty) {
        self.excess = MEMORY * self.excess + c.excess;
        self.determined = MEMORY * self.determined + c.determined;
    }

    /// That of the largest evidence [J].
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
            let Some(wanted) = Temperature::of(&certainty).now().map(coldest).filter(|_| settings.temperature.is_none()) else {
                break;
            };
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
            seen: body.seen(frame, &u)?,
            doubts: doubts(body, settings, frame, &u, &met, (&certainty, problem.temperature, self.energy))?,
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
) -> Result<Vec<Doubt>, Failure> {
    if met.readings == 0 {
        return Ok(vec![Doubt::Unseen]);
    }
    let mut doubts = Vec::new();
    if met.rms > FAR * settings.noise.max(0.1 * settings.spacing) {
        doubts.push(Doubt::Far(met.rms));
    }
    let pierced = body.pierced(frame, u)?;
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
    Ok(doubts)
}
