//! `palpate observe`: a synthetic recording of a scene.

use crate::cli::Console;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::options::{BackendName, count};
use crate::render::{CameraError, Pinhole, Sensor};
use crate::results;
use crate::results::observation::ObservationDocument;
use crate::synthetic::{Observers, observe};
use clap::Args;
use glam::DVec3;
use palpate_io::npy::read_array;
use palpate_io::{InputError, read_bytes};
use std::io::Cursor;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

const AFTER_HELP: &str = "\
Examples:
  palpate observe ball.toml --camera \"eye=0.5,-0.5,0.4 target=0,0,0.1 size=320x240\" --noise 0.002 --seed 3 --out ball-seen
  palpate observe beam.toml --markers tips.csv --noise 0.0003 --fps 100 --out beam-seen
  palpate observe ball.toml --camera \"eye=1,0,1 target=0,0,0\" --refine 2 --out truth

A camera is written as key=value words: eye=x,y,z and target=x,y,z (metres) are needed; up=x,y,z (default 0,0,1),
fov=DEGREES (vertical, default 45), size=WIDTHxHEIGHT (default 640x480) and name=LABEL may follow.
A marker file has the header name,x,y,z and one surface point of the rest configuration per line.
With --refine R the simulation that is recorded has cells and time step divided by R, so that a fit on the scene's own grid
cannot profit from sharing its errors.";

/// Record a simulation as depth cameras or motion capture would
#[derive(Clone, Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// Scene file
    scene: PathBuf,
    /// A depth camera, like "eye=1,0,1 target=0,0,0 fov=45 size=640x480"; repeatable
    #[arg(long, value_name = "CAMERA")]
    camera: Vec<String>,
    /// File of tracked surface points (CSV with the header name,x,y,z)
    #[arg(long, value_name = "FILE")]
    markers: Option<PathBuf>,
    /// File of tracked points of the body at rest, without markers (NPY, or NPZ with one array; points × 3)
    #[arg(long, value_name = "FILE")]
    points: Option<PathBuf>,
    /// Record the displacement of every simulation node, too
    #[arg(long)]
    displacements: bool,
    /// Folder of the recording
    #[arg(long, value_name = "RECORDING")]
    out: PathBuf,
    /// Standard deviation of a depth reading along the camera's axis, and of a marker coordinate [m]
    #[arg(long, value_name = "S", default_value_t = 0.0, allow_negative_numbers = true)]
    noise: f64,
    /// Share of readings that are missing, 0 to 1
    #[arg(long, value_name = "F", default_value_t = 0.0, allow_negative_numbers = true)]
    dropout: f64,
    /// Metres per count of a depth image
    #[arg(long, alias = "quantisation", value_name = "S", default_value_t = 0.001, allow_negative_numbers = true)]
    depth_scale: f64,
    /// Frames per second [default: one frame per time step of the scene]
    #[arg(long, value_name = "F", conflicts_with = "times", allow_negative_numbers = true)]
    fps: Option<f64>,
    /// Times of the frames on the recording's clock [s], separated by commas
    #[arg(long, value_name = "T,…", value_delimiter = ',', allow_negative_numbers = true)]
    times: Option<Vec<f64>>,
    /// Seed of the noise
    #[arg(long, default_value_t = 1, value_parser = count(0..=u64::MAX), allow_negative_numbers = true)]
    seed: u64,
    /// Divide cells and time step of the recorded simulation by this
    #[arg(long, value_name = "R", default_value_t = 1.0, allow_negative_numbers = true)]
    refine: f64,
    /// What computes
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendName,
    /// Overwrite a recording that is already there
    #[arg(long)]
    force: bool,
}

