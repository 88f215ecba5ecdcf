//! Analytic bodies: exact signed distances and meshes.

use super::{Shape, TriMesh};
use crate::scene::Analytic;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::f64::consts::TAU;

/// An analytic body placed in the world by a rigid pose.
#[derive(Clone, Debug)]
pub struct Placed {
    body: Analytic,
    pose: DAffine3,
    inverse: DAffine3,
}

impl Placed {
    /// Places a body; `pose` must be rigid (a rotation and a translation).
    pub fn new(body: Analytic, pose: DAffine3) -> Placed {
        Placed { body, pose, inverse: pose.inverse() }
    }
}

/// An orthonormal frame whose third column is `axis` (any length; z for a zero vector).
fn frame(axis: DVec3) -> DMat3 {
    let w = axis.try_normalize().unwrap_or(DVec3::Z);
    let (u, v) = w.any_orthonormal_pair();
    // (u, v, w) right-handed, so that meshes keep their orientation.
    if u.cross(v).dot(w) > 0.0 { DMat3::from_cols(u, v, w) } else { DMat3::from_cols(v, u, w) }
}

/// Distance across and along the axis of a body of revolution [m].
fn profile(p: DVec3, center: DVec3, axis: DVec3) -> DVec2 {
    let w = axis.try_normalize().unwrap_or(DVec3::Z);
    let d = p - center;
    let z = d.dot(w);
    DVec2::new((d - w * z).length(), z)
}

/// The point of a body of revolution with the given profile coordinates, in the half-plane of `p`.
fn revolve(q: DVec2, p: DVec3, center: DVec3, axis: DVec3) -> DVec3 {
    let f = frame(axis);
    let d = p - center;
    let across = d - f.z_axis * d.dot(f.z_axis);
    // On the axis up to rounding every direction across is as good.
    let across = if across.length() > 1e-9 * q.x.abs() { across.normalize() } else { f.x_axis };
    center + across * q.x + f.z_axis * q.y
}

/// Nearest point of the box |x| ≤ `half`'s surface, any dimension given as a slice.
fn closest_on_box<const N: usize>(p: [f64; N], half: [f64; N]) -> [f64; N] {
    let mut q: [f64; N] = std::array::from_fn(|a| p[a].clamp(-half[a], half[a]));
    if q == p {
        // Inside: out through the nearest face.
        let gap = |a: usize| half[a] - p[a].abs();
        let a = (0..N).fold(0, |m, a| if gap(a) < gap(m) { a } else { m });
        q[a] = half[a].copysign(p[a]);
    }
    q
}

impl Shape for Placed {
    fn signed_distance(&self, p: DVec3) -> f64 {
        let p = self.inverse.transform_point3(p);
        match self.body {
            Analytic::Ball { radius, center } => p.distance(center) - radius,
            Analytic::Torus { major, minor, center, axis } => {
                let q = profile(p, center, axis);
                (q - DVec2::new(major, 0.0)).length() - minor
            }
            Analytic::Box { min, max } => {
                let q = (p - 0.5 * (min + max)).abs() - 0.5 * (max - min);
                q.max(DVec3::ZERO).length() + q.max_element().min(0.0)
            }
            Analytic::Cylinder { radius, height, center, axis } => {
                let q = profile(p, center, axis);
                let q = DVec2::new(q.x - radius, q.y.abs() - 0.5 * height);
                q.max(DVec2::ZERO).length() + q.max_element().min(0.0)
            }
        }
    }

    fn closest_point(&self, p: DVec3) -> DVec3 {
        let p = self.inverse.transform_point3(p);
        let q = match self.body {
            Analytic::Ball { radius, center } => center + (p - center).try_normalize().unwrap_or(DVec3::X) * radius,
            Analytic::Torus { major, minor, center, axis } => {
                let ring = DVec2::new(major, 0.0);
                let d = (profile(p, center, axis) - ring).try_normalize().unwrap_or(DVec2::X);
                revolve(ring + d * minor, p, center, axis)
            }
            Analytic::Box { min, max } => {
                let center = 0.5 * (min + max);
                center + DVec3::from_array(closest_on_box((p - center).to_array(), (max - center).to_array()))
            }
            Analytic::Cylinder { radius, height, center, axis } => {
                let q = closest_on_box(profile(p, center, axis).to_array(), [radius, 0.5 * height]);
                revolve(DVec2::from_array(q), p, center, axis)
            }
        };
        self.pose.transform_point3(q)
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        // Half extents of a disc of radius one across a unit axis: √(1 − a²) per component.
        let across = |axis: DVec3| {
            let a = self.pose.transform_vector3(axis).try_normalize().unwrap_or(DVec3::Z);
            (a, (DVec3::ONE - a * a).max(DVec3::ZERO).map(f64::sqrt))
        };
        let (center, half) = match self.body {
            Analytic::Ball { radius, center } => (center, DVec3::splat(radius)),
            Analytic::Torus { major, minor, center, axis } => (center, across(axis).1 * major + minor),
            Analytic::Box { min, max } => {
                let half = 0.5 * (max - min);
                let m = self.pose.matrix3;
                (0.5 * (min + max), m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z)
            }
            Analytic::Cylinder { radius, height, center, axis } => {
                let (a, c) = across(axis);
                (center, c * radius + a.abs() * (0.5 * height))
            }
        };
        let center = self.pose.transform_point3(center);
        (center - half, center + half)
    }

