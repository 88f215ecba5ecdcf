//! Walks the tetrahedra of a cell and hands the part inside and the surface to a sink.

use glam::DVec3;

/// A signed distance on a lattice of cells of edge `h`, each divided into `subdivisions`³ sub-cubes.
pub struct Lattice<'a> {
    /// Signed distance [m] at a world point.
    pub distance: &'a (dyn Fn(DVec3) -> f64 + Sync),
    /// Edge of a cell [m].
    pub h: f64,
    /// Sub-cubes per axis; even, so that octants are made of whole sub-cubes.
    pub subdivisions: usize,
}

impl Lattice<'_> {
    /// Distance at sub-lattice point `g` (in sub-steps from the world's origin). Values within 1e-9 h of zero count as zero: a face
    /// on a lattice plane then leaves no slivers. Same point, same bits, whichever cell asks.
    fn value(&self, g: [i64; 3]) -> f64 {
        let step = self.h / self.subdivisions as f64;
        let d = (self.distance)(DVec3::new(g[0] as f64, g[1] as f64, g[2] as f64) * step);
        if d.abs() < 1e-9 * self.h { 0.0 } else { d }
    }

    /// True if a tetrahedron with all corners on the surface is inside (a box's edge, a sheet as thin as a sub-cube).
    fn flat_inside(&self, v: [[i64; 3]; 4]) -> bool {
        let step = self.h / self.subdivisions as f64;
        let sum = v.iter().fold(DVec3::ZERO, |s, g| s + DVec3::new(g[0] as f64, g[1] as f64, g[2] as f64));
        (self.distance)(sum * (0.25 * step)) < -1e-9 * self.h
    }
}

/// Receives the pieces of a cell, in coordinates ξ ∈ [0, 1]³ of that cell.
pub trait Sink {
    /// A sub-cube inside.
    fn cube(&mut self, lo: DVec3, hi: DVec3);
    /// A tetrahedron inside, in any orientation (may be degenerate).
    fn tetra(&mut self, v: [DVec3; 4]);
    /// A piece of surface, counter-clockwise seen from outside, in an octant of the cell.
    fn triangle(&mut self, _v: [DVec3; 3], _octant: usize) {}
}

/// Orders of the axes in which the six Kuhn tetrahedra walk from corner (0,0,0) to (1,1,1) of a cube.
const PATHS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// Splits a cube into its six Kuhn tetrahedra.
pub fn kuhn(lo: DVec3, hi: DVec3) -> [[DVec3; 4]; 6] {
    PATHS.map(|path| {
        let mut v = [lo; 4];
        for k in 0..3 {
            v[k + 1] = v[k];
            v[k + 1][path[k]] = hi[path[k]];
        }
        v
    })
}

/// Sub-cubes with a sharp edge in them are divided once more by this along each axis.
const REFINE: usize = 4;

/// A sub-cube holds a sharp edge if the mean gradient of the distance in it is shorter than this. A smooth surface of radius r has
/// 1 − (step/r)²/8 or more: it takes a radius below two sub-steps to be mistaken for an edge, at no harm but time.
const SHARP: f64 = 0.97;

/// Hands every piece of the cell whose lowest node is `cell` (world lattice coordinates) to the sink.
pub fn walk(lattice: &Lattice, cell: [i64; 3], sink: &mut impl Sink) {
    let s = lattice.subdivisions;
    let block = Block { lattice, cell, low: [0; 3], count: s };
    let values = block.values();
    if values.iter().all(|&v| v < 0.0) {
        return sink.cube(DVec3::ZERO, DVec3::ONE);
    }
    // A corner of the body may poke in between the points.
    let step = lattice.h / s as f64;
    if values.iter().all(|&v| v > step) {
        return;
    }
    block.walk(&values, true, sink);
}

/// Some sub-cubes of a cell: `count`³ from sub-lattice place `low`, counted from the cell's lowest corner.
struct Block<'a> {
    lattice: &'a Lattice<'a>,
    cell: [i64; 3],
    low: [i64; 3],
    count: usize,
}

