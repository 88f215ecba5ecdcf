//! Comparison of states with what was measured: matching, costs and their derivatives, on the device.
//!
//! Interface to the rest of the backend: states come as buffers of `[3][B][N]` vectors (u = first + second part, v), adjoints and
//! tangents as `[2][B][N]`; results are added to buffers of the tally. Frames of a step are worked on in rounds ([`looks`]); matches
//! are found again on the way back, which costs less memory than keeping them for every frame and member.

mod bounds;
mod depth;
mod displacements;
#[cfg(test)]
mod extension_tests;
#[cfg(test)]
mod fault_tests;
#[cfg(test)]
mod front_tests;
mod looks;
mod markers;
#[cfg(test)]
mod match_tests;
#[cfg(test)]
mod product_tests;
mod readings;
mod results;
#[cfg(test)]
pub(crate) mod rollout_tests;
#[cfg(test)]
pub(crate) mod rows_tests;
mod shots;
mod tables;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod view_tests;

use crate::device::pipelines::pass;
use crate::device::pipelines::shared::{directions::DIRECTION, reduce};
use crate::device::recorder::{Args, Buffers, Named, Recorder, Size};
use crate::device::{Arena, Gpu, GpuError, Maker};
use crate::layout::{Carried, Found, Look, Sight};
#[cfg(test)]
pub(crate) use bounds::MOST_DIRECTIONS;
pub(crate) use bounds::Seen;
use looks::{Agenda, Round};
use palpate_engine::{Direction, ReadingResidual, ResidualRow};
use palpate_model::cutcells::pullback::TURNED_AWAY;
use palpate_model::effects::sensors::Sensors;
use palpate_model::observation::{ReadingKind, Viewed};
use palpate_model::plan::Plan;
pub(crate) use results::{residuals, rows};
use shots::{Shots, Take, row_count};
use std::collections::HashMap;
use tables::{BandTables, SiteTables};

/// Most loop iterations of one invocation: software adapters silently leave every loop beyond 65,535, and what short loops add is
/// not counted.
pub(crate) const MOST_LOOPS: u64 = 62_000;
/// Points that one group of eight lanes goes through at most for a cell; more are dealt out to more groups.
pub(crate) const POINTS_OF_STRIPE: usize = 12_500;
/// Device memory for scratch [B]; fewer looks are worked on together when they need more.
const SCRATCH: u64 = 256 << 20;
/// Most workgroups that share a sum.
const PARTS: usize = reduce::PARTS as usize;
/// Bytes of a node's vector, and of what is kept of a point and of a marker.
const VECTOR: u64 = 16;
const FOUND: u64 = size_of::<Found>() as u64;
const CARRIED: u64 = size_of::<Carried>() as u64;

/// Every cost, in the order in which residuals stand in a frame.
const COSTS: [&dyn Cost; 3] = [&depth::Depth, &markers::Markers, &displacements::Displacements];

/// What one kind of readings takes beside the passes that serve all (`see_nodes`, `sum_rows`, `join_pulls`, `fold_pulls`, `see_tangents`,
/// `differentiate_rows`, `weigh_rows`, `weigh_changes`).
trait Cost: Sync {
    /// Most readings of a look in a round.
    fn items(&self, round: &Round) -> usize;
    /// Scratch buffers of one look, and their bytes.
    fn scratch(&self, s: &Sight) -> Vec<(&'static str, u64)>;
    /// Finds the residuals of a round's looks.
    fn compare(&self, r: &mut Recorder, own: &Named, sight: &Sight, round: Round);
    /// Prepares what nodes gather of dJ/dr, and adds to dJ/dθ at fixed displacement.
    fn pull(&self, r: &mut Recorder, own: &Named, sight: &Sight, round: Round);
    /// Residuals of a frame, reading by reading.
    fn readings(&self, d: &results::Downloaded) -> Vec<ReadingResidual>;
    /// Scalar residuals of a frame, with their places among the device's rows.
    fn rows(&self, d: &results::Downloaded) -> Vec<(ResidualRow, usize)>;
}

/// What is observed, on the device.
#[derive(Debug)]
pub(crate) struct Observer {
    plan: Plan,
    shots: Shots,
    sight: Sight,
    agenda: Agenda,
    sensors: Vec<Sensors>,
    /// What each member is compared with.
    views: Vec<Viewed>,
    buffers: Buffers,
    /// Largest buffer that can be bound [B].
    largest: u64,
    room: Room,
}

/// How work is cut into parts.
#[derive(Clone, Copy, Debug)]
struct Room {
    /// Points of a stripe.
    points: usize,
    /// Bytes of scratch.
    scratch: u64,
}

fn groups_of(items: usize) -> usize {
    items.div_ceil(64).max(1)
}

impl Observer {
    /// Tables of a plan, and scratch for up to `members` simulations.
    ///
    /// # Errors
    /// A limit of the device is too small.
    pub(crate) fn new(gpu: &Gpu, plan: &Plan, members: usize) -> Result<Observer, GpuError> {
        Observer::within(gpu, plan, members, Room { points: POINTS_OF_STRIPE, scratch: SCRATCH })
    }

