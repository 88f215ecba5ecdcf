//! What is wrong with a triangle mesh, and what of it can be put right without guessing.

use super::components::components;
use super::{MeshShape, TriMesh};
use glam::DVec3;
use std::collections::BTreeMap;

/// Holes with more edges than this are not closed: their shape is anybody's guess.
const HOLE_EDGES: usize = 64;

/// Holes with a rim longer than this share of the mesh's size are not closed.
const HOLE_RIM: f64 = 0.25;

/// Distance at which a segment touches a triangle, over their size: rounding of coordinates in f64.
const TOUCHING: f64 = 1e-9;

/// Facts about a mesh; a closed, consistently and outward oriented surface has zeros but for volume, components and size.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshReport {
    /// Edges with one triangle.
    pub open_edges: usize,
    /// Edges with more than two triangles.
    pub non_manifold_edges: usize,
    /// Edges whose two triangles run along them in the same direction (one of them is flipped).
    pub inconsistent_edges: usize,
    /// Volume [m³] by the divergence theorem; negative = inside out.
    pub signed_volume: f64,
    /// Pairs of triangles without common vertex that touch or pierce each other.
    pub intersecting_pairs: usize,
    /// Parts not joined by common vertices.
    pub components: usize,
    /// Triangles without area.
    pub degenerate_triangles: usize,
    /// Length of the bounding box's diagonal [m].
    pub size: f64,
    /// Rims of the holes: number of edges and length [m], longest first.
    pub holes: Vec<(usize, f64)>,
}

impl MeshReport {
    /// True if every edge joins two triangles.
    pub fn is_closed(&self) -> bool {
        self.open_edges == 0 && self.non_manifold_edges == 0
    }
}

/// Triangles at every undirected edge, with the direction (true = from smaller to larger vertex) each runs along it.
fn edge_uses(mesh: &TriMesh) -> BTreeMap<[u32; 2], Vec<(usize, bool)>> {
    let mut uses: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for (t, &[a, b, c]) in mesh.triangles.iter().enumerate() {
        for [p, q] in [[a, b], [b, c], [c, a]] {
            uses.entry([p.min(q), p.max(q)]).or_default().push((t, p < q));
        }
    }
    uses
}

/// Examines a mesh.
pub fn diagnose(mesh: &TriMesh) -> MeshReport {
    let uses = edge_uses(mesh);
    let count = |f: fn(&[(usize, bool)]) -> bool| uses.values().filter(|u| f(u)).count();
    let mut holes: Vec<(usize, f64)> = rims(mesh, &uses).iter().map(|r| (r.len(), rim_length(mesh, r))).collect();
    holes.sort_by(|a, b| b.1.total_cmp(&a.1));
    MeshReport {
        open_edges: count(|u| u.len() == 1),
        non_manifold_edges: count(|u| u.len() > 2),
        inconsistent_edges: count(|u| u.len() == 2 && u[0].1 == u[1].1),
        signed_volume: mesh.volume(),
        intersecting_pairs: intersecting_pairs(mesh),
        components: components(&mesh.triangles, mesh.vertices.len()).1,
        degenerate_triangles: (0..mesh.triangles.len()).filter(|&t| is_degenerate(mesh, t)).count(),
        size: mesh.size(),
        holes,
    }
}

fn is_degenerate(mesh: &TriMesh, t: usize) -> bool {
    let [a, b, c] = mesh.corners(t);
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    // Height below 1e-9 of the length: the normal is rounding.
    super::trimesh::triangle_area([a, b, c]) <= 0.5e-9 * longest * longest
}

