//! Frames of a motion as files: what `simulate` and `synthesize` write.

use crate::cli::Console;
use crate::embed::Embedding;
use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fields::{OnGrid, named};
use crate::options::count;
use crate::progress::Track;
use crate::render::{Pinhole, shade};
use crate::skin::Skin;
use crate::solids::{intrusion, obstacles};
use crate::stress::stressed;
use clap::{Args, ValueEnum};
use glam::DVec3;
use palpate_cpu::CpuBackend;
use palpate_engine::Snapshot;
use palpate_io::npy::{Array, write_npz};
use palpate_io::output::{make_folder, write_file};
use palpate_io::vtk::{Elements, Values, write_vtu};
use palpate_model::scene::InitialShape;
use palpate_model::shape::TriMesh;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What to write of a motion.
#[derive(Clone, Debug, Args)]
pub struct Output {
    /// What to write, separated by commas
    #[arg(long, value_enum, value_delimiter = ',', default_value = "obj")]
    format: Vec<Format>,
    /// Write every N-th state
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = count(1..=u64::MAX), allow_negative_numbers = true)]
    every: u64,
    /// Files that the body carries along, in the coordinates of object.mesh: meshes (OBJ, PLY), points and Gaussian splats (PLY); each is
    /// written anew for every frame
    #[arg(long, value_name = "FILE", value_delimiter = ',')]
    carry: Vec<PathBuf>,
}

/// A motion that was simulated and written.
pub struct Written {
    /// The last step that was reached, where somebody stopped it before the end.
    pub interrupted: Option<usize>,
    /// Frames written.
    pub frames: usize,
    /// Files written.
    pub files: usize,
    /// Largest displacement of a node [m].
    pub farthest: f64,
    /// Wall-clock time of the simulation [s].
    pub seconds: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    Obj,
    Ply,
    Vtu,
    Png,
    Npz,
}

impl Format {
    fn ending(self) -> &'static str {
        match self {
            Format::Obj => "obj",
            Format::Ply => "ply",
            Format::Vtu => "vtu",
            Format::Png => "png",
            Format::Npz => "npz",
        }
    }
}

/// Frames of one kind: `frame_00012.obj`, `toy_00012.ply`.
#[derive(Clone, Debug, PartialEq)]
struct Series {
    stem: String,
    ending: String,
}

impl Series {
    fn of(format: Format) -> Series {
        Series { stem: "frame".into(), ending: format.ending().into() }
    }

    fn name(&self, number: usize) -> String {
        format!("{}_{number:05}.{}", self.stem, self.ending)
    }
}

/// Removes the frames of an earlier simulation that this one, with its frames `numbers`, does not replace: whoever plays the folder would
/// see both. Returns how many there were. Series without a frame 0, which every simulation writes, come from elsewhere and stay.
fn remove_stale(folder: &Path, series: &Series, numbers: &[usize]) -> Result<usize, Error> {
    let list = std::fs::read_dir(folder).map_err(|e| Error::write(folder, e))?;
    let number = |name: &str| {
        let n =
            name.strip_prefix(&series.stem)?.strip_prefix('_')?.strip_suffix(&series.ending)?.strip_suffix('.')?.parse().ok()?;
        (series.name(n) == name).then_some(n)
    };
    let there: Vec<usize> = list
        .filter_map(|e| e.ok().filter(|e| e.file_type().is_ok_and(|t| t.is_file()))?.file_name().to_str().and_then(number))
        .collect();
    if !there.contains(&0) {
        return Ok(0);
    }
    let stale: Vec<usize> = there.into_iter().filter(|n| !numbers.contains(n)).collect();
    for n in &stale {
        let path = folder.join(series.name(*n));
        std::fs::remove_file(&path).map_err(|e| Error::Failed(format!("{}: cannot be removed: {e}", path.display())))?;
    }
    Ok(stale.len())
}

/// Writes frames of one simulation.
struct Writer<'a> {
    experiment: &'a Experiment,
    folder: PathBuf,
    formats: Vec<Format>,
    surface: Embedding,
    triangles: Vec<[u32; 3]>,
    elements: Elements,
    fields: OnGrid,
    /// Displacement of the stress-free shape, where the shape given is the equilibrium [m].
    stress_free: Option<Vec<DVec3>>,
    camera: Pinhole,
    carried: Vec<(Series, Skin)>,
    series: Vec<(f64, String)>,
    files: usize,
}

