//! A ball that is let go in front of a wall, and what instruments see of it.

use glam::DVec3;
use palpate_import::{ImportError, Imported, Options, Watch, import};
use palpate_io::recording::Recording;
use palpate_io::{read_recording, read_scene};
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

pub const RADIUS: f64 = 0.05;
pub const WALL: f64 = 1.2;
pub const SIZE: [usize; 2] = [120, 160];
pub const FOCAL: f64 = 150.0;
pub const CENTER: [f64; 2] = [60.5, 40.25];
pub const FRAMES: usize = 12;
pub const RATE: f64 = 30.0;
/// When the ball is let go [s].
pub const RELEASE: f64 = 0.1;

/// Centre of the ball in the camera's axes (y down) [m].
pub fn center(t: f64) -> DVec3 {
    let fallen = 0.5 * 9.81 * (t - RELEASE).max(0.0).powi(2);
    DVec3::new(0.01, -0.05 + fallen, 0.6)
}

/// Depth along the axis of a ray (x/z, y/z): the ball or the wall.
pub fn depth(ray: [f64; 2], t: f64) -> f64 {
    let d = DVec3::new(ray[0], ray[1], 1.0);
    let c = center(t);
    // |z d − c|² = r², the nearer root.
    let (a, b) = (d.dot(d), d.dot(c));
    let disc = b * b - a * (c.dot(c) - RADIUS * RADIUS);
    if disc < 0.0 { WALL } else { (b - disc.sqrt()) / a }
}

/// Ray of a pixel of the pinhole camera.
pub fn ray(i: usize) -> [f64; 2] {
    [((i % SIZE[0]) as f64 - CENTER[0]) / FOCAL, ((i / SIZE[0]) as f64 - CENTER[1]) / FOCAL]
}

/// Depth image of the pinhole camera in metres.
pub fn image(t: f64) -> Vec<f64> {
    (0..SIZE[0] * SIZE[1]).map(|i| depth(ray(i), t)).collect()
}

/// In counts.
pub fn counts(t: f64, scale: f64) -> Vec<u16> {
    image(t).iter().map(|z| (z / scale).round() as u16).collect()
}

pub fn png(path: &Path, counts: &[u16], size: [usize; 2]) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let image = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(size[0] as u32, size[1] as u32, counts.to_vec()).unwrap();
    image.save(path).unwrap();
}

pub fn time(k: usize) -> f64 {
    k as f64 / RATE
}

/// Points of the ball's surface that move with it: markers.
pub fn marks() -> Vec<DVec3> {
    let turned =
        |k: f64| DVec3::new((2.4 * k).cos() * (1.0 - 0.3 * k).sqrt(), (2.4 * k).sin() * (1.0 - 0.3 * k).sqrt(), 0.5 * k - 0.6);
    (0..4).map(|k| turned(f64::from(k) * 0.7).normalize() * RADIUS).collect()
}

/// A folder that goes with the test.
pub struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    pub fn new() -> Bench {
        Bench { folder: tempfile::tempdir().unwrap() }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, text).unwrap();
        path
    }

    /// Imports a source below this folder.
    pub fn import(&self, source: &str, o: &Options) -> Result<Imported, ImportError> {
        import(&self.path(source), &self.path("out"), o, &mut Watch::new(&mut |_, _| ControlFlow::Continue(())))
    }

    /// Imports what must be in order, reads it back and checks that the scene goes with the recording.
    pub fn good(&self, source: &str, o: &Options) -> (Imported, Recording, String) {
        let imported = self.import(source, o).unwrap_or_else(|e| panic!("{e}"));
        let recording = read_recording(self.path("out")).unwrap();
        let scene = read_scene(self.path("out/scene.toml")).unwrap().value;
        let spec = scene.observation.as_ref().unwrap();
        let (observation, _) = recording.observation(spec, &mut Vec::new()).unwrap();
        let (low, high) = palpate_model::shape::shape_of(&scene.object).bounds();
        palpate_io::check_overlap(&observation, low, high).unwrap();
        let text = fs::read_to_string(self.path("out/scene.toml")).unwrap();
        let both = text.clone() + &fs::read_to_string(self.path("out/recording.toml")).unwrap();
        for g in &imported.guesses {
            assert!(both.contains(&format!("# guess: {}", g.line())), "{} is marked nowhere", g.line());
            assert!(g.fix.contains("--") || g.fix.contains("[["), "{} has no way out", g.line());
        }
        (imported, recording, text)
    }

    /// What is wrong with a source.
    pub fn bad(&self, source: &str, o: &Options) -> String {
        match self.import(source, o) {
            Ok(_) => panic!("{source} was imported"),
            Err(e) => {
                assert!(!self.path("out/recording.toml").exists(), "{e}: something was written");
                e.to_string()
            }
        }
    }
}

/// Greatest distance of the recorded depth points from the surface of the ball at their time [m], and how many there are.
pub fn off_ball(r: &Recording) -> (f64, usize) {
    let (mut off, mut n) = (0.0, 0);
    for f in &r.frames {
        let camera = &r.cameras[f.camera];
        for (u, v, c) in f.readings() {
            let p = camera.point(u as f64, v as f64, camera.depth(c)).unwrap();
            off = f64::max(off, (p.distance(center(f.time)) - RADIUS).abs());
            n += 1;
        }
    }
    (off, n)
}

/// A surface of the ball about the origin, as OBJ.
pub fn ball_obj(scale: f64) -> String {
    use palpate_model::scene::Analytic;
    use palpate_model::shape::{Placed, Shape};
    let ball = Placed::new(Analytic::Ball { radius: RADIUS, center: DVec3::ZERO }, glam::DAffine3::IDENTITY);
    let mesh = ball.surface(0.01);
    let v: String = mesh.vertices.iter().map(|v| format!("v {} {} {}\n", v.x * scale, v.y * scale, v.z * scale)).collect();
    let t: String = mesh.triangles.iter().map(|t| format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1)).collect();
    v + &t
}

/// Bytes that are cut, changed or lack a piece, another way for every `k`.
pub fn damaged(bytes: &[u8], k: usize) -> Vec<u8> {
    let mut b = bytes.to_vec();
    let at = (k * 104_729) % b.len();
    match k % 3 {
        0 => b.truncate(at),
        1 => (0..k).for_each(|j| {
            let at = (j * 7919 + k * 104_729) % b.len();
            b[at] = b[at].wrapping_mul(31).wrapping_add(k as u8);
        }),
        _ => drop(b.drain(at..(at + 40).min(b.len()))),
    }
    b
}
