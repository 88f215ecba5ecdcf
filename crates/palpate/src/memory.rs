//! How many simulations of a fit run at once, and how much memory they take.

use crate::error::Error;
use palpate_engine::{MOST_SENSITIVITIES, Request, Wanted};
use palpate_fit::{Want, want};
use palpate_gpu::{AdapterReport, Choice, GpuError, Load};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::scene::Optimizer;

/// Memory that the simulations of one batch may take together [B], unless the user says how many run at once. What a graphics
/// device has cannot be asked; any that computes faster than a CPU has more.
pub(crate) const BATCH_MEMORY: u64 = 2_000_000_000;

/// Bytes a node below which no simulation on the CPU stays, up to bodies of a million nodes: the fill of a factor.
const ROUGH: u64 = 150_000;

/// Refuses what memory has no room for, before it is taken: a process that runs out of memory is ended without a word.
///
/// # Errors
/// More bytes are asked for than the machine, the container or the shell leave.
pub(crate) fn require(bytes: u64, what: &str, hint: &str) -> Result<(), Error> {
    let short = palpate_io::available().filter(|room| room.bytes < bytes);
    short.map_or(Ok(()), |room| {
        let needed = palpate_io::gigabytes(bytes);
        Err(Error::Failed(format!("{what} takes about {needed} of memory, and {room} (hint: {hint})")))
    })
}

/// Refuses a simulation on the CPU that memory has no room for.
///
/// # Errors
/// As [`require`].
pub(crate) fn require_on_cpu(plan: &Plan, demand: &Demand, threads: usize) -> Result<(), Error> {
    // Sizes are counted only where it may matter.
    let rough = ROUGH * plan.body.nodes.len() as u64;
    if palpate_io::available().is_none_or(|room| room.bytes > rough) {
        return Ok(());
    }
    let memory = demand.on_cpu(plan, threads).1;
    let what = format!("a simulation of {} nodes", plan.body.nodes.len());
    require(memory.total(), &what, "take coarser cells, or fewer simulations at once (--batch)")
}

/// What a fit asks of its backend.
#[derive(Clone, Debug)]
pub(crate) struct Demand {
    /// Simulations that could run at once: the starts of the fit.
    pub starts: usize,
    /// How many the user allows.
    pub asked: Option<usize>,
    /// Optimiser.
    pub optimizer: Optimizer,
    /// Places in θ of the free parameters.
    pub places: Vec<usize>,
    /// Whether states are compared with what was measured.
    pub compared: bool,
}

impl Demand {
    /// So many simulations without derivatives.
    pub fn forward(members: usize) -> Demand {
        Demand { starts: members, asked: None, optimizer: Optimizer::NelderMead, places: Vec::new(), compared: false }
    }

    /// What is asked of every evaluation.
    pub fn request(&self) -> Request {
        match want(self.optimizer) {
            Want::Cost => Request::default(),
            Want::Gradient => Request { gradient: Wanted::Places(self.places.clone()), sensitivities: Vec::new() },
            Want::Curvature => Request { gradient: Wanted::Nothing, sensitivities: self.places.clone() },
        }
    }

    /// A step with that, in words.
    pub fn step(&self) -> String {
        match want(self.optimizer) {
            _ if !self.compared => "a step".into(),
            Want::Cost => "a step with the cost".into(),
            Want::Gradient => "a step with the cost and its gradient".into(),
            Want::Curvature if self.places.len() == 1 => "a step with the cost and one derivative".into(),
            Want::Curvature => format!("a step with the cost and {} derivatives", self.places.len()),
        }
    }

    /// What is asked once, at the best point, for standard errors; nothing of very many numbers.
    fn last(&self) -> Request {
        if self.places.len() > MOST_SENSITIVITIES {
            return Request::default();
        }
        Request { gradient: Wanted::Nothing, sensitivities: self.places.clone() }
    }

    /// True where products with the Gauss–Newton matrix are asked for.
    fn multiplies(&self) -> bool {
        self.optimizer == Optimizer::GaussNewtonCg
    }

    fn ratios(&self, plan: &Plan, members: usize) -> usize {
        if self.places.contains(&plan.layout.index(ParamKey::PoissonRatio)) { members } else { 1 }
    }

    fn most(&self) -> usize {
        self.asked.unwrap_or(usize::MAX).min(self.starts).max(1)
    }

    /// Simulations at once on so many threads of the CPU (0 = one per core), and their memory: as many as there are starts, as long
    /// as they fit.
    pub fn on_cpu(&self, plan: &Plan, threads: usize) -> (usize, palpate_cpu::Memory) {
        let threads = if threads == 0 { rayon::current_num_threads() } else { threads };
        let sizes = palpate_cpu::Sizes::new(plan);
        let last = sizes.memory(1, 1, threads, &self.last());
        let product = self.multiplies().then(|| sizes.product(threads));
        let of = |members| {
            let during = sizes.memory(members, self.ratios(plan, members), threads, &self.request());
            [Some(last), product].into_iter().flatten().fold(during, |most, m| if m.total() > most.total() { m } else { most })
        };
        let most = palpate_io::available().map_or(BATCH_MEMORY, |room| room.bytes.min(BATCH_MEMORY));
        largest(self.most(), of, |m| self.asked.is_some() || m.total() <= most)
    }

