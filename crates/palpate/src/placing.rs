//! Control regions where the recording asks for them: a number that is one everywhere becomes one a region, region by region.
//!
//! ```text
//! fit → gradient and curvature by zones of the body → evidence for one more control (palpate_fit::Zones)
//! worth it:     the scene with that control, and again
//! else:         done
//! ```

use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{FitOptions, Fitted};
use crate::interrupt::Interrupt;
use crate::objective::{Coordinates, Objective};
use glam::DVec3;
use palpate_fit::{Controls, Zones};
use palpate_io::scene_with_regions;
use palpate_model::params::fields::{Basis, Blend, FieldSpec, Region, Scale, Varied};
use palpate_model::scene::WarmStart;
use palpate_model::shape::spread;

/// Zones that a body is cut into: each costs a direction of one evaluation, and bodies of more parts than this are fitted as fields by cells.
const ZONES: usize = 24;
/// Most that a control's factor is moved before the next fit: a linearised fit says no more.
const STEP: f64 = 2.0;

/// Choices of [`place`].
#[derive(Clone, Debug)]
pub struct PlaceOptions {
    /// The number that varies; it must be free.
    pub varied: Varied,
    /// Most controls.
    pub most: usize,
    /// How they share the body.
    pub blend: Blend,
    /// What computes.
    pub backend: Backend,
    /// Ends it in good order.
    pub interrupt: Interrupt,
}

impl Default for PlaceOptions {
    fn default() -> PlaceOptions {
        PlaceOptions {
            varied: Varied::Modulus,
            most: 8,
            blend: Blend::Nearest,
            backend: Backend::Cpu,
            interrupt: Interrupt::default(),
        }
    }
}

/// A fit with so many controls.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaceRound {
    /// Number of controls.
    pub controls: usize,
    /// Cost of its fit.
    pub cost: f64,
    /// Mean square residual over the squared noise.
    pub reduced_chi_square: f64,
    /// What one control more would add to the logarithm of the evidence; nothing where none was looked for.
    pub gain: Option<f64>,
    /// Places that were tried for it.
    pub tried: usize,
}

/// A control that was placed.
#[derive(Clone, Debug, PartialEq)]
pub struct Placed {
    /// Its region and factor.
    pub region: Region,
    /// Standard error of the factor.
    pub standard_error: Option<f64>,
}

/// What [`place`] found.
#[derive(Debug)]
pub struct Placement {
    /// The scene with the controls and their values.
    pub experiment: Experiment,
    /// The last fit.
    pub fitted: Fitted,
    /// The controls; none where the number is one everywhere.
    pub controls: Vec<Placed>,
    /// Every fit.
    pub rounds: Vec<PlaceRound>,
    /// True where it was ended before its end.
    pub interrupted: bool,
}

/// Middles of zones: farthest-point sampling of the places where the number varies, from the one next to their mean.
fn middles(places: &[DVec3]) -> Vec<DVec3> {
    let mean = places.iter().sum::<DVec3>() / places.len().max(1) as f64;
    let away = |k: &usize| (places[*k] - mean).length_squared();
    let first = (0..places.len()).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or(0);
    spread(places, first, ZONES).into_iter().map(|k| places[k]).collect()
}

/// Balls around the centres that do not meet.
fn regions(e: &Experiment, centres: &[DVec3], values: &[f64]) -> Vec<Region> {
    let apart = |a: &DVec3| centres.iter().filter(|b| *b != a).map(|b| (*b - *a).length()).fold(f64::INFINITY, f64::min);
    let closest = centres.iter().map(apart).fold(f64::INFINITY, f64::min);
    // Two cells: a region of a single node has no capacity, and its contrast falls with the cells' size.
    let radius = (2.0 * e.plan().body.length).min(0.45 * closest);
    centres.iter().zip(values).map(|(center, value)| Region { center: *center, radius, value: *value }).collect()
}

