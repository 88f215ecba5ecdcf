//! Planes that the measured body does not cross and the simulated one does: where something flat that the scene does not know would stand.

use super::hypothesis::{Prepared, lab_error, prepare};
use super::limits::Limits;
use super::simulate::linearise;
use crate::embed::Embedding;
use crate::engine::Backend;
use crate::experiment::Experiment;
use crate::residuals::visit_frames;
use glam::DVec3;
use palpate_diagnose::{LabError, Reading, Readings, Wall, least_squares};

/// Directions that are looked into, evenly over the sphere.
const DIRECTIONS: usize = 200;
/// Places on the body's surface that are followed.
const PLACES: usize = 400;
/// So many of them, counted over all frames, may lie beyond a wall: readings are noisy.
const BEYOND: usize = 5;
/// Standard deviations of a reading by which the simulated body must go through.
const DEPTH: f64 = 3.0;
/// Distance from a wall up to which a place lies against it, in cells; never less than noise is wide.
const TOUCHING: f64 = 0.1;
/// Mean distance between readings and the simulated body, in cells, up to which they tell where the measured one is.
const NEAR: f64 = 0.5;
/// Fewest readings that tell where a body is.
const FEWEST: usize = 12;
/// Ridge on how the body deforms, relative to what readings tell of it.
const RIDGE: f64 = 1.0;
/// Ridge on where it is as a whole: a camera may see one side only.
const SMALL: f64 = 1e-3;
/// Planes that are returned at most, and the cosine between normals above which the one that keeps more out stands for both.
const MOST: usize = 8;
const ALIKE: f64 = 0.9;

/// Walls around the recordings of all experiments, the one that keeps out most of the simulation first: with the values of the baseline, and with
/// those that its fit started from, for a body that something keeps up may have been made stiff enough to stay where it was seen.
pub(super) fn walls(base: &[Experiment], limits: &Limits) -> Result<Vec<Wall>, LabError> {
    let ready = prepare(base, &[]).map_err(lab_error)?;
    let starts: Vec<f64> = ready.numbers().iter().map(|n| n.start).collect();
    let mut all = vec![ready.own_values(), starts];
    all.dedup();
    let mut found = Vec::new();
    for values in all {
        // A start that cannot be simulated shows nothing.
        found.extend(crossed(&ready, &values, limits).unwrap_or_default());
        limits.check()?;
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut out: Vec<Wall> = Vec::new();
    for (_, wall) in found {
        if out.len() < MOST && out.iter().all(|w| w.normal.dot(wall.normal) < ALIKE) {
            out.push(wall);
        }
    }
    Ok(out)
}

/// Walls that the simulation with these values crosses, and how far beyond what lies against them would be [m], in all.
fn crossed(ready: &Prepared, values: &[f64], limits: &Limits) -> Result<Vec<(f64, Wall)>, LabError> {
    let readings = linearise(ready, values, ready.free.len(), limits)?;
    let noise = readings.rows.iter().map(|r| r.row.noise).fold(0.0, f64::max);
    let center = ready.experiments[0].plan.body.center;
    // Where the measured body is, and where the simulated one.
    let (mut measured, mut simulated) = (Vec::new(), Vec::new());
    for (scene, e) in ready.experiments.iter().enumerate() {
        let patches = &e.plan.body.patches;
        let places = patches.iter().step_by(patches.len().div_ceil(PLACES).max(1)).map(|p| p.point).collect();
        let surface = Embedding::new(&e.plan.body, places);
        let shifts = shifts(e, scene, &readings);
        visit_frames(&e.plan, Backend::Cpu, &ready.theta(scene, values), &limits.stop(), |frame, displacement, _| {
            let Some(shift) = &shifts[frame] else { return };
            for (rest, x) in surface.rest.iter().zip(surface.deform(&displacement())) {
                simulated.push(x - center);
                measured.push(x + shift.at(*rest) - center);
            }
        })
        .map_err(|e| limits.error(e))?;
    }
    if measured.len() <= BEYOND {
        return Ok(Vec::new());
    }
    let lowest = |points: &[DVec3], normal: DVec3| {
        let mut along: Vec<f64> = points.iter().map(|p| normal.dot(*p)).collect();
        *along.select_nth_unstable_by(BEYOND, f64::total_cmp).1
    };
    let near = f64::max(DEPTH * noise, TOUCHING * ready.experiments[0].plan.body.length);
    let wall = |i: usize| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / DIRECTIONS as f64;
        let (s, c) = (i as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt())).sin_cos();
        let normal = DVec3::new((1.0 - z * z).sqrt() * c, (1.0 - z * z).sqrt() * s, z);
        let at = lowest(&measured, normal);
        // What lies against the wall while the simulation goes on through it; a plane askew touches the measured body at an edge.
        let pairs = measured.iter().zip(&simulated).map(|(m, s)| (normal.dot(*m) - at, at - normal.dot(*s)));
        let kept_out = pairs.filter(|(gap, _)| *gap < near).map(|(_, beyond)| beyond.max(0.0)).sum();
        (at - lowest(&simulated, normal), (kept_out, Wall { normal, distance: -at }))
    };
    Ok((0..DIRECTIONS).map(wall).filter(|(depth, _)| *depth > DEPTH * noise).map(|w| w.1).collect())
}

