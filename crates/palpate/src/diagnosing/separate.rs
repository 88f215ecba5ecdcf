//! Measurements that could be made next, simulated as their sensors would read them: every model with its own effects, those of the
//! measurement among them, so that a biased camera is told from a stretched one just as wind is from drag. A rival is fitted once more, to the
//! first order, to both recordings: what its own numbers can take up tells nobody from anybody.

use super::hypothesis::{Prepared, prepare};
use super::limits::Limits;
use super::simulate::linearise;
use crate::embed::Embedding;
use crate::engine::{Backend, between};
use crate::experiment::Experiment;
use crate::render::Pinhole;
use crate::residuals::spread;
use crate::synthetic::read_depths;
use crate::viewers::viewers;
use glam::{DAffine3, DQuat, DVec3};
use palpate_diagnose::{Model, Readings, Separation, Way, direction, least_squares};
use palpate_engine::{Snapshot, Stop};
use palpate_model::effects::sensors::Sensors;
use palpate_model::mechanics::rotation::Polar;
use palpate_model::observation::{Observation, ReadingKind};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::space::body::Body;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, PI};
use std::ops::ControlFlow;
use std::sync::Arc;

/// Frames that are compared, spread over the recording's.
const FRAMES: usize = 12;
/// Most columns and rows of a simulated depth image: differences of models are smooth.
const PIXELS: usize = 96;
/// A number is moved by this part of its own size, to see what readings make of it.
const MOVED: f64 = 1e-2;
/// Keeps numbers that nothing tells where they are: far below what any reading says.
const RIDGE: f64 = 1e-12;

/// What several measurements would read of every rival, the models after the first, against the first one; those that could be simulated
/// within the limits.
pub(super) fn separations(base: &[Experiment], backend: Backend, models: &[&Model], limits: &Limits) -> Vec<Separation> {
    let ready: Result<Vec<Prepared>, _> = models.iter().map(|m| prepare(base, &m.changes)).collect();
    let (Ok(ready), watch) = (ready, Watch::new(&base[0])) else { return Vec::new() };
    let past = models[1..].par_iter().zip(&ready[1..]).map(|(m, r)| linearise(r, &m.values, 0, limits));
    let Ok(past) = past.collect::<Result<Vec<Readings>, _>>() else { return Vec::new() };
    // Every model as it is, and every rival with each of its numbers moved.
    let mut runs: Vec<(usize, Option<f64>, Vec<f64>)> = Vec::new();
    for (k, (m, r)) in models.iter().zip(&ready).enumerate() {
        runs.push((k, None, m.values.clone()));
        for (q, n) in r.numbers().iter().enumerate().filter(|_| k > 0) {
            let step = MOVED * n.scale;
            let step = if m.values[q] + step > n.bounds.1 { -step } else { step };
            let mut values = m.values.clone();
            values[q] += step;
            runs.push((k, Some(step), values));
        }
    }
    let mut out = Vec::new();
    let simulate = |way: &Way| -> Option<Vec<Motion>> {
        runs.par_iter().map(|(k, _, values)| watch.motion(&ready[*k], values, way, backend, &limits.stop())).collect()
    };
    let mut compare = |measurement: String, way: Way, motions: &[Motion], cameras: &[(u32, Pinhole)], markers: bool| {
        let seen: Vec<Vec<Read>> = motions.par_iter().map(|m| watch.read(m, cameras, markers)).collect();
        let of = |k: usize| runs.iter().zip(&seen).filter(move |(r, _)| r.0 == k);
        let left = |(k, past): (usize, &Readings)| {
            let rival = of(k).find(|(r, _)| r.1.is_none())?.1;
            let moved: Vec<(f64, &[Read])> = of(k).filter_map(|(r, seen)| Some((r.1?, seen.as_slice()))).collect();
            watch.left(&seen[0], rival, &moved, past)
        };
        let differences: Option<Vec<(f64, f64)>> = past.iter().enumerate().map(|(k, past)| left((k + 1, past))).collect();
        out.extend(differences.map(|differences| Separation { measurement, way, differences }));
    };
    if !watch.cameras.is_empty()
        && let Some(motions) = simulate(&Way::default())
    {
        for (what, cameras) in watch.views(&motions[0], base[0].up()) {
            let poses = cameras.iter().map(|(number, c)| (*number, c.world_from_camera)).collect();
            compare(what, Way { cameras: poses, ..Way::default() }, &motions, &cameras, false);
        }
    }
    for (what, way) in trials(&base[0]) {
        if let Some(motions) = simulate(&way) {
            compare(what, way, &motions, &watch.cameras, true);
        }
    }
    out
}

