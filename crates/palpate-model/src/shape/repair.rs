//! What is wrong with a triangle mesh, and what of it can be put right without guessing.

use super::components::components;
use super::contacts::contacts;
use super::edges::{EdgeUses, bucketed};
use super::joining::join_vertices;
use super::pseudonormal::{Pseudonormals, single_fans};
use super::{MeshShape, TriMesh};
use glam::DVec3;
use rayon::prelude::*;

/// Holes with more edges than this are not closed: their shape is anybody's guess.
const HOLE_EDGES: usize = 64;

/// Holes with a rim longer than this share of the mesh's size are not closed.
const HOLE_RIM: f64 = 0.25;

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

/// Distance over the size within which a surface that touches itself has no sign by normals.
const TOUCHING: f64 = 1e-6;

/// Examines a mesh.
pub fn diagnose(mesh: &TriMesh) -> MeshReport {
    MeshShape::examined(mesh.clone()).1
}

/// The same with the normals of all features, where the mesh is so clean that they tell inside from outside. `tree` holds the mesh.
pub(super) fn examine_in(mesh: &TriMesh, tree: &MeshShape) -> (MeshReport, Option<Pseudonormals>) {
    let uses = EdgeUses::of(mesh);
    let (mut open_edges, mut non_manifold_edges, mut inconsistent_edges) = (0, 0, 0);
    for (_, u) in uses.groups() {
        match u {
            [_] => open_edges += 1,
            [a, b] => inconsistent_edges += usize::from(a.rising == b.rising),
            _ => non_manifold_edges += 1,
        }
    }
    let mut holes: Vec<(usize, f64)> = match open_edges {
        0 => Vec::new(),
        _ => rims(mesh, &uses).iter().map(|r| (r.len(), rim_length(mesh, r))).collect(),
    };
    holes.sort_by(|a, b| b.1.total_cmp(&a.1));
    let size = mesh.size();
    let contacts = contacts(mesh, tree, TOUCHING * size);
    let report = MeshReport {
        open_edges,
        non_manifold_edges,
        inconsistent_edges,
        signed_volume: mesh.volume(),
        intersecting_pairs: contacts.pairs,
        components: components(&mesh.triangles, mesh.vertices.len()).1,
        degenerate_triangles: (0..mesh.triangles.len()).into_par_iter().filter(|&t| is_degenerate(mesh, t)).count(),
        size,
        holes,
    };
    let counts = (report.inconsistent_edges, report.intersecting_pairs, report.degenerate_triangles, report.components);
    let clean = report.is_closed() && report.signed_volume > 0.0 && counts == (0, 0, 0, 1) && !contacts.touches;
    let normals = (clean && single_fans(mesh)).then(|| Pseudonormals::new(mesh, &uses));
    (report, normals)
}

fn is_degenerate(mesh: &TriMesh, t: usize) -> bool {
    let [a, b, c] = mesh.corners(t);
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    // Height below 1e-9 of the length: the normal is rounding.
    super::trimesh::triangle_area([a, b, c]) <= 0.5e-9 * longest * longest
}

/// Closed loops of open edges, walked so that the triangle of each edge lies on its right (a filling has it on its left).
fn rims(mesh: &TriMesh, uses: &EdgeUses) -> Vec<Vec<u32>> {
    let open = uses.groups().filter(|(_, u)| u.len() == 1).map(|([a, b], u)| if u[0].rising { (b, a) } else { (a, b) });
    let open: Vec<(u32, u32)> = open.collect();
    let (first, to) = bucketed(mesh.vertices.len(), open.iter().copied());
    // What is left to walk from each vertex, and where it stands on the rim that is walked.
    let mut left: Vec<u32> = first[1..].to_vec();
    let mut place = vec![usize::MAX; mesh.vertices.len()];
    let mut loops = Vec::new();
    for start in 0..mesh.vertices.len() {
        while left[start] > first[start] {
            let mut rim = vec![start as u32];
            place[start] = 0;
            while let Some(&at) = rim.last().filter(|v| left[**v as usize] > first[**v as usize]) {
                left[at as usize] -= 1;
                let next = to[left[at as usize] as usize];
                // A vertex met again closes a loop (two holes may touch in it).
                let i = place[next as usize];
                if i == usize::MAX {
                    place[next as usize] = rim.len();
                    rim.push(next);
                    continue;
                }
                let closed = rim.split_off(i);
                closed.iter().for_each(|v| place[*v as usize] = usize::MAX);
                loops.push(closed);
                if i == 0 {
                    break;
                }
                place[next as usize] = rim.len();
                rim.push(next);
            }
            rim.iter().for_each(|v| place[*v as usize] = usize::MAX);
        }
    }
    loops.retain(|l| l.len() > 2);
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
    drop_doubled(&mut mesh);
    say(before - mesh.triangles.len(), "dropped triangles that occur twice");
    let uses = EdgeUses::of(&mesh);
    // Turning a triangle changes no edge's number of triangles.
    let open_edges = uses.open();
    say(orient(&mut mesh, &uses), "turned triangles to agree with their neighbours");
    say(turn_outward(&mut mesh), "turned inside-out parts outward, triangles");
    let holes = if open_edges == 0 { 0 } else { close_holes(&mut mesh) };
    say(holes, "closed small holes");
    Repaired { mesh: drop_unused(mesh), done, open_edges }
}

