//! Who lies beside whom: what every value of a field stands for, and links between neighbours. Priors of fields need no more of a body.
//!
//! Links are those of finite volumes: with area A and distance d, Σ (A/d)(m_a − m_b)² approximates ∫|∇m|² over the body.

use crate::cutcells::cut::POINTS27;
use crate::space::body::Body;
use glam::DVec3;
use std::collections::BTreeMap;

/// Values of a field and their neighbours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Neighbours {
    /// Volume that each value stands for [m³], positive, shape `[N]`.
    pub volume: Vec<f64>,
    /// Pairs of neighbours, each once and in increasing order.
    pub links: Vec<Link>,
}

/// Two values beside each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// The first, by its number.
    pub a: u32,
    /// The second, of the higher number.
    pub b: u32,
    /// Area between them [m²].
    pub area: f64,
    /// Distance of their middles [m].
    pub distance: f64,
}

/// Least distance of two cells' middles, in edges of a cell: slivers that a body leaves in two cells may all but touch.
const CLOSE: f64 = 0.1;

impl Neighbours {
    /// Elements that share a face: cells of a lattice, or elastic points whose stencils share three of their first four nodes; or points of a cloud with
    /// their stars.
    pub fn of_elements(body: &Body) -> Neighbours {
        let mut n = Neighbours::default();
        n.add_cells(body);
        match body.points.stars {
            Some(_) => n.add_stars(body),
            None => n.add_points(body),
        }
        n.settle()
    }

    /// Nodes that share an element. A pair at distance d gets an equal part of 3 V/d² of every element of volume V that holds it, so that a
    /// constant gradient has the right norm wherever pairs point in all directions alike.
    pub fn of_nodes(body: &Body) -> Neighbours {
        if body.points.stars.is_some() {
            return Neighbours::of_elements(body);
        }
        let volumes = body.cells().iter().map(|c| c.fraction * body.cut().grid.h.powi(3)).chain(volumes(body));
        let mut areas: BTreeMap<(u32, u32), (f64, f64)> = BTreeMap::new();
        for (nodes, volume) in body.element_nodes().zip(volumes) {
            let pairs = (nodes.len() * (nodes.len() - 1) / 2).max(1) as f64;
            for (i, a) in nodes.iter().enumerate() {
                for b in &nodes[..i] {
                    let distance = (body.nodes[*a as usize] - body.nodes[*b as usize]).length();
                    let entry = areas.entry((*a.min(b), *a.max(b))).or_insert((0.0, distance));
                    entry.0 += 3.0 * volume / (pairs * distance);
                }
            }
        }
        let links = areas.into_iter().map(|((a, b), (area, distance))| Link { a, b, area, distance }).collect();
        Neighbours { volume: body.node_volume.clone(), links }.settle()
    }

    /// Volume of all [m³].
    pub fn whole(&self) -> f64 {
        self.volume.iter().sum()
    }

    /// Cells of a lattice. The face between two of them is as full as the fuller one: a cut along it leaves all of it, one across leaves as
    /// much as both hold.
    fn add_cells(&mut self, body: &Body) {
        let Some(cut) = &body.cut else { return };
        let h = cut.grid.h;
        let number: BTreeMap<[usize; 3], u32> = (0u32..).zip(&cut.cells).map(|(e, c)| (c.lattice, e)).collect();
        let middle = |e: usize| {
            let cell = &cut.cells[e];
            cut.grid.position(cell.lattice) + h * (0..27).map(|q| POINTS27[q] * cell.weights[q]).sum::<DVec3>() / cell.fraction
        };
        for (e, cell) in cut.cells.iter().enumerate() {
            self.volume.push(cell.fraction * h.powi(3));
            for axis in 0..3 {
                let mut lattice = cell.lattice;
                lattice[axis] += 1;
                let Some(&other) = number.get(&lattice) else { continue };
                let full = cell.fraction.max(cut.cells[other as usize].fraction).min(1.0);
                let distance = (middle(other as usize) - middle(e))[axis].max(CLOSE * h);
                self.links.push(Link { a: e as u32, b: other, area: full * h * h, distance });
            }
        }
    }

    /// Points of a cloud. A pair at distance d gets an equal part of 3 V/d² of the star of each that has it, as nodes that share an element do.
    fn add_stars(&mut self, body: &Body) {
        for (s, volume) in body.points.means().zip(&body.points.volume) {
            let others = &s.nodes[1..];
            for other in others {
                let distance = (body.nodes[*other as usize] - body.nodes[s.nodes[0] as usize]).length();
                let area = 3.0 * volume / (others.len() as f64 * distance);
                self.links.push(Link { a: s.nodes[0], b: *other, area, distance });
            }
        }
        self.volume.extend(volumes(body));
    }

    /// Tetrahedra.
    fn add_points(&mut self, body: &Body) {
        let first = self.volume.len() as u32;
        let mut faces: BTreeMap<[u32; 3], Vec<u32>> = BTreeMap::new();
        for (e, s) in (first..).zip(body.points.means()) {
            let corners = &s.nodes[..s.nodes.len().min(4)];
            for leave in 0..corners.len() {
                let mut face: Vec<u32> = (0..corners.len()).filter(|k| *k != leave).map(|k| corners[k]).collect();
                face.sort_unstable();
                if let Ok(face) = <[u32; 3]>::try_from(face) {
                    faces.entry(face).or_default().push(e);
                }
            }
        }
        self.volume.extend(volumes(body));
        let middles: Vec<DVec3> = body.points.means().map(|s| s.at(&body.nodes)).collect();
        for (face, elements) in faces {
            let [a, b, c] = face.map(|n| body.nodes[n as usize]);
            let area = 0.5 * (b - a).cross(c - a).length();
            let pairs = (elements.len() * elements.len().saturating_sub(1) / 2).max(1) as f64;
            for (i, b) in elements.iter().enumerate() {
                for a in &elements[..i] {
                    let distance = (middles[(a - first) as usize] - middles[(b - first) as usize]).length();
                    self.links.push(Link { a: *a, b: *b, area: area / pairs, distance });
                }
            }
        }
    }

