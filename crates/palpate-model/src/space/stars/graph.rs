//! Stars: who is whose neighbour, and the least-squares weights of the deformation gradient (Müller, Keiser, Nealen, Pauly, Gross & Alexa, Point based
//! animation of elastic, plastic and melting objects, 2004).
//!
//! With d_ij = X_j − X_i and weights w_ij, M_i = Σ_j w_ij d_ij d_ijᵀ and G_ij = w_ij M_i⁻¹ d_ij, G_ii = −Σ_j G_ij. F_i = Σ_j y_j G_ijᵀ is exact for affine fields.

use super::near::Near;
use crate::materials::principal_stretch::eigen;
use crate::shape::Shape;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Most neighbours of a point.
pub const MOST: usize = 24;
/// Largest condition of M: beyond it neighbours lie almost in a plane, and are joined by more.
const WORST: f64 = 100.0;
/// Radius of the weights' kernel, in distances of the farthest neighbour.
const KERNEL: f64 = 1.5;
/// How far outside the shape the middle between two neighbours may lie, in spacings: across a gap they are no neighbours.
const OUTSIDE: f64 = 0.25;

/// A point with its neighbours.
#[derive(Clone, Debug)]
pub struct Star {
    /// The point itself, then its neighbours, nearest first.
    pub nodes: Vec<u32>,
    /// G of them [1/m].
    pub gradient: Vec<DVec3>,
    /// Kernel weights of the neighbours alone, which sum to one.
    pub kernel: Vec<f64>,
}

/// The star of every point, of so many neighbours and more where these lie almost in a plane.
///
/// # Errors
/// Points whose neighbours lie in a plane however many there are, or several parts that are no neighbours.
pub fn stars(points: &[DVec3], near: &Near, shape: &dyn Shape, neighbours: usize, spacing: f64) -> Result<Vec<Star>, String> {
    let of = |i: usize| {
        let x = points[i];
        let seen = |n: &u32| shape.signed_distance(0.5 * (x + points[*n as usize])) < OUTSIDE * spacing;
        let others = near.nearest(x, MOST + 1).into_iter().map(|n| n.1).filter(|n| *n as usize != i);
        let candidates: Vec<u32> = others.filter(seen).collect();
        (neighbours.min(candidates.len())..=candidates.len()).find_map(|k| star(points, i as u32, &candidates[..k]))
    };
    let all: Vec<Option<Star>> = (0..points.len()).into_par_iter().map(of).collect();
    let flat: Vec<usize> = (0..all.len()).filter(|i| all[*i].is_none()).collect();
    if let Some(first) = flat.first() {
        return Err(format!(
            "{} of {} points have all their neighbours in about one plane or line, point {first} at {} m first; stars need points on all sides: give \
             at least two, better four layers of points through the thickness, or discretisation = \"cells\"",
            flat.len(),
            points.len(),
            points[*first]
        ));
    }
    let all: Vec<Star> = all.into_iter().flatten().collect();
    let parts = parts(&all);
    if parts.len() > 1 {
        let sizes: Vec<String> = parts.iter().take(6).map(usize::to_string).collect();
        return Err(format!(
            "falls into {} parts that are no neighbours, of {} points{}; give one body, without stray points",
            parts.len(),
            sizes.join(", "),
            if parts.len() > 6 { " and so on" } else { "" }
        ));
    }
    Ok(all)
}

/// A star with published weights; `None` where the neighbours lie almost in a plane.
fn star(points: &[DVec3], i: u32, neighbours: &[u32]) -> Option<Star> {
    let x = points[i as usize];
    let arms: Vec<DVec3> = neighbours.iter().map(|n| points[*n as usize] - x).collect();
    let reach = KERNEL * arms.iter().map(|d| d.length()).fold(0.0, f64::max);
    let kernel: Vec<f64> = arms.iter().map(|d| (1.0 - d.length_squared() / (reach * reach)).powi(3)).collect();
    let mut moment = DMat3::ZERO;
    for (d, w) in arms.iter().zip(&kernel) {
        moment += DMat3::from_cols(*d * d.x, *d * d.y, *d * d.z) * *w;
    }
    let values = eigen(std::array::from_fn(|r| std::array::from_fn(|c| moment.col(c)[r]))).0;
    let (least, most) = values.iter().fold((f64::INFINITY, 0.0f64), |(a, b), v| (a.min(*v), b.max(*v)));
    let spread = least * WORST > most;
    if neighbours.len() < 3 || !spread {
        return None;
    }
    let inverse = moment.inverse();
    let mut gradient: Vec<DVec3> = arms.iter().zip(&kernel).map(|(d, w)| inverse * *d * *w).collect();
    gradient.insert(0, -gradient.iter().copied().sum::<DVec3>());
    let nodes = std::iter::once(i).chain(neighbours.iter().copied()).collect();
    let whole: f64 = kernel.iter().sum();
    Some(Star { nodes, gradient, kernel: kernel.iter().map(|w| w / whole).collect() })
}

/// Sizes of the parts that hang together, the largest first.
fn parts(stars: &[Star]) -> Vec<usize> {
    let mut links: Vec<Vec<u32>> = vec![Vec::new(); stars.len()];
    for star in stars {
        for n in &star.nodes[1..] {
            links[star.nodes[0] as usize].push(*n);
            links[*n as usize].push(star.nodes[0]);
        }
    }
    let (mut seen, mut sizes) = (vec![false; stars.len()], Vec::new());
    for first in 0..stars.len() {
        if std::mem::replace(&mut seen[first], true) {
            continue;
        }
        let (mut open, mut size) = (vec![first as u32], 0);
        while let Some(i) = open.pop() {
            size += 1;
            for n in &links[i as usize] {
                if !std::mem::replace(&mut seen[*n as usize], true) {
                    open.push(*n);
                }
            }
        }
        sizes.push(size);
    }
    sizes.sort_unstable_by(|a, b| b.cmp(a));
    sizes
}
