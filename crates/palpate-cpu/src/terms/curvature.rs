//! How the tangent stiffness treats negative curvature.

/// How the tangent stiffness treats negative curvature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Curvature {
    /// As it is.
    Exact,
    /// As it is, but dissipation without the part of its curvature that is negative. That of φ(d), with d the square of a strain's increment and φ
    /// concave in d, is then the curvature of the parabola above it that touches it, and the full step cannot pass beyond its kink (Hunter &
    /// Lange, A tutorial on MM algorithms, The American Statistician 58, 2004).
    Majorised,
    /// Without the negative eigenvalues of squeezed cells (Teran, Sifakis, Irving & Fedkiw, Robust quasistatic finite elements and
    /// flesh simulation, SCA 2005).
    Tamed,
    /// Without all parts that may be indefinite: the second derivative of the rotation.
    Convex,
}

impl Curvature {
    /// True where negative curvature of elasticity and loads stays.
    pub fn keeps(self) -> bool {
        matches!(self, Curvature::Exact | Curvature::Majorised)
    }

    /// The second derivative of a dissipation by d that serves.
    pub fn of_dissipation(self, second: f64) -> f64 {
        if self == Curvature::Majorised { second.max(0.0) } else { second }
    }
}
