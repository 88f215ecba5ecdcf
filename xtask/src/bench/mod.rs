//! Time and memory of one step, forward and back, of the CPU backend: the paper's dragon, and balls and blocks of growing size.

mod counting;
pub mod counts;
pub mod fields;
pub mod fit;
pub mod gpu;
pub mod model;
pub mod page;
pub mod report;

use crate::table;
use glam::{DAffine3, DVec3};
use palpate_cpu::{CpuBackend, World};
use palpate_engine::{Backend, ParamBatch, Request, Rollout, Wanted};
use palpate_model::cutcells::build::SUBDIVISIONS;
use palpate_model::effects::law::Asks;
use palpate_model::effects::{self, Effect, Family, Law};
use palpate_model::materials::{ALL, Model, find};
use palpate_model::observation::{Camera, Channel, Frame, Observation, ObservedPoint, ReadingKind};
use palpate_model::params::{Layout, ParamKey};
use palpate_model::plan::{Clock, Plan, PlaneSite};
use palpate_model::scene::{Analytic, InitialShape, Solver, Tetrahedron};
use palpate_model::shape::{Placed, Shape};
use palpate_model::space::body::Body;
use palpate_model::space::stuffing::stuff;
use peak_alloc::PeakAlloc;
use report::{Line, Report, Times};
use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

/// Steps that are timed; fewer of bodies beyond [`BIG`] nodes.
const STEPS: [usize; 2] = [10, 4];
/// Times that they are repeated, likewise: a single run is at the mercy of what else the machine does.
const RUNS: [usize; 2] = [7, 3];
/// See [`STEPS`].
const BIG: usize = 20_000;
/// Points of a frame, about what a 50 × 50 camera sees of a body.
const POINTS: usize = 1000;
/// Width of the band in cells, as for the paper's dragon.
pub(super) const BAND: f64 = 4.0;
/// The paper's table 2 (RTX 2070): forward, cost, adjoint of one step [s]; of 2489, 1138, 770 and 2440 nodes.
pub(super) const PAPER_DRAGON: [f64; 3] = seconds([318.0, 172.0, 462.0]);
pub(super) const PAPER_TORUS: [f64; 3] = seconds([95.0, 92.0, 225.0]);
pub(super) const PAPER_BALL: [f64; 3] = seconds([77.0, 199.0, 58.0]);
pub(super) const PAPER_TEDDY: [f64; 3] = seconds([803.0, 165.0, 764.0]);

const fn seconds([a, b, c]: [f64; 3]) -> [f64; 3] {
    [1e-3 * a, 1e-3 * b, 1e-3 * c]
}

/// Runs everything whose name begins with `only`; `quick` leaves the bodies of 100 000 nodes out.
///
/// # Errors
/// A body cannot be built.
pub fn all(quick: bool, only: &str) -> Result<Report, String> {
    let mut report = Report {
        date: table::today(),
        threads: rayon::current_num_threads(),
        adapter: None,
        copy: None,
        fit: None,
        fields: None,
        lines: Vec::new(),
        left_out: Vec::new(),
    };
    let mut add = |line: Line| {
        println!("{}: {} nodes, forward {:.1} ms", line.name, line.nodes, 1e3 * line.forward.median);
        report.lines.push(line);
    };
    let wanted = |name: &str| name.starts_with(only);
    if let Some(sdf) = dragon()? {
        let model = find("neo-hookean").ok_or("there is no such material")?;
        let cases = [
            ("dragon", Case::default()),
            // Fixed numbers cost nothing: the gradient is that of the first.
            ("dragon, effects absent", Case { laws: effects(), ..Case::default() }),
            ("dragon, effects free", Case { laws: effects(), free: true, ..Case::default() }),
            ("dragon, neo-Hookean", Case { model, ..Case::default() }),
        ];
        for (name, case) in cases.into_iter().filter(|c| wanted(c.0)) {
            let line = one(name, &sdf, DRAGON_EDGE, &case)?;
            add(Line { paper: (name == "dragon").then_some(PAPER_DRAGON), ..line });
        }
    }
    // Cells over the diameter or the edge that give about 1, 3, 10, 30, 100 thousand nodes.
    let balls = [10.0, 15.5, 24.0, 36.0, 55.0];
    let blocks = [9.0, 13.0, 20.5, 30.0, 45.5];
    for k in 0..if quick { 4 } else { 5 } {
        let ball = Analytic::Ball { radius: 0.1, center: DVec3::new(0.001, 0.002, 0.103) };
        let block = Analytic::Box { min: DVec3::new(-0.1, -0.1, 0.003), max: DVec3::new(0.1, 0.1, 0.203) };
        for (kind, shape, across) in [("ball", ball, balls[k]), ("block", block, blocks[k])] {
            let name = format!("{kind} {}", SIZES[k]);
            if wanted(&name) {
                add(one(&name, &placed(shape), 0.2 / across, &Case::default())?);
            }
        }
    }
    let ball = placed(Analytic::Ball { radius: 0.1, center: DVec3::new(0.001, 0.002, 0.103) });
    for (name, edge, kind) in TETRAHEDRA.into_iter().filter(|t| wanted(t.0)) {
        let start = begin();
        let mesh = stuff(&ball, edge).map_err(|e| format!("{name}: {e}"))?;
        add(measured(name, Body::of_tets(&mesh, kind), start, &Case::default())?);
    }
    if wanted("fields") {
        let fields = fields::run()?;
        println!("{}", fields.text());
        report.fields = Some(fields);
    }
    Ok(report)
}

