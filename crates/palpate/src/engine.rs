//! Choice of a backend, and rollouts without its type.

use crate::auto;
use crate::error::Error;
use crate::host::host;
use crate::memory::{Demand, members_on_cpu, settle, settle_pool};
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::tracking::Correspond;
use palpate_engine::{Evaluate, Evaluation, FrameResiduals, Part, Rollout, Snapshot, Stop, Visitor};
use palpate_gpu::{Choice, Gpu, GpuBackend, GpuError, Skinning};
use palpate_model::plan::Plan;
use palpate_model::plan::join::{Joint, join};
use palpate_model::space::stencil::Stencils;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

/// What computes the physics.
///
/// ```
/// use palpate::{Backend, Experiment};
///
/// let scene = r#"
///     format = "scene/1"
///     [object]
///     shape = { ball = { radius = 0.05, center = [0, 0, 0.3] } }
///     cell_size = 0.05
///     [material]
///     density = 1000.0
///     youngs_modulus = 2.0e4
///     poisson_ratio = 0.4
///     [time]
///     step = 0.01
///     steps = 2
/// "#;
/// let experiment = Experiment::from_toml(scene, "ball.toml")?;
/// // What `auto` picks for this body, and why: the CPU, unless a graphics processor was measured to be faster.
/// let (backend, reason) = Backend::Auto.resolve(experiment.plan(), 1);
/// assert_ne!(backend, Backend::Auto);
/// println!("{}: {reason}", backend.name());
/// let simulation = experiment.simulate(backend)?;
/// assert_eq!(simulation.snapshots.len(), 3);
/// # Ok::<(), palpate::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// The reference in double precision.
    Cpu,
    /// WGSL kernels on the graphics adapter that `PALPATE_ADAPTER` names (by index, PCI address or a part of its name), else on the best one.
    Gpu,
    /// The faster of the two for the body at hand.
    #[default]
    Auto,
}

/// The device of this process: kernels are compiled once. A device that was lost is opened anew, for whoever comes next.
fn gpu() -> Result<GpuBackend, GpuError> {
    static OPEN: Mutex<Option<Arc<Gpu>>> = Mutex::new(None);
    let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    if open.as_ref().is_none_or(|gpu| gpu.is_lost()) {
        *open = Some(Gpu::open_for(&Choice::from_env(), None, host())?);
    }
    let device = GpuBackend::on(open.clone().expect("a device was just opened"));
    Ok(device.with_shapes(Arc::new(CpuBackend)))
}

/// The device for so many simulations at once.
fn gpu_for(members: usize) -> Result<GpuBackend, Error> {
    let device = gpu().map_err(Error::Device)?;
    Ok(if members == 1 { device.alone() } else { device })
}

/// False where the system has no device file of a graphics processor: drivers need not be asked then, which takes time and makes
/// some of them write to the terminal.
fn may_have_processor() -> bool {
    !cfg!(target_os = "linux")
        || ["/dev/dri", "/dev/nvidia0", "/dev/kfd", "/dev/dxg"].iter().any(|f| std::path::Path::new(f).exists())
}

