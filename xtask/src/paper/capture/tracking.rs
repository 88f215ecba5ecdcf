//! Bodies that swing in front of depth cameras, moved by the simulator that shares nothing with the tracker: a bar that is let go, and a sheet that is
//! held at one edge and folds down. Their true surface is known.

use super::{FRAME, Figures, HIDDEN, INSIDE, INSIDE_HIDDEN, RMS, SETTLED, off};
use crate::tetrahedra::change::Change;
use crate::tetrahedra::motion::{Motion, Resolution, simulate};
use crate::tetrahedra::watch::{Watchers, record};
use glam::DVec3;
use palpate::render::{CameraError, Pinhole};
use palpate::{Backend, Embedding, Experiment, FitOptions, Interrupt, TrackedBody, refine, track};
use palpate_io::recording::Recording;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

/// Noise of a depth reading [m].
const NOISE: f64 = 0.002;
/// Seeds of the noise.
const SEEDS: std::ops::RangeInclusive<u64> = 1..=10;
const RATE: f64 = 30.0;
const DURATION: f64 = 1.0;
const STEP: f64 = 1.0 / 120.0;

/// What swings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Body {
    /// 0.4 m long and 0.1 m thick.
    Bar,
    /// 0.2 m wide and 10 mm thick.
    Sheet,
}

impl Body {
    fn corners(self) -> [[f64; 3]; 2] {
        match self {
            Body::Bar => [[0.0, -0.05, -0.05], [0.4, 0.05, 0.05]],
            Body::Sheet => [[0.0, -0.1, -0.005], [0.2, 0.1, 0.005]],
        }
    }

    fn modulus(self) -> f64 {
        match self {
            Body::Bar => 1.5e5,
            Body::Sheet => 1.5e5,
        }
    }

    fn cell(self) -> f64 {
        match self {
            Body::Bar => 0.02,
            Body::Sheet => 0.01,
        }
    }

    fn scene(self, stiffer: f64) -> String {
        let [min, max] = self.corners();
        format!(
            "format = \"scene/1\"\ntitle = \"Tracked\"\n\n[object]\nshape = {{ box = {{ min = {min:?}, max = {max:?} }} }}\ncell_size = {}\n\n[material]\n\
             density = 1000.0\nyoungs_modulus = {:e}\npoisson_ratio = 0.4\nstiffness_damping = 0.002\n\n[[clamp]]\n\
             box = {{ min = [-0.01, -1.0, -1.0], max = [0.0101, 1.0, 1.0] }}\n\n[time]\nstep = {STEP}\nduration = {DURATION}\n",
            self.cell(),
            stiffer * self.modulus()
        )
    }

    fn cameras(self, count: usize) -> Result<Vec<Pinhole>, String> {
        let (size, target) = match self {
            Body::Bar => (0.4, DVec3::new(0.18, 0.0, -0.12)),
            Body::Sheet => (0.3, DVec3::new(0.08, 0.0, -0.08)),
        };
        let eyes = [DVec3::new(1.2, -2.2, 0.6), DVec3::new(1.2, 2.2, 0.4), DVec3::new(2.4, 0.1, -1.4)];
        let camera = |k: usize| -> Result<Pinhole, CameraError> {
            let mut camera = Pinhole::looking_at(target + size * eyes[k], target, DVec3::Z, 40.0, 48, 48)?;
            camera.name = format!("camera-{k}");
            Ok(camera)
        };
        (0..count).map(camera).collect::<Result<_, _>>().map_err(|e| text(&e))
    }

    /// Points of the surface that are compared, away from the clamp.
    fn places(self) -> Vec<DVec3> {
        let [min, max] = self.corners().map(DVec3::from);
        let mut all = Vec::new();
        let size = max - min;
        for a in 0..3 {
            let (b, c) = ((a + 1) % 3, (a + 2) % 3);
            for (i, j) in (1..12).flat_map(|i| (1..12).map(move |j| (i, j))) {
                for side in [min[a], max[a]] {
                    let mut p = DVec3::ZERO;
                    p[a] = side;
                    p[b] = min[b] + size[b] * f64::from(i) / 12.0;
                    p[c] = min[c] + size[c] * f64::from(j) / 12.0;
                    if p.x > 0.02 {
                        all.push(p);
                    }
                }
            }
        }
        all
    }
}

fn text(e: &dyn std::fmt::Display) -> String {
    e.to_string()
}

/// Where each place was [m], by time [µs] and number of the place.
type Truth = BTreeMap<(u64, usize), DVec3>;

