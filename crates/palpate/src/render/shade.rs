//! Shaded pictures for reports and `--format png`.

use crate::render::camera::Pinhole;
use crate::render::raster::{DepthImage, rasterise};
use glam::DVec3;

/// An RGB picture, 8 bits a channel, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green, blue of every pixel.
    pub rgb: Vec<[u8; 3]>,
}

/// Colour of what nothing is drawn on.
pub const BACKGROUND: [u8; 3] = [255, 255, 255];

impl Picture {
    /// A picture of one colour.
    pub fn blank(width: usize, height: usize) -> Picture {
        Picture { width, height, rgb: vec![BACKGROUND; width * height] }
    }

    /// Draws a filled square of `2 r + 1` pixels around (column, row), as far as it lies in the picture.
    pub fn dot(&mut self, column: f64, row: f64, r: i64, colour: [u8; 3]) {
        if !(column.is_finite() && row.is_finite()) {
            return;
        }
        let (c, l) = (column.round() as i64, row.round() as i64);
        for y in (l - r).max(0)..=(l + r).min(self.height as i64 - 1) {
            for x in (c - r).max(0)..=(c + r).min(self.width as i64 - 1) {
                self.rgb[y as usize * self.width + x as usize] = colour;
            }
        }
    }

    /// The picture as a PNG file's bytes.
    pub fn png(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let flat: Vec<u8> = self.rgb.iter().flatten().copied().collect();
        image::RgbImage::from_raw(self.width as u32, self.height as u32, flat)
            .expect("a picture holds width × height pixels")
            .write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png)
            .expect("writing a PNG to memory cannot fail");
        bytes
    }
}

/// A picture of a triangle mesh lit from the camera and from above, with smooth normals; `colour` of each vertex in [0, 1].
pub fn shade(
    camera: &Pinhole,
    vertices: &[DVec3],
    triangles: &[[u32; 3]],
    up: DVec3,
    colour: impl Fn(usize) -> DVec3,
) -> Picture {
    let mut picture = Picture::blank(camera.width, camera.height);
    shade_on(&mut picture, camera, vertices, triangles, up, colour);
    picture
}

/// The same over what a picture of the camera's size shows already; returns what was seen where.
pub fn shade_on(
    picture: &mut Picture,
    camera: &Pinhole,
    vertices: &[DVec3],
    triangles: &[[u32; 3]],
    up: DVec3,
    colour: impl Fn(usize) -> DVec3,
) -> DepthImage {
    let image = rasterise(camera, vertices, triangles);
    let normals = vertex_normals(vertices, triangles);
    let eye = camera.world_from_camera.translation;
    let sky = up.try_normalize().unwrap_or(DVec3::Z);
    for y in 0..camera.height {
        for x in 0..camera.width {
            let i = y * camera.width + x;
            if image.triangle[i] == DepthImage::NONE {
                continue;
            }
            let t = triangles[image.triangle[i] as usize].map(|v| v as usize);
            let p = camera.unproject(x as f64, y as f64, image.depth[i]);
            let b = barycentric(p, t.map(|v| vertices[v]));
            let mix = |f: &dyn Fn(usize) -> DVec3| f(t[0]) * b[0] + f(t[1]) * b[1] + f(t[2]) * b[2];
            let n = mix(&|v| normals[v]).normalize_or_zero();
            let view = (eye - p).normalize_or_zero();
            // Head light, and a little more on what faces the sky: the shape reads without cast shadows.
            let light = 0.25 + 0.6 * n.dot(view).abs() + 0.15 * n.dot(sky).max(0.0);
            let c = (mix(&colour) * light).clamp(DVec3::ZERO, DVec3::ONE);
            picture.rgb[i] = (c * 255.0).round().to_array().map(|v| v as u8);
        }
    }
    image
}

/// Area-weighted unit normals of the vertices.
fn vertex_normals(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; vertices.len()];
    for t in triangles {
        let [a, b, c] = t.map(|v| vertices[v as usize]);
        let n = (b - a).cross(c - a);
        for v in t {
            normals[*v as usize] += n;
        }
    }
    normals.iter().map(|n| n.normalize_or_zero()).collect()
}

/// Barycentric coordinates of the point of a triangle's plane nearest to `p`; a degenerate triangle gives its first corner.
fn barycentric(p: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let n = (b - a).cross(c - a);
    let area = n.length_squared();
    if area == 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let u = (c - b).cross(p - b).dot(n) / area;
    let v = (a - c).cross(p - c).dot(n) / area;
    [u, v, 1.0 - u - v]
}

/// Colour of a signed residual: blue (point inside the model) through grey to red (outside), saturated at ±`scale`. Grey in the middle is seen
/// on light and on dark ground, and blue and red by who cannot tell red from green (Moreland, Diverging color maps, 2009).
pub fn residual_colour(residual: f64, scale: f64) -> [u8; 3] {
    let t = (residual / scale).clamp(-1.0, 1.0);
    let (red, blue) = (DVec3::new(180.0, 4.0, 38.0), DVec3::new(39.0, 66.0, 190.0));
    let middle = DVec3::splat(205.0);
    let c = if t >= 0.0 { middle.lerp(red, t) } else { middle.lerp(blue, -t) };
    c.round().to_array().map(|v| v as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn barycentric_coordinates_reproduce_the_point() {
        let t = [DVec3::new(0.0, 0.1, 0.2), DVec3::new(1.0, 0.3, -0.2), DVec3::new(0.2, 0.9, 0.5)];
        let p = t[0] * 0.2 + t[1] * 0.5 + t[2] * 0.3;
        let b = barycentric(p, t);
        assert!((b[0] - 0.2).abs() < 1e-14 && (b[1] - 0.5).abs() < 1e-14 && (b[2] - 0.3).abs() < 1e-14);
    }

    #[test]
    fn a_framed_box_is_completely_in_the_picture() {
        for (size, up) in [((120, 80), DVec3::Z), ((80, 120), DVec3::Y)] {
            let (min, max) = (DVec3::new(-1.0, 2.0, 0.0), DVec3::new(0.5, 2.2, 1.0));
            let c = Pinhole::framing(min, max, up, size.0, size.1);
            for k in 0..8 {
                let corner = DVec3::select(glam::BVec3::new(k & 1 > 0, k & 2 > 0, k & 4 > 0), min, max);
                let p = c.project(corner);
                assert!((0.0..size.0 as f64 - 1.0).contains(&p.x) && (0.0..size.1 as f64 - 1.0).contains(&p.y), "{p}");
            }
        }
    }
}