/// A body on its way to controls.
struct Way<'a> {
    options: &'a PlaceOptions,
    /// Number of the field of controls.
    number: usize,
    middles: Vec<DVec3>,
}

impl Way<'_> {
    fn spec(&self, regions: Vec<Region>, blend: Blend) -> FieldSpec {
        let basis = Basis::Regions(regions, blend);
        FieldSpec { varied: self.options.varied, basis, scale: Scale::Log, values: None, prior: None }
    }

    /// True of what a field of its own takes the place of.
    fn bound(&self, path: &str) -> bool {
        path == self.options.varied.path() || path.starts_with(&format!("field.{}.", self.number))
    }

    /// A fit as the scene says, or another one that starts where the last one ended.
    fn fit(&self, e: &Experiment, again: bool, starts: &[(String, f64)]) -> Result<Fitted, Error> {
        let (backend, interrupt) = (self.options.backend, self.options.interrupt.clone());
        let begun = e.searched(|f| {
            if again {
                (f.starts, f.warm_start) = (1, WarmStart::Stated);
            }
            for (path, value) in starts {
                f.parameters.iter_mut().filter(|p| p.path == *path).for_each(|p| p.start = (*value, *value));
            }
        });
        begun.fit(FitOptions { backend, interrupt, hurried: true, ..FitOptions::default() })
    }

    /// What a fit's end says of the zones, which follow the controls `own` as the scene has them.
    fn zones(&self, e: &Experiment, fitted: &Fitted, own: &[usize], values: &[f64]) -> Result<Option<Zones>, Error> {
        let number = e.scene().fields.len();
        let ones = vec![1.0; self.middles.len()];
        let spec = self.spec(regions(e, &self.middles, &ones), Blend::Nearest);
        let text = scene_with_regions(e.text(), e.scene(), number, &spec, |path| self.bound(path))?;
        let zoned = e.reworded(text)?;
        let mut cost = Objective::new(std::slice::from_ref(&zoned), self.options.backend, Coordinates::Physical)?;
        cost.until(&self.options.interrupt);
        let x = cost.start();
        let (gradient, curvature) = cost.gradient_and_curvature(&x)?;
        // The cost is half the mean square: −ln L of as many readings as the recording is worth, with the noise that was found.
        let readings = if fitted.result.independent.is_finite() { fitted.result.independent } else { f64::NAN };
        let count = if readings.is_nan() { fitted.after.iter().map(|r| r.points).sum::<usize>() as f64 } else { readings };
        let scale = count / fitted.result.reduced_chi_square.max(1.0);
        let prefix = format!("field.{number}.");
        let places: Vec<usize> = (0..x.len()).filter(|i| cost.names()[*i].starts_with(&prefix)).collect();
        let scaled = |all: Vec<f64>| all.into_iter().map(|v| scale * v).collect::<Vec<_>>();
        let now = self.middles.iter().map(|m| self.value_at(*m, own, values).ln()).collect();
        let at = self.middles.iter().map(|m| m.to_array()).collect();
        Ok(Zones::new(at, now, &scaled(gradient), &scaled(curvature), &places))
    }

    /// Factor of the control next to a place; one where there are none.
    fn value_at(&self, place: DVec3, own: &[usize], values: &[f64]) -> f64 {
        let away = |k: &usize| (self.middles[own[*k]] - place).length_squared();
        (0..own.len()).min_by(|a, b| away(a).total_cmp(&away(b))).map_or(1.0, |k| values[k])
    }

    /// The scene with these controls.
    fn with(&self, e: &Experiment, found: &Controls) -> Result<Experiment, Error> {
        let centres: Vec<DVec3> = found.zones.iter().map(|z| self.middles[*z]).collect();
        let values: Vec<f64> = found.values.iter().map(|v| v.clamp(-STEP, STEP).exp()).collect();
        let spec = self.spec(regions(e, &centres, &values), self.options.blend);
        e.reworded(scene_with_regions(e.text(), e.scene(), self.number, &spec, |path| self.bound(path))?)
    }
}

