//! What is evaluated: scenes of `bench/same`, put together from their files, each with what is seen of it.

use super::watch::{Seen, watched};
use crate::table;
use palpate::Experiment;
use palpate_io::parse_scene;
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;

/// A scene and what is seen of it.
pub struct Case {
    /// Name, in the file of hashes as well.
    pub name: &'static str,
    /// Files of `bench/same` without their ending, one behind the other; none for the README's first fit.
    parts: &'static [&'static str],
    /// Texts of the files that are replaced.
    changes: &'static [(&'static str, &'static str)],
    /// What is seen, and when [s].
    seen: (Seen, &'static [f64]),
    /// Simulations in one batch, around the scene's own values.
    pub members: usize,
}

/// No frame lies on a step boundary, and none coincides with another scheme's stages.
const THREE: &[f64] = &[0.025, 0.0437, 0.06];

const fn case(name: &'static str, parts: &'static [&'static str], seen: Seen, times: &'static [f64]) -> Case {
    Case { name, parts, changes: &[], seen: (seen, times), members: 1 }
}

const fn changed(case: Case, changes: &'static [(&'static str, &'static str)]) -> Case {
    Case { changes, ..case }
}

/// All cases. Each covers something that no other does; bodies have some 60 to 800 nodes, motions at most ten steps.
pub const CASES: [Case; 16] = [
    case("fall", &["fall"], Seen::Points, &[0.031, 0.055, 0.079]),
    case("bounce", &["bounce"], Seen::Both, THREE),
    changed(case("bounce, theta 0.6", &["bounce"], Seen::Both, THREE), &[("theta = 0.5", "theta = 0.6")]),
    Case { members: 3, ..case("batch", &["bounce"], Seen::Both, THREE) },
    case("swing", &["swing"], Seen::Markers, &[0.0, 0.0217, 0.041, 0.0633]),
    case("hang", &["hang"], Seen::Both, &[0.0]),
    case("spin", &["spin"], Seen::Nodes, THREE),
    changed(case("spin, trilinear", &["spin"], Seen::Nodes, THREE), &[("\"enhanced\"", "\"trilinear\"")]),
    changed(case("spin, corner", &["spin"], Seen::Nodes, THREE), &[("\"enhanced\"", "\"corner\"")]),
    case("block, two levels", &["block"], Seen::Points, &[0.013, 0.027]),
    changed(
        case("block, cholesky", &["block"], Seen::Points, &[0.013, 0.027]),
        &[("\"cg\"", "\"cholesky\""), ("= 0.49\n", "= 0.499\n"), ("0.0125", "0.02")],
    ),
    changed(
        case("effects on contact and loads", &["bounce", "effects-contact", "effects-loads"], Seen::Both, THREE),
        &[("theta = 0.5", "theta = 0.55")],
    ),
    case("effects of the material", &["bounce", "effects-material"], Seen::Both, THREE),
    case("effects of supports", &["swing", "effects-supports"], Seen::Markers, &[0.0, 0.0217, 0.041]),
    case("effects of sensors", &["bounce", "effects-sensors"], Seen::Both, THREE),
    changed(
        case("first fit", &[], Seen::Points, &[]),
        &[
            ("cells = 16", "cells = 9"),
            ("= 0.0075", "= 0.01"),
            ("starts     = 3", "starts     = 2"),
            ("= 20\n", "= 4\n"),
            ("[fit]", "pixel_stride = 2\n[fit]"),
        ],
    ),
];

impl Case {
    /// True for the case that is also fitted.
    pub fn is_fitted(&self) -> bool {
        self.parts.is_empty()
    }

    /// The experiment of a case that reads its recording from files.
    ///
    /// # Errors
    /// A file is missing or wrong.
    pub fn experiment(&self) -> Result<Experiment, String> {
        let path = table::root().join("assets/scenes/first-fit.toml");
        let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Experiment::from_toml(&self.replaced(text)?, &path).map_err(|e| e.to_string())
    }

    /// What a backend gets.
    ///
    /// # Errors
    /// A file is missing or wrong.
    pub fn plan(&self) -> Result<Plan, String> {
        if self.is_fitted() {
            return Ok(self.experiment()?.plan().clone());
        }
        let folder = table::root().join("bench/same");
        let mut text = String::new();
        for part in self.parts {
            let path = folder.join(format!("{part}.toml"));
            text += &std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        }
        let scene =
            parse_scene(&self.replaced(text)?, folder.join(format!("{}.toml", self.parts[0]))).map_err(|e| e.to_string())?;
        watched(&scene.value, self.seen.0, self.seen.1).map_err(|e| format!("{}: {e}", self.name))
    }

    /// A change that changes nothing would be taken for a case of its own.
    fn replaced(&self, mut text: String) -> Result<String, String> {
        for (old, new) in self.changes {
            if !text.contains(old) {
                return Err(format!("{}: its files have no \"{old}\"", self.name));
            }
            text = text.replace(old, new);
        }
        Ok(text)
    }

    /// θ of every member: the scene's own values first, then others.
    pub fn members(&self, plan: &Plan) -> Vec<Vec<f64>> {
        let varied = |b: usize| {
            let s = b as f64;
            let value = |(key, value): (&ParamKey, &f64)| match key.spec().path.as_ref() {
                "material.youngs_modulus" => value * (1.0 + 0.5 * s),
                "material.poisson_ratio" => value - 0.03 * s,
                "material.stiffness_damping" => value / (1.0 + s),
                "world.gravity.z" => value - 0.2 * s,
                _ => *value,
            };
            plan.layout.keys.iter().zip(&plan.theta).map(value).collect()
        };
        (0..self.members).map(varied).collect()
    }
}
