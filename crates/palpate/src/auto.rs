//! What `auto` takes: both backends compute the first steps of the scene at hand, with what will be asked of them, and the faster one is remembered.

use crate::engine::Backend;
use crate::memory::Demand;
use palpate_cpu::CpuBackend;
use palpate_engine::{Backend as _, Evaluate as _, ParamBatch, Request, Rollout};
use palpate_gpu::GpuBackend;
use palpate_model::observation::Frame;
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use std::sync::Arc;
use std::time::Instant;

/// Fewest steps that are timed; of small bodies as many as the CPU takes in this time [s], which bodies that start near the ground land in.
const STEPS: usize = 2;
const TRIAL: f64 = 0.3;
/// Members that the CPU is timed with, for each of its threads: more take as many times longer.
const PER_THREAD: usize = 2;
/// Members that a software adapter is timed with, likewise.
const ON_SOFTWARE: usize = 2;
/// A graphics processor must be this much faster, so that chance does not decide between equals: which one runs decides the last bits of a
/// result.
const CLEARLY: f64 = 0.8;

/// The first steps of a plan, with as many frames a step as the whole has where they are compared; the first ones, in which the body is
/// where it starts.
fn trial(plan: &Plan, steps: usize, compared: bool) -> Plan {
    let (start, dt, all) = (plan.theta[plan.layout.index(ParamKey::TimeStart)], plan.clock.step, plan.clock.steps);
    let mut short = plan.clone();
    short.clock.steps = all.min(steps);
    short.times.truncate(short.clock.steps + 1);
    let mut seen = plan.observation.without_frames();
    if compared {
        let frames = &plan.observation.frames;
        let count = (frames.len() * short.clock.steps).div_ceil(all.max(1));
        let count = if all == 0 { frames.len() } else { count };
        let time = |k: usize| start + (k as f64 + 0.5) / count as f64 * short.clock.steps as f64 * dt;
        seen.frames = frames.iter().take(count).enumerate().map(|(k, f)| Frame { time: time(k), ..f.clone() }).collect();
    }
    Plan { observation: Arc::new(seen), others: Vec::new(), ..short }
}

/// Seconds of a step of such a trial with what is asked of it, for `members` simulations, so many at once, or why there are none; the
/// first round warms up.
fn time_step<B: palpate_engine::Backend>(backend: B, plan: &Plan, request: &Request, members: [usize; 2]) -> Result<f64, String> {
    let [members, at_once] = members;
    let rows = ParamBatch::from_rows(&vec![plan.theta.clone(); members]);
    let mut rollout = Rollout::new(backend, plan, at_once).map_err(|e| e.message)?;
    rollout.evaluate(&rows, request);
    let clock = Instant::now();
    let done = rollout.evaluate(&rows, request);
    let seconds = clock.elapsed().as_secs_f64() / plan.clock.steps.max(1) as f64;
    match done.into_iter().find_map(|e| e.failure) {
        None => Ok(seconds),
        // The way out is taken here.
        Some(f) => Err(f.message()),
    }
}

/// Times of a step on the CPU and on the device [s].
fn measure(device: &GpuBackend, plan: &Plan, demand: &Demand, hear: &mut dyn FnMut(&str)) -> Result<[f64; 2], String> {
    let (request, members) = (demand.request(), demand.starts);
    let of = |count: usize| Demand { starts: count, ..demand.clone() };
    // Beyond some members both take as many times longer.
    let few = members.min(PER_THREAD * rayon::current_num_threads());
    let failed = |why: String| format!("the first steps fail on the CPU: {why}");
    let on_cpu = |plan: &Plan| time_step(CpuBackend, plan, &request, [few, of(few).on_cpu(plan, 0).0]).map_err(failed);
    hear("auto: timing the first steps on the CPU");
    let shortest = trial(plan, STEPS, demand.compared);
    let mut cpu = on_cpu(&shortest)?;
    let steps = ((TRIAL / cpu.max(1e-9)) as usize).clamp(STEPS, plan.clock.steps.max(STEPS));
    let short = if steps > STEPS { trial(plan, steps, demand.compared) } else { shortest };
    if steps > STEPS {
        cpu = on_cpu(&short)?;
    }
    let some = if device.gpu().is_software() { members.min(ON_SOFTWARE) } else { members };
    hear(&format!("auto: timing the first steps on {}", device.gpu().name));
    let at_once = of(some).on_device(plan, device.gpu().largest_buffer()).map_or(1, |d| d.0);
    let gpu = time_step(device.clone(), &short, &request, [some, at_once]);
    let gpu = gpu.map_err(|why| format!("{} cannot compute this body: {why}", device.name()))?;
    Ok([cpu * members as f64 / few as f64, gpu * members as f64 / some as f64])
}

/// What a measurement holds for: device and driver, threads, body, and what is asked.
fn key(device: &GpuBackend, plan: &Plan, demand: &Demand) -> String {
    let gpu = device.gpu();
    let (nodes, elements, planes) = (plan.body.nodes.len(), plan.body.elements(), plan.planes.len());
    let body = format!("{nodes} nodes, {elements} elements, {planes} planes, {} parameters", plan.layout.len());
    let time = format!("{} steps of {} s", plan.clock.steps, plan.clock.step);
    let asked = format!("{} of {} members", demand.step(), demand.starts);
    let threads = rayon::current_num_threads();
    format!("{} {}, {threads} threads: {body}, {time}, {asked}", gpu.name, gpu.driver).replace(char::is_control, " ")
}

/// The backend for a plan, and the reason; `hear` is told what takes time.
pub(crate) fn choose(device: GpuBackend, plan: &Plan, demand: &Demand, hear: &mut dyn FnMut(&str)) -> (Backend, String) {
    let (key, name, what) = (key(&device, plan, demand), device.name(), demand.step());
    let read = |text: &str| -> Option<[f64; 2]> {
        let (cpu, gpu) = text.split_once(' ')?;
        Some([cpu.parse().ok()?, gpu.parse().ok()?])
    };
    let known = device.gpu().host().written(&key).and_then(|text| read(&text));
    let [cpu, gpu] = match known.map_or_else(|| measure(&device, plan, demand, hear), Ok) {
        Ok(times) if known.is_none() => {
            read(&device.gpu().host().write(&key, &format!("{} {}", times[0], times[1]))).unwrap_or(times)
        }
        Ok(times) => times,
        Err(why) => return (Backend::Cpu, why),
    };
    let ms = |s: f64| format!("{:.2} ms", s * 1e3);
    let before = if known.is_some() { ", as measured before" } else { "" };
    if gpu < CLEARLY * cpu {
        return (Backend::Gpu, format!("{what} takes {} on {name}, {} on the CPU{before}", ms(gpu), ms(cpu)));
    }
    let software = if device.gpu().is_software() {
        format!(", a software adapter and {:.0} times slower", gpu / cpu)
    } else {
        String::new()
    };
    (Backend::Cpu, format!("{what} takes {}, {} on {name}{software}{before}", ms(cpu), ms(gpu)))
}
