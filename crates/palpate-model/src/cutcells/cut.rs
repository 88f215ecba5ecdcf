//! Exact integration over the part of a cell inside the body, `{φ < 0} ∩ cell`, and over the surface in it.
//!
//! φ is sampled on a sub-lattice of the cell and taken linear in the six Kuhn tetrahedra of every sub-cube. Planar cuts are
//! therefore exact, curved ones second order in the sub-lattice's step. All integrals are moments over tetrahedra and triangles
//! with rules exact for the integrands' degree. Local coordinates ξ ∈ [0, 1]³ unless said otherwise.

mod clip;
mod quadrature;
mod walk;

pub use clip::{ClipBox, HeldMoments, Pieces, held_moments};
pub use walk::Lattice;

use crate::cutcells::grid::shape_functions;
use glam::DVec3;
use quadrature::{TETRA, TRIANGLE4};
use walk::{Sink, walk};

/// Offset of the outer Gauss points of order 3 from the middle of a unit interval, √(3/5)/2.
const GAUSS: f64 = 0.387_298_334_620_741_7;

/// Gauss points of a cell, 3 × 3 × 3 in [0, 1]³, x fastest.
pub const POINTS27: [DVec3; 27] = {
    let t = [0.5 - GAUSS, 0.5, 0.5 + GAUSS];
    let mut points = [DVec3::ZERO; 27];
    let mut q = 0;
    while q < 27 {
        points[q] = DVec3::new(t[q % 3], t[q / 3 % 3], t[q / 9]);
        q += 1;
    }
    points
};

/// Gauss weights of a full cell; they sum to one.
pub const FULL_WEIGHTS: [f64; 27] = {
    let w = [5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0];
    let mut weights = [0.0; 27];
    let mut q = 0;
    while q < 27 {
        weights[q] = w[q % 3] * w[q / 3 % 3] * w[q / 9];
        q += 1;
    }
    weights
};

/// What a cut leaves in a cell.
#[derive(Clone, Debug)]
pub struct CellCut {
    /// Volume inside, divided by h³.
    pub fraction: f64,
    /// Weights of [`POINTS27`] divided by h³; integrate every polynomial of degree ≤ 2 per variable exactly over the part inside.
    pub weights: [f64; 27],
    /// Surface in the cell: one piece per octant, more where it has a sharp edge there.
    pub pieces: Vec<SurfacePiece>,
}

/// Surface inside one octant of a cell, without sharp edges.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePiece {
    /// Area [m²].
    pub area: f64,
    /// Mean of the eight shape functions; sums to one.
    pub weights: [f64; 8],
    /// Mean outward normal, normalised.
    pub normal: DVec3,
    /// Centroid [m].
    pub point: DVec3,
}

impl CellCut {
    /// A cell filled by the body, without surface.
    pub fn full() -> CellCut {
        CellCut { fraction: 1.0, weights: FULL_WEIGHTS, pieces: Vec::new() }
    }

    /// Centroid of the part inside, in the coordinates ξ of the basis cell.
    pub fn centroid(&self) -> DVec3 {
        (0..27).map(|q| POINTS27[q] * self.weights[q]).sum::<DVec3>() / self.fraction
    }
}

/// Cuts the cell with lowest lattice node `cell` (counted in world lattice coordinates, not from the grid's first node).
/// Weights refer to the shape functions and Gauss points of the cell `basis`, normally the same one; with a neighbour as basis the
/// polynomials are continued beyond it.
pub fn cut_cell(lattice: &Lattice, cell: [i64; 3], basis: [i64; 3]) -> CellCut {
    let shift = DVec3::new((cell[0] - basis[0]) as f64, (cell[1] - basis[1]) as f64, (cell[2] - basis[2]) as f64);
    let mut sum = Sum { shift, moments: [0.0; 27], octants: Default::default() };
    walk(lattice, cell, &mut sum);
    let (mut fraction, mut weights) = (sum.moments[0], lagrange_weights(&sum.moments));
    // A cell cut only along its faces is full; what is missing is the rounding of a sum over tetrahedra.
    if fraction > 1.0 - 1e-12 && shift == DVec3::ZERO {
        (fraction, weights) = (1.0, FULL_WEIGHTS);
    }
    let h = lattice.h;
    let corner = DVec3::new(basis[0] as f64, basis[1] as f64, basis[2] as f64) * h;
    let pieces = sum
        .octants
        .iter()
        .flatten()
        // Below 1e-12 h² there are only degenerate triangles of a surface that touches a corner or an edge.
        .filter(|o| o.area > 1e-12)
        .map(|o| SurfacePiece {
            area: o.area * h * h,
            weights: o.weights.map(|w| w / o.area),
            normal: o.vector.normalize_or_zero(),
            point: corner + o.moment / o.area * h,
        })
        .collect();
    CellCut { fraction, weights, pieces }
}