    fn within(gpu: &Gpu, plan: &Plan, members: usize, room: Room) -> Result<Observer, GpuError> {
        let (shots, sight, buffers) = tables(gpu, plan, members, room)?;
        let (agenda, sensors, views) = (Agenda::default(), Vec::new(), Vec::new());
        Ok(Observer { plan: plan.clone(), shots, sight, agenda, sensors, views, buffers, largest: gpu.largest, room })
    }

    /// Device memory of tables and scratch [B].
    pub(crate) fn bytes(&self) -> u64 {
        self.buffers.values().map(wgpu::Buffer::size).sum()
    }

    /// A new batch: what each member is compared with, where it starts on that recording's clock [s], and what its sensors do.
    pub(crate) fn set(&mut self, gpu: &Gpu, views: &[Viewed], starts: &[f64], sensors: &[Sensors]) {
        self.sight.members = starts.len() as u32;
        (self.views, self.sensors) = (views.to_vec(), sensors.to_vec());
        let recordings = || views.iter().map(|v| v.view.recording);
        let moved = self.sight.readings > 0 && self.sight.frames > 0;
        if moved {
            let takes: Vec<Take> = recordings().zip(sensors.iter().cloned()).collect();
            self.shots = Shots::of(&self.plan, &takes);
            if let Err(e) = readings::upload(gpu, &self.plan, &takes, &self.shots, &mut self.buffers) {
                gpu.keep(e);
            }
        }
        let take = |(member, recording): (usize, usize)| self.shots.firsts[if moved { member } else { recording }];
        let firsts: Vec<u32> = recordings().enumerate().map(take).collect();
        self.agenda = Agenda::new(&self.plan, views, starts, &firsts, self.sight.slots as usize);
        if let (Some(looks), Some(sight)) = (self.buffers.get("looks"), self.buffers.get("sight")) {
            let bytes: &[u8] = bytemuck::cast_slice(&self.agenda.looks);
            if bytes.len() as u64 <= looks.size() {
                gpu.queue.write_buffer(looks, 0, bytes);
            }
            gpu.queue.write_buffer(sight, 0, bytemuck::bytes_of(&self.sight));
        }
        let offsets = readings::offsets(sensors, self.sight.sites);
        if let Some(buffer) = self.buffers.get("offsets").filter(|b| 16 * offsets.len() as u64 <= b.size()) {
            gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(&offsets));
        }
    }

    /// Looks that are worked on together along `directions` directions.
    fn tangent_slots(&self, directions: usize) -> usize {
        tangent_slots(&self.sight, self.room, self.largest, directions)
    }

    /// Adds to a tally's buffers what observations write along directions. What the device refuses is kept as its error.
    pub(crate) fn extend_tally(&self, gpu: &Gpu, directions: &[Direction], tally: &mut Buffers) {
        sum_sizes(&self.sight).into_iter().for_each(|size| insert(gpu, size, tally));
        self.point(gpu, directions, tally);
    }

    /// Makes a tally ready for tangents along these directions; what it has summed up stays.
    pub(crate) fn point(&self, gpu: &Gpu, directions: &[Direction], tally: &mut Buffers) {
        if let Err(e) = bounds::check_directions(directions.len()) {
            gpu.keep(e);
        }
        let together = self.tangent_slots(directions.len()) as u64;
        let sizes = tangent_sizes(&self.sight, directions.len() as u64, together);
        sizes.into_iter().for_each(|size| insert(gpu, size, tally));
        let components = readings::components(&self.plan, self.sight.members as usize, directions);
        gpu.queue.write_buffer(&tally["own_directions"], 0, bytemuck::cast_slice(&components));
    }

