//! Point clouds: kept as they are; or, where an image of the background is to be taken away from them, as depth images of a camera that is made up,
//! whose pixels are finer than the points are apart.

use super::masks::{ON_PLANE, check_range};
use super::plane::{Plane, largest};
use super::settle::{DEPTH_NOISE, Said, median};
use crate::Watch;
use crate::budget::Budget;
use crate::capture::{Cloud, DepthCamera, DepthFrame, Guess, Pixels};
use crate::error::{ImportError, refuse, refuse_option};
use crate::lens::Optics;
use crate::options::Options;
use glam::{DAffine3, DMat3, DVec3};
use palpate_io::lens::Lens;
use palpate_io::recording::{RecordedCloud, SeenFrom};

/// Pixels a mean distance of points: a point is moved by an eighth of that at most, and few meet in one pixel.
const FINE: f64 = 4.0;

/// No side of an image is longer than this.
const LONGEST: f64 = 4000.0;

/// Rays are no steeper than this from the axis of a camera (x/z).
const STEEPEST: f64 = 2.0;

/// Clouds that are kept.
pub struct Kept {
    /// In metres, without what is not the object.
    pub clouds: Vec<RecordedCloud>,
    /// The plane that was taken away.
    pub plane: Option<Plane>,
    /// Which way they were looked at.
    pub sight: Option<DVec3>,
}

/// Clouds in a unit of `metres` as a recording holds them, less what the user's ranges, box and plane take away.
pub fn keep(clouds: &[Cloud], viewpoint: Option<DVec3>, metres: f64, o: &Options, said: &mut Said) -> Result<Kept, ImportError> {
    check_range(o)?;
    let pose = pose(clouds, viewpoint, metres, o, said, "cloud.0.origin");
    let from = pose.map_or(SeenFrom::Unknown, |p| SeenFrom::Origin(p.translation));
    if pose.is_none() {
        let option = if o.near.is_some() { "near" } else { "far" };
        if let Some(x) = o.near.or(o.far) {
            return refuse_option(option, x, "needs to know from where the clouds were seen; --camera-pose says it");
        }
        let text = "nothing says from where the clouds were seen: they have no lines of sight, and which side of the body a point is of is not known";
        said.facts.push(format!("{text}; --camera-pose gives them"));
    }
    let noise = o.noise.unwrap_or(DEPTH_NOISE);
    if o.noise.is_none() {
        let text = format!("{DEPTH_NOISE} m a point, that of common depth cameras at half a metre");
        said.guesses.push(Guess::recording("noise", "cloud.0.noise_sigma", text, "--noise"));
    }
    let back = pose.map(|p| p.inverse());
    let taken = |p: &DVec3| {
        let z = back.map_or(0.0, |b| b.transform_point3(*p).z);
        let in_range = o.near.is_none_or(|n| z >= n) && o.far.is_none_or(|n| z <= n);
        in_range && o.within.is_none_or(|[low, high]| p.clamp(low, high) == *p)
    };
    let world = |c: &Cloud| c.points.iter().map(|p| *p * metres).filter(taken).collect::<Vec<_>>();
    let mut all: Vec<Vec<DVec3>> = clouds.iter().map(world).collect();
    let plane = match o.remove_plane.then(|| all.first().and_then(|first| largest(first, ON_PLANE * noise))) {
        Some(None) => return refuse_option("remove-plane", "", "the first cloud holds no plane: too few points"),
        Some(p) => p,
        None => None,
    };
    if let Some(plane) = &plane {
        all.iter_mut().for_each(|c| c.retain(|p| plane.height(*p) > ON_PLANE * noise));
    }
    let [before, after] = [clouds.iter().map(|c| c.points.len()).sum::<usize>(), all.iter().map(Vec::len).sum()];
    if o.near.or(o.far).is_some() || o.within.is_some() || plane.is_some() {
        said.facts.push(format!("masks: {after} of {before} points are taken for the object"));
    } else {
        said.facts
            .push("masks: none, every point counts as the object; --far, --box or --remove-plane take the rest away".into());
    }
    let cloud = |(c, points): (&Cloud, Vec<DVec3>)| RecordedCloud {
        file: c.file.clone(),
        time: c.time,
        from,
        points,
        noise_sigma: Some(noise),
        noise_systematic: 0.0,
    };
    let mut kept: Vec<RecordedCloud> = clouds.iter().zip(all).map(cloud).collect();
    kept.retain(|c| !c.points.is_empty());
    if kept.is_empty() {
        let used = [("near", o.near.is_some()), ("far", o.far.is_some()), ("box", o.within.is_some())];
        let option = used.iter().find(|u| u.1).map_or("remove-plane", |u| u.0);
        return refuse_option(option, "", "no point of any cloud is left");
    }
    if kept.len() < clouds.len() {
        said.losses.push(format!(
            "{} of {} clouds hold no point of the object and are left out",
            clouds.len() - kept.len(),
            clouds.len()
        ));
    }
    Ok(Kept { clouds: kept, plane, sight: pose.map(|p| p.matrix3.z_axis) })
}

