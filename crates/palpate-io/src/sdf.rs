//! Signed distance grids in the binary layout of the Sparse Surface Constraints code.

use crate::error::InputError;
use crate::input::read_bytes;
use glam::DVec3;
use palpate_model::shape::{Shape, TriMesh};
use std::collections::BTreeMap;
use std::path::Path;

/// A signed distance sampled on a lattice, negative inside. Node (i, j, k) lies at `(offset + (i, j, k)) · h`.
#[derive(Clone, Debug, PartialEq)]
pub struct SdfGrid {
    /// Cells per unit length of the file.
    pub resolution: i32,
    /// Lattice coordinates of node (0, 0, 0).
    pub offset: [i32; 3],
    /// Nodes along each axis.
    pub size: [usize; 3],
    /// Signed distance at the nodes in cells, x fastest.
    pub values: Vec<f64>,
    /// Edge of a cell [m].
    pub h: f64,
    /// Corners of a box around the body [m]: every closest point asks for them.
    extent: (DVec3, DVec3),
}

/// Reads `int32` resolution, `int32[3]` offset, `int32[3]` size, then `float32` values in cells (little-endian, x fastest).
/// `scale` is the length of the file's unit [m].
///
/// # Errors
/// A file that is too short or too long for its size, or a value that is not finite.
pub fn read_sdf(path: impl AsRef<Path>, scale: f64) -> Result<SdfGrid, InputError> {
    sdf(path.as_ref(), scale)
}

fn sdf(path: &Path, scale: f64) -> Result<SdfGrid, InputError> {
    let bytes = read_bytes(path)?;
    let (head, body) =
        bytes.split_at_checked(28).ok_or_else(|| InputError::file(path, "is shorter than the header of 28 bytes"))?;
    let words: Vec<i32> = head.chunks_exact(4).map(|c| i32::from_le_bytes([c[0], c[1], c[2], c[3]])).collect();
    let resolution = words[0];
    // 4096³ is far beyond memory; the limit keeps the product from overflowing.
    if resolution < 1 || words[4..7].iter().any(|n| !(2..=4096).contains(n)) {
        let text = format!("resolution {resolution} and size {:?}: expected a resolution ≥ 1 and 2 to 4096 nodes", &words[4..7]);
        return Err(InputError::file(path, text));
    }
    let size = [words[4] as usize, words[5] as usize, words[6] as usize];
    let count = size[0] * size[1] * size[2];
    if body.len() != 4 * count {
        return Err(InputError::file(path, format!("{} bytes of values, {size:?} nodes need {}", body.len(), 4 * count)));
    }
    let values: Vec<f64> = body.chunks_exact(4).map(|c| f64::from(f32::from_le_bytes([c[0], c[1], c[2], c[3]]))).collect();
    if let Some(i) = values.iter().position(|v| !v.is_finite()) {
        return Err(InputError::file(path, format!("value {i} is not finite")));
    }
    let (offset, h) = ([words[1], words[2], words[3]], scale / f64::from(resolution));
    let mut grid = SdfGrid { resolution, offset, size, values, h, extent: Default::default() };
    grid.extent = grid.measured();
    Ok(grid)
}

impl SdfGrid {
    /// Sets every |φ| < 0.1 cells to 0, so that no cell is cut to a sliver (the rule of the Sparse Surface Constraints code).
    pub fn snapped(mut self) -> SdfGrid {
        self.values.iter_mut().filter(|v| v.abs() < 0.1).for_each(|v| *v = 0.0);
        self.extent = self.measured();
        self
    }

    /// Corners of a box around the body [m].
    fn measured(&self) -> (DVec3, DVec3) {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for c in self.active_cells() {
            // The surface inside a cell lies between its inside corners and where edges leave the body.
            let corners = cube(c);
            for a in corners {
                let fa = self.values[self.index(a)];
                if fa < 0.0 {
                    let pa = self.position(a);
                    (min, max) = (min.min(pa), max.max(pa));
                    for b in corners {
                        let fb = self.values[self.index(b)];
                        if fb >= 0.0 && (0..3).filter(|i| a[*i] != b[*i]).count() == 1 {
                            let p = pa.lerp(self.position(b), fa / (fa - fb));
                            (min, max) = (min.min(p), max.max(p));
                        }
                    }
                }
            }
        }
        (min, max)
    }

