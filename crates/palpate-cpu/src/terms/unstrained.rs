//! The stress-free shape X + W as elastic points see it. With G = I + ∇W a point's deformation is F̂ = F G⁻¹ = Σ x ⊗ ĝ of gradients
//! ĝ = G⁻ᵀ g, and it stands for the volume det(G) V: the body is the one whose nodes rest at X + W.
//!
//! When the shape moves by δW, L = Σ δW ⊗ ĝ, a state's F̂ changes by −F̂ L, gradients by −Lᵀ ĝ and volumes by their tr(L)th part. So a force V P ĝ of
//! each node changes by V [tr(L) P + δP − P Lᵀ] ĝ, where δP is what −F̂ L of all states makes of P.

use super::elastic_points::contract;
use glam::{DMat3, DVec3};
use palpate_model::space::points::Points;
use palpate_model::space::stencil::Stencils;

/// Elastic points as they are in the stress-free shape.
#[derive(Clone, Debug, Default)]
pub struct Unstrained {
    /// Places and gradients ĝ of the points.
    pub stencils: Stencils,
    /// Volumes [m³]; one that is not positive says that the shape is folded there.
    pub volume: Vec<f64>,
    /// Σ (X + W) ⊗ ĝ less Σ X ⊗ ĝ of every point: what displacements have to be less than to be measured from this shape.
    pub shift: Vec<DMat3>,
}

impl Unstrained {
    /// The points at W `[N]` [m].
    pub fn new(points: &Points, w: &[DVec3]) -> Unstrained {
        let mut out = Unstrained::default();
        for ((s, v), (back, swelling)) in points.stencils.iter().zip(&points.volume).zip(points.unstrained(w)) {
            let turned: Vec<DVec3> = s.gradient.iter().map(|g| back.transpose() * *g).collect();
            out.stencils.push_with_gradient(s.nodes, s.value, &turned);
            out.volume.push(v * swelling);
            out.shift.push(DMat3::IDENTITY - back);
        }
        out
    }

    /// True where a point's material would be inside out without a load.
    pub fn is_folded(&self) -> bool {
        self.volume.iter().any(|v| v.is_nan() || *v <= 0.0)
    }
}

/// Change of a stress P with the shape, of which `change` is δP.
pub fn moved(l: DMat3, p: DMat3, change: DMat3) -> DMat3 {
    p * (l.x_axis.x + l.y_axis.y + l.z_axis.z) + change - p * l.transpose()
}

/// The transpose: M with M : L = Z : [tr(L) P + δP − P Lᵀ]. `pulled` lists F̂ of every state and what the transpose of ∂P/∂F̂ makes of Z.
pub fn pulled(z: DMat3, p: DMat3, pulled: impl Iterator<Item = (DMat3, DMat3)>) -> DMat3 {
    let states: DMat3 = pulled.map(|(f, d)| f.transpose() * d).sum();
    DMat3::IDENTITY * contract(p, z) - z.transpose() * p - states
}
