//! From what cameras and motion capture leave behind to a recording and a first scene.
//!
//! Invariant: whatever leaves this room was either said by the source, or by the user, or is marked as a guess; what a recording cannot hold is
//! converted with a word about the loss, or refused. A source that contradicts itself is refused with the file and what is wrong in it. This
//! room does not simulate.

mod arrays;
mod budget;
mod capture;
mod error;
mod formats;
mod images;
mod intrinsics;
mod lens;
mod options;
mod pickle;
mod place;
mod stages;
mod times;
mod torch;
mod write;

pub use capture::{Guess, Spot};
pub use error::ImportError;
pub use options::{Background, Floor, Options, Unit, corners, direction, numbers, rigid};

use capture::{Capture, DepthFrame};
use error::{refuse, refuse_option};
use glam::DVec3;
use palpate_io::Recording;
use palpate_io::output::{make_folder, write_file};
use stages::body::Seen;
use stages::release::Motion;
use stages::settle::Said;
use stages::{body, clouds, crop, masks, points, release, settle, thin};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Formats that are read: name and what it is.
pub fn formats() -> impl Iterator<Item = (&'static str, &'static str)> {
    formats::ALL.iter().map(|f| (f.name, f.what))
}

/// Tells how far an import is, and whether it shall go on.
pub struct Watch<'a> {
    look: &'a mut dyn FnMut(f64, &str) -> ControlFlow<()>,
}

impl<'a> Watch<'a> {
    /// A watch that calls this with the share of a stage that is done, and the stage's name.
    pub fn new(look: &'a mut dyn FnMut(f64, &str) -> ControlFlow<()>) -> Watch<'a> {
        Watch { look }
    }

    pub(crate) fn at(&mut self, done: usize, of: usize, what: &str) -> Result<(), ImportError> {
        match (self.look)(done as f64 / of.max(1) as f64, what) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(ImportError::Interrupted),
        }
    }
}

/// What was imported.
#[derive(Clone, Debug)]
pub struct Imported {
    /// Name of the source's format.
    pub format: &'static str,
    /// Why it was taken for that.
    pub why: String,
    /// The recording's file.
    pub recording: PathBuf,
    /// The scene's file.
    pub scene: PathBuf,
    /// Cameras.
    pub cameras: usize,
    /// Depth images.
    pub images: usize,
    /// Point clouds.
    pub clouds: usize,
    /// Depth readings of the object, points of clouds among them.
    pub depth_readings: usize,
    /// Readings of markers.
    pub marker_readings: usize,
    /// Readings of tracked points.
    pub tracked_readings: usize,
    /// First and last time [s].
    pub times: [f64; 2],
    /// What was assumed, each marked in its file.
    pub guesses: Vec<Guess>,
    /// What is known, worth a word.
    pub facts: Vec<String>,
    /// What the source holds and the recording does not.
    pub losses: Vec<String>,
    /// What reading the mesh had to say.
    pub warnings: Vec<String>,
}