    fn surface(&self, edge: f64) -> TriMesh {
        let mesh = match self.body {
            Analytic::Ball { radius, center } => ball(radius, center, edge),
            Analytic::Torus { major, minor, center, axis } => torus(major, minor, center, frame(axis), edge),
            Analytic::Box { min, max } => cuboid(min, max).refined(edge),
            Analytic::Cylinder { radius, height, center, axis } => {
                cylinder(radius, height, center, frame(axis), edge).refined(edge)
            }
        };
        mesh.transformed(&self.pose)
    }
}

fn ball(radius: f64, center: DVec3, edge: f64) -> TriMesh {
    // Icosahedron, refined on the unit sphere.
    let g = 0.5 * (1.0 + 5f64.sqrt());
    let mut vertices = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        vertices.extend([DVec3::new(0.0, a, b), DVec3::new(b, 0.0, a), DVec3::new(a, b, 0.0)].map(DVec3::normalize));
    }
    let mut triangles = Vec::new();
    // Its faces are the triples of mutually nearest vertices.
    let near = |a: usize, b: usize| vertices[a].distance(vertices[b]) < 1.1;
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(a, c) {
                    let outward = vertices[a].dot(vertices[b].cross(vertices[c])) > 0.0;
                    triangles.push(if outward { [a as u32, b as u32, c as u32] } else { [a as u32, c as u32, b as u32] });
                }
            }
        }
    }
    // An icosahedron has 20 faces; at least one refinement, so that even a coarse ball looks like one.
    let limit = (edge / radius).clamp(1e-3, 0.6);
    let unit = TriMesh { vertices, triangles }.refined_by(|a, b| a.distance(b) > limit, |a, b| (a + b).normalize());
    TriMesh { vertices: unit.vertices.iter().map(|&p| center + p * radius).collect(), triangles: unit.triangles }
}

/// Number of equal edges at most `edge` long around a circle (at least 12) or along a line.
fn divisions(length: f64, edge: f64, least: u32) -> u32 {
    // The cap keeps a mistaken edge length from exhausting memory.
    ((length / edge).ceil().clamp(f64::from(least), 4096.0)) as u32
}

