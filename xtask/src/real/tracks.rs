//! Where markers were seen and where a simulation has them.

use glam::DVec3;
use palpate::{Error, Experiment};
use palpate_cpu::CpuBackend;
use palpate_engine::Rollout;

/// A marker at one time.
#[derive(Clone, Copy, Debug)]
pub struct Sighting {
    /// Time on the recording's clock [s].
    pub time: f64,
    /// Measured position [m].
    pub seen: DVec3,
    /// Simulated position [m].
    pub simulated: DVec3,
}

/// Sightings of one marker at parameters θ, ordered by time; none of a marker that the recording does not have.
///
/// # Errors
/// The simulation fails.
pub fn track(experiment: &Experiment, theta: &[f64], marker: &str) -> Result<Vec<Sighting>, Error> {
    let plan = experiment.plan();
    let site = plan.observation.markers.iter().position(|m| m.name == marker).unwrap_or(usize::MAX);
    let mut all = Vec::new();
    let mut rollout = Rollout::new(CpuBackend, plan, 1)?;
    let seen = |frame: usize| &plan.observation.frames[frame];
    rollout.visit(theta, |_, _, residuals| {
        for r in residuals {
            for (sample, off) in r.offsets().filter(|(s, _)| s.item as usize == site) {
                all.push(Sighting { time: seen(r.frame).time, seen: sample.place, simulated: sample.place + off });
            }
        }
        std::ops::ControlFlow::Continue(())
    })?;
    all.sort_by(|a, b| a.time.total_cmp(&b.time));
    Ok(all)
}

/// Root mean square distance [m] between measurement and simulation.
pub fn rms(track: &[Sighting]) -> f64 {
    (track.iter().map(|s| (s.simulated - s.seen).length_squared()).sum::<f64>() / track.len() as f64).sqrt()
}
