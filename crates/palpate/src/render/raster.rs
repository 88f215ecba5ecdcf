//! A z-buffer: which triangle a pixel's centre sees, and how far away.

use crate::render::camera::Pinhole;
use glam::DVec3;

/// What a pinhole camera without noise measures.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthImage {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Depth along the camera's z axis [m], row by row; infinite where nothing is seen.
    pub depth: Vec<f64>,
    /// Number of the triangle seen, [`DepthImage::NONE`] where nothing is seen.
    pub triangle: Vec<u32>,
}

impl DepthImage {
    /// Marks a pixel that sees nothing in [`DepthImage::triangle`].
    pub const NONE: u32 = u32::MAX;

    /// Number of pixels that see the surface.
    pub fn covered(&self) -> usize {
        self.triangle.iter().filter(|t| **t != DepthImage::NONE).count()
    }
}

/// Renders triangles of world points [m] by their depth at pixel centres.
///
/// 1/z is linear over the picture of a plane, so it is interpolated and inverted: depths are exact at pixel centres.
/// Both sides of a triangle are drawn (of a closed surface the nearest is the front). What is nearer than a thousandth
/// of the farthest vertex is cut off. Ties go to the triangle with the smaller number, so that the result does not
/// depend on anything but the input.
pub fn rasterise(camera: &Pinhole, vertices: &[DVec3], triangles: &[[u32; 3]]) -> DepthImage {
    let (width, height) = (camera.width, camera.height);
    let mut image = DepthImage {
        width,
        height,
        depth: vec![f64::INFINITY; width * height],
        triangle: vec![DepthImage::NONE; width * height],
    };
    let camera_from_world = camera.world_from_camera.inverse();
    let points: Vec<DVec3> = vertices.iter().map(|v| camera_from_world.transform_point3(*v)).collect();
    let near = 1e-3 * points.iter().map(|p| p.z).filter(|z| z.is_finite()).fold(0.0, f64::max);
    if near <= 0.0 {
        return image;
    }
    for (number, t) in triangles.iter().enumerate() {
        let corners = t.map(|v| points[v as usize]);
        if corners.iter().any(|p| !p.is_finite()) {
            continue;
        }
        if corners.iter().all(|p| p.z >= near) {
            draw(&mut image, camera, corners, number as u32);
        } else if corners.iter().any(|p| p.z > near) {
            let polygon = clip_near(corners, near);
            for k in 1..polygon.len().saturating_sub(1) {
                draw(&mut image, camera, [polygon[0], polygon[k], polygon[k + 1]], number as u32);
            }
        }
    }
    image
}

/// The part of a triangle (camera coordinates) with z ≥ `near`: up to four corners.
fn clip_near(corners: [DVec3; 3], near: f64) -> Vec<DVec3> {
    let mut out = Vec::with_capacity(4);
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        if a.z >= near {
            out.push(a);
        }
        if (a.z >= near) != (b.z >= near) {
            out.push(a.lerp(b, (near - a.z) / (b.z - a.z)));
        }
    }
    out
}

