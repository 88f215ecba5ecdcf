//! What saw the surface, as cameras that can be rendered: those of a recording, and for clouds that were seen from a place, one there that looks at
//! the body.

use crate::experiment::Experiment;
use crate::render::Pinhole;
use glam::DVec3;
use palpate_io::recording::RecordedCamera;
use palpate_model::observation::Camera;

/// Pixels a side of a scanner's picture.
const SIDES: std::ops::RangeInclusive<usize> = 32..=1024;

/// Widest vertical field of view of a scanner's picture [°]; it may stand close to the body.
const WIDEST: f64 = 130.0;

/// The camera of a recording as one that can be rendered. Lens distortion is left out: it moves a pixel, hardly its normal.
pub(crate) fn pinhole(c: &RecordedCamera) -> Pinhole {
    Pinhole {
        name: c.name.clone(),
        width: c.width,
        height: c.height,
        fx: c.focal[0],
        fy: c.focal[1],
        cx: c.center[0],
        cy: c.center[1],
        world_from_camera: c.world_from_camera,
    }
}

/// What saw points of the surface with this number in the plan's observation, looking at the box `low..high` [m] where it has no pose; `None`
/// without lines of sight.
pub(crate) fn viewer(e: &Experiment, number: usize, (low, high): (DVec3, DVec3)) -> Option<Pinhole> {
    let o = &e.plan().observation;
    let center = match o.cameras.get(number)? {
        Camera::Pinhole { .. } => return e.recording()?.cameras.get(number).map(pinhole),
        Camera::Scanner { center } => *center,
        Camera::Unknown => return None,
    };
    let middle = 0.5 * (low + high);
    let (away, radius) = (middle.distance(center), 0.5 * high.distance(low));
    let fov = (2.0 * (radius / away.max(radius)).asin()).to_degrees().clamp(1.0, WIDEST);
    // About as many pixels see the body as the scanner has points of it.
    let of_frame = |f: &palpate_model::observation::Frame| f.points.iter().filter(|p| p.camera as usize == number).count();
    let (frames, points) = o.frames.iter().map(of_frame).filter(|n| *n > 0).fold((0, 0), |(f, p), n| (f + 1, p + n));
    let stride = e.scene().observation.as_ref().map_or(1, |o| o.pixel_stride);
    let side = ((2 * points / frames.max(1)) as f64).sqrt().ceil() as usize * stride;
    let side = side.clamp(*SIDES.start(), *SIDES.end());
    let look = |up: DVec3| Pinhole::looking_at(center, middle, up, fov, side, side).ok();
    let camera = look(e.up()).or_else(|| look(e.up().any_orthonormal_vector()))?;
    Some(Pinhole { name: o.camera_names.get(number).cloned().unwrap_or_default(), ..camera })
}

/// Everything that saw the surface along lines of sight, with its number in the plan's observation.
pub(crate) fn viewers(e: &Experiment) -> Vec<(u32, Pinhole)> {
    let bounds = e.shape().bounds();
    let count = e.plan().observation.cameras.len();
    (0..count).filter_map(|c| Some((c as u32, viewer(e, c, bounds)?))).collect()
}
