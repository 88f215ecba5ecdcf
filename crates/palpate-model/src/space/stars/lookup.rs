//! Which points of a cloud carry a place: the affine field that fits the points around it best, which passes through a point that lies there.

use super::near::Near;
use crate::cutcells::extension::AffineFit;
use crate::cutcells::shadow::InCubes;
use crate::space::body::Body;
use crate::space::stencil::StencilBuf;
use glam::DVec3;

/// Radius of the fit's kernel, in spacings.
const RADIUS: f64 = 2.0;
/// How near a point draws the field to its own value, in spacings.
const OWN: f64 = 0.5;

/// Finds the points that carry a place.
pub struct StarLookup<'a> {
    body: &'a Body,
    near: InCubes<'a>,
    nodes: Near,
    /// Places of the surface's patches.
    surface: Near,
}

impl<'a> StarLookup<'a> {
    /// Sorts points and patches.
    pub fn new(body: &'a Body) -> StarLookup<'a> {
        let places: Vec<DVec3> = body.patches.iter().map(|p| p.point).collect();
        let [nodes, surface] = [&body.nodes, &places].map(|x| Near::new(x, body.length));
        StarLookup { body, near: InCubes::new(body), nodes, surface }
    }

    /// Weights and gradients of the points around a place, and how far outside the body it is [m], zero inside; no number where the place is none.
    pub fn carry(&self, place: DVec3) -> (StencilBuf, f64) {
        let nearest = self.nodes.nearest(place, 1).first().copied();
        let radius = RADIUS * self.body.length;
        // Beyond the kernel's reach the field of the nearest point goes on: a place may be anywhere, whoever asks refuses those far away.
        let near = nearest.is_some_and(|n| n.0 <= radius);
        let center = if near { place } else { self.body.nodes[nearest.map_or(0, |n| n.1 as usize)] };
        let fit = AffineFit::new(self.body, &self.near, center, radius);
        let mut s = StencilBuf { value: fit.value(place), gradient: fit.gradient(), nodes: fit.nodes.clone() };
        if let Some((distance, nearest)) = nearest {
            // What is added has no affine part, so that affine motion stays exact.
            let pull = (1.0 - (distance / (OWN * self.body.length)).powi(2)).max(0.0).powi(2);
            let there = fit.value(self.body.nodes[nearest as usize]);
            if let Some(k) = s.nodes.iter().position(|n| *n == nearest).filter(|_| pull > 0.0) {
                s.value.iter_mut().zip(there).for_each(|(w, other)| *w -= pull * other);
                s.value[k] += pull;
            }
        }
        (s, self.outside(place))
    }

    fn outside(&self, place: DVec3) -> f64 {
        if !place.is_finite() {
            return f64::NAN;
        }
        let nearest = self.surface.nearest(place, 1).first().map(|n| &self.body.patches[n.1 as usize]);
        nearest.map_or(0.0, |patch| (place - patch.point).dot(patch.normal).max(0.0))
    }
}
