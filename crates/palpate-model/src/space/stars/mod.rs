//! Bodies of point clouds: every point is a node and an elastic point at once, whose stencil is itself and its neighbours. A star has the deformation
//! gradient F_i = Σ_j y_j G_ijᵀ and the volume V_i. Materials, effects and adjoints come with elastic points; there is no mesh.
//!
//! After Chen et al., Virtual Elastic Objects (CVPR 2022), whose weights fail the patch test ([`compatible`]); those are to be had as [`Weights::Published`].

#[cfg(feature = "sparse")]
pub mod compatible;
pub mod graph;
pub mod lookup;
pub mod near;
pub mod penalty;
pub mod volumes;

use crate::cutcells::extension::AffineFit;
use crate::cutcells::shadow::InCubes;
use crate::shape::{Shape, TriMesh};
use crate::space::body::{Body, Patch};
use crate::space::points::Points;
use crate::space::stencil::Stencils;
#[cfg(feature = "sparse")]
use compatible::make_compatible;
use glam::DVec3;
#[cfg(not(feature = "sparse"))]
use graph::Star;
use near::Near;
use penalty::Penalty;
use rayon::prelude::*;

/// How the deformation gradient of a star is weighed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Weights {
    /// Least squares, changed as little as passes the patch test.
    #[default]
    Compatible,
    /// Least squares alone, as published: irregular bodies are far too soft.
    Published,
}

/// What stars are made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StarSpec {
    /// Neighbours of a point, at least.
    pub neighbours: usize,
    /// How they are weighed.
    pub weights: Weights,
    /// γ of the residual penalty.
    pub residual_penalty: f64,
}

impl Default for StarSpec {
    fn default() -> StarSpec {
        StarSpec { neighbours: 6, weights: Weights::default(), residual_penalty: 0.05 }
    }
}

/// There are no compatible weights without a factorisation.
#[cfg(not(feature = "sparse"))]
fn make_compatible(_: &mut [Star], _: &[DVec3], _: &[f64], _: &[DVec3], _: f64) -> Result<(), String> {
    Err("compatible weights need the feature `sparse` of palpate-model".into())
}

/// Fewest points of a body.
pub const FEWEST: usize = 8;
/// Points nearer than this part of the spacing are one point twice.
const SAME: f64 = 1e-3;
/// Longest edge of the surface's patches, in spacings.
const PATCH: f64 = 0.5;
/// Radius of the fit that gives a patch its points, in spacings; it grows until these span all directions.
const RADIUS: f64 = 1.5;

/// Refuses clouds that no body can be made of, whatever it is made of.
///
/// # Errors
/// Too few points, points that are no numbers, points at one place; with counts.
pub fn check(points: &[DVec3]) -> Result<(), String> {
    if points.len() < FEWEST {
        return Err(format!("holds {}; a body needs {FEWEST} or more", count(points.len())));
    }
    if let Some(k) = points.iter().position(|x| !x.is_finite()) {
        let all = points.iter().filter(|x| !x.is_finite()).count();
        return Err(format!("{all} of {} points are no numbers, point {k} first", points.len()));
    }
    let near = Near::new(points, near::spacing(points));
    let same = SAME * near::spacing(points);
    let twin = |i: usize| near.nearest(points[i], 2).into_iter().find(|n| n.1 as usize != i && n.0 <= same).map(|n| n.1);
    let twins: Vec<(usize, u32)> = (0..points.len()).filter_map(|i| Some((i, twin(i)?))).collect();
    match twins.first() {
        None => Ok(()),
        Some((i, j)) => Err(format!(
            "{} of {} points lie at the place of another one, points {i} and {j} at {} m first; give every point once",
            twins.len(),
            points.len(),
            points[*i]
        )),
    }
}

fn count(n: usize) -> String {
    if n == 1 { "1 point".into() } else { format!("{n} points") }
}

/// Places, areas and outward normals of the surface's pieces, and the points that each moves with.
struct Surface {
    patches: Vec<Patch>,
    stencils: Stencils,
}

/// The pieces, by the nearest point.
fn surface(body: &Body, mesh: &TriMesh, near: &Near) -> Surface {
    let cubes = InCubes::new(body);
    let piece = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        let (twice, point) = ((b - a).cross(c - a), (a + b + c) / 3.0);
        let normal = twice.try_normalize()?;
        let fit = AffineFit::new(body, &cubes, point, RADIUS * body.length);
        let patch = Patch { cell: near.nearest(point, 1)[0].1, area: 0.5 * twice.length(), normal, point };
        Some((patch, fit.value(point), fit.nodes))
    };
    let mut pieces: Vec<_> = (0..mesh.triangles.len()).into_par_iter().filter_map(piece).collect();
    pieces.sort_by_key(|p| p.0.cell);
    let mut all = Surface { patches: Vec::new(), stencils: Stencils::default() };
    for (patch, weights, nodes) in pieces {
        all.stencils.push(&nodes, &weights);
        all.patches.push(patch);
    }
    all
}

impl Body {
    /// A body of stars around points [m] inside a shape.
    ///
    /// # Errors
    /// Points that are too few, twice, outside, in a plane or in several parts; with counts.
    pub fn of_stars(points: &[DVec3], shape: &dyn Shape, spec: &StarSpec) -> Result<Body, String> {
        check(points)?;
        let (low, high) = shape.bounds();
        let rough = ((high - low).element_product() / points.len() as f64).cbrt();
        let volume = shape.surface(rough).volume();
        let length = (volume / points.len() as f64).cbrt();
        let mesh = shape.surface(PATCH * length);
        // That of the pieces exactly, or a constant stress would not be in equilibrium.
        let volume = mesh.volume();
        let near = Near::new(points, length);
        let node_volume = volumes::volumes(points, &near, shape, length, volume)?;
        let mut stars = graph::stars(points, &near, shape, spec.neighbours, length)?;
        let mut body = Body {
            length,
            nodes: points.to_vec(),
            node_volume: node_volume.clone(),
            patches: Vec::new(),
            surface: Stencils::default(),
            cut: None,
            points: Points::new(1),
            band: Default::default(),
            volume,
            area: mesh.area(),
            center: points.iter().zip(&node_volume).map(|(x, v)| *x * *v).sum::<DVec3>() / volume,
            corners: mesh.bounds(),
        };
        let Surface { patches, stencils } = surface(&body, &mesh, &near);
        (body.patches, body.surface) = (patches, stencils);
        if spec.weights == Weights::Compatible {
            make_compatible(&mut stars, points, &node_volume, &body.outward_areas(), length)?;
        }
        for (star, v) in stars.iter().zip(&node_volume) {
            let mut value = vec![0.0; star.nodes.len()];
            value[0] = 1.0;
            body.points.stencils.push_with_gradient(&star.nodes, &value, &star.gradient);
            body.points.volume.push(*v);
        }
        body.points.stars = Some(Penalty::new(spec.residual_penalty, &stars, points, &node_volume));
        Ok(body)
    }

    /// Every node's share of the surface as an outward area vector [m²] `[N]`: what a constant stress pulls at it with.
    pub fn outward_areas(&self) -> Vec<DVec3> {
        let mut areas = vec![DVec3::ZERO; self.nodes.len()];
        self.pieces().for_each(|(patch, s)| s.spread(patch.area * patch.normal, &mut areas));
        areas
    }
}

#[cfg(test)]
mod tests;
