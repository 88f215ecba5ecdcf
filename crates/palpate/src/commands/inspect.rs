//! `palpate inspect`: what would be simulated and fitted, and what looks wrong.

use crate::catalogue;
use crate::cli::Console;
use crate::commands::devices;
use crate::error::Error;
use crate::experiment::{Experiment, short};
use crate::fitting::{self, free_parameters};
use crate::memory::{Demand, adapter};
use clap::Args;
use palpate_gpu::AdapterReport;
use palpate_io::recording::{Recording, read_recording};
use palpate_model::plan::Physics;
use palpate_model::scene::{BodySource, Optimizer};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

const AFTER_HELP: &str = "\
Examples:
  palpate inspect beam.toml
  palpate inspect my-recording
  palpate inspect beam.toml --json
  palpate inspect --devices                    graphics adapters, their limits, what they can run
  palpate inspect --effects                    laws that a scene can add, with parameters and units

A scene is checked together with its recording: where both lie, and whether their times overlap. Nothing is simulated.";

/// Show what a scene or recording holds, without computing anything
#[derive(Clone, Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// Scene file, or folder (or recording.toml) of a recording
    #[arg(value_name = "SCENE|RECORDING", required_unless_present_any = ["effects", "devices"])]
    path: Option<PathBuf>,
    /// Show the effects that scenes can name, with their parameters, units and defaults
    #[arg(long, conflicts_with = "path")]
    effects: bool,
    /// List the graphics adapters of this machine and what they can run
    #[arg(long, conflicts_with_all = ["path", "effects"])]
    devices: bool,
}

/// One line of the answer: key in JSON, label and text for people.
struct Line {
    key: &'static str,
    label: &'static str,
    value: Value,
    text: String,
}

fn line(key: &'static str, label: &'static str, value: Value, text: impl Into<String>) -> Line {
    Line { key, label, value, text: text.into() }
}

fn is_recording(path: &Path) -> bool {
    let format = |text: String| text.lines().any(|l| l.trim_start().starts_with("format") && l.contains("recording/"));
    path.is_dir() || std::fs::read_to_string(path).is_ok_and(format)
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    if a.devices {
        return Ok(devices::run(console));
    }
    let Some(path) = &a.path else {
        console.print(&if console.json() { catalogue::json().to_string() } else { catalogue::markdown() });
        return Ok(0);
    };
    let (kind, lines, warnings) = if is_recording(path) {
        let r = read_recording(path)?;
        ("recording", recording(&r), r.warnings)
    } else {
        let e = Experiment::open(path)?;
        let mut lines = scene(&e);
        lines.extend(observed(&e));
        ("scene", lines, e.warnings().to_vec())
    };
    if console.json() {
        let mut map: Map<String, Value> = lines.into_iter().map(|l| (l.key.to_string(), l.value)).collect();
        map.insert("format".into(), json!("inspection/1"));
        map.insert("kind".into(), json!(kind));
        map.insert("path".into(), json!(path.display().to_string()));
        map.insert("warnings".into(), json!(warnings));
        console.print(&Value::Object(map).to_string());
        return Ok(0);
    }
    let width = lines.iter().map(|l| l.label.len()).max().unwrap_or(0);
    let mut text = format!("{kind} {}", path.display());
    // Lines without a label are for programs.
    for l in lines.iter().filter(|l| !l.label.is_empty()) {
        text += &format!("\n  {:width$}  {}", l.label, l.text);
    }
    for w in &warnings {
        text += &format!("\n  warning: {w}");
    }
    console.print(&text);
    Ok(0)
}

fn megabytes(bytes: f64) -> String {
    if bytes < 1e6 { format!("{:.0} kB", bytes / 1e3) } else { format!("{:.1} MB", bytes / 1e6) }
}