/// Reads a source and writes `recording.toml`, what it names, and `scene.toml` into a folder.
///
/// # Errors
/// The first thing that is wrong with the source or an option, or a file that cannot be written; nothing is written then but, in the last
/// case, files without a `recording.toml`.
pub fn import(source: &Path, out: &Path, o: &Options, watch: &mut Watch) -> Result<Imported, ImportError> {
    check(o)?;
    for name in ["recording.toml", "scene.toml"] {
        if out.join(name).exists() && !o.force {
            return refuse_option("out", out.display(), format!("{name} is already there; add --force to replace it"));
        }
    }
    apart(source, out)?;
    watch.at(0, 1, "looking at the source")?;
    let place = place::Place::open(source)?;
    let (format, why) = formats::choose(&place, o.format.as_deref())?;
    let mut capture = (format.read)(&place, o, watch)?;
    thin_frames(&mut capture, o)?;
    let mut said = Said {
        guesses: std::mem::take(&mut capture.guesses),
        facts: std::mem::take(&mut capture.facts),
        losses: std::mem::take(&mut capture.losses),
    };
    let up = up(&capture, o, &mut said);
    let empty = add_background(&mut capture, o)?;
    let mut kept = None;
    if !capture.clouds.is_empty() {
        let places = capture.clouds.iter().flat_map(|c| c.points.iter().copied());
        // A background is taken away pixel by pixel.
        let as_images = o.background.is_some();
        let metres = points::unit(&capture, &place, places, if as_images { "camera" } else { "cloud" }, o, &mut said)?;
        if as_images {
            let made = clouds::camera(&capture.clouds, capture.viewpoint, metres, o, &mut said, watch)?;
            capture.cameras.push(made);
        } else {
            kept = Some(clouds::keep(&capture.clouds, capture.viewpoint, metres, o, &mut said)?);
        }
    }
    let mut r = settle::depth(&mut capture, o, &mut said, watch)?;
    if let Some(m) = &capture.markers {
        let metres = points::unit(&capture, &place, m.places.iter().flatten().copied(), "markers.file", o, &mut said)?;
        r.markers = Some(points::markers(m, metres, o, &mut said));
    }
    if let Some(t) = &capture.tracks {
        let metres = points::unit(&capture, &place, t.places.iter().copied(), "points.file", o, &mut said)?;
        r.points = Some(points::tracks(t, metres, o, &mut said));
    }
    // The image without the object came along with the others, behind the last.
    let empty = empty.then(|| r.frames.pop().and_then(|f| f.depth)).flatten();
    let mut plane = masks::apply(&mut r, o, empty, &mut said, watch)?;
    let mut sight = None;
    if let Some(k) = kept {
        (r.clouds, plane, sight) = (k.clouds, k.plane, k.sight);
    }
    said.facts.extend(plane.as_ref().map(masks::describe));
    crop::apply(&mut r, &mut said);
    r.source = format!("imported by palpate from {} ({})", place.title(), format.name);
    let times = times(&r);
    let Some([first, last]) = times else { return refuse(&place.path, "holds no reading") };
    let motion = match &capture.equilibria {
        None => release::find(&r, o, &mut said),
        Some(_) => {
            for (option, given) in [("release", o.release), ("duration", o.duration)] {
                if let Some(x) = given {
                    return refuse_option(option, x, "belongs to a motion; the frames of this source are equilibria");
                }
            }
            let text = "every frame is an equilibrium, as the source's were simulated; nothing moves by itself between them";
            said.facts.push(text.into());
            Motion::Sequence { first }
        }
    };
    if let Motion::Moving { from, .. } = motion
        && from >= last
    {
        return refuse_option("release", from, format!("comes after the last time, {last} s"));
    }
    points::at_rest(&mut r, motion, &place, &mut said)?;
    let before = if let Motion::Moving { from, .. } = motion { from.max(first) } else { first };
    let everything = seen_points(&r, |_| true);
    let at_rest = seen_points(&r, |t| t <= before + 1e-9);
    // Where nothing was seen at rest, what is seen first.
    let at_rest = if at_rest.is_empty() { everything.clone() } else { at_rest };
    let Some(bounds) = masks::bounds(&at_rest) else { return refuse(&place.path, "holds no reading") };
    let sight = sight.or((r.cameras.len() == 1 && !r.frames.is_empty()).then(|| r.cameras[0].axis()));
    let seen = Seen { points: &at_rest, bounds, sight, on_surface: r.markers.is_none() };
    let body = body::make(o, &seen, &mut said)?;
    let window = write::scene::window(motion, last, o, &mut said);
    // Frames to train on are counted among those that are compared.
    let counted = capture.equilibria.as_ref().is_some_and(|e| !e.train.is_empty());
    let thinned = match counted {
        true => thin::Thinned { stride: 1, every: 1 },
        false => thin::choose(&r, window.0, window.1, o, &mut said),
    };
    let lowest = lowest(&everything, up);
    let cost = if r.markers.is_some() {
        "markers"
    } else if r.points.is_some() {
        "points"
    } else {
        "sparse-surface"
    };
    let parts = write::scene::Parts {
        title: &r.title,
        body: &body,
        up,
        motion,
        window,
        last,
        lowest,
        plane,
        held: if motion == Motion::Still { None } else { points::held(&r) },
        equilibria: capture.equilibria.as_ref(),
        tracks: r.points.as_ref().map_or(0, |p| p.rest.len()),
        cost,
        thinned,
    };
    let scene = write::scene::text(&parts, o, &mut said);
    watch.at(0, 1, WRITING)?;
    write_all(out, &r, &body, &scene, &said)?;
    for (name, text) in &capture.beside {
        write_file(out.join(name), |w| w.write_all(text.as_bytes()))?;
    }
    Ok(Imported {
        format: format.name,
        why,
        recording: out.join("recording.toml"),
        scene: out.join("scene.toml"),
        cameras: r.cameras.len(),
        images: r.frames.len(),
        clouds: r.clouds.len(),
        depth_readings: r.frames.iter().map(|f| f.readings().count()).chain(r.clouds.iter().map(|c| c.points.len())).sum(),
        marker_readings: r.markers.as_ref().map_or(0, |m| m.samples.len()),
        tracked_readings: r.points.as_ref().map_or(0, |p| p.track.readings()),
        times: [first, last],
        guesses: said.guesses,
        facts: said.facts,
        losses: said.losses,
        warnings: body.warnings,
    })
}