/// Of triangles with the same vertices the first stays.
fn drop_doubled(mesh: &mut TriMesh) {
    let sorted = |t: &[u32; 3]| {
        let mut key = *t;
        key.sort_unstable();
        key
    };
    // By smallest vertex: few share one.
    let keys = mesh.triangles.iter().zip(0u32..).map(|(t, n)| {
        let [a, b, c] = sorted(t);
        (a, ([b, c], n))
    });
    let (first, mut keys) = bucketed(mesh.vertices.len(), keys);
    let mut doubled = vec![false; mesh.triangles.len()];
    for w in first.windows(2) {
        let own = &mut keys[w[0] as usize..w[1] as usize];
        own.sort_unstable();
        own.windows(2).filter(|k| k[0].0 == k[1].0).for_each(|k| doubled[k[1].1 as usize] = true);
    }
    let mut number = 0;
    mesh.triangles.retain(|_| {
        number += 1;
        !doubled[number - 1]
    });
}

/// Walks over edges of two triangles and turns those that disagree; of each connected patch the minority is turned.
fn orient(mesh: &mut TriMesh, uses: &EdgeUses) -> usize {
    // A triangle has a neighbour at each of three sides at most.
    let mut neighbours: Vec<([(u32, bool); 3], u8)> = vec![Default::default(); mesh.triangles.len()];
    for (_, u) in uses.groups().filter(|(_, u)| u.len() == 2 && u[0].triangle != u[1].triangle) {
        let agree = u[0].rising != u[1].rising;
        for [from, to] in [[u[0], u[1]], [u[1], u[0]]] {
            let (all, count) = &mut neighbours[from.triangle as usize];
            all[usize::from(*count)] = (to.triangle, agree);
            *count += 1;
        }
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
            let (all, count) = &neighbours[t];
            for &(s, agree) in &all[..usize::from(*count)] {
                let s = s as usize;
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
    let (first, members) = bucketed(count, of.iter().zip(0usize..).map(|(c, t)| (*c as u32, t)));
    let mut turned = 0;
    // Parts that are not cavities first face outward by themselves; a part counts as enclosed by the absolute winding of the others.
    for c in 0..count {
        let own = &members[first[c] as usize..first[c + 1] as usize];
        // About the part's own middle, so that an open part is judged by its bulge and not by its place.
        let corners = || own.iter().flat_map(|t| mesh.corners(*t));
        let (lo, hi) = corners().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
        let middle = 0.5 * (lo + hi);
        let six: f64 = (own.iter())
            .map(|t| {
                let [a, b, d] = mesh.corners(*t).map(|p| p - middle);
                a.dot(b.cross(d))
            })
            .sum();
        if six >= 0.0 {
            continue;
        }
        let enclosed = count > 1 && {
            let others = MeshShape::unsigned(part(mesh, &|n| n != c));
            own.first().map(|t| mesh.corners(*t)[0]).is_some_and(|p| others.winding_number(p).abs() > 0.5)
        };
        if !enclosed {
            for t in own {
                mesh.triangles[*t].swap(1, 2);
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
    for rim in rims(mesh, &EdgeUses::of(mesh)) {
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