/// Finds over which regions a number varies, from a recording and a scene that has it free; `hear` is told in words what is being done.
///
/// # Errors
/// As of a fit; the number is not free, or varies already.
pub fn place(experiment: &Experiment, options: &PlaceOptions, mut hear: impl FnMut(&str)) -> Result<Placement, Error> {
    let path = options.varied.path();
    let free = experiment.scene().fit.iter().flat_map(|f| &f.parameters);
    if !free.clone().any(|p| p.path == path) {
        let text = format!("needs \"{path}\", of which is to be found over which regions it varies");
        return Err(experiment.fault("fit.parameter", text));
    }
    if let Some(i) = experiment.scene().fields.iter().position(|f| f.varied == options.varied) {
        return Err(
            experiment.fault(&format!("field.{i}"), format!("varies {path} already: take it out to have controls placed"))
        );
    }
    let places = options.varied.places(&experiment.plan().body);
    let way = Way { options, number: experiment.scene().fields.len(), middles: middles(&places) };
    hear("a fit with one value");
    let fitted = way.fit(experiment, false, &[])?;
    let found = experiment.with_values(&fitted.values_of(0, experiment))?;
    let mut at = Placement { experiment: found, fitted, controls: Vec::new(), rounds: Vec::new(), interrupted: false };
    let mut own: Vec<usize> = Vec::new();
    loop {
        let result = &at.fitted.result;
        at.rounds.push(PlaceRound {
            controls: own.len().max(1),
            cost: result.cost,
            reduced_chi_square: result.reduced_chi_square,
            gain: None,
            tried: 0,
        });
        at.interrupted |= at.fitted.interrupted || options.interrupt.is_raised();
        if at.interrupted || own.len().max(1) >= options.most.max(1) {
            break;
        }
        hear(&format!("{} zones for control number {}", way.middles.len(), own.len().max(1) + 1));
        let values: Vec<f64> = at.controls.iter().map(|c| c.region.value).collect();
        let zones = match way.zones(&at.experiment, &at.fitted, &own, &values) {
            Err(Error::Interrupted) => {
                at.interrupted = true;
                break;
            }
            other => other?,
        };
        let Some(next) = zones.and_then(|z| z.next(&own)) else { break };
        if let Some(round) = at.rounds.last_mut() {
            (round.gain, round.tried) = (Some(next.gain), next.tried);
        }
        if !next.worth() {
            break;
        }
        hear(&format!("a fit with {} controls", next.zones.len()));
        let with = way.with(&at.experiment, &next)?;
        // The controls start where the linearised fit has them.
        let mut starts = at.fitted.values_of(0, &at.experiment);
        starts.retain(|(path, _)| !way.bound(path));
        let fitted = way.fit(&with, true, &starts)?;
        // What a linearised fit promised and the fit does not keep is no control.
        if fitted.interrupted || fitted.result.cost >= at.fitted.result.cost {
            at.interrupted |= fitted.interrupted;
            break;
        }
        at.experiment = with.with_values(&fitted.values_of(0, &with))?;
        own = next.zones;
        at.controls = placed(&at.experiment, &fitted, way.number);
        at.fitted = fitted;
    }
    Ok(at)
}

/// The controls of a scene with what a fit knows of them.
fn placed(e: &Experiment, fitted: &Fitted, number: usize) -> Vec<Placed> {
    let Some(Basis::Regions(regions, _)) = e.scene().fields.get(number).map(|f| &f.basis) else { return Vec::new() };
    let error = |k: usize| {
        let own = format!("field.{number}.{k}");
        let found = fitted.free.iter().zip(&fitted.result.parameters).find(|(n, _)| n.path == own);
        found.and_then(|(_, p)| p.standard_error)
    };
    regions.iter().enumerate().map(|(k, r)| Placed { region: *r, standard_error: error(k) }).collect()
}
