//! Point clouds as depth images: a recording holds no clouds, so that a camera is made up whose pixels are finer than the points are apart.

use super::settle::{Said, median};
use crate::Watch;
use crate::capture::{Cloud, DepthCamera, DepthFrame, Guess, Pixels};
use crate::error::{ImportError, refuse};
use crate::lens::{Lens, Optics};
use crate::options::Options;
use glam::{DAffine3, DMat3, DVec3};

/// Pixels a mean distance of points: a point is moved by an eighth of that at most, and few meet in one pixel.
const FINE: f64 = 4.0;

/// No side of an image is longer than this.
const LONGEST: f64 = 4000.0;

/// Rays are no steeper than this from the axis of a camera (x/z).
const STEEPEST: f64 = 2.0;

/// The made-up camera of clouds in a unit of `metres`.
pub fn camera(
    clouds: &[Cloud],
    viewpoint: Option<DVec3>,
    metres: f64,
    o: &Options,
    said: &mut Said,
    watch: &mut Watch,
) -> Result<DepthCamera, ImportError> {
    let pose = pose(clouds, viewpoint, metres, o, said);
    let back = pose.inverse();
    let local: Vec<Vec<DVec3>> =
        clouds.iter().map(|c| c.points.iter().map(|p| back.transform_point3(*p * metres)).collect()).collect();
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let (mut behind, mut all, mut far) = (0usize, 0usize, 0.0f64);
    for p in local.iter().flatten() {
        all += 1;
        if !visible(*p) {
            behind += 1;
            continue;
        }
        let ray = [p.x / p.z, p.y / p.z];
        for a in 0..2 {
            low[a] = low[a].min(ray[a]);
            high[a] = high[a].max(ray[a]);
        }
        far = far.max(p.z);
    }
    let Some(first) = clouds.first().filter(|_| behind < all) else {
        let file = clouds.first().map(|c| c.file.clone()).unwrap_or_default();
        return refuse(file, "holds no point in front of the camera; --camera-pose says from where they were seen");
    };
    let span = [high[0] - low[0], high[1] - low[1]].map(|s| s.max(1e-3));
    let dense = median(local.iter().map(|c| c.len() as f64).collect()).unwrap_or(1.0).max(1.0);
    let apart = (span[0] * span[1] / dense).sqrt();
    let focal = (FINE / apart).min(LONGEST / span[0].max(span[1]));
    let size = span.map(|s| (s * focal).ceil() as usize + 3);
    let center = [1.0 - low[0] * focal, 1.0 - low[1] * focal];
    let scale = if far <= 6.5 { 1e-4 } else { 1e-3 };
    let (mut met, mut frames) = (0usize, Vec::new());
    for (k, (cloud, points)) in clouds.iter().zip(&local).enumerate() {
        watch.at(k, clouds.len(), "clouds to images")?;
        let mut counts = vec![0u16; size[0] * size[1]];
        for p in points.iter().filter(|p| visible(**p)) {
            let pixel = [0, 1].map(|a| ((p[a] / p.z * focal + center[a]).round().max(0.0) as usize).min(size[a] - 1));
            let count = (p.z / scale).round().clamp(1.0, f64::from(u16::MAX)) as u16;
            let slot = &mut counts[pixel[0] + pixel[1] * size[0]];
            if *slot > 0 {
                met += 1;
            }
            if *slot == 0 || count < *slot {
                *slot = count;
            }
        }
        frames.push(DepthFrame { time: cloud.time, file: cloud.file.clone(), pixels: Pixels::Counts(counts), mask: None });
    }
    let deep = median(local.iter().flatten().map(|p| p.z).collect()).unwrap_or(far);
    said.losses.push(format!(
        "clouds become depth images of {} × {} pixels: a point moves sideways by up to {:.2} mm, {met} of {all} fall into a pixel with a nearer one \
         and {behind} lie behind the camera",
        size[0],
        size[1],
        500.0 * deep / focal * 2f64.sqrt()
    ));
    if first.points.is_empty() && clouds.iter().all(|c| c.points.is_empty()) {
        return refuse(&first.file, "holds no point, and neither do the others");
    }
    Ok(DepthCamera {
        name: "cloud".into(),
        size,
        optics: Optics { focal: [focal; 2], center, lens: Lens::Brown([0.0; 5]) },
        scale: Some(scale),
        usual_scale: (scale, ""),
        poses: vec![pose],
        frames,
        made: true,
    })
}

fn visible(p: DVec3) -> bool {
    p.z > 1e-3 && (p.x / p.z).abs() < STEEPEST && (p.y / p.z).abs() < STEEPEST
}

/// Where the clouds were seen from, and which way the camera looked.
fn pose(clouds: &[Cloud], viewpoint: Option<DVec3>, metres: f64, o: &Options, said: &mut Said) -> DAffine3 {
    if let Some(p) = o.camera_pose {
        return p;
    }
    let points = || clouds.iter().flat_map(|c| c.points.iter().map(|p| *p * metres));
    let front = points().filter(|p| visible(*p)).count();
    let all = points().count().max(1);
    let (low, high) = points().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)));
    let (middle, size) = (0.5 * (low + high), (high - low).length());
    let key = "camera.0.world_from_camera";
    let (eye, text) = match viewpoint {
        Some(v) => (v * metres, "clouds were seen from their VIEWPOINT"),
        None if 100 * front > 99 * all => {
            let text = "clouds were seen from their origin, along z, since they lie in front of it";
            said.guesses.push(Guess::recording("pose", key, text, "--camera-pose"));
            return DAffine3::IDENTITY;
        }
        None => (
            middle - 3.0 * size.max(0.1) * DVec3::Y,
            "clouds are looked at along y from outside, since they lie around their origin",
        ),
    };
    said.guesses.push(Guess::recording("pose", key, text, "--camera-pose"));
    let z = (middle - eye).try_normalize().unwrap_or(DVec3::Z);
    let (x, y) = z.any_orthonormal_pair();
    // Right-handed: x × y = z.
    let x = if x.cross(y).dot(z) > 0.0 { x } else { -x };
    DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), eye)
}
