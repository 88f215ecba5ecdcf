//! Experiments changed as a hypothesis says: effects appended, numbers freed, without cutting the body again.

use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{FreeNumber, free_parameters};
use glam::DVec3;
use palpate_diagnose::{Change, LabError, Number};
use palpate_fit::{FreeParameter, Slot};
use palpate_model::effects::field::{Field, Spot};
use palpate_model::effects::{ALL, Site, Unstated};
use palpate_model::params::{ParamKey, Transform};
use palpate_model::scene::{FitParameter, FitSpec, Inertia, WarmStart};

/// Changed experiments and their free numbers: those of the scenes first, then change by change.
pub(super) struct Prepared {
    pub experiments: Vec<Experiment>,
    pub names: Vec<FreeNumber>,
    pub free: Vec<FreeParameter>,
    /// How many of them the scenes themselves leave free: the first ones.
    pub given: usize,
}

/// A number that belongs to one recording, never to the body. Gravity is one where scenes state different ones: the setup was turned between
/// them, and an error of its direction turns with nothing that both share.
pub(super) fn is_own<'a>(path: &str, scenes: impl IntoIterator<Item = &'a Experiment>) -> bool {
    let of_recording = ["initial.", "time.", "mass."].iter().any(|p| path.starts_with(p));
    let mut stated = scenes.into_iter().map(|e| e.scene.gravity);
    let mut turned = || stated.next().is_some_and(|first| stated.any(|other| other != first));
    of_recording || path.starts_with("world.gravity") && turned()
}

/// Path in the scene file of a key.
pub(super) fn path_of(e: &Experiment, key: ParamKey) -> String {
    match (key, e.scene.material.inertia) {
        (ParamKey::Density, Inertia::Mass(_)) => "material.mass".into(),
        _ => key.spec().path,
    }
}

/// Paths that a diagnosis may free: held by every scene. Numbers of single scenes carry the scene's name when there are several.
pub(super) fn held(experiments: &[Experiment]) -> Vec<String> {
    let is_free = |e: &Experiment, path: &str| e.scene.fit.iter().flat_map(|f| &f.parameters).any(|p| p.path == path);
    let has = |e: &Experiment, path: &str| e.plan.layout.keys.iter().any(|k| path_of(e, *k) == path);
    let mut out = Vec::new();
    for key in experiments[0].plan.layout.keys.iter().filter(|k| palpate_diagnose::can_be_freed(**k)) {
        let path = path_of(&experiments[0], *key);
        if experiments.iter().any(|e| is_free(e, &path) || !has(e, &path)) {
            continue;
        }
        if experiments.len() > 1 && is_own(&path, experiments) {
            let label = |s| FreeNumber { path: path.clone(), scene: Some(s) }.label();
            out.extend((0..experiments.len()).map(label));
        } else {
            out.push(path);
        }
    }
    out
}