    /// Number of a node in `values`.
    fn index(&self, ijk: [usize; 3]) -> usize {
        ijk[0] + self.size[0] * (ijk[1] + self.size[1] * ijk[2])
    }

    /// World position of a node [m].
    fn position(&self, ijk: [usize; 3]) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|a| f64::from(self.offset[a]) + ijk[a] as f64)) * self.h
    }

    /// Corner (0, 0, 0) of every cell that a corner with φ < 0 makes part of the body.
    pub fn active_cells(&self) -> Vec<[usize; 3]> {
        self.cells().filter(|c| cube(*c).iter().any(|n| self.values[self.index(*n)] < 0.0)).collect()
    }

    fn cells(&self) -> impl Iterator<Item = [usize; 3]> + use<> {
        let [nx, ny, nz] = self.size.map(|n| n - 1);
        (0..nz).flat_map(move |k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])))
    }
}

/// Eight corners of a cell, bit 0 of the number +x, bit 1 +y, bit 2 +z.
fn cube(c: [usize; 3]) -> [[usize; 3]; 8] {
    std::array::from_fn(|n| [c[0] + (n & 1), c[1] + (n >> 1 & 1), c[2] + (n >> 2 & 1)])
}

/// Six tetrahedra around the diagonal from corner 0 to corner 7; neighbouring cells split their common face alike.
const TETRAHEDRA: [[usize; 4]; 6] = [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

impl Shape for SdfGrid {
    /// Trilinear between nodes; outside the lattice the nearest lattice point's value plus the distance to it.
    fn signed_distance(&self, p: DVec3) -> f64 {
        let last = self.size.map(|n| n - 1);
        let local = p / self.h - DVec3::from_array(self.offset.map(f64::from));
        let held = local.clamp(DVec3::ZERO, DVec3::from_array(last.map(|n| n as f64)));
        let cell = [0, 1, 2].map(|a| (held[a].floor() as usize).min(last[a] - 1));
        let xi = held - DVec3::from_array(cell.map(|i| i as f64));
        let n = palpate_model::cutcells::grid::shape_functions(xi);
        let phi: f64 = cube(cell).iter().zip(n).map(|(c, w)| w * self.values[self.index(*c)]).sum();
        (phi + (local - held).length()) * self.h
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        self.extent
    }

    /// Marching tetrahedra on the lattice's own cells: a closed surface where the body stays inside the lattice. `edge` is not
    /// used: the lattice has no finer detail.
    fn surface(&self, _edge: f64) -> TriMesh {
        let mut mesh = TriMesh::default();
        let mut made: BTreeMap<(usize, usize), u32> = BTreeMap::new();
        for c in self.active_cells() {
            let corners = cube(c);
            for tet in TETRAHEDRA {
                let nodes = tet.map(|i| corners[i]);
                let phi = nodes.map(|n| self.values[self.index(n)]);
                let (inside, outside): (Vec<usize>, Vec<usize>) = (0..4).partition(|i| phi[*i] < 0.0);
                let mut cut = |i: usize, o: usize| -> u32 {
                    let key = (self.index(nodes[i]), self.index(nodes[o]));
                    *made.entry(key).or_insert_with(|| {
                        let t = phi[i] / (phi[i] - phi[o]);
                        mesh.vertices.push(self.position(nodes[i]).lerp(self.position(nodes[o]), t));
                        mesh.vertices.len() as u32 - 1
                    })
                };
                let triangles: Vec<[u32; 3]> = match (&inside[..], &outside[..]) {
                    ([i], [a, b, c]) => vec![[cut(*i, *a), cut(*i, *b), cut(*i, *c)]],
                    ([a, b, c], [o]) => vec![[cut(*a, *o), cut(*b, *o), cut(*c, *o)]],
                    ([i, j], [a, b]) => {
                        let (ia, ib, ja, jb) = (cut(*i, *a), cut(*i, *b), cut(*j, *a), cut(*j, *b));
                        vec![[ia, ib, jb], [ia, jb, ja]]
                    }
                    _ => Vec::new(),
                };
                // Outward = from the inside corners' centre to the outside corners'.
                let centre =
                    |set: &[usize]| set.iter().map(|i| self.position(nodes[*i])).sum::<DVec3>() / set.len().max(1) as f64;
                let out = centre(&outside) - centre(&inside);
                for t in triangles {
                    let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
                    let flipped = (b - a).cross(c - a).dot(out) < 0.0;
                    mesh.triangles.push(if flipped { [t[0], t[2], t[1]] } else { t });
                }
            }
        }
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball of radius 4.3 cells around the lattice's middle, 13³ nodes, as the file holds it.
    fn file(folder: &Path) -> std::path::PathBuf {
        let mut bytes: Vec<u8> = [10i32, -6, -6, -6, 13, 13, 13].iter().flat_map(|w| w.to_le_bytes()).collect();
        for k in -6..=6 {
            for j in -6..=6 {
                for i in -6..=6 {
                    let phi = ((i * i + j * j + k * k) as f32).sqrt() - 4.3;
                    bytes.extend(phi.to_le_bytes());
                }
            }
        }
        let path = folder.join("ball.sdf");
        std::fs::write(&path, bytes).unwrap();
        path
    }

    #[test]
    fn a_ball_on_a_lattice_is_a_closed_shape() {
        let folder = tempfile::tempdir().unwrap();
        let ball = read_sdf(file(folder.path()), 0.1).unwrap();
        let h = 0.01;
        assert!((ball.h - h).abs() < 1e-15);
        let r = 4.3 * h;
        for p in
            [DVec3::new(0.02, 0.01, 0.0), DVec3::new(0.0, -0.043, 0.0), DVec3::new(0.03, 0.03, 0.03), DVec3::new(0.2, 0.0, 0.0)]
        {
            // Trilinear interpolation of a ball's distance errs by about h²/8 · 2/r.
            let error = ball.signed_distance(p) - (p.length() - r);
            assert!(error.abs() < 0.1 * h, "{p}: {error}");
        }
        let (min, max) = ball.bounds();
        // On the axes the distance is linear up to single precision of the file.
        assert!((max - DVec3::splat(r)).length() < 1e-8 && (min + DVec3::splat(r)).length() < 1e-8, "{min} {max}");
        let mesh = ball.surface(h);
        let mut edges: Vec<(u32, u32)> = mesh.triangles.iter().flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]).collect();
        edges.sort_unstable();
        assert!(
            edges.iter().all(|(a, b)| edges.binary_search(&(*b, *a)).is_ok()),
            "every edge has its opposite: closed, oriented"
        );
        let exact = 4.0 / 3.0 * std::f64::consts::PI * r.powi(3);
        // Facets are up to √3 cells long and hang in by up to 3h²/8r: at most 9/8 (h/r)² = 6 % of the volume, never outside.
        let ratio = mesh.volume() / exact;
        assert!(ratio > 0.94 && ratio < 1.0, "{ratio}");
    }

    #[test]
    fn files_of_the_wrong_length_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = file(folder.path());
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
        assert!(read_sdf(&path, 1.0).unwrap_err().to_string().contains("nodes need 8788"));
        std::fs::write(&path, &bytes[..9]).unwrap();
        assert!(read_sdf(&path, 1.0).unwrap_err().to_string().contains("header of 28 bytes"));
        let mut wrong = bytes.clone();
        wrong[16] = 0xff;
        wrong[19] = 0xff;
        std::fs::write(&path, wrong).unwrap();
        assert!(read_sdf(&path, 1.0).unwrap_err().to_string().contains("2 to 4096 nodes"));
    }

    #[test]
    fn small_distances_can_be_snapped_to_the_surface() {
        let folder = tempfile::tempdir().unwrap();
        let grid = read_sdf(file(folder.path()), 1.0).unwrap();
        let snapped = grid.clone().snapped();
        assert!(grid.values.iter().any(|v| v.abs() < 0.1), "the ball tests the rule");
        assert!(snapped.values.iter().all(|v| *v == 0.0 || v.abs() >= 0.1));
        let deep = |c: &[usize; 3]| cube(*c).iter().any(|n| grid.values[grid.index(*n)] <= -0.1);
        let expected: Vec<_> = grid.active_cells().into_iter().filter(deep).collect();
        assert!(snapped.active_cells() == expected && expected.len() < grid.active_cells().len());
    }
}