/// The motion, and where the places were at every frame.
fn moved(body: Body, folder: &Path) -> Result<(Motion, Truth), String> {
    let scene = Experiment::from_toml(&body.scene(1.0), folder.join("truth.toml")).map_err(|e| text(&e))?;
    let times: Vec<f64> = (1..=(RATE * DURATION) as usize).map(|k| k as f64 / RATE).collect();
    let fine = Resolution { fine: 2, substeps: 2 };
    let motion = simulate(scene.scene(), &Change::default(), &times, fine).map_err(|e| text(&e))?;
    let markers = body.places().into_iter().enumerate().map(|(k, p)| (format!("{k}"), p)).collect();
    let watchers = Watchers { cameras: Vec::new(), markers, noise: 0.0, stated: NOISE, seed: 1 };
    let seen = record(&motion, &Change::default(), &watchers).map_err(|e| text(&e))?;
    let markers = seen.markers.ok_or("nothing was marked")?;
    let number = |name: usize| markers.names[name].parse::<usize>().map_err(|e| text(&e));
    let mut truth = BTreeMap::new();
    for s in &markers.samples {
        truth.insert((key(s.time), number(s.marker)?), s.position);
    }
    Ok((motion, truth))
}

/// A time as a key: microseconds.
fn key(time: f64) -> u64 {
    (1e6 * time).round() as u64
}

/// What cameras see of the motion.
fn seen(body: Body, motion: &Motion, cameras: usize, seed: u64) -> Result<Recording, String> {
    let watchers = Watchers { cameras: body.cameras(cameras)?, markers: Vec::new(), noise: NOISE, stated: NOISE, seed };
    record(motion, &Change::default(), &watchers).map_err(|e| text(&e))
}

/// Sums over places.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    squares: f64,
    inside: f64,
    count: f64,
}

impl Sum {
    fn add(&mut self, miss: DVec3, deviation: f64) {
        self.squares += miss.length_squared();
        let within = miss.to_array().into_iter().filter(|m| m.abs() < 2.0 * deviation).count();
        self.inside += within as f64 / 3.0;
        self.count += 1.0;
    }

    fn rms(&self) -> f64 {
        1e3 * (self.squares / self.count).sqrt()
    }
}

/// What was seen and what was hidden, over all frames.
fn compare(body: Body, own: &Experiment, tracked: &TrackedBody, truth: &Truth) -> [Sum; 2] {
    let places = body.places();
    let rest = &tracked.surface.rest;
    let near: Vec<usize> = places
        .iter()
        .map(|p| (0..rest.len()).min_by(|a, b| rest[*a].distance(*p).total_cmp(&rest[*b].distance(*p))).unwrap_or(0))
        .collect();
    let mut sums = [Sum::default(); 2];
    let carrier = Embedding::new(&own.plan().body, places);
    for f in &tracked.frames {
        let at = carrier.deform(&f.displacement);
        for (k, p) in at.iter().enumerate() {
            if let Some(truth) = truth.get(&(key(f.time), k)) {
                sums[usize::from(!f.seen[near[k]])].add(*p - *truth, f.deviation[near[k]]);
            }
        }
    }
    sums
}

/// Tracks the body from recordings of every seed.
pub fn run(folder: &Path, body: Body, cameras: usize, stiffer: f64) -> Result<Figures, String> {
    let (motion, truth) = moved(body, folder)?;
    let own = Experiment::from_toml(&body.scene(stiffer), folder.join("track.toml")).map_err(|e| text(&e))?;
    let (mut sums, mut warm, mut frames, mut doubted, mut worst) = ([Sum::default(); 2], 0.0, 0usize, 0usize, 0.0f64);
    let mut points = 0;
    for seed in SEEDS {
        let e = own.measured(seen(body, &motion, cameras, seed)?).map_err(|e| text(&e))?;
        points = e.plan().observation.residuals() / e.plan().observation.frames.len();
        let clock = Instant::now();
        let (mut first, mut last) = (0.0, 0.0);
        let tracked = track(&e, |done| {
            last = clock.elapsed().as_secs_f64();
            if done == 1 {
                first = last;
            }
            ControlFlow::Continue(())
        })
        .map_err(|e| text(&e))?;
        warm += (last - first) / (tracked.frames.len() - 1) as f64;
        frames += tracked.frames.len();
        doubted += tracked.frames.len() - tracked.sound();
        let now = compare(body, &own, &tracked, &truth);
        let all = ((now[0].squares + now[1].squares) / (now[0].count + now[1].count)).sqrt();
        worst = worst.max(1e3 * all);
        for (s, n) in sums.iter_mut().zip(now) {
            *s = Sum { squares: s.squares + n.squares, inside: s.inside + n.inside, count: s.count + n.count };
        }
        println!("seed {seed}: {:.2} mm, seen {:.2}, hidden {:.2}", 1e3 * all, now[0].rms(), now[1].rms());
    }
    let seeds = SEEDS.count() as f64;
    let rms = ((sums[0].squares + sums[1].squares) / (sums[0].count + sums[1].count)).sqrt();
    let away = truth.iter().map(|((_, k), p)| p.distance(body.places()[*k])).fold(0.0, f64::max);
    Ok([
        (RMS, 1e3 * rms),
        ("rms of the worst seed [mm]", worst),
        ("rms of what is seen [mm]", sums[0].rms()),
        (HIDDEN, sums[1].rms()),
        (INSIDE, sums[0].inside / sums[0].count),
        (INSIDE_HIDDEN, sums[1].inside / sums[1].count),
        (FRAME, warm / seeds),
        ("share of frames that are doubted", doubted as f64 / frames as f64),
        ("depth readings a frame", points as f64),
        ("nodes", own.plan().body.nodes.len() as f64),
        ("largest distance from rest [mm]", 1e3 * away),
    ]
    .into_iter()
    .map(|(name, x)| (name.to_string(), x))
    .collect())
}