/// Makes the experiments of a hypothesis.
pub(super) fn prepare(base: &[Experiment], changes: &[Change]) -> Result<Prepared, Error> {
    let several = base.len() > 1;
    let mut experiments = base.to_vec();
    let (known, freed, _) = free_parameters(base)?;
    if let Some(field) = freed.iter().find(|f| f.count > 1) {
        let message =
            format!("{}: a diagnosis weighs numbers one by one; take the field out of [fit], or give it regions", field.path);
        return Err(Error::scene(&base[0].scene().path, "fit.parameter", message));
    }
    let given = known.len();
    let mut order: Vec<String> = known.iter().map(FreeNumber::label).collect();
    for change in changes {
        match change {
            Change::Effect(effect) => {
                for (s, e) in experiments.iter_mut().enumerate() {
                    let number = e.scene.effects.len();
                    e.scene.effects.push(effect.clone());
                    // Fields come behind the effects.
                    let fields: Vec<usize> = e.plan.fields.iter().map(|f| f.count).collect();
                    let end = e.plan.layout.fields().next().map_or(e.plan.theta.len(), |f| f.start);
                    e.plan.layout = e.scene.layout_with(&fields);
                    let center = e.plan.body.center;
                    e.plan.theta.splice(end..end, (0..effect.values.len()).map(|slot| effect.value(slot, center)));
                    for slot in change.free_slots() {
                        let path = e.plan.layout.effect_key(number, slot).spec().path;
                        if s == 0 {
                            order.push(path.clone());
                        }
                        set_free(e, path, false);
                    }
                }
            }
            Change::Freed { paths, .. } => {
                order.extend(paths.iter().cloned());
                for (s, e) in experiments.iter_mut().enumerate() {
                    for label in paths {
                        let path = label.split(" [scene").next().unwrap_or(label);
                        let own = several && is_own(path, base);
                        if !own || (FreeNumber { path: path.into(), scene: Some(s) }).label() == *label {
                            set_free(e, path.to_string(), own);
                        }
                    }
                }
            }
        }
    }
    // Starts are set by whoever fits; here they only must not contradict each other between scenes.
    let (names, free, _) = free_parameters(&experiments)?;
    let mut both: Vec<(FreeNumber, FreeParameter)> = names.into_iter().zip(free).collect();
    both.sort_by_key(|(n, _)| order.iter().position(|o| *o == n.label()).unwrap_or(usize::MAX));
    let (names, free) = both.into_iter().unzip();
    Ok(Prepared { experiments, names, free, given })
}

/// Largest displacement gradient of a rest shape that could be mistaken for the one given: a strain of 30 %, or a turn of 17°.
const MOST_RESHAPED: f64 = 0.3;

/// Largest ratio of density or stiffness between two ends of a body: beyond it one end is air beside the other.
const MOST_GRADED: f64 = 100.0;

/// Largest displacement gradient within the body's box that one number of a rest shape makes, for each unit of it.
fn steepness(e: &Experiment, field: &dyn Field<3>, (slot, of): (usize, usize)) -> f64 {
    let middle = Spot::of(&e.plan);
    let (low, high) = e.shape().bounds();
    let still = vec![0.0; of];
    let mut most: f64 = 0.0;
    for corner in 0..8 {
        let at = DVec3::from_array([0, 1, 2].map(|a| if corner >> a & 1 == 0 { low[a] } else { high[a] }));
        for axis in DVec3::AXES {
            let way = 1e-3 * middle.size * axis;
            let moved = |rest: DVec3| DVec3::from_array(field.slope(&Spot { rest, ..middle }, &still, slot));
            most = most.max((moved(at + way) - moved(at - way)).length() / (2.0 * way.length()));
        }
    }
    most
}

fn set_free(e: &mut Experiment, path: String, per_scene: bool) {
    let key = e.plan.layout.keys.iter().find(|k| path_of(e, **k) == path);
    let Some(spec) = key.map(|k| k.spec()) else { return };
    let mut bounds = if path == "material.mass" { (1e-9, 1e6) } else { (spec.lower, spec.upper) };
    if let Some(ParamKey::Effect { law, slot, .. }) = key {
        let p = &ALL[usize::from(*law)].params[usize::from(*slot)];
        if let (Unstated::OnBody, Some(axis)) = (p.default, p.axis) {
            let (low, high) = e.shape().bounds();
            bounds = (low[usize::from(axis)], high[usize::from(axis)]);
        }
        if let (Site::Density(_) | Site::Modulus(_), Some(axis), "1/m") = (&ALL[usize::from(*law)].site, p.axis, p.unit) {
            let (low, high) = e.shape().bounds();
            let most = MOST_GRADED.ln() / (high - low)[usize::from(axis)];
            bounds = (bounds.0.max(-most), bounds.1.min(most));
        }
        if let Site::Rest(field) = &ALL[usize::from(*law)].site {
            let most = MOST_RESHAPED / steepness(e, *field, (usize::from(*slot), ALL[usize::from(*law)].params.len()));
            bounds = (bounds.0.max(-most), bounds.1.min(most));
        }
    }
    let middle = 0.0f64.clamp(bounds.0, bounds.1);
    let parameter = FitParameter { path, start: (middle, middle), bounds, known: None, per_scene };
    let empty = || FitSpec {
        optimizer: None,
        iterations: 50,
        starts: 1,
        seed: 1,
        threads: 0,
        warm_start: WarmStart::Stated,
        frames: None,
        parameters: Vec::new(),
    };
    e.scene.fit.get_or_insert_with(empty).parameters.push(parameter);
}

