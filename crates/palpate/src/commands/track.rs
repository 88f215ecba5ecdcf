//! `palpate track`: the moving body in every frame of a recording.

use crate::cli::{Console, INTERRUPTED};
use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::options::{count, out_folder};
use crate::report::tracking_document;
use crate::results;
use crate::results::tracking::{FrameRow, RoundNumber, TrackingDocument};
use crate::tracking::{Refined, TrackedBody, refine, track_on};
use clap::{Args, ValueEnum};
use glam::DVec3;
use palpate_diagnose::stated;
use palpate_engine::number;
use palpate_io::npy::{Array, write_npz};
use palpate_io::output::write_file;
use palpate_io::vtk::{Elements, Values, write_vtu};
use palpate_model::shape::TriMesh;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

const AFTER_HELP: &str = "\
Examples:
  palpate track leaf.toml --out seen                 arrays, verdicts and a recording of points in seen/
  palpate track leaf.toml --out seen --format ply    the surface of every frame as well
  palpate track leaf.toml --out seen && palpate fit seen/scene.toml
  palpate track leaf.toml --out seen --refine 4      track, fit the scene's free numbers to that, track again, until nothing moves
  palpate fit leaf.toml --from seen                  fit the depth readings themselves, from where the tracked points lead

The scene's recording says where its cameras or markers saw the body; no forces need to be known. Every frame is the most probable shape
between what the material allows and what was measured, with the uncertainty of each place. [track] in the scene chooses: prior
(\"dynamic\": a step from the frame before, \"elastic\": the equilibrium), temperature (J, how far the prior may be wrong; found where absent),
outliers (share of depth points that are something else) and soft_start (m, how far the body may be from its place).

tracked.json (tracking/1) holds a verdict and a row a frame. tracked.npz holds time [F], displacement and velocity [F, N, 3] of the nodes,
surface [F, V, 3], sigma [F, V] (m, one coordinate), seen [F, V] and data [F, N] (share of the prior's variance that readings took away);
nodes [N, 3], rest [V, 3] and triangles are the body at rest.
recording/ and scene.toml are the scene with the points that were seen as its measurement: `palpate fit` reads them.";

/// Find the moving body in every frame of a recording
#[derive(Clone, Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// Scene file, with the recording it is tracked in
    scene: PathBuf,
    /// Output folder [default: out/SCENE-tracked]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Track and fit in turns, with N fits at most: ends when no number of [fit] moves by 0.3 standard errors
    #[arg(long, value_name = "N", value_parser = count(1..=100), allow_negative_numbers = true)]
    refine: Option<u64>,
    /// Files per frame, separated by commas
    #[arg(long, value_enum, value_delimiter = ',')]
    format: Vec<Format>,
    /// What finds out which readings belong to which part of the surface
    #[arg(long, value_enum, default_value = "cpu")]
    backend: Who,
}

/// The body itself is moved on the CPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Who {
    /// Double precision, on all cores
    Cpu,
    /// WGSL kernels on a graphics adapter (PALPATE_ADAPTER chooses one by index, PCI address or name), which also fits with --refine
    Gpu,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// The deformed surface
    Ply,
    /// The elements with displacement, velocity and share of data, and a .pvd for the series
    Vtu,
}

fn array(shape: &[usize], values: impl Iterator<Item = f64>) -> Array {
    Array { shape: shape.to_vec(), values: values.collect() }
}

fn vectors(count: usize, of: impl Iterator<Item = DVec3>) -> Array {
    let values: Vec<f64> = of.flat_map(|v| v.to_array()).collect();
    array(&[values.len() / (3 * count.max(1)), count, 3], values.into_iter())
}

fn write_arrays(folder: &Path, experiment: &Experiment, t: &TrackedBody) -> Result<(), Error> {
    let nodes = &experiment.plan().body.nodes;
    let (f, n, v) = (t.frames.len(), t.frames.first().map_or(0, |f| f.data.len()), t.surface.rest.len());
    let frames = || t.frames.iter();
    let flag = |b: &bool| f64::from(u8::from(*b));
    let all = [
        ("time", array(&[f], frames().map(|x| x.time))),
        ("displacement", vectors(n, frames().flat_map(|x| x.displacement.iter().copied()))),
        ("velocity", vectors(n, frames().flat_map(|x| x.velocity.iter().copied()))),
        ("surface", vectors(v, frames().flat_map(|x| x.surface.iter().copied()))),
        ("sigma", array(&[f, v], frames().flat_map(|x| x.deviation.iter().copied()))),
        ("seen", array(&[f, v], frames().flat_map(|x| x.seen.iter().map(flag)))),
        ("nodes", array(&[nodes.len(), 3], nodes.iter().flat_map(|x| x.to_array()))),
        ("rest", array(&[v, 3], t.surface.rest.iter().flat_map(|x| x.to_array()))),
        ("triangles", array(&[t.triangles.len(), 3], t.triangles.iter().flatten().map(|k| f64::from(*k)))),
        ("data", array(&[f, n], frames().flat_map(|x| x.data.iter().copied()))),
    ];
    Ok(write_npz(folder.join("tracked.npz"), &all.iter().map(|(name, a)| (*name, a)).collect::<Vec<_>>())?)
}

