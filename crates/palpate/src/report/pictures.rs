//! Simulated surface and measured points in one picture, coloured by their residual.

use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::render::{Picture, Pinhole, residual_colour, shade};
use crate::residuals::{spread, visit_frames};
use crate::viewers::viewer;
use glam::DVec3;
use palpate_engine::{FrameResiduals, Stop};

/// Widest picture in a report [pixels].
const WIDTH: usize = 480;

/// One frame of a comparison.
#[derive(Clone, Debug)]
pub struct FramePicture {
    /// Time on the recording's clock [s].
    pub time: f64,
    /// The picture.
    pub picture: Picture,
}

/// Pictures of up to `count` frames, spread over the recording, of a simulation with parameters θ `[P]`: the surface in grey,
/// measured points from blue (inside the model) to red (outside), saturated at `scale` [m]; markers black with a line to
/// the simulated one's place in the same colours.
///
/// # Errors
/// [`Error::Simulation`] when that fails or is stopped.
pub fn pictures(
    experiment: &Experiment,
    backend: Backend,
    theta: &[f64],
    count: usize,
    scale: f64,
    stop: &Stop,
) -> Result<Vec<FramePicture>, Error> {
    let plan = experiment.plan();
    let all: Vec<usize> = (0..plan.observation.frames.len()).collect();
    let wanted = spread(&all, count);
    let (surface, triangles) = experiment.surface(0.5 * plan.body.length);
    let mut out = Vec::new();
    visit_frames(plan, backend, theta, stop, |frame, displacement, residuals| {
        if wanted.contains(&frame) {
            let vertices = surface.deform(&displacement());
            let camera = camera(experiment, frame, &vertices);
            let mut picture = shade(&camera, &vertices, &triangles, experiment.up(), |_| DVec3::splat(0.72));
            mark(&mut picture, &camera, residuals, scale);
            out.push(FramePicture { time: plan.observation.frames[frame].time, picture });
        }
    })?;
    Ok(out)
}

/// The camera that saw most points of the frame, cut down to the body; a view from aside where nothing has lines of sight.
fn camera(experiment: &Experiment, frame: usize, vertices: &[DVec3]) -> Pinhole {
    let f = &experiment.plan().observation.frames[frame];
    let count = |c: usize| f.points.iter().filter(|p| p.camera as usize == c).count();
    let extent = |points: &mut dyn Iterator<Item = DVec3>| {
        points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)))
    };
    let best = (0..experiment.plan().observation.cameras.len()).max_by_key(|c| (count(*c), std::cmp::Reverse(*c)));
    let bounds = extent(&mut vertices.iter().copied());
    if let Some(camera) = best.filter(|c| count(*c) > 0).and_then(|c| viewer(experiment, c, bounds)) {
        let mut pixels = vertices.iter().map(|v| camera.project(*v)).filter(|p| p.z > 0.0 && p.is_finite());
        return cropped(&camera, extent(&mut pixels));
    }
    let measured = f.markers.iter().map(|m| m.position).chain(f.points.iter().map(|p| p.position));
    let (lo, hi) = extent(&mut vertices.iter().copied().chain(measured));
    Pinhole::framing(lo, hi, experiment.up(), WIDTH, WIDTH * 3 / 4)
}

/// The same camera looking through a window around the body, scaled to the report's width.
fn cropped(camera: &Pinhole, (lo, hi): (DVec3, DVec3)) -> Pinhole {
    let (w, h) = (camera.width as f64, camera.height as f64);
    let margin = 0.15 * (hi.x - lo.x).max(hi.y - lo.y) + 2.0;
    let (x0, x1) = ((lo.x - margin).clamp(0.0, w - 1.0), (hi.x + margin).clamp(0.0, w - 1.0));
    let (y0, y1) = ((lo.y - margin).clamp(0.0, h - 1.0), (hi.y + margin).clamp(0.0, h - 1.0));
    // A body outside the picture leaves the whole picture.
    let (x0, x1, y0, y1) = if x1 - x0 < 8.0 || y1 - y0 < 8.0 { (0.0, w - 1.0, 0.0, h - 1.0) } else { (x0, x1, y0, y1) };
    let zoom = (WIDTH as f64 / (x1 - x0 + 1.0)).min(WIDTH as f64 / (y1 - y0 + 1.0));
    Pinhole {
        width: (((x1 - x0 + 1.0) * zoom).round() as usize).max(1),
        height: (((y1 - y0 + 1.0) * zoom).round() as usize).max(1),
        fx: camera.fx * zoom,
        fy: camera.fy * zoom,
        cx: (camera.cx - x0) * zoom,
        cy: (camera.cy - y0) * zoom,
        ..camera.clone()
    }
}

fn mark(picture: &mut Picture, camera: &Pinhole, r: &FrameResiduals, scale: f64) {
    // Not more dots than the picture can show.
    let distances: Vec<_> = r.readings.iter().filter(|r| r.sensor.is_depth()).zip(r.distances()).collect();
    let every = (distances.len() / 8000).max(1);
    for (p, d) in distances.into_iter().step_by(every) {
        let q = camera.project(p.place);
        if q.z > 0.0 {
            let colour = d.map_or([20, 20, 20], |d| residual_colour(d, scale));
            picture.dot(q.x, q.y, 1, colour);
        }
    }
    for (m, d) in r.offsets() {
        let (a, b) = (camera.project(m.place), camera.project(m.place + d));
        if a.z > 0.0 && b.z > 0.0 {
            for k in 0..=32 {
                let p = a.lerp(b, f64::from(k) / 32.0);
                picture.dot(p.x, p.y, 0, residual_colour(d.length(), scale));
            }
            picture.dot(b.x, b.y, 2, residual_colour(d.length(), scale));
            picture.dot(a.x, a.y, 2, [20, 20, 20]);
        }
    }
}