    /// Pairs in order, each once.
    fn settle(mut self) -> Neighbours {
        self.links.iter_mut().filter(|l| l.a > l.b).for_each(|l| std::mem::swap(&mut l.a, &mut l.b));
        self.links.sort_by_key(|l| (l.a, l.b));
        self.links.dedup_by(|next, kept| {
            let same = (next.a, next.b) == (kept.a, kept.b);
            kept.area += if same { next.area } else { 0.0 };
            same
        });
        self
    }
}

/// Volumes of tetrahedra [m³].
fn volumes(body: &Body) -> impl Iterator<Item = f64> + '_ {
    (0..body.points.elements()).map(|e| body.points.element_volume(e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutcells::build::SUBDIVISIONS;
    use crate::scene::{Analytic, BodySource, Object, Resolution};
    use crate::shape::shape_of;
    use crate::space::points::TetMesh;
    use crate::space::tets::Tetrahedron;

    /// A bar whose last cells are cut, across and along.
    fn bar() -> Body {
        let shape = Analytic::Box { min: DVec3::ZERO, max: DVec3::new(0.19, 0.04, 0.035) };
        let object = Object {
            source: BodySource::Analytic(shape),
            pose: glam::DAffine3::IDENTITY,
            resolution: Resolution::CellSize(0.02),
        };
        Body::build(shape_of(&object).as_ref(), 0.02, 0.02, SUBDIVISIONS).unwrap()
    }

    /// A cube of 3³ cubes of six tetrahedra each (Kuhn).
    fn cube() -> Body {
        let n = 3u32;
        let number = |p: [u32; 3]| p[0] + (n + 1) * (p[1] + (n + 1) * p[2]);
        let (mut nodes, mut tets) = (Vec::new(), Vec::new());
        for k in 0..(n + 1).pow(3) {
            nodes.push(DVec3::new((k % (n + 1)).into(), (k / (n + 1) % (n + 1)).into(), (k / (n + 1).pow(2)).into()) * 0.01);
        }
        for k in 0..n.pow(3) {
            let low = [k % n, k / n % n, k / n / n];
            for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
                let mut at = low;
                let mut tet = vec![number(at)];
                for axis in order {
                    at[axis] += 1;
                    tet.push(number(at));
                }
                tets.push([tet[0], tet[1], tet[2], tet[3]]);
            }
        }
        Body::of_tets(&TetMesh { nodes, tets, ..TetMesh::default() }.checked().unwrap(), Tetrahedron::Quadratic)
    }

    /// Σ (A/d)(m_a − m_b)² of the field m = g·x.
    fn square(n: &Neighbours, at: &[DVec3], g: DVec3) -> f64 {
        n.links.iter().map(|l| l.area / l.distance * g.dot(at[l.a as usize] - at[l.b as usize]).powi(2)).sum()
    }

    #[test]
    fn links_measure_the_gradient_of_the_body_between_middles() {
        let body = bar();
        let n = Neighbours::of_elements(&body);
        assert!((n.whole() / body.volume - 1.0).abs() < 1e-9 && n.volume.len() == body.elements());
        let cut = body.cut();
        let middles: Vec<DVec3> = (cut.cells.iter())
            .map(|c| {
                cut.grid.position(c.lattice) + 0.02 * (0..27).map(|q| POINTS27[q] * c.weights[q]).sum::<DVec3>() / c.fraction
            })
            .collect();
        // Between the middles of the first and the last cells lies that much of the body.
        let x = square(&n, &middles, DVec3::X);
        let between = (0.185 - 0.01) * 0.04 * 0.035;
        assert!((x / between - 1.0).abs() < 1e-9, "{x} {between}");
        let z = square(&n, &middles, DVec3::Z);
        // Across, the face beside the cut cells is as full as the full ones.
        let between = 0.19 * 0.04 * 0.0175;
        assert!((z / between - 1.0).abs() < 1e-9, "{z} {between}");
    }

    #[test]
    fn nodes_and_tetrahedra_have_links_in_all_directions() {
        for body in [bar(), cube()] {
            let n = Neighbours::of_nodes(&body);
            assert!((n.whole() / body.volume - 1.0).abs() < 1e-9);
            let all: f64 = [DVec3::X, DVec3::Y, DVec3::Z].iter().map(|g| square(&n, &body.nodes, *g)).sum();
            assert!((all / (3.0 * body.volume) - 1.0).abs() < 1e-9, "{all} {}", body.volume);
        }
        let body = cube();
        let n = Neighbours::of_elements(&body);
        // 27 cubes of six with six faces inside, and two triangles on each of 3 · 2 · 9 squares between cubes.
        assert_eq!((n.volume.len(), n.links.len()), (162, 27 * 6 + 2 * 54));
        assert!(n.links.windows(2).all(|w| (w[0].a, w[0].b) < (w[1].a, w[1].b)) && n.links.iter().all(|l| l.a < l.b));
    }
}
