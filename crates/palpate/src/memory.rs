//! How many simulations of a fit run at once, and how much memory they take.

use crate::error::Error;
use glam::DVec3;
use palpate_engine::{MOST_SENSITIVITIES, Request, Wanted};
use palpate_fit::{Want, want};
use palpate_gpu::{AdapterReport, Choice, GpuError, Load};
use palpate_io::Room;
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::build::plan_memory;
use palpate_model::scene::{BodySource, Optimizer, Resolution, Scene};
use palpate_model::shape::Shape;
use rayon::BroadcastContext;
use std::hint::black_box;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Memory that the simulations of one batch may take together [B], unless the user says how many run at once. What a graphics
/// device has cannot be asked; any that computes faster than a CPU has more.
pub(crate) const BATCH_MEMORY: u64 = 2_000_000_000;

/// Bytes a node below which every simulation on the CPU stays beside its states, up to bodies of a million nodes: the fill of a factor of a ball,
/// where 18 535 nodes have 8600 entries each, and N nodes more as N^0.45.
const ROUGH: u64 = 500_000;

/// Whether the threads that compute have been started.
static STARTED: Once = Once::new();

/// Whether they, and the thread that asks, keep what they need for products of matrices.
static SETTLED: AtomicBool = AtomicBool::new(false);

/// The most that simulations were granted so far [B]. Since then they gave it back to the heap of this process, whose addresses count as taken.
static GRANTED: AtomicU64 = AtomicU64::new(0);

/// A thread's first allocation.
fn allocate(_: BroadcastContext<'_>) {
    drop(black_box(Box::new(0u8)));
}

/// What the machine, the container or the shell leave, beside the addresses that threads reserve ([`Room::beside`]).
fn left(started: usize, computing: usize) -> Option<Room> {
    // A thread reserves addresses at its first allocation. Those that compute do so before it is first asked what is left, while none of them is
    // busy yet.
    if rayon::current_thread_index().is_none() {
        STARTED.call_once(|| {
            rayon::broadcast(allocate);
        });
    }
    palpate_io::available().map(|room| room.beside(started, computing))
}

/// Lets the threads that compute take for good what each of them needs for products of matrices, where it counts: from then on it is known what is
/// left. The thread that asks computes as well.
///
/// # Errors
/// There is no room for it.
pub(crate) fn settle() -> Result<(), Error> {
    if rayon::current_thread_index().is_some() || SETTLED.load(Ordering::Relaxed) {
        return Ok(());
    }
    let threads = rayon::current_num_threads();
    if reserve(threads + 1)? {
        rayon::broadcast(|_| palpate_cpu::settle());
        palpate_cpu::settle();
    }
    SETTLED.store(true, Ordering::Relaxed);
    Ok(())
}

/// The same for the threads of a pool.
///
/// # Errors
/// As [`settle`].
pub(crate) fn settle_pool(pool: &rayon::ThreadPool) -> Result<(), Error> {
    let threads = pool.current_num_threads();
    pool.broadcast(allocate);
    if reserve(threads)? {
        pool.broadcast(|_| palpate_cpu::settle());
    }
    Ok(())
}

/// True where it counts what so many threads keep.
fn reserve(threads: usize) -> Result<bool, Error> {
    let Some(room) = left(0, 0).filter(|room| room.addresses) else { return Ok(false) };
    let what = format!("computing on {threads} threads");
    require(room.beside(0, threads).reserved, Some(room), &what, "take coarser cells, or fewer threads: RAYON_NUM_THREADS")?;
    Ok(true)
}

/// What is left to simulations, on so many threads that are yet to be started: what they had before is theirs.
fn left_to_simulations(demand: &Demand, threads: usize) -> Option<Room> {
    let room = left(demand.threads() + threads, threads)?;
    Some(Room { bytes: room.bytes.max(GRANTED.load(Ordering::Relaxed)), ..room })
}

/// Refuses what memory has no room for, before it is taken: a process that runs out of memory is ended without a word.
///
/// # Errors
/// More bytes are asked for than there is room.
fn require(bytes: u64, room: Option<Room>, what: &str, hint: &str) -> Result<(), Error> {
    let short = room.filter(|room| room.bytes < bytes);
    short.map_or(Ok(()), |room| {
        let needed = palpate_io::gigabytes(bytes);
        Err(Error::Memory(format!("{what} takes about {needed} of memory, and {room} (hint: {hint})")))
    })
}

