//! Normals of planes of which an angle was free: angles are measured from an axis that follows from the scene, a direction speaks for itself.

use super::{FreeNumber, specs};
use crate::experiment::Experiment;
use crate::results::fit::FoundNormal;
use palpate_engine::number;
use palpate_fit::FitResult;
use palpate_model::params::ParamKey;

/// The normals of all scenes' planes whose angles were free, on the scenes' own cells.
pub(super) fn found(experiments: &[Experiment], free: &[FreeNumber], result: &FitResult) -> Vec<FoundNormal> {
    let mut out = Vec::new();
    for (s, e) in experiments.iter().enumerate() {
        let plan = e.plan();
        for (i, site) in plan.planes.iter().enumerate() {
            let keys = [ParamKey::PlaneTheta(i as u16), ParamKey::PlanePhi(i as u16)];
            let own = |path: &str| free.iter().position(|n| n.path == path && n.scene.is_none_or(|own| own == s));
            let named = |path: &str| specs(e).is_some_and(|f| f.parameters.iter().any(|p| p.path == path));
            let places = keys.map(|k| Some(k.spec().path).filter(|p| named(p)).and_then(|p| own(&p)));
            if places == [None; 2] {
                continue;
            }
            let [theta, phi] = keys.map(|k| result.theta[s][plan.layout.index(k)]);
            // On the sphere a step of φ is sin θ as long as one of θ; across each other their errors add as squares.
            let lengths = [1.0, theta.sin()];
            let errors =
                places.iter().zip(lengths).filter_map(|(p, l)| p.map(|p| result.parameters[p].standard_error.map(|e| e * l)));
            out.push(FoundNormal {
                path: format!("plane.{i}.normal"),
                scene: s,
                // Adding zero turns −0 into 0.
                normal: site.normal(theta, phi)[0].to_array().map(|x| x + 0.0),
                standard_error: errors.collect::<Option<Vec<f64>>>().map(|e| e.iter().map(|x| x * x).sum::<f64>().sqrt()),
            });
        }
    }
    out
}

impl FoundNormal {
    /// In a line, of one of so many scenes.
    pub fn line(&self, scenes: usize) -> String {
        let [x, y, z] = self.normal.map(|x| number((x * 1e5).round() / 1e5));
        let error =
            self.standard_error.map_or(String::new(), |e| format!(" ± {} rad", number(format!("{e:.1e}").parse().unwrap_or(e))));
        let of = if scenes > 1 { format!(" of scene {}", self.scene + 1) } else { String::new() };
        format!("{}{of} = ({x}, {y}, {z}){error}", self.path)
    }
}