/// Edge of the dragon's cells [m]: its longest side is 0.3 m, the file's unit a fifth of it, with 6 cells to a unit.
pub(super) const DRAGON_EDGE: f64 = 0.3 / 5.0 / 6.0;

/// The paper's dragon; `None` without the folder of recordings.
pub(super) fn dragon() -> Result<Option<palpate_io::SdfGrid>, String> {
    let Some(file) = data().map(|d| d.join("dragon-sdf/dragon.sdf")).filter(|f| f.is_file()) else {
        println!("no dragon: set PALPATE_DATA to the folder of recordings");
        return Ok(None);
    };
    Ok(Some(palpate_io::read_sdf(&file, 0.3 / 5.0).map_err(|e| e.to_string())?.snapped()))
}

/// What a body is made of, and what the gradient is wanted by.
#[derive(Debug)]
pub(super) struct Case {
    /// Laws of effects, all of them absent.
    laws: Vec<usize>,
    /// The gradient is wanted by the effects' numbers as well.
    free: bool,
    model: &'static Model,
    /// Only so many steps.
    steps: usize,
}

impl Default for Case {
    fn default() -> Case {
        Case { laws: Vec::new(), free: false, model: &ALL[0], steps: usize::MAX }
    }
}

/// Balls of tetrahedra: name, longest edges [m], kind. About 1900 elements with 2900 nodes, and 50 000 elements as the paper has them.
const TETRAHEDRA: [(&str, f64, Tetrahedron); 2] =
    [("tet10 3k", 0.034, Tetrahedron::Quadratic), ("tet4 10k", 0.01, Tetrahedron::Linear)];
/// Names of the sizes.
const SIZES: [&str; 5] = ["1k", "3k", "10k", "30k", "100k"];

pub(super) fn placed(body: Analytic) -> Placed {
    Placed::new(body, DAffine3::IDENTITY)
}

/// Folder of the recordings: `PALPATE_DATA`, or `shared/data` beside the workspace.
pub(crate) fn data() -> Option<std::path::PathBuf> {
    let folder = std::env::var_os("PALPATE_DATA").map_or_else(|| table::root().join("../shared/data"), Into::into);
    folder.is_dir().then_some(folder)
}

/// Every effect that needs nothing but a body and a plane, and that both backends have.
fn effects() -> Vec<usize> {
    let serves = |l: &Law| !matches!(l.family, Family::Measurement) && l.asks() == Asks::Nothing;
    (0..effects::ALL.len()).filter(|k| serves(&effects::ALL[*k])).collect()
}

