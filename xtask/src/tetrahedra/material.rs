//! The material at one point: stable neo-Hookean elasticity and viscosity.
//!
//! Elastic energy of the deformation gradient F (Smith, De Goes & Kim, *Stable Neo-Hookean Flesh Simulation*, ACM TOG 37, 2018, Eq. 14):
//! ½ μ (|F|² − 3) + ½ λ (J − a)² − ½ μ ln(|F|² + 1) with a = 1 + ¾ μ/λ. Its constants are chosen so that it is linear elasticity of E and ν for
//! small strains (section 3.4 there): μ = 4/3 μ_L, λ = λ_L + 5/6 μ_L.
//!
//! The viscous second Piola–Kirchhoff stress is β C : Ė with the rate of Green's strain E and the linear elastic C: no rigid motion is damped.

use super::element::outer;
use glam::{DMat3, DVec3};

/// Second derivatives by F, in blocks of its columns.
pub type Tangent = [[DMat3; 3]; 3];

/// Constants [Pa].
#[derive(Clone, Copy, Debug)]
pub struct Material {
    mu: f64,
    lambda: f64,
    rest: f64,
    /// Lamé's constants of the linear law.
    linear: [f64; 2],
}

impl Material {
    /// A material with these small-strain constants.
    pub fn new(youngs_modulus: f64, poisson_ratio: f64) -> Material {
        let mu_linear = youngs_modulus / (2.0 * (1.0 + poisson_ratio));
        let lambda_linear = 2.0 * mu_linear * poisson_ratio / (1.0 - 2.0 * poisson_ratio);
        let (mu, lambda) = (4.0 / 3.0 * mu_linear, lambda_linear + 5.0 / 6.0 * mu_linear);
        Material { mu, lambda, rest: 1.0 + 0.75 * mu / lambda, linear: [lambda_linear, mu_linear] }
    }

    /// Energy per volume.
    pub fn energy(&self, f: DMat3) -> f64 {
        let squared = squared(f);
        let off = f.determinant() - self.rest;
        0.5 * (self.mu * (squared - 3.0 - (squared + 1.0).ln()) + self.lambda * off * off)
    }

    /// First Piola–Kirchhoff stress.
    pub fn stress(&self, f: DMat3) -> DMat3 {
        f * (self.mu * (1.0 - 1.0 / (squared(f) + 1.0))) + cofactor(f) * (self.lambda * (f.determinant() - self.rest))
    }

    /// Its derivative.
    pub fn tangent(&self, f: DMat3) -> Tangent {
        let near = 1.0 / (squared(f) + 1.0);
        let g = cofactor(f);
        let pull = self.lambda * (f.determinant() - self.rest);
        let mut t = [[DMat3::ZERO; 3]; 3];
        for k in 0..3 {
            for l in 0..3 {
                t[k][l] = outer(f.col(k), f.col(l)) * (2.0 * self.mu * near * near) + outer(g.col(k), g.col(l)) * self.lambda;
            }
            t[k][k] += DMat3::from_diagonal(DVec3::splat(self.mu * (1.0 - near)));
            // Column k of the cofactor is f_{k+1} × f_{k+2}.
            let (next, last) = ((k + 1) % 3, (k + 2) % 3);
            t[k][next] += cross(f.col(last)) * -pull;
            t[k][last] += cross(f.col(next)) * pull;
        }
        t
    }

    /// C : e of the linear law, for a symmetric e.
    fn linear(&self, e: DMat3) -> DMat3 {
        e * (2.0 * self.linear[1]) + DMat3::from_diagonal(DVec3::splat(self.linear[0] * trace(e)))
    }

    /// ½ e : C : e of the linear law, for a symmetric e.
    pub fn quadratic(&self, e: DMat3) -> f64 {
        let s = self.linear(e);
        0.5 * (0..3).map(|k| s.col(k).dot(e.col(k))).sum::<f64>()
    }

    /// Derivative of [`Material::quadratic`] by F where e is Green's strain less something that does not move.
    pub fn quadratic_stress(&self, f: DMat3, e: DMat3) -> DMat3 {
        f * self.linear(e)
    }

    /// Its second derivative.
    pub fn quadratic_tangent(&self, f: DMat3, e: DMat3) -> Tangent {
        let s = self.linear(e);
        let [lambda, mu] = self.linear;
        let all = (0..3).fold(DMat3::ZERO, |a, k| a + outer(f.col(k), f.col(k))) * mu;
        let mut t = [[DMat3::ZERO; 3]; 3];
        for k in 0..3 {
            for l in 0..3 {
                let [fk, fl] = [f.col(k), f.col(l)];
                t[k][l] = DMat3::from_diagonal(DVec3::splat(s.col(k)[l])) + outer(fl, fk) * mu + outer(fk, fl) * lambda;
            }
            t[k][k] += all;
        }
        t
    }
}

/// Green's strain.
pub fn green(f: DMat3) -> DMat3 {
    (f.transpose() * f - DMat3::IDENTITY) * 0.5
}

fn squared(f: DMat3) -> f64 {
    (0..3).map(|k| f.col(k).length_squared()).sum()
}

fn trace(e: DMat3) -> f64 {
    e.x_axis.x + e.y_axis.y + e.z_axis.z
}

/// ∂J/∂F.
fn cofactor(f: DMat3) -> DMat3 {
    DMat3::from_cols(f.y_axis.cross(f.z_axis), f.z_axis.cross(f.x_axis), f.x_axis.cross(f.y_axis))
}

/// The matrix of a × .
fn cross(a: DVec3) -> DMat3 {
    DMat3::from_cols(DVec3::new(0.0, a.z, -a.y), DVec3::new(-a.z, 0.0, a.x), DVec3::new(a.y, -a.x, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stretched a little with its sides free, the stress is E times the stretch and the sides shrink by ν.
    #[test]
    fn small_strains_obey_the_stated_constants() {
        let m = Material::new(2.4e5, 0.4);
        let e = 1e-5;
        let p = m.stress(DMat3::from_diagonal(DVec3::new(1.0 + e, 1.0 - 0.4 * e, 1.0 - 0.4 * e)));
        assert!((p.x_axis.x / (2.4e5 * e) - 1.0).abs() < 1e-4, "{}", p.x_axis.x / e);
        assert!(p.y_axis.y.abs() < 1e-4 * p.x_axis.x && m.stress(DMat3::IDENTITY).x_axis.length() < 1e-9);
    }
}