/// How far [m] the measured body is from the simulated one, affine in the rest place: readings say it along their normals alone, and nothing of
/// the side that nobody sees.
struct Shift {
    center: DVec3,
    size: f64,
    coefficients: Vec<f64>,
}

impl Shift {
    fn basis(&self, rest: DVec3) -> [f64; 4] {
        let x = (rest - self.center) / self.size;
        [1.0, x.x, x.y, x.z]
    }

    fn at(&self, rest: DVec3) -> DVec3 {
        let parts = self.basis(rest).into_iter().zip(self.coefficients.chunks(3));
        parts.map(|(b, c)| b * DVec3::from_slice(c)).sum()
    }
}

/// The shift of every frame of a scene, where most readings met the body.
fn shifts(e: &Experiment, scene: usize, readings: &Readings) -> Vec<Option<Shift>> {
    let (low, high) = e.shape().bounds();
    let frames = e.plan.observation.frames.len();
    let mut rows: Vec<Vec<&Reading>> = vec![Vec::new(); frames];
    readings.rows.iter().filter(|r| r.scene == scene).for_each(|r| rows[r.row.frame].push(r));
    let shift = |rows: Vec<&Reading>| {
        let met: Vec<_> = rows.iter().filter_map(|r| Some((r.row, r.row.value?, r.row.by_place.length()))).collect();
        // Far from the body readings tell little of where it is.
        let away = met.iter().map(|(_, value, _)| value.abs()).sum::<f64>() / met.len().max(1) as f64;
        if met.len() < FEWEST || 2 * met.len() < rows.len() || away > NEAR * e.plan.body.length {
            return None;
        }
        let mut shift = Shift { center: 0.5 * (low + high), size: (high - low).length(), coefficients: Vec::new() };
        let y: Vec<f64> = met.iter().map(|(_, value, steep)| -value / steep).collect();
        let column = |k: usize| -> Vec<f64> {
            met.iter().map(|(row, _, steep)| shift.basis(row.rest)[k / 3] * row.by_place[k % 3] / steep).collect()
        };
        let columns: Vec<Vec<f64>> = (0..12).map(column).collect();
        // As one piece first; how it deforms is told less well.
        let chosen: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let whole = least_squares(&chosen[..3], &y, SMALL)?;
        let left = |i: usize| y[i] + whole.iter().zip(&columns).map(|(t, c)| t * c[i]).sum::<f64>();
        shift.coefficients = least_squares(&chosen, &(0..y.len()).map(left).collect::<Vec<f64>>(), RIDGE)?;
        shift.coefficients.iter_mut().zip(whole).for_each(|(c, t)| *c += t);
        Some(shift)
    };
    rows.into_iter().map(shift).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interrupt::{Clock, Interrupt};
    use crate::render::{Pinhole, Sensor};
    use crate::synthetic::{Observers, observe};
    use std::ops::ControlFlow;

    const BALL: &str = r#"
format = "scene/1"
[object]
shape = { ball = { radius = 0.05, center = [0, 0, 0.06] } }
cell_size = 0.03
[material]
density = 1000.0
youngs_modulus = 2.0e4
poisson_ratio = 0.4
[time]
step = 0.01
steps = 20
"#;

    fn experiment(text: &str) -> Experiment {
        Experiment::from_toml(text, "scene.toml").unwrap()
    }

    #[test]
    fn a_floor_that_the_scene_does_not_know_lies_under_the_measured_body() {
        let floor = "[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\n";
        let truth = experiment(&format!("{BALL}{floor}"));
        let observers = Observers {
            cameras: vec!["eye=0.1,-0.6,0.2 target=0,0,0.04 fov=24 size=24x24".parse::<Pinhole>().unwrap()],
            markers: Vec::new(),
            points: Vec::new(),
            displacements: false,
            times: (1..=10).map(|k| 0.02 * f64::from(k)).collect(),
            sensor: Sensor { noise: 5e-4, dropout: 0.0, depth_scale: 5e-5, seed: 1 },
        };
        let recording = observe(&truth, Backend::Cpu, &observers, |_| ControlFlow::Continue(())).unwrap();
        let folder = std::env::temp_dir().join(format!("palpate-walls-{}", std::process::id()));
        palpate_io::write_recording(&folder, &recording).unwrap();
        let seen = format!("[observation]\nrecording = {:?}\ncost = \"sparse-surface\"\n", folder.display().to_string());
        let limits = Limits::new(&Interrupt::default(), &Clock::start(), None);
        let found = walls(&[experiment(&format!("{BALL}{seen}"))], &limits);
        let known = walls(&[experiment(&format!("{BALL}{floor}{seen}"))], &limits);
        std::fs::remove_dir_all(&folder).unwrap();
        // Who knows the floor does not go through it.
        assert_eq!(known.unwrap(), []);
        let wall = found.unwrap()[0];
        assert!(wall.normal.z > 0.95, "{wall:?}");
        // The floor is 60 mm below the centre. The ball flattens by up to a third of its radius there, which a shift as one piece takes for a
        // lower floor; from one cell away a fit finds it.
        assert!((0.055..0.08).contains(&wall.distance), "{wall:?}");
    }
}
