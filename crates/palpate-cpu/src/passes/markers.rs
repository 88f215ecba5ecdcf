//! Markers: carried rigidly by the surface point that they are attached to, also on a stalk.

use glam::{DMat3, DVec3};
use palpate_model::mechanics::rotation::{Polar, cross_matrix};
use palpate_model::observation::MarkerSite;
use palpate_model::space::body::Body;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::collapse_tests::scene;
    use palpate_model::observation::{MarkerRest, Observation};
    use palpate_model::plan::build::build_plan;
    use palpate_model::scene::{Analytic, BodySource};

    #[test]
    fn a_stalk_is_turned_but_neither_stretched_nor_sheared() {
        let mut scene = scene(5e4);
        let (min, max) = (DVec3::new(0.0, 0.0, 0.1), DVec3::new(0.1, 0.06, 0.16));
        scene.object.source = BodySource::Analytic(Analytic::Box { min, max });
        let (surface, stalk) = (DVec3::new(0.05, 0.03, 0.16), DVec3::new(0.003, -0.004, 0.012));
        let rest = MarkerRest { name: "m".into(), position: surface + stalk, surface: Some(surface) };
        let plan = build_plan(&scene, Observation::default(), &[rest]).unwrap();
        let site = &plan.observation.markers[0];
        // A stretch along skew axes, thirty per cent and more, and then a turn: the polar decomposition takes F = R S apart again.
        let stretch = DMat3::from_cols(DVec3::new(1.3, 0.2, -0.1), DVec3::new(0.2, 0.8, 0.15), DVec3::new(-0.1, 0.15, 1.4));
        let turn = DMat3::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), 1.1);
        for r in [DMat3::IDENTITY, turn] {
            let f = r * stretch;
            let u: Vec<DVec3> = plan.body.nodes.iter().map(|x| f * *x - *x).collect();
            let carried = Carried::new(&plan.body, site, &u).position - f * surface;
            assert!((carried.length() - stalk.length()).abs() < 1e-13, "{} m of {} m", carried.length(), stalk.length());
            assert!((carried - r * stalk).length() < 1e-13, "{carried} instead of {}", r * stalk);
            // Carried by F it would be a fifth longer.
            assert!((f * stalk).length() > 1.2 * stalk.length());
        }
    }
}
