//! A surface that is coarse enough for a page.

use crate::embed::Embedding;
use crate::experiment::Experiment;
use glam::DVec3;
use std::collections::BTreeMap;

/// Most vertices of a surface in a report.
const MOST_VERTICES: usize = 2500;

/// The rest surface as a report shows it.
pub struct Body {
    /// Its vertices, carried by the nodes.
    pub surface: Embedding,
    /// Its triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Neighbours of every vertex.
    pub neighbours: Vec<Vec<u32>>,
}

impl Body {
    /// The surface of a scene. What is too fine is merged in cubes, the coarser the finer it is.
    pub fn new(e: &Experiment) -> Body {
        let body = &e.plan().body;
        // Triangles of edge l have 0.43 l² of area, and there are two for each vertex.
        let edge = (body.area / (0.43 * 2.0 * 0.6 * MOST_VERTICES as f64)).sqrt().max(0.5 * body.length);
        let mesh = e.shape().surface(edge);
        let (mut vertices, mut triangles) = (mesh.vertices, mesh.triangles);
        let mut side = edge;
        while vertices.len() > MOST_VERTICES {
            (vertices, triangles) = merged(&vertices, &triangles, side);
            side *= 1.3;
        }
        let mut neighbours = vec![Vec::new(); vertices.len()];
        for t in &triangles {
            for k in 0..3 {
                neighbours[t[k] as usize].extend([t[(k + 1) % 3], t[(k + 2) % 3]]);
            }
        }
        for n in &mut neighbours {
            n.sort_unstable();
            n.dedup();
        }
        Body { surface: Embedding::new(body, vertices), triangles, neighbours }
    }

    /// The residual around every vertex: each point counts at the nearest one, and half as much at its neighbours.
    pub fn spread(&self, vertices: &[DVec3], points: &[(DVec3, f64)]) -> Vec<Option<f64>> {
        let mut sums = vec![(0.0, 0.0); vertices.len()];
        for (place, residual) in points {
            let far = |v: &DVec3| v.distance_squared(*place);
            let nearest = (0..vertices.len()).min_by(|a, b| far(&vertices[*a]).total_cmp(&far(&vertices[*b])));
            if let Some(n) = nearest {
                sums[n].0 += residual;
                sums[n].1 += 1.0;
            }
        }
        // Twice: a mean over some ten points says what is systematic, and not what noise did at one.
        for _ in 0..2 {
            let mix = |v: usize| {
                let around = self.neighbours[v].iter().map(|n| sums[*n as usize]);
                around.fold(sums[v], |(s, w), (t, x)| (s + 0.5 * t, w + 0.5 * x))
            };
            sums = (0..sums.len()).map(mix).collect();
        }
        sums.iter().map(|(s, w)| (*w > 0.0).then(|| s / w)).collect()
    }
}

/// Vertices of a cube of this side become one, their mean.
fn merged(vertices: &[DVec3], triangles: &[[u32; 3]], side: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut cubes: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    let mut sums: Vec<(DVec3, f64)> = Vec::new();
    let mut number = Vec::with_capacity(vertices.len());
    for v in vertices {
        let cube = (*v / side).floor().to_array().map(|x| x as i64);
        let n = *cubes.entry(cube).or_insert_with(|| {
            sums.push((DVec3::ZERO, 0.0));
            sums.len() as u32 - 1
        });
        sums[n as usize].0 += *v;
        sums[n as usize].1 += 1.0;
        number.push(n);
    }
    let corners = triangles.iter().map(|t| t.map(|v| number[v as usize]));
    let mut triangles: Vec<[u32; 3]> = corners.filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]).collect();
    triangles.sort_unstable();
    triangles.dedup();
    (sums.into_iter().map(|(s, n)| s / n).collect(), triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fine_surface_is_merged_and_keeps_its_extent() {
        // A square of 41 × 41 vertices, 0.025 apart.
        let n = 41u32;
        let vertices: Vec<DVec3> = (0..n * n).map(|k| DVec3::new(f64::from(k % n), f64::from(k / n), 0.0) * 0.025).collect();
        let quad =
            |i: u32, j: u32| [[j * n + i, j * n + i + 1, (j + 1) * n + i], [j * n + i + 1, (j + 1) * n + i + 1, (j + 1) * n + i]];
        let triangles: Vec<[u32; 3]> = (0..n - 1).flat_map(|j| (0..n - 1).flat_map(move |i| quad(i, j))).collect();
        let (v, t) = merged(&vertices, &triangles, 0.1);
        assert!(v.len() <= 121 && t.len() > 150, "{} {}", v.len(), t.len());
        let area = |[a, b, c]: [u32; 3]| 0.5 * (v[b as usize] - v[a as usize]).cross(v[c as usize] - v[a as usize]).length();
        let all: f64 = t.iter().map(|t| area(*t)).sum();
        // The rim moves in by at most half a cube on each side.
        assert!(all > 0.8 && all < 1.001, "{all}");
    }
}
