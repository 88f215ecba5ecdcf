//! Pinhole cameras with OpenCV's distortion.

use super::noise;
use crate::document::Table;
use crate::error::InputError;
use crate::rigid::rigid;
use glam::{DAffine3, DVec3};

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
    /// OpenCV's k1, k2, p1, p2, k3.
    pub distortion: [f64; 5],
    /// Camera to world; camera axes x right, y down, z forward.
    pub world_from_camera: DAffine3,
    /// Metres per count of a depth image; `None` when no depth was recorded.
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
    let any_depth = root.tables("frame")?.iter().any(|f| f.has("depth"));
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
        if any_depth && depth_scale.is_none() {
            let used = root.tables("frame")?.iter().any(|f| f.has("depth") && f.optional_str("camera").ok() == Some(Some(name)));
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
            distortion: t.optional_numbers("distortion", 5)?.map_or([0.0; 5], |d| [d[0], d[1], d[2], d[3], d[4]]),
            world_from_camera: rigid(pose).map_err(|e| t.error("world_from_camera", e))?,
            depth_scale,
            depth_offset: t.optional_f64("depth_offset")?.unwrap_or(0.0),
            noise_sigma: noise(&t, "noise_sigma")?,
            noise_systematic: noise(&t, "noise_systematic")?.unwrap_or(0.0),
        };
        // The corners are farthest from the axis: where they can be undistorted, every pixel can.
        let (u, v) = (camera.width as f64 - 1.0, camera.height as f64 - 1.0);
        for [u, v] in [[0.0, 0.0], [u, 0.0], [0.0, v], [u, v]] {
            if camera.ray(u, v).is_none() {
                return Err(t.error(
                    "distortion",
                    format!("cannot be inverted at pixel ({u}, {v}); are the coefficients k1 k2 p1 p2 k3?"),
                ));
            }
        }
        cameras.push(camera);
    }
    Ok(cameras)
}

impl RecordedCamera {
    /// Centre of projection in the world [m].
    pub fn position(&self) -> DVec3 {
        self.world_from_camera.translation
    }

    /// Unit vector in the world along which depth counts.
    pub fn axis(&self) -> DVec3 {
        self.world_from_camera.matrix3.z_axis
    }

    /// Normalised image coordinates (x/z, y/z) of a pixel, distortion removed; `None` where it cannot be inverted.
    ///
    /// OpenCV's model x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²) (y likewise) is inverted by fixed-point iteration.
    pub fn ray(&self, u: f64, v: f64) -> Option<[f64; 2]> {
        let target = [(u - self.center[0]) / self.focal[0], (v - self.center[1]) / self.focal[1]];
        if self.distortion == [0.0; 5] {
            return Some(target);
        }
        let mut p = target;
        // Real lenses need some ten rounds; one that needs more than this is folded over itself.
        for _ in 0..200 {
            let (radial, tangential) = self.distort(p);
            if radial <= 0.0 {
                return None;
            }
            let next = [(target[0] - tangential[0]) / radial, (target[1] - tangential[1]) / radial];
            let change = (next[0] - p[0]).abs().max((next[1] - p[1]).abs());
            p = next;
            if change < 1e-12 {
                return Some(p);
            }
        }
        None
    }

    /// Radial factor and tangential shift at normalised coordinates.
    fn distort(&self, [x, y]: [f64; 2]) -> (f64, [f64; 2]) {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        (radial, [2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y])
    }

    /// Pixel (u, v) and depth along the axis [m] of a world point; `None` behind the camera.
    pub fn project(&self, world: DVec3) -> Option<([f64; 2], f64)> {
        let p = self.world_from_camera.inverse().transform_point3(world);
        if p.z <= 0.0 {
            return None;
        }
        let n = [p.x / p.z, p.y / p.z];
        let (radial, shift) = self.distort(n);
        let uv = [0, 1].map(|a| (n[a] * radial + shift[a]) * self.focal[a] + self.center[a]);
        Some((uv, p.z))
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

    /// Depth [m] of a count of a depth image, offset included.
    pub fn depth(&self, count: u16) -> f64 {
        f64::from(count) * self.depth_scale.unwrap_or(0.0) + self.depth_offset
    }
}
