//! `[fit]`: what is to be found out, checked against the scene.

use crate::document::Table;
use crate::error::{InputError, number};
use crate::keys::suggest;
use crate::scene::normal;
use palpate_model::effects::{ALL, Unstated};
use palpate_model::params::fields::Basis;
use palpate_model::params::{On, ParamKey, Transform, is_component};
use palpate_model::plan::PlaneSite;
use palpate_model::scene::{FitParameter, FitSpec, Inertia, Optimizer, Scene, TrainFrames, WarmStart};

/// One number of a scene that can be fitted.
pub(super) struct Target {
    pub path: String,
    /// What the scene states: one value, or the range of a field's.
    pub value: (f64, f64),
    pub lower: f64,
    pub upper: f64,
    pub positive: bool,
}

/// The numbers of this scene that can be fitted, in the order of its layout.
fn targets(scene: &Scene) -> Vec<Target> {
    let mut out = Vec::new();
    // Handles are no [[effect]] of the file: their numbers have no path that could be written back.
    let of_handle =
        |key: ParamKey| scene.synthesis.handles.iter().any(|h| h.follows.is_some_and(|e| key.on() == On::Effect(e as u16)));
    for key in scene.layout().keys.into_iter().filter(|k| !is_choice(*k) && !of_handle(*k)) {
        let spec = key.spec();
        let (path, stated, lower, upper) = match (key, scene.material.inertia) {
            (ParamKey::Density, Inertia::Mass(m)) => ("material.mass".to_string(), m, 1e-9, 1e6),
            _ => (spec.path.clone(), value(scene, key), spec.lower, spec.upper),
        };
        out.push(Target { path, value: (stated, stated), lower, upper, positive: spec.transform == Transform::Log });
    }
    out
}

/// What a path means in the scene's fields: every region of one, all values of one by cells or nodes, or a single value. How many cells
/// or nodes there are only a body knows.
fn field_targets(path: &str, scene: &Scene) -> Option<Vec<Target>> {
    let mut parts = path.strip_prefix("field.")?.split('.').map(str::parse::<usize>);
    let (Some(Ok(i)), place, None) = (parts.next(), parts.next().transpose().ok()?, parts.next()) else { return None };
    let field = scene.fields.get(i)?;
    let target = |k: Option<usize>, value: (f64, f64)| {
        let spec = ParamKey::Field { field: i as u16, index: k.unwrap_or(0) as u32 }.spec();
        let path = if k.is_some() { spec.path } else { format!("field.{i}") };
        Target { path, value, lower: spec.lower, upper: spec.upper, positive: spec.transform == Transform::Log }
    };
    match (&field.basis, &field.values, place) {
        (Basis::Regions(regions, _), _, None) => {
            Some(regions.iter().enumerate().map(|(k, r)| target(Some(k), (r.value, r.value))).collect())
        }
        (Basis::Regions(regions, _), _, Some(k)) => Some(vec![target(Some(k), regions.get(k).map(|r| (r.value, r.value))?)]),
        (_, Some(values), Some(k)) => Some(vec![target(Some(k), values.get(k).map(|v| (*v, *v))?)]),
        (_, Some(values), None) => {
            let range = values.iter().fold((f64::INFINITY, 0.0), |(a, b): (f64, f64), v| (a.min(*v), b.max(*v)));
            Some(vec![target(None, range)])
        }
        (_, None, k) => Some(vec![target(k, (1.0, 1.0))]),
    }
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
        ParamKey::Viscosity => scene.material.viscosity.map_or(0.0, |v| v.coefficient),
        ParamKey::ViscosityExponent => scene.material.viscosity.map_or(1.0, |v| v.exponent),
        ParamKey::StretchFactor(k) => scene.curves.stretch.factors[usize::from(k)],
        ParamKey::VolumeFactor(k) => scene.curves.volume.factors[usize::from(k)],
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
    let known = targets(scene);
    let mut parameters: Vec<FitParameter> = Vec::new();
    for p in t.tables("parameter")? {
        if let Some(path) = p.optional_str("path")?
            && scene.layout().keys.iter().any(|k| is_choice(*k) && k.spec().path == path)
        {
            return Err(p.error("path", format!("{path} chooses one thing among several and cannot be fitted; state it")));
        }
        for parameter in parameter(&p, scene, &known)? {
            if parameters.iter().any(|o| o.path == parameter.path) {
                return Err(p.error("path", format!("{} is given twice", parameter.path)));
            }
            parameters.push(parameter);
        }
    }
    Ok(Some(FitSpec {
        optimizer: t.optional_choice("optimizer", &Optimizer::ALL)?,
        iterations: t.optional_count("iterations", 0..=1_000_000)?.unwrap_or(50) as usize,
        starts: t.optional_count("starts", 1..=1_000_000)?.unwrap_or(1) as usize,
        seed: t.optional_count("seed", 0..=u64::MAX)?.unwrap_or(1),
        threads: t.optional_count("threads", 0..=4096)?.unwrap_or(0) as usize,
        warm_start: t.optional_choice("warm_start", &WarmStart::ALL)?.unwrap_or_default(),
        parameters,
        frames: frames(&t)?,
    }))
}

