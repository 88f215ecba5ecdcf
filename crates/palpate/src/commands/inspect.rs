//! `palpate inspect`: what would be simulated and fitted, and what looks wrong.

mod identify;
mod recorded;
mod tets;

use crate::catalogue;
use crate::cli::Console;
use crate::commands::devices;
use crate::error::Error;
use crate::experiment::{Experiment, short};
use crate::fitting::{self, free_parameters};
use crate::memory::{Demand, adapter};
use crate::options::BackendName;
use crate::progress::Track;
use crate::results::inspection::{Cells, Constraints, Inspected, InspectionDocument, Observed, SceneInspection, Time};
use crate::results::{self, inspection};
use crate::suited::{Suited, suited};
use clap::Args;
use palpate_gpu::AdapterReport;
use palpate_io::read_text;
use palpate_io::recording::read_recording;
use palpate_model::observation::{Channel, ReadingKind};
use palpate_model::plan::Physics;
use palpate_model::scene::BodySource;
use std::path::{Path, PathBuf};

const AFTER_HELP: &str = "\
Examples:
  palpate inspect beam.toml
  palpate inspect my-recording
  palpate inspect beam.toml --json
  palpate inspect beam.toml --identify         which of its free numbers the recording would determine
  palpate inspect --devices                    graphics adapters, their limits, what they can run
  palpate inspect --effects                    laws that a scene can add, with parameters and units

A scene is checked together with its recording: where both lie, and whether their times overlap. Nothing is
simulated but with --identify.";

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
    /// Say what the recording would determine before anything is fitted, and which second motion would help most; this simulates
    #[arg(long, requires = "path")]
    identify: bool,
    /// What computes, with --identify
    #[arg(long, value_enum, default_value = "auto", requires = "identify")]
    backend: BackendName,
    /// List the graphics adapters of this machine and what they can run
    #[arg(long, conflicts_with_all = ["path", "effects"])]
    devices: bool,
}

