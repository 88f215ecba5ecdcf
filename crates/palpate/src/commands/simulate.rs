//! `palpate simulate`: a scene's motion as files.

use super::frames::{Output, Written, write_motion};
use crate::cli::{Console, INTERRUPTED};
use crate::error::Error;
use crate::experiment::Experiment;
use crate::options::{BackendName, out_folder};
use crate::results::simulation::SimulationDocument;
use crate::results::{self, finite};
use clap::Args;
use std::path::{Path, PathBuf};

const AFTER_HELP: &str = "\
Examples:
  palpate simulate beam.toml                           a surface mesh (OBJ) per frame in out/beam/
  palpate simulate beam.toml --format vtu,png --every 5
  palpate simulate found/model.toml --out frames       what a fit has found, simulated again
  palpate simulate toy.toml --carry fine.obj,splats.ply   files that follow the body, written for every frame

obj, ply: the deformed surface; vtu: the cells or tetrahedra with displacement, velocity and fields, strain (Green) and stress
(Cauchy, and von Mises' of it; the material's alone), and a .pvd for the whole series; png: shaded pictures; npz: the warp, nodes at rest X
and moved y [N, 3] and the time. What --carry names is in the coordinates of object.mesh. Splats (3DGS PLY) move with their covariance and turn with
their harmonics. The scene's recording is not read. Frames of an earlier simulation in the same folder and of the same
formats are replaced: those that this one has no frame for are removed.";

/// Simulate a scene and write its motion
#[derive(Clone, Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// Scene file
    scene: PathBuf,
    /// Output folder [default: out/SCENE]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// What computes
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendName,
    #[command(flatten)]
    output: Output,
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    let folder = out_folder(&a.out, &a.scene, "");
    crate::folder::check(&folder)?;
    let mut track = console.progress(0, "simulating");
    track.on(0, "reading");
    let experiment = Experiment::open_without_recording(&a.scene)?;
    let (backend, note) = a.backend.choose(experiment.plan(), 1, &mut track)?;
    track.aside(|| {
        console.warn(experiment.warnings());
        note.iter().for_each(|n| console.note(n));
    });
    let _lock = crate::folder::take(&folder, console)?;
    console.interrupt.serve();
    let written = write_motion(&experiment, backend, &folder, &a.output, track, console)?;
    let document = document(&experiment, &folder, backend.name(), &written);
    console.print(&if console.json() { results::line(&document) } else { sentence(&document) });
    Ok(if written.interrupted.is_some() { INTERRUPTED } else { 0 })
}

/// What was simulated and written.
pub fn document(experiment: &Experiment, folder: &Path, backend: &str, written: &Written) -> SimulationDocument {
    SimulationDocument {
        scene: experiment.scene().path.display().to_string(),
        backend: backend.into(),
        steps: experiment.plan().clock.steps,
        interrupted: written.interrupted,
        nodes: experiment.plan().body.nodes.len(),
        frames: written.frames,
        files: written.files,
        out: folder.display().to_string(),
        largest_displacement: finite(written.farthest),
        seconds: written.seconds,
    }
}

/// The same in a sentence.
pub fn sentence(d: &SimulationDocument) -> String {
    let first = d.interrupted.map_or(String::new(), |reached| format!("interrupted after step {reached}: "));
    format!(
        "{first}{}: {} steps of {} nodes in {:.2} s ({}), largest displacement {:.4} m; {} files in {}",
        d.scene,
        d.steps,
        d.nodes,
        d.seconds,
        d.backend,
        d.largest_displacement.unwrap_or(f64::NAN),
        d.files,
        d.out
    )
}