/// Motions that start in another way, and loads from another side, in words and for a simulation.
fn trials(e: &Experiment) -> Vec<(String, Way)> {
    let (low, high) = e.shape().bounds();
    let size = (high - low).max_element();
    let up = e.up();
    let side = up.any_orthonormal_vector();
    let gravity = e.scene.gravity;
    let speed = (2.0 * gravity.length().max(1.0) * size).sqrt();
    let pushed = |push| Way { push, ..Way::default() };
    let spun = |spin| Way { spin, ..Way::default() };
    let mut out = Vec::new();
    if e.plan.clock.moves() {
        let rate = speed / size;
        out.push((format!("a push of {:.2} m/s sideways at the start", 0.5 * speed), pushed(0.5 * speed * side)));
        out.push((format!("a spin of {rate:.1} rad/s about the vertical at the start"), spun(rate * up)));
        out.push((format!("a spin of {rate:.1} rad/s about a horizontal axis at the start"), spun(rate * side)));
        if e.plan.clamps.is_empty() && !e.plan.planes.is_empty() {
            out.push((format!("a drop from {size:.2} m higher"), pushed(-speed * up)));
        }
    }
    // On the ground a body would slide away.
    if gravity != DVec3::ZERO && e.plan.planes.is_empty() {
        for (axis, angle) in [(side, FRAC_PI_2), (side.cross(up), FRAC_PI_2), (side, PI)] {
            let turn = DQuat::from_axis_angle(axis, angle);
            let what = format!("the setup turned, so that gravity pulls towards {}", direction(turn * gravity));
            out.push((what, Way { turn, ..Way::default() }));
        }
    }
    out
}

/// What watches, as the recording has it.
struct Watch {
    /// Without frames: nothing is compared with the recording.
    observation: Arc<Observation>,
    /// On the recording's clock [s].
    times: Vec<f64>,
    surface: Embedding,
    triangles: Vec<[u32; 3]>,
    /// As the recording states them, with their numbers in the observation.
    cameras: Vec<(u32, Pinhole)>,
    /// The largest difference of a depth that counts [m]: where an outline has moved by a pixel, depth jumps by as much as the body is deep.
    largest: f64,
}

/// A simulated motion, and what its model says of the sensors.
struct Motion {
    /// Node displacements of every frame [m].
    frames: Vec<Vec<DVec3>>,
    body: Arc<Body>,
    sensors: Sensors,
}

/// A depth, or a coordinate of a marker or tracked point [m]; infinite where nothing is.
type Read = (ReadingKind, f64);

impl Watch {
    fn new(e: &Experiment) -> Watch {
        let o = &e.plan.observation;
        let all: Vec<usize> = (0..o.frames.len()).collect();
        let count = if e.plan.clock.steps == 0 { 1 } else { FRAMES };
        let (surface, triangles) = e.surface(0.5 * e.plan.body.length);
        Watch {
            observation: Arc::new(o.without_frames()),
            times: spread(&all, count).into_iter().map(|f| o.frames[f].time).collect(),
            surface,
            triangles,
            cameras: viewers(e).into_iter().map(|(number, c)| (number, coarse(c))).collect(),
            largest: e.plan.body.length,
        }
    }

