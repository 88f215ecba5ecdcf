//! Quadratic tetrahedra and triangles: shape functions, quadrature and the consistent mass.
//!
//! Corner functions are L(2L − 1), those of the edges' middles 4 L_a L_b in barycentric coordinates L (Zienkiewicz & Taylor, *The Finite
//! Element Method*, vol. 1). Sides may be curved: places are interpolated with the same functions.

use super::mesh::{EDGES, Mesh};
use glam::{DMat3, DVec3};

/// Four points, exact for quadratics: what a linear material needs in straight elements.
const STRESS: [([f64; 4], f64); 4] = {
    const A: f64 = 0.585_410_196_624_968_5;
    const B: f64 = 0.138_196_601_125_010_5;
    [([A, B, B, B], 0.25), ([B, A, B, B], 0.25), ([B, B, A, B], 0.25), ([B, B, B, A], 0.25)]
};

/// Eleven points, exact to the fourth degree (Keast, *Comput. Methods Appl. Mech. Eng.* 55, 1986): what the mass needs.
fn mass_rule() -> Vec<([f64; 4], f64)> {
    let (a, b) = (0.25 * (1.0 + (5.0_f64 / 14.0).sqrt()), 0.25 * (1.0 - (5.0_f64 / 14.0).sqrt()));
    let mut rule = vec![([0.25; 4], -6.0 * 74.0 / 5625.0)];
    for k in 0..4 {
        let mut l = [1.0 / 14.0; 4];
        l[k] = 11.0 / 14.0;
        rule.push((l, 6.0 * 343.0 / 45_000.0));
    }
    for [p, q] in EDGES {
        let mut l = [b; 4];
        (l[p], l[q]) = (a, a);
        rule.push((l, 6.0 * 56.0 / 2250.0));
    }
    rule
}

/// Six points of a triangle, exact to the fourth degree (Dunavant, *IJNME* 21, 1985), all inside and with positive weights.
const FACE: [([f64; 3], f64); 6] = {
    const A: f64 = 0.445_948_490_915_965;
    const B: f64 = 0.091_576_213_509_771;
    const V: f64 = 0.223_381_589_678_011;
    const W: f64 = 0.109_951_743_655_322;
    const C: f64 = 1.0 - 2.0 * A;
    const D: f64 = 1.0 - 2.0 * B;
    [([A, A, C], V), ([A, C, A], V), ([C, A, A], V), ([B, B, D], W), ([B, D, B], W), ([D, B, B], W)]
};

/// The ten functions of a tetrahedron.
fn shape(l: [f64; 4]) -> [f64; 10] {
    std::array::from_fn(
        |k| if k < 4 { l[k] * (2.0 * l[k] - 1.0) } else { EDGES[k - 4].map(|c| l[c]).iter().product::<f64>() * 4.0 },
    )
}

/// Their derivatives by L₁, L₂, L₃, with L₀ = 1 − L₁ − L₂ − L₃.
fn slopes(l: [f64; 4]) -> [DVec3; 10] {
    const D: [DVec3; 4] = [DVec3::NEG_ONE, DVec3::X, DVec3::Y, DVec3::Z];
    std::array::from_fn(|k| match k {
        0..4 => (4.0 * l[k] - 1.0) * D[k],
        _ => {
            let [a, b] = EDGES[k - 4];
            4.0 * (l[a] * D[b] + l[b] * D[a])
        }
    })
}

/// The six functions of a triangle.
pub fn face_shape(l: [f64; 3]) -> [f64; 6] {
    let corner = |k: usize| l[k] * (2.0 * l[k] - 1.0);
    [corner(0), corner(1), corner(2), 4.0 * l[0] * l[1], 4.0 * l[1] * l[2], 4.0 * l[2] * l[0]]
}

/// A quadrature point of a tetrahedron at rest.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Volume that it stands for [m³].
    pub volume: f64,
    /// Shape functions.
    pub shape: [f64; 10],
    /// Their gradients in the rest shape [1/m].
    pub gradients: [DVec3; 10],
}

impl Point {
    fn new(nodes: &[DVec3; 10], (l, weight): ([f64; 4], f64)) -> Point {
        let s = slopes(l);
        let jacobian = (0..10).fold(DMat3::ZERO, |j, k| j + outer(nodes[k], s[k]));
        let back = jacobian.inverse().transpose();
        Point { volume: weight * jacobian.determinant() / 6.0, shape: shape(l), gradients: s.map(|g| back * g) }
    }

    /// Gradient of a field in the rest shape.
    pub fn gradient(&self, field: &[DVec3; 10]) -> DMat3 {
        (0..10).fold(DMat3::ZERO, |f, k| f + outer(field[k], self.gradients[k]))
    }
}