/// The made-up camera of clouds in a unit of `metres`.
pub fn camera(
    clouds: &[Cloud],
    viewpoint: Option<DVec3>,
    metres: f64,
    o: &Options,
    said: &mut Said,
    watch: &mut Watch,
) -> Result<DepthCamera, ImportError> {
    let key = "camera.0.world_from_camera";
    let pose = pose(clouds, viewpoint, metres, o, said, key).unwrap_or_else(|| {
        let (middle, size) = middle_and_size(clouds, metres);
        let text = "clouds are looked at along y from outside, since they lie around their origin";
        said.guesses.push(Guess::recording("pose", key, text, "--camera-pose"));
        towards(middle - 3.0 * size.max(0.1) * DVec3::Y, middle)
    });
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
    let (mut met, mut frames, mut budget) = (0usize, Vec::new(), Budget::new());
    for (k, (cloud, points)) in clouds.iter().zip(&local).enumerate() {
        watch.at(k, clouds.len(), "clouds to images")?;
        let mut counts = vec![0u16; size[0] * size[1]];
        budget.take(&cloud.file, &counts)?;
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

/// Middle and diagonal of what clouds reach over [m].
fn middle_and_size(clouds: &[Cloud], metres: f64) -> (DVec3, f64) {
    let points = clouds.iter().flat_map(|c| c.points.iter().map(|p| *p * metres));
    let (low, high) = points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)));
    (0.5 * (low + high), (high - low).length())
}

/// Where the clouds were seen from, and which way a camera there looked; `None` where nothing says it.
fn pose(clouds: &[Cloud], viewpoint: Option<DVec3>, metres: f64, o: &Options, said: &mut Said, key: &str) -> Option<DAffine3> {
    if let Some(p) = o.camera_pose {
        return Some(p);
    }
    let points = || clouds.iter().flat_map(|c| c.points.iter().map(|p| *p * metres));
    let front = points().filter(|p| visible(*p)).count();
    let all = points().count().max(1);
    let (middle, _) = middle_and_size(clouds, metres);
    let (eye, text) = match viewpoint {
        Some(v) => (v * metres, "clouds were seen from their VIEWPOINT"),
        None if 100 * front > 99 * all => {
            let text = "clouds were seen from their origin, along z, since they lie in front of it";
            said.guesses.push(Guess::recording("pose", key, text, "--camera-pose"));
            return Some(DAffine3::IDENTITY);
        }
        None => return None,
    };
    said.guesses.push(Guess::recording("pose", key, text, "--camera-pose"));
    Some(towards(eye, middle))
}

/// A camera that looks from one place at another.
fn towards(eye: DVec3, middle: DVec3) -> DAffine3 {
    let z = (middle - eye).try_normalize().unwrap_or(DVec3::Z);
    let (x, y) = z.any_orthonormal_pair();
    // Right-handed: x × y = z.
    let x = if x.cross(y).dot(z) > 0.0 { x } else { -x };
    DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), eye)
}
