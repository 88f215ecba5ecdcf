//! Markers: carried rigidly by the surface point that they are attached to, also on a stalk.

use glam::{DMat3, DVec3};
use palpate_model::body::Body;
use palpate_model::observation::MarkerSite;
use palpate_model::rotation::{Polar, cross_matrix};

/// A marker at one state.
pub struct Carried {
    /// Position of its centre [m].
    pub position: DVec3,
    polar: Polar,
}

impl Carried {
    /// Where a site's marker is at displacement `u`.
    pub fn new(body: &Body, site: &MarkerSite, u: &[DVec3]) -> Carried {
        let (p, f) = site.carry(|i| body.nodes[i] + u[i]);
        let polar = Polar::new(f);
        Carried { position: p + polar.r * site.stalk, polar }
    }

    /// Change of the position for a change `du` of the displacement.
    pub fn tangent(&self, site: &MarkerSite, du: &[DVec3]) -> DVec3 {
        let (dp, df) = site.carry(|i| du[i]);
        dp + self.polar.r * self.polar.spin(df).cross(site.stalk)
    }

    /// Change of the position per metre that the stalk grows along rest axis `a`.
    pub fn by_stalk(&self, a: usize) -> DVec3 {
        self.polar.r.col(a)
    }

    /// Adds the gradient by the displacement, given that by the position.
    pub fn adjoint(&self, site: &MarkerSite, adj: DVec3, out: &mut [DVec3]) {
        // adj·R(ω×s) = ω·(s × Rᵀadj), and w·ax(RᵀdF) = (R [w]×):dF with w = G⁻¹ (s × Rᵀadj).
        let w: DVec3 = self.polar.g_inv * site.stalk.cross(self.polar.r.transpose() * adj);
        let adj_f: DMat3 = self.polar.r * cross_matrix(w);
        for (k, &n) in site.nodes.iter().enumerate() {
            out[n as usize] += site.position_weights[k] * adj + adj_f * site.gradient_weights[k];
        }
    }
}