    /// Simulates a model of the first scene; `None` where that fails or is stopped.
    fn motion(&self, ready: &Prepared, values: &[f64], way: &Way, backend: Backend, stop: &Stop) -> Option<Motion> {
        let plan = Plan { observation: self.observation.clone(), ..ready.experiments[0].plan.clone() };
        let mut theta = ready.theta(0, values);
        let place = |key| plan.layout.index(key);
        let gravity = way.turn * DVec3::from_array([0u8, 1, 2].map(|a| theta[place(ParamKey::Gravity(a))]));
        for a in 0..3u8 {
            theta[place(ParamKey::Velocity(a))] += way.push[usize::from(a)];
            theta[place(ParamKey::AngularVelocity(a))] += way.spin[usize::from(a)];
            theta[place(ParamKey::Gravity(a))] = gravity[usize::from(a)];
        }
        let sensors = Sensors::new(&plan.layout, &theta);
        let start = theta[place(ParamKey::TimeStart)] + sensors.ahead();
        let mut waiting = self.times.iter().map(|t| t - start).peekable();
        let (mut frames, mut last) = (Vec::new(), None::<Snapshot>);
        let visit = |_, state: Snapshot, _| {
            while let Some(t) = waiting.next_if(|t| *t <= state.time) {
                frames.push(last.as_ref().map_or_else(|| state.displacement.clone(), |a| between(a, &state, t)));
            }
            last = Some(state);
            ControlFlow::Continue(())
        };
        backend.visit_until(&plan, &theta, stop.clone(), visit).ok()?;
        // A body at rest has one state, and the last one is held.
        let last = last?;
        frames.extend(waiting.map(|_| last.displacement.clone()));
        Some(Motion { frames, body: plan.body, sensors })
    }

    /// What cameras at these stated poses, and markers where they are wanted, read of a motion, in an order that is the same for all motions.
    fn read(&self, m: &Motion, cameras: &[(u32, Pinhole)], markers: bool) -> Vec<Read> {
        let mut out = Vec::new();
        for u in &m.frames {
            let vertices = self.surface.deform(u);
            for (number, stated) in cameras {
                let number = *number;
                let camera =
                    Pinhole { world_from_camera: m.sensors.true_pose(number, stated.world_from_camera), ..stated.clone() };
                let depths = read_depths(&m.sensors, number, &camera, &vertices, &self.triangles).depth;
                out.extend(depths.into_iter().map(|d| (ReadingKind::Depth, d)));
            }
            for number in (0..self.observation.markers.len()).filter(|_| markers) {
                let site = m.sensors.site(&self.observation, number as u32);
                let (p, f) = site.carry(|i| m.body.nodes[i] + u[i]);
                let place = p + Polar::new(f).r * site.stalk;
                out.extend(place.to_array().map(|x| (site.kind, x)));
            }
        }
        out
    }

    /// What is left of a difference between what is named and a rival once the rival's numbers are fitted to both recordings, to the first order:
    /// root mean square, and the noise of one reading [m], of depths, markers or tracked points, whichever shows more. `moved` are the rival's
    /// readings with each of its numbers moved by so much, and `past` says what the recording at hand knows of them. `None` where nothing is seen of both.
    fn left(&self, named: &[Read], rival: &[Read], moved: &[(f64, &[Read])], past: &Readings) -> Option<(f64, f64)> {
        let noise = |kind| self.observation.noise(kind);
        let mut kinds: Vec<ReadingKind> = Vec::new();
        let (mut rest, mut by_number) = (Vec::new(), vec![Vec::new(); moved.len()]);
        for (i, (&(kind, a), &(_, b))) in named.iter().zip(rival).enumerate() {
            let by: Vec<f64> = moved.iter().map(|(_, m)| m[i].1 - b).collect();
            // Where an outline passes, a depth has no derivative.
            let most = if kind == ReadingKind::Depth { self.largest } else { f64::INFINITY };
            if !a.is_finite() || !b.is_finite() || by.iter().any(|x| !x.is_finite() || x.abs() >= most) {
                continue;
            }
            kinds.push(kind);
            rest.push((a - b).clamp(-most, most) / noise(kind));
            by_number.iter_mut().zip(moved).zip(by).for_each(|((c, (step, _)), x)| c.push(-x / (step * noise(kind))));
        }
        // The next recording has as many readings as the one at hand, of which a few are simulated.
        let (few, columns) = (rest.len(), past.columns);
        let weight = (past.rows.len() as f64 / few.max(1) as f64).sqrt();
        rest.iter_mut().chain(by_number.iter_mut().flatten()).for_each(|x| *x *= weight);
        for (q, column) in by_number.iter_mut().enumerate() {
            let known = past.rows.iter().zip(past.sensitivity.iter().skip(q).step_by(columns.max(1)));
            column.extend(known.map(|(r, s)| s * r.row.weight.sqrt() / r.row.noise));
        }
        rest.resize(few + past.rows.len(), 0.0);
        let all: Vec<&[f64]> = by_number.iter().map(Vec::as_slice).collect();
        for (column, x) in all.iter().zip(least_squares(&all, &rest, RIDGE)?) {
            rest.iter_mut().zip(*column).for_each(|(r, c)| *r += x * c);
        }
        // In units of noise, over readings of the next recording: what that one leaves, and what the one at hand has to give for it.
        let of = |kind: ReadingKind| {
            let count = kinds.iter().filter(|k| **k == kind).count() as f64 * weight * weight;
            let all = kinds.iter().copied().chain(past.rows.iter().map(|r| r.row.source.sensor.kind()));
            let sum: f64 = all.zip(&rest).filter(|(k, _)| *k == kind).map(|(_, r)| r * r).sum();
            // A position has three coordinates.
            let noise = (kind.components() as f64).sqrt() * noise(kind);
            ((sum / count).sqrt() * noise, noise)
        };
        let found: BTreeSet<ReadingKind> = kinds.iter().copied().collect();
        found.into_iter().map(of).max_by(|x, y| (x.0 / x.1).total_cmp(&(y.0 / y.1)))
    }

