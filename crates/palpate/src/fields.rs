//! Found fields as arrays: NPZ and VTU files beside a result, and what the result says of them.

use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::Fitted;
use crate::results::finite;
use crate::results::fit::{FieldReference, Posterior, Tried};
use palpate_cpu::CpuBackend;
use palpate_fit::FieldPosterior;
use palpate_io::npy::{Array, write_npz};
use palpate_io::vtk::{Elements, Values, write_vtu};
use palpate_model::params::fields::{Basis, Varied};
use palpate_model::params::{On, ParamKey};
use palpate_model::plan::Plan;
use palpate_model::scene::InitialShape;
use std::collections::BTreeMap;
use std::path::Path;

/// Name of the array of values in an NPZ file.
const ARRAY: &str = "values";

/// A field of a scene with the values found.
struct Found<'a> {
    experiment: &'a Experiment,
    /// Number of the scene, and of the field in it.
    scene: usize,
    field: usize,
    /// Values `[count]`.
    values: Vec<f64>,
    /// Factor at every place.
    factors: Vec<f64>,
    /// Standard errors `[count]`, NaN where there is none; `None` where there are none at all.
    errors: Option<Vec<f64>>,
    /// What prior and recording say of it.
    posterior: Option<&'a FieldPosterior>,
}

/// Standard errors of the free values of a scene, by the path of its fields: `field.0.3`, or the first of `field.0`.
fn errors_of(fitted: &Fitted, scene: usize) -> BTreeMap<&str, Vec<Option<f64>>> {
    let own = |n: &crate::FreeNumber| n.scene.is_none_or(|s| s == scene);
    let numbers = fitted.free.iter().zip(&fitted.result.parameters).map(|(n, p)| (n, vec![p.standard_error]));
    let fields = fitted.fields.iter().zip(&fitted.result.fields).map(|(n, f)| (n, f.standard_errors.clone()));
    numbers.chain(fields).filter(|(n, _)| own(n)).map(|(n, e)| (n.path.as_str(), e)).collect()
}

/// Every field of a scene of which something was free.
fn found<'a>(experiment: &'a Experiment, fitted: &'a Fitted, scene: usize) -> Vec<Found<'a>> {
    let (plan, theta) = (experiment.plan(), &fitted.result.theta[scene]);
    let free = errors_of(fitted, scene);
    let named = |path: &str| experiment.scene().fit.iter().flat_map(|f| &f.parameters).any(|p| p.path == path);
    let mut errors = vec![f64::NAN; plan.layout.len()];
    let mut fields = vec![false; plan.fields.len()];
    for (path, known) in free.iter().filter(|(path, _)| named(path)) {
        let places = plan.layout.resolve(path);
        let Some(On::Field(field)) = plan.layout.keys.get(places.start).map(|k: &ParamKey| k.on()) else { continue };
        fields[usize::from(field)] = true;
        places.zip(known).for_each(|(p, e)| errors[p] = e.unwrap_or(f64::NAN));
    }
    let posterior = |field: usize| {
        let own = |n: &crate::FreeNumber| n.path == format!("field.{field}") && n.scene.is_none_or(|s| s == scene);
        fitted.fields.iter().zip(&fitted.result.fields).find(|(n, _)| own(n)).and_then(|(_, f)| f.posterior.as_ref())
    };
    let all = plan.layout.fields().zip(&plan.fields).enumerate().filter(|(field, _)| fields[*field]);
    all.map(|(field, (places, f))| {
        let values = theta[places.clone()].to_vec();
        let own = errors[places].to_vec();
        let errors = own.iter().any(|e| e.is_finite()).then_some(own);
        Found { experiment, scene, field, factors: f.factors(&values), values, errors, posterior: posterior(field) }
    })
    .collect()
}

/// Names of files of fields and stress-free shapes that lie in a folder.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let names = entries.filter_map(Result::ok).map(|e| e.file_name().to_string_lossy().into_owned());
    let is_own =
        |n: &String| (n.starts_with("field") || n.starts_with("stress-free")) && (n.ends_with(".npz") || n.ends_with(".vtu"));
    let mut own: Vec<String> = names.filter(is_own).collect();
    own.sort();
    own
}

/// Names of a scene's file of the grid, and of one of its fields.
fn file_names(scenes: usize, scene: usize, field: usize) -> (String, String) {
    let ending = if scenes == 1 { String::new() } else { format!("-scene-{}", scene + 1) };
    (format!("fields{ending}.vtu"), format!("field-{field}{ending}.npz"))
}

/// Writes the stress-free shape of a scene whose shape is given under load: the displacement from the shape given, `stress_free` [m], on the grid.
fn write_stress_free(path: &Path, e: &Experiment, theta: &[f64]) -> Result<(), Error> {
    let (plan, body) = (e.plan(), &e.plan().body);
    let w = CpuBackend.stress_free(plan, theta)?;
    Ok(write_vtu(path, &body.nodes, &Elements::of(body), &[("stress_free", Values::Vectors(&w))], &[])?)
}

