//! Sensors behind lenses, and images that are straightened where a recording does not know the lens.

use palpate_io::lens::Lens;

/// A lens behind a sensor's pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optics {
    /// fx, fy [pixels].
    pub focal: [f64; 2],
    /// cx, cy [pixels], (0, 0) the centre of the top-left pixel.
    pub center: [f64; 2],
    /// Distortion.
    pub lens: Lens,
}

impl Optics {
    /// Ray of a pixel.
    pub fn ray(&self, u: f64, v: f64) -> Option<[f64; 2]> {
        self.lens.undistort([(u - self.center[0]) / self.focal[0], (v - self.center[1]) / self.focal[1]])
    }

    /// Pixel of a ray.
    pub fn pixel(&self, ray: [f64; 2]) -> Option<[f64; 2]> {
        let p = self.lens.distort(ray)?;
        Some([p[0] * self.focal[0] + self.center[0], p[1] * self.focal[1] + self.center[1]])
    }
}

/// For every pixel of a pinhole image, where it lies in the image of a lens (column, row); NaN outside.
pub(crate) struct Straightened {
    size: [usize; 2],
    from: Vec<[f32; 2]>,
    /// Share of the lens's pixels that the pinhole image of the same size and focal length does not reach.
    pub lost: f64,
}

/// Depths of neighbours that differ by more than this share belong to two surfaces, and nothing lies between them.
const SAME_SURFACE: f32 = 0.02;

impl Straightened {
    /// Prepares for images of a size.
    pub fn new(optics: &Optics, size: [usize; 2]) -> Straightened {
        let [w, h] = size;
        let plain = Optics { lens: Lens::Brown([0.0; 5]), ..*optics };
        let from = (0..w * h)
            .map(|i| {
                let ray = plain.ray((i % w) as f64, (i / w) as f64).unwrap_or([f64::NAN; 2]);
                let there = optics.pixel(ray).filter(|[u, v]| {
                    let inside = *u > -0.5 && *v > -0.5 && *u < w as f64 - 0.5 && *v < h as f64 - 0.5;
                    // Far out a polynomial turns round: only what comes back is real.
                    let back = || optics.ray(*u, *v).is_some_and(|r| (r[0] - ray[0]).hypot(r[1] - ray[1]) < 1e-6);
                    inside && back()
                });
                there.map_or([f32::NAN; 2], |p| p.map(|x| x as f32))
            })
            .collect();
        let reached = |i: usize| {
            let ray = optics.ray((i % w) as f64, (i / w) as f64);
            let p = ray.and_then(|r| plain.pixel(r));
            p.is_some_and(|[u, v]| u > -0.5 && v > -0.5 && u < w as f64 - 0.5 && v < h as f64 - 0.5)
        };
        let lost = (0..w * h).filter(|i| !reached(*i)).count() as f64 / (w * h) as f64;
        Straightened { size, from, lost }
    }

    /// The pinhole image of one through the lens; 0 = no reading. Depth along the axis does not change: between four readings of one surface
    /// it is interpolated, at edges the nearest is taken.
    pub fn depth(&self, at: impl Fn(usize) -> f32) -> Vec<f32> {
        let [w, h] = self.size;
        let pick = |[u, v]: [f32; 2]| -> f32 {
            if u.is_nan() {
                return 0.0;
            }
            let nearest = || at((u.round().max(0.0) as usize).min(w - 1) + (v.round().max(0.0) as usize).min(h - 1) * w);
            let (u0, v0) = (u.floor(), v.floor());
            if u0 < 0.0 || v0 < 0.0 || u0 as usize + 1 >= w || v0 as usize + 1 >= h {
                return nearest();
            }
            let first = u0 as usize + v0 as usize * w;
            let z = [at(first), at(first + 1), at(first + w), at(first + w + 1)];
            let (low, high) = z.iter().fold((f32::INFINITY, 0.0f32), |(a, b), x| (a.min(*x), b.max(*x)));
            if !(low > 0.0 && high - low <= SAME_SURFACE * low) {
                return nearest();
            }
            let (a, b) = (u - u0, v - v0);
            (z[0] * (1.0 - a) + z[1] * a) * (1.0 - b) + (z[2] * (1.0 - a) + z[3] * a) * b
        };
        self.from.iter().map(|p| pick(*p)).collect()
    }

    /// A mask as the pinhole sees it.
    pub fn mask(&self, mask: &[bool]) -> Vec<bool> {
        let [w, h] = self.size;
        let pick = |p: &[f32; 2]| {
            !p[0].is_nan() && mask[(p[0].round().max(0.0) as usize).min(w - 1) + (p[1].round().max(0.0) as usize).min(h - 1) * w]
        };
        self.from.iter().map(pick).collect()
    }
}

#[cfg(test)]
#[path = "lens_tests.rs"]
mod tests;