/// Draws one triangle given in camera coordinates, all in front of the camera.
fn draw(image: &mut DepthImage, camera: &Pinhole, corners: [DVec3; 3], number: u32) {
    let u = corners.map(|p| camera.cx + camera.fx * p.x / p.z);
    let v = corners.map(|p| camera.cy + camera.fy * p.y / p.z);
    let inverse = corners.map(|p| 1.0 / p.z);
    let area = (u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0]);
    if area == 0.0 || !area.is_finite() {
        return;
    }
    let range = |c: [f64; 3], n: usize| {
        let lo = c[0].min(c[1]).min(c[2]).ceil().max(0.0);
        let hi = c[0].max(c[1]).max(c[2]).floor().min(n as f64 - 1.0);
        (lo <= hi).then_some((lo as usize, hi as usize))
    };
    let (Some((u0, u1)), Some((v0, v1))) = (range(u, image.width), range(v, image.height)) else { return };
    // Barycentric coordinates are linear in the picture: b_k = start + column step + row step.
    let slope = [1, 2, 0].map(|i: usize| {
        let j = (i + 1) % 3;
        ((v[i] - v[j]) / area, (u[j] - u[i]) / area, (u[i] * v[j] - u[j] * v[i]) / area)
    });
    // Pixels exactly on an edge belong to both neighbours; the z test decides, so no crack appears along shared edges.
    let slack = -1e-12;
    for y in v0..=v1 {
        let row = y * image.width;
        for x in u0..=u1 {
            let b = slope.map(|(du, dv, c)| du * x as f64 + dv * y as f64 + c);
            if b[0] < slack || b[1] < slack || b[2] < slack {
                continue;
            }
            let z = 1.0 / (b[0] * inverse[0] + b[1] * inverse[1] + b[2] * inverse[2]);
            if z < image.depth[row + x] {
                image.depth[row + x] = z;
                image.triangle[row + x] = number;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;

    fn camera() -> Pinhole {
        "eye=0.3,-2,0.4 target=0,0,0 fov=50 size=160x120".parse().unwrap()
    }

    /// A big tilted square, seen completely: every pixel's depth must be the ray's intersection with its plane.
    #[test]
    fn depth_of_a_plane_is_exact_at_pixel_centres() {
        let c = camera();
        let n = DVec3::new(0.2, 1.0, 0.3).normalize();
        let a = n.any_orthonormal_vector();
        let b = n.cross(a);
        let square: Vec<DVec3> = [(-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0)].map(|(s, t)| a * s + b * t).to_vec();
        let image = rasterise(&c, &square, &[[0, 1, 2], [0, 2, 3]]);
        assert_eq!(image.covered(), 160 * 120, "no crack along the diagonal");
        for y in 0..120 {
            for x in 0..160 {
                let p = c.unproject(x as f64, y as f64, image.depth[y * 160 + x]);
                // Rounding: coordinates of a few metres, 1/z and back.
                assert!(p.dot(n).abs() < 1e-12, "pixel {x},{y}: {}", p.dot(n));
            }
        }
    }

    #[test]
    fn nearer_surfaces_hide_farther_ones_and_coverage_matches_the_solid_angle() {
        let c = camera();
        // Two facing discs: the near one half as big.
        let disc = |center: DVec3, r: f64, n: usize| -> (Vec<DVec3>, Vec<[u32; 3]>) {
            let x = c.world_from_camera.matrix3.x_axis;
            let y = c.world_from_camera.matrix3.y_axis;
            let mut v = vec![center];
            for k in 0..n {
                let p = DVec2::from_angle(std::f64::consts::TAU * k as f64 / n as f64) * r;
                v.push(center + x * p.x + y * p.y);
            }
            let t = (0..n as u32).map(|k| [0, k + 1, (k + 1) % n as u32 + 1]).collect();
            (v, t)
        };
        let forward = c.world_from_camera.matrix3.z_axis;
        let eye = c.world_from_camera.translation;
        let (far, t_far) = disc(eye + forward * 2.0, 0.4, 60);
        let (near, t_near) = disc(eye + forward * 1.0, 0.1, 60);
        let offset = far.len() as u32;
        let vertices = [far, near].concat();
        let triangles = [t_far, t_near.iter().map(|t| t.map(|v| v + offset)).collect()].concat();
        let image = rasterise(&c, &vertices, &triangles);
        let center = image.depth[60 * 160 + 80];
        assert!((center - 1.0).abs() < 1e-12);
        let near_pixels = image.depth.iter().filter(|z| **z < 1.5).count() as f64;
        let expected = std::f64::consts::PI * (0.1 * c.fx).powi(2);
        // A disc of radius r pixels is counted to within its rim: 2πr pixels, each half right on average.
        assert!((near_pixels - expected).abs() < 2.0 * (0.1 * c.fx), "{near_pixels} of {expected}");
    }

    #[test]
    fn what_lies_behind_the_camera_is_cut_off() {
        let c = camera();
        let forward = c.world_from_camera.matrix3.z_axis;
        let right = c.world_from_camera.matrix3.x_axis;
        let down = c.world_from_camera.matrix3.y_axis;
        let eye = c.world_from_camera.translation;
        // A floor under the camera that runs from behind it to 10 m in front.
        let floor: Vec<DVec3> = [(-9.0, -3.0), (9.0, -3.0), (9.0, 10.0), (-9.0, 10.0)]
            .map(|(s, t)| eye + down * 0.5 + right * s + forward * t)
            .to_vec();
        let image = rasterise(&c, &floor, &[[0, 1, 2], [0, 2, 3]]);
        let (x, y) = (80, 110);
        let z = image.depth[y * 160 + x];
        assert!((z - 0.5 * c.fy / (y as f64 - c.cy)).abs() < 1e-12, "{z}");
        assert_eq!(image.triangle[10 * 160 + 80], DepthImage::NONE, "nothing above the horizon");
        let behind: Vec<DVec3> = floor.iter().map(|p| *p - forward * 20.0).collect();
        assert_eq!(rasterise(&c, &behind, &[[0, 1, 2]]).covered(), 0);
    }

    /// 50 000 triangles in 640 × 480 pixels must not cost a tenth of a second: recordings and reports render hundreds of frames.
    #[test]
    fn fifty_thousand_triangles_are_drawn_quickly() {
        let c: Pinhole = "eye=0,-3,0 target=0,0,0 fov=45 size=640x480".parse().unwrap();
        let n = 160usize;
        let mut vertices = Vec::new();
        for i in 0..=n {
            for j in 0..=n {
                let (s, t) = (i as f64 / n as f64 * std::f64::consts::TAU, j as f64 / n as f64 * std::f64::consts::PI);
                vertices.push(DVec3::new(s.cos() * t.sin(), s.sin() * t.sin(), t.cos()));
            }
        }
        let at = |i: usize, j: usize| (i * (n + 1) + j) as u32;
        let quads = (0..n * n).map(|k| (k / n, k % n));
        let triangles: Vec<[u32; 3]> = quads
            .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i, j + 1)], [at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]])
            .collect();
        // The best of several: other work on the machine is not the renderer's fault.
        let seconds = (0..5).map(|_| {
            let clock = std::time::Instant::now();
            assert!(rasterise(&c, &vertices, &triangles).covered() > 50_000);
            clock.elapsed().as_secs_f64()
        });
        let best = seconds.fold(f64::INFINITY, f64::min);
        println!("{} triangles in {:.1} ms", triangles.len(), best * 1e3);
        assert!(best < 0.1, "{best} s");
    }
}
