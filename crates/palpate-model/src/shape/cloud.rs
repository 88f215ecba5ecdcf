//! The surface around a cloud of points that fills a body: balls around all points, closed and drawn in again, by a signed distance on a lattice.
//!
//! Balls of a radius that leaves no holes are joined. Their surface is moved inwards until the volume is right: the one stated, or the one at which the
//! points lie half of their own spacing within it, where each stands for a cube of that edge.

use super::marching::Field;
use super::{MeshShape, Shape, TriMesh};
use crate::shape::components::components;
use crate::space::stars::near::{Near, spacing};
use glam::DVec3;
use rayon::prelude::*;

/// Radius of the balls in distances of third neighbours: holes of a lattice whose points are moved by a quarter of its edge are filled.
const BALL: f64 = 1.6;
/// Points of the lattice along such a distance.
const FINE: f64 = 2.0;
/// Most points of the lattice.
const MOST: f64 = 2e7;
/// Least distance of vertices from points of the lattice, in edges: no slivers.
const LEAST: f64 = 0.05;
/// Halvings of the bracket around the distance that gives the right volume.
const HALVINGS: usize = 30;

/// A closed surface around points [m], with the volume [m³] where one is stated.
///
/// # Errors
/// Points of several bodies, a volume that they cannot fill, or too many cubes.
pub fn around(points: &[DVec3], volume: Option<f64>) -> Result<TriMesh, String> {
    let third = spacing(points);
    let radius = BALL * third;
    let edge = third / FINE;
    let margin = DVec3::splat(radius + 2.0 * edge);
    let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min) - margin;
    let high = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max) + margin;
    let size = ((high - low) / edge).to_array().map(|n| n.ceil() as usize + 1);
    let all = size.iter().map(|n| *n as f64).product::<f64>();
    if all > MOST {
        return Err(format!(
            "are {} points about {third:.3e} m apart in a box that would take {all:.1e} cubes, at most {MOST:.0e}; are there points far away from the rest?",
            points.len()
        ));
    }
    let near = Near::new(points, third);
    let mut balls = Field { low, edge, size, values: Vec::new() };
    let far = |x: DVec3| near.nearest(x, 1).first().map_or(f64::INFINITY, |n| n.0) - radius;
    balls.values = (0..all as usize).into_par_iter().with_min_len(1024).map(|n| far(balls.place(n))).collect();
    fill_cavities(&mut balls);
    let outer = balls.surface(LEAST);
    let bodies = components(&outer.triangles, outer.vertices.len()).1;
    if bodies != 1 {
        return Err(format!(
            "are of {bodies} bodies: gaps of more than {:.3e} m separate them, twice {BALL} times the distance of neighbours; give one body, without stray points",
            2.0 * radius
        ));
    }
    let shape = MeshShape::new(outer);
    let depth = |n: usize| if balls.values[n] > 0.0 { balls.values[n] } else { shape.signed_distance(balls.place(n)) };
    let depths: Vec<f64> = (0..balls.values.len()).into_par_iter().with_min_len(1024).map(depth).collect();
    let drawn_in = |offset: f64| {
        let values = depths.iter().map(|d| d + radius - offset).collect();
        Field { low, edge, size, values }.surface(LEAST)
    };
    let excess = |offset: f64| {
        let cubes = points.len() as f64 * (2.0 * offset).powi(3);
        drawn_in(offset).volume() - volume.unwrap_or(cubes)
    };
    // Where the volume is stated it grows with the offset; else cubes grow faster than it.
    let sign = if volume.is_some() { 1.0 } else { -1.0 };
    let (mut from, mut to) = (if volume.is_some() { -0.4 * third } else { 0.1 * third }, radius);
    if sign * excess(from) > 0.0 || sign * excess(to) < 0.0 {
        let [least, most] = [from, to].map(|o| drawn_in(o).volume());
        return Err(match volume {
            Some(v) => format!(
                "volume = {v} m³ is not what these points fill: {least:.3e} to {most:.3e} m³ are possible; check the unit of points and volume"
            ),
            None => "are too thin a body for a surface around it: give volume, or mesh or shape beside the points".to_string(),
        });
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (from + to);
        if sign * excess(middle) < 0.0 { from = middle } else { to = middle }
    }
    let mesh = drawn_in(0.5 * (from + to));
    match components(&mesh.triangles, mesh.vertices.len()).1 {
        1 => Ok(mesh),
        _ => Err("are too thin a body for a surface around it: give mesh or shape beside the points".into()),
    }
}

/// What no way from the border reaches becomes inside.
fn fill_cavities(field: &mut Field) {
    let mut open: Vec<usize> = (0..field.values.len()).filter(|n| field.is_border(*n)).collect();
    let mut reached = vec![false; field.values.len()];
    open.iter().for_each(|n| reached[*n] = true);
    while let Some(n) = open.pop() {
        // Border points are all outside; their neighbours lie behind those within.
        let beside = if field.is_border(n) { field.inwards(n) } else { field.beside(n).to_vec() };
        for m in beside {
            if field.values[m] > 0.0 && !std::mem::replace(&mut reached[m], true) {
                open.push(m);
            }
        }
    }
    field.values.iter_mut().zip(reached).filter(|(v, r)| **v > 0.0 && !r).for_each(|(v, _)| *v = -*v);
}
