//! Time of a step of the GPU backend beside the CPU's: batches, passes by the device's own clock, traffic of conjugate gradients.

use super::counting;
use super::model::{Counts, H100, Modelled};
use super::report::{Line, Report, Times};
use super::{BAND, Case, DRAGON_EDGE, PAPER_BALL, PAPER_DRAGON, PAPER_TORUS, blocks, dragon, one, placed, plan};
use crate::table;
use glam::DVec3;
use palpate_engine::{Backend, Direction, ParamBatch, Request, Wanted};
use palpate_gpu::{Choice, Gpu, GpuBackend, World};
use palpate_model::cutcells::build::SUBDIVISIONS;
use palpate_model::plan::Plan;
use palpate_model::plan::scheme::Stage;
use palpate_model::scene::Analytic;
use palpate_model::shape::Shape;
use palpate_model::space::body::Body;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Instant;

/// Simulations that run together.
const BATCHES: [usize; 3] = [1, 8, 64];
/// Fewest steps that are timed where there is time for a whole one: the paper's bodies land in the fourth.
const STEPS: usize = 5;
/// How the time of a step grows with nodes: iterations of conjugate gradients grow as bodies do.
const GROWTH: f64 = 4.0 / 3.0;
/// Derivatives by parameters that are timed together.
const COLUMNS: usize = 8;
/// Passes that are printed.
const SHOWN: usize = 8;

/// Time and traffic of some work of a whole batch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Traffic {
    /// Time [s].
    pub seconds: f64,
    /// Numbers read and written, each once [bytes].
    pub bytes: f64,
    /// Bandwidth over that of a copy.
    pub share: f64,
}

impl Traffic {
    fn new(t: palpate_gpu::Traffic, copy: f64) -> Traffic {
        Traffic { seconds: t.seconds, bytes: t.bytes, share: t.bytes / t.seconds / copy }
    }

    fn text(&self) -> String {
        let (megabytes, gigabytes) = (self.bytes / 1e6, self.bytes / self.seconds / 1e9);
        format!("{megabytes:.2} MB in {:.3} ms, {gigabytes:.1} GB/s = {:.0} % of a copy", 1e3 * self.seconds, 100.0 * self.share)
    }
}

/// What only a graphics device has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Device {
    /// Simulations that ran together.
    pub batch: usize,
    /// Times faster than the CPU's, of the same steps of one member: forward, cost, adjoint.
    pub over_cpu: [f64; 3],
    /// The CPU's times of the same steps. (Files of earlier versions compared with other steps.)
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cpu: Option<[Times; 3]>,
    /// What the same steps come to with many workgroups a member, as a graphics processor runs large bodies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub counts: Option<Counts>,
    /// What the model of a graphics processor makes of that: an H100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub modelled: Option<Modelled>,
    /// Seconds of a step's derivative by one parameter, of one member: by itself, and as one of eight that are computed together. (Files
    /// of earlier versions lack it.)
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub columns: Option<[f64; 2]>,
    /// How conjugate gradients multiply, and with how many workgroups a member.
    pub product: String,
    /// A whole iteration of conjugate gradients, as steps run it. (Files of earlier versions lack it.)
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub iteration: Option<Traffic>,
    /// Both products by themselves, where many workgroups share a solve.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub products: Vec<(String, Traffic)>,
    /// Passes of one step forward and back: name, dispatches, milliseconds on the device; the longest first.
    pub passes: Vec<(String, u64, f64)>,
}

impl Device {
    /// Prints what the table has no room for.
    pub fn print(&self, name: &str) {
        let [f, c, a] = self.over_cpu.map(|x| format!("{x:.2}"));
        println!("  {name}: times faster than the CPU: forward {f}, cost {c}, adjoint {a}");
        if let (Some(c), Some(m)) = (&self.counts, &self.modelled) {
            println!(
                "    of {} steps, each: {:.1} Newton, {:.0} CG, {:.0} CG for the adjoint, {:.0} dispatches recorded, {:.0} live, {:.2} ms of the host, \
                 {:.1} MB",
                c.steps,
                c.newton,
                c.linear,
                c.adjoint,
                c.recorded,
                c.live,
                1e3 * c.host,
                1e-6 * c.bytes
            );
            println!(
                "    model of an {}: {:.2} ms a step on the device, {:.2} ms of its host; {:.3} ms a member",
                H100.name,
                1e3 * m.device,
                1e3 * m.host,
                1e3 * m.device.max(m.host) / self.batch as f64
            );
        }
        if let Some([alone, together]) = self.columns.map(|c| c.map(|s| 1e3 * s)) {
            println!("    derivative by a parameter: {alone:.2} ms alone, {together:.2} ms as one of {COLUMNS}");
        }
        if let Some(t) = &self.iteration {
            println!("    iteration of CG ({}): {}", self.product, t.text());
        }
        self.products.iter().for_each(|(name, t)| println!("    product {name}: {}", t.text()));
        let shown: Vec<String> = self.passes.iter().take(SHOWN).map(|(p, n, ms)| format!("{p} {ms:.2} ({n}×)")).collect();
        if !shown.is_empty() {
            println!("    passes of a step and its adjoint [ms]: {}", shown.join(", "));
        }
    }
}

