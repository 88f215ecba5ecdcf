//! What Dawn, the WebGPU of Chromium, says of the kernels: whether its compiler takes them all, and whether a step that it computes is the step of
//! the CPU backend. Browsers differ from wgpu in three things that matter here: control flow around barriers must be provably uniform, a kernel
//! binds ten storage buffers, and rounding is another compiler's.

mod driver;
mod scenes;

use crate::table;
use palpate_gpu::device::pipelines::{PASSES, constant};
use palpate_gpu::device::trace::{Groups, Work};
use palpate_gpu::{Choice, Gpu, Lanes, TracedStep, Tuning, trace_step};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Differences from the CPU backend that single precision explains: displacements [m], velocities [m/s]. As the backend's own tests have them.
const CLOSE: [f64; 2] = [5e-7, 1e-4];
/// Differences of other results from those of wgpu, over the largest entry: what is promised of gradients.
const RESULTS_CLOSE: f64 = 1e-3;
/// Variants in the order of a pass's sources.
const VARIANTS: [&str; 2] = ["subgroup", "memory"];

/// What is asked.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Only whether the compiler takes the kernels.
    pub compile: bool,
}

/// Asks.
///
/// # Errors
/// A kernel is refused, a step differs, or Node.js or a driver is missing.
pub fn run(options: Options) -> Result<(), String> {
    let folder = table::root().join("target/dawn");
    prepare(&folder)?;
    let kernels: Vec<Value> = PASSES
        .iter()
        .flat_map(|p| {
            let variants = if p.lanes { &[0, 1][..] } else { &[1] };
            variants
                .iter()
                .map(|v| json!({ "name": p.name, "variant": VARIANTS[*v], "code": p.sources[*v].replace("@coherent ", "") }))
        })
        .collect();
    write(&folder.join("kernels.json"), &json!(kernels))?;
    node(&folder, "compile", &folder, None)?;
    if options.compile {
        return Ok(());
    }
    crate::test::find_adapter(true)?;
    let driver = driver::find(&folder)?;
    let gpu = Gpu::open(&Choice::from_env()).map_err(|e| e.to_string())?;
    let mut ran = vec![false; PASSES.len()];
    for (name, plan) in scenes::all()? {
        for (way, tuning) in [("one workgroup", usize::MAX), ("many workgroups", 0)] {
            println!("{name}, {way} a member");
            let traced =
                trace_step(&gpu, &plan, Tuning { many_from: tuning, product: None, crew: 0 }).map_err(|e| e.to_string())?;
            for work in traced.trace.submissions.iter().flat_map(|s| &s.work) {
                if let Work::Dispatch { pass, .. } = work {
                    ran[*pass] = true;
                }
            }
            let place = folder.join("trace");
            fs::create_dir_all(&place).map_err(|e| format!("{}: {e}", place.display()))?;
            store(&traced, usize::from(gpu.lanes() == Lanes::Memory), &place)?;
            node(&folder, "replay", &place, driver.as_deref())?;
            compare(&traced, &scenes::on_cpu(&plan)?, &place)?;
        }
    }
    println!("{} of {} kernels ran in Dawn", ran.iter().filter(|r| **r).count(), ran.len());
    Ok(())
}

/// Node's package and the script, in a folder of their own.
fn prepare(folder: &Path) -> Result<(), String> {
    fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let put = |name: &str, text: &str| fs::write(folder.join(name), text).map_err(|e| format!("{name}: {e}"));
    let package = include_str!("package.json");
    let known = fs::read_to_string(folder.join("package.json")).is_ok_and(|t| t == package);
    put("check.mjs", include_str!("check.mjs"))?;
    if known && folder.join("node_modules/webgpu").is_dir() {
        return Ok(());
    }
    put("package.json", package)?;
    let mut npm = Command::new("npm");
    npm.current_dir(folder).args(["install", "--no-audit", "--no-fund", "--ignore-scripts", "--loglevel=error"]);
    let done = npm.status().map_err(|e| format!("npm: {e}; Dawn needs Node.js with npm (Debian: nodejs, npm)"))?;
    if done.success() { Ok(()) } else { Err("npm could not install webgpu".into()) }
}

/// Times that the script may crash.
const CRASHES: usize = 3;

/// Runs the script; once more where it crashes. Whatever it computes is compared.
fn node(folder: &Path, what: &str, data: &Path, driver: Option<&Path>) -> Result<(), String> {
    for _ in 0..=CRASHES {
        let done = command(folder, what, data, driver).status().map_err(|e| format!("node: {e}"))?;
        match done.code() {
            Some(0) => return Ok(()),
            Some(_) => return Err(format!("Dawn, {what}: failed")),
            None => println!("Node.js crashed ({done}): once more"),
        }
    }
    Err(format!("Dawn, {what}: crashes"))
}

fn command(folder: &Path, what: &str, data: &Path, driver: Option<&Path>) -> Command {
    let mut command = Command::new("node");
    command.current_dir(folder).arg("check.mjs").arg(what).arg(data).env("XDG_RUNTIME_DIR", std::env::temp_dir());
    // With threads lavapipe crashes under Dawn now and then.
    command.env("LP_NUM_THREADS", "0");
    if let Some(driver) = driver {
        driver::use_it(&mut command, driver);
    }
    command
}

