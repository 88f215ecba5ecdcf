//! Recordings of the tetrahedra: seen by depth cameras or a motion-capture system with their errors.

use super::change::Change;
use super::element::face_shape;
use super::mesh::Mesh;
use super::motion::Motion;
use glam::{DAffine3, DQuat, DVec3};
use palpate::Error;
use palpate::render::{Pinhole, Sensor, rasterise};
use palpate::synthetic::recorded_camera;
use palpate_io::recording::{DepthImage, DepthPixels, MarkerSample, RecordedCamera, RecordedFrame, RecordedMarkers, Recording};
use palpate_model::observation::MarkerRest;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::path::PathBuf;

/// Metres per count: rounding stays far below the noise.
const DEPTH_SCALE: f64 = 5e-5;
/// Every edge of a quadratic triangle is drawn as so many straight ones: with four, a ball of 50 mm reads 0.1 mm too small.
const PARTS: usize = 16;

/// What watches a body.
#[derive(Clone, Debug)]
pub struct Watchers {
    /// Depth cameras.
    pub cameras: Vec<Pinhole>,
    /// Markers on the surface of the stated shape [m].
    pub markers: Vec<(String, DVec3)>,
    /// Noise of a depth reading and of a marker's coordinate [m].
    pub noise: f64,
    /// Noise that the recording states [m]: of noiseless ones that of others.
    pub stated: f64,
    /// Seed of the noise.
    pub seed: u64,
}

/// A recording of a motion, as these watchers, with the errors of a change, make it.
///
/// # Errors
/// A camera never sees the body.
pub fn record(motion: &Motion, change: &Change, w: &Watchers) -> Result<Recording, Error> {
    let mut rng = ChaCha8Rng::seed_from_u64(w.seed);
    let mut frames = Vec::new();
    let sensor = Sensor { noise: w.noise, dropout: 0.0, depth_scale: DEPTH_SCALE, seed: w.seed };
    for (k, now) in motion.instants.iter().enumerate() {
        let (vertices, triangles) = surface(&motion.mesh, &now.places);
        for (number, camera) in w.cameras.iter().enumerate() {
            let truly = drifted(camera, number, change, now.time);
            let mut exact = rasterise(&truly, &vertices, &triangles);
            let width = exact.width;
            for (i, z) in exact.depth.iter_mut().enumerate() {
                *z = reading(change, camera, [i % width, i / width], *z);
            }
            if exact.covered() > 0 {
                let read = sensor.read(&exact, (k * w.cameras.len() + number) as u64);
                let depth = DepthImage { width: read.width, height: read.height, pixels: DepthPixels::Counts(read.counts) };
                let time = now.time + change.clock;
                frames.push(RecordedFrame { camera: number, time, depth: Some(depth), mask: Some(read.mask) });
            }
        }
    }
    for (i, c) in w.cameras.iter().enumerate() {
        if !frames.iter().any(|f| f.camera == i) {
            return Err(Error::Input(format!("camera \"{}\" never sees the body", c.name)));
        }
    }
    let stated_sensor = Sensor { noise: w.stated, ..sensor };
    Ok(Recording {
        path: PathBuf::from("recording.toml"),
        title: "Synthetic".into(),
        source: "Quadratic tetrahedra".into(),
        cameras: w.cameras.iter().enumerate().map(|(i, c)| stated(c, i, change, &stated_sensor)).collect(),
        frames,
        clouds: Vec::new(),
        markers: (!w.markers.is_empty()).then(|| tracked(w, change, motion, &mut rng)),
        points: None,
        displacements: None,
        warnings: Vec::new(),
    })
}

/// The deformed surface in flat triangles.
fn surface(mesh: &Mesh, places: &[DVec3]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    let n = PARTS;
    for face in &mesh.faces {
        let first = vertices.len() as u32;
        // Rows of a triangle: row i has n + 1 − i points.
        let number = |i: usize, j: usize| first + (i * (n + 1) - i * i.saturating_sub(1) / 2 + j) as u32;
        for i in 0..=n {
            for j in 0..=n - i {
                let l = [i as f64, j as f64, (n - i - j) as f64].map(|x| x / n as f64);
                vertices.push(carried(face, l, places));
                if i + j < n {
                    triangles.push([number(i, j), number(i + 1, j), number(i, j + 1)]);
                }
                if i + j + 1 < n {
                    triangles.push([number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)]);
                }
            }
        }
    }
    (vertices, triangles)
}

/// A point of a face.
fn carried(face: &[usize; 6], l: [f64; 3], places: &[DVec3]) -> DVec3 {
    face.iter().zip(face_shape(l)).map(|(n, s)| s * places[*n]).sum()
}

/// What a camera reads where the true depth is `z` [m].
fn reading(change: &Change, camera: &Pinhole, pixel: [usize; 2], z: f64) -> f64 {
    let [x, y] = [(pixel[0] as f64 - camera.cx) / camera.fx, (pixel[1] as f64 - camera.cy) / camera.fy];
    let slant = 1.0 + change.along_ray * ((1.0 + x * x + y * y).sqrt() - 1.0);
    z * slant * (1.0 + change.depth_scale) + change.depth_bias + change.outside.map_or(0.0, |o| o.added(pixel))
}

/// Where the first camera really stands: it may drift.
fn drifted(c: &Pinhole, number: usize, change: &Change, time: f64) -> Pinhole {
    let mut out = c.clone();
    if let (0, Some(outside)) = (number, &change.outside) {
        out.world_from_camera.translation += outside.drifted(time);
    }
    out
}

/// The camera as the recording states it; the first may stand elsewhere.
fn stated(c: &Pinhole, number: usize, change: &Change, sensor: &Sensor) -> RecordedCamera {
    let [moved, turned] = if number == 0 { change.camera } else { [DVec3::ZERO; 2] };
    let turn = glam::DMat3::from_quat(DQuat::from_scaled_axis(turned));
    let pose = c.world_from_camera;
    RecordedCamera {
        world_from_camera: DAffine3::from_mat3_translation(turn * pose.matrix3, pose.translation + moved),
        ..recorded_camera(c, sensor)
    }
}

/// The markers: points of the surface, wherever it goes. One that sits elsewhere than stated does so by its offset in the stated shape.
fn tracked(w: &Watchers, change: &Change, motion: &Motion, rng: &mut ChaCha8Rng) -> RecordedMarkers {
    let truly = |k: usize, p: DVec3| change.marker.filter(|m| m.0 == k).map_or(p, |m| p + m.1);
    let sites: Vec<(usize, [f64; 3])> = w.markers.iter().enumerate().map(|(k, m)| motion.mesh.nearest(truly(k, m.1))).collect();
    let mut samples = Vec::new();
    for now in &motion.instants {
        for (marker, (face, l)) in sites.iter().enumerate() {
            let noise = DVec3::from([0; 3].map(|_| StandardNormal.sample(rng)));
            let position = carried(&motion.mesh.faces[*face], *l, &now.places) + w.noise * noise;
            samples.push(MarkerSample { time: now.time + change.clock, marker, position });
        }
    }
    let rest = |(name, p): &(String, DVec3)| MarkerRest { name: name.clone(), position: *p, surface: Some(*p) };
    RecordedMarkers {
        file: PathBuf::from("markers.csv"),
        names: w.markers.iter().map(|m| m.0.clone()).collect(),
        samples,
        noise_sigma: Some(w.stated.max(1e-6)),
        noise_systematic: 0.0,
        rest: w.markers.iter().map(rest).collect(),
    }
}