/// A body by name, with the edge of its cells and its Young's modulus.
struct Subject {
    name: &'static str,
    shape: Box<dyn Shape>,
    h: f64,
    /// The paper's seconds for such a body.
    paper: Option<[f64; 3]>,
}

fn subjects(quick: bool) -> Result<Vec<Subject>, String> {
    let center = DVec3::new(0.001, 0.002, 0.103);
    let torus = Analytic::Torus { major: 0.08, minor: 0.03, center, axis: DVec3::Z };
    let ball = Analytic::Ball { radius: 0.1, center };
    let of = |name, body, across: f64| Subject { name, shape: Box::new(placed(body)), h: 0.2 / across, paper: None };
    let like = |paper, subject| Subject { paper: Some(paper), ..subject };
    if quick {
        return Ok(vec![of("torus", torus, 9.0), of("ball", ball, 6.0)]);
    }
    // Cells across that give about as many nodes as the paper's bodies have: 1138 and 770.
    let mut all = vec![like(PAPER_TORUS, of("torus", torus, 13.0)), like(PAPER_BALL, of("ball", ball.clone(), 8.6))];
    if let Some(sdf) = dragon()? {
        all.push(Subject { name: "dragon", shape: Box::new(sdf), h: DRAGON_EDGE, paper: Some(PAPER_DRAGON) });
    }
    let balls = [("ball 1k", 10.0), ("ball 10k", 24.0), ("ball 30k", 36.0), ("ball 100k", 55.0)];
    all.extend(balls.map(|(name, across)| of(name, ball.clone(), across)));
    Ok(all)
}

/// Every body whose name begins with `only`, on the CPU and in batches on the device; none that would take more than `patience` seconds.
///
/// # Errors
/// There is no device, or a body cannot be built.
pub fn all(quick: bool, only: &str, patience: f64) -> Result<Report, String> {
    let gpu = Gpu::open_for(&Choice::from_env(), None, palpate::host()).map_err(|e| format!("{e} (hint: {})", e.hint()))?;
    let copy = gpu.copy_bandwidth().map_err(|e| e.to_string())?;
    println!("{}: copies {:.1} GB/s", gpu.name, copy / 1e9);
    let mut report = Report {
        date: table::today(),
        threads: rayon::current_num_threads(),
        adapter: Some(gpu.name.clone()),
        copy: Some(copy),
        fit: None,
        fields: None,
        lines: Vec::new(),
        left_out: Vec::new(),
    };
    compile(&gpu)?;
    let mut longest: Option<Longest> = None;
    for s in subjects(quick)?.into_iter().filter(|s| s.name.starts_with(only)) {
        let mut cpu = one(s.name, &*s.shape, s.h, &Case::default())?;
        cpu.paper = s.paper;
        println!("{}: {} nodes, CPU forward {:.1} ms", s.name, cpu.nodes, 1e3 * cpu.forward.median);
        let body = Body::build(&*s.shape, s.h, BAND * s.h, SUBDIVISIONS).map_err(|e| format!("{}: {e}", s.name))?;
        let plan = plan(body, &[]);
        report.lines.push(cpu.clone());
        for batch in BATCHES.into_iter().filter(|b| !quick || *b < 64) {
            // Software adapters take as many times longer as there are members.
            let expected = longest.map_or(0.0, |l| l.expects(cpu.nodes, batch));
            if expected > patience {
                let why = format!("{} × {batch}: a step would take some {expected:.0} s; --patience allows more", s.name);
                println!("  left out: {why}");
                report.left_out.push(why);
                continue;
            }
            let same = |steps| {
                if steps == cpu.steps { Ok(cpu.clone()) } else { one(s.name, &*s.shape, s.h, &Case { steps, ..Case::default() }) }
            };
            match on_device(&gpu, copy, &plan, batch, &same, patience) {
                Ok((line, seconds)) => {
                    println!("  {}: forward {:.2} ms a member", line.name, 1e3 * line.forward.median);
                    longest = longest.filter(|l| l.seconds > seconds).or(Some(Longest { nodes: cpu.nodes, batch, seconds }));
                    report.lines.push(line);
                }
                // Too large for the device is an answer as well.
                Err(e) => {
                    println!("  {} × {batch}: {e}", s.name);
                    report.left_out.push(format!("{} × {batch}: {e}", s.name));
                }
            }
        }
    }
    Ok(report)
}