/// Pairs of triangles of which an edge of one meets the other.
fn intersecting_pairs(mesh: &TriMesh) -> usize {
    let tree = MeshShape::unsigned(mesh.clone());
    let mut pairs = Vec::new();
    for (t, &v) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh.corners(t);
        for [p, q] in [[a, b], [b, c], [c, a]] {
            tree.overlapping(p.min(q), p.max(q), &mut |s| {
                if mesh.triangles[s].iter().all(|w| !v.contains(w)) && meets(p, q, mesh.corners(s)) {
                    pairs.push((t.min(s), t.max(s)));
                }
            });
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs.len()
}

/// True if the segment meets the triangle, its edges and its plane included: bodies that overlap by whole faces, or by corners that
/// lie on the diagonal of a face, pierce nothing strictly.
fn meets(p: DVec3, q: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let normal = (b - a).cross(c - a);
    let size = normal.length();
    if size == 0.0 {
        return false;
    }
    let near = TOUCHING * (q - p).length().max((b - a).length()).max((c - a).length());
    let (above, below) = (normal.dot(p - a) / size, normal.dot(q - a) / size);
    let inside = |x: DVec3| {
        [(a, b), (b, c), (c, a)].iter().all(|&(s, e)| (e - s).cross(x - s).dot(normal) >= -near * size * (e - s).length())
    };
    if above.abs() > near || below.abs() > near {
        // A segment that only ends in the plane meets it as well.
        return above.min(below) <= near
            && above.max(below) >= -near
            && inside(p + (q - p) * (above / (above - below)).clamp(0.0, 1.0));
    }
    // In the plane of the triangle: an end inside, or an edge crossed.
    let crosses = |&(s, e): &(DVec3, DVec3)| {
        let side = |x: DVec3, from: DVec3, to: DVec3| (to - from).cross(x - from).dot(normal);
        side(p, s, e) * side(q, s, e) < 0.0 && side(s, p, q) * side(e, p, q) < 0.0
    };
    inside(p) || inside(q) || [(a, b), (b, c), (c, a)].iter().any(crosses)
}

/// Closed loops of open edges, walked so that the triangle of each edge lies on its right (a filling has it on its left).
fn rims(mesh: &TriMesh, uses: &BTreeMap<[u32; 2], Vec<(usize, bool)>>) -> Vec<Vec<u32>> {
    let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (&[a, b], u) in uses.iter().filter(|(_, u)| u.len() == 1) {
        let (from, to) = if u[0].1 { (b, a) } else { (a, b) };
        next.entry(from).or_default().push(to);
    }
    let mut loops = Vec::new();
    while let Some((&start, _)) = next.iter().find(|(_, to)| !to.is_empty()) {
        let mut rim = vec![start];
        while let Some(to) = next.get_mut(&rim[rim.len() - 1]).and_then(Vec::pop) {
            // A vertex met again closes a loop (two holes may touch in it).
            if let Some(i) = rim.iter().position(|&v| v == to) {
                loops.push(rim.split_off(i));
                if i > 0 {
                    rim.push(to);
                    continue;
                }
                break;
            }
            rim.push(to);
        }
    }
    loops.retain(|l| l.len() > 2 && l.iter().all(|&v| (v as usize) < mesh.vertices.len()));
    loops
}

fn rim_length(mesh: &TriMesh, rim: &[u32]) -> f64 {
    let at = |i: usize| mesh.vertices[rim[i % rim.len()] as usize];
    (0..rim.len()).map(|i| at(i).distance(at(i + 1))).sum()
}

/// What [`repair`] made of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Repaired {
    /// The mesh.
    pub mesh: TriMesh,
    /// What was done, in words and numbers.
    pub done: Vec<String>,
    /// Edges with one triangle before holes were closed.
    pub open_edges: usize,
}

/// Puts right what needs no guessing: joins equal vertices, drops collapsed and doubled triangles, turns triangles to agree with their
/// neighbours and outward, closes small holes. Larger holes are left to the caller to refuse.
pub fn repair(mesh: &TriMesh) -> Repaired {
    let mut done = Vec::new();
    let mut say = |n: usize, what: &str| {
        if n > 0 {
            done.push(format!("{what}: {n}"));
        }
    };
    let (mut mesh, joined) = join_vertices(mesh);
    say(joined, "joined vertices at the same place");
    let before = mesh.triangles.len();
    mesh.triangles.retain(|&[a, b, c]| a != b && b != c && c != a);
    say(before - mesh.triangles.len(), "dropped triangles collapsed to a line or point");
    let before = mesh.triangles.len();
    let mut seen = std::collections::BTreeSet::new();
    mesh.triangles.retain(|t| {
        let mut key = *t;
        key.sort_unstable();
        seen.insert(key)
    });
    say(before - mesh.triangles.len(), "dropped triangles that occur twice");
    say(orient(&mut mesh), "turned triangles to agree with their neighbours");
    say(turn_outward(&mut mesh), "turned inside-out parts outward, triangles");
    let open_edges = edge_uses(&mesh).values().filter(|u| u.len() == 1).count();
    let holes = close_holes(&mut mesh);
    say(holes, "closed small holes");
    Repaired { mesh: drop_unused(mesh), done, open_edges }
}

/// Joins vertices closer than f32 can tell apart.
fn join_vertices(mesh: &TriMesh) -> (TriMesh, usize) {
    let largest = mesh.vertices.iter().map(|v| v.abs().max_element()).fold(mesh.size(), f64::max);
    let tolerance = 1e-7 * largest;
    let key = |p: DVec3| (p / (2.0 * tolerance).max(f64::MIN_POSITIVE)).floor().to_array().map(|x| x as i64);
    let mut grid: BTreeMap<[i64; 3], Vec<u32>> = BTreeMap::new();
    let mut vertices: Vec<DVec3> = Vec::new();
    let mut number = Vec::with_capacity(mesh.vertices.len());
    for &p in &mesh.vertices {
        let [x, y, z] = key(p);
        let near = (0..27).find_map(|o| {
            let cell = [x + o % 3 - 1, y + o / 3 % 3 - 1, z + o / 9 - 1];
            grid.get(&cell)?.iter().copied().find(|&v| vertices[v as usize].distance(p) <= tolerance)
        });
        number.push(near.unwrap_or_else(|| {
            grid.entry([x, y, z]).or_default().push(vertices.len() as u32);
            vertices.push(p);
            vertices.len() as u32 - 1
        }));
    }
    let joined = mesh.vertices.len() - vertices.len();
    let triangles = mesh.triangles.iter().map(|t| t.map(|v| number[v as usize])).collect();
    (TriMesh { vertices, triangles }, joined)
}

