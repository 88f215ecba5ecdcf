//! The normal of a piece of surface that turns with the body (Nanson's formula: n ∝ cof(F) N).

use glam::{DMat3, DVec3};

/// A deformed normal, with what its derivatives need.
#[derive(Clone, Copy, Debug)]
pub struct Turned {
    /// Unit normal.
    pub normal: DVec3,
    rest: DVec3,
    f: DMat3,
    /// Area over that at rest.
    size: f64,
}

/// Area vector cof(F) N of a unit of surface with the vector N at rest.
pub fn carried(rest: DVec3, f: DMat3) -> DVec3 {
    rest.x * f.y_axis.cross(f.z_axis) + rest.y * f.z_axis.cross(f.x_axis) + rest.z * f.x_axis.cross(f.y_axis)
}

/// Change of [`carried`] for a change of F.
pub fn carried_along(n: DVec3, f: DMat3, d: DMat3) -> DVec3 {
    n.x * (d.y_axis.cross(f.z_axis) + f.y_axis.cross(d.z_axis))
        + n.y * (d.z_axis.cross(f.x_axis) + f.z_axis.cross(d.x_axis))
        + n.z * (d.x_axis.cross(f.y_axis) + f.x_axis.cross(d.y_axis))
}

/// Its transpose: derivative by F of what has the derivative `g` by the area vector.
pub fn carried_pull(n: DVec3, f: DMat3, g: DVec3) -> DMat3 {
    let (x, y, z) = (f.x_axis, f.y_axis, f.z_axis);
    DMat3::from_cols(
        n.y * g.cross(z) + n.z * y.cross(g),
        n.z * g.cross(x) + n.x * z.cross(g),
        n.x * g.cross(y) + n.y * x.cross(g),
    )
}

impl Turned {
    /// The normal `rest` of a surface that deforms by F.
    pub fn new(rest: DVec3, f: DMat3) -> Turned {
        let m = carried(rest, f);
        // A surface that has shrunk to nothing has no normal; the one at rest is as good as any.
        let size = m.length();
        let normal = if size > f64::MIN_POSITIVE { m / size } else { rest };
        Turned { normal, rest, f, size: size.max(f64::MIN_POSITIVE) }
    }

    /// Change of the normal for a change of F.
    pub fn along(&self, d: DMat3) -> DVec3 {
        let m = carried_along(self.rest, self.f, d);
        (m - self.normal * self.normal.dot(m)) / self.size
    }

    /// The transpose of [`Turned::along`]: derivative by F of what has the derivative `w` by the normal.
    pub fn pull(&self, w: DVec3) -> DMat3 {
        carried_pull(self.rest, self.f, (w - self.normal * self.normal.dot(w)) / self.size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::rotation::tests::Noise;

    #[test]
    fn a_normal_turns_with_the_body_and_has_the_derivatives_it_says() {
        let mut noise = Noise(3);
        for _ in 0..20 {
            let rest = noise.vector(1.0).normalize();
            let turn = DMat3::from_axis_angle(noise.vector(1.0).normalize(), noise.uniform(-3.0, 3.0));
            assert!((Turned::new(rest, turn).normal - turn * rest).length() < 1e-14);
            let mut random = || DMat3::from_cols(noise.vector(0.4), noise.vector(0.4), noise.vector(0.4));
            let (f, d) = (turn + random(), random());
            let turned = Turned::new(rest, f);
            // It stays across what lies in the surface.
            let tangent = rest.any_orthonormal_vector();
            assert!(turned.normal.dot(f * tangent).abs() < 1e-14);
            let step = 1e-6;
            let [a, b] = [step, -step].map(|s| Turned::new(rest, f + d * s).normal);
            let along = turned.along(d);
            // A central difference: truncation of 1e-12 of the third derivative, rounding of 1e-10.
            assert!(((a - b) / (2.0 * step) - along).length() < 1e-8 * (1.0 + along.length()));
            let w = noise.vector(1.0);
            let pulled = turned.pull(w);
            let product: f64 = (0..3).map(|c| pulled.col(c).dot(d.col(c))).sum();
            assert!((product - w.dot(along)).abs() < 1e-12 * (1.0 + along.length()));
        }
    }
}
