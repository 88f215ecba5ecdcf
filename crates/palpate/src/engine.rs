//! Choice of a backend, and rollouts without its type.

use crate::error::Error;
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Evaluate, Evaluation, FrameResiduals, Rollout, Snapshot};
use palpate_model::plan::Plan;
use std::ops::ControlFlow;

/// What computes the physics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// The reference in double precision.
    Cpu,
    /// The fastest that this build and machine have.
    #[default]
    Auto,
}

impl Backend {
    /// Name of the backend that is really used, for result files.
    pub fn resolved(self) -> &'static str {
        match self {
            // The only one in this build; `auto` has nothing to choose from.
            Backend::Cpu | Backend::Auto => "cpu",
        }
    }

    /// A plan as a function of θ, for up to `members` simulations at once.
    ///
    /// # Errors
    /// The backend refuses the plan.
    pub fn evaluator(self, plan: &Plan, members: usize) -> Result<Box<dyn Evaluate>, Error> {
        match self {
            Backend::Cpu | Backend::Auto => Ok(Box::new(Rollout::new(CpuBackend, plan, members)?)),
        }
    }

    /// Simulates one member; `visit` gets every state (the initial one first) with the residuals of the frames of its step, and may
    /// end the simulation.
    ///
    /// # Errors
    /// The backend refuses the plan, or the simulation fails.
    pub fn visit(
        self,
        plan: &Plan,
        theta: &[f64],
        visit: impl FnMut(usize, Snapshot, Vec<FrameResiduals>) -> ControlFlow<()>,
    ) -> Result<Evaluation, Error> {
        match self {
            Backend::Cpu | Backend::Auto => Ok(Rollout::new(CpuBackend, plan, 1)?.visit(theta, visit)?),
        }
    }
}

/// Displacement [m] of every node between two states of a simulation, on the cubic through both displacements and velocities
/// (what frames between steps are compared with); the state is held before the first and after the last.
pub fn between(a: &Snapshot, b: &Snapshot, time: f64) -> Vec<DVec3> {
    let dt = b.time - a.time;
    if dt <= 0.0 {
        return b.displacement.clone();
    }
    let s = ((time - a.time) / dt).clamp(0.0, 1.0);
    let (s2, s3) = (s * s, s * s * s);
    let f = [2.0 * s3 - 3.0 * s2 + 1.0, (s3 - 2.0 * s2 + s) * dt, 3.0 * s2 - 2.0 * s3, (s3 - s2) * dt];
    (0..a.displacement.len())
        .map(|i| a.displacement[i] * f[0] + a.velocity[i] * f[1] + b.displacement[i] * f[2] + b.velocity[i] * f[3])
        .collect()
}

/// Runs `work` with so many threads (0 = one per core).
///
/// # Errors
/// The operating system refuses the threads.
pub fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> Result<T, Error> {
    if threads == 0 {
        return Ok(work());
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    Ok(pool.map_err(|e| Error::Failed(format!("cannot start {threads} threads: {e}")))?.install(work))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_motion_is_met_exactly_between_two_states() {
        let at = |t: f64| Snapshot {
            time: t,
            displacement: vec![DVec3::new(t * t * t, 1.0 - t, 0.5 * t * t)],
            velocity: vec![DVec3::new(3.0 * t * t, -1.0, t)],
        };
        let (a, b) = (at(0.2), at(0.5));
        for t in [0.2, 0.31, 0.5] {
            assert!((between(&a, &b, t)[0] - at(t).displacement[0]).length() < 1e-15, "{t}");
        }
        assert_eq!(between(&a, &b, 9.0), b.displacement);
    }
}