    fn rounds(&self, k: usize) -> impl Iterator<Item = Round> {
        self.agenda.steps.get(k).into_iter().flatten().copied()
    }

    /// All buffers of a call: the call's own, the tally's, the observer's.
    fn named<'a>(&'a self, own: &Named<'a>, tally: &'a Buffers) -> Vec<(&'static str, &'a wgpu::Buffer)> {
        let rest = tally.iter().chain(&self.buffers).map(|(name, buffer)| (*name, buffer));
        own.iter().copied().chain(rest).collect()
    }

    /// Adds the cost of the frames of step k; `ends` are the states before and after it.
    pub(crate) fn observe(&self, r: &mut Recorder, k: usize, ends: [&wgpu::Buffer; 2], tally: &Buffers) {
        for round in self.rounds(k) {
            let own = self.named(&[("now", ends[0]), ("next", ends[1]), ("sums", &tally["frame_sums"])], tally);
            look(r, &own, &self.sight, round);
            let parts = groups_of(round.rows).min(PARTS);
            run(r, pass::SUM_ROWS, &own, round, parts, 0);
            run(r, pass::ADD_PARTS, &own, round, 1, parts);
        }
    }

    /// Adds to dJ/d(now) and dJ/d(next) of the frames of step k, and to dJ/d(start).
    pub(crate) fn observe_adjoint(
        &self,
        r: &mut Recorder,
        k: usize,
        ends: [&wgpu::Buffer; 2],
        adjoints: [&wgpu::Buffer; 2],
        tally: &Buffers,
    ) {
        for round in self.rounds(k) {
            let states = [("now", ends[0]), ("next", ends[1])];
            let adjoint = [("adj_now", adjoints[0]), ("adj_next", adjoints[1]), ("sums", &tally["start_sums"])];
            let own = self.named(&[&states[..], &adjoint[..]].concat(), tally);
            look(r, &own, &self.sight, round);
            self.pull(r, &own, round);
        }
    }

    /// Adds the product of the Gauss–Newton matrix of the frames of step k with the direction of the tangent, as
    /// [`Observer::observe_adjoint`] adds the gradient.
    pub(crate) fn observe_product(
        &self,
        r: &mut Recorder,
        k: usize,
        ends: [&wgpu::Buffer; 2],
        tangent: [&wgpu::Buffer; 2],
        adjoints: [&wgpu::Buffer; 2],
        tally: &Buffers,
    ) {
        for round in self.rounds(k).flat_map(|round| round.parts(self.tangent_slots(1))) {
            let mut own = self.differentiate(r, round, ends, &[tangent], tally);
            let items: usize = COSTS.iter().map(|cost| cost.items(&round)).sum();
            run(r, pass::WEIGH_CHANGES, &own, round, groups_of(items), 0);
            own.extend([("adj_now", adjoints[0]), ("adj_next", adjoints[1]), ("sums", &tally["start_sums"])]);
            self.pull(r, &own, round);
        }
    }

    /// Adds what the residuals of a round pull at both ends of the step and at the start.
    fn pull(&self, r: &mut Recorder, own: &Named, round: Round) {
        COSTS.iter().for_each(|cost| cost.pull(r, own, &self.sight, round));
        let groups = groups_of(self.sight.nodes as usize);
        run(r, pass::JOIN_PULLS, own, round, groups, usize::from(round.points > 0));
        let parts = groups.min(PARTS);
        run(r, pass::FOLD_PULLS, own, round, parts, 0);
        run(r, pass::ADD_PARTS, own, round, 1, parts);
    }

    /// Adds to the Gauss–Newton gradient and matrix of the frames of step k; one tangent buffer a direction.
    pub(crate) fn observe_tangent(
        &self,
        r: &mut Recorder,
        k: usize,
        ends: [&wgpu::Buffer; 2],
        tangents: &[[&wgpu::Buffer; 2]],
        tally: &Buffers,
    ) {
        let q = tangents.len();
        for round in self.rounds(k).flat_map(|round| round.parts(self.tangent_slots(q))) {
            let own = self.differentiate(r, round, ends, tangents, tally);
            run(r, pass::WEIGH_ROWS, &own, round, q + q * (q + 1) / 2, q);
        }
    }

    /// Residuals of a round, and their derivatives along the tangents; returns the buffers.
    fn differentiate<'a>(
        &'a self,
        r: &mut Recorder,
        round: Round,
        ends: [&'a wgpu::Buffer; 2],
        tangents: &[[&wgpu::Buffer; 2]],
        tally: &'a Buffers,
    ) -> Vec<(&'static str, &'a wgpu::Buffer)> {
        let q = tangents.len();
        let band = (self.sight.extended - self.sight.nodes) as usize;
        let states = [("now", ends[0]), ("next", ends[1])];
        let own = self.named(&states, tally);
        look(r, &own, &self.sight, round);
        if q > 0 {
            for (i, [now, next]) in tangents.iter().enumerate() {
                let own = self.named(&[&states[..], &[("tangent_now", *now), ("tangent_next", *next)]].concat(), tally);
                run(r, pass::SEE_TANGENTS, &own, round, groups_of(self.sight.nodes as usize), q + DIRECTION as usize * i);
            }
            if round.points > 0 && band > 0 {
                run(r, pass::EXTEND_TANGENTS, &own, round, groups_of(q * band), q);
            }
            let items: usize = COSTS.iter().map(|cost| cost.items(&round)).sum();
            run(r, pass::DIFFERENTIATE_ROWS, &own, round, groups_of(q * items), q);
        }
        own
    }
}