fn check(a: &Arguments) -> Result<(), Error> {
    let wrong = |option, value: f64, allowed: &str| Err(Error::option(option, value, format!("must be {allowed}")));
    if a.camera.is_empty() && a.markers.is_none() && a.points.is_none() && !a.displacements {
        let text = "nothing observes: give --camera \"eye=x,y,z target=x,y,z\", --markers FILE, --points FILE or --displacements";
        return Err(Error::Input(text.into()));
    }
    if a.displacements && a.refine != 1.0 {
        return Err(Error::Input("--displacements: with --refine the nodes would not be those of the scene".into()));
    }
    if !(0.0..=1.0).contains(&a.noise) {
        return wrong("noise", a.noise, "in [0, 1] (m)");
    }
    if !(0.0..1.0).contains(&a.dropout) {
        return wrong("dropout", a.dropout, "in [0, 1)");
    }
    if !(a.depth_scale > 0.0 && a.depth_scale <= 1.0) {
        return wrong("depth-scale", a.depth_scale, "> 0 and at most 1 (m per count)");
    }
    if !(a.refine > 0.0 && a.refine <= 16.0) {
        return wrong("refine", a.refine, "> 0 and at most 16");
    }
    if let Some(fps) = a.fps
        && !(fps > 0.0 && fps <= 1e6)
    {
        return wrong("fps", fps, "> 0 and at most 1000000 (1/s)");
    }
    Ok(())
}

fn cameras(texts: &[String]) -> Result<Vec<Pinhole>, Error> {
    let mut cameras: Vec<Pinhole> = Vec::new();
    for (i, text) in texts.iter().enumerate() {
        let mut camera: Pinhole =
            text.parse().map_err(|e: CameraError| Error::option("camera", format!("\"{text}\""), e.to_string()))?;
        if !text.split_whitespace().any(|w| w.starts_with("name=")) {
            camera.name = format!("cam{i}");
        }
        if cameras.iter().any(|c| c.name == camera.name) {
            let message = format!("another camera is already named {}", camera.name);
            return Err(Error::option("camera", format!("\"{text}\""), message));
        }
        cameras.push(camera);
    }
    Ok(cameras)
}

fn times(a: &Arguments, experiment: &Experiment) -> Result<Vec<f64>, Error> {
    let time = &experiment.scene().time;
    let count = |step: f64| ((experiment.end_time() - experiment.start_time()) / step + 1e-9).floor() as usize;
    let evenly = |step: f64| (0..=count(step)).map(|k| experiment.start_time() + k as f64 * step).collect();
    if let Some(times) = &a.times {
        if times.is_empty() || !times.windows(2).all(|w| w[0] < w[1]) || times.iter().any(|t| !t.is_finite()) {
            return Err(Error::option("times", "", "give increasing times in seconds, separated by commas"));
        }
        return Ok(times.clone());
    }
    if let (None, true) = (a.fps, time.scheme.still) {
        return Ok(experiment.plan().times.clone());
    }
    let times: Vec<f64> = a.fps.map_or_else(|| evenly(time.step), |fps| evenly(1.0 / fps));
    if times.len() > 1_000_000 {
        return Err(Error::Input(format!("{} frames are too many; give --fps or --times", times.len())));
    }
    Ok(times)
}

/// Tracked points of a CSV file, each checked to lie on the surface.
fn markers(path: &Path, experiment: &Experiment) -> Result<Vec<(String, DVec3)>, Error> {
    let open = |e: csv::Error| InputError::file(path, format!("cannot be read: {e}"));
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(Cursor::new(read_bytes(path)?));
    if reader.headers().map_err(open)? != vec!["name", "x", "y", "z"] {
        return Err(InputError::line(path, 1, "the header must be name,x,y,z").into());
    }
    let allowed = 2.0 * experiment.plan().body.length;
    let mut markers: Vec<(String, DVec3)> = Vec::new();
    for row in reader.records() {
        let row = row.map_err(open)?;
        let line = row.position().map_or(0, |p| p.line() as usize);
        let wrong = |message: String| Error::from(InputError::line(path, line, message));
        let number = |i: usize| row.get(i).and_then(|s| s.parse::<f64>().ok()).filter(|x| x.is_finite());
        let (Some(x), Some(y), Some(z)) = (number(1), number(2), number(3)) else {
            return Err(wrong("x, y and z must be numbers (m)".into()));
        };
        let (name, p) = (row.get(0).unwrap_or_default().to_string(), DVec3::new(x, y, z));
        if name.is_empty() || markers.iter().any(|m| m.0 == name) {
            return Err(wrong(format!("name \"{name}\" must be there and not be used twice")));
        }
        let away = experiment.shape().signed_distance(p);
        if away.abs() > allowed {
            return Err(wrong(format!(
                "{name} lies {:.4} m away from the surface; allowed are {allowed:.4} m (two cells)",
                away.abs()
            )));
        }
        markers.push((name, p));
    }
    if markers.is_empty() {
        return Err(InputError::file(path, "holds no marker").into());
    }
    Ok(markers)
}