    /// The same on a device whose largest buffer is `room` [B]. Where not even one simulation fits, one is the answer: to make it
    /// says what is too large.
    ///
    /// # Errors
    /// The body is beyond what the kernels can do.
    pub fn on_device(&self, plan: &Plan, room: u64) -> Result<(usize, palpate_gpu::Memory), GpuError> {
        let of = |members| {
            let load = |request| Load { members, ratios: self.ratios(plan, members), request, room };
            palpate_gpu::memory(plan, &load(&self.request()))
        };
        let fits = |m: &palpate_gpu::Memory| m.largest <= room && (self.asked.is_some() || m.total() <= BATCH_MEMORY);
        let (members, during) = largest(self.most(), of, |m| m.as_ref().is_ok_and(fits));
        let during = during?;
        // Memory of states is kept for the next batch of the same size. The last evaluation is one member.
        let gradient = if members == 1 { self.request().gradient } else { Wanted::Nothing };
        let request = Request { gradient, ..self.last() };
        let last = palpate_gpu::memory(plan, &Load { members: 1, ratios: 1, request: &request, room })?;
        let then = palpate_gpu::Memory { states: last.states, tangents: last.tangents, ..during };
        let gradient = self.request().gradient;
        let product = if self.multiplies() { Some(palpate_gpu::memory_of_product(plan, &gradient, room)?) } else { None };
        let all = [Some(then), product].into_iter().flatten();
        Ok((members, all.fold(during, |most, m| if m.total() > most.total() { m } else { most })))
    }
}

/// The largest number up to `most` of which what it takes fits, at least 1, and what it takes; whatever is larger than one that does
/// not fit does not fit either.
fn largest<T>(most: usize, of: impl Fn(usize) -> T, fits: impl Fn(&T) -> bool) -> (usize, T) {
    let all = of(most);
    if most == 1 || fits(&all) {
        return (most, all);
    }
    let (mut low, mut high) = ((1, None), most);
    while high - low.0 > 1 {
        let middle = low.0 + (high - low.0) / 2;
        let taken = of(middle);
        if fits(&taken) { low = (middle, Some(taken)) } else { high = middle }
    }
    (low.0, low.1.unwrap_or_else(|| of(1)))
}

/// The adapter that would be used.
pub(crate) fn adapter() -> Option<AdapterReport> {
    let choice = Choice::from_env();
    palpate_gpu::adapters().into_iter().find(|a| a.refusal.is_none() && a.is_meant(&choice))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Experiment;

    #[test]
    fn the_largest_that_fits_is_found() {
        for most in 1..20 {
            for limit in 0..25 {
                assert_eq!(largest(most, |n| n, |n| *n <= limit).0, limit.clamp(1, most), "{most} {limit}");
            }
        }
    }

    #[test]
    fn as_many_run_at_once_as_a_buffer_of_the_device_holds() {
        let scene = r#"
            format = "scene/1"
            [object]
            shape = { ball = { radius = 0.05, center = [0, 0, 0.3] } }
            cell_size = 0.01
            [material]
            density = 1000.0
            youngs_modulus = 2.0e4
            poisson_ratio = 0.4
            [time]
            step = 0.01
            steps = 20
        "#;
        let experiment = Experiment::from_toml(scene, "ball.toml").unwrap_or_else(|e| panic!("{e}"));
        let plan = experiment.plan();
        for optimizer in [Optimizer::GaussNewton, Optimizer::Rprop, Optimizer::NelderMead] {
            let demand = |starts, asked| Demand { starts, asked, optimizer, places: vec![0, 1], compared: true };
            let on = |starts, asked, room| demand(starts, asked).on_device(plan, room).unwrap_or_else(|e| panic!("{e}"));
            let (all, memory) = on(20, None, u64::MAX);
            assert_eq!(all, 20);
            // A device with buffers of half that size takes half as many; one more would not fit.
            // Some buffers have a head of a few words, whatever the number of members.
            let room = memory.largest / 2 + 512;
            let (half, part) = on(20, None, room);
            assert_eq!((half, part.largest <= room), (10, true), "{optimizer:?}");
            assert!(part.total() < memory.total());
            assert_eq!(on(20, None, memory.largest / 2 - 1).0, 9);
            assert_eq!(on(20, Some(3), u64::MAX).0, 3, "who asks for fewer gets fewer");
            assert_eq!(on(20, Some(99), room).0, 10, "and no more than fit");
            assert_eq!(on(20, None, 1000).0, 1);
            let cpu = |asked| demand(20, asked).on_cpu(plan, 2);
            assert_eq!((cpu(None).0, cpu(Some(4)).0), (20, 4));
            assert!(cpu(Some(4)).1.total() < cpu(None).1.total());
        }
    }
}
