//! `[fit]`: what is to be found out, checked against the scene.

use crate::document::Table;
use crate::error::{InputError, number};
use crate::keys::suggest;
use palpate_model::effects::{ALL, Unstated};
use palpate_model::params::{ParamKey, Transform};
use palpate_model::plan::PlaneSite;
use palpate_model::scene::{FitParameter, FitSpec, Inertia, Optimizer, Scene};

/// One number of a scene that can be fitted.
struct Target {
    path: String,
    value: f64,
    lower: f64,
    upper: f64,
    positive: bool,
}

/// The numbers of this scene that can be fitted, in the order of its layout.
fn targets(scene: &Scene) -> Vec<Target> {
    let mut out = Vec::new();
    for key in scene.layout().keys.into_iter().filter(|k| !is_choice(*k)) {
        let spec = key.spec();
        let (path, value, lower, upper) = match (key, scene.material.inertia) {
            (ParamKey::Density, Inertia::Mass(m)) => ("material.mass".to_string(), m, 1e-9, 1e6),
            _ => (spec.path.clone(), value(scene, key), spec.lower, spec.upper),
        };
        out.push(Target { path, value, lower, upper, positive: spec.transform == Transform::Log });
    }
    out
}

/// True for numbers that choose one thing among several.
fn is_choice(key: ParamKey) -> bool {
    let ParamKey::Effect { law, slot, .. } = key else { return false };
    matches!(ALL[usize::from(law)].params[usize::from(slot)].default, Unstated::Choice(_))
}

/// A parameter's value as the scene states it.
fn value(scene: &Scene, key: ParamKey) -> f64 {
    let plane = |i: u16| {
        let p = scene.planes[usize::from(i)];
        let site = PlaneSite { polar_axis: PlaneSite::polar_axis_for(p.normal), stiffness: None };
        (p.point.dot(p.normal), site.angles(p.normal))
    };
    match key {
        ParamKey::YoungsModulus => scene.material.youngs_modulus,
        ParamKey::PoissonRatio => scene.material.poisson_ratio,
        ParamKey::Density => match scene.material.inertia {
            Inertia::Density(x) | Inertia::Mass(x) => x,
        },
        ParamKey::MassDamping => scene.material.mass_damping,
        ParamKey::StiffnessDamping => scene.material.stiffness_damping,
        ParamKey::Gravity(a) => scene.gravity[usize::from(a)],
        ParamKey::Velocity(a) => scene.initial.velocity[usize::from(a)],
        ParamKey::AngularVelocity(a) => scene.initial.angular_velocity[usize::from(a)],
        ParamKey::TimeStart => scene.time.start,
        ParamKey::PlaneHeight(i) => plane(i).0,
        ParamKey::PlaneTheta(i) => plane(i).1.0,
        ParamKey::PlanePhi(i) => plane(i).1.1,
        ParamKey::PointMass(i) => scene.masses[usize::from(i)].mass,
        // A scene without its body has no place of a field; a field that states nothing changes nothing.
        ParamKey::Field { .. } => 1.0,
        // Not stated and not known before the body is cut: the fit must say where to start.
        ParamKey::Effect { effect, slot, .. } => scene.effects[usize::from(effect)].values[usize::from(slot)].unwrap_or(f64::NAN),
    }
}

pub(super) fn fit(root: &Table, scene: &Scene) -> Result<Option<FitSpec>, InputError> {
    let Some(t) = root.optional_table("fit")? else { return Ok(None) };
    let optimizers = [
        ("rprop", Optimizer::Rprop),
        ("gradient-descent", Optimizer::GradientDescent),
        ("lbfgs", Optimizer::Lbfgs),
        ("gauss-newton", Optimizer::GaussNewton),
        ("nelder-mead", Optimizer::NelderMead),
    ];
    let known = targets(scene);
    let mut parameters: Vec<FitParameter> = Vec::new();
    for p in t.tables("parameter")? {
        if let Some(path) = p.optional_str("path")?
            && scene.layout().keys.iter().any(|k| is_choice(*k) && k.spec().path == path)
        {
            return Err(p.error("path", format!("{path} chooses one thing among several and cannot be fitted; state it")));
        }
        for parameter in parameter(&p, &known)? {
            if parameters.iter().any(|o| o.path == parameter.path) {
                return Err(p.error("path", format!("{} is given twice", parameter.path)));
            }
            parameters.push(parameter);
        }
    }
    Ok(Some(FitSpec {
        optimizer: t.optional_choice("optimizer", &optimizers)?.unwrap_or(Optimizer::GaussNewton),
        iterations: t.optional_count("iterations", 0..=1_000_000)?.unwrap_or(50) as usize,
        starts: t.optional_count("starts", 1..=1_000_000)?.unwrap_or(1) as usize,
        seed: t.optional_count("seed", 0..=u64::MAX)?.unwrap_or(1),
        threads: t.optional_count("threads", 0..=4096)?.unwrap_or(0) as usize,
        parameters,
    }))
}