/// What the fit of a scene asks of its backend; one simulation where there is nothing to fit.
fn demand(e: &Experiment) -> (Demand, String) {
    let one = || (Demand::forward(1), "one simulation".to_string());
    let Some(fit) = e.scene().fit.as_ref().filter(|f| !f.parameters.is_empty()) else { return one() };
    let Ok((_, free, _)) = free_parameters(std::slice::from_ref(e)) else { return one() };
    let demand = fitting::demand(&free, 0, fit.optimizer, fit.starts);
    let numbers = demand.places.len();
    let name = match fit.optimizer {
        Optimizer::Rprop => "rprop",
        Optimizer::GradientDescent => "gradient-descent",
        Optimizer::Lbfgs => "lbfgs",
        Optimizer::GaussNewton => "gauss-newton",
        Optimizer::NelderMead => "nelder-mead",
    };
    (demand, format!("{name}, {numbers} free number{}", if numbers == 1 { "" } else { "s" }))
}

/// Memory of a fit on either backend: in all, by its parts, and for how many starts at once; and why the device cannot run it, if it
/// cannot.
fn memory(e: &Experiment, device: Option<&AdapterReport>) -> Vec<Line> {
    let (demand, what) = demand(e);
    let text = |backend: &str, total: u64, members: usize, parts: &[(&str, u64)]| {
        let parts: Vec<String> = parts.iter().map(|(name, bytes)| format!("{name} {}", megabytes(*bytes as f64))).collect();
        let starts = if demand.starts == 1 { String::new() } else { format!(", {members} of {} starts at once", demand.starts) };
        format!("{} with --backend {backend} ({what}{starts}): {}", megabytes(total as f64), parts.join(", "))
    };
    let threads = e.scene().fit.as_ref().map_or(0, |f| f.threads);
    let (members, m) = demand.on_cpu(e.plan(), threads);
    let parts = [
        ("body, frames and cell matrices", m.shared),
        ("matrices", m.matrices),
        ("solves", m.solves),
        ("states", m.states),
        ("derivatives", m.tangents),
    ];
    let cpu = text("cpu", m.total(), members, &parts);
    let mut lines = vec![line("memory", "memory", json!(m.total()), cpu), line("batch", "", json!(members), "")];
    // Without a device no limit is known.
    let on_device = demand.on_device(e.plan(), device.map_or(u64::MAX, |a| a.largest_buffer()));
    let refusal = match (device, &on_device) {
        (None, _) => None,
        (Some(_), Err(why)) => Some(why.clone()),
        (Some(a), Ok((_, m))) => a.holds(m.largest).err(),
    };
    if let Ok((members, m)) = on_device {
        let parts = [("body and frames", m.constants), ("work space", m.work), ("states", m.states), ("derivatives", m.tangents)];
        lines.push(line("device_memory", "device", json!(m.total()), text("gpu", m.total(), members, &parts)));
        lines.push(line("device_batch", "", json!(members), ""));
    }
    if let Some((a, why)) = device.zip(refusal) {
        let text = format!("by {}: {why} (hint: {})", a.name, why.hint_alone());
        lines.push(line("device_refusal", "refused", json!(why.to_string()), text));
    }
    lines
}