/// Looks that are worked on together along `directions` directions.
fn tangent_slots(s: &Sight, room: Room, largest: u64, directions: usize) -> usize {
    let each = directions.max(1) as u64 * (VECTOR * u64::from(s.extended)).max(4 * u64::from(s.rows));
    (largest.min(room.scratch) / each.max(1)).clamp(1, u64::from(s.slots)) as usize
}

fn insert(gpu: &Gpu, (name, bytes): (&'static str, u64), tally: &mut Buffers) {
    let made = gpu.buffer(name, bytes).unwrap_or_else(|e| {
        gpu.keep(e);
        gpu.small()
    });
    tally.insert(name, made);
}

/// Sums over frames that observations add to a tally, in bytes.
fn sum_sizes(s: &Sight) -> [(&'static str, u64); 2] {
    let looks = u64::from(s.members) * u64::from(s.frames);
    [("frame_sums", VECTOR * looks), ("start_sums", VECTOR * looks)]
}

/// What observations add to a tally along q directions, in bytes.
fn tangent_sizes(s: &Sight, q: u64, together: u64) -> [(&'static str, u64); 4] {
    let together = if q == 0 || s.members * s.frames == 0 { 0 } else { together };
    let offsets = if s.offsets > 0 { 3 * u64::from(s.sites) } else { 0 };
    [
        ("curvature", 4 * u64::from(s.members) * (q + q * q)),
        ("changes", VECTOR * together * q * u64::from(s.extended)),
        ("slopes", 4 * together * q * u64::from(s.rows)),
        ("own_directions", 4 * u64::from(s.members) * q * (1 + offsets + u64::from(s.readings))),
    ]
}

/// Sizes of the buffers that comparing a plan's frames takes [B].
pub(crate) fn memory<M: Maker<Buffer = u64>>(
    maker: &M,
    plan: &Plan,
    members: usize,
    directions: usize,
) -> Result<Vec<u64>, GpuError> {
    let room = Room { points: POINTS_OF_STRIPE, scratch: SCRATCH };
    let (_, mut sight, buffers) = tables(maker, plan, members, room)?;
    sight.members = members as u32;
    let together = tangent_slots(&sight, room, maker.largest(), directions) as u64;
    let tally = sum_sizes(&sight).into_iter().chain(tangent_sizes(&sight, directions as u64, together));
    Ok(buffers.into_values().chain(tally.map(|t| t.1)).collect())
}

/// What [`tables`] makes.
type Made<B> = (Shots, Sight, HashMap<&'static str, B>);

/// Tables, and scratch.
fn tables<M: Maker>(gpu: &M, plan: &Plan, members: usize, room: Room) -> Result<Made<M::Buffer>, GpuError> {
    let body = &*plan.body;
    let recordings: Vec<_> = (0..plan.recordings()).map(|r| plan.recording(r).observation).collect();
    // Until a batch is there, all members are compared with the recording that has most points.
    let largest =
        (0..recordings.len()).max_by_key(|r| (recordings[*r].readings(ReadingKind::Depth), usize::MAX - r)).unwrap_or(0);
    let takes = readings::distinct(plan, vec![(largest, Sensors::new(&plan.layout, &plan.theta)); members.max(1)]);
    let shots = Shots::of(plan, &takes);
    let band = BandTables::new(plan);
    let sites = SiteTables::new(plan);
    let all = || recordings.iter().flat_map(|r| &r.frames);
    let most = |f: &dyn Fn(&palpate_model::observation::Frame) -> usize| all().map(f).max().unwrap_or(0);
    let frames = recordings.iter().map(|r| r.frames.len()).max().unwrap_or(0);
    let points = most(&|f| f.points.len());
    let mut sight = Sight {
        nodes: body.nodes.len() as u32,
        extended: (body.nodes.len() + body.band.nodes.len()) as u32,
        cells: band.cells.len() as u32,
        points: points as u32,
        rows: most(&|f| row_count(plan, f)) as u32,
        markers: most(&|f| f.markers.len()) as u32,
        stripes: points.div_ceil(room.points).max(1) as u32,
        sites: readings::most_sites(plan) as u32,
        parameters: plan.layout.len() as u32,
        offsets: readings::offset_places(plan).len() as u32,
        readings: readings::places(plan).len() as u32,
        frames: frames as u32,
        lattice: body.band.grid.size.map(|n| n as u32),
        h: body.length as f32,
        band: plan.band as f32,
        turned_away: TURNED_AWAY as f32,
        ..Sight::default()
    };
    Seen::new(&sight, &shots, &band, &sites).check()?;
    let largest = gpu.largest();
    let each = scratch(&sight);
    let widest = each.iter().map(|s| s.1).max().unwrap_or(1).max(1);
    let whole = each.iter().map(|s| s.1).sum::<u64>().max(1);
    let fit = (largest / widest).min(room.scratch / whole).max(1);
    sight.slots = fit.min(members.max(1) as u64) as u32;

    let mut buffers = HashMap::new();
    if frames > 0 {
        for (name, bytes) in each {
            buffers.insert(name, gpu.buffer(name, bytes * u64::from(sight.slots))?);
        }
        let looks = size_of::<Look>() * members.max(1) * frames;
        buffers.insert("looks", gpu.buffer("looks", looks as u64)?);
        buffers.insert("sight", gpu.buffer("sight", size_of::<Sight>() as u64)?);
        readings::upload(gpu, plan, &takes, &shots, &mut buffers)?;
        buffers.insert("measured", gpu.upload("measured", &shots.measured)?);
        let offsets = VECTOR * u64::from(sight.sites) * members.max(1) as u64;
        buffers.insert("offsets", gpu.buffer("offsets", offsets)?);
        let mut body = Arena::new("body_tables");
        body.put("reading_places", &readings::places(plan));
        depth::put(&band, &mut body);
        markers::put(plan, (&shots, &sites), &mut body);
        body.upload(gpu, &mut buffers)?;
    }
    Ok((shots, sight, buffers))
}

/// Bytes of every scratch buffer for one look.
fn scratch(s: &Sight) -> Vec<(&'static str, u64)> {
    let extended = u64::from(s.extended);
    let shared = [
        ("seen", 2 * VECTOR * extended),
        ("pulls", VECTOR * extended),
        ("rows", 8 * u64::from(s.rows)),
        ("partials", VECTOR * PARTS as u64),
    ];
    shared.into_iter().chain(COSTS.iter().flat_map(|cost| cost.scratch(s))).collect()
}

fn run(r: &mut Recorder, kernel: usize, own: &Named, round: Round, groups: usize, mode: usize) {
    let args = Args { step: round.count as u32, mode: mode as u32, roster: groups as u32, extra: round.first as u32 };
    r.run(kernel, own, Size::All { members: round.count, groups }, args);
}

/// Displacements and residuals of a round.
fn look(r: &mut Recorder, own: &Named, sight: &Sight, round: Round) {
    run(r, pass::SEE_NODES, own, round, groups_of(sight.nodes as usize), 0);
    COSTS.iter().for_each(|cost| cost.compare(r, own, sight, round));
}
