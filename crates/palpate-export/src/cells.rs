//! MuJoCo's quadratic cells: a lattice of nodes around the mesh, three along each side of a cell, and what of the mesh's mass each has.
//!
//! MuJoCo integrates a flex's elasticity over the parts of tetrahedra inside each cell, so cells are cut like palpate's, and bending is as good as
//! quadratic elements are.

use crate::specimen::Specimen;
use glam::{DMat3, DVec3, IVec3};
use palpate_model::cutcells::cut::ClipBox;

/// Side of a cell over the edge of the cube that six mean tetrahedra fill, which of a stuffed lattice is 0.79 of its edge: so cells are twice as long
/// as palpate's own, and bend as well with their quadratic functions.
const COARSER: f64 = 2.5;

/// The lattice. Nodes are numbered with z fastest, as MuJoCo counts them.
pub struct Cells {
    /// Cells along each axis.
    pub count: IVec3,
    low: DVec3,
    /// Sides of a cell [m].
    side: DVec3,
    /// Mass of every node [kg]; zero where no part of the body reaches it.
    pub masses: Vec<f64>,
}

/// Faces of a clamp across an axis [m], where they lie across it.
fn faces(region: &ClipBox, axis: usize) -> Vec<f64> {
    let straight = region.to_frame.matrix3.abs_diff_eq(DMat3::IDENTITY, 1e-12);
    let away = region.to_frame.translation[axis];
    if straight { vec![region.min[axis] - away, region.max[axis] - away] } else { Vec::new() }
}

/// How far a face may lie from the nearest face of cells, over their side, before other cells are looked for.
const MET: f64 = 0.02;

/// The number of cells, from three quarters of `wanted` to twice as many and as near to it as may be, whose faces meet places at these shares of the
/// way; where none does, the one that comes closest. A place amid a cell would be held, but bend the part of the cell before it.
fn meeting(shares: &[f64], wanted: f64) -> f64 {
    let miss = |count: f64| shares.iter().map(|t| (count * t - (count * t).round()).abs()).fold(0.0, f64::max);
    let least = (0.75 * wanted).ceil();
    let mut all: Vec<f64> = (0..=(2.0 * wanted - least) as usize).map(|k| least + k as f64).collect();
    all.sort_by(|a, b| (a - wanted).abs().total_cmp(&(b - wanted).abs()));
    let first = all.iter().copied().find(|count| miss(*count) < MET);
    first.or_else(|| all.into_iter().min_by(|a, b| miss(*a).total_cmp(&miss(*b)))).unwrap_or(wanted)
}

/// Lagrange's quadratic functions on [0, 1] at 0, ½ and 1.
fn quadratic(t: f64) -> [f64; 3] {
    [(1.0 - t) * (1.0 - 2.0 * t), 4.0 * t * (1.0 - t), t * (2.0 * t - 1.0)]
}

impl Cells {
    /// Cells around a specimen's mesh, whose tetrahedra have edges about so long [m]; as many along each axis as bring faces of cells to
    /// those of clamps.
    pub fn new(s: &Specimen, edge: f64) -> Cells {
        let (low, high) = s.mesh.bounds();
        let least = ((high - low) / (COARSER * edge)).round().max(DVec3::ONE);
        let count = DVec3::from_array(std::array::from_fn(|axis| {
            let faces: Vec<f64> = s.held.iter().flat_map(|h| faces(&h.region, axis)).collect();
            let span = high[axis] - low[axis];
            let inside = faces.iter().map(|x| (x - low[axis]) / span).filter(|t| *t > 0.0 && *t < 1.0);
            let shares: Vec<f64> = inside.collect();
            meeting(&shares, least[axis])
        }));
        let mut cells = Cells { count: count.as_ivec3(), low, side: (high - low) / count, masses: Vec::new() };
        cells.masses = cells.lumped(s);
        cells
    }

    /// Nodes along each axis.
    pub fn size(&self) -> IVec3 {
        2 * self.count + 1
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        let n = self.size();
        n.x as usize * n.y as usize * n.z as usize
    }

    fn number(&self, p: IVec3) -> usize {
        let n = self.size();
        (p.z + n.z * (p.y + n.y * p.x)) as usize
    }