impl Block<'_> {
    /// Place on the world's sub-lattice of a place in the block.
    fn global(&self, l: [i64; 3]) -> [i64; 3] {
        std::array::from_fn(|a| self.cell[a] * self.lattice.subdivisions as i64 + self.low[a] + l[a])
    }

    /// Local coordinates in the cell of a place in the block.
    fn local(&self, l: [i64; 3]) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|a| (self.low[a] + l[a]) as f64 / self.lattice.subdivisions as f64))
    }

    fn values(&self) -> Vec<f64> {
        let n = self.count + 1;
        let place = |i: usize| [(i % n) as i64, (i / n % n) as i64, (i / (n * n)) as i64];
        (0..n * n * n).map(|i| self.lattice.value(self.global(place(i)))).collect()
    }

    fn walk(&self, values: &[f64], refine: bool, sink: &mut impl Sink) {
        let (s, n) = (self.count, self.count + 1);
        let step = self.lattice.h / self.lattice.subdivisions as f64;
        // Points beyond the block are asked for only where a face lies on the surface.
        let at = |l: [i64; 3]| {
            if l.iter().all(|&c| c >= 0 && c < n as i64) {
                values[l[0] as usize + n * (l[1] as usize + n * l[2] as usize)]
            } else {
                self.lattice.value(self.global(l))
            }
        };
        for c in 0..s * s * s {
            let lo = [(c % s) as i64, (c / s % s) as i64, (c / (s * s)) as i64];
            let hi = lo.map(|x| x + 1);
            let corner: [f64; 8] =
                std::array::from_fn(|i| at([lo[0] + (i & 1) as i64, lo[1] + (i >> 1 & 1) as i64, lo[2] + (i >> 2) as i64]));
            if corner.iter().all(|&v| v < 0.0) && (!refine || corner.iter().all(|&v| v < -step)) {
                sink.cube(self.local(lo), self.local(hi));
                continue;
            }
            if refine && corner.iter().any(|v| v.abs() < step) && mean_slope(&corner) < SHARP * step {
                let lattice = Lattice { subdivisions: self.lattice.subdivisions * REFINE, ..*self.lattice };
                let low = std::array::from_fn(|a| (self.low[a] + lo[a]) * REFINE as i64);
                let block = Block { lattice: &lattice, cell: self.cell, low, count: REFINE };
                block.walk(&block.values(), false, sink);
                continue;
            }
            if corner.iter().all(|&v| v < 0.0) {
                sink.cube(self.local(lo), self.local(hi));
                continue;
            }
            if corner.iter().all(|&v| v >= 0.0) && corner.iter().filter(|&&v| v > 0.0).count() > 4 {
                continue;
            }
            let middle = 0.5 * (self.local(lo) + self.local(hi));
            let octant = (0..3).map(|a| if middle[a] > 0.5 { 1 << a } else { 0 }).sum();
            self.sub_cube(lo, &at, octant, sink);
        }
    }

    /// The six tetrahedra of one sub-cube.
    fn sub_cube(&self, lo: [i64; 3], at: &impl Fn([i64; 3]) -> f64, octant: usize, sink: &mut impl Sink) {
        let global = |l| self.global(l);
        for path in PATHS {
            let mut v = [lo; 4];
            for k in 0..3 {
                v[k + 1] = v[k];
                v[k + 1][path[k]] += 1;
            }
            let phi = v.map(at);
            let x = v.map(|l| self.local(l));
            if phi.iter().any(|&f| f > 0.0) {
                if phi.iter().any(|&f| f < 0.0) {
                    cut_tetra(x, phi, sink, octant);
                }
                continue;
            }
            if phi.iter().all(|&f| f == 0.0) && !self.lattice.flat_inside(v.map(global)) {
                continue;
            }
            sink.tetra(x);
            for k in 0..4 {
                if (0..4).all(|m| m == k || phi[m] == 0.0) && !neighbour_inside(self.lattice, at, &global, v, k) {
                    let f: [DVec3; 3] = std::array::from_fn(|m| x[(k + 1 + m) % 4]);
                    outward(f, (f[0] + f[1] + f[2]) / 3.0 - x[k], sink, octant);
                }
            }
        }
    }
}

