//! `palpate import`: what a camera or a motion-capture system left behind, as a recording and a first scene.

use crate::cli::Console;
use crate::error::Error;
use crate::options::count;
use crate::results;
use crate::results::import::{GuessDocument, ImportDocument};
use clap::Args;
use glam::{DAffine3, DVec3};
use palpate_import::{Background, Floor, Imported, Options, Unit, WRITING, Watch, corners, direction, import, rigid};
use std::ops::ControlFlow;
use std::path::PathBuf;

const AFTER_HELP: &str = "\
Examples: from a camera's folder to a fit in three commands
  palpate import  takes/ball --mesh ball.obj --far 0.9 --out ball
  palpate inspect ball/scene.toml
  palpate fit     ball/scene.toml --out found

More:
  palpate import take.csv --mesh beam.obj --clamp -0.01,-0.01,-0.01,0.001,0.04,0.04 --out beam
  palpate import bag/ --pick /camera/depth/image_rect_raw --background 0..9 --out ball
  palpate import clouds/ --fps 30 --unit mm --box -0.2,-0.2,0.3,0.2,0.2,0.9 --out ball

SOURCE is a file or a folder. The format is told by its content:
  ros2-mcap     ROS 2 bag: depth images and their camera info
  tum           TUM RGB-D folder: depth.txt, groundtruth.txt
  azure-kinect  depth images with the device's calibration or Open3D's intrinsic.json
  npy           NPZ, NPY: depth (frames, rows, columns) with K, or tracks (frames, points, 3)
  realsense     depth images (PNG, TIFF, NPY, raw) beside intrinsics in JSON, of any camera
  pcd, ply      sequence of point clouds
  c3d, optitrack, vicon, qualisys   labelled markers

FOLDER gets recording.toml, what it names, and scene.toml. The world's axes are those of the source. What nobody measured or said (unit, axis,
pose, floor, release time, material, …) is guessed, marked \"# guess:\" in these files and listed, each with the flag that replaces it.
A source that contradicts itself is refused. What a recording cannot hold is converted, and the loss is told.
The recording keeps every reading of the object; the scene uses about --points of them an image.
Ctrl-C stops before anything is written.";

/// Import a camera's folder or a motion-capture file as a recording and a first scene
#[derive(Clone, Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// File or folder
    source: PathBuf,
    /// Folder of the recording and the scene
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Format of the source [default: told by its content]
    #[arg(long, value_name = "NAME")]
    format: Option<String>,
    /// Surface of the object at rest (.obj, .ply, .stl) [default: a box around what is seen]
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Unit of the mesh: m, cm, mm, in, ft
    #[arg(long, value_name = "UNIT")]
    mesh_unit: Option<Unit>,
    /// From the mesh's axes to the world: x,y,z or x,y,z,qx,qy,qz,qw or 16 numbers, row by row [m]
    #[arg(long, value_name = "POSE", value_parser = rigid, allow_hyphen_values = true)]
    pose: Option<DAffine3>,
    /// From the camera's axes (x right, y down, z forward) to the world, as --pose
    #[arg(long, value_name = "POSE", value_parser = rigid, allow_hyphen_values = true)]
    camera_pose: Option<DAffine3>,
    /// Unit of lengths in the source: m, cm, mm, in, ft
    #[arg(long, value_name = "UNIT")]
    unit: Option<Unit>,
    /// Metres of one count of a depth image
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    depth_scale: Option<f64>,
    /// JSON file with the camera's intrinsics
    #[arg(long, value_name = "FILE")]
    intrinsics: Option<PathBuf>,
    /// Frames per second, where the source does not say it or says it wrongly
    #[arg(long, value_name = "F", allow_negative_numbers = true)]
    fps: Option<f64>,
    /// Upward direction in the source's axes: x, -y, … or x,y,z
    #[arg(long, value_name = "AXIS", value_parser = direction, allow_hyphen_values = true)]
    up: Option<DVec3>,
    /// Array or topic, where the source holds several
    #[arg(long, value_name = "NAME")]
    pick: Option<String>,
    /// Readings nearer than this are not the object [m]
    #[arg(long, value_name = "Z", allow_negative_numbers = true)]
    near: Option<f64>,
    /// Readings farther than this are not the object [m]
    #[arg(long, value_name = "Z", allow_negative_numbers = true)]
    far: Option<f64>,
    /// Only what lies in this box of the world is the object: x0,y0,z0,x1,y1,z1 [m]
    #[arg(long = "box", value_name = "BOX", value_parser = corners, allow_hyphen_values = true)]
    within: Option<[DVec3; 2]>,
    /// What was there without the object: frames (0 or 0..9), or a depth image
    #[arg(long, value_name = "FRAMES|FILE")]
    background: Option<Background>,
    /// The largest plane of the first image, and what lies behind it, is not the object
    #[arg(long)]
    remove_plane: bool,
    /// Height of the floor along the upward direction [m], or none
    #[arg(long, value_name = "H", allow_hyphen_values = true)]
    floor: Option<Floor>,
    /// Box that is held: x0,y0,z0,x1,y1,z1 [m]
    #[arg(long, value_name = "BOX", value_parser = corners, allow_hyphen_values = true)]
    clamp: Option<[DVec3; 2]>,
    /// When the motion begins, on the recording's clock [s]
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    release: Option<f64>,
    /// How long the motion is fitted [s]
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    duration: Option<f64>,
    /// Keep every N-th time of the source
    #[arg(long, value_name = "N", value_parser = count(1..=1_000_000), allow_negative_numbers = true)]
    every: Option<u64>,
    /// Depth readings an image that the scene uses [default: 2000]
    #[arg(long, value_name = "N", value_parser = count(1..=100_000_000), allow_negative_numbers = true)]
    points: Option<u64>,
    /// Standard deviation of a reading [m]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    noise: Option<f64>,
    /// Density of the object [kg/m³]
    #[arg(long, value_name = "D", allow_negative_numbers = true)]
    density: Option<f64>,
    /// Young's modulus that the fit begins with [Pa]
    #[arg(long, value_name = "E", allow_negative_numbers = true)]
    youngs: Option<f64>,
    /// Poisson's ratio
    #[arg(long, value_name = "NU", allow_negative_numbers = true)]
    poisson: Option<f64>,
    /// Overwrite a recording that is already there
    #[arg(long)]
    force: bool,
}