/// Has the driver compile the kernels: the first step of all would count it.
fn compile(gpu: &Arc<Gpu>) -> Result<(), String> {
    let ball = placed(Analytic::Ball { radius: 0.1, center: DVec3::new(0.0, 0.0, 0.103) });
    let body = Body::build(&ball, 0.07, BAND * 0.07, SUBDIVISIONS).map_err(|e| e.to_string())?;
    let mut plan = plan(body, &[]);
    plan.clock.steps = 1;
    let backend = GpuBackend::on(gpu.clone());
    let mut world = backend.build(&plan, 1).map_err(|e| e.to_string())?;
    backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    settled(&backend, &mut world, &plan.clock.stages()[..1], &[1]).map(|_| ())
}

/// The longest step there and back so far: what larger ones will take.
#[derive(Clone, Copy, Debug)]
struct Longest {
    nodes: usize,
    batch: usize,
    seconds: f64,
}

impl Longest {
    fn expects(&self, nodes: usize, batch: usize) -> f64 {
        self.seconds * batch as f64 / self.batch as f64 * (nodes as f64 / self.nodes as f64).powf(GROWTH)
    }
}

/// Seconds of forward, cost and adjoint of every step, and bytes of the device.
pub(super) struct Run {
    seconds: [Vec<f64>; 3],
    /// The same of derivatives, for every number of them that were computed together.
    columns: Vec<Vec<f64>>,
    failure: Option<String>,
    /// Seconds in which the host recorded a step.
    pub(super) recording: Vec<f64>,
}

fn run(backend: &GpuBackend, world: &mut World, stages: &[Stage], together: &[usize]) -> Result<Run, String> {
    let steps = stages.len();
    let wait = || backend.gpu().wait().map_err(|e| e.to_string());
    let mut seconds = [Vec::new(), Vec::new(), Vec::new()];
    let mut recording = Vec::new();
    let request = Request { gradient: Wanted::All, ..Request::default() };
    let mut tally = backend.new_tally(world, &request);
    let mut tape = vec![backend.new_state(world)];
    backend.start(world, &mut tape[0], &mut tally);
    wait()?;
    for k in 0..steps {
        let mut next = backend.new_state(world);
        let clock = Instant::now();
        backend.step(world, &stages[k], &[&tape[k]], &mut next, &mut tally);
        recording.push(clock.elapsed().as_secs_f64());
        wait()?;
        seconds[0].push(clock.elapsed().as_secs_f64());
        let clock = Instant::now();
        backend.observe(world, k, &tape[k], &next, &mut tally);
        wait()?;
        seconds[1].push(clock.elapsed().as_secs_f64());
        tape.push(next);
    }
    let mut columns = vec![Vec::new(); together.len()];
    for (&count, seconds) in together.iter().zip(&mut columns) {
        let directions: Vec<usize> = (0..count).collect();
        let [mut old, mut new] = [0; 2].map(|_| backend.new_tangent(world, &Direction::parameters(&directions)));
        backend.start_tangent(world, &tape[0], &mut old, &mut tally);
        wait()?;
        for k in 0..steps {
            let clock = Instant::now();
            backend.step_tangent(world, &stages[k], &[&tape[k]], &tape[k + 1], &[&old], &mut new, &mut tally);
            wait()?;
            seconds.push(clock.elapsed().as_secs_f64() / count as f64);
            std::mem::swap(&mut old, &mut new);
        }
    }
    let (mut adj, mut adj_now) = (backend.new_adjoint(world), backend.new_adjoint(world));
    wait()?;
    for k in (0..steps).rev() {
        let clock = Instant::now();
        backend.observe_adjoint(world, k, &tape[k], &tape[k + 1], &mut adj, &mut adj_now, &mut tally);
        backend.step_adjoint(world, &stages[k], &[&tape[k]], &tape[k + 1], &adj, std::slice::from_mut(&mut adj_now), &mut tally);
        wait()?;
        seconds[2].push(clock.elapsed().as_secs_f64());
        std::mem::swap(&mut adj, &mut adj_now);
        backend.clear_adjoint(&mut adj_now);
    }
    let failure = backend.read(world, &tally).into_iter().find_map(|e| e.failure).map(|f| f.to_string());
    Ok(Run { seconds, columns, failure, recording })
}