    /// Place of a node [m].
    pub fn place(&self, node: usize) -> DVec3 {
        let n = self.size();
        let node = node as i32;
        let p = IVec3::new(node / (n.y * n.z), node / n.z % n.y, node % n.z);
        self.low + 0.5 * self.side * p.as_dvec3()
    }

    /// Largest side of a cell [m].
    pub fn largest(&self) -> f64 {
        self.side.max_element()
    }

    /// The cell that holds a place, and where in it, from 0 to 1.
    fn cell(&self, x: DVec3) -> (IVec3, DVec3) {
        let t = (x - self.low) / self.side;
        let cell = t.floor().as_ivec3().clamp(IVec3::ZERO, self.count - 1);
        (cell, t - cell.as_dvec3())
    }

    /// Masses of nodes: a cell's is shared out by the diagonal of its mass matrix (Hinton, Rock & Zienkiewicz 1976), so that all are positive.
    /// Point masses go to the node that is nearest among those that have some.
    fn lumped(&self, s: &Specimen) -> Vec<f64> {
        let of_cell = |c: IVec3| (c.z + self.count.z * (c.y + self.count.y * c.x)) as usize;
        let cells = (self.count.x * self.count.y * self.count.z) as usize;
        let (mut mass, mut diagonal) = (vec![0.0; cells], vec![[0.0f64; 27]; cells]);
        for e in 0..s.mesh.tets.len() {
            let corners = s.mesh.places(e);
            let share = s.density(e) * s.mesh.volume_of(e) / f64::from(PIECES);
            for x in pieces(corners) {
                let (cell, t) = self.cell(x);
                let k = of_cell(cell);
                let [a, b, c] = [quadratic(t.x), quadratic(t.y), quadratic(t.z)];
                mass[k] += share;
                for (i, d) in diagonal[k].iter_mut().enumerate() {
                    *d += share * (a[i / 9] * b[i / 3 % 3] * c[i % 3]).powi(2);
                }
            }
        }
        let mut masses = vec![0.0; self.len()];
        for k in (0..cells).filter(|k| mass[*k] > 0.0) {
            let (y, z) = (self.count.y as usize, self.count.z as usize);
            let first = 2 * IVec3::new((k / (y * z)) as i32, (k / z % y) as i32, (k % z) as i32);
            let whole: f64 = diagonal[k].iter().sum();
            for (i, d) in diagonal[k].iter().enumerate() {
                let node = self.number(first + IVec3::new((i / 9) as i32, (i / 3 % 3) as i32, (i % 3) as i32));
                masses[node] += mass[k] * d / whole;
            }
        }
        for m in &s.masses {
            let near = (0..masses.len()).filter(|n| masses[*n] > 0.0);
            let far = |n: &usize| self.place(*n).distance_squared(m.point);
            if let Some(node) = near.min_by(|a, b| far(a).total_cmp(&far(b))) {
                masses[node] += m.mass;
            }
        }
        masses
    }
}

/// Points that stand for a tetrahedron.
const PIECES: u32 = 32;

/// Points of a tetrahedron that stand for equal parts of it: the four of the rule of second degree (Hammer, Marlowe & Stroud 1956) in each of the
/// eight parts of Bey's refinement, so that functions of higher degree and the edges of cells within it are met.
fn pieces(x: [DVec3; 4]) -> impl Iterator<Item = DVec3> {
    const POINT: [f64; 2] = [0.585_410_196_624_968_5, 0.138_196_601_125_010_5];
    let m = |i: usize, j: usize| 0.5 * (x[i] + x[j]);
    let [ab, ac, ad, bc, bd, cd] = [m(0, 1), m(0, 2), m(0, 3), m(1, 2), m(1, 3), m(2, 3)];
    let parts = [
        [x[0], ab, ac, ad],
        [ab, x[1], bc, bd],
        [ac, bc, x[2], cd],
        [ad, bd, cd, x[3]],
        [ab, ac, ad, bd],
        [ab, ac, bc, bd],
        [ac, ad, bd, cd],
        [ac, bc, bd, cd],
    ];
    parts.into_iter().flat_map(|p| (0..4).map(move |k| (0..4).map(|i| p[i] * POINT[usize::from(i != k)]).sum()))
}
