//! Lenses: the distortion models that depth cameras come with. Recordings hold those of [`Lens::as_recorded`].

/// A distortion of normalised image coordinates (x/z, y/z).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// OpenCV's k1 k2 p1 p2 k3 (Brown & Conrady); all 0 = none.
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

    /// The lens of a recording's coefficients, OpenCV's k1 k2 p1 p2 k3 k4 k5 k6.
    pub fn recorded(k: [f64; 8]) -> Lens {
        match k {
            [k1, k2, p1, p2, k3, 0.0, 0.0, 0.0] => Lens::Brown([k1, k2, p1, p2, k3]),
            _ => Lens::Rational(k),
        }
    }

    /// OpenCV's k1 k2 p1 p2 k3 k4 k5 k6, where the lens is one of those that a recording holds.
    pub fn as_recorded(&self) -> Option<[f64; 8]> {
        match *self {
            Lens::Brown([k1, k2, p1, p2, k3]) => Some([k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]),
            Lens::Rational(k) => Some(k),
            _ if self.is_pinhole() => Some([0.0; 8]),
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

#[cfg(test)]
#[path = "lens_tests.rs"]
mod tests;
