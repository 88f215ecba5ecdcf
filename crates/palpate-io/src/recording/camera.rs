//! Cameras with OpenCV's distortion.

use super::image::{self, RawDepth};
use super::noise;
use crate::document::Table;
use crate::error::InputError;
use crate::lens::Lens;
use crate::rigid::rigid;
use glam::{DAffine3, DVec3};
use std::path::Path;

/// A calibrated depth camera.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedCamera {
    /// Label.
    pub name: String,
    /// Pixels per row.
    pub width: usize,
    /// Pixels per column.
    pub height: usize,
    /// Focal lengths fx, fy [pixels].
    pub focal: [f64; 2],
    /// Principal point cx, cy [pixels]; (0, 0) is the centre of the top-left pixel.
    pub center: [f64; 2],
    /// OpenCV's k1, k2, p1, p2, k3, k4, k5, k6; the last three are 0 but for a rational lens.
    pub distortion: [f64; 8],
    /// Camera to world; camera axes x right, y down, z forward.
    pub world_from_camera: DAffine3,
    /// Metres per count of a depth image; `None` when no counts were recorded.
    pub depth_scale: Option<f64>,
    /// Metres added to every reading.
    pub depth_offset: f64,
    /// Standard deviation of one reading [m].
    pub noise_sigma: Option<f64>,
    /// Size of errors that do not average out [m].
    pub noise_systematic: f64,
}

pub(super) fn cameras(root: &Table) -> Result<Vec<RecordedCamera>, InputError> {
    let mut cameras: Vec<RecordedCamera> = Vec::new();
    // Images of floats are in metres.
    let counts = |f: &Table| f.optional_str("depth").ok().flatten().is_some_and(|file| !image::holds_metres(Path::new(file)));
    let any_counts = root.tables("frame")?.iter().any(counts);
    for t in root.tables("camera")? {
        let name = t.optional_str("name")?.ok_or_else(|| t.missing("name", "a label"))?;
        if cameras.iter().any(|c| c.name == name) {
            return Err(t.error("name", format!("two cameras are named \"{name}\"")));
        }
        let size = |key: &str| -> Result<usize, InputError> {
            let n = t.optional_count(key, 1..=65536)?.ok_or_else(|| t.missing(key, "a number of pixels"))?;
            Ok(n as usize)
        };
        let focal = |key: &str| -> Result<f64, InputError> {
            let f = t.f64_where(key, |x| x > 0.0, "is not allowed: must be > 0 (pixels)")?;
            f.ok_or_else(|| t.missing(key, "a number > 0 (pixels)"))
        };
        let principal = |key: &str| t.optional_f64(key)?.ok_or_else(|| t.missing(key, "a number (pixels)"));
        let pose = t
            .optional_matrix4("world_from_camera")?
            .ok_or_else(|| t.missing("world_from_camera", "a rigid 4 × 4 matrix, row-major"))?;
        let depth_scale = t.f64_where("depth_scale", |x| x > 0.0, "is not allowed: must be > 0 (m per count)")?;
        if any_counts && depth_scale.is_none() {
            let used = root.tables("frame")?.iter().any(|f| counts(f) && f.optional_str("camera").ok() == Some(Some(name)));
            if used {
                return Err(t.missing("depth_scale", "metres per PNG count (0.001 for millimetres)"));
            }
        }
        let camera = RecordedCamera {
            name: name.to_string(),
            width: size("width")?,
            height: size("height")?,
            focal: [focal("fx")?, focal("fy")?],
            center: [principal("cx")?, principal("cy")?],
            distortion: distortion(&t)?,
            world_from_camera: rigid(pose).map_err(|e| t.error("world_from_camera", e))?,
            depth_scale,
            depth_offset: t.optional_f64("depth_offset")?.unwrap_or(0.0),
            noise_sigma: noise(&t, "noise_sigma")?,
            noise_systematic: noise(&t, "noise_systematic")?.unwrap_or(0.0),
        };
        if let Some(message) = camera.folded() {
            return Err(t.error("distortion", message));
        }
        cameras.push(camera);
    }
    Ok(cameras)
}

