//! Recordings by a simulator that shares nothing with palpate's own physics, and what the diagnosis says about them.
//!
//! Quadratic tetrahedra instead of cut cells, a neo-Hookean material instead of corotated linear elasticity, two-step backward
//! differentiation instead of the θ-scheme, clamps that hold nodes, a contact law of its own, sharp boundaries between materials: what a
//! diagnosis calls right here is no artefact of the simulator that it searches with.

mod body;
mod cases;
mod element;
mod integrator;
mod loads;
mod material;
mod matrix;
mod mesh;
mod recording;
mod report;
mod scenes;
#[cfg(test)]
mod tests;

use super::case::Outcome;
use crate::table;
use cases::Case;
use palpate::{Backend, DiagnoseOptions, Diagnosed, Error, diagnose};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::{Duration, Instant};

/// A number: the end of its path, the truth, what was found.
type Compared = (String, f64, Option<f64>);

/// What was hidden and what was found.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Independent {
    /// What the diagnosis said; `hidden` are the names that are right.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// The verdict that is right.
    pub expected: String,
    /// Numbers of what was named.
    pub numbers: Vec<Compared>,
    /// The free numbers of the scene as it is: path, truth, fitted.
    pub baseline: Vec<Compared>,
    /// Distance of recording and model, before and after, and what noise and grid explain after [m].
    pub distance: [f64; 3],
    /// Time that both recordings took [s].
    pub recording_seconds: f64,
}

impl Independent {
    /// 1 where verdict and name are right, ½ where a right name is said to be as good as what is named.
    pub fn score(&self) -> f64 {
        let right = |name: &String| self.outcome.hidden.contains(name);
        if self.outcome.hidden.is_empty() || self.outcome.named.is_empty() {
            return f64::from(u8::from(self.outcome.verdict == self.expected));
        }
        match self.outcome.named.first() {
            Some(first) if right(first) => 1.0,
            _ if self.outcome.indistinguishable.iter().any(right) => 0.5,
            _ => 0.0,
        }
    }
}

/// Runs the cases that are asked for (by name or by what should be named) and not known yet, saves after every case, and prints a report.
///
/// # Errors
/// Nothing fits the options, or a file cannot be read or written.
pub fn run(options: &super::Options) -> Result<(), String> {
    let path = table::root().join("bench").join("blind-independent.json");
    let asked = |c: &Case, name: &str| {
        c.name == name || c.scene == name || c.names.contains(&name) || c.name.split(' ').next() == Some(name)
    };
    let wants = |c: &Case| options.only.as_deref().is_none_or(|all| all.split(',').any(|name| asked(c, name.trim())));
    let wanted: Vec<Case> = cases::all().into_iter().filter(wants).collect();
    if wanted.is_empty() {
        let names: Vec<&str> = cases::all().iter().map(|c| c.name).collect();
        return Err(format!("no case fits; there are: {}", names.join(", ")));
    }
    let known = super::outcomes(&path, &wanted, options)?;
    report::print(&known.iter().collect::<Vec<_>>());
    println!("\nwritten to {}", path.display());
    Ok(())
}

impl super::Run for Case {
    type Kept = Independent;

    fn name(&self) -> &str {
        self.name
    }

    fn name_of(kept: &Independent) -> &str {
        &kept.outcome.name
    }

    fn line(kept: &Independent) -> String {
        report::line(kept)
    }

    fn run(&self, folder: &Path, budget: Duration, say: &mut (dyn FnMut(&str) + Send)) -> Independent {
        Case::run(self, folder, budget, say)
    }
}

impl Case {
    /// Runs the case in an empty folder; failures are outcomes too.
    fn run(&self, folder: &Path, budget: Duration, say: &mut (dyn FnMut(&str) + Send)) -> Independent {
        let names = self.names.iter().map(|n| n.to_string()).collect();
        let mut out = Independent {
            outcome: Outcome::new(self.name, self.scene, "independent", names),
            expected: self.verdict.into(),
            numbers: Vec::new(),
            baseline: Vec::new(),
            distance: [0.0; 3],
            recording_seconds: 0.0,
        };
        if let Err(e) = self.fill(&mut out, folder, budget, say) {
            out.outcome.sentence = e.to_string();
        }
        out
    }

    fn fill(
        &self,
        out: &mut Independent,
        folder: &Path,
        budget: Duration,
        say: &mut (dyn FnMut(&str) + Send),
    ) -> Result<(), Error> {
        let scene = scenes::scene(self.scene).ok_or_else(|| Error::Input(format!("{}: no such scene", self.scene)))?;
        let clock = Instant::now();
        // The same noise whatever else is in the list.
        let seed = self.name.bytes().fold(7u64, |s, b| s.wrapping_mul(31).wrapping_add(u64::from(b)));
        say("recordings");
        let seen = recording::observed(scene, &self.truth, seed, &folder.join("seen"), false)?;
        let other = recording::observed(scene, &self.truth, seed.wrapping_add(1), &folder.join("other"), true)?;
        out.recording_seconds = clock.elapsed().as_secs_f64();
        let options = DiagnoseOptions {
            backend: Backend::Cpu,
            budget: Some(budget),
            on_progress: Some(&mut *say),
            ..DiagnoseOptions::default()
        };
        let found = diagnose(&[seen], Some(&other), options)?;
        out.outcome.answer(&found);
        let d = &found.diagnosis;
        out.distance = [d.before.rms, d.after.rms, d.after.noise];
        let truth = |path: &str| match path {
            "material.youngs_modulus" => scene.setup.truth(false).map(|s| s.material.youngs_modulus).ok(),
            "material.stiffness_damping" => scene.setup.truth(false).map(|s| s.material.stiffness_damping).ok(),
            _ => None,
        };
        let values = d.baseline.numbers.iter().zip(&d.baseline.values);
        out.baseline = values.filter_map(|(n, v)| Some((n.path.clone(), truth(&n.path)?, Some(*v)))).collect();
        self.compare(out, &found);
        Ok(())
    }

    /// Numbers of the right effect, where it was named.
    fn compare(&self, out: &mut Independent, found: &Diagnosed) {
        let mut effects = found.diagnosis.effects.iter().filter(|e| e.accepted);
        let Some(effect) = effects.find(|e| self.names.contains(&e.kind.as_str())) else { return };
        let end =
            |path: &str| path.strip_prefix("effect.").and_then(|p| p.split_once('.')).map_or(path.to_string(), |p| p.1.into());
        let value = |name: &str| effect.parameters.iter().find(|p| end(&p.0) == name).map(|p| p.1);
        let all: Vec<Compared> = self.numbers.iter().map(|(name, t)| (name.to_string(), *t, value(name))).collect();
        // What goes by another name has other numbers.
        if all.iter().any(|n| n.2.is_some()) {
            let size: f64 = all.iter().map(|n| n.1 * n.1).sum();
            let off = |sign: f64| all.iter().map(|n| (sign * n.2.unwrap_or(0.0) - n.1).powi(2)).sum::<f64>();
            let off = if self.mirrored { off(1.0).min(off(-1.0)) } else { off(1.0) };
            out.outcome.parameter_error = (size > 0.0).then(|| (off / size).sqrt());
            out.numbers = all;
        }
    }
}