/// What people read: a label and what stands behind it, line by line.
type Lines = Vec<(&'static str, String)>;

fn is_recording(path: &Path) -> bool {
    let format = |text: String| text.lines().any(|l| l.trim_start().starts_with("format") && l.contains("recording/"));
    path.is_dir() || read_text(path).is_ok_and(format)
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    if a.devices {
        return Ok(devices::run(console));
    }
    let mut reading = Some(console.progress(0, "inspecting"));
    reading.iter_mut().for_each(|t| t.on(0, "reading"));
    let Some(path) = &a.path else {
        console.print(&if console.json() { results::line(&catalogue::document()) } else { catalogue::markdown() });
        return Ok(0);
    };
    let (kind, content, lines, warnings) = if is_recording(path) {
        let r = read_recording(path)?;
        let (content, lines) = recorded::recording(&r);
        ("recording", Inspected::Recording(Box::new(content)), lines, r.warnings)
    } else {
        let e = Experiment::open(path)?;
        let (mut content, mut lines) = scene(&e);
        if a.identify {
            reading.take().into_iter().for_each(Track::finish);
            let mut first = console.progress(0, "identifying");
            let (backend, _) = a.backend.choose(e.plan(), 1, &mut first)?;
            let mut track = Some(first);
            let found = crate::identify::identify(&e, backend, |what, [done, of]| {
                if done == 0 {
                    track.replace(console.progress(of as u64, &format!("looking at {what}"))).into_iter().for_each(Track::finish);
                }
                track.iter_mut().for_each(|t| t.at(done as u64, ""));
            })?;
            track.into_iter().for_each(Track::finish);
            lines.extend(identify::identified(&found));
            content.identification = Some(found);
        }
        ("scene", Inspected::Scene(Box::new(content)), lines, e.warnings().to_vec())
    };
    reading.into_iter().for_each(Track::finish);
    if console.json() {
        console.print(&results::line(&InspectionDocument { path: path.display().to_string(), warnings, content }));
        return Ok(0);
    }
    let width = lines.iter().map(|(label, _)| label.len()).max().unwrap_or(0);
    let mut text = format!("{kind} {}", path.display());
    for (label, said) in &lines {
        text += &format!("\n  {label:width$}  {said}");
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
    let optimizer = fit.optimizer.unwrap_or_else(|| fitting::usual(&free));
    let demand = fitting::demand(&free, 0, optimizer, fit.starts);
    let numbers = demand.places.len();
    let name = optimizer.name();
    (demand, format!("{name}, {numbers} free number{}", if numbers == 1 { "" } else { "s" }))
}

/// Memory of a fit on either backend: in all, by its parts, and for how many starts at once; and why the device cannot run it, if it
/// cannot.
fn memory(e: &Experiment, device: Option<&AdapterReport>, content: &mut SceneInspection, lines: &mut Lines) {
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
    (content.memory, content.batch) = (m.total(), members);
    lines.push(("memory", text("cpu", m.total(), members, &parts)));
    // Without a device no limit is known.
    let on_device = demand.on_device(e.plan(), device.map_or(u64::MAX, |a| a.largest_buffer()));
    let refusal = match (device, &on_device) {
        (None, _) => None,
        (Some(_), Err(why)) => Some(why.clone()),
        (Some(a), Ok((_, m))) => a.holds(m.largest).err(),
    };
    if let Ok((members, m)) = on_device {
        let parts = [("body and frames", m.constants), ("work space", m.work), ("states", m.states), ("derivatives", m.tangents)];
        (content.device_memory, content.device_batch) = (Some(m.total()), Some(members));
        lines.push(("device", text("gpu", m.total(), members, &parts)));
    }
    if let Some((a, why)) = device.zip(refusal) {
        lines.push(("refused", format!("by {}: {why} (hint: {})", a.name, why.hint_alone())));
        content.device_refusal = Some(why.to_string());
    }
}

fn title(title: &str) -> Option<String> {
    (!title.is_empty()).then(|| title.to_string())
}

fn scene(e: &Experiment) -> (SceneInspection, Lines) {
    let (mut content, mut lines) = (SceneInspection::default(), Lines::new());
    body(e, &mut content, &mut lines);
    world(e, &mut content, &mut lines);
    memory(e, adapter().as_ref(), &mut content, &mut lines);
    observed(e, &mut content, &mut lines);
    free(e, &mut content, &mut lines);
    (content, lines)
}

fn body(e: &Experiment, content: &mut SceneInspection, lines: &mut Lines) {
    let (scene, plan) = (e.scene(), e.plan());
    let body = &plan.body;
    let density = Physics::new(&plan.layout, &plan.theta).density;
    let (min, max) = e.shape().bounds();
    let size = max - min;
    let cut = body.cells().iter().filter(|c| !c.is_full()).count();
    let (all, full, nodes) = (body.elements(), body.elements() - cut, body.nodes.len());
    content.title = title(&scene.title);
    (content.size, content.volume, content.area, content.mass) = (size.to_array(), body.volume, body.area, density * body.volume);
    lines.extend(content.title.iter().map(|t| ("title", t.clone())));
    lines.extend([
        ("size", format!("{:.4} × {:.4} × {:.4} m", size.x, size.y, size.z)),
        ("volume", format!("{:.6e} m³", body.volume)),
        ("surface", format!("{:.6e} m²", body.area)),
        ("mass", format!("{:.6} kg ({density:.1} kg/m³)", content.mass)),
    ]);
    if let BodySource::Mesh { open_edges: open, .. } = scene.object.source {
        content.open_edges = Some(open);
        // A mesh that stays open is refused before it comes here.
        let text = if open == 0 { "0 (closed)".to_string() } else { format!("{open} in the file (closed by the repair)") };
        lines.push(("open edges", text));
    }
    (content.cell_size, content.cells) = (body.length, Cells { all, full, cut });
    (content.nodes, content.degrees_of_freedom, content.band_cells) = (nodes, 3 * nodes, body.band.cells.len());
    match body.cut {
        Some(_) => lines.extend([
            ("cell size", format!("{:.5} m{}", body.length, why(e, "object.cell_size"))),
            ("cells", format!("{all} ({full} full, {cut} cut)")),
            ("band cells", format!("{} of {:.4} m", body.band.cells.len(), plan.band)),
        ]),
        None => tets::tetrahedra(e, content, lines),
    }
    lines.extend([("nodes", nodes.to_string()), ("degrees of freedom", (3 * nodes).to_string())]);
    let Suited { discretisation, reason } = suited(e);
    lines.push(("suited", format!("{discretisation}: {reason}")));
    content.suited = Some(inspection::Suited { discretisation: discretisation.to_string(), reason });
}

/// Why a number of the scene is what it is, where it was chosen.
fn why(e: &Experiment, key: &str) -> String {
    e.chosen().iter().find(|c| c.0 == key).map_or(String::new(), |(_, _, why)| format!(" (chosen: {why})"))
}

/// What acts on the body, and when.
fn world(e: &Experiment, content: &mut SceneInspection, lines: &mut Lines) {
    let plan = e.plan();
    let [clamps, planes, masses] = [plan.clamps.len(), plan.planes.len(), plan.masses.len()];
    content.constraints = Constraints { clamps, planes, masses };
    lines.push((
        "world",
        [counted(clamps, "clamp", "clamps"), counted(planes, "plane", "planes"), counted(masses, "point mass", "point masses")]
            .join(", "),
    ));
    let (steps, time, end) = (plan.clock.steps, &e.scene().time, e.end_time());
    content.time = Time { step: plan.clock.step, steps, start: e.start_time(), end };
    let text = match steps {
        0 => "static".to_string(),
        _ if time.scheme.still => format!("{} equilibria, from {} s to {end:.4} s", steps + 1, e.start_time()),
        _ => format!(
            "{steps} steps of {} s{}, from {} s to {end:.4} s{}",
            time.step,
            why(e, "time.step"),
            time.start,
            numerical_damping(time)
        ),
    };
    lines.push(("time", text));
}

/// What the scheme damps by itself, which a fit takes for the material's.
fn numerical_damping(time: &palpate_model::scene::Time) -> String {
    let [slow, fast] = [1.0, 10.0].map(|hertz| 100.0 * time.scheme.numerical_damping(time.step, time.theta, hertz));
    if fast < 1e-3 {
        return String::new();
    }
    let stated = if time.scheme.name == "theta" { format!("theta = {}", time.theta) } else { time.scheme.name.into() };
    format!("; {stated} damps 1 Hz by {slow:.2} % of critical, 10 Hz by {fast:.2} %")
}

/// What the simulation is compared with.
fn observed(e: &Experiment, content: &mut SceneInspection, lines: &mut Lines) {
    let o = &e.plan().observation;
    let (Some(first), Some(last)) = (o.frames.first(), o.frames.last()) else { return };
    let points: Vec<usize> = o.frames.iter().map(|f| f.points.len()).collect();
    let [low, high] = extremes(&points);
    let of = |c: &Channel| (o.readings(c.kind) > 0).then(|| format!("{:.2} mm ({})", c.noise * 1e3, c.kind.name()));
    let noise: Vec<String> = o.channels.iter().filter_map(of).collect();
    let noise = if noise.is_empty() { "unknown".to_string() } else { noise.join(", ") };
    let [readings, tracks, displacements] =
        [ReadingKind::Marker, ReadingKind::Track, ReadingKind::Displacement].map(|kind| o.readings(kind));
    let tracked = o.markers.len() - o.marker_count();
    let more = |count: usize, text: String| if count == 0 { String::new() } else { text };
    lines.push((
        "observed",
        format!(
            "{} from {} s to {} s{}{}{}{}; noise {noise}; lies around the object",
            counted(o.frames.len(), "frame", "frames"),
            short(first.time),
            short(last.time),
            more(
                o.cameras.len() + high,
                format!(", {}, {low} to {high} depth points a frame", counted(o.cameras.len(), "camera", "cameras"))
            ),
            more(o.marker_count(), format!(", {} ({readings} readings)", counted(o.marker_count(), "marker", "markers"))),
            more(tracks, format!(", {tracked} tracked points ({tracks} readings)")),
            more(displacements, format!(", {displacements} displacements of nodes")),
        ),
    ));
    let noise_of = |kind| o.channel(kind).map(|c| c.noise);
    content.observation = Some(Observed {
        frames: o.frames.len(),
        from: first.time,
        to: last.time,
        cameras: o.cameras.len(),
        points: points.iter().sum(),
        points_per_frame: [low, high],
        marker_readings: readings,
        markers: o.marker_count(),
        tracked_readings: tracks,
        tracked_points: tracked,
        displacements,
        depth_noise: noise_of(ReadingKind::Depth),
        marker_noise: noise_of(ReadingKind::Marker),
        tracked_noise: noise_of(ReadingKind::Track),
        displacement_noise: noise_of(ReadingKind::Displacement),
        overlap: true,
    });
}

fn free(e: &Experiment, content: &mut SceneInspection, lines: &mut Lines) {
    let Some(fit) = &e.scene().fit else { return };
    let paths: Vec<String> = fit.parameters.iter().map(|p| p.path.clone()).collect();
    let text =
        format!("{} ({} of at most {} iterations)", paths.join(", "), counted(fit.starts, "start", "starts"), fit.iterations);
    lines.push(("to be found", text));
    content.free = Some(paths);
}

fn counted(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

/// Smallest and largest of some numbers; zeros without any.
fn extremes(numbers: &[usize]) -> [usize; 2] {
    [numbers.iter().min().copied().unwrap_or(0), numbers.iter().max().copied().unwrap_or(0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_that_is_too_small_is_named_with_its_limit_and_the_way_out() {
        let e = Experiment::from_toml(include_str!("../../tests/block.toml"), "block.toml").unwrap_or_else(|e| panic!("{e}"));
        let said = |e: &Experiment, device: Option<&AdapterReport>| {
            let (mut content, mut lines) = (SceneInspection::default(), Lines::new());
            memory(e, device, &mut content, &mut lines);
            assert!(content.device_memory.is_some() == content.device_batch.is_some());
            assert_eq!(content.device_refusal.is_some(), lines.iter().any(|l| l.0 == "refused"));
            lines
        };
        let labels = |lines: &Lines| lines.iter().map(|l| l.0).collect::<Vec<_>>();
        assert_eq!(labels(&said(&e, None)), ["memory", "device"]);
        let Some(mut device) = adapter() else {
            return assert!(std::env::var("PALPATE_GPU").as_deref() != Ok("require"), "there is no adapter");
        };
        assert_eq!(said(&e, Some(&device)), said(&e, None));
        device.limits.max_storage_buffer_binding_size = 2000;
        let lines = said(&e, Some(&device));
        assert_eq!(labels(&lines), ["memory", "device", "refused"]);
        let text = &lines[2].1;
        for words in [&device.name, "max_storage_buffer_binding_size", "2000 bytes", "coarser cells, or --backend cpu"] {
            assert!(text.contains(words), "{words} is not in: {text}");
        }
        // What no device runs is refused by the one that is there.
        let laws = "[[effect]]\nkind = \"strain-stiffening\"\ncoefficient = 0.1\n".repeat(17);
        let e = Experiment::from_toml(&(include_str!("../../tests/block.toml").to_string() + &laws), "laws.toml");
        let lines = said(&e.unwrap_or_else(|e| panic!("{e}")), Some(&device));
        let last = lines.last().map(|l| (l.0, l.1.contains("more than 16 laws of cells")));
        assert_eq!(last, Some(("refused", true)));
    }
}
