//! What a report shows, collected in one place: two motions of every scene beside what was measured ([`ReportData`]).

mod body;
mod charts;
mod frame;
mod histogram;
mod motion;
mod overlay;
mod tracks;

pub(super) use charts::{curve, searches};
pub(super) use overlay::bar;

use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::report::quantity::round_up;
use crate::results::finite;
use crate::results::report::{Chart, ReportData, SceneData, ShownFrame};
use motion::{Motion, Plot};
use palpate_engine::Stop;

/// Most single-precision numbers of all scenes together: 5 MB in base64, so that a page stays below 8 MB with its programs and pictures.
const MOST_NUMBERS: usize = 900_000;
/// Frames of a scene that are shown in space where nobody asks for fewer or more.
pub const FRAMES: usize = 24;
/// Share of the residuals whose colours are not full.
const BELOW_SCALE: f64 = 0.95;

/// A motion: what is simulated, with which θ `[P]`.
pub struct Simulated<'a> {
    /// The scene.
    pub experiment: &'a Experiment,
    /// Its parameters.
    pub theta: &'a [f64],
}

/// The two motions of one scene, and what is known of its noise.
pub struct Compared<'a> {
    /// The first; `None` where it is not to be simulated.
    pub before: Option<Simulated<'a>>,
    /// The second, likewise.
    pub after: Option<Simulated<'a>>,
    /// Whose experiment gives recording and shape where there is no motion.
    pub experiment: &'a Experiment,
    /// Root mean square distance that noise and the shape's rounding leave [m].
    pub noise: f64,
    /// Summaries of both motions' frames, root mean square [m], where they are not simulated.
    pub rms: [Vec<f64>; 2],
    /// Whose residuals say where colours are full: 0 or 1.
    pub measure: usize,
}

/// Collects what a report shows of scenes, its motions under these names, with at most so many frames of each in space. A first motion that cannot be simulated is left out.
///
/// # Errors
/// The second motion of a scene cannot be simulated, or was stopped.
pub fn scenes(
    title: &str,
    motions: [&str; 2],
    all: &[Compared],
    backend: Backend,
    frames: usize,
    stop: &Stop,
) -> Result<ReportData, Error> {
    let room = (MOST_NUMBERS / all.len().max(1), frames.max(1));
    let mut data = ReportData { title: title.into(), motions: motions.map(str::to_string), ..ReportData::default() };
    for (s, c) in all.iter().enumerate() {
        let (scene, charts) = scene(c, (s, motions), backend, room, stop)?;
        data.scenes.push(scene);
        data.charts.extend(charts);
    }
    Ok(data)
}

fn scene(
    c: &Compared,
    (number, names): (usize, [&str; 2]),
    backend: Backend,
    (share, frames_shown): (usize, usize),
    stop: &Stop,
) -> Result<(SceneData, Vec<Chart>), Error> {
    let e = c.experiment;
    let plan = e.plan();
    let frames = &plan.observation.frames;
    let mut out = SceneData {
        name: e.scene().path.display().to_string(),
        up: e.up().to_array(),
        noise: c.noise,
        times: frames.iter().map(|f| f.time).collect(),
        ..SceneData::default()
    };
    let plot = Plot::new(e, share, frames_shown);
    let run = |m: &Simulated| Motion::new(m.experiment, m.theta, backend, &plot, stop);
    let after = c.after.as_ref().map(run).transpose()?;
    let before = match (&after, &c.before) {
        (Some(_), Some(m)) => run(m).ok(),
        _ => None,
    };
    let motions = [before.as_ref(), after.as_ref()];
    out.triangles.0 = plot.body.triangles.iter().flatten().copied().collect();
    let rms = |k: usize| motions[k].map_or(&c.rms[k], |m| &m.rms).iter().map(|r| finite(*r)).collect();
    out.rms = [rms(0), rms(1)];
    out.scale = scale(motions[c.measure].or(motions[1]), c.noise);
    out.shown = plot
        .shown
        .iter()
        .enumerate()
        .filter(|_| after.is_some())
        .map(|(k, f)| ShownFrame { frame: *f, time: frames[*f].time, motions: motions.map(|m| m.map(|m| m.shown[k].clone())) })
        .collect();
    out.worst = worst(&out);
    let mut all = tracks::tracks(e, &plot, motions, names);
    all.extend(charts::residuals(e, &out, motions, names));
    all.extend(histogram::histograms(e, motions, names, c.noise));
    for chart in &mut all {
        chart.scene = Some(number);
        chart.key = format!("{}-{number}", chart.key);
    }
    (out.bounds, out.tick) = frame::bounds(e, &out);
    out.view = frame::view(e, &out).to_array();
    out.corner = frame::corner(&out).to_array();
    out.floor = frame::floor(e, &out);
    out.overlays = overlay::overlays(e, &out);
    Ok((out, all))
}

/// The frame that is looked at first: where the second motion lies farthest from the measurement; where noise explains that, the first one.
fn worst(scene: &SceneData) -> usize {
    let of = |m: usize, k: usize| scene.rms[m].get(scene.shown[k].frame).copied().flatten().unwrap_or(0.0);
    let largest = |m: usize| (0..scene.shown.len()).max_by(|a, b| of(m, *a).total_cmp(&of(m, *b)).then(b.cmp(a))).unwrap_or(0);
    let found = largest(1);
    // Half as much again is beyond what chance does to a frame.
    let explained = !scene.shown.is_empty() && of(1, found) < 1.5 * scene.noise;
    if explained && !scene.rms[0].is_empty() { largest(0) } else { found }
}

/// Residual at which colours are full: one that few exceed, and not less than what noise leaves.
fn scale(motion: Option<&Motion>, noise: f64) -> f64 {
    let mut all: Vec<f64> = motion.map_or(Vec::new(), |m| m.samples.iter().flat_map(|s| s.1.iter().map(|x| x.abs())).collect());
    all.sort_by(f64::total_cmp);
    let high = all.get(((all.len() as f64 * BELOW_SCALE) as usize).min(all.len().saturating_sub(1))).copied().unwrap_or(0.0);
    round_up(high.max(if noise.is_finite() { noise } else { 0.0 }).max(1e-6))
}