/// Length of the mean gradient over a cube, times its edge.
fn mean_slope(corner: &[f64; 8]) -> f64 {
    let slope = |bit: usize| (0..8).map(|i| if i & bit == 0 { -corner[i] } else { corner[i] }).sum::<f64>() / 4.0;
    DVec3::new(slope(1), slope(2), slope(4)).length()
}

/// True if the tetrahedron across the face opposite to corner `k` is inside; the face's corners all lie on the surface.
fn neighbour_inside(
    lattice: &Lattice,
    at: &impl Fn([i64; 3]) -> f64,
    global: &impl Fn([i64; 3]) -> [i64; 3],
    mut v: [[i64; 3]; 4],
    k: usize,
) -> bool {
    // Pivot rule of the Freudenthal (Kuhn) triangulation: the neighbour's apex mirrors the corner along the path.
    let (before, after) = (v[(k + 3) % 4], v[(k + 1) % 4]);
    v[k] = match k {
        0 => std::array::from_fn(|a| v[3][a] + v[1][a] - v[0][a]),
        3 => std::array::from_fn(|a| v[0][a] - (v[3][a] - v[2][a])),
        _ => std::array::from_fn(|a| before[a] + after[a] - v[k][a]),
    };
    let apex = at(v[k]);
    apex < 0.0 || apex == 0.0 && lattice.flat_inside(v.map(global))
}

/// A tetrahedron with linear φ of both signs.
fn cut_tetra(v: [DVec3; 4], phi: [f64; 4], sink: &mut impl Sink, octant: usize) {
    let mut polygon = [DVec3::ZERO; 4];
    let n = below(v, phi, &mut |t| sink.tetra(t), &mut polygon);
    let mean = |keep: fn(f64) -> bool| {
        let (s, n) = (0..4).filter(|&i| keep(phi[i])).fold((DVec3::ZERO, 0.0), |(s, n), i| (s + v[i], n + 1.0));
        s / n
    };
    let out = mean(|f| f > 0.0) - mean(|f| f < 0.0);
    for k in 2..n {
        outward([polygon[0], polygon[k - 1], polygon[k]], out, sink, octant);
    }
}

fn outward([a, b, c]: [DVec3; 3], out: DVec3, sink: &mut impl Sink, octant: usize) {
    let turned = (b - a).cross(c - a).dot(out) < 0.0;
    sink.triangle(if turned { [a, c, b] } else { [a, b, c] }, octant);
}

/// Splits the part of a tetrahedron with linear `phi` ≤ 0 into tetrahedra; writes the corners of the cut, in order round it, and
/// returns their number (0, 3 or 4).
pub fn below(v: [DVec3; 4], phi: [f64; 4], emit: &mut impl FnMut([DVec3; 4]), polygon: &mut [DVec3; 4]) -> usize {
    let mut order = [0, 1, 2, 3];
    order.sort_by_key(|&i| phi[i] > 0.0);
    let inside = phi.iter().filter(|&&f| f <= 0.0).count();
    let v = order.map(|i| v[i]);
    let f = order.map(|i| phi[i]);
    let cross = |a: usize, b: usize| v[a] + (v[b] - v[a]) * (f[a] / (f[a] - f[b]));
    let mut wedge = |p: [DVec3; 3], q: [DVec3; 3]| {
        emit([p[0], p[1], p[2], q[0]]);
        emit([p[1], p[2], q[0], q[1]]);
        emit([p[2], q[0], q[1], q[2]]);
    };
    match inside {
        0 => 0,
        1 => {
            let c = [cross(0, 1), cross(0, 2), cross(0, 3)];
            emit([v[0], c[0], c[1], c[2]]);
            polygon[..3].copy_from_slice(&c);
            3
        }
        2 => {
            let (p, q) = ([v[0], cross(0, 2), cross(0, 3)], [v[1], cross(1, 2), cross(1, 3)]);
            wedge(p, q);
            *polygon = [p[1], p[2], q[2], q[1]];
            4
        }
        3 => {
            let c = [cross(0, 3), cross(1, 3), cross(2, 3)];
            wedge([v[0], v[1], v[2]], c);
            polygon[..3].copy_from_slice(&c);
            3
        }
        _ => {
            emit(v);
            0
        }
    }
}