/// Refuses a body that memory has no room to be made in.
///
/// # Errors
/// As [`require`].
pub(crate) fn require_for_body(scene: &Scene, shape: &dyn Shape) -> Result<(), Error> {
    let Some(bytes) = plan_memory(scene, shape) else { return Ok(()) };
    let object = &scene.object;
    // The weights of points are solved for.
    let threads = usize::from(matches!(object.source, BodySource::Cloud(_)));
    let (doing, hint) = match (&object.source, object.resolution) {
        (BodySource::Cloud(_), _) => ("joining the points", "take fewer points: object.points"),
        (BodySource::Tetrahedra { .. }, _) => ("making the body", "take a coarser mesh: object.volume_mesh"),
        (_, Resolution::Edge(_)) => ("filling the body", "take larger tetrahedra: object.edge_length"),
        (_, Resolution::Cells(_)) => ("cutting the body", "take coarser cells: object.cells"),
        _ => ("cutting the body", "take coarser cells: object.cell_size"),
    };
    require(bytes as u64, left(0, threads), &format!("{}: {doing}", scene.path.display()), hint)
}

/// How many simulations run at once on so many threads of the CPU (0 = one per core): as many as are asked for, as long as they fit.
///
/// # Errors
/// Memory has no room for one: as [`require`].
pub(crate) fn members_on_cpu(plan: &Plan, demand: &Demand, threads: usize) -> Result<usize, Error> {
    if threads == 0 {
        settle()?;
    }
    // Sizes are counted only where it may matter: now, or once these have been granted.
    let states = 2 * size_of::<DVec3>() * plan.clock.stages().len();
    let rough = (ROUGH + states as u64) * (plan.body.nodes.len() * demand.most()) as u64;
    let room = left_to_simulations(demand, threads);
    let all_fit = demand.most() == 1 || rough <= BATCH_MEMORY;
    if all_fit && room.is_none_or(|room| room.bytes > 2 * rough.max(BATCH_MEMORY)) {
        return Ok(demand.most());
    }
    let (members, memory) = demand.on_cpu(plan, threads);
    let what = format!("a simulation of {} nodes", plan.body.nodes.len());
    // One is asked for where no more fit, unless somebody said how many.
    let hint = match demand.asked {
        Some(_) => "take coarser cells, or fewer simulations at once (--batch)",
        None => "take coarser cells",
    };
    require(memory.total(), room, &what, hint)?;
    GRANTED.fetch_max(memory.total(), Ordering::Relaxed);
    Ok(members)
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

    /// One simulation with tangents along these places in θ.
    pub fn tangents(places: &[usize]) -> Demand {
        Demand { optimizer: Optimizer::GaussNewton, places: places.to_vec(), ..Demand::forward(1) }
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

    /// Threads that are started for it: one of every start of a fit.
    fn threads(&self) -> usize {
        if self.compared { self.starts } else { 0 }
    }

    fn most(&self) -> usize {
        self.asked.unwrap_or(usize::MAX).min(self.starts).max(1)
    }

    /// Simulations at once on so many threads of the CPU (0 = one per core), and their memory: as many as there are starts, as long
    /// as they fit.
    pub fn on_cpu(&self, plan: &Plan, threads: usize) -> (usize, palpate_cpu::Memory) {
        let most = left_to_simulations(self, threads).map_or(BATCH_MEMORY, |room| room.bytes.min(BATCH_MEMORY));
        let threads = if threads == 0 { rayon::current_num_threads() } else { threads };
        let sizes = palpate_cpu::Sizes::new(plan);
        let last = sizes.memory(1, 1, threads, &self.last());
        let product = self.multiplies().then(|| sizes.product(threads));
        let of = |members| {
            let during = sizes.memory(members, self.ratios(plan, members), threads, &self.request());
            [Some(last), product].into_iter().flatten().fold(during, |most, m| if m.total() > most.total() { m } else { most })
        };
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