/// Writes the fields of a fit into a folder, an NPZ file each and a VTU file a scene, and says where they are; beside them the stress-free shape of
/// scenes whose shape is given under load.
///
/// # Errors
/// A file cannot be written.
pub(crate) fn write_fields(folder: &Path, experiments: &[Experiment], fitted: &Fitted) -> Result<Vec<FieldReference>, Error> {
    for (scene, e) in experiments.iter().enumerate() {
        if e.plan().initial == InitialShape::Given {
            let ending = if experiments.len() == 1 { String::new() } else { format!("-scene-{}", scene + 1) };
            write_stress_free(&folder.join(format!("stress-free{ending}.vtu")), e, &fitted.result.theta[scene])?;
        }
        let found = found(e, fitted, scene);
        for (k, f) in found.iter().enumerate() {
            let (grid, file) = file_names(experiments.len(), scene, f.field);
            if k == 0 {
                write_grid(&folder.join(&grid), e, &fitted.result.theta[scene], &found)?;
            }
            f.write(&folder.join(&file))?;
        }
    }
    Ok(references(experiments, fitted))
}

/// What a result says of the fields of a fit.
pub(crate) fn references(experiments: &[Experiment], fitted: &Fitted) -> Vec<FieldReference> {
    let mut references = Vec::new();
    for (scene, e) in experiments.iter().enumerate() {
        for f in found(e, fitted, scene) {
            let (grid, file) = file_names(experiments.len(), scene, f.field);
            references.push(f.reference(file, grid));
        }
    }
    references
}

/// For every field by cells or nodes of a scene, its number, file and array.
pub(crate) fn files_of(fields: &[FieldReference], scene: usize, experiment: &Experiment) -> Vec<(usize, String, &'static str)> {
    let number = |f: &FieldReference| f.path.strip_prefix("field.").and_then(|i| i.parse::<usize>().ok());
    let of_scene = fields.iter().filter(|f| f.scene == scene).filter_map(|f| Some((number(f)?, f.file.clone(), ARRAY)));
    of_scene.filter(|(i, ..)| !matches!(experiment.scene().fields[*i].basis, Basis::Regions(..))).collect()
}

impl Found<'_> {
    fn write(&self, path: &Path) -> Result<(), Error> {
        let places = self.varied().places(&self.experiment.plan().body);
        let one = |values: &[f64]| Array { shape: vec![values.len()], values: values.to_vec() };
        let place = Array { shape: vec![places.len(), 3], values: places.iter().flat_map(|p| p.to_array()).collect() };
        let (values, factors) = (one(&self.values), one(&self.factors));
        let errors = self.errors.as_ref().map(|e| one(e));
        let mut arrays = vec![(ARRAY, &values), ("factor", &factors), ("place", &place)];
        arrays.extend(errors.iter().map(|e| ("standard_error", e)));
        let known: Vec<(&str, Array)> = self.posterior_arrays().into_iter().map(|(name, values)| (name, one(&values))).collect();
        arrays.extend(known.iter().map(|(name, values)| (*name, values)));
        Ok(write_npz(path, &arrays)?)
    }

    /// What is known of every value `[count]`, of a field with a prior.
    fn posterior_arrays(&self) -> Vec<(&'static str, Vec<f64>)> {
        let Some(p) = self.posterior else { return Vec::new() };
        let open = p.undetermined.iter().map(|u| f64::from(u8::from(*u))).collect();
        vec![
            ("ln_sd", p.deviation.clone()),
            ("ln_prior_sd", p.prior_deviation.clone()),
            ("gain", p.gain.clone()),
            ("undetermined", open),
        ]
    }

    fn varied(&self) -> Varied {
        self.experiment.plan().fields[self.field].varied
    }

    /// Standard error of the factor at every place, where every place has its own value.
    fn errors_by_place(&self) -> Option<&[f64]> {
        let own = matches!(
            (&self.experiment.scene().fields[self.field].basis, self.varied()),
            (Basis::Points, _) | (Basis::Cells, Varied::Modulus | Varied::Damping) | (Basis::Nodes, Varied::Density)
        );
        self.errors.as_deref().filter(|_| own)
    }

    fn reference(&self, file: String, grid: String) -> FieldReference {
        let mut sorted = self.values.clone();
        sorted.sort_by(f64::total_cmp);
        let (n, at) = (sorted.len(), |k: usize| sorted.get(k).copied());
        let median = at(n / 2).zip(at(n.saturating_sub(1) / 2)).map(|(a, b)| 0.5 * (a + b));
        FieldReference {
            path: format!("field.{}", self.field),
            varies: self.varied().path().into(),
            basis: self.experiment.scene().fields[self.field].basis.noun().into(),
            count: n,
            file,
            array: ARRAY.into(),
            grid,
            min: at(0).and_then(finite),
            median: median.and_then(finite),
            max: sorted.last().copied().and_then(finite),
            posterior: self.posterior.map(posterior),
            scene: self.scene,
        }
    }
}

