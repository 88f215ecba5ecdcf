//! Free numbers of one or several experiments: what is shared, where each acts.

use super::specs;
use crate::error::Error;
use crate::experiment::Experiment;
use palpate_fit::{FieldPrior, FreeParameter, Mean, Slot};
use palpate_model::params::fields::Prior;
use palpate_model::params::{ParamKey, Transform};
use std::sync::Arc;

/// One free number, or field, of a fit over one or several scenes.
#[derive(Clone, Debug, PartialEq)]
pub struct FreeNumber {
    /// Path in the scene file.
    pub path: String,
    /// The scene it belongs to; `None` when all scenes that name it share it.
    pub scene: Option<usize>,
}

impl FreeNumber {
    /// Path, with the number of its scene (from 1) where it is not shared.
    pub fn label(&self) -> String {
        self.scene.map_or_else(|| self.path.clone(), |s| format!("{} [scene {}]", self.path, s + 1))
    }
}

/// A number or field that reaches θ: its first place with θ per unit, and how many values it has.
fn slot(experiment: &Experiment, scene: usize, path: &str) -> Option<(ParamKey, Slot, usize)> {
    let plan = experiment.plan();
    // The mass of the body is its density times its volume on the grid.
    let (path, factor) = if path == "material.mass" { ("material.density", 1.0 / plan.body.volume) } else { (path, 1.0) };
    let places = plan.layout.resolve(path);
    let key = plan.layout.keys.get(places.start).filter(|_| !places.is_empty())?;
    Some((*key, Slot { scene, place: places.start, factor }, places.len()))
}

/// The field that a path stands for as a whole, with its prior.
fn with_prior(e: &Experiment, path: &str) -> Option<(usize, Prior)> {
    let field = path.strip_prefix("field.")?.parse::<usize>().ok()?;
    Some((field, e.scene().fields.get(field)?.prior?))
}

/// The prior of a field as the fit sees it. Where the number that the field varies is free as well, or another field varies it, that holds
/// the mean.
fn prior(e: &Experiment, path: &str) -> Option<FieldPrior> {
    let (field, prior) = with_prior(e, path)?;
    let fields = &e.scene().fields;
    let varied = fields[field].varied;
    let of_same = |i: usize| fields.get(i).is_some_and(|f| f.varied == varied);
    let holds_mean = |other: &str| {
        let number = other == varied.path() || (other == "material.mass" && varied.path() == "material.density");
        let before = other.strip_prefix("field.").and_then(|r| r.split('.').next()?.parse::<usize>().ok());
        number || before.is_some_and(|i| i < field && of_same(i))
    };
    let mean = match specs(e).iter().flat_map(|f| &f.parameters).any(|p| holds_mean(&p.path)) {
        true => Mean::Zero,
        false => Mean::Free,
    };
    let around = Arc::new(fields[field].neighbours(&e.plan().body)?);
    Some(FieldPrior { around, kind: prior.kind, length: prior.length, deviation: prior.deviation, mean })
}

type Free = (Vec<FreeNumber>, Vec<FreeParameter>, Vec<String>);

/// The free numbers of the experiments, how the fit sees them, and warnings.
///
/// # Errors
/// A path that is no number of its scene, or shared parameters that disagree.
pub(crate) fn free_parameters(experiments: &[Experiment]) -> Result<Free, Error> {
    let (mut numbers, mut free): (Vec<FreeNumber>, Vec<FreeParameter>) = (Vec::new(), Vec::new());
    let mut warnings = Vec::new();
    for (scene, e) in experiments.iter().enumerate() {
        let file = |s: usize| experiments[s].scene().path.as_path();
        for p in specs(e).iter().flat_map(|f| &f.parameters) {
            let (key, slot, count) = slot(e, scene, &p.path).ok_or_else(|| {
                Error::scene(file(scene), "fit.parameter", format!("\"{}\" is not a number of this scene", p.path))
            })?;
            let own = p.per_scene && experiments.len() > 1;
            let known = numbers.iter().position(|n| n.path == p.path && n.scene.is_none());
            if let (false, Some(k)) = (own, known) {
                let f = &mut free[k];
                if f.bounds != p.bounds || f.start != p.start {
                    let message = format!(
                        "has start [{}, {}] and bounds [{}, {}], {} has [{}, {}] and [{}, {}]; a shared parameter has the same in \
                         both, or say per_scene = true",
                        p.start.0,
                        p.start.1,
                        p.bounds.0,
                        p.bounds.1,
                        file(f.slots[0].scene).display(),
                        f.start.0,
                        f.start.1,
                        f.bounds.0,
                        f.bounds.1
                    );
                    return Err(Error::scene(file(scene), &p.path, message));
                }
                if f.known != p.known {
                    let text =
                        |k: Option<(f64, f64)>| k.map_or("no known value".into(), |(v, sd)| format!("known = [{v}, {sd}]"));
                    let message = format!(
                        "has {} here and {} in {}; a shared parameter has the same in both, or say per_scene = true",
                        text(p.known),
                        text(f.known),
                        file(f.slots[0].scene).display()
                    );
                    return Err(Error::scene(file(scene), &p.path, message));
                }
                if f.count != count {
                    let message = format!(
                        "has {count} values here and {} in {}; share a field between bodies of the same cells, or say per_scene = true",
                        f.count,
                        file(f.slots[0].scene).display()
                    );
                    return Err(Error::scene(file(scene), &p.path, message));
                }
                if with_prior(e, &p.path).map(|w| w.1) != with_prior(&experiments[f.slots[0].scene], &p.path).map(|w| w.1) {
                    let message = format!(
                        "has another prior here than in {}; a shared field has the same in both, or say per_scene = true",
                        file(f.slots[0].scene).display()
                    );
                    return Err(Error::scene(file(scene), &p.path, message));
                }
                f.slots.push(slot);
                continue;
            }
            let spec = key.spec();
            // Who expects more than is usual has the search go as far in a step.
            let expected = match p.known {
                Some((_, sd)) if spec.transform == Transform::Linear && sd.is_finite() => sd,
                _ => 0.0,
            };
            let is_mass = p.path == "material.mass";
            let number = FreeNumber { path: p.path.clone(), scene: own.then_some(scene) };
            let vector = |path| FreeNumber { path, scene: number.scene }.label();
            free.push(FreeParameter {
                direction: key.direction().map(vector),
                path: number.label(),
                unit: if is_mass { "kg".into() } else { spec.unit.into() },
                transform: spec.transform,
                typical: (spec.typical / slot.factor).max(expected),
                bounds: p.bounds,
                start: p.start,
                known: p.known,
                prior: prior(e, &p.path),
                count,
                slots: vec![slot],
            });
            numbers.push(number);
        }
    }
    for (n, f) in numbers.iter().zip(&free).filter(|(n, _)| n.scene.is_none() && n.path.starts_with("material.")) {
        for (s, e) in experiments.iter().enumerate() {
            if !f.slots.iter().any(|slot| slot.scene == s) {
                warnings.push(format!(
                    "{} is free in another scene but keeps its own value in {}; name it in its [fit] to share it",
                    n.path,
                    e.scene().path.display()
                ));
            }
        }
    }
    Ok((numbers, free, warnings))
}