/// `frames`: which of them the fit sees.
fn frames(t: &Table) -> Result<Option<TrainFrames>, InputError> {
    let Some(f) = t.optional_table("frames")? else { return Ok(None) };
    let train =
        f.optional_table("train")?.ok_or_else(|| f.missing("train", "{ every = n, count = m } or { numbers = [0, 5, …] }"))?;
    let count = |key: &str| train.optional_count(key, 1..=u64::MAX).map(|n| n.map(|n| usize::try_from(n).unwrap_or(usize::MAX)));
    let (every, most) = (count("every")?, count("count")?);
    let numbers = train.optional_list("numbers")?.map(|all| numbers(&train, all)).transpose()?;
    if numbers.is_some() && (every, most) != (None, None) {
        return Err(train.error("numbers", "excludes every and count: it names each frame itself"));
    }
    if numbers.is_none() && (every, most) == (None, None) {
        return Err(f.error("train", "says neither every, count nor numbers: which frames is the fit to see?"));
    }
    f.optional_choice("test", &[("rest", ())])?;
    Ok(Some(TrainFrames { every: every.unwrap_or(1), count: most.unwrap_or(usize::MAX), numbers, others: false }))
}

/// Numbers of frames in rising order.
fn numbers(t: &Table, all: Vec<f64>) -> Result<Vec<usize>, InputError> {
    // Beyond this, floats skip whole numbers.
    let whole = |x: &f64| x.fract() == 0.0 && (0.0..9e15).contains(x);
    if let Some(x) = all.iter().find(|x| !whole(x)) {
        return Err(t.error("numbers", format!("{} is no number of a frame: they are counted from 0", number(*x))));
    }
    let mut out: Vec<usize> = all.into_iter().map(|x| x as usize).collect();
    out.sort_unstable();
    out.dedup();
    if out.is_empty() { Err(t.error("numbers", "names no frame")) } else { Ok(out) }
}

