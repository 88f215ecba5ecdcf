//! Meshes of quadratic tetrahedra: a block and a ball, both cut into bricks and every brick into six tetrahedra (Kuhn, *IBM J. Res. Dev.* 4,
//! 1960). The edges of neighbouring bricks run the same way, so that their tetrahedra meet face to face.

use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_4;

/// Corners of the six edges, in the order of the nodes 4 to 9 of a tetrahedron.
pub const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];
/// Corners of the four faces, seen from outside against the clock.
const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
/// Half edge of the cube in the middle of a ball, over the radius.
const CORE: f64 = 0.5;
/// How much that cube bulges: 0 is a cube, 1 a ball.
const BULGE: f64 = 0.5;

/// Nodes, tetrahedra and surface.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Places at rest [m].
    pub nodes: Vec<DVec3>,
    /// Four corners, then the middles of [`EDGES`].
    pub tets: Vec<[usize; 10]>,
    /// Three corners, then the middles of the edges 01, 12, 20, of every face that only one tetrahedron has.
    pub faces: Vec<[usize; 6]>,
    /// The tetrahedron of each such face.
    pub owners: Vec<usize>,
}

/// Number of a node in a brick of 3 × 3 × 3 nodes.
fn local(c: [usize; 3]) -> usize {
    c[0] + 3 * c[1] + 9 * c[2]
}

/// Corners of the edge between two corners of a tetrahedron, as number of its middle.
fn middle(a: usize, b: usize) -> usize {
    4 + EDGES.iter().position(|e| *e == [a, b] || *e == [b, a]).unwrap_or(0)
}

impl Mesh {
    /// Cuts bricks of 27 nodes ([`local`]) into tetrahedra.
    fn from_bricks(nodes: Vec<DVec3>, bricks: &[[usize; 27]]) -> Mesh {
        const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        let mut tets = Vec::with_capacity(6 * bricks.len());
        for brick in bricks {
            for order in ORDERS {
                let mut corners = [[0usize; 3]; 4];
                for k in 0..3 {
                    corners[k + 1] = corners[k];
                    corners[k + 1][order[k]] = 2;
                }
                let at = |c: [usize; 3]| nodes[brick[local(c)]];
                let edge = |k: usize| at(corners[k]) - at(corners[0]);
                if edge(1).cross(edge(2)).dot(edge(3)) < 0.0 {
                    corners.swap(1, 2);
                }
                let mut tet = [0; 10];
                (0..4).for_each(|k| tet[k] = brick[local(corners[k])]);
                for (k, [a, b]) in EDGES.iter().enumerate() {
                    tet[4 + k] = brick[local([0, 1, 2].map(|d| (corners[*a][d] + corners[*b][d]) / 2))];
                }
                tets.push(tet);
            }
        }
        let (faces, owners) = surface(&tets);
        Mesh { nodes, tets, faces, owners }
    }

    /// A block, cut into bricks by planes at these coordinates of each axis.
    pub fn block(planes: [&[f64]; 3]) -> Mesh {
        let bricks = planes.map(|p| p.len() - 1);
        let lattice = bricks.map(|n| 2 * n + 1);
        let number = |c: [usize; 3]| c[0] + lattice[0] * (c[1] + lattice[1] * c[2]);
        let at = |d: usize, k: usize| 0.5 * (planes[d][k / 2] + planes[d][k.div_ceil(2)]);
        let nodes = corners_of(lattice).map(|c| DVec3::from([0, 1, 2].map(|d| at(d, c[d])))).collect();
        let brick = |c: [usize; 3]| cells(|o| number([0, 1, 2].map(|d| 2 * c[d] + o[d])));
        let all: Vec<[usize; 27]> = corners_of(bricks).map(brick).collect();
        Mesh::from_bricks(nodes, &all)
    }