impl Prepared {
    /// Values that the experiments have of the free numbers.
    pub fn own_values(&self) -> Vec<f64> {
        let own = |s: &Slot| self.experiments[s.scene].plan.theta[s.place] / s.factor;
        self.free.iter().map(|f| own(&f.slots[0])).collect()
    }

    /// The free numbers.
    pub fn numbers(&self) -> Vec<Number> {
        let own = self.own_values();
        let number = |(k, (n, f)): (usize, (&FreeNumber, &FreeParameter))| {
            let guess = match f.transform {
                Transform::Log => (f.start.0 * f.start.1).sqrt(),
                _ => 0.5 * (f.start.0 + f.start.1),
            };
            let start = if k < self.given { guess } else { own[k] };
            let scale = if f.transform == Transform::Log && start > 0.0 { start } else { f.typical };
            Number {
                path: n.label(),
                unit: f.unit.clone(),
                start,
                bounds: f.bounds,
                scale,
                transform: f.transform,
                known: f.known,
            }
        };
        self.names.iter().zip(&self.free).enumerate().map(number).collect()
    }

    /// θ of a scene at values of the free numbers.
    pub fn theta(&self, scene: usize, values: &[f64]) -> Vec<f64> {
        let mut theta = self.experiments[scene].plan.theta.clone();
        for (f, v) in self.free.iter().zip(values) {
            f.slots.iter().filter(|s| s.scene == scene).for_each(|s| theta[s.place] = v * s.factor);
        }
        theta
    }

    /// Values of a scene's free numbers by path.
    pub fn values_of(&self, scene: usize, values: &[f64]) -> Vec<(String, f64)> {
        let acts = |f: &FreeParameter| f.slots.iter().any(|s| s.scene == scene);
        let all = self.names.iter().zip(&self.free).zip(values);
        all.filter(|((_, f), _)| acts(f)).map(|((n, _), v)| (n.path.clone(), *v)).collect()
    }
}

/// An error of preparation as the laboratory's.
pub(super) fn lab_error(e: Error) -> LabError {
    match e {
        Error::Interrupted => LabError::Interrupted,
        other => LabError::failed(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube under this gravity [m/s²].
    fn cube(gravity: &str) -> Experiment {
        let text = format!(
            "format = \"scene/1\"\n[object]\nshape = {{ box = {{ min = [0, 0, 0], max = [0.1, 0.1, 0.1] }} }}\ncells = 2\n\
             [material]\ndensity = 1000.0\nyoungs_modulus = 1.0e4\npoisson_ratio = 0.3\n[world]\ngravity = {gravity}\n\
             [time]\nstep = 0.01\nsteps = 2\n"
        );
        Experiment::from_toml(&text, "cube.toml").unwrap()
    }

    #[test]
    fn gravity_belongs_to_a_recording_where_the_setup_was_turned() {
        let free = |scenes: &[Experiment]| {
            let paths: Vec<String> = held(scenes).into_iter().filter(|p| p.starts_with("world.gravity")).collect();
            let change = Change::Freed { name: "gravity", sentence: "", paths };
            let ready = prepare(scenes, &[change]).unwrap();
            // Every scene keeps what it states.
            for (s, e) in scenes.iter().enumerate() {
                assert_eq!(ready.theta(s, &ready.own_values()), e.plan.theta);
            }
            ready.numbers().into_iter().map(|n| n.path).collect::<Vec<_>>()
        };
        let (upright, turned) = (cube("[0, 0, -9.81]"), cube("[9.81, 0, 0]"));
        assert_eq!(free(&[upright.clone(), upright.clone()]), ["world.gravity.x", "world.gravity.y", "world.gravity.z"]);
        let own = free(&[upright, turned]);
        assert_eq!(own.len(), 6, "{own:?}");
        assert!(own.contains(&"world.gravity.x [scene 2]".into()), "{own:?}");
    }
}