impl Writer<'_> {
    fn write(&mut self, number: usize, state: &Snapshot) -> Result<(), Error> {
        let vertices = self.surface.deform(&state.displacement);
        let time = self.experiment.start_time() + state.time;
        for format in self.formats.clone() {
            let name = Series::of(format).name(number);
            let file = self.folder.join(&name);
            match format {
                Format::Obj | Format::Ply => {
                    let mesh = TriMesh { vertices: vertices.clone(), triangles: self.triangles.clone() };
                    match format {
                        Format::Obj => palpate_io::write_obj(file, &mesh)?,
                        _ => palpate_io::write_ply(file, &mesh)?,
                    }
                }
                Format::Vtu => {
                    let body = &self.experiment.plan().body;
                    let points: Vec<DVec3> = body.nodes.iter().zip(&state.displacement).map(|(x, u)| *x + *u).collect();
                    let fractions: Vec<f64> = body.cells().iter().map(|c| c.fraction).collect();
                    let mut of_nodes = named(&self.fields.nodes);
                    of_nodes.push(("displacement", Values::Vectors(&state.displacement)));
                    of_nodes.push(("velocity", Values::Vectors(&state.velocity)));
                    of_nodes.extend(self.stress_free.iter().map(|w| ("stress_free", Values::Vectors(w))));
                    let mut of_elements = named(&self.fields.elements);
                    let plan = self.experiment.plan();
                    let s = stressed(plan, &plan.theta, &state.displacement, self.stress_free.as_deref());
                    of_elements.push(("strain", Values::Symmetric(&s.strain)));
                    of_elements.push(("stress", Values::Symmetric(&s.stress)));
                    of_elements.push(("von_mises", Values::Numbers(&s.von_mises)));
                    if body.cut.is_some() {
                        of_elements.push(("fraction", Values::Numbers(&fractions)));
                    }
                    write_vtu(file, &points, &self.elements, &of_nodes, &of_elements)?;
                    self.series.push((time, name));
                }
                Format::Png => {
                    let mut seen = TriMesh { vertices: vertices.clone(), triangles: self.triangles.clone() };
                    for other in obstacles(self.experiment.plan(), time) {
                        let first = seen.vertices.len() as u32;
                        seen.vertices.extend(other.vertices);
                        seen.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
                    }
                    let own = vertices.len();
                    let colour = |v: usize| if v < own { DVec3::new(0.45, 0.62, 0.85) } else { DVec3::splat(0.72) };
                    let picture = shade(&self.camera, &seen.vertices, &seen.triangles, self.experiment.up(), colour);
                    write_file(file, |w| w.write_all(&picture.png()))?;
                }
                Format::Npz => {
                    let rest = &self.experiment.plan().body.nodes;
                    let rows = |v: Vec<f64>| Array { shape: vec![rest.len(), 3], values: v };
                    let before = rows(rest.iter().flat_map(|x| x.to_array()).collect());
                    let moved = rest.iter().zip(&state.displacement);
                    let after = rows(moved.flat_map(|(x, u)| (*x + *u).to_array()).collect());
                    let time = Array { shape: vec![1], values: vec![time] };
                    write_npz(file, &[("X", &before), ("y", &after), ("time", &time)])?;
                }
            }
            self.files += 1;
        }
        for (series, skin) in &mut self.carried {
            skin.write(&self.folder.join(series.name(number)), &state.displacement)?;
            self.files += 1;
        }
        Ok(())
    }
}

/// A camera that sees the surface in all states, given by their bounding boxes.
fn camera(experiment: &Experiment, boxes: &[(DVec3, DVec3)]) -> Pinhole {
    let (lo, hi) = boxes.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), (l, h)| (a.min(*l), b.max(*h)));
    Pinhole::framing(lo, hi, experiment.up(), 640, 480)
}

