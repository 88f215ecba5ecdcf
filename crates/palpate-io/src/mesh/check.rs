//! Is a triangle mesh the surface of a solid? Repairs what is safe to repair.

use super::bounds;
use glam::DVec3;
use palpate_model::shape::TriMesh;
use std::collections::BTreeMap;

/// Holes up to this part of the longest side are closed with a warning; larger ones are somebody's decision.
const SMALL_HOLE: f64 = 0.1;

/// Vertices on open borders closer than this part of the longest side are one vertex.
const WELD: f64 = 1e-5;

/// More open border than this is no crack.
const MOST_BORDER: usize = 5000;

/// Triangles on either side of every edge (smaller vertex first), with true where the triangle runs from smaller to larger.
type Edges = BTreeMap<(u32, u32), Vec<(usize, bool)>>;

fn edges(mesh: &TriMesh) -> Edges {
    let mut edges = Edges::new();
    for (t, tri) in mesh.triangles.iter().enumerate() {
        for i in 0..3 {
            let (a, b) = (tri[i], tri[(i + 1) % 3]);
            edges.entry((a.min(b), a.max(b))).or_default().push((t, a < b));
        }
    }
    edges
}

/// Makes the mesh closed and oriented where that is safe; what was done or looks wrong is added to `warnings`.
///
/// # Errors
/// What keeps the mesh from enclosing a solid, with numbers.
pub(super) fn solid(mut mesh: TriMesh, warnings: &mut Vec<String>) -> Result<TriMesh, String> {
    let (min, max) = bounds(&mesh.vertices);
    let side = (max - min).max_element();
    // Coordinates of files carry six or more digits; a millionth of the length is flat.
    if (max - min).min_element() < 1e-6 * side {
        return Err("encloses no volume: it is flat; a closed surface of a solid is needed".to_string());
    }
    let open = |mesh: &TriMesh| edges(mesh).values().filter(|t| t.len() == 1).count();
    if open(&mesh) > 0 {
        weld(&mut mesh, WELD * side);
    }
    let border = open(&mesh);
    if border > 0 {
        close(&mut mesh, border, SMALL_HOLE * side, warnings)?;
    }
    let components = orient(&mut mesh, warnings)?;
    face_outward(&mut mesh, &components, warnings);
    let touching = edges(&mesh).values().filter(|t| t.len() > 2).count();
    if touching > 0 {
        warnings.push(format!("touches itself along {touching} edges; inside and outside are taken from the winding number"));
    }
    let volume = mesh.volume();
    // A flattened surface's volume is rounding noise; a fibre a thousandth as thick as long is far above this.
    if volume < 1e-9 * side.powi(3) {
        return Err(format!("encloses no volume ({volume:e} m³, its longest side is {side} m)"));
    }
    Ok(mesh)
}

/// Joins vertices on open borders that lie closer than `tolerance` (cracks between patches).
fn weld(mesh: &mut TriMesh, tolerance: f64) {
    let mut border: Vec<u32> = edges(mesh).iter().filter(|(_, t)| t.len() == 1).flat_map(|(e, _)| [e.0, e.1]).collect();
    border.sort_unstable();
    border.dedup();
    if border.len() > MOST_BORDER {
        return;
    }
    let mut target: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    for (i, &v) in border.iter().enumerate() {
        let near = border[..i].iter().find(|w| mesh.vertices[**w as usize].distance(mesh.vertices[v as usize]) < tolerance);
        if let Some(&w) = near {
            target[v as usize] = target[w as usize];
        }
    }
    mesh.triangles.iter_mut().for_each(|t| *t = t.map(|v| target[v as usize]));
    mesh.triangles.retain(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]);
}

/// Closes simple holes up to `size` across with a fan around their middle.
fn close(mesh: &mut TriMesh, border: usize, size: f64, warnings: &mut Vec<String>) -> Result<(), String> {
    let open = |what: String| {
        format!("is open: {border} border edges{what}; a closed surface is needed: fill its holes in a mesh editor")
    };
    // A border edge a → b of a triangle is passed b → a by the triangle that closes it.
    let mut next: BTreeMap<u32, u32> = BTreeMap::new();
    for (e, t) in edges(mesh).iter().filter(|(_, t)| t.len() == 1) {
        let (a, b) = if t[0].1 { (e.1, e.0) } else { *e };
        if next.insert(a, b).is_some() {
            return Err(open(" that meet or run against each other".into()));
        }
    }
    let mut holes = 0;
    while let Some((&first, _)) = next.first_key_value() {
        let mut ring = vec![first];
        while let Some(v) = next.remove(&ring[ring.len() - 1]) {
            if v == first {
                break;
            }
            ring.push(v);
        }
        let points: Vec<DVec3> = ring.iter().map(|v| mesh.vertices[*v as usize]).collect();
        let (lo, hi) = bounds(&points);
        let across = (hi - lo).length();
        if across > size {
            return Err(open(format!(", a hole {across:.4} m across (up to {size:.4} m would be closed)")));
        }
        let middle = mesh.vertices.len() as u32;
        mesh.vertices.push(points.iter().sum::<DVec3>() / points.len() as f64);
        mesh.triangles.extend((0..ring.len()).map(|i| [ring[i], ring[(i + 1) % ring.len()], middle]));
        holes += 1;
    }
    warnings.push(format!("{holes} small holes were closed ({border} border edges)"));
    Ok(())
}