fn torus(major: f64, minor: f64, center: DVec3, f: DMat3, edge: f64) -> TriMesh {
    let (nu, nv) = (divisions(TAU * (major + minor), edge, 12), divisions(TAU * minor, edge, 12));
    let mut mesh = TriMesh::default();
    for i in 0..nu {
        let (su, cu) = (TAU * f64::from(i) / f64::from(nu)).sin_cos();
        for j in 0..nv {
            let (sv, cv) = (TAU * f64::from(j) / f64::from(nv)).sin_cos();
            let r = major + minor * cv;
            mesh.vertices.push(center + f * DVec3::new(r * cu, r * su, minor * sv));
            let at = |i: u32, j: u32| (i % nu) * nv + j % nv;
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

fn cuboid(min: DVec3, max: DVec3) -> TriMesh {
    let vertices =
        (0..8).map(|i| DVec3::from_array(std::array::from_fn(|a| if i >> a & 1 == 1 { max[a] } else { min[a] }))).collect();
    let quads: [[u32; 4]; 6] = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriMesh { vertices, triangles }
}

fn cylinder(radius: f64, height: f64, center: DVec3, f: DMat3, edge: f64) -> TriMesh {
    let n = divisions(TAU * radius, edge, 12);
    let mut mesh = TriMesh::default();
    let z = f.z_axis * (0.5 * height);
    mesh.vertices.extend([center - z, center + z]);
    for i in 0..n {
        let (s, c) = (TAU * f64::from(i) / f64::from(n)).sin_cos();
        let r = (f.x_axis * c + f.y_axis * s) * radius;
        mesh.vertices.extend([center + r - z, center + r + z]);
        let at = |i: u32, top: u32| 2 + 2 * (i % n) + top;
        let (a, b, c, d) = (at(i, 0), at(i + 1, 0), at(i + 1, 1), at(i, 1));
        mesh.triangles.extend([[a, b, c], [a, c, d], [0, b, a], [1, d, c]]);
    }
    // Middles of edges on the curved side are moved onto it.
    mesh.refined_by(
        |a, b| a.distance(b) > edge,
        |a, b| {
            let middle = 0.5 * (a + b);
            let q = profile(middle, center, f.z_axis);
            let on_side = |p| profile(p, center, f.z_axis).x > radius * (1.0 - 1e-9);
            if on_side(a) && on_side(b) { revolve(DVec2::new(radius, q.y), middle, center, f.z_axis) } else { middle }
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    fn bodies() -> [(Analytic, f64, f64); 4] {
        let c = DVec3::new(0.1, -0.2, 0.3);
        let axis = DVec3::new(0.3, 1.0, -0.4);
        let pi = std::f64::consts::PI;
        [
            (Analytic::Ball { radius: 0.5, center: c }, pi / 6.0, pi),
            (Analytic::Torus { major: 0.5, minor: 0.2, center: c, axis }, 2.0 * pi * pi * 0.5 * 0.04, 4.0 * pi * pi * 0.1),
            (Analytic::Box { min: c, max: c + DVec3::new(1.0, 0.5, 0.25) }, 0.125, 1.0 + 0.5 + 0.25),
            (Analytic::Cylinder { radius: 0.3, height: 0.8, center: c, axis }, pi * 0.072, pi * (0.48 + 0.18)),
        ]
    }

    #[test]
    fn surfaces_are_watertight_and_measure_up() {
        let pose = DAffine3::from_rotation_translation(DQuat::from_rotation_x(0.7), DVec3::new(1.0, 2.0, 3.0));
        for (body, volume, area) in bodies() {
            let shape = Placed::new(body.clone(), pose);
            let mesh = shape.surface(0.03);
            // Every directed edge once, and once the other way: closed and consistently oriented.
            let mut directed: Vec<_> = mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
            directed.sort_unstable();
            let count = directed.len();
            directed.dedup();
            assert_eq!(count, directed.len(), "{body:?}");
            assert!(directed.iter().all(|&[a, b]| directed.binary_search(&[b, a]).is_ok()), "{body:?}");
            // Chords of 0.03 on radii from 0.2 lose below 0.4 %.
            assert!((mesh.volume() / volume - 1.0).abs() < 8e-3, "{body:?}: {} {volume}", mesh.volume());
            assert!((mesh.area() / area - 1.0).abs() < 8e-3, "{body:?}: {} {area}", mesh.area());
            assert!(mesh.vertices.iter().all(|&p| shape.signed_distance(p).abs() < 1e-12), "{body:?}");
            // Diagonals of the torus' quads are √2 times as long.
            assert!(mesh.edges().iter().all(|&[a, b]| mesh.vertices[a as usize].distance(mesh.vertices[b as usize]) < 0.0425));
            let (lo, hi) = shape.bounds();
            let (mlo, mhi) = mesh.bounds();
            assert!(((lo - mlo).abs().max_element()).max((hi - mhi).abs().max_element()) < 5e-3, "{body:?}");
            assert!(lo.cmple(mlo + 1e-12).all() && hi.cmpge(mhi - 1e-12).all(), "{body:?}");
        }
    }

    #[test]
    fn distance_is_that_of_the_nearest_surface_point() {
        for (body, ..) in bodies() {
            let shape = Placed::new(body, DAffine3::from_rotation_z(0.4));
            let mesh = shape.surface(0.02);
            for i in 0..40 {
                let t = f64::from(i);
                let p = shape.pose.transform_point3(DVec3::new(0.1, -0.2, 0.3))
                    + DVec3::new((1.3 * t).sin(), (2.1 * t).cos(), (0.7 * t).sin()) * (0.03 * t);
                let d = shape.signed_distance(p);
                let nearest = mesh.vertices.iter().map(|v| v.distance(p)).fold(f64::INFINITY, f64::min);
                // Vertices are 0.02 apart: near the surface the nearest one is up to 0.012 farther in the tangent plane.
                assert!(nearest > d.abs() - 1e-9 && nearest - d.abs() < 0.0125, "{shape:?} {p}: {d} {nearest}");
                let c = shape.closest_point(p);
                assert!(
                    shape.signed_distance(c).abs() < 1e-12 && (c.distance(p) - d.abs()).abs() < 1e-12,
                    "{shape:?} {p}: {c} {d}"
                );
            }
        }
    }
}
