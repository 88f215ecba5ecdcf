//! What steps come to on a graphics processor, beside what they take on the CPU: iterations, dispatches, bytes. Nothing is timed but the host's
//! recording, so a software adapter and a busy machine count as well as any. Rows are kept in `bench/counts.json`.

use super::counting::{self, Ways};
use super::model::{Counts, H100, Modelled};
use super::{BAND, DRAGON_EDGE, Seconds, dragon, placed, plan, there_and_back};
use crate::paper::scenes::body as scene_of;
use crate::real::report::Made;
use crate::table;
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::{Backend, Request, Wanted};
use palpate_gpu::{Choice, Gpu};
use palpate_model::cutcells::build::SUBDIVISIONS;
use palpate_model::observation::Observation;
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::{Analytic, BodySource, Clamp, LinearSolver, Scene};
use palpate_model::shape::{MeshShape, Shape};
use palpate_model::space::body::Body;
use palpate_model::space::stuffing::stuff;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;

/// Steps that are counted: the bodies land in the third or fourth. Of large bodies as many as reach the ground.
const STEPS: [usize; 2] = [5, 4];
/// Beyond so many nodes [`STEPS`] are fewer, and the first rollout is counted, which nobody has told how many dispatches it needs.
const BIG: usize = 20_000;

/// A workload, and what its steps come to on average.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Its name.
    pub name: String,
    /// Day of the count.
    pub date: String,
    /// Commit that was counted.
    pub commit: String,
    /// Nodes of the body.
    pub nodes: usize,
    /// Members of the batch.
    pub batch: usize,
    /// The device's.
    pub gpu: Counts,
    /// The CPU's iterations of the same steps: Newton's, of conjugate gradients with two levels, of those for the adjoint.
    pub cpu: [f64; 3],
    /// What the model makes of the device's.
    pub modelled: Modelled,
}

impl Row {
    fn cells(&self) -> Vec<String> {
        let (g, [newton, linear, adjoint]) = (&self.gpu, self.cpu);
        let ratio = |gpu: f64, cpu: f64| if cpu > 0.0 { format!("{:.2}", gpu / cpu) } else { "direct".into() };
        let known = |x: f64, digits: usize| if x > 0.0 { format!("{x:.digits$}") } else { "–".into() };
        vec![
            self.name.clone(),
            self.nodes.to_string(),
            self.batch.to_string(),
            g.steps.to_string(),
            format!("{:.1} / {newton:.1}", g.newton),
            format!("{:.0} / {linear:.0}", g.linear),
            ratio(g.linear, linear),
            format!("{:.0} / {adjoint:.0}", g.adjoint),
            ratio(g.adjoint, adjoint),
            known(g.recorded, 0),
            format!("{:.0}", g.live),
            known(1e3 * g.host, 2),
            format!("{:.0}", 1e-6 * g.bytes / self.batch as f64),
            format!("{:.2}", 1e3 * self.modelled.device.max(self.modelled.host) / self.batch as f64),
        ]
    }
}

/// A body and what happens to it.
struct Subject {
    name: &'static str,
    batch: usize,
    /// Its workgroups stay for all iterations of a solve.
    stays: bool,
    make: Box<dyn Fn() -> Result<Plan, String>>,
}

fn dropped(shape: &dyn Shape, h: f64) -> Result<Plan, String> {
    let body = Body::build(shape, h, BAND * h, SUBDIVISIONS).map_err(|e| e.to_string())?;
    Ok(plan(body, &[]))
}

fn the_dragon() -> Result<palpate_io::SdfGrid, String> {
    dragon()?.ok_or_else(|| "it is not there".into())
}

/// What is clamped in a scene, watched as other bodies are, far above the ground.
fn clamped(scene: &Scene) -> Result<Plan, String> {
    let made = build_plan(scene, Observation::default(), &[]).map_err(|e| e.to_string())?;
    let mut plan = Plan { clamps: made.clamps, ..plan((*made.body).clone(), &[]) };
    plan.theta[plan.layout.index(ParamKey::PlaneHeight(0))] -= 1.0;
    Ok(plan)
}

/// The dragon, held by its lowest tenth, bends under its weight: the distances as a mesh, for a clamp is cut out of a scene's shape.
fn clamped_dragon() -> Result<Plan, String> {
    let sdf = the_dragon()?;
    let surface = stuff(&sdf, 0.004).map_err(|e| e.to_string())?.surface();
    let (low, high) = sdf.bounds();
    let mut scene = scene_of(Analytic::Ball { radius: 0.1, center: DVec3::ZERO }, 0.01, 5e4);
    scene.object.source = BodySource::Mesh { path: "dragon".into(), shape: Arc::new(MeshShape::new(surface)), open_edges: 0 };
    let top = DVec3::new(high.x, high.y, low.z + 0.1 * (high.z - low.z));
    scene.clamps = vec![Clamp::still(low - DVec3::ONE, top + DVec3::new(1.0, 1.0, 0.0))];
    clamped(&scene)
}

