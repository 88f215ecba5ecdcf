//! The lattice: where nodes and cells of a body lie in the world.

use glam::DVec3;

/// Offsets of the eight corners of a cell; bit 0 of the corner number is +x, bit 1 +y, bit 2 +z.
pub const CORNERS: [[i32; 3]; 8] = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]];

/// Signs (−1 or +1 per axis) of the eight corners of a cell, seen from its centre.
pub const SIGNS: [[f64; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [1.0, 1.0, 1.0],
];

/// An axis-aligned lattice: node (i, j, k) lies at `(offset + (i, j, k)) · h`, linear order x fastest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Grid {
    /// Lattice coordinates of node (0, 0, 0).
    pub offset: [i32; 3],
    /// Number of nodes along each axis.
    pub size: [usize; 3],
    /// Edge of a cell [m].
    pub h: f64,
}

impl Grid {
    /// The smallest lattice that covers the box `min..max` [m] with `border` more cells on every side.
    pub fn covering(min: DVec3, max: DVec3, h: f64, border: i32) -> Grid {
        // A face that lies on a lattice plane up to rounding must not add a layer of cells.
        let tol = 1e-6;
        let lo = (min / h + tol).floor().to_array();
        let hi = (max / h - tol).ceil().to_array();
        let offset = [0, 1, 2].map(|a| lo[a] as i32 - border);
        let size = [0, 1, 2].map(|a| (hi[a] as i32 + border - offset[a] + 1) as usize);
        Grid { offset, size, h }
    }

    /// Number of lattice nodes.
    pub fn len(&self) -> usize {
        self.size[0] * self.size[1] * self.size[2]
    }

    /// True when the lattice has no node.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Linear number of node (i, j, k).
    pub fn index(&self, ijk: [usize; 3]) -> usize {
        ijk[0] + self.size[0] * (ijk[1] + self.size[1] * ijk[2])
    }

    /// Node (i, j, k) of a linear number.
    pub fn coordinates(&self, index: usize) -> [usize; 3] {
        let nx = self.size[0];
        let ny = self.size[1];
        [index % nx, index / nx % ny, index / (nx * ny)]
    }

    /// World position of node (i, j, k) [m].
    pub fn position(&self, ijk: [usize; 3]) -> DVec3 {
        DVec3::new(
            f64::from(self.offset[0] + ijk[0] as i32),
            f64::from(self.offset[1] + ijk[1] as i32),
            f64::from(self.offset[2] + ijk[2] as i32),
        ) * self.h
    }

    /// Cell that holds a world point, by its lowest node, with local coordinates in [0, 1]³; `None` outside.
    pub fn locate(&self, p: DVec3) -> Option<([usize; 3], DVec3)> {
        let mut ijk = [0; 3];
        let mut xi = DVec3::ZERO;
        for a in 0..3 {
            let s = p[a] / self.h - f64::from(self.offset[a]);
            let last = self.size[a] as f64 - 1.0;
            if !(0.0..=last).contains(&s) {
                return None;
            }
            let i = s.floor().min(last - 1.0);
            ijk[a] = i as usize;
            xi[a] = s - i;
        }
        Some((ijk, xi))
    }
}

/// The eight trilinear shape functions at local coordinates `xi` ∈ [0, 1]³; they sum to one.
pub fn shape_functions(xi: DVec3) -> [f64; 8] {
    std::array::from_fn(|i| {
        let mut n = 1.0;
        for a in 0..3 {
            n *= if CORNERS[i][a] == 1 { xi[a] } else { 1.0 - xi[a] };
        }
        n
    })
}

/// Gradients of the eight trilinear shape functions with respect to `xi` (divide by h for 1/m).
pub fn shape_gradients(xi: DVec3) -> [DVec3; 8] {
    std::array::from_fn(|i| {
        let f = |a: usize| if CORNERS[i][a] == 1 { xi[a] } else { 1.0 - xi[a] };
        let s = SIGNS[i];
        DVec3::new(s[0] * f(1) * f(2), s[1] * f(0) * f(2), s[2] * f(0) * f(1))
    })
}