/// The run that has what its members need.
pub(super) fn settled(backend: &GpuBackend, world: &mut World, stages: &[Stage], together: &[usize]) -> Result<Run, String> {
    backend.rollout(world, false, |world| run(backend, world, stages, together))
}

/// One line of the report, and the seconds of a step there and back.
fn on_device(
    gpu: &Arc<Gpu>,
    copy: f64,
    plan: &Plan,
    batch: usize,
    of_cpu: &dyn Fn(usize) -> Result<Line, String>,
    patience: f64,
) -> Result<(Line, f64), String> {
    let backend = GpuBackend::on(gpu.clone());
    let before = gpu.made();
    let clock = Instant::now();
    let mut world = backend.build(plan, batch).map_err(|e| e.to_string())?;
    let build = clock.elapsed().as_secs_f64();
    let rows = counting::members(plan, batch);
    backend.set_params(&mut world, &ParamBatch::from_rows(&rows));
    // With the clock of the passes, a second time where the first one compiled some of them; then as fits run, as often as there is time.
    let clock = Instant::now();
    let once = |world: &mut World| {
        world.time_passes(true);
        let run = settled(&backend, world, &plan.clock.stages()[..1], &[])?;
        let passes = world.pass_times().into_iter().map(|(name, t)| (name.to_string(), t.count, 1e-6 * t.nanoseconds)).collect();
        world.time_passes(false);
        let step = run.seconds.iter().flatten().sum();
        Ok::<_, String>((run, step, passes))
    };
    let (mut run, mut step, mut passes) = once(&mut world)?;
    if 4.0 * clock.elapsed().as_secs_f64() < patience {
        (run, step, passes) = once(&mut world)?;
    }
    let times = ((patience - clock.elapsed().as_secs_f64()) / step) as usize;
    // A derivative takes about as long as an adjoint.
    let both: &[usize] = if times > 2 * COLUMNS { &[1, COLUMNS] } else { &[] };
    let mut steps = 1;
    if times > 0 {
        steps = (times / if both.is_empty() { 1 } else { 2 + COLUMNS }).clamp(STEPS, plan.clock.steps);
        run = settled(&backend, &mut world, &plan.clock.stages()[..steps], both)?;
    }
    let speed = world.cg_speed().map_err(|e| e.to_string())?;
    let of_member = |s: Vec<f64>| Times::of(s.into_iter().map(|x| x / batch as f64).collect());
    let [forward, cost, adjoint] = run.seconds.map(of_member);
    let columns: Vec<f64> = run.columns.into_iter().map(|s| of_member(s).median).collect();
    let ratio = |a: &Times, b: &Times| a.median / b.median.max(1e-12);
    let cpu = of_cpu(steps)?;
    let counts = counting::count(gpu, plan, &rows, steps, counting::Ways::Settled, false)?;
    let line = Line {
        name: format!("gpu {} × {batch}", cpu.name),
        build,
        forward,
        cost,
        adjoint,
        tape: 48 * plan.body.nodes.len(),
        matrix: 36 * blocks(&plan.body),
        newton: counts.newton,
        linear: counts.linear,
        peak: (gpu.made() - before) as usize,
        failure: run.failure,
        gpu: Some(Device {
            batch,
            over_cpu: [ratio(&cpu.forward, &forward), ratio(&cpu.cost, &cost), ratio(&cpu.adjoint, &adjoint)],
            cpu: Some([cpu.forward, cpu.cost, cpu.adjoint]),
            counts: Some(counts),
            modelled: Some(H100.step(&counts)),
            columns: columns.try_into().ok(),
            product: format!("{}, {}", speed.product.name(), if speed.many { "many workgroups" } else { "one workgroup" }),
            iteration: Some(Traffic::new(speed.iteration, copy)),
            products: speed.products.iter().map(|(p, t)| (p.name().to_string(), Traffic::new(*t, copy))).collect(),
            passes,
        }),
        ..cpu.clone()
    };
    Ok((line, step))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_larger_bodies_and_batches_take_follows_from_the_longest_so_far() {
        // On lavapipe a torus of 1301 nodes in a batch of 64 took 19.3 s a step, and a ball of 10 251 nodes 4.8 s.
        let longest = Longest { nodes: 1301, batch: 64, seconds: 19.3 };
        assert!((longest.expects(10_251, 1) / 4.8).ln().abs() < 0.2, "{}", longest.expects(10_251, 1));
        assert_eq!(longest.expects(1301, 8), 19.3 / 8.0);
    }
}