/// A body that is dropped from just above the ground and, where it has a band, watched in every step, with effects of these laws, all of them absent.
pub(super) fn plan(body: Body, laws: &[usize]) -> Plan {
    let layout = Layout::new(1, 0, laws, &[]);
    let steps = STEPS[usize::from(body.nodes.len() > BIG)];
    let lowest = body.nodes.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    let value = |k: &ParamKey| match k {
        ParamKey::YoungsModulus => 5e4,
        ParamKey::PoissonRatio => 0.45,
        ParamKey::Density => 1000.0,
        ParamKey::MassDamping => 0.1,
        ParamKey::StiffnessDamping => 0.01,
        ParamKey::Gravity(2) => -9.81,
        ParamKey::PlaneTheta(_) | ParamKey::PlanePhi(_) => std::f64::consts::FRAC_PI_2,
        ParamKey::PlaneHeight(_) => lowest,
        ParamKey::Effect { law, slot, .. } => Effect::absent(usize::from(*law)).value(usize::from(*slot), body.center),
        _ => 0.0,
    };
    let theta = layout.keys.iter().map(value).collect();
    // Seen from the front: patches that face the camera.
    let camera = DVec3::new(0.0, -2.0, 0.2);
    let facing: Vec<_> = body.patches.iter().filter(|p| p.normal.dot(camera - p.point) > 0.0).collect();
    let stride = facing.len().div_ceil(POINTS).max(1);
    let seen = facing.iter().step_by(stride).filter(|_| !body.band.nodes.is_empty());
    let points: Vec<ObservedPoint> = seen.map(|p| ObservedPoint { position: p.point, camera: 0 }).collect();
    let frame = |k: usize| Frame { time: 0.01 * k as f64, points: points.clone(), ..Frame::default() };
    let observation = Observation {
        cameras: vec![Camera::Pinhole { center: camera, axis: DVec3::Y }],
        frames: (1..=steps).map(frame).collect(),
        channels: vec![Channel::new(ReadingKind::Depth, 1e-3)],
        ..Observation::default()
    };
    Plan {
        fields: Vec::new(),
        followed: Vec::new(),
        moving: Vec::new(),
        driven: Vec::new(),
        frames: Default::default(),
        model: &ALL[0],
        curves: Default::default(),
        theta,
        layout,
        planes: vec![PlaneSite { polar_axis: 0, stiffness: None }],
        clamps: Vec::new(),
        masses: Default::default(),
        times: Vec::new(),
        clock: Clock { step: 0.01, steps, theta: 0.6, scheme: palpate_model::plan::scheme::theta() },
        initial: InitialShape::Rest,
        pivot: DVec3::ZERO,
        observation: Arc::new(observation),
        others: Vec::new(),
        band: BAND * body.length,
        solver: Solver::default(),
        body: Arc::new(body),
    }
}

/// Blocks of the stiffness matrix: pairs of nodes that share a cell or a ghost line.
pub(super) fn blocks(body: &Body) -> usize {
    let mut pairs = BTreeSet::new();
    let mut add = |nodes: &[u32]| nodes.iter().for_each(|a| pairs.extend(nodes.iter().map(|b| (*a, *b))));
    body.element_nodes().for_each(&mut add);
    body.ghosts().iter().for_each(|g| add(&g.nodes));
    pairs.len()
}

/// When a body was begun, and the memory in use before [bytes].
struct Start(Instant, usize);

fn begin() -> Start {
    reserve();
    PeakAlloc.reset_peak_usage();
    Start(Instant::now(), PeakAlloc.current_usage())
}

pub(super) fn one(name: &str, shape: &dyn Shape, h: f64, case: &Case) -> Result<Line, String> {
    let start = begin();
    let body = Body::build(shape, h, BAND * h, SUBDIVISIONS).map_err(|e| format!("{name}: {e}"))?;
    measured(name, body, start, case)
}