impl Arguments {
    fn options(&self) -> Options {
        let whole = |n: Option<u64>| n.map(|n| n as usize);
        Options {
            format: self.format.clone(),
            mesh: self.mesh.clone(),
            mesh_unit: self.mesh_unit,
            pose: self.pose,
            camera_pose: self.camera_pose,
            unit: self.unit,
            depth_scale: self.depth_scale,
            intrinsics: self.intrinsics.clone(),
            fps: self.fps,
            up: self.up,
            near: self.near,
            far: self.far,
            within: self.within,
            background: self.background.clone(),
            remove_plane: self.remove_plane,
            floor: self.floor,
            clamp: self.clamp,
            release: self.release,
            duration: self.duration,
            every: whole(self.every),
            points: whole(self.points),
            noise: self.noise,
            density: self.density,
            youngs_modulus: self.youngs,
            poisson_ratio: self.poisson,
            pick: self.pick.clone(),
            force: self.force,
        }
    }
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    crate::folder::check(&a.out)?;
    let mut track = console.progress(1000, "importing");
    let interrupt = console.interrupt.clone();
    // Its folder is taken once there is something to write.
    let mut lock = None;
    let mut look = |share: f64, what: &str| {
        if what == WRITING && lock.is_none() {
            lock = Some(crate::folder::take(&a.out, console));
            interrupt.serve();
            if lock.as_ref().is_some_and(Result::is_err) {
                return ControlFlow::Break(());
            }
        }
        track.at((share * 1000.0) as u64, what);
        if interrupt.is_raised() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let imported = import(&a.source, &a.out, &a.options(), &mut Watch::new(&mut look));
    let _lock = lock.transpose()?;
    let imported = imported?;
    track.finish();
    console.warn(&imported.warnings);
    console.warn(&imported.losses);
    let text = if console.json() { results::line(&document(&imported)) } else { report(a, &imported) };
    console.print(&text);
    Ok(0)
}

fn report(a: &Arguments, i: &Imported) -> String {
    let mut t = format!("{}: {} ({})\n", a.source.display(), i.format, i.why);
    let [from, to] = i.times;
    t += &format!("  {from:.3} to {to:.3} s");
    for (n, what) in [
        (i.images, "depth images"),
        (i.clouds, "point clouds"),
        (i.cameras, "cameras"),
        (i.depth_readings, "depth readings of the object"),
        (i.marker_readings, "readings of markers"),
        (i.tracked_readings, "readings of points"),
    ] {
        if n > 0 {
            t += &format!(", {n} {what}");
        }
    }
    t.push('\n');
    i.facts.iter().for_each(|f| t += &format!("  {f}\n"));
    t += "guesses, each marked in its file:\n";
    i.guesses.iter().for_each(|g| t += &format!("  {}\n", g.line()));
    t + &format!(
        "wrote {} and {}\nnext: palpate inspect {}, then palpate fit {1}",
        i.recording.display(),
        i.scene.display(),
        i.scene.display()
    )
}

fn document(i: &Imported) -> ImportDocument {
    let guess = |g: &palpate_import::Guess| GuessDocument { about: g.what.into(), text: g.text.clone(), fix: g.fix.clone() };
    ImportDocument {
        recording: i.recording.display().to_string(),
        scene: i.scene.display().to_string(),
        source_format: i.format.into(),
        why: i.why.clone(),
        cameras: i.cameras,
        images: i.images,
        clouds: i.clouds,
        depth_readings: i.depth_readings,
        marker_readings: i.marker_readings,
        tracked_readings: i.tracked_readings,
        times: i.times,
        guesses: i.guesses.iter().map(guess).collect(),
        facts: i.facts.clone(),
        losses: i.losses.clone(),
    }
}