/// What `result.json` says of a field with a prior.
fn posterior(p: &FieldPosterior) -> Posterior {
    let mut sorted = p.deviation.clone();
    sorted.sort_by(f64::total_cmp);
    let length = |h: palpate_fit::Hyper| (h.length > 0.0).then_some(h.length);
    let chosen = [(p.chosen.0, "length"), (p.chosen.1, "deviation")];
    Posterior {
        prior: p.kind.name().into(),
        length: length(p.hyper),
        deviation: finite(p.hyper.deviation),
        chosen: chosen.iter().filter(|c| c.0).map(|c| c.1.to_string()).collect(),
        residuals_as_one: finite(p.temper),
        effective: finite(p.effective),
        sd: [0, sorted.len() / 2, sorted.len().saturating_sub(1)].map(|k| sorted.get(k).copied().and_then(finite)),
        undetermined: p.undetermined.iter().filter(|u| **u).count(),
        undetermined_share: finite(p.undetermined_share),
        tried: p
            .tried
            .iter()
            .map(|t| Tried { length: length(t.hyper), deviation: t.hyper.deviation, evidence: finite(t.evidence) })
            .collect(),
    }
}

/// The fields on the grid, and `E_sd`, `density_sd` or `damping_sd` where a value of one field is that of a place.
fn write_grid(path: &Path, e: &Experiment, theta: &[f64], found: &[Found]) -> Result<(), Error> {
    let plan = e.plan();
    let shown: Vec<usize> = found.iter().map(|f| f.field).collect();
    let mut grid = OnGrid::new(plan, theta, &shown);
    for (_, varied) in Varied::ALL {
        let own: Vec<&Found> = found.iter().filter(|f| f.varied() == varied).collect();
        let [f] = &own[..] else { continue };
        let Some(errors) = f.errors_by_place() else { continue };
        let (name, arrays) = grid.of(varied);
        let number = arrays.iter().find(|a| a.0 == name).map(|a| a.1.clone()).unwrap_or_default();
        let sd = number.iter().zip(errors.iter().zip(&f.factors)).map(|(n, (e, factor))| n * e / factor);
        arrays.push((format!("{name}_sd"), sd.collect()));
    }
    // One field's names stand alone.
    let several = found.iter().filter(|f| f.posterior.is_some()).count() > 1;
    for f in found {
        let name = |name: &str| if several { format!("{name}_{}", f.field) } else { name.to_string() };
        let arrays = match e.scene().fields[f.field].basis {
            Basis::Nodes => &mut grid.nodes,
            _ => &mut grid.elements,
        };
        arrays.extend(f.posterior_arrays().into_iter().map(|(n, values)| (name(n), values)));
    }
    let body = &plan.body;
    Ok(write_vtu(path, &body.nodes, &Elements::of(body), &named(&grid.nodes), &named(&grid.elements))?)
}

/// Fields of a scene as arrays by element and by node.
#[derive(Debug, Default)]
pub(crate) struct OnGrid {
    /// `E` [Pa] and `damping` [s] with all fields of them, and `factor_K` of field K.
    pub(crate) elements: Vec<(String, Vec<f64>)>,
    /// `density` [kg/m³], and `factor_K`.
    pub(crate) nodes: Vec<(String, Vec<f64>)>,
}

impl OnGrid {
    /// The fields numbered `shown` at parameters θ `[P]`; nothing of a number that none of them varies.
    pub(crate) fn new(plan: &Plan, theta: &[f64], shown: &[usize]) -> OnGrid {
        let mut all = OnGrid::default();
        let keys = [ParamKey::YoungsModulus, ParamKey::Density, ParamKey::StiffnessDamping];
        for ((_, varied), key) in Varied::ALL.into_iter().zip(keys) {
            let mut number = vec![theta[plan.layout.index(key)]; varied.places(&plan.body).len()];
            let (name, out) = all.of(varied);
            for (k, (places, f)) in plan.layout.fields().zip(&plan.fields).enumerate().filter(|(_, (_, f))| f.varied == varied) {
                let factors = f.factors(&theta[places]);
                number.iter_mut().zip(&factors).for_each(|(n, factor)| *n *= factor);
                if shown.contains(&k) {
                    out.push((format!("factor_{k}"), factors));
                }
            }
            if !out.is_empty() {
                out.push((name.into(), number));
            }
        }
        all
    }

    /// Name of the number that varies, and its arrays.
    fn of(&mut self, varied: Varied) -> (&'static str, &mut Vec<(String, Vec<f64>)>) {
        match varied {
            Varied::Modulus => ("E", &mut self.elements),
            Varied::Density => ("density", &mut self.nodes),
            Varied::Damping => ("damping", &mut self.elements),
        }
    }
}

/// Arrays as a VTU file takes them.
pub(crate) fn named(arrays: &[(String, Vec<f64>)]) -> Vec<(&str, Values<'_>)> {
    arrays.iter().map(|(name, values)| (name.as_str(), Values::Numbers(values))).collect()
}