/// One `[[fit.parameter]]`: a number, or the three components of a vector.
fn parameter(t: &Table, known: &[Target]) -> Result<Vec<FitParameter>, InputError> {
    let path = t.optional_str("path")?.ok_or_else(|| t.missing("path", "the dotted path of a number in this file"))?;
    let component = |k: &Target| k.path.strip_prefix(path).is_some_and(|r| matches!(r, "" | ".x" | ".y" | ".z"));
    let chosen: Vec<&Target> = known.iter().filter(|k| component(k)).collect();
    if chosen.is_empty() {
        return Err(t.error("path", unknown_path(path, known)));
    }
    let starts = t.optional_ranges("start", chosen.len())?;
    let bounds = t.optional_ranges("bounds", chosen.len())?;
    let per_scene = t.optional_bool("per_scene")?.unwrap_or(false);
    let mut out = Vec::new();
    for (i, k) in chosen.iter().enumerate() {
        let start = starts.as_ref().map_or((k.value, k.value), |s| s[i]);
        let bounds = bounds.as_ref().map_or((k.lower, k.upper), |b| b[i]);
        let path = &k.path;
        let (low, high) = (number(bounds.0), number(bounds.1));
        if start.0.is_nan() {
            return Err(t.error("start", format!("{path}: the scene states no value; give a start, or state it in the effect")));
        }
        if bounds.0 >= bounds.1 {
            return Err(t.error("bounds", format!("{path}: [{low}, {high}] leaves no room; low must be below high")));
        }
        if k.positive && bounds.0 <= 0.0 {
            return Err(t.error("bounds", format!("{path}: must be > 0 (it is fitted on a logarithmic scale), found {low}")));
        }
        if k.positive && start.0 <= 0.0 {
            let way_out = if starts.is_some() { "give a start > 0" } else { "the scene's value is 0: set start to a number > 0" };
            return Err(
                t.error("start", format!("{path}: {} cannot be fitted on a logarithmic scale; {way_out}", number(start.0)))
            );
        }
        if path == "material.poisson_ratio" && (bounds.0 <= -1.0 || bounds.1 >= 0.5) {
            return Err(t.error("bounds", format!("{path}: [{low}, {high}] must lie in (-1, 0.5)")));
        }
        if start.0 < bounds.0 || start.1 > bounds.1 {
            let from = if starts.is_some() { "start" } else { "the scene's value" };
            let (first, last) = (number(start.0), number(start.1));
            let start = if first == last { first } else { format!("[{first}, {last}]") };
            return Err(t.error("bounds", format!("{path}: [{low}, {high}] excludes {from} {start}")));
        }
        out.push(FitParameter { path: path.clone(), start, bounds, per_scene });
    }
    Ok(out)
}

fn unknown_path(path: &str, known: &[Target]) -> String {
    if path == "material.density" {
        return "this scene gives material.mass; fit \"material.mass\" or state the density".to_string();
    }
    if path == "material.mass" {
        return "this scene gives material.density; fit \"material.density\" or state the mass".to_string();
    }
    for (table, noun) in [("plane.", "[[plane]]"), ("mass.", "[[mass]]"), ("effect.", "[[effect]]")] {
        let index = path.strip_prefix(table).and_then(|r| r.split('.').next()).and_then(|i| i.parse::<usize>().ok());
        if let Some(i) = index
            && !known.iter().any(|k| k.path.starts_with(&format!("{table}{i}.")))
        {
            return format!("\"{path}\": this scene has no {noun} number {i} (they are counted from 0)");
        }
    }
    let names: Vec<&str> = known.iter().map(|k| k.path.as_str()).collect();
    format!("\"{path}\" is not a number that can be fitted; {}", suggest(path, &names))
}