/// Five coefficients of Brown & Conrady, or eight of a rational lens.
fn distortion(t: &Table) -> Result<[f64; 8], InputError> {
    let mut all = [0.0; 8];
    let Some(given) = t.optional_list("distortion")? else { return Ok(all) };
    if given.len() != 5 && given.len() != 8 {
        let text = format!("expected 5 numbers (k1 k2 p1 p2 k3) or 8 (k4 k5 k6 as well), found {}", given.len());
        return Err(t.error("distortion", text));
    }
    all.iter_mut().zip(given).for_each(|(a, k)| *a = k);
    Ok(all)
}

impl RecordedCamera {
    /// Its lens.
    pub fn lens(&self) -> Lens {
        Lens::recorded(self.distortion)
    }

    /// What is wrong with a lens that is folded over itself inside of the image.
    ///
    /// The corners are farthest from the axis: where they can be undistorted, every pixel can. Behind a rational lens the corners of
    /// wide images see nothing; there the middles of the sides decide, and a reading that has no ray is refused by itself.
    pub fn folded(&self) -> Option<String> {
        let (u, v) = (self.width as f64 - 1.0, self.height as f64 - 1.0);
        let places = match self.lens() {
            Lens::Rational(_) => [[0.0, 0.5 * v], [u, 0.5 * v], [0.5 * u, 0.0], [0.5 * u, v]],
            _ => [[0.0, 0.0], [u, 0.0], [0.0, v], [u, v]],
        };
        let [u, v] = *places.iter().find(|p| self.ray(p[0], p[1]).is_none())?;
        Some(format!(
            "cannot be inverted at pixel ({u}, {v}); are the coefficients k1 k2 p1 p2 k3, and k4 k5 k6 of a rational lens?"
        ))
    }

    /// Centre of projection in the world [m].
    pub fn position(&self) -> DVec3 {
        self.world_from_camera.translation
    }

    /// Unit vector in the world along which depth counts.
    pub fn axis(&self) -> DVec3 {
        self.world_from_camera.matrix3.z_axis
    }

    /// Normalised image coordinates (x/z, y/z) of a pixel, distortion removed; `None` where it cannot be inverted.
    pub fn ray(&self, u: f64, v: f64) -> Option<[f64; 2]> {
        self.lens().undistort([(u - self.center[0]) / self.focal[0], (v - self.center[1]) / self.focal[1]])
    }

    /// Pixel (u, v) and depth along the axis [m] of a world point; `None` behind the camera.
    pub fn project(&self, world: DVec3) -> Option<([f64; 2], f64)> {
        let p = self.world_from_camera.inverse().transform_point3(world);
        if p.z <= 0.0 {
            return None;
        }
        let bent = self.lens().distort([p.x / p.z, p.y / p.z])?;
        Some(([0, 1].map(|a| bent[a] * self.focal[a] + self.center[a]), p.z))
    }

    /// True where a world point [m] falls into the image.
    pub fn holds(&self, world: DVec3) -> bool {
        let size = [self.width as f64, self.height as f64];
        self.project(world).is_some_and(|(uv, _)| (0..2).all(|a| (-0.5..size[a] - 0.5).contains(&uv[a])))
    }

    /// World point of a pixel whose depth along the axis is `z` [m]; `None` where the distortion cannot be inverted.
    pub fn point(&self, u: f64, v: f64, z: f64) -> Option<DVec3> {
        let [x, y] = self.ray(u, v)?;
        Some(self.world_from_camera.transform_point3(DVec3::new(x * z, y * z, z)))
    }

    /// Depth [m] of a reading of a depth image, offset included.
    pub fn depth(&self, reading: impl Into<RawDepth>) -> f64 {
        self.plain_depth(reading.into()) + self.depth_offset
    }

    /// The same without the offset.
    pub(super) fn plain_depth(&self, reading: RawDepth) -> f64 {
        match reading {
            RawDepth::Count(c) => f64::from(c) * self.depth_scale.unwrap_or(0.0),
            RawDepth::Metres(z) => f64::from(z),
        }
    }
}