fn measured(name: &str, body: Body, Start(clock, before): Start, case: &Case) -> Result<Line, String> {
    let build = clock.elapsed().as_secs_f64();
    let mut plan = Plan { model: case.model, ..plan(body, &case.laws) };
    plan.clock.steps = plan.clock.steps.min(case.steps);
    let own = |k: &ParamKey| case.free || !matches!(k, ParamKey::Effect { .. });
    let places = (0..plan.layout.len()).filter(|p| own(&plan.layout.keys[*p])).collect();
    let request = Request { gradient: Wanted::Places(places), ..Request::default() };
    let body = &plan.body;
    let mut world = CpuBackend.build(&plan, 1).map_err(|e| e.to_string())?;
    let mut taken = Seconds::default();
    let mut failure = None;
    for _ in 0..RUNS[usize::from(body.nodes.len() > BIG)] {
        failure = there_and_back(&plan, &request, &mut world, &mut taken);
    }
    let (effort, steps) = (world.effort(0), plan.clock.steps as f64);
    let landed = lands(&plan);
    Ok(Line {
        name: name.into(),
        nodes: body.nodes.len(),
        cells: body.elements(),
        band_nodes: body.band.nodes.len(),
        build,
        forward: Times::of(taken.forward),
        cost: Times::of(taken.cost),
        adjoint: Times::of(taken.adjoint),
        steps: plan.clock.steps,
        landed,
        newton: effort.newton as f64 / steps,
        linear: effort.linear as f64 / steps,
        paper: None,
        tape: 48 * body.nodes.len(),
        matrix: 72 * blocks(body),
        peak: PeakAlloc.peak_usage().saturating_sub(before),
        failure,
        gpu: None,
    })
}

/// The step in which the body, in free flight until then, has touched the ground; `None` where it does not.
fn lands(plan: &Plan) -> Option<usize> {
    let mut rollout = Rollout::new(CpuBackend, plan, 1).ok()?;
    let mut found = None;
    let flight = |k: usize| -9.81 * 0.5 * (plan.clock.step * k as f64).powi(2);
    let end = rollout.visit(&plan.theta, |k, s, _| {
        let lowest = s.displacement.iter().map(|u| u.z).fold(f64::INFINITY, f64::min);
        let highest = s.displacement.iter().map(|u| u.z).fold(f64::NEG_INFINITY, f64::max);
        // In free flight all nodes fall alike.
        if found.is_none() && highest - lowest > 1e-3 * flight(k).abs() && k > 0 {
            found = Some(k);
        }
        ControlFlow::Continue(())
    });
    end.is_ok().then_some(found)?
}

/// Products of dense matrices reserve a gigabyte of address space per thread when they are first asked for, of which next to nothing is
/// ever touched: no body's memory.
fn reserve() {
    rayon::broadcast(|_| {
        let m = faer::Mat::<f64>::identity(64, 64);
        std::hint::black_box(&m * &m)
    });
}

/// What steps took, one by one [s].
#[derive(Default)]
struct Seconds {
    forward: Vec<f64>,
    cost: Vec<f64>,
    adjoint: Vec<f64>,
}

/// One rollout and its adjoint; says why it stopped, if it did.
fn there_and_back(plan: &Plan, request: &Request, world: &mut World, taken: &mut Seconds) -> Option<String> {
    let backend = CpuBackend;
    backend.set_params(world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let mut tally = backend.new_tally(world, request);
    let mut now = backend.new_state(world);
    backend.start(world, &mut now, &mut tally);
    let mut tape = Vec::new();
    for k in 0..plan.clock.steps {
        let mut next = backend.new_state(world);
        let clock = Instant::now();
        backend.step(world, &plan.clock.stages()[k], &[&now], &mut next, &mut tally);
        taken.forward.push(clock.elapsed().as_secs_f64());
        let clock = Instant::now();
        backend.observe(world, k, &now, &next, &mut tally);
        taken.cost.push(clock.elapsed().as_secs_f64());
        tape.push(std::mem::replace(&mut now, next));
    }
    let (mut adj, mut adj_now) = (backend.new_adjoint(world), backend.new_adjoint(world));
    let mut next = now;
    for k in (0..plan.clock.steps).rev() {
        let Some(now) = tape.pop() else { break };
        let clock = Instant::now();
        backend.observe_adjoint(world, k, &now, &next, &mut adj, &mut adj_now, &mut tally);
        backend.step_adjoint(
            world,
            &plan.clock.stages()[k],
            &[&now],
            &next,
            &adj,
            std::slice::from_mut(&mut adj_now),
            &mut tally,
        );
        taken.adjoint.push(clock.elapsed().as_secs_f64());
        std::mem::swap(&mut adj, &mut adj_now);
        backend.clear_adjoint(&mut adj_now);
        next = now;
    }
    backend.read(world, &tally).remove(0).failure.map(|f| f.to_string())
}
