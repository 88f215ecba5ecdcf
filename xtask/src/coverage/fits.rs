//! Fits of the coverage study: what watches a true body, with how much noise, and which of its numbers are free.

use super::bodies::{Draw, Truth};
use crate::suite::setup::Setup;
use crate::tetrahedra::change::Change;
use crate::tetrahedra::motion::Motion;
use crate::tetrahedra::watch;
use palpate::{Backend, Error, Experiment, FitOptions, Fitted, Interrupt};
use palpate_io::write_recording;
use std::path::Path;

/// Sets of free numbers.
pub const SETS: [&str; 7] = ["E", "E, damping", "E, gravity", "density, damping", "E, start", "E, plane", "E, release"];

/// A free number and its truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Free {
    /// Path in the scene.
    pub path: &'static str,
    /// Its true value.
    pub truth: f64,
    /// Where its fit starts.
    pub start: f64,
}

/// One fit.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Name, unique in the study.
    pub name: String,
    /// What is free.
    pub set: &'static str,
    /// Free numbers.
    pub free: Vec<Free>,
    /// The scene with what watches it.
    pub setup: Setup,
    /// What the recording's sensors have.
    pub change: Change,
    /// Seed of the noise.
    pub seed: u64,
}

/// The trial of a truth with this number.
pub fn trial(t: &Truth, number: u64) -> Trial {
    let seed = 100 * t.seed + number;
    let d = &mut Draw::new(seed);
    // Every truth goes through the sets that it can show, one after the other, from a place of its own.
    let open: Vec<&'static str> = SETS.into_iter().filter(|s| *s != "E, plane" || t.touches).collect();
    let set = open[((t.seed + number) % open.len() as u64) as usize];
    let [modulus, beta, density] = t.material;
    let off = |d: &mut Draw| d.log(0.75, 1.35);
    let mut free = Vec::new();
    let mut put = |path, truth: f64, start: f64| free.push(Free { path, truth, start });
    let mut change = Change::default();
    if set.starts_with('E') {
        put("material.youngs_modulus", modulus, modulus * off(d));
    }
    match set {
        "E, damping" => put("material.stiffness_damping", beta, beta * off(d)),
        "E, gravity" => put("world.gravity.z", -9.81, -9.81 * d.between(0.95, 1.05)),
        "density, damping" => {
            put("material.density", density, density * off(d));
            put("material.stiffness_damping", beta, beta * off(d));
        }
        "E, start" if t.touches => {
            for (path, v) in ["initial.velocity.x", "initial.velocity.z"].into_iter().zip([t.start[0][0], t.start[0][2]]) {
                put(path, v, v + d.between(-0.05, 0.05));
            }
        }
        "E, start" if t.kind == "block" => {
            put("initial.velocity.x", t.start[0][0], t.start[0][0] * d.between(0.8, 1.2));
            put("initial.velocity.y", t.start[0][1], t.start[0][1] + d.between(-0.05, 0.05));
        }
        "E, start" => {
            for (k, path) in
                ["initial.angular_velocity.x", "initial.angular_velocity.y", "initial.angular_velocity.z"].into_iter().enumerate()
            {
                put(path, t.start[1][k], t.start[1][k] + d.between(-0.3, 0.3));
            }
        }
        "E, plane" => {
            let scene = t.setup().truth(false).ok();
            let height = scene.and_then(|s| s.planes.first().map(|p| p.point.dot(p.normal))).unwrap_or(0.0);
            put("plane.0.height", height, height + 0.02 * t.size * d.between(-1.0, 1.0));
        }
        "E, release" => {
            change.clock = d.between(-0.006, 0.006);
            put("time.start", change.clock, 0.0);
        }
        _ => {}
    }
    let marked = !t.markers.is_empty();
    let (cameras, markers) = match (number + t.seed / 3) % 4 {
        0 if marked => (Vec::new(), t.markers.clone()),
        1 => (vec![camera(t, d, 0.0), camera(t, d, 1.6)], Vec::new()),
        2 if marked => (vec![camera(t, d, 0.0)], t.markers.clone()),
        _ => (vec![camera(t, d, 0.0)], Vec::new()),
    };
    let noise = t.size * d.log(0.002, 0.02);
    let fit = free.iter().map(|f| Setup::free(f.path, f.start)).collect();
    let setup = Setup { cameras, markers, noise, fit, ..t.setup() };
    Trial { name: format!("{} {number}", setup.name), set, free, setup, change, seed }
}

fn camera(t: &Truth, d: &mut Draw, turned: f64) -> String {
    let angle = -1.5 + turned + d.between(-0.2, 0.2);
    let (far, up) = (d.between(9.0, 12.0) * t.size, d.between(0.5, 4.0) * t.size);
    let pixels = [24, 28, 32][(d.between(0.0, 2.999)) as usize];
    let [x, y, z] = t.middle.to_array();
    let eye = [x + far * angle.cos(), y + far * angle.sin(), z + up];
    format!("eye={},{},{} target={x},{y},{z} fov={} size={pixels}x{pixels}", eye[0], eye[1], eye[2], d.between(22.0, 27.0))
}

/// Times of the frames [s]: the last leaves room for a clock that is off.
pub fn times(t: &Truth) -> Vec<f64> {
    let end = t.step * (t.steps as f64 - 2.0);
    (1..).map(|k| 2.0 * t.step * f64::from(k)).take_while(|x| *x < end).collect()
}

impl Trial {
    /// Records a motion and fits it.
    ///
    /// # Errors
    /// Nothing is seen, or the fit has no start.
    pub fn fit(&self, motion: &Motion, folder: &Path) -> Result<Fitted, Error> {
        let recording = watch::record(motion, &self.change, &self.setup.watchers(true, self.seed)?)?;
        write_recording(folder, &recording).map_err(|e| Error::Failed(e.to_string()))?;
        let text = self.setup.text(folder, false);
        let e = Experiment::new(self.setup.parse(&text)?, text, Vec::new())?;
        let mut fitted = e.fit(FitOptions { backend: Backend::Cpu, ..FitOptions::default() })?;
        fitted.check_grid(std::slice::from_ref(&e), Backend::Cpu, &Interrupt::default());
        Ok(fitted)
    }
}