/// The scene with the modulus and the damping free.
fn free(body: Body, stiffer: f64, warm: &str) -> String {
    body.scene(stiffer)
        + &format!(
            "\n[fit]\nwarm_start = \"{warm}\"\n\n[[fit.parameter]]\npath = \"material.youngs_modulus\"\nbounds = [1e3, 1e8]\n\n[[fit.parameter]]\n\
             path = \"material.stiffness_damping\"\nbounds = [1e-5, 0.1]\n"
        )
}

/// Rounds of tracking and fitting from ten times the modulus.
pub fn rounds(folder: &Path) -> Result<Figures, String> {
    let body = Body::Bar;
    let (motion, truth) = moved(body, folder)?;
    let recording = seen(body, &motion, 2, 1)?;
    palpate_io::write_recording(folder.join("seen"), &recording).map_err(|e| text(&e))?;
    let scene = free(body, 10.0, "none") + "\n[observation]\nrecording = \"seen\"\ncost = \"sparse-surface\"\n";
    let own = Experiment::from_toml(&scene, folder.join("scene.toml")).map_err(|e| text(&e))?;
    let mut figures = Figures::new();
    let rms = |t: &TrackedBody| {
        let s = compare(body, &own, t, &truth);
        1e3 * ((s[0].squares + s[1].squares) / (s[0].count + s[1].count)).sqrt()
    };
    let before = track(&own, |_| ControlFlow::Continue(())).map_err(|e| text(&e))?;
    figures.insert("rms without a round [mm]".into(), rms(&before));
    for (most, name) in [(1, "rms after 1 round [mm]"), (6, "rms after all rounds [mm]")] {
        let r = refine(&own, most, Backend::Cpu, &Interrupt::default(), folder, |_| {}).map_err(|e| text(&e))?;
        figures.insert(name.into(), rms(&r.tracked));
        if most > 1 {
            let last = r.rounds.last().ok_or("no round")?;
            figures.insert("rounds".into(), r.rounds.len() as f64);
            if let Some(moved) = last.moved {
                figures.insert("last move".into(), moved);
            }
            if r.settled {
                figures.insert(SETTLED.into(), r.rounds.len() as f64);
            }
            figures.insert("E off [%]".into(), off(last.values[0].value, body.modulus()));
            figures.insert("stiffness damping, off [%]".into(), off(last.values[1].value, 0.002));
            figures.insert("settled".into(), f64::from(u8::from(r.settled)));
        }
    }
    Ok(figures)
}

/// A fit of the depth images from ten times the modulus, led by tracking.
pub fn led(folder: &Path) -> Result<Figures, String> {
    let body = Body::Bar;
    let (motion, _) = moved(body, folder)?;
    let own = Experiment::from_toml(&free(body, 10.0, "tracked"), folder.join("scene.toml")).map_err(|e| text(&e))?;
    let e = own.measured(seen(body, &motion, 2, 1)?).map_err(|e| text(&e))?;
    let fitted = e.fit(FitOptions { backend: Backend::Cpu, ..FitOptions::default() }).map_err(|e| text(&e))?;
    println!("{}\n{}", fitted.verdict, fitted.notes.join("\n"));
    let found = &fitted.result.parameters;
    let mut figures = Figures::new();
    figures.insert("E off [%]".into(), off(found[0].value, body.modulus()));
    figures.insert("its standard error [%]".into(), 100.0 * found[0].standard_error.unwrap_or(f64::NAN) / found[0].value);
    figures.insert("stiffness damping, off [%]".into(), off(found[1].value, 0.002));
    let points = fitted.tracked.first().ok_or("nothing was tracked")?;
    figures.insert("E of the tracked points, off [%]".into(), off(points.value, body.modulus()));
    figures.insert("evaluations".into(), fitted.result.runs[fitted.result.best].evaluations as f64);
    Ok(figures)
}