/// Tracked points of an array, each checked to lie on or in the body.
fn points(path: &Path, experiment: &Experiment) -> Result<Vec<DVec3>, Error> {
    let array = read_array(path, None)?;
    let wrong = |message: String| Error::from(InputError::file(path, message));
    if array.shape.len() != 2 || array.shape[1] != 3 || array.shape[0] == 0 {
        return Err(wrong(format!("has shape {}, expected (points, 3)", array.shape_text())));
    }
    let points: Vec<DVec3> = array.values.chunks_exact(3).map(DVec3::from_slice).collect();
    let allowed = 2.0 * experiment.plan().body.length;
    let away = |p: &DVec3| experiment.shape().signed_distance(*p);
    // What is no number is away as well.
    let far = points.iter().filter(|p| away(p).abs() > allowed || away(p).is_nan()).count();
    if far > 0 {
        let text = format!("{far} of {} points lie more than {allowed:.4} m (two cells) away from the surface", points.len());
        return Err(wrong(text));
    }
    Ok(points)
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    check(a)?;
    let cameras = cameras(&a.camera)?;
    if a.out.join("recording.toml").exists() && !a.force {
        return Err(Error::option("out", a.out.display(), "a recording is already there; add --force to replace it"));
    }
    crate::folder::check(&a.out)?;
    let mut track = console.progress(0, "observing");
    track.on(0, "reading");
    let coarse = Experiment::open_without_recording(&a.scene)?;
    let (backend, note) = a.backend.choose(coarse.plan(), 1, &mut track)?;
    track.aside(|| {
        console.warn(coarse.warnings());
        note.iter().for_each(|n| console.note(n));
    });
    let observers = Observers {
        cameras,
        markers: a.markers.as_deref().map_or(Ok(Vec::new()), |p| markers(p, &coarse))?,
        points: a.points.as_deref().map_or(Ok(Vec::new()), |p| points(p, &coarse))?,
        displacements: a.displacements,
        // The scene's own steps: the same frames whatever the refinement.
        times: times(a, &coarse)?,
        sensor: Sensor { noise: a.noise, dropout: a.dropout, depth_scale: a.depth_scale, seed: a.seed },
    };
    let experiment = if a.refine == 1.0 { coarse } else { coarse.refined(a.refine)? };
    // Whether the folder can be made is known before the simulation, not after it.
    let _lock = crate::folder::take(&a.out, console)?;
    console.interrupt.serve();
    track.measure(1000);
    let interrupt = console.interrupt.clone();
    let recording = observe(&experiment, backend, &observers, |share| {
        track.at((share * 1000.0) as u64, "");
        if interrupt.is_raised() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })?;
    track.finish();
    let readings: usize = recording.frames.iter().map(|f| f.readings().count()).sum();
    let samples = recording.markers.as_ref().map_or(0, |m| m.samples.len());
    let tracked = recording.points.as_ref().map_or(0, |p| p.track.readings());
    let displacements = recording.displacements.as_ref().map_or(0, |d| d.track.readings());
    if !recording.cameras.is_empty() && readings == 0 {
        let (scale, far) = (a.depth_scale, 65535.0 * a.depth_scale);
        let message = format!(
            "no pixel has a reading; 1 to 65535 counts reach from {scale:?} m to {far:?} m (--dropout {} loses more)",
            a.dropout
        );
        return Err(Error::option("depth-scale", format!("{scale:?}"), message));
    }
    if recording.markers.is_some() && samples == 0 {
        return Err(Error::option("dropout", a.dropout, "no marker is ever seen; make it smaller"));
    }
    palpate_io::write_recording(&a.out, &recording)?;

    if console.json() {
        console.print(&results::line(&ObservationDocument {
            recording: a.out.display().to_string(),
            backend: backend.name().into(),
            cameras: recording.cameras.len(),
            frames: observers.times.len(),
            images: recording.frames.len(),
            depth_readings: readings,
            marker_readings: samples,
            tracked_readings: tracked,
            displacements,
        }));
    } else {
        console.print(&format!(
            "{}: {} times, {} images with {readings} depth readings, {samples} marker readings, \
             {tracked} readings of points, {displacements} displacements",
            a.out.display(),
            observers.times.len(),
            recording.frames.len()
        ));
    }
    Ok(0)
}
