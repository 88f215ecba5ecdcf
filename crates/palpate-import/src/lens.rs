//! Lenses: the distortion models that depth cameras come with, and the way to those that a recording knows.

/// A distortion of normalised image coordinates (x/z, y/z).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// OpenCV's k1 k2 p1 p2 k3 (Brown & Conrady); all 0 = none. Recordings hold it as it is.
    Brown([f64; 5]),
    /// OpenCV's rational model k1 k2 p1 p2 k3 k4 k5 k6.
    Rational([f64; 8]),
    /// As `Brown`, with the tangential part of coordinates that are distorted radially already (RealSense).
    Modified([f64; 5]),
    /// The polynomial of `Brown` leads from the image to the ray (RealSense).
    Inverse([f64; 5]),
    /// Four coefficients of the angle from the axis (Kannala & Brandt; "equidistant", "fisheye").
    Angle([f64; 4]),
}

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

/// Brown & Conrady's polynomial; the tangential part is of the coordinates scaled by the radial one where `modified`.
fn brown([x, y]: [f64; 2], [k1, k2, p1, p2, k3]: [f64; 5], modified: bool) -> [f64; 2] {
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let [a, b] = if modified { [x * radial, y * radial] } else { [x, y] };
    [x * radial + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a), y * radial + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b]
}

/// The point that `map` takes to `goal`: Newton's method with differences, from the goal itself.
fn invert(map: impl Fn([f64; 2]) -> [f64; 2], goal: [f64; 2]) -> Option<[f64; 2]> {
    let mut p = goal;
    for _ in 0..50 {
        let f = map(p);
        let miss = [f[0] - goal[0], f[1] - goal[1]];
        if miss[0].abs().max(miss[1].abs()) < 1e-12 {
            return Some(p);
        }
        // Small against any image, large against rounding.
        const STEP: f64 = 1e-6;
        let (dx, dy) = (map([p[0] + STEP, p[1]]), map([p[0], p[1] + STEP]));
        let j = [[(dx[0] - f[0]) / STEP, (dy[0] - f[0]) / STEP], [(dx[1] - f[1]) / STEP, (dy[1] - f[1]) / STEP]];
        let det = j[0][0] * j[1][1] - j[0][1] * j[1][0];
        // An image that is folded over itself has no way back.
        if det <= 1e-9 || det.is_nan() {
            return None;
        }
        p = [p[0] - (j[1][1] * miss[0] - j[0][1] * miss[1]) / det, p[1] - (j[0][0] * miss[1] - j[1][0] * miss[0]) / det];
    }
    // Differences leave the last digits open.
    let f = map(p);
    ((f[0] - goal[0]).abs().max((f[1] - goal[1]).abs()) < 1e-9).then_some(p)
}

impl Lens {
    /// True where a ray falls on the sensor as through a pinhole.
    pub fn is_pinhole(&self) -> bool {
        let none = |k: &[f64]| k.iter().all(|x| *x == 0.0);
        match self {
            Lens::Brown(k) | Lens::Modified(k) | Lens::Inverse(k) => none(k),
            Lens::Rational(k) => none(k),
            // The angle itself, not its tangent, is what is measured: never a pinhole.
            Lens::Angle(_) => false,
        }
    }

    /// The same as Brown & Conrady's model, where it is one.
    pub fn as_brown(&self) -> Option<[f64; 5]> {
        match *self {
            Lens::Brown(k) => Some(k),
            Lens::Rational([k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]) => Some([k1, k2, p1, p2, k3]),
            _ if self.is_pinhole() => Some([0.0; 5]),
            _ => None,
        }
    }

    fn polynomial(&self, p: [f64; 2]) -> [f64; 2] {
        match *self {
            Lens::Brown(k) | Lens::Inverse(k) => brown(p, k, false),
            Lens::Modified(k) => brown(p, k, true),
            Lens::Rational([k1, k2, p1, p2, k3, k4, k5, k6]) => {
                let [x, y] = p;
                let r2 = x * x + y * y;
                let above = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let radial = above / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
                let shift = brown(p, [0.0, 0.0, p1, p2, 0.0], false);
                [x * radial + shift[0] - x, y * radial + shift[1] - y]
            }
            Lens::Angle([k1, k2, k3, k4]) => {
                let r = p[0].hypot(p[1]);
                let t = r.atan();
                let t2 = t * t;
                let bent = t * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))));
                let scale = if r > 0.0 { bent / r } else { 1.0 };
                p.map(|x| x * scale)
            }
        }
    }

    /// From a ray to the image; `None` where the model has no way.
    pub fn distort(&self, p: [f64; 2]) -> Option<[f64; 2]> {
        match self {
            Lens::Inverse(_) if !self.is_pinhole() => invert(|q| self.polynomial(q), p),
            _ => Some(self.polynomial(p)),
        }
    }

    /// From the image to a ray; `None` where the model has no way.
    pub fn undistort(&self, p: [f64; 2]) -> Option<[f64; 2]> {
        match self {
            _ if self.is_pinhole() => Some(p),
            Lens::Inverse(_) => Some(self.polynomial(p)),
            _ => invert(|q| self.polynomial(q), p),
        }
    }
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