fn write_frames(folder: &Path, experiment: &Experiment, t: &TrackedBody, formats: &[Format]) -> Result<(), Error> {
    let body = &experiment.plan().body;
    let elements = Elements::of(body);
    let mut series = Vec::new();
    for (k, f) in t.frames.iter().enumerate() {
        if formats.contains(&Format::Ply) {
            let mesh = TriMesh { vertices: f.surface.clone(), triangles: t.triangles.clone() };
            palpate_io::write_ply(folder.join(format!("frame_{k:05}.ply")), &mesh)?;
        }
        if formats.contains(&Format::Vtu) {
            let name = format!("frame_{k:05}.vtu");
            let points: Vec<DVec3> = body.nodes.iter().zip(&f.displacement).map(|(x, u)| *x + *u).collect();
            let of_nodes = [
                ("displacement", Values::Vectors(&f.displacement)),
                ("velocity", Values::Vectors(&f.velocity)),
                ("data", Values::Numbers(&f.data)),
            ];
            write_vtu(folder.join(&name), &points, &elements, &of_nodes, &[])?;
            series.push((f.time, name));
        }
    }
    if !series.is_empty() {
        palpate_io::write_pvd(folder.join("series.pvd"), &series)?;
    }
    Ok(())
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    let folder = out_folder(&a.out, &a.scene, "-tracked");
    let (experiment, mut progress, lock) = crate::folder::begin(&folder, "tracking", console, || Experiment::open(&a.scene))?;
    let clock = Instant::now();
    progress.measure(experiment.plan().observation.frames.len() as u64);
    let interrupt = console.interrupt.clone();
    let backend = match a.backend {
        Who::Cpu => Backend::Cpu,
        Who::Gpu => Backend::Gpu,
    };
    let refined = match a.refine {
        Some(most) => refine(&experiment, most as usize, backend, &interrupt, &folder, |text| progress.on(0, text))?,
        None => {
            let tracked = track_on(&experiment, backend, |done| {
                progress.at(done as u64, "");
                if interrupt.is_raised() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })?;
            Refined::once(experiment, tracked)
        }
    };
    let Refined { tracked, experiment, text, .. } = &refined;
    progress.finish();
    let seconds = clock.elapsed().as_secs_f64();
    lock.check()?;
    write_arrays(&folder, experiment, tracked)?;
    write_frames(&folder, experiment, tracked, &a.format)?;
    let document = tracking_document(&refined, seconds);
    match tracked.recording(&experiment.scene().title, tracked.noise) {
        Ok(recording) => {
            palpate_io::write_recording(folder.join("recording"), &recording)?;
            let scene = palpate_io::scene_of_tracks(text, experiment.scene(), "recording", &folder)?;
            write_file(folder.join("scene.toml"), |w| w.write_all(scene.as_bytes()))?;
        }
        // The frames say what is wrong; nothing of them is to be fitted.
        Err(e) => console.warn(&[e.to_string()]),
    }
    results::write(folder.join("tracked.json"), &document)?;
    if console.json() {
        console.print(&results::line(&document));
    } else {
        print(console, &document, &folder);
    }
    Ok(if tracked.interrupted { INTERRUPTED } else { 0 })
}

fn print(console: &mut Console, d: &TrackingDocument, folder: &Path) {
    let because = if d.reason.is_empty() { String::new() } else { format!(": {}", d.reason) };
    console.print(&format!("{}{because}", d.verdict));
    for (k, r) in d.rounds.iter().enumerate() {
        let one = |v: &RoundNumber| format!("{} {}", v.path, stated(v.value.unwrap_or(f64::NAN), v.standard_error));
        let moved = r.moved.map_or(String::new(), |m| format!("; moved by {} standard errors at most", number(m)));
        let rms = r.rms.unwrap_or(f64::NAN);
        console.print(&format!(
            "round {}: readings lay {} m from the tracked body; {}{moved}",
            k + 1,
            number(rms),
            r.values.iter().map(one).collect::<Vec<_>>().join(", ")
        ));
    }
    let worst = |of: fn(&FrameRow) -> Option<f64>| d.frames.iter().filter_map(of).fold(0.0, f64::max);
    console.print(&format!(
        "{}: {} of {} frames, {} nodes, {:.2} s a frame; readings lie at most {} m (rms) from the body; ± of a place that was seen at most {} m, \
         of a hidden one {} m; files in {}",
        d.scene,
        d.frames.len(),
        d.recorded,
        d.nodes,
        d.seconds / d.frames.len().max(1) as f64,
        number(worst(|f| f.rms)),
        number(worst(|f| f.deviation_seen)),
        number(worst(|f| f.deviation_hidden)),
        folder.display()
    ));
}