/// Walks over edges of two triangles and turns those that disagree; of each connected patch the minority is turned.
fn orient(mesh: &mut TriMesh) -> usize {
    let uses = edge_uses(mesh);
    let mut neighbours: Vec<Vec<(usize, bool)>> = vec![Vec::new(); mesh.triangles.len()];
    for u in uses.values().filter(|u| u.len() == 2 && u[0].0 != u[1].0) {
        let agree = u[0].1 != u[1].1;
        neighbours[u[0].0].push((u[1].0, agree));
        neighbours[u[1].0].push((u[0].0, agree));
    }
    let mut flip: Vec<Option<bool>> = vec![None; mesh.triangles.len()];
    let mut turned = 0;
    for start in 0..mesh.triangles.len() {
        if flip[start].is_some() {
            continue;
        }
        flip[start] = Some(false);
        let mut part = vec![(start, false)];
        let mut i = 0;
        while i < part.len() {
            let (t, f) = part[i];
            for &(s, agree) in &neighbours[t] {
                if flip[s].is_none() {
                    // A neighbour that agrees needs the same treatment, one that disagrees the other.
                    let g = f == agree;
                    flip[s] = Some(g);
                    part.push((s, g));
                }
            }
            i += 1;
        }
        let count = part.iter().filter(|(_, f)| *f).count();
        let minority = 2 * count <= part.len();
        for (t, _) in part.iter().filter(|(_, f)| *f == minority) {
            mesh.triangles[*t].swap(1, 2);
            turned += 1;
        }
    }
    turned
}

/// Turns parts with negative volume, unless they lie inside another part (a cavity).
fn turn_outward(mesh: &mut TriMesh) -> usize {
    let (of, count) = components(&mesh.triangles, mesh.vertices.len());
    let part = |mesh: &TriMesh, keep: &dyn Fn(usize) -> bool| TriMesh {
        vertices: mesh.vertices.clone(),
        triangles: (0..of.len()).filter(|&t| keep(of[t])).map(|t| mesh.triangles[t]).collect(),
    };
    let mut turned = 0;
    // Parts that are not cavities first face outward by themselves; a part counts as enclosed by the absolute winding of the others.
    for c in 0..count {
        let own = part(mesh, &|n| n == c);
        // About the part's own middle, so that an open part is judged by its bulge and not by its place.
        let middle = {
            let (lo, hi) = own.bounds();
            0.5 * (lo + hi)
        };
        let centred = TriMesh { vertices: own.vertices.iter().map(|&p| p - middle).collect(), triangles: own.triangles };
        let six: f64 = (0..centred.triangles.len())
            .map(|t| {
                let [a, b, d] = centred.corners(t);
                a.dot(b.cross(d))
            })
            .sum();
        if six >= 0.0 {
            continue;
        }
        let enclosed = count > 1 && {
            let others = MeshShape::unsigned(part(mesh, &|n| n != c));
            let first = of.iter().position(|&n| n == c).map(|t| mesh.corners(t)[0]);
            first.is_some_and(|p| others.winding_number(p).abs() > 0.5)
        };
        if !enclosed {
            for t in (0..of.len()).filter(|&t| of[t] == c) {
                mesh.triangles[t].swap(1, 2);
                turned += 1;
            }
        }
    }
    turned
}

/// Closes holes with few edges and a short rim by a fan around the rim's middle.
fn close_holes(mesh: &mut TriMesh) -> usize {
    let size = mesh.size();
    let mut closed = 0;
    for rim in rims(mesh, &edge_uses(mesh)) {
        if rim.len() > HOLE_EDGES || rim_length(mesh, &rim) > HOLE_RIM * size {
            continue;
        }
        closed += 1;
        if let [a, b, c] = rim[..] {
            mesh.triangles.push([a, b, c]);
            continue;
        }
        let middle = rim.iter().map(|&v| mesh.vertices[v as usize]).sum::<DVec3>() / rim.len() as f64;
        let m = mesh.vertices.len() as u32;
        mesh.vertices.push(middle);
        mesh.triangles.extend((0..rim.len()).map(|i| [rim[i], rim[(i + 1) % rim.len()], m]));
    }
    closed
}

fn drop_unused(mesh: TriMesh) -> TriMesh {
    let mut number = vec![u32::MAX; mesh.vertices.len()];
    mesh.triangles.iter().flatten().for_each(|&v| number[v as usize] = 0);
    let mut vertices = Vec::new();
    for (v, n) in number.iter_mut().enumerate().filter(|(_, n)| **n == 0) {
        *n = vertices.len() as u32;
        vertices.push(mesh.vertices[v]);
    }
    TriMesh { vertices, triangles: mesh.triangles.iter().map(|t| t.map(|v| number[v as usize])).collect() }
}

#[cfg(test)]
#[path = "repair_tests.rs"]
mod tests;
