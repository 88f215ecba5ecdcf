//! Cells and time step of a scene that leaves them open: from what bends, how fast it swings, how often it is seen and how well.
//!
//! *Cells*: h = t/n, with t the thickness below which a tenth of the surface lies, by rays that go inwards against the normal (Shapira, Shamir
//! & Cohen-Or, Vis. Comput. 24, 2008), and n = 4, or 3 where noise is more than a twentieth of t. At most [`MOST_CELLS`] of them.
//!
//! *Tetrahedra* that are made here: edges of t/3. Two through a thickness would do for bending, but leave a round body too few nodes on its
//! surface. At most as many tetrahedra as there may be cells.
//!
//! *Step*: the shortest of
//! - T/N of the lowest bending mode, f = k² t c/(2π √12 L²) of a beam of length L and thickness t with c = √(E/ρ), k = 1.875 where it is
//!   clamped and 4.730 where it is free, never above c/2L. A second-order scheme lags by (2π/N)²/12 of its phase, which over a period
//!   moves a swing of a tenth of L by as much as the noise at N = π √(2π L/(15 σ)); N lies in [16, 64];
//! - half the time between two frames, so that what is seen lies between states that are computed;
//! - what it takes to cross half a cell at the speed of the start or of a fall to the next plane.

use crate::experiment::short;
use glam::DVec3;
use palpate_engine::number;
use palpate_model::observation::Observation;
use palpate_model::scene::{Inertia, Resolution, Scene};
use palpate_model::shape::Shape;
use std::f64::consts::{PI, TAU};

/// Places of the surface that are measured.
const RAYS: usize = 400;
/// Share of them that is thinner than the thickness that counts: a rim or a corner is no part that bends.
const THIN: f64 = 0.1;
/// Cells through that thickness, and where noise hides what they do.
const THROUGH: [f64; 2] = [4.0, 3.0];
/// Edges of tetrahedra through that thickness.
const EDGES_THROUGH: f64 = 3.0;
/// Tetrahedra in the cube of an edge.
const IN_CUBE: f64 = 12.0;
/// Noise over thickness from which on it does.
const NOISY: f64 = 0.05;
/// Most cells that are chosen: beyond, somebody should know why.
pub(crate) const MOST_CELLS: f64 = 20_000.0;
/// Fewest and most steps in a period of the lowest mode.
const PER_PERIOD: [f64; 2] = [16.0, 64.0];
/// Share of a cell that a step may cross.
const CROSSED: f64 = 0.5;

/// What was chosen: key of the scene file, value in SI units, and why.
pub type Choice = (&'static str, f64, String);

/// Fills in what a scene leaves open, and says what it is and why.
pub(crate) fn choose(scene: &mut Scene, shape: &dyn Shape, observation: &Observation) -> Vec<Choice> {
    let mut chosen = Vec::new();
    let open = matches!(scene.object.resolution, Resolution::Open | Resolution::OpenEdge);
    if !open && scene.time.open.is_none() {
        return chosen;
    }
    // Of channels, since markers have no sites yet by which their readings could be counted; one without readings is refused before.
    let noise = observation.channels.iter().map(|c| c.noise).fold(f64::NAN, f64::min);
    let (low, high) = shape.bounds();
    let thickness = thickness(shape);
    if open {
        let made = scene.object.resolution == Resolution::OpenEdge;
        let [fine, coarse] = THROUGH;
        let cells = if noise > NOISY * thickness { coarse } else { fine };
        let (key, through, of, things) = match made {
            true => ("object.edge_length", EDGES_THROUGH, "edges", "tetrahedra"),
            false => ("object.cell_size", cells, "cells", "cells"),
        };
        // Three quarters of a box are full where a body fills it well; of others there are fewer cells.
        let in_cube = if made { IN_CUBE } else { 1.0 };
        let least = ((high - low).element_product() * in_cube / MOST_CELLS).cbrt();
        let (h, limited) = (rounded(thickness / through), rounded(least));
        let thick = number(two(thickness));
        let why = match h < limited {
            true => format!("about {MOST_CELLS} {things}; {through} through {thick} m of thickness would be more"),
            false => format!("{through} {of} through {thick} m of thickness"),
        };
        let h = h.max(limited);
        scene.object.resolution = if made { Resolution::Edge(h) } else { Resolution::CellSize(h) };
        chosen.push((key, h, why));
    }
    if let Some(duration) = scene.time.open.take() {
        let h = match scene.object.resolution {
            Resolution::CellSize(h) | Resolution::Edge(h) => h,
            Resolution::Cells(n) => (high - low).max_element() / f64::from(n),
            Resolution::Own | Resolution::Open | Resolution::OpenEdge => thickness,
        };
        let mut limits = vec![swing(scene, shape, thickness, noise)];
        limits.extend(frames(observation));
        limits.extend(crossing(scene, shape, h));
        let (step, why) = limits.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).expect("there is a lowest mode");
        scene.time.steps = (duration / rounded(step)).ceil().clamp(1.0, 1e7) as usize;
        scene.time.step = duration / scene.time.steps as f64;
        chosen.push(("time.step", scene.time.step, why));
    }
    chosen
}