/// What the body carries, and what its frames are called.
fn carried(
    experiment: &Experiment,
    files: &[PathBuf],
    backend: Backend,
    track: &mut Track,
    console: &mut Console,
) -> Result<Vec<(Series, Skin)>, Error> {
    let mut all: Vec<(Series, Skin)> = Vec::new();
    for file in files {
        let part = |p: Option<&std::ffi::OsStr>| p.map(|p| p.to_string_lossy().into_owned()).unwrap_or_default();
        let series = Series { stem: part(file.file_stem()), ending: part(file.extension()).to_ascii_lowercase() };
        if series.stem == "frame" || all.iter().any(|(other, _)| *other == series) {
            let message = format!("its frames would be called {}, as others are; rename the file", series.name(0));
            return Err(Error::Option { option: "carry", given: file.display().to_string(), message });
        }
        let (skin, doubt) = Skin::new(experiment, file, backend)?;
        track.aside(|| console.warn(doubt.as_slice()));
        all.push((series, skin));
    }
    Ok(all)
}

/// Simulates an experiment with its own values and writes its motion into a folder.
///
/// # Errors
/// The simulation fails, or a file cannot be written.
pub fn write_motion(
    experiment: &Experiment,
    backend: Backend,
    folder: &Path,
    a: &Output,
    mut track: Track,
    console: &mut Console,
) -> Result<Written, Error> {
    make_folder(folder)?;
    let plan = experiment.plan();
    // Whoever names a file that cannot be carried is told before anything is computed.
    let carried = carried(experiment, &a.carry, backend, &mut track, console)?;
    let clock = Instant::now();
    let (surface, triangles) = experiment.surface(0.5 * plan.body.length);
    let keep = |k: usize| (k as u64).is_multiple_of(a.every) || k == plan.clock.steps;

    // States first, files afterwards: the pictures' camera frames the whole motion. An interrupt ends the simulation, not the
    // writing of what it has.
    track.measure(plan.clock.steps as u64);
    let mut states: Vec<(usize, Snapshot)> = Vec::new();
    let (mut farthest, mut reached): (f64, usize) = (0.0, 0);
    let mut extent: Vec<(DVec3, DVec3)> = Vec::new();
    let interrupt = console.interrupt.clone();
    backend.visit(plan, &plan.theta, |k, s, _| {
        farthest = s.displacement.iter().map(|u| u.length()).fold(farthest, f64::max);
        if keep(k) {
            let points = surface.deform(&s.displacement);
            extent.push(points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p))));
            states.push((k, s));
        }
        track.at(k as u64, "");
        reached = k;
        if interrupt.is_raised() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    let interrupted = interrupt.is_raised();
    track.finish();
    let seconds = clock.elapsed().as_secs_f64();

    let mut formats = a.format.clone();
    formats.dedup();
    let numbers: Vec<usize> = states.iter().map(|(k, _)| *k).collect();
    let series = formats.iter().map(|f| Series::of(*f)).chain(carried.iter().map(|c| c.0.clone()));
    let stale = series.map(|s| remove_stale(folder, &s, &numbers)).sum::<Result<usize, Error>>()?;
    if stale > 0 {
        console.note(&format!("removed from {}: {stale} frames of an earlier simulation", folder.display()));
    }
    let given = experiment.scene().initial.state == InitialShape::Given;
    let stress_free = given.then(|| CpuBackend.stress_free(plan, &plan.theta)).transpose()?;
    let mut writer = Writer {
        stress_free,
        camera: camera(experiment, &extent),
        elements: Elements::of(&plan.body),
        fields: OnGrid::new(plan, &plan.theta, &(0..plan.fields.len()).collect::<Vec<_>>()),
        experiment,
        folder: folder.to_path_buf(),
        formats,
        surface,
        triangles,
        carried,
        series: Vec::new(),
        files: 0,
    };
    console.warn(intrusion(plan, experiment.start_time(), &states).as_slice());
    let mut track = console.progress(states.len() as u64, "writing");
    let mut written = 0;
    for (k, state) in &states {
        writer.write(*k, state)?;
        written += 1;
        track.on(1, "");
    }
    track.finish();
    if !writer.series.is_empty() {
        palpate_io::write_pvd(folder.join("series.pvd"), &writer.series)?;
    }
    Ok(Written { interrupted: interrupted.then_some(reached), frames: written, files: writer.files, farthest, seconds })
}