    /// The cameras elsewhere: nearer and farther along the line to the middle of a motion, and a quarter turn around it.
    fn views(&self, m: &Motion, up: DVec3) -> Vec<(String, Vec<(u32, Pinhole)>)> {
        let middle = |u: &Vec<DVec3>| {
            let x = self.surface.deform(u);
            x.iter().sum::<DVec3>() / x.len().max(1) as f64
        };
        let target = m.frames.iter().map(middle).sum::<DVec3>() / m.frames.len().max(1) as f64;
        let which = if self.cameras.len() == 1 { "the camera" } else { "every camera" };
        let at = |factor: f64| {
            move |c: &Pinhole| DAffine3 {
                translation: target + factor * (c.world_from_camera.translation - target),
                ..c.world_from_camera
            }
        };
        let around = |c: &Pinhole| {
            let m = c.world_from_camera.matrix3;
            // One that looks down sees the side by coming down.
            let axis = if m.z_axis.dot(up).abs() < std::f64::consts::FRAC_1_SQRT_2 { up } else { m.x_axis };
            let turn = DAffine3::from_quat(DQuat::from_axis_angle(axis, FRAC_PI_2));
            DAffine3::from_translation(target) * turn * DAffine3::from_translation(-target) * c.world_from_camera
        };
        let stand = |pose: &dyn Fn(&Pinhole) -> DAffine3| {
            let stood = |(number, c): &(u32, Pinhole)| (*number, Pinhole { world_from_camera: pose(c), ..c.clone() });
            self.cameras.iter().map(stood).collect::<Vec<_>>()
        };
        vec![
            (format!("{which} at 3/4 of its distance"), stand(&at(0.75))),
            (format!("{which} at 1.5 times its distance"), stand(&at(1.5))),
            (format!("{which} a quarter turn around the body"), stand(&around)),
        ]
    }
}