/// a bᵀ.
pub fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Quadrature points of a face at rest: shape functions and areas [m²].
pub type Patches = [([f64; 6], f64); 6];

/// What of a mesh does not change while it moves.
#[derive(Clone, Debug)]
pub struct Elements {
    /// Points for stress and forces in the volume.
    pub points: Vec<[Point; 4]>,
    /// ∫ N_i N_j of every tetrahedron [m³].
    pub products: Vec<[[f64; 10]; 10]>,
    /// Points of the surface.
    pub patches: Vec<Patches>,
}

impl Elements {
    /// Integrates a mesh.
    pub fn new(mesh: &Mesh) -> Elements {
        let nodes = |t: &[usize; 10]| t.map(|n| mesh.nodes[n]);
        let rule = mass_rule();
        let product = |t: &[usize; 10]| {
            let mut m = [[0.0; 10]; 10];
            for p in rule.iter().map(|r| Point::new(&nodes(t), *r)) {
                for (row, a) in m.iter_mut().zip(p.shape) {
                    row.iter_mut().zip(p.shape).for_each(|(m, b)| *m += p.volume * a * b);
                }
            }
            m
        };
        Elements {
            points: mesh.tets.iter().map(|t| STRESS.map(|r| Point::new(&nodes(t), r))).collect(),
            products: mesh.tets.iter().map(product).collect(),
            patches: mesh.faces.iter().map(|f| patches(&f.map(|n| mesh.nodes[n]))).collect(),
        }
    }
}

fn patches(nodes: &[DVec3; 6]) -> Patches {
    FACE.map(|(l, weight)| {
        // Derivatives of the place by L₀ and L₁, with L₂ = 1 − L₀ − L₁.
        let along = |a: usize, edge: [usize; 3]| {
            let b = 2;
            let [ab, bc, ca] = edge.map(|k| nodes[k]);
            (4.0 * l[a] - 1.0) * nodes[a] - (4.0 * l[b] - 1.0) * nodes[b]
                + 4.0 * (l[1 - a] * ab + (l[b] - l[a]) * ca - l[1 - a] * bc)
        };
        // Middles: between both, between the other and the last, between this and the last.
        let area = along(0, [3, 4, 5]).cross(along(1, [3, 5, 4])).length();
        (face_shape(l), 0.5 * weight * area)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ L₀^a L₁^b L₂^c over a tetrahedron of volume one is 3! a! b! c! / (a + b + c + 3)!.
    #[test]
    fn rules_are_exact() {
        let factorial = |n: i32| (1..=n).map(f64::from).product::<f64>();
        for (rule, degree) in [(mass_rule(), 4), (STRESS.to_vec(), 2)] {
            for (a, b, c) in (0..=degree).flat_map(|a| (0..=degree).flat_map(move |b| (0..=degree).map(move |c| (a, b, c)))) {
                if a + b + c <= degree {
                    let sum: f64 = rule.iter().map(|(l, w)| w * l[0].powi(a) * l[1].powi(b) * l[2].powi(c)).sum();
                    let exact = 6.0 * factorial(a) * factorial(b) * factorial(c) / factorial(a + b + c + 3);
                    assert!((sum - exact).abs() < 1e-14, "{a} {b} {c}: {sum} instead of {exact}");
                }
            }
        }
    }

    #[test]
    fn meshes_have_the_volume_and_surface_of_their_bodies() {
        let block = Mesh::block([&[0.0, 0.05, 0.07, 0.2], &[0.0, 0.03], &[0.0, 0.01, 0.04]]);
        let ball = Mesh::ball(DVec3::X, 0.05, 3, 1);
        let pi = std::f64::consts::PI;
        // A side of the ball is three quadratic edges.
        let of = [(block, 2.4e-4, 2.0 * (0.006 + 0.008 + 0.0012), 1e-12), (ball, pi / 6.0 * 1e-3, pi * 0.01, 2e-3)];
        for (mesh, volume, area, within) in of {
            let e = Elements::new(&mesh);
            assert!(e.points.iter().flatten().all(|p| p.volume > 0.0), "inside out");
            let v: f64 = e.points.iter().flatten().map(|p| p.volume).sum();
            let m: f64 = e.products.iter().flatten().flatten().sum();
            let a: f64 = e.patches.iter().flatten().map(|p| p.1).sum();
            for (found, exact) in [(v, volume), (m, volume), (a, area)] {
                assert!((found / exact - 1.0).abs() < within, "{found} instead of {exact}");
            }
        }
    }
}