    /// A ball: a bulging cube of `core`³ bricks with `layers` layers of bricks on each of its sides. Middles of edges lie on the curved surface.
    pub fn ball(center: DVec3, radius: f64, core: usize, layers: usize) -> Mesh {
        let last = 2 * core;
        // By place on the lattice of the cube, and half layer above it.
        let mut numbers: BTreeMap<([usize; 3], usize), usize> = BTreeMap::new();
        let mut nodes = Vec::new();
        let mut number = |c: [usize; 3], layer: usize| {
            *numbers.entry((c, layer)).or_insert_with(|| {
                let p = DVec3::from(c.map(|x| x as f64 / core as f64 - 1.0));
                let inner = CORE * bulging(p);
                let outer = DVec3::from(p.to_array().map(|x| (FRAC_PI_4 * x).tan())).normalize_or_zero();
                let share = layer as f64 / (2 * layers) as f64;
                nodes.push(center + radius * inner.lerp(outer, share));
                nodes.len() - 1
            })
        };
        let mut bricks = Vec::new();
        for c in corners_of([core; 3]) {
            bricks.push(cells(|o| number([0, 1, 2].map(|d| 2 * c[d] + o[d]), 0)));
        }
        for (axis, end) in (0..3).flat_map(|a| [(a, 0), (a, last)]) {
            // The first axis of these bricks runs outwards on all sides: shared faces are cut the same way.
            for c in corners_of([layers, core, core]) {
                bricks.push(cells(|o| {
                    let mut place = [end; 3];
                    place[(axis + 1) % 3] = 2 * c[1] + o[1];
                    place[(axis + 2) % 3] = 2 * c[2] + o[2];
                    number(place, 2 * c[0] + o[0])
                }));
            }
        }
        Mesh::from_bricks(nodes, &bricks)
    }

    /// The point of the surface next to `p`: its face and the barycentric coordinates there. Faces must be flat.
    pub fn nearest(&self, p: DVec3) -> (usize, [f64; 3]) {
        let mut best = (f64::INFINITY, 0, [1.0, 0.0, 0.0]);
        for (f, nodes) in self.faces.iter().enumerate() {
            let [a, b, c] = [0, 1, 2].map(|k| self.nodes[nodes[k]]);
            let normal = (b - a).cross(c - a);
            let share = |q: DVec3, r: DVec3| (q - p).cross(r - p).dot(normal) / normal.length_squared();
            let clipped = [share(b, c), share(c, a), share(a, b)].map(|l| l.max(0.0));
            let l = clipped.map(|x| x / clipped.iter().sum::<f64>());
            let off = (l[0] * a + l[1] * b + l[2] * c).distance(p);
            if off < best.0 {
                best = (off, f, l);
            }
        }
        (best.1, best.2)
    }
}

/// Numbers of bricks along three axes, one after another.
fn corners_of(bricks: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    let [x, y, z] = bricks;
    (0..z).flat_map(move |k| (0..y).flat_map(move |j| (0..x).map(move |i| [i, j, k])))
}

/// The nodes of a brick by their offsets in it.
fn cells(mut node: impl FnMut([usize; 3]) -> usize) -> [usize; 27] {
    std::array::from_fn(|k| node([k % 3, k / 3 % 3, k / 9]))
}

/// A cube [−1, 1]³ on its way to a ball: with `BULGE` = 1 this is the map of a cube to a ball, x √(1 − y²/2 − z²/2 + y²z²/3).
fn bulging(p: DVec3) -> DVec3 {
    let s = p * p * BULGE;
    let one = |x: f64, a: f64, b: f64| x * (1.0 - 0.5 * (a + b) + a * b / 3.0).sqrt();
    DVec3::new(one(p.x, s.y, s.z), one(p.y, s.z, s.x), one(p.z, s.x, s.y))
}

/// Faces that only one tetrahedron has, and whose they are.
fn surface(tets: &[[usize; 10]]) -> (Vec<[usize; 6]>, Vec<usize>) {
    let mut seen: BTreeMap<[usize; 3], Option<([usize; 6], usize)>> = BTreeMap::new();
    for (t, tet) in tets.iter().enumerate() {
        for [a, b, c] in FACES {
            let mut key = [tet[a], tet[b], tet[c]];
            key.sort_unstable();
            let face = [a, b, c, middle(a, b), middle(b, c), middle(c, a)].map(|k| tet[k]);
            seen.entry(key).and_modify(|f| *f = None).or_insert(Some((face, t)));
        }
    }
    seen.into_values().flatten().unzip()
}
