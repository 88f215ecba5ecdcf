//! Recordings of the tetrahedra: simulated, seen by depth cameras or a motion-capture system with their errors, and written.

use super::cases::Truth;
use super::element::face_shape;
use super::integrator::{Integrator, State};
use super::mesh::Mesh;
use super::scenes::{Independent, MARKER_NOISE};
use glam::{DAffine3, DQuat, DVec3};
use palpate::render::{Pinhole, Sensor, rasterise};
use palpate::synthetic::recorded_camera;
use palpate::{Error, Experiment};
use palpate_io::recording::{DepthImage, MarkerSample, RecordedCamera, RecordedFrame, RecordedMarkers, Recording};
use palpate_io::write_recording;
use palpate_model::observation::MarkerRest;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::path::{Path, PathBuf};

/// Metres per count: rounding stays far below the noise.
const DEPTH_SCALE: f64 = 5e-5;
/// Every edge of a quadratic triangle is drawn as so many straight ones.
const PARTS: usize = 4;

/// Places of the nodes at a time.
struct Instant {
    time: f64,
    places: Vec<DVec3>,
}

/// Records a true body and opens the experiment that the diagnosis gets, with the recording kept in `folder`.
///
/// # Errors
/// The body cannot be simulated, or the recording not written or read.
pub fn observed(scene: &Independent, truth: &Truth, seed: u64, folder: &Path, other: bool) -> Result<Experiment, Error> {
    let setup = &scene.setup;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let instants = simulate(scene, truth, other)?;
    let mesh = scene.mesh();
    let mut frames = Vec::new();
    let cameras = setup.cameras()?;
    let sensor = Sensor { noise: scene.depth_noise, dropout: 0.0, depth_scale: DEPTH_SCALE, seed };
    for (k, now) in instants.iter().enumerate() {
        let (vertices, triangles) = surface(&mesh, &now.places);
        for (number, camera) in cameras.iter().enumerate() {
            let mut exact = rasterise(camera, &vertices, &triangles);
            let width = exact.width;
            for (i, z) in exact.depth.iter_mut().enumerate() {
                *z = reading(truth, camera, [i % width, i / width], *z);
            }
            if exact.covered() > 0 {
                let read = sensor.read(&exact, (k * cameras.len() + number) as u64);
                let depth = DepthImage { width: read.width, height: read.height, counts: read.counts };
                let time = now.time + truth.clock;
                frames.push(RecordedFrame { camera: number, time, depth: Some(depth), mask: Some(read.mask) });
            }
        }
    }
    let recording = Recording {
        path: PathBuf::from("recording.toml"),
        title: format!("Synthetic: {}", setup.name),
        source: "Quadratic tetrahedra".into(),
        cameras: cameras.iter().map(|c| stated(c, truth, &sensor)).collect(),
        frames,
        markers: (!setup.markers.is_empty()).then(|| tracked(scene, truth, &mesh, &instants, &mut rng)),
        points: None,
        displacements: None,
        warnings: Vec::new(),
    };
    write_recording(folder, &recording).map_err(|e| Error::Failed(e.to_string()))?;
    let text = setup.text(folder);
    Experiment::new(setup.parse(&text, other)?, text, Vec::new())
}

/// Places of the nodes at the times of the frames.
fn simulate(scene: &Independent, truth: &Truth, other: bool) -> Result<Vec<Instant>, Error> {
    let stated = scene.setup.truth(other)?;
    let body = scene.body(&stated, truth);
    let pivot = stated.initial.pivot.unwrap_or_else(|| center(&body.mesh));
    let spin = stated.initial.angular_velocity + truth.spin;
    let start = body.mesh.nodes.iter().map(|x| stated.initial.velocity + spin.cross(*x - pivot)).collect();
    let step = stated.time.step / scene.substeps as f64;
    let mut motion = Integrator::new(&body, start, step).map_err(Error::Failed)?;
    let end = stated.time.step * stated.time.steps as f64 - scene.spare;
    let mut times = (1..).map(|k| k as f64 * scene.setup.spacing).take_while(|t| *t < end + 1e-9).peekable();
    let mut instants = Vec::new();
    let mut now = 0.0;
    for _ in 0..stated.time.steps * scene.substeps {
        let before = motion.state().clone();
        motion.advance().map_err(|e| Error::Failed(format!("{e} at {now:.4} s")))?;
        while let Some(time) = times.next_if(|t| *t <= now + step + 1e-9) {
            let u = between(&before, motion.state(), step, (time - now) / step);
            instants.push(Instant { time, places: body.mesh.nodes.iter().zip(&u).map(|(x, u)| *x + *u).collect() });
        }
        now += step;
        if times.peek().is_none() {
            break;
        }
    }
    Ok(instants)
}

/// Mean of the nodes; of a ball with layers all around, its middle.
fn center(mesh: &Mesh) -> DVec3 {
    mesh.nodes.iter().sum::<DVec3>() / mesh.nodes.len() as f64
}

/// The cubic through two states and their velocities.
fn between(a: &State, b: &State, step: f64, s: f64) -> Vec<DVec3> {
    let (s2, s3) = (s * s, s * s * s);
    let w = [1.0 - 3.0 * s2 + 2.0 * s3, 3.0 * s2 - 2.0 * s3, step * (s - 2.0 * s2 + s3), step * (s3 - s2)];
    (0..a.u.len()).map(|n| w[0] * a.u[n] + w[1] * b.u[n] + w[2] * a.v[n] + w[3] * b.v[n]).collect()
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
fn reading(truth: &Truth, camera: &Pinhole, pixel: [usize; 2], z: f64) -> f64 {
    let [x, y] = [(pixel[0] as f64 - camera.cx) / camera.fx, (pixel[1] as f64 - camera.cy) / camera.fy];
    let slant = if truth.along_ray { (1.0 + x * x + y * y).sqrt() } else { 1.0 };
    z * slant + truth.depth_bias
}

/// The camera as the recording states it.
fn stated(c: &Pinhole, truth: &Truth, sensor: &Sensor) -> RecordedCamera {
    let [moved, turned] = truth.camera;
    let turn = glam::DMat3::from_quat(DQuat::from_scaled_axis(turned));
    let pose = c.world_from_camera;
    RecordedCamera {
        world_from_camera: DAffine3::from_mat3_translation(turn * pose.matrix3, pose.translation + moved),
        ..recorded_camera(c, sensor)
    }
}

/// The markers: points of the surface, wherever it goes.
fn tracked(scene: &Independent, truth: &Truth, mesh: &Mesh, instants: &[Instant], rng: &mut ChaCha8Rng) -> RecordedMarkers {
    let markers = scene.setup.markers();
    let sites: Vec<(usize, [f64; 3])> = markers.iter().map(|m| mesh.nearest(m.1)).collect();
    let mut samples = Vec::new();
    for now in instants {
        for (marker, (face, l)) in sites.iter().enumerate() {
            let noise = DVec3::from([0; 3].map(|_| StandardNormal.sample(rng)));
            let position = carried(&mesh.faces[*face], *l, &now.places) + MARKER_NOISE * noise;
            samples.push(MarkerSample { time: now.time + truth.clock, marker, position });
        }
    }
    let rest = |(name, p): &(String, DVec3)| MarkerRest { name: name.clone(), position: *p, surface: Some(*p) };
    RecordedMarkers {
        file: PathBuf::from("markers.csv"),
        names: markers.iter().map(|m| m.0.clone()).collect(),
        samples,
        noise_sigma: Some(MARKER_NOISE),
        noise_systematic: 0.0,
        rest: markers.iter().map(rest).collect(),
    }
}