/// A number with its first two digits.
pub(crate) fn two(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

/// The largest number of two digits that is not above: what is chosen should not hang on the last digit of an estimate.
fn rounded(x: f64) -> f64 {
    let digit = 10f64.powf(x.log10().floor() - 1.0);
    two((x / digit).floor() * digit)
}

/// How thick the thin parts of a body are [m].
pub(crate) fn thickness(shape: &dyn Shape) -> f64 {
    let (low, high) = shape.bounds();
    let size = (high - low).max_element();
    let mesh = shape.surface(size / 24.0);
    let stride = mesh.triangles.len().div_ceil(RAYS).max(1);
    let mut lengths: Vec<f64> = mesh
        .triangles
        .iter()
        .step_by(stride)
        .filter_map(|t| {
            let [a, b, c] = t.map(|i| mesh.vertices[i as usize]);
            let inwards = -(b - a).cross(c - a).try_normalize()?;
            ray(shape, (a + b + c) / 3.0, inwards, size)
        })
        .collect();
    lengths.sort_by(f64::total_cmp);
    // A body that no ray crosses is as thick as its box is.
    lengths.get((THIN * lengths.len() as f64) as usize).copied().unwrap_or((high - low).min_element())
}

/// Length of a ray through the body, by steps as long as the surface is away.
fn ray(shape: &dyn Shape, from: DVec3, way: DVec3, size: f64) -> Option<f64> {
    let least = 1e-3 * size;
    let mut t = 2.0 * least;
    while t < 2.0 * size {
        let depth = -shape.signed_distance(from + t * way);
        if depth <= 0.0 {
            return (t > 3.0 * least).then_some(t);
        }
        t += depth.max(least);
    }
    None
}

/// Estimate of the lowest frequency of a body [Hz].
pub(crate) fn lowest_frequency(scene: &Scene, shape: &dyn Shape) -> f64 {
    lowest(scene, shape, thickness(shape))
}

/// The same for a thickness that is known [m].
fn lowest(scene: &Scene, shape: &dyn Shape, thickness: f64) -> f64 {
    let (low, high) = shape.bounds();
    let length = (high - low).max_element();
    let density = match scene.material.inertia {
        Inertia::Density(rho) => rho,
        // The volume is that of a body that fills half its box.
        Inertia::Mass(m) => m / (0.5 * (high - low).element_product()),
    };
    let speed = (scene.material.youngs_modulus / density).sqrt();
    let root: f64 = if scene.clamps.is_empty() { 4.730 } else { 1.875 };
    let bending = root * root * thickness * speed / (TAU * 12f64.sqrt() * length * length);
    bending.min(0.5 * speed / length)
}

/// The step that follows the lowest mode.
fn swing(scene: &Scene, shape: &dyn Shape, thickness: f64, noise: f64) -> (f64, String) {
    let (low, high) = shape.bounds();
    let length = (high - low).max_element();
    let frequency = lowest(scene, shape, thickness);
    let wanted = PI * (TAU * length / (15.0 * noise)).sqrt();
    let per_period = if wanted.is_finite() { wanted.clamp(PER_PERIOD[0], PER_PERIOD[1]) } else { PER_PERIOD[1] }.round();
    (
        1.0 / (per_period * frequency),
        format!("{per_period} steps in a period of the lowest mode, about {} Hz", number(two(frequency))),
    )
}

/// Half the time between frames.
fn frames(observation: &Observation) -> Option<(f64, String)> {
    let times: Vec<f64> = observation.frames.iter().map(|f| f.time).collect();
    let gap = times.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min);
    gap.is_finite().then(|| (0.5 * gap, format!("two steps between frames that are {} s apart", short(gap))))
}