/// Turns triangles so that neighbours agree; returns the connected component of every triangle.
///
/// Where more than two triangles share an edge, who continues whom is the file's secret: such components are left as they are
/// and must be consistent already.
fn orient(mesh: &mut TriMesh, warnings: &mut Vec<String>) -> Result<Vec<usize>, String> {
    let edges = edges(mesh);
    // The neighbour across an edge, and whether both pass it in opposite directions; unknown where several meet.
    let mut neighbours: Vec<Vec<(usize, Option<bool>)>> = vec![Vec::new(); mesh.triangles.len()];
    for around in edges.values() {
        for (i, &(t, forward)) in around.iter().enumerate() {
            let (n, other) = around[(i + 1) % around.len()];
            let agree = (around.len() == 2).then_some(forward != other);
            neighbours[t].push((n, agree));
            neighbours[n].push((t, agree));
        }
    }
    let mut component = vec![usize::MAX; mesh.triangles.len()];
    let mut flipped = 0;
    let mut count = 0;
    for seed in 0..mesh.triangles.len() {
        if component[seed] != usize::MAX {
            continue;
        }
        component[seed] = count;
        let mut members = vec![seed];
        let mut flip = BTreeMap::from([(seed, false)]);
        let (mut one_sided, mut touching) = (false, false);
        let mut next = 0;
        while next < members.len() {
            let t = members[next];
            next += 1;
            for &(n, agree) in &neighbours[t] {
                touching |= agree.is_none();
                // Like the neighbour where the two agree, unlike it where they do not.
                let turned = agree.is_some_and(|a| flip[&t] == a);
                if component[n] == usize::MAX {
                    component[n] = count;
                    flip.insert(n, turned);
                    members.push(n);
                } else if agree.is_some() && flip[&n] != turned {
                    one_sided = true;
                }
            }
        }
        count += 1;
        if touching {
            continue;
        }
        if one_sided {
            return Err("has no inside: its surface is one-sided (like a Möbius strip)".to_string());
        }
        let turned: Vec<usize> = flip.into_iter().filter(|(_, f)| *f).map(|(t, _)| t).collect();
        flipped += turned.len().min(members.len() - turned.len());
        turned.into_iter().for_each(|t| mesh.triangles[t].swap(1, 2));
    }
    if flipped > 0 {
        warnings.push(format!("{flipped} of {} triangles were turned to agree with their neighbours", mesh.triangles.len()));
    }
    let unbalanced = self::edges(mesh).values().filter(|t| 2 * t.iter().filter(|x| x.1).count() != t.len()).count();
    if unbalanced > 0 {
        return Err(format!(
            "has no inside: its triangles contradict each other along {unbalanced} edges that more than two of them share"
        ));
    }
    Ok(component)
}

/// Turns components that are not inside another one outward.
fn face_outward(mesh: &mut TriMesh, component: &[usize], warnings: &mut Vec<String>) {
    let count = component.iter().max().map_or(0, |c| c + 1);
    let parts: Vec<TriMesh> = (0..count)
        .map(|c| TriMesh {
            vertices: mesh.vertices.clone(),
            triangles: mesh.triangles.iter().zip(component).filter(|(_, k)| **k == c).map(|(t, _)| *t).collect(),
        })
        .collect();
    let volumes: Vec<f64> = parts.iter().map(TriMesh::volume).collect();
    for c in 0..count {
        let p = mesh.vertices[parts[c].triangles[0][0] as usize];
        let around = (0..count).filter(|o| *o != c && winding(&parts[*o], p).abs() > 0.5).count();
        if volumes[c] < 0.0 && around == 0 {
            let own = |t: &(&mut [u32; 3], &usize)| *t.1 == c;
            mesh.triangles.iter_mut().zip(component).filter(own).for_each(|(t, _)| t.swap(1, 2));
            warnings.push(format!("its {} triangles faced inward and were turned", parts[c].triangles.len()));
        } else if volumes[c] > 0.0 && around % 2 == 1 {
            warnings
                .push("a closed part lies inside another and faces outward: taken as solid; a cavity faces inward".to_string());
        }
    }
}

/// Winding number of a surface around a point: 1 inside, 0 outside (solid angles after van Oosterom and Strackee, 1983).
fn winding(mesh: &TriMesh, p: DVec3) -> f64 {
    let angle = |t: usize| {
        let [a, b, c] = mesh.triangles[t].map(|v| mesh.vertices[v as usize] - p);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        2.0 * a.dot(b.cross(c)).atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
    };
    (0..mesh.triangles.len()).map(angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}