fn write(path: &PathBuf, value: &Value) -> Result<(), String> {
    fs::write(path, value.to_string()).map_err(|e| format!("{}: {e}", path.display()))
}

/// Numbers of the buffers with results that a list of work touches.
fn results_of(traced: &TracedStep, buffers: &[usize]) -> Vec<usize> {
    traced.results.iter().map(|r| r.1).filter(|b| buffers.contains(b)).collect()
}

/// Writes a trace for the script, with this variant of the kernels.
fn store(traced: &TracedStep, variant: usize, folder: &Path) -> Result<(), String> {
    let mut data: Vec<u8> = Vec::new();
    let mut lists = Vec::new();
    for s in &traced.trace.submissions {
        let mut starts = Vec::new();
        for bytes in &s.before {
            starts.push(data.len());
            data.extend(bytes);
        }
        let work: Vec<Value> = s
            .work
            .iter()
            .map(|w| match w {
                Work::Dispatch { pass, buffers, call, groups: Groups::All(groups) } => {
                    json!({ "pass": pass, "buffers": buffers, "call": call, "groups": groups })
                }
                Work::Dispatch { pass, buffers, call, groups: Groups::At(buffer, byte) } => {
                    json!({ "pass": pass, "buffers": buffers, "call": call, "at": [buffer, byte] })
                }
                Work::Copy([from, to], bytes) => json!({ "copy": [from.0, from.1, to.0, to.1, bytes] }),
                Work::Clear(buffer) => json!({ "clear": buffer }),
            })
            .collect();
        let results = results_of(traced, &s.buffers);
        lists.push(json!({ "buffers": s.buffers, "before": starts, "work": work, "results": results }));
    }
    let kernel = |p: &palpate_gpu::device::pipelines::PassSource| {
        let constants: serde_json::Map<String, Value> =
            p.overrides.iter().filter_map(|n| Some((n.to_string(), json!(constant(n)?)))).collect();
        json!({ "name": p.name, "code": p.sources[variant], "variant": VARIANTS[variant], "bindings": p.bindings, "constants": constants })
    };
    let kernels: Vec<Value> = PASSES.iter().map(kernel).collect();
    write(&folder.join("trace.json"), &json!({ "sizes": traced.trace.sizes, "submissions": lists, "kernels": kernels }))?;
    fs::write(folder.join("trace.bin"), data).map_err(|e| format!("trace.bin: {e}"))
}

fn floats(bytes: &[u8]) -> Vec<f64> {
    bytes.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))).collect()
}

/// Largest absolute difference.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// Compares what Dawn computed with wgpu, list by list, and the state after the step with the CPU.
fn compare(traced: &TracedStep, cpu: &scenes::Moved, folder: &Path) -> Result<(), String> {
    let replayed = fs::read(folder.join("replayed.bin")).map_err(|e| format!("replayed.bin: {e}"))?;
    let mut at = 0;
    let (mut state, mut worst) = (Vec::new(), (0.0, ""));
    for s in &traced.trace.submissions {
        for buffer in results_of(traced, &s.buffers) {
            let size = traced.trace.sizes[buffer] as usize;
            let found = floats(replayed.get(at..at + size).ok_or("replayed.bin is too short")?);
            at += size;
            let place = s.buffers.iter().position(|b| *b == buffer).unwrap_or_default();
            let right = floats(&s.after[place]);
            let name = traced.results.iter().find(|r| r.1 == buffer).map_or("", |r| r.0);
            if name == "state" {
                state.clone_from(&found);
                continue;
            }
            let size = right.iter().map(|v| v.abs()).fold(0.0, f64::max);
            let off = apart(&found, &right) / size.max(f64::MIN_POSITIVE);
            if off > worst.0 {
                worst = (off, name);
            }
        }
    }
    let count = cpu.u.len();
    let part = |k: usize| -> Vec<f64> {
        state[4 * k * count..4 * (k + 1) * count].chunks_exact(4).flat_map(|v| v[..3].to_vec()).collect()
    };
    let u: Vec<f64> = part(0).iter().zip(part(1)).map(|(a, b)| a + b).collect();
    let off = [apart(&u, &cpu.u.concat()), apart(&part(2), &cpu.v.concat())];
    println!(
        "  from the CPU: {:.1e} m of {:.1e}, {:.1e} m/s of {:.1e}; other results from wgpu: {:.1e} ({})",
        off[0], cpu.way, off[1], cpu.speed, worst.0, worst.1
    );
    if off[0] > CLOSE[0] || off[1] > CLOSE[1] || !off[0].is_finite() || !off[1].is_finite() {
        return Err(format!("Dawn's step is not the CPU's: {off:?}, allowed are {CLOSE:?}"));
    }
    if worst.0 > RESULTS_CLOSE {
        return Err(format!("{}: Dawn and wgpu differ by {:.1e}, allowed is {RESULTS_CLOSE:.0e}", worst.1, worst.0));
    }
    Ok(())
}
