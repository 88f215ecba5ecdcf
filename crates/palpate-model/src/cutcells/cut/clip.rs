//! Integrals over the part of a cell that lies both in the body and in a box (held regions).

use super::quadrature::{TETRA, TRIANGLE6};
use super::walk::{Lattice, Sink, below, kuhn, walk};
use super::{add_moments, lagrange_weights};
use crate::cutcells::grid::shape_functions;
use glam::{DAffine3, DVec3};

/// A box in its own frame: the points p with `min ≤ to_frame(p) ≤ max`.
#[derive(Clone, Copy, Debug)]
pub struct ClipBox {
    /// From world to the box's frame (rigid).
    pub to_frame: DAffine3,
    /// Lowest corner in the frame [m].
    pub min: DVec3,
    /// Highest corner in the frame [m].
    pub max: DVec3,
}

impl ClipBox {
    /// The six half-spaces' signed distances [m] at a world point, negative inside.
    pub fn distances(&self, p: DVec3) -> [f64; 6] {
        let q = self.to_frame.transform_point3(p);
        let (a, b) = (self.min - q, q - self.max);
        [a.x, a.y, a.z, b.x, b.y, b.z]
    }

    /// True if no point within `radius` [m] of the world point `p` lies in the box.
    pub fn misses(&self, p: DVec3, radius: f64) -> bool {
        self.distances(p).iter().any(|&d| d > radius)
    }
}

/// Moments of a held region in one cell.
#[derive(Clone, Debug)]
pub struct HeldMoments {
    /// ∫ N_i n dS over the faces of the region inside the body [m²]; n points out of the free part of the body, into the region.
    pub surface_normal: [DVec3; 8],
    /// ∫ N_i N_j dS over them [m²].
    pub surface_mass: [[f64; 8]; 8],
    /// ∫ N_i N_j dV over the held part of the body [m³].
    pub volume_mass: [[f64; 8]; 8],
    // Of monomials about the basis cell's centre, over h³.
    moments: [f64; 27],
}

impl Default for HeldMoments {
    fn default() -> HeldMoments {
        HeldMoments {
            surface_normal: Default::default(),
            surface_mass: Default::default(),
            volume_mass: Default::default(),
            moments: [0.0; 27],
        }
    }
}

impl HeldMoments {
    /// Area of the held surface [m²].
    pub fn area(&self) -> f64 {
        self.surface_mass.iter().flatten().sum()
    }

    /// Volume of the held part [m³].
    pub fn volume(&self) -> f64 {
        self.volume_mass.iter().flatten().sum()
    }

    /// Weights of the basis cell's Gauss points over the held part, as in [`super::CellCut::weights`].
    pub fn weights(&self) -> [f64; 27] {
        lagrange_weights(&self.moments)
    }
}

/// Adds the moments of `{φ < 0} ∩ cell ∩ region` to `held`, with the shape functions of the cell `basis` (see [`super::cut_cell`]).
/// `full` says that the body is known to fill the cell, without surface.
pub fn held_moments(lattice: &Lattice, cell: [i64; 3], basis: [i64; 3], full: bool, region: &ClipBox, held: &mut HeldMoments) {
    let (origin, shift) = (point(cell), point(cell) - point(basis));
    let mut sink = Clipped { region, h: lattice.h, origin, shift, held };
    if full {
        sink.cube(DVec3::ZERO, DVec3::ONE);
    } else {
        walk(lattice, cell, &mut sink);
    }
}

impl std::ops::AddAssign<&HeldMoments> for HeldMoments {
    fn add_assign(&mut self, other: &HeldMoments) {
        for i in 0..8 {
            self.surface_normal[i] += other.surface_normal[i];
            for j in 0..8 {
                self.surface_mass[i][j] += other.surface_mass[i][j];
                self.volume_mass[i][j] += other.volume_mass[i][j];
            }
        }
        self.moments.iter_mut().zip(other.moments).for_each(|(m, o)| *m += o);
    }
}

/// The pieces of a cell inside the body, kept so that many boxes can be held against them.
#[derive(Clone, Debug, Default)]
pub struct Pieces {
    solids: Vec<[DVec3; 4]>,
}

impl Pieces {
    /// Cuts a cell; `full` as in [`held_moments`].
    pub fn of(lattice: &Lattice, cell: [i64; 3], full: bool) -> Pieces {
        let mut pieces = Pieces::default();
        if full {
            pieces.cube(DVec3::ZERO, DVec3::ONE);
        } else {
            walk(lattice, cell, &mut pieces);
        }
        pieces
    }