/// Triangles whose normals differ from their piece's mean by more than this cosine (37 degrees) begin a new piece: an edge
/// of a box is not rounded off, while a smooth surface stays one piece per octant down to radii of about a cell.
const SHARP: f64 = 0.8;

#[derive(Clone, Copy, Default)]
struct Piece {
    area: f64,
    weights: [f64; 8],
    vector: DVec3,
    moment: DVec3,
}

/// Sums monomial moments about the basis cell's centre and surface moments per octant.
struct Sum {
    shift: DVec3,
    moments: [f64; 27],
    octants: [Vec<Piece>; 8],
}

impl Sink for Sum {
    fn cube(&mut self, lo: DVec3, hi: DVec3) {
        let (a, b) = (lo + self.shift - 0.5, hi + self.shift - 0.5);
        let integrals = |a: f64, b: f64| [b - a, 0.5 * (b * b - a * a), (b * b * b - a * a * a) / 3.0];
        let [x, y, z] = [integrals(a.x, b.x), integrals(a.y, b.y), integrals(a.z, b.z)];
        for q in 0..27 {
            self.moments[q] += x[q % 3] * y[q / 3 % 3] * z[q / 9];
        }
    }

    fn tetra(&mut self, v: [DVec3; 4]) {
        let volume = (v[1] - v[0]).cross(v[2] - v[0]).dot(v[3] - v[0]).abs() / 6.0;
        if volume == 0.0 {
            return;
        }
        add_moments(&mut self.moments, v.map(|p| p + self.shift - 0.5), volume);
    }

    fn triangle(&mut self, v: [DVec3; 3], octant: usize) {
        let vector = 0.5 * (v[1] - v[0]).cross(v[2] - v[0]);
        let area = vector.length();
        let v = v.map(|p| p + self.shift);
        let pieces = &mut self.octants[octant];
        let same = |p: &Piece| p.vector.dot(vector) >= SHARP * p.vector.length() * area;
        let n = pieces.iter().position(same).unwrap_or(pieces.len());
        if n == pieces.len() {
            pieces.push(Piece::default());
        }
        let o = &mut pieces[n];
        o.area += area;
        o.vector += vector;
        o.moment += (v[0] + v[1] + v[2]) * (area / 3.0);
        for (b, w) in &TRIANGLE4 {
            let n = shape_functions(v[0] * b[0] + v[1] * b[1] + v[2] * b[2]);
            for i in 0..8 {
                o.weights[i] += w * area * n[i];
            }
        }
    }
}

/// Adds the integrals of the monomials of degree ≤ 2 per variable over a tetrahedron.
fn add_moments(moments: &mut [f64; 27], v: [DVec3; 4], volume: f64) {
    for (b, w) in &TETRA {
        let p = v[0] * b[0] + v[1] * b[1] + v[2] * b[2] + v[3] * b[3];
        let w = w * volume;
        let (x, y) = ([1.0, p.x, p.x * p.x], [1.0, p.y, p.y * p.y]);
        for (c, z) in [w, w * p.z, w * p.z * p.z].into_iter().enumerate() {
            for (b, y) in y.into_iter().enumerate() {
                for (a, x) in x.into_iter().enumerate() {
                    moments[a + 3 * b + 9 * c] += x * y * z;
                }
            }
        }
    }
}

/// Weights of the Gauss points from moments of the monomials about the centre: ∫ of the tensor-product Lagrange polynomials.
fn lagrange_weights(moments: &[f64; 27]) -> [f64; 27] {
    let g = GAUSS;
    // Coefficients of 1, t, t² of the polynomials through −g, 0, g.
    let l = [[0.0, -0.5 / g, 0.5 / (g * g)], [1.0, 0.0, -1.0 / (g * g)], [0.0, 0.5 / g, 0.5 / (g * g)]];
    let mut m = *moments;
    for (stride, outer) in [(1, [3, 9]), (3, [1, 9]), (9, [1, 3])] {
        let old = m;
        for i in 0..3 {
            for j in 0..3 {
                let base = i * outer[0] + j * outer[1];
                for k in 0..3 {
                    m[base + k * stride] = (0..3).map(|a| l[k][a] * old[base + a * stride]).sum();
                }
            }
        }
    }
    m
}

#[cfg(test)]
mod tests;
