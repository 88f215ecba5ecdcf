//! Markers and tracked points: where the body carries them, minus where they were seen. A marker is carried rigidly by the surface point
//! that it is attached to, also on a stalk; a tracked point has no stalk.

use super::{Along, Cost, Look, Residuals, Sums};
use glam::{DMat3, DVec3};
use palpate_engine::{Misfit, ReadingResidual, ResidualRow, Source};
use palpate_model::mechanics::rotation::{Polar, cross_matrix};
use palpate_model::observation::{MarkerSite, ObservedMarker};
use palpate_model::space::body::Body;
use std::borrow::Cow;
use std::sync::Arc;

/// The cost.
#[derive(Debug)]
pub struct Markers;

impl Cost for Markers {
    fn compare(&self, look: Look, u: &[DVec3], sums: &mut Sums) -> Arc<dyn Residuals> {
        let off = |m: &ObservedMarker| carry(look, m, u).1.position - m.position;
        let off: Vec<DVec3> = look.seen().markers.iter().map(off).collect();
        look.seen().markers.iter().zip(&off).for_each(|(m, r)| sums.add_vector(*r, noise(look, m)));
        Arc::new(Offsets { off })
    }
}

/// Residual of every marker and tracked point [m].
#[derive(Debug)]
struct Offsets {
    off: Vec<DVec3>,
}

impl Offsets {
    fn pairs<'a>(&'a self, look: Look<'a>) -> impl Iterator<Item = (&'a ObservedMarker, DVec3)> {
        look.seen().markers.iter().zip(self.off.iter().copied())
    }
}

impl Residuals for Offsets {
    fn readings(&self, look: Look) -> Vec<ReadingResidual> {
        let reading = |(m, off): (&ObservedMarker, DVec3)| ReadingResidual {
            sensor: look.observation.sensor_of(m.site),
            item: m.site,
            place: m.position,
            misfit: Some(Misfit::Offset(off)),
        };
        self.pairs(look).map(reading).collect()
    }

    fn influences(&self, look: Look, scale: f64) -> Vec<f64> {
        let influence = |(m, off): (&ObservedMarker, DVec3)| {
            let factor = scale / (noise(look, m) * noise(look, m));
            (factor * off).to_array()
        };
        self.pairs(look).flat_map(influence).collect()
    }

    fn rows(&self, look: Look, u: &[DVec3], along: Along, visit: &mut dyn FnMut(ResidualRow, &[f64])) {
        let nodes = &look.plan.body.nodes;
        let mut d = vec![0.0; along.du.len()];
        for (m, off) in self.pairs(look) {
            let (site, carried) = carry(look, m, u);
            let moved: Vec<DVec3> = along.du.iter().map(|du| carried.tangent(&site, du)).collect();
            let rest = site.carry(|i| nodes[i]).0;
            for axis in 0..3u8 {
                let a = usize::from(axis);
                d.iter_mut().zip(&moved).for_each(|(d, v)| *d = v[a]);
                // Offsets of the marker lengthen its stalk.
                let places = look.sensors.marker_places(m.site);
                let direct: Vec<_> = places.flat_map(|at| (0..3).map(move |b| (at + b, b))).collect();
                let direct: Vec<_> = direct.into_iter().map(|(at, b)| (at, carried.by_stalk(b)[a])).collect();
                along.add_direct(&direct, &mut d);
                let source = Source { sensor: look.observation.sensor_of(m.site), item: m.site, axis };
                visit(ResidualRow::coordinate(look.frame, source, off[a], noise(look, m), rest), &d);
            }
        }
    }

    fn pull(&self, look: Look, u: &[DVec3], factors: &[f64], out: &mut [DVec3], theta: &mut [f64]) {
        for (m, f) in look.seen().markers.iter().zip(factors.chunks_exact(3)) {
            let (site, carried) = carry(look, m, u);
            let adj = DVec3::from_slice(f);
            carried.adjoint(&site, adj, out);
            for at in look.sensors.marker_places(m.site) {
                (0..3).for_each(|a| theta[at + a] += adj.dot(carried.by_stalk(a)));
            }
        }
    }
}

fn noise(look: Look, m: &ObservedMarker) -> f64 {
    look.observation.noise_in(look.seen(), look.observation.markers[m.site as usize].kind)
}

/// A marker's site as its offset has it, and the marker at displacement `u`.
fn carry<'a>(look: Look<'a>, m: &ObservedMarker, u: &[DVec3]) -> (Cow<'a, MarkerSite>, Carried) {
    let site = look.sensors.site(look.observation, m.site);
    let turns = site.stalk != DVec3::ZERO || look.sensors.marker_places(m.site).next().is_some();
    let carried = Carried::new(&look.plan.body, &site, u, turns);
    (site, carried)
}

/// A marker at one state.
pub struct Carried {
    /// Position of its centre [m].
    pub position: DVec3,
    /// What turns its stalk; none of a point without one.
    polar: Option<Polar>,
}

impl Carried {
    /// Where a site's marker is at displacement `u`; `turns` where its stalk, or the derivative by it, matters.
    pub fn new(body: &Body, site: &MarkerSite, u: &[DVec3], turns: bool) -> Carried {
        let (p, f) = site.carry(|i| body.nodes[i] + u[i]);
        let polar = turns.then(|| Polar::new(f));
        Carried { position: polar.as_ref().map_or(p, |polar| p + polar.r * site.stalk), polar }
    }

    /// Change of the position for a change `du` of the displacement.
    pub fn tangent(&self, site: &MarkerSite, du: &[DVec3]) -> DVec3 {
        let (dp, df) = site.carry(|i| du[i]);
        self.polar.as_ref().map_or(dp, |polar| dp + polar.r * polar.spin(df).cross(site.stalk))
    }

    /// Change of the position per metre that the stalk grows along rest axis `a`.
    pub fn by_stalk(&self, a: usize) -> DVec3 {
        self.polar.as_ref().map_or(DVec3::AXES[a], |polar| polar.r.col(a))
    }

    /// Adds the gradient by the displacement, given that by the position.
    pub fn adjoint(&self, site: &MarkerSite, adj: DVec3, out: &mut [DVec3]) {
        let Some(polar) = &self.polar else {
            site.stencil.get().spread(adj, out);
            return;
        };
        // adj·R(ω×s) = ω·(s × Rᵀadj), and w·ax(RᵀdF) = (R [w]×):dF with w = G⁻¹ (s × Rᵀadj).
        let w: DVec3 = polar.g_inv * site.stalk.cross(polar.r.transpose() * adj);
        let adj_f: DMat3 = polar.r * cross_matrix(w);
        for (k, &n) in site.stencil.nodes.iter().enumerate() {
            out[n as usize] += site.stencil.value[k] * adj + adj_f * site.stencil.gradient[k];
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
            let carried = Carried::new(&plan.body, site, &u, true).position - f * surface;
            assert!((carried.length() - stalk.length()).abs() < 1e-13, "{} m of {} m", carried.length(), stalk.length());
            assert!((carried - r * stalk).length() < 1e-13, "{carried} instead of {}", r * stalk);
            // Carried by F it would be a fifth longer.
            assert!((f * stalk).length() > 1.2 * stalk.length());
        }
    }
}