fn scene(e: &Experiment) -> Vec<Line> {
    let (scene, plan) = (e.scene(), e.plan());
    let body = &plan.body;
    let physics = Physics::new(&plan.layout, &plan.theta);
    let (min, max) = e.shape().bounds();
    let size = max - min;
    let full = body.cells.iter().filter(|c| c.is_full()).count();
    let cut = body.cells.len() - full;
    let nodes = body.nodes.len();
    let mass = physics.density * body.volume;
    let (steps, time) = (plan.clock.steps, &scene.time);
    let mut lines = vec![
        line("title", "title", json!(scene.title), scene.title.clone()),
        line("size", "size", json!(size.to_array()), format!("{:.4} × {:.4} × {:.4} m", size.x, size.y, size.z)),
        line("volume", "volume", json!(body.volume), format!("{:.6e} m³", body.volume)),
        line("area", "surface", json!(body.area), format!("{:.6e} m²", body.area)),
        line("mass", "mass", json!(mass), format!("{mass:.6} kg ({:.1} kg/m³)", physics.density)),
    ];
    if let BodySource::Mesh { open_edges: open, .. } = scene.object.source {
        // A mesh that stays open is refused before it comes here.
        let text = if open == 0 { "0 (closed)".to_string() } else { format!("{open} in the file (closed by the repair)") };
        lines.push(line("open_edges", "open edges", json!(open), text));
    }
    lines.extend([
        line("cell_size", "cell size", json!(body.grid.h), format!("{:.5} m", body.grid.h)),
        line(
            "cells",
            "cells",
            json!({ "all": body.cells.len(), "full": full, "cut": cut }),
            format!("{} ({full} full, {cut} cut)", body.cells.len()),
        ),
        line("nodes", "nodes", json!(nodes), nodes.to_string()),
        line("degrees_of_freedom", "degrees of freedom", json!(3 * nodes), (3 * nodes).to_string()),
        line(
            "band_cells",
            "band cells",
            json!(body.band.cells.len()),
            format!("{} of {:.4} m", body.band.cells.len(), plan.band),
        ),
        line(
            "constraints",
            "world",
            json!({ "clamps": plan.clamps.len(), "planes": plan.planes.len(), "masses": plan.masses.len() }),
            format!("{} clamps, {} planes, {} point masses", plan.clamps.len(), plan.planes.len(), plan.masses.len()),
        ),
        line(
            "time",
            "time",
            json!({ "step": time.step, "steps": steps, "start": time.start, "end": e.end_time() }),
            if steps == 0 {
                "static".to_string()
            } else {
                format!(
                    "{steps} steps of {} s, from {} s to {:.4} s{}",
                    time.step,
                    time.start,
                    e.end_time(),
                    numerical_damping(time)
                )
            },
        ),
    ]);
    lines.extend(memory(e, adapter().as_ref()));
    lines.retain(|l| l.key != "title" || !l.text.is_empty());
    lines
}

/// What the θ-scheme damps by itself: ζ = (θ − ½) ω Δt to first order, which a fit takes for the material's.
fn numerical_damping(time: &palpate_model::scene::Time) -> String {
    let of_one_hertz = std::f64::consts::TAU * (time.theta - 0.5) * time.step;
    if of_one_hertz < 1e-6 {
        return String::new();
    }
    format!("; theta = {} damps 1 Hz by {:.2} % of critical, 10 Hz by ten times as much", time.theta, 100.0 * of_one_hertz)
}

/// What is compared and what is free.
fn observed(e: &Experiment) -> Vec<Line> {
    let mut lines = Vec::new();
    let o = &e.plan().observation;
    if let (Some(first), Some(last)) = (o.frames.first(), o.frames.last()) {
        let points: Vec<usize> = o.frames.iter().map(|f| f.points.len()).collect();
        let markers: usize = o.frames.iter().map(|f| f.markers.len()).sum();
        let (low, high) = (points.iter().min().copied().unwrap_or(0), points.iter().max().copied().unwrap_or(0));
        let total: usize = points.iter().sum();
        let of = |seen: usize, size: f64, what: &str| (seen > 0).then(|| format!("{:.2} mm ({what})", size * 1e3));
        let noise: Vec<String> =
            [of(total, o.depth_noise, "depth"), of(markers, o.marker_noise, "markers")].into_iter().flatten().collect();
        let noise = if noise.is_empty() { "unknown".to_string() } else { noise.join(", ") };
        lines.push(line(
            "observation",
            "observed",
            json!({ "frames": o.frames.len(), "from": first.time, "to": last.time, "cameras": o.cameras.len(), "points": total,
                    "points_per_frame": [low, high], "marker_readings": markers, "markers": o.markers.len(),
                    "depth_noise": o.depth_noise, "marker_noise": o.marker_noise, "overlap": true }),
            format!(
                "{} frames from {} s to {} s, {} cameras, {low} to {high} depth points a frame, {} markers ({markers} readings); \
                 noise {noise}; lies around the object",
                o.frames.len(),
                short(first.time),
                short(last.time),
                o.cameras.len(),
                o.markers.len(),
            ),
        ));
    }
    if let Some(fit) = &e.scene().fit {
        let paths: Vec<&str> = fit.parameters.iter().map(|p| p.path.as_str()).collect();
        let text = format!("{} ({} starts of at most {} iterations)", paths.join(", "), fit.starts, fit.iterations);
        lines.push(line("free", "to be found", json!(paths), text));
    }
    lines
}