/// The step that crosses half a cell.
fn crossing(scene: &Scene, shape: &dyn Shape, h: f64) -> Option<(f64, String)> {
    let (low, high) = shape.bounds();
    let corners = (0..8).map(|k| DVec3::from_array([0, 1, 2].map(|a| if k >> a & 1 == 0 { low[a] } else { high[a] })));
    let corners: Vec<DVec3> = corners.collect();
    let drop = |p: &palpate_model::scene::Plane| corners.iter().map(|c| p.normal.dot(*c - p.point)).fold(f64::INFINITY, f64::min);
    let fall = scene.planes.iter().map(|p| 2.0 * (-scene.gravity.dot(p.normal)).max(0.0) * drop(p).max(0.0)).fold(0.0, f64::max);
    let start = scene.initial.velocity.length() + 0.5 * (high - low).length() * scene.initial.angular_velocity.length();
    let speed = (start * start + fall).sqrt();
    (speed > 0.0).then(|| (CROSSED * h / speed, format!("half a cell at {} m/s", number(two(speed)))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::Experiment;

    fn chosen(shape: &str, rest: &str) -> Vec<Choice> {
        let text = format!(
            "format = \"scene/1\"\n[object]\nshape = {shape}\n[material]\ndensity = 1000.0\nyoungs_modulus = 1.0e5\npoisson_ratio = 0.4\n{rest}"
        );
        Experiment::from_toml(&text, "open.toml").expect("it can be made").chosen().to_vec()
    }

    #[test]
    fn cells_follow_what_is_thin() {
        let time = "[time]\nduration = 0.1\n";
        for (shape, thin) in [
            ("{ box = { min = [0, 0, 0], max = [0.2, 0.04, 0.02] } }", 0.02),
            ("{ torus = { major = 0.1, minor = 0.04 } }", 0.08),
            ("{ ball = { radius = 0.05 } }", 0.1),
        ] {
            let h = chosen(shape, time)[0].1;
            // Rays end where they are a thousandth of the size from the surface, facets lie inside it, and the digits are two.
            assert!(h < 1.02 * thin / 4.0 && h > 0.9 * thin / 4.0, "{shape}: {h}");
        }
        // A sheet of a millimetre would have two million cells.
        let sheet = &chosen("{ box = { min = [0, 0, 0], max = [0.3, 0.3, 0.001] } }", time)[0];
        assert!(sheet.1 > 0.00025 && sheet.2.contains("about 20000 cells"), "{sheet:?}");
    }

    #[test]
    fn the_step_follows_swing_and_speed() {
        let beam = "{ box = { min = [0, 0, 0], max = [0.2, 0.02, 0.02] } }";
        let held = "[[clamp]]\nbox = { min = [-1, -1, -1], max = [0.01, 1, 1] }\n";
        let step = |more: &str| {
            let all = chosen(beam, &format!("{more}[time]\nduration = 0.5\n"));
            (all[1].1, all[1].2.clone())
        };
        // Euler and Bernoulli: 0.1615 t c/L² = 0.81 Hz held at one end, in 64 steps where nothing is said of noise.
        let (swings, why) = step(held);
        assert!((swings * 64.0 * 0.8075 - 1.0).abs() < 0.15, "{swings}: {why}");
        // Thrown at 10 m/s it crosses half a cell of 5 mm in a quarter of a millisecond.
        let (flies, why) = step("[initial]\nvelocity = [10, 0, 0]\n");
        assert!((flies / 2.5e-4 - 1.0).abs() < 0.15 && why.starts_with("half a cell at 10 m/s"), "{flies}: {why}");
        let (falls, why) = step("[[plane]]\npoint = [0, 0, -0.5]\nnormal = [0, 0, 1]\n");
        // √(2 · 9.81 · 0.5) = 3.1 m/s.
        assert!((falls / (0.0025 / 3.13) - 1.0).abs() < 0.15, "{falls}: {why}");
    }
}