    /// What [`held_moments`] adds for the cell of edge `h` [m] that was cut.
    pub fn held(&self, h: f64, cell: [i64; 3], basis: [i64; 3], region: &ClipBox) -> HeldMoments {
        let mut held = HeldMoments::default();
        let mut sink = Clipped { region, h, origin: point(cell), shift: point(cell) - point(basis), held: &mut held };
        self.solids.iter().for_each(|t| sink.tetra(*t));
        held
    }
}

impl Sink for Pieces {
    fn cube(&mut self, lo: DVec3, hi: DVec3) {
        self.solids.extend(kuhn(lo, hi));
    }

    fn tetra(&mut self, v: [DVec3; 4]) {
        self.solids.push(v);
    }
}

fn point(c: [i64; 3]) -> DVec3 {
    DVec3::new(c[0] as f64, c[1] as f64, c[2] as f64)
}

struct Clipped<'a> {
    region: &'a ClipBox,
    h: f64,
    origin: DVec3,
    shift: DVec3,
    held: &'a mut HeldMoments,
}

impl Clipped<'_> {
    /// Distances to the six half-spaces, in cells; a face of the box within 1e-9 cells of a point holds it.
    fn distances(&self, xi: DVec3) -> [f64; 6] {
        self.region.distances((self.origin + xi) * self.h).map(|d| if d.abs() < 1e-9 * self.h { 0.0 } else { d / self.h })
    }

    fn add_tetra(&mut self, v: [DVec3; 4]) {
        let part = (v[1] - v[0]).cross(v[2] - v[0]).dot(v[3] - v[0]).abs() / 6.0;
        let volume = part * self.h.powi(3);
        add_moments(&mut self.held.moments, v.map(|p| p + self.shift - 0.5), part);
        for (b, w) in &TETRA {
            let n = shape_functions(v[0] * b[0] + v[1] * b[1] + v[2] * b[2] + v[3] * b[3] + self.shift);
            add_outer(&mut self.held.volume_mass, &n, w * volume);
        }
    }

    /// Adds a polygon that a face of the box cuts out of the body, as far as the faces after it leave it.
    fn add_face(&mut self, face: usize, mut polygon: Vec<DVec3>) {
        for plane in face + 1..6 {
            // Sutherland–Hodgman against one half-space.
            let mut kept = Vec::with_capacity(polygon.len() + 1);
            for i in 0..polygon.len() {
                let (p, q) = (polygon[i], polygon[(i + 1) % polygon.len()]);
                let (a, b) = (self.distances(p)[plane], self.distances(q)[plane]);
                if a <= 0.0 {
                    kept.push(p);
                }
                if (a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0) {
                    kept.push(p + (q - p) * (a / (a - b)));
                }
            }
            polygon = kept;
        }
        // Seen from the free part of the body, outwards is into the box.
        let into = if face < 3 { DVec3::AXES[face] } else { -DVec3::AXES[face - 3] };
        let normal = self.region.to_frame.inverse().transform_vector3(into);
        for k in 2..polygon.len() {
            let t = [polygon[0], polygon[k - 1], polygon[k]];
            let area = 0.5 * (t[1] - t[0]).cross(t[2] - t[0]).length() * (self.h * self.h);
            for (b, w) in &TRIANGLE6 {
                let n = shape_functions(t[0] * b[0] + t[1] * b[1] + t[2] * b[2] + self.shift);
                add_outer(&mut self.held.surface_mass, &n, w * area);
                for i in 0..8 {
                    self.held.surface_normal[i] += normal * (w * area * n[i]);
                }
            }
        }
    }
}

fn add_outer(m: &mut [[f64; 8]; 8], n: &[f64; 8], w: f64) {
    for i in 0..8 {
        for j in 0..8 {
            m[i][j] += w * n[i] * n[j];
        }
    }
}

impl Sink for Clipped<'_> {
    fn cube(&mut self, lo: DVec3, hi: DVec3) {
        for t in kuhn(lo, hi) {
            self.tetra(t);
        }
    }

    fn tetra(&mut self, v: [DVec3; 4]) {
        let mut parts = vec![v];
        for plane in 0..6 {
            let mut kept = Vec::with_capacity(parts.len());
            for t in parts {
                let d = t.map(|p| self.distances(p)[plane]);
                let mut face = [DVec3::ZERO; 4];
                let corners = below(t, d, &mut |t| kept.push(t), &mut face);
                self.add_face(plane, face[..corners].to_vec());
            }
            parts = kept;
        }
        for t in parts {
            self.add_tetra(t);
        }
    }
}
