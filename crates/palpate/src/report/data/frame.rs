//! The frame that a scene is shown in: its bounds with axes and marks, the floor, and where one looks from.

use crate::experiment::Experiment;
use crate::report::quantity::round_up;
use crate::results::report::{Floats, SceneData};
use glam::DVec3;
use palpate_model::observation::Camera;

/// Bounds of all that is shown, and the distance of marks on the axes.
pub fn bounds(e: &Experiment, scene: &SceneData) -> ([[f64; 3]; 2], f64) {
    let (lo, hi) = e.shape().bounds();
    let (mut lo, mut hi) = (lo, hi);
    let mut grow = |p: DVec3| {
        if p.is_finite() {
            lo = lo.min(p);
            hi = hi.max(p);
        }
    };
    for m in scene.shown.iter().flat_map(|f| f.motions.iter().flatten()) {
        m.vertices.vectors().into_iter().chain(m.measured.vectors()).for_each(&mut grow);
    }
    // A plane nearby is the floor that people look for.
    let reach = (hi - lo).length();
    for p in &e.scene().planes {
        let foot = |q: DVec3| q - p.normal * p.normal.dot(q - p.point);
        let middle = 0.5 * (lo + hi);
        if (foot(middle) - middle).length() < reach {
            let foot = foot(middle);
            lo = lo.min(foot);
            hi = hi.max(foot);
        }
    }
    let size = (hi - lo).max_element().max(1e-9);
    let pad = DVec3::splat(0.03 * size);
    (lo, hi) = (lo - pad, hi + pad);
    ([lo.to_array(), hi.to_array()], round_up(size / 8.0))
}

/// From where one looks at first: as the camera that saw most does, a little from above, so that what it measured is in front.
pub fn view(e: &Experiment, scene: &SceneData) -> DVec3 {
    let up = DVec3::from_array(scene.up);
    let frames = &e.plan().observation.frames;
    let cameras = &e.plan().observation.cameras;
    let count = |c: usize| frames.iter().flat_map(|f| &f.points).filter(|p| p.camera as usize == c).count();
    let best = (0..cameras.len()).max_by_key(|c| (count(*c), std::cmp::Reverse(*c))).filter(|c| count(*c) > 0);
    let a = up.any_orthonormal_vector();
    let usual = (a * 0.5 - up.cross(a) * 0.85 + up * 0.35).normalize();
    let Some(camera) = best else { return usual };
    let from = match &cameras[camera] {
        Camera::Pinhole { axis, .. } => -*axis,
        Camera::Scanner { center } => {
            (*center - 0.5 * scene.bounds.map(DVec3::from_array).iter().sum::<DVec3>()).normalize_or(usual)
        }
        Camera::Unknown => return usual,
    };
    let level = from - up * from.dot(up);
    // Straight from above or below nothing of height is seen.
    let height = from.dot(up).clamp(0.15, 0.8);
    level.try_normalize().map_or(usual, |l| (l * (1.0 - height * height).sqrt() + up * height).normalize())
}

/// The corner where the axes meet: low, nearer to whoever looks, and to the left.
pub fn corner(scene: &SceneData) -> DVec3 {
    let [lo, hi] = scene.bounds.map(DVec3::from_array);
    let (up, view) = (DVec3::from_array(scene.up), DVec3::from_array(scene.view));
    let right = up.cross(view);
    let mut corner = lo;
    for a in 0..3 {
        let towards = if up[a].abs() > 0.7 { -up[a] } else { view[a] - right[a] * 0.2 };
        corner[a] = if towards > 0.0 { hi[a] } else { lo[a] };
    }
    corner
}

/// Lines of a grid on every plane within reach, in steps of the marks, at most 40 each way.
pub fn floor(e: &Experiment, scene: &SceneData) -> Floats {
    let [lo, hi] = scene.bounds.map(DVec3::from_array);
    let (middle, reach) = (0.5 * (lo + hi), 0.5 * (hi - lo).length());
    let mut out = Vec::new();
    for p in &e.scene().planes {
        let away = p.normal.dot(middle - p.point);
        if away.abs() > 1.5 * reach {
            continue;
        }
        let foot = middle - p.normal * away;
        // Along an axis of the world where the plane is level with one.
        let level = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().find(|a| a.dot(p.normal).abs() < 1e-6);
        let u = level.unwrap_or_else(|| p.normal.any_orthonormal_vector());
        let v = p.normal.cross(u);
        let n = ((0.75 * reach / scene.tick).ceil() as i64).clamp(1, 20);
        // Lines go through whole multiples of the step, as marks do.
        let origin = foot - u * (u.dot(foot) % scene.tick) - v * (v.dot(foot) % scene.tick);
        let length = n as f64 * scene.tick;
        for k in -n..=n {
            let s = k as f64 * scene.tick;
            out.extend([origin + u * s - v * length, origin + u * s + v * length]);
            out.extend([origin + v * s - u * length, origin + v * s + u * length]);
        }
    }
    Floats::of_vectors(&out)
}