impl Backend {
    /// Name for result files and messages.
    pub fn name(self) -> &'static str {
        match self {
            Backend::Cpu => "cpu",
            Backend::Gpu => "gpu",
            Backend::Auto => "auto",
        }
    }

    /// What `auto` means for a plan in batches of `members`, and the reason: a graphics processor is taken where a step of this body
    /// takes clearly less time on it than on the CPU, both measured here or before. Software adapters are never faster and not tried, unless
    /// `PALPATE_ADAPTER` names one.
    pub fn resolve(self, plan: &Plan, members: usize) -> (Backend, String) {
        self.resolve_for(plan, &Demand::forward(members), &mut |_| {})
    }

    /// The same for a fit, whose steps are timed with what its optimiser asks of them: the cost, its gradient or derivatives. `hear` is told
    /// what takes time.
    pub(crate) fn resolve_for(self, plan: &Plan, demand: &Demand, hear: &mut dyn FnMut(&str)) -> (Backend, String) {
        if self != Backend::Auto {
            return (self, "asked for".into());
        }
        let named = Choice::from_env() != Choice::Auto;
        hear("auto: opening the graphics device");
        if !named && (!may_have_processor() || !palpate_gpu::adapters().iter().any(|a| a.refusal.is_none() && !a.is_software())) {
            return (Backend::Cpu, "there is no graphics processor".into());
        }
        match gpu() {
            Ok(device) => auto::choose(device, plan, demand, hear),
            Err(e) => (Backend::Cpu, e.to_string()),
        }
    }

    /// Who says, for a tracker, which readings belong to which part of the surface: the device only where it is asked for.
    ///
    /// # Errors
    /// There is no usable adapter.
    pub(crate) fn correspondence(self) -> Result<Box<dyn Correspond>, Error> {
        Ok(match self {
            Backend::Gpu => Box::new(gpu().map_err(Error::Device)?.correspondence()),
            Backend::Cpu | Backend::Auto => Box::new(palpate_cpu::Correspondence),
        })
    }

    /// Who moves places that follow a body of `nodes` nodes, where that is the device.
    ///
    /// # Errors
    /// There is no usable adapter, or it has too little room.
    pub(crate) fn skinning(self, stencils: &Stencils, nodes: usize) -> Result<Option<Skinning>, Error> {
        match self {
            Backend::Gpu => gpu().and_then(|device| device.skinning(stencils, nodes)).map(Some).map_err(Error::Device),
            Backend::Cpu | Backend::Auto => Ok(None),
        }
    }

    /// How many simulations of a fit run at once, with so many threads (0 = one per core).
    ///
    /// # Errors
    /// There is no usable adapter, or the body is beyond what it can do.
    pub(crate) fn members(self, plan: &Plan, demand: &Demand, threads: usize) -> Result<usize, Error> {
        match self {
            Backend::Gpu => {
                let room = gpu().map_err(Error::Device)?.gpu().largest_buffer();
                Ok(demand.on_device(plan, room).map_err(Error::Device)?.0)
            }
            _ => members_on_cpu(plan, demand, threads),
        }
    }

    /// A plan as a function of θ, for up to `members` simulations at once.
    ///
    /// # Errors
    /// There is no usable adapter, or the backend refuses the plan.
    pub fn evaluator(self, plan: &Plan, members: usize) -> Result<Box<dyn Evaluate>, Error> {
        self.evaluator_until(plan, members, Stop::default())
    }

    /// The same, whose evaluations end at their next stage once `stop` says so.
    ///
    /// # Errors
    /// There is no usable adapter, or the backend refuses the plan.
    pub fn evaluator_until(self, plan: &Plan, members: usize, stop: Stop) -> Result<Box<dyn Evaluate>, Error> {
        match self.resolve(plan, members).0 {
            Backend::Gpu => Ok(Box::new(Rollout::new(gpu_for(members)?, plan, members)?.stopped_by(stop))),
            _ => Ok(Box::new(Rollout::new(CpuBackend, plan, members)?.stopped_by(stop))),
        }
    }

    /// Plans as functions of θ, in their order. Those that differ in θ and recordings alone are parts of one evaluator, for as many simulations
    /// at once as `members` says of a plan with the recordings of so many.
    ///
    /// # Errors
    /// As [`Backend::evaluator`], or `members` has one.
    pub(crate) fn evaluators_until(
        self,
        plans: &[&Plan],
        mut members: impl FnMut(&Joint) -> Result<usize, Error>,
        stop: &Stop,
    ) -> Result<Vec<Box<dyn Evaluate>>, Error> {
        let mut all: Vec<Option<Box<dyn Evaluate>>> = plans.iter().map(|_| None).collect();
        for joint in join(plans) {
            let whole = self.evaluator_until(&joint.plan, members(&joint)?, stop.clone())?;
            if let [(only, _)] = joint.parts[..] {
                all[only] = Some(whole);
                continue;
            }
            let parts = Part::all(whole, joint.parts.iter().map(|p| p.1.clone()));
            joint.parts.iter().zip(parts).for_each(|((plan, _), part)| all[*plan] = Some(Box::new(part)));
        }
        Ok(all.into_iter().flatten().collect())
    }

    /// Simulates one member; `visit` gets every state (the initial one first) with the residuals of the frames of its step, and may
    /// end the simulation.
    ///
    /// # Errors
    /// There is no usable adapter, the backend refuses the plan, or the simulation fails.
    pub fn visit(
        self,
        plan: &Plan,
        theta: &[f64],
        visit: impl FnMut(usize, Snapshot, Vec<FrameResiduals>) -> ControlFlow<()>,
    ) -> Result<Evaluation, Error> {
        self.visit_until(plan, theta, Stop::default(), visit)
    }

    /// The same, which ends at its next stage once `stop` says so.
    ///
    /// # Errors
    /// As [`Backend::visit`], and where it was stopped.
    pub fn visit_until(
        self,
        plan: &Plan,
        theta: &[f64],
        stop: Stop,
        mut visit: impl FnMut(usize, Snapshot, Vec<FrameResiduals>) -> ControlFlow<()>,
    ) -> Result<Evaluation, Error> {
        self.show(plan, theta, stop, &mut visit)
    }

    /// [`Backend::visit_until`], compiled once for all visitors.
    fn show(self, plan: &Plan, theta: &[f64], stop: Stop, visit: &mut Visitor<'_>) -> Result<Evaluation, Error> {
        match self.resolve(plan, 1).0 {
            Backend::Gpu => Ok(Rollout::new(gpu_for(1)?, plan, 1)?.stopped_by(stop).visit(theta, visit)?),
            _ => {
                members_on_cpu(plan, &Demand::forward(1), 0)?;
                Ok(Rollout::new(CpuBackend, plan, 1)?.stopped_by(stop).visit(theta, visit)?)
            }
        }
    }

    /// An error where this backend was asked for and cannot be had.
    pub(crate) fn check(self) -> Result<(), Error> {
        if self == Backend::Gpu { gpu().map(|_| ()).map_err(Error::Device) } else { Ok(()) }
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

/// Threads beyond which more only wait for each other: one a core, and a few on small machines, so that results can be compared there.
pub(crate) fn most_threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from).max(16)
}

/// Runs `work` with so many threads (0 = one per core), but not more than are of use.
///
/// # Errors
/// The operating system refuses the threads, or memory has no room for what they keep.
pub fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> Result<T, Error> {
    if threads == 0 {
        settle()?;
        return Ok(work());
    }
    let threads = threads.min(most_threads());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| Error::Failed(format!("cannot start {threads} threads: {e}")))?;
    settle_pool(&pool)?;
    // The work goes on in the caller's span.
    let span = tracing::Span::current();
    Ok(pool.install(|| span.in_scope(work)))
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

#[cfg(test)]
#[path = "engine_tests.rs"]
mod device_tests;