/// The same camera with fewer and larger pixels.
fn coarse(c: Pinhole) -> Pinhole {
    let n = c.width.max(c.height).div_ceil(PIXELS).max(1);
    let by = n as f64;
    let middle = |x: f64| (x + 0.5) / by - 0.5;
    Pinhole { width: c.width / n, height: c.height / n, fx: c.fx / by, fy: c.fy / by, cx: middle(c.cx), cy: middle(c.cy), ..c }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interrupt::{Clock, Interrupt};
    use crate::render::Sensor;
    use crate::synthetic::{Observers, observe};
    use palpate_diagnose::{Change, Separated};
    use palpate_model::effects::{Effect, find};

    /// A block that hangs from its top, three cells of a centimetre long, at rest under its own weight.
    const HANGING: &str = r#"
        format = "scene/1"
        [object]
        shape = { box = { min = [0, 0, 0], max = [0.02, 0.02, 0.03] } }
        cell_size = 0.01
        [material]
        density = 1000.0
        youngs_modulus = 2.0e3
        poisson_ratio = 0.4
        [world]
        gravity = [0.0, 0.0, -9.81]
        [[clamp]]
        box = { min = [-0.01, -0.01, 0.029], max = [0.03, 0.03, 0.04] }
        [initial]
        state = "static-equilibrium"
        [time]
        duration = 0
    "#;

    /// The block as a camera half a metre away has seen it, and a marker on its lower face.
    fn seen(folder: &std::path::Path) -> Experiment {
        let truth = Experiment::from_toml(HANGING, "hanging.toml").unwrap();
        let camera = "eye=0.01,-0.49,0.015 target=0.01,0.01,0.015 fov=6 size=40x40".parse().unwrap();
        let observers = Observers {
            cameras: vec![camera],
            markers: vec![("low".into(), DVec3::new(0.01, 0.01, 0.0))],
            points: Vec::new(),
            displacements: false,
            times: vec![0.0],
            sensor: Sensor { noise: 5e-4, dropout: 0.0, depth_scale: 1e-4, seed: 1 },
        };
        let recording = observe(&truth, Backend::Cpu, &observers, |_| ControlFlow::Continue(())).unwrap();
        palpate_io::write_recording(folder.join("seen"), &recording).unwrap();
        let text = format!("{HANGING}\n[observation]\nrecording = \"seen\"\ncost = [\"sparse-surface\", \"markers\"]\n");
        Experiment::from_toml(&text, folder.join("scene.toml")).unwrap()
    }

    /// A model with one effect at these values of its free numbers.
    fn model(base: &[Experiment], kind: &str, values: &[f64]) -> Model {
        let changes = vec![Change::Effect(Effect::absent(find(kind).unwrap()))];
        let numbers = prepare(base, &changes).unwrap().numbers();
        assert_eq!(numbers.len(), values.len(), "{kind}");
        Model { changes, numbers, values: values.to_vec(), errors: vec![None; values.len()] }
    }

    fn best(base: &[Experiment], models: &[&Model], names: &[&str]) -> (Separated, Vec<Separation>) {
        let limits = Limits::new(&Interrupt::default(), &Clock::start(), None);
        let ways = separations(base, Backend::Cpu, models, &limits);
        println!("{ways:#?}");
        let names: Vec<String> = names.iter().map(|n| n.to_string()).collect();
        (Separated::best(&ways, &names).unwrap(), ways)
    }

    #[test]
    fn a_bias_is_told_from_a_scale_at_another_distance_and_from_its_twin_nowhere() {
        let folder = tempfile::tempdir().unwrap();
        let base = [seen(folder.path())];
        let bias = model(&base, "depth-bias", &[0.004]);
        // What both read of the near face, 0.49 m away.
        let scale = model(&base, "depth-scale", &[0.004 / 0.49]);
        let (next, _) = best(&base, &[&bias, &scale], &["depth-scale"]);
        assert_eq!(next.measurement, "the camera at 1.5 times its distance");
        // Half the bias more, of which another scale takes up a part: one that errs at either distance in proportion to the other. But for what the
        // grid rounds off the body and pixels at its sides.
        let left = 0.002 * f64::sqrt(1.0 / (1.0 + 1.5 * 1.5));
        assert!((next.difference / left - 1.0).abs() < 0.1, "{next:?}");
        assert_eq!(next.from, ["depth-scale"]);
        // Two names that read the same everywhere cannot be told apart, and are said not to be.
        let twin = model(&base, "depth-bias", &[0.0041]);
        let (none, _) = best(&base, &[&bias, &twin], &["twin"]);
        assert!(none.from.is_empty() && none.sentence().starts_with("None of the measurements"), "{none:?}");
    }

    #[test]
    fn loads_on_a_body_at_rest_are_told_apart_by_turning_it() {
        let folder = tempfile::tempdir().unwrap();
        let base = [seen(folder.path())];
        // A fifth of the weight more: as a force that stays with the setup, and as a denser body.
        let force = model(&base, "uniform-force", &[0.0, 0.0, -2000.0]);
        let changes = vec![Change::Freed { name: "density", sentence: "", paths: vec!["material.density".into()] }];
        let numbers = prepare(&base, &changes).unwrap().numbers();
        let density = Model { changes, numbers, values: vec![1000.0 + 2000.0 / 9.81], errors: vec![None] };
        let (next, ways) = best(&base, &[&force, &density], &["density"]);
        assert!(next.measurement.starts_with("the setup turned, so that gravity pulls towards"), "{next:?}");
        // As it hangs, both look the same from everywhere: solvers leave 1e-8 of a centimetre, depth at pixels of the outline more.
        let views = ways.iter().filter(|w| w.measurement.contains("the camera"));
        assert!(views.map(|w| w.differences[0].0).fold(0.0, f64::max) < 1e-6, "{ways:?}");
    }
}