/// What is heard before anything is written.
pub const WRITING: &str = "writing";

/// Refuses to write among what is read: images could be written over, and the next import would read what this one wrote.
fn apart(source: &Path, out: &Path) -> Result<(), ImportError> {
    let mut there = std::path::absolute(out).unwrap_or_else(|_| out.to_path_buf());
    while !there.exists() && there.pop() {}
    match (source.canonicalize(), there.canonicalize()) {
        (Ok(s), Ok(o)) if s.is_dir() && o.starts_with(&s) => {
            refuse_option("out", out.display(), format!("lies in the source, {}; choose a folder beside it", source.display()))
        }
        _ => Ok(()),
    }
}

fn check(o: &Options) -> Result<(), ImportError> {
    let positive: [(&'static str, Option<f64>, f64, &str); 6] = [
        ("noise", o.noise, 1.0, "at most 1 (m)"),
        ("duration", o.duration, 1e4, "at most 10000 (s)"),
        ("density", o.density, 1e5, "at most 100000 (kg/m³)"),
        ("youngs", o.youngs_modulus, 1e13, "at most 1e13 (Pa)"),
        ("fps", o.fps, 1e6, "at most 1000000 (1/s)"),
        ("depth-scale", o.depth_scale, 1.0, "at most 1 (m per count)"),
    ];
    for (option, value, most, allowed) in positive {
        if let Some(x) = value.filter(|x| !(*x > 0.0 && *x <= most)) {
            return refuse_option(option, x, format!("must be > 0 and {allowed}"));
        }
    }
    if let Some(x) = o.noise.filter(|x| *x < 1e-9) {
        return refuse_option("noise", x, "must be at least 1e-9 (m)");
    }
    if let Some(x) = o.poisson_ratio.filter(|x| !(*x > -1.0 && *x < 0.5)) {
        return refuse_option("poisson", x, "must lie in (-1, 0.5)");
    }
    if let Some(x) = o.release.filter(|x| !x.is_finite()) {
        return refuse_option("release", x, "must be a finite time (s)");
    }
    for (option, n) in [("every", o.every), ("points", o.points)] {
        if n == Some(0) {
            return refuse_option(option, 0, "must be a whole number from 1");
        }
    }
    Ok(())
}

/// Leaves every n-th time.
fn thin_frames(c: &mut Capture, o: &Options) -> Result<(), ImportError> {
    let Some(n) = o.every.filter(|n| *n > 1) else { return Ok(()) };
    fn nth<T>(all: &mut Vec<T>, n: usize) {
        let mut k = 0;
        all.retain(|_| {
            k += 1;
            (k - 1) % n == 0
        });
    }
    for camera in &mut c.cameras {
        if camera.poses.len() == camera.frames.len() && camera.poses.len() > 1 {
            nth(&mut camera.poses, n);
        }
        nth(&mut camera.frames, n);
    }
    nth(&mut c.clouds, n);
    if let Some(m) = &mut c.markers {
        let count = m.names.len();
        m.places = m.places.chunks(count.max(1)).step_by(n).flatten().copied().collect();
        nth(&mut m.times, n);
    }
    if let Some(t) = &mut c.tracks {
        t.places = t.places.chunks(t.count.max(1)).step_by(n).flatten().copied().collect();
        nth(&mut t.times, n);
    }
    if let Some(e) = &mut c.equilibria {
        e.train = e.train.iter().filter(|k| k.is_multiple_of(n)).map(|k| k / n).collect();
    }
    Ok(())
}

/// The upward direction: of the user, of the source, or of what is usual.
fn up(c: &Capture, o: &Options, said: &mut Said) -> DVec3 {
    if let Some(up) = o.up {
        return up;
    }
    let camera = !c.cameras.is_empty() && o.camera_pose.is_none() && c.cameras.iter().all(|c| c.poses.is_empty());
    let (up, why) = match &c.up {
        Some((up, why)) => (*up, why.clone()),
        None if camera => (DVec3::NEG_Y, "-y, against the camera's y: it was held level".to_string()),
        None => (DVec3::Z, "z, as usual".to_string()),
    };
    said.guesses.push(Guess::scene("axis", "world.gravity", format!("up is {why}"), "--up"));
    up
}

/// Puts the user's image of the empty scene behind the images of the only camera.
fn add_background(c: &mut Capture, o: &Options) -> Result<bool, ImportError> {
    let Some(Background::File(path)) = &o.background else { return Ok(false) };
    let [camera] = &mut c.cameras[..] else {
        return refuse_option("background", path.display(), "needs one camera that stands still");
    };
    if camera.poses.len() > 1 {
        return refuse_option("background", path.display(), "needs one camera that stands still");
    }
    let (_, pixels) = images::read_depth(path, Some(camera.size))?;
    if std::mem::discriminant(&pixels) != std::mem::discriminant(&camera.frames[0].pixels) {
        return refuse(path, "holds counts where the other images hold floats, or the other way round");
    }
    camera.frames.push(DepthFrame { time: f64::INFINITY, file: path.clone(), pixels, mask: None });
    Ok(true)
}

/// First and last time at which anything was measured.
fn times(r: &Recording) -> Option<[f64; 2]> {
    let images = r.frames.iter().map(|f| f.time);
    let markers = r.markers.iter().flat_map(|m| m.samples.iter().map(|s| s.time));
    let tracks = r.points.iter().flat_map(|p| p.track.times.iter().copied());
    images
        .chain(r.clouds.iter().map(|c| c.time))
        .chain(markers)
        .chain(tracks)
        .fold(None, |span: Option<[f64; 2]>, t| Some(span.map_or([t, t], |[a, b]| [a.min(t), b.max(t)])))
}

/// World points at some times; of dense images a part.
fn seen_points(r: &Recording, at: impl Fn(f64) -> bool) -> Vec<DVec3> {
    let mut all = Vec::new();
    for f in r.frames.iter().filter(|f| at(f.time)) {
        let camera = &r.cameras[f.camera];
        let every = (f.readings().count() / 5000).max(1);
        let some = f.readings().step_by(every);
        all.extend(some.filter_map(|(u, v, c)| camera.point(u as f64, v as f64, camera.depth(c))));
    }
    for c in r.clouds.iter().filter(|c| at(c.time)) {
        all.extend(c.points.iter().step_by((c.points.len() / 5000).max(1)));
    }
    if let Some(m) = &r.markers {
        all.extend(m.samples.iter().filter(|s| at(s.time)).map(|s| s.position));
    }
    if let Some(p) = &r.points {
        let times = p.track.times.iter().enumerate().filter(|(_, t)| at(**t));
        all.extend(times.flat_map(|(k, _)| p.track.seen(k).map(|s| s.1)));
    }
    all
}

/// Height under which only one in a thousand points lies.
fn lowest(points: &[DVec3], up: DVec3) -> f64 {
    let mut heights: Vec<f64> = points.iter().map(|p| p.dot(up)).collect();
    let k = heights.len() / 1000;
    if heights.is_empty() { 0.0 } else { *heights.select_nth_unstable_by(k, f64::total_cmp).1 }
}

fn write_all(out: &Path, r: &Recording, body: &body::Body, scene: &str, said: &Said) -> Result<(), ImportError> {
    make_folder(out)?;
    if let Some(mesh) = &body.mesh {
        palpate_io::write_obj(out.join("object.obj"), mesh)?;
    }
    palpate_io::write_recording(out, r)?;
    let (mut of_recording, mut of_scene) = (Vec::<(&str, &Guess)>::new(), Vec::<(&str, &Guess)>::new());
    for g in &said.guesses {
        match &g.spot {
            Spot::Recording(key) => of_recording.push((key, g)),
            Spot::Scene(key) => of_scene.push((key, g)),
        }
    }
    let path = out.join("recording.toml");
    let plain = error::read_text(&path)?;
    let head: Vec<String> = said.losses.iter().map(|l| format!("lost: {l}")).collect();
    let put = |path: &Path, text: &str, guesses: &[(&str, &Guess)], head: &[String]| -> Result<(), ImportError> {
        match write::mark::mark(text, guesses, head) {
            Ok(marked) => Ok(write_file(path, |w| w.write_all(marked.as_bytes()))?),
            Err(e) => refuse(path, format!("was written and is no TOML: {e}")),
        }
    };
    put(&path, &plain, &of_recording, &head)?;
    let head = [
        "Written by `palpate import`. What nobody measured or said is marked \"guess\": check it, or give the flag that is named.",
        "palpate inspect shows what would be simulated, palpate fit fits it.",
    ];
    put(&out.join("scene.toml"), scene, &of_scene, &head.map(String::from))
}