/// A slender beam, held at one end, bends under its weight.
fn beam() -> Result<Plan, String> {
    let long = Analytic::Box { min: DVec3::ZERO, max: DVec3::new(0.4, 0.03, 0.03) };
    let mut scene = scene_of(long, 0.01, 2e5);
    scene.clamps = vec![Clamp::still(DVec3::splat(-1.0), DVec3::new(0.011, 1.0, 1.0))];
    clamped(&scene)
}

fn subjects() -> Vec<Subject> {
    let center = DVec3::new(0.001, 0.002, 0.103);
    let ball = move |across: f64| move || dropped(&placed(Analytic::Ball { radius: 0.1, center }), 0.2 / across);
    let torus = move || dropped(&placed(Analytic::Torus { major: 0.08, minor: 0.03, center, axis: DVec3::Z }), 0.2 / 13.0);
    let whole = || dropped(&the_dragon()?, DRAGON_EDGE);
    let of = |name, batch, make: Box<dyn Fn() -> Result<Plan, String>>| Subject { name, batch, stays: false, make };
    vec![
        of("torus", 1, Box::new(torus)),
        of("ball", 1, Box::new(ball(8.6))),
        of("dragon", 1, Box::new(whole)),
        Subject { stays: true, ..of("dragon, staying", 1, Box::new(whole)) },
        // With 64 a software adapter has no room for the blocks of their matrices in one binding.
        of("dragon × 60", 60, Box::new(whole)),
        of("dragon clamped", 1, Box::new(clamped_dragon)),
        of("beam clamped", 1, Box::new(beam)),
        of("ball 10k", 1, Box::new(ball(24.0))),
        of("ball 30k", 1, Box::new(ball(36.0))),
        of("ball 100k", 1, Box::new(ball(55.0))),
    ]
}

/// Counts the workload of a name, or all but the dragon's batch and the largest ball, which a software adapter takes long
/// for; the others' rows stay.
///
/// # Errors
/// There is no device, or a body cannot be built.
pub fn run(only: Option<&str>) -> Result<(), String> {
    let gpu = Gpu::open(&Choice::from_env()).map_err(|e| format!("{e} (hint: {})", e.hint()))?;
    let mut rows = stored(&table::root())?;
    let made = Made::now()?;
    let long = |name: &str| matches!(name, "dragon × 60" | "ball 100k");
    for s in subjects() {
        if !only.map_or(!long(s.name), |o| s.name == o) {
            continue;
        }
        let mut plan = (s.make)().map_err(|e| format!("{}: {e}", s.name))?;
        let nodes = plan.body.nodes.len();
        let big = nodes > BIG;
        plan.clock.steps = STEPS[usize::from(big)];
        let members = counting::members(&plan, s.batch);
        let ways = if big { Ways::Once } else { Ways::Settled };
        let counts = counting::count(&gpu, &plan, &members, plan.clock.steps, ways, s.stays)?;
        let row = Row {
            name: s.name.into(),
            date: made.date.clone(),
            commit: made.commit.clone(),
            nodes,
            batch: s.batch,
            gpu: counts,
            cpu: of_cpu(&plan)?,
            modelled: H100.step(&counts),
        };
        print(std::slice::from_ref(&row));
        rows.retain(|r| r.name != row.name);
        rows.push(row);
        table::save("counts", &rows)?;
    }
    table::replace("docs/gpu.md", "counts", &markdown(&rows))?;
    print(&rows);
    Ok(())
}

/// The CPU's iterations of a step of the plan's own numbers.
fn of_cpu(plan: &Plan) -> Result<[f64; 3], String> {
    // By factors it would need none.
    let mut plan = plan.clone();
    plan.solver.linear = LinearSolver::ConjugateGradient;
    let plan = &plan;
    let mut world = CpuBackend.build(plan, 1).map_err(|e| e.to_string())?;
    let request = Request { gradient: Wanted::All, ..Request::default() };
    if let Some(why) = there_and_back(plan, &request, &mut world, &mut Seconds::default()) {
        return Err(why);
    }
    let e = world.effort(0);
    Ok([e.newton, e.linear, e.adjoint].map(|n| n as f64 / plan.clock.steps as f64))
}

/// Heading of the table.
const HEADING: [&str; 14] = [
    "workload",
    "nodes",
    "members",
    "steps",
    "Newton GPU/CPU",
    "CG",
    "ratio",
    "adjoint CG",
    "ratio",
    "recorded",
    "live",
    "host ms",
    "MB a member",
    "H100 ms a member",
];

/// The rows as a table of a page.
pub fn markdown(rows: &[Row]) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let mut text = line(&HEADING.map(String::from));
    text += &line(&HEADING.map(|_| "---".to_string()));
    rows.iter().for_each(|r| text += &line(&r.cells()));
    text
}

/// What is counted and stored.
///
/// # Errors
/// The file is there and holds something else.
pub fn stored(root: &Path) -> Result<Vec<Row>, String> {
    table::stored(root, "counts")
}

fn print(rows: &[Row]) {
    let mut all = vec![HEADING.map(String::from).to_vec()];
    all.extend(rows.iter().map(Row::cells));
    table::print("a step on the device (many workgroups a member) beside the CPU's", &all);
}