fn recording(r: &Recording) -> Vec<Line> {
    let mut lines = vec![line("title", "title", json!(r.title), r.title.clone())];
    for c in &r.cameras {
        let noise = c.noise_sigma.map_or("not stated".to_string(), |s| format!("{:.2} mm", s * 1e3));
        lines.push(line(
            "cameras",
            "camera",
            json!(
                r.cameras
                    .iter()
                    .map(|c| json!({ "name": c.name, "width": c.width, "height": c.height, "noise": c.noise_sigma,
                "systematic": c.noise_systematic, "position": c.position().to_array() }))
                    .collect::<Vec<_>>()
            ),
            format!("{} {} × {} pixels, noise {noise}, at {:.3}", c.name, c.width, c.height, c.position()),
        ));
    }
    let readings: Vec<usize> = r.frames.iter().map(|f| f.readings().count()).collect();
    if let (Some(first), Some(last)) = (r.frames.first(), r.frames.last()) {
        let (low, high) = (readings.iter().min().copied().unwrap_or(0), readings.iter().max().copied().unwrap_or(0));
        lines.push(line(
            "frames",
            "images",
            json!({ "count": r.frames.len(), "from": first.time, "to": last.time, "readings": readings.iter().sum::<usize>(),
                    "readings_per_image": [low, high] }),
            format!(
                "{} from {:.4} s to {:.4} s, {low} to {high} readings of the object each",
                r.frames.len(),
                first.time,
                last.time
            ),
        ));
    }
    if let Some(m) = &r.markers {
        let (from, to) = (m.samples.first().map_or(f64::NAN, |s| s.time), m.samples.last().map_or(f64::NAN, |s| s.time));
        let noise = m.noise_sigma.map_or("not stated".to_string(), |s| format!("{:.2} mm", s * 1e3));
        lines.push(line(
            "markers",
            "markers",
            json!({ "names": m.names, "readings": m.samples.len(), "from": from, "to": to, "noise": m.noise_sigma,
                    "rest_places": m.rest.len() }),
            format!(
                "{} markers, {} readings from {} s to {} s, noise {noise}, {} with a rest place",
                m.names.len(),
                m.samples.len(),
                short(from),
                short(to),
                m.rest.len()
            ),
        ));
    }
    lines.retain(|l| l.key != "title" || !l.text.is_empty());
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_that_is_too_small_is_named_with_its_limit_and_the_way_out() {
        let e = Experiment::from_toml(include_str!("../../tests/block.toml"), "block.toml").unwrap_or_else(|e| panic!("{e}"));
        let said = |device: Option<&AdapterReport>| {
            memory(&e, device).into_iter().filter(|l| l.key.starts_with("device")).map(|l| (l.key, l.text)).collect::<Vec<_>>()
        };
        let keys = |lines: &[(&'static str, String)]| lines.iter().map(|l| l.0).collect::<Vec<_>>();
        assert_eq!(keys(&said(None)), ["device_memory", "device_batch"]);
        let Some(mut device) = adapter() else {
            return assert!(std::env::var("PALPATE_GPU").as_deref() != Ok("require"), "there is no adapter");
        };
        assert_eq!(said(Some(&device)), said(None));
        device.limits.max_storage_buffer_binding_size = 2000;
        let lines = said(Some(&device));
        assert_eq!(keys(&lines), ["device_memory", "device_batch", "device_refusal"]);
        let text = &lines[2].1;
        for words in [&device.name, "max_storage_buffer_binding_size", "2000 bytes", "coarser cells, or --backend cpu"] {
            assert!(text.contains(words), "{words} is not in: {text}");
        }
        // What no device runs is refused by the one that is there.
        let laws = "[[effect]]\nkind = \"strain-stiffening\"\ncoefficient = 0.1\n".repeat(17);
        let e = Experiment::from_toml(&(include_str!("../../tests/block.toml").to_string() + &laws), "laws.toml");
        let lines = memory(&e.unwrap_or_else(|e| panic!("{e}")), Some(&device));
        let last = lines.last().map(|l| (l.key, l.text.contains("more than 16 laws of cells")));
        assert_eq!(last, Some(("device_refusal", true)));
    }
}