/// One `[[fit.parameter]]`: a number, the three components of a vector, or a field, whose values share one start and one pair of bounds.
fn parameter(t: &Table, scene: &Scene, known: &[Target]) -> Result<Vec<FitParameter>, InputError> {
    let path = t.optional_str("path")?.ok_or_else(|| t.missing("path", "the dotted path of a number in this file"))?;
    if scene.time.scheme.still
        && ["time.start", "initial.", "material.mass_damping", "material.stiffness_damping", "material.viscosity"]
            .iter()
            .any(|p| path.starts_with(p))
    {
        return Err(t.error("path", format!("{path} has no part in a quasi-static sequence, in which nothing moves")));
    }
    let component = |k: &Target| k.path.strip_prefix(path).is_some_and(is_component);
    let of_field = field_targets(path, scene);
    let of_normal = normal::targets(t, path, scene, known)?;
    if of_normal.is_none() && t.has("within") {
        return Err(t.error("within", format!("belongs to the normal of a plane, not to {path}; bounds say where that may lie")));
    }
    let own = of_field.as_ref().or(of_normal.as_ref());
    let chosen: Vec<&Target> = own.map_or_else(|| known.iter().filter(|k| component(k)).collect(), |f| f.iter().collect());
    if chosen.is_empty() {
        return Err(t.error("path", unknown_path(path, scene, known)));
    }
    // Values of a field and factors of a curve share one range.
    let shared = of_field.is_some() || path.ends_with("_curve.factors");
    let ranges = |key| match shared {
        true => t.optional_ranges(key, 1).map(|r| r.map(|r| vec![r[0]; chosen.len()])),
        false => t.optional_ranges(key, chosen.len()),
    };
    // The start of a normal is in its angles already.
    let starts = if of_normal.is_some() { None } else { ranges("start")? };
    let bounds = ranges("bounds")?;
    let known_values = known_values(t, chosen.len(), shared)?;
    let per_scene = t.optional_bool("per_scene")?.unwrap_or(false);
    let mut out = Vec::new();
    for (i, k) in chosen.iter().enumerate() {
        let beforehand = known_values.as_ref().map(|v| v[i]);
        // What the scene does not state starts where it is known to be.
        let stated = if k.value.0.is_nan() { beforehand.map_or(k.value, |(v, _)| (v, v)) } else { k.value };
        let start = starts.as_ref().map_or(stated, |s| s[i]);
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
        if let Some((value, _)) = beforehand
            && !(value >= bounds.0 && value <= bounds.1)
        {
            return Err(t.error("known", format!("{path}: {} lies outside the bounds [{low}, {high}]", number(value))));
        }
        out.push(FitParameter { path: path.clone(), start, bounds, known: beforehand, per_scene });
    }
    Ok(out)
}

/// `known`: a pair of value and standard deviation for each of `count` numbers, or one for all.
fn known_values(t: &Table, count: usize, of_field: bool) -> Result<Option<Vec<(f64, f64)>>, InputError> {
    let Some(pairs) = t.optional_pairs("known", if of_field { 1 } else { count })? else { return Ok(None) };
    for (value, sd) in &pairs {
        if *sd <= 0.0 {
            let (value, sd) = (number(*value), number(*sd));
            return Err(t.error(
                "known",
                format!("[{value}, {sd}]: the standard deviation must be > 0; leave the key out where nothing is known"),
            ));
        }
    }
    Ok(Some(if of_field { vec![pairs[0]; count] } else { pairs }))
}

fn unknown_path(path: &str, scene: &Scene, known: &[Target]) -> String {
    if path == "material.density" {
        return "this scene gives material.mass; fit \"material.mass\" or state the density".to_string();
    }
    if path == "material.mass" {
        return "this scene gives material.density; fit \"material.density\" or state the mass".to_string();
    }
    if let Some(i) = path.strip_prefix("field.").and_then(|r| r.split('.').next()).and_then(|i| i.parse::<usize>().ok()) {
        return match scene.fields.get(i).map(|f| (&f.basis, &f.values)) {
            None => format!("\"{path}\": this scene has no [[field]] number {i} (they are counted from 0)"),
            Some((Basis::Regions(r, _), _)) => format!("\"{path}\": field {i} has {} regions (they are counted from 0)", r.len()),
            Some((basis, Some(v))) => format!("\"{path}\": field {i} has {} {} (they are counted from 0)", v.len(), basis.noun()),
            Some((basis, None)) => format!("\"{path}\": say \"field.{i}\", or \"field.{i}.3\" for one of its {}", basis.noun()),
        };
    }
    for (table, noun) in [
        ("plane.", "[[plane]]"),
        ("mass.", "[[mass]]"),
        ("effect.", "[[effect]]"),
        ("load.", "[[load]]"),
        ("attach.", "[[attach]]"),
        ("obstacle.", "[[obstacle]]"),
    ] {
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
