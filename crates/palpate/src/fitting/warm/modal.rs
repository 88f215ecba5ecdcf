//! Stiffness and damping from vibrations (Wang et al. 2015, section 5.3): frequencies and damping ratios are read off the record without any
//! simulation, and the model's modulus is scaled until it vibrates as fast.
//!
//! With fixed shapes of rest and equilibrium ω² goes with the modulus, so that `E ← E (ω/ω_model)²` would be exact in one step. A body that
//! droops does so less when it is stiffer. So the first step is taken without gravity, where the guess does not matter at all, and further ones about
//! the equilibrium, by secants of ln ω² over ln E.

use crate::experiment::Experiment;
use glam::{DMat3, DVec3};
use palpate_cpu::CpuBackend;
use palpate_cpu::modes::Modes;
use palpate_engine::number;
use palpate_fit::{Vibration, vibrations};
use palpate_model::observation::Observation;
use palpate_model::params::fields::Varied;
use palpate_model::plan::Plan;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Vibrations that are looked for in the record, and modes of the model that they are compared with.
const MOST: usize = 4;
const MODES: usize = 8;
/// Agreement of shapes (modal assurance criterion, Allemang & Brown 1982) from which on two are the same one.
const ALIKE: f64 = 0.5;
/// Modes this near each other, relative to the frequency, are one space: a square bar bends either way as easily.
const TOGETHER: f64 = 0.03;
/// Relative change of the modulus that is small enough for a start, and most steps about the equilibrium.
const NEAR: f64 = 0.005;
const STEPS: usize = 8;
/// Least exponent of ω² over E that says something of E: with less, weight and not stiffness brings the body back.
const TELLS: f64 = 0.2;
/// Share of the damping ratio that a model of two numbers is allowed to be wrong by, beside its standard error.
const ROUGH: f64 = 0.05;

/// What vibrations say of a scene's numbers.
#[derive(Clone, Debug)]
pub struct Told {
    /// Factor of the modulus, or of all its fields' values, over what the scene states.
    pub stiffness: f64,
    /// Damping by mass [1/s] and by stiffness [s], as far as they were asked for.
    pub damping: [Option<f64>; 2],
    /// What was seen and done, in sentences.
    pub notes: Vec<String>,
}

/// What is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Asked {
    /// The modulus, or the values of its fields.
    pub stiffness: bool,
    /// Damping by mass, by stiffness.
    pub damping: [bool; 2],
}

/// The motion of tracked things as rows of numbers, without gaps.
struct Record {
    times: Vec<f64>,
    /// Coordinates [m] `[F][3 S]`.
    rows: Vec<Vec<f64>>,
    /// Which things they are.
    things: Vec<Thing>,
}

/// A site or a node of the observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Thing {
    Site(u32),
    Node(u32),
}

/// All places of a frame by thing.
fn places(o: &Observation, frame: usize) -> BTreeMap<Thing, DVec3> {
    let f = &o.frames[frame];
    let sites = f.markers.iter().map(|m| (Thing::Site(m.site), m.position));
    sites.chain(f.displacements.iter().map(|d| (Thing::Node(d.node), d.value))).collect()
}

/// The largest part of the record without gaps: of frames and things the one with the most gaps is left out, until there are none.
fn record(o: &Observation, from: f64) -> Record {
    let mut frames: Vec<(f64, BTreeMap<Thing, DVec3>)> =
        (0..o.frames.len()).filter(|f| o.frames[*f].time >= from).map(|f| (o.frames[f].time, places(o, f))).collect();
    frames.retain(|f| !f.1.is_empty());
    let mut things: Vec<Thing> = frames.iter().flat_map(|f| f.1.keys().copied()).collect();
    things.sort_unstable();
    things.dedup();
    loop {
        let gaps_of = |t: &Thing| frames.iter().filter(|f| !f.1.contains_key(t)).count() as f64 / frames.len().max(1) as f64;
        let gaps_in =
            |k: usize| things.iter().filter(|t| !frames[k].1.contains_key(t)).count() as f64 / things.len().max(1) as f64;
        let worst_thing =
            (0..things.len()).map(|i| (gaps_of(&things[i]), i)).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let worst_frame = (0..frames.len()).map(|k| (gaps_in(k), k)).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        match (worst_thing, worst_frame) {
            (Some((g, i)), Some((h, _))) if g > 0.0 && g >= h => drop(things.remove(i)),
            (_, Some((h, k))) if h > 0.0 => drop(frames.remove(k)),
            _ => break,
        }
    }
    let row = |f: &BTreeMap<Thing, DVec3>| things.iter().flat_map(|t| f[t].to_array()).collect();
    Record { times: frames.iter().map(|f| f.0).collect(), rows: frames.iter().map(|f| row(&f.1)).collect(), things }
}

/// What a mode of the model does to the things of the record `[3 S]`.
fn at_things(o: &Observation, things: &[Thing], shape: &[DVec3]) -> Vec<f64> {
    let of = |t: &Thing| match t {
        Thing::Node(n) => shape[*n as usize],
        Thing::Site(s) => {
            let site = &o.markers[*s as usize];
            let (p, f): (DVec3, DMat3) = site.carry(|i| shape[i]);
            // A stalk turns with the skew part of the gradient.
            p + 0.5 * ((f - f.transpose()) * site.stalk)
        }
    };
    things.iter().flat_map(|t| of(t).to_array()).collect()
}

/// Agreement of a measured vibration with every mode, 0 to 1; modes of one frequency agree together.
fn agreement(v: &Vibration, modes: &Modes, o: &Observation, things: &[Thing]) -> Vec<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let squares = dot(&v.cosine, &v.cosine) + dot(&v.sine, &v.sine);
    let alone: Vec<f64> = modes
        .shapes
        .iter()
        .map(|shape| {
            let s = at_things(o, things, shape);
            (dot(&s, &v.cosine).powi(2) + dot(&s, &v.sine).powi(2)) / (dot(&s, &s) * squares).max(f64::MIN_POSITIVE)
        })
        .collect();
    let w = &modes.frequencies;
    let near = |a: usize, b: usize| (w[a] - w[b]).abs() <= TOGETHER * w[a];
    (0..w.len()).map(|a| (0..w.len()).filter(|b| near(a, *b)).map(|b| alone[b]).sum::<f64>().min(1.0)).collect()
}

/// The mode that agrees best and how well.
fn best(v: &Vibration, modes: &Modes, o: &Observation, things: &[Thing]) -> (usize, f64) {
    let all = agreement(v, modes, o, things);
    (0..all.len()).map(|k| (k, all[k])).max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0))).unwrap_or((0, 0.0))
}

/// θ with a stiffer body.
fn scaled(plan: &Plan, stiffness: f64, fields: bool) -> Vec<f64> {
    let mut theta = plan.theta.clone();
    let places = match fields {
        false => plan.layout.resolve("material.youngs_modulus"),
        true => {
            let first = (0..plan.fields.len()).find(|k| plan.fields[*k].varied == Varied::Modulus);
            first.map_or(0..0, |k| plan.layout.resolve(&format!("field.{k}")))
        }
    };
    theta[places].iter_mut().for_each(|v| *v *= stiffness);
    theta
}

fn hertz(w: f64) -> f64 {
    w / TAU
}

/// Reads vibrations off the experiment's markers, tracks or displacements and moves the model to them; `fields` says that the modulus itself
/// is held and the values of its first field are not.
///
/// # Errors
/// Why they say nothing, in words that follow "no start by vibrations:".
pub fn told(e: &Experiment, asked: Asked, fields: bool) -> Result<Told, String> {
    let (plan, o) = (e.plan(), &*e.plan().observation);
    if plan.clamps.is_empty() {
        return Err("nothing holds the body".into());
    }
    if plan.clamps.iter().any(|c| c.motion.is_some()) {
        return Err("a clamp moves, and the body with it".into());
    }
    let record = record(o, e.scene().time.start);
    if record.things.is_empty() {
        return Err("no marker or tracked point was seen often enough".into());
    }
    let seen = vibrations(&record.times, &record.rows, MOST)?;
    let strongest = seen.first().ok_or("nothing in the record vibrates")?;
    let backend = CpuBackend;
    let at = |plan: &Plan, factor: f64| -> Result<(Modes, usize, f64), String> {
        let modes = backend.modes(plan, &scaled(plan, factor, fields), MODES).map_err(|f| f.to_string())?;
        let (k, alike) = best(strongest, &modes, o, &record.things);
        Ok((modes, k, alike))
    };
    let mut weightless = plan.clone();
    let gravity = weightless.layout.resolve("world.gravity");
    weightless.theta[gravity].iter_mut().for_each(|g| *g = 0.0);
    let mut notes = Vec::new();
    let mut factor = 1.0;
    let (mut modes, mut k, mut alike) = at(&weightless, 1.0)?;
    let mut told_exponent = 1.0;
    if asked.stiffness {
        let aim = 2.0 * strongest.frequency.ln();
        factor = (strongest.frequency / modes.frequencies[k]).powi(2);
        let mut before: Option<(f64, f64)> = None;
        for _ in 0..STEPS {
            let Ok(next) = at(plan, factor) else {
                notes.push("about the drooping shape the model has no vibrations: those without gravity count".into());
                break;
            };
            (modes, k, alike) = next;
            let now = (factor.ln(), 2.0 * modes.frequencies[k].ln());
            if let Some(b) = before.filter(|b| (b.0 - now.0).abs() > 1e-9) {
                told_exponent = ((b.1 - now.1) / (b.0 - now.0)).clamp(TELLS, 4.0);
            }
            let step = ((aim - now.1) / told_exponent).clamp(-1.5, 1.5);
            before = Some(now);
            factor *= step.exp();
            if step.abs() < NEAR {
                break;
            }
        }
    }
    if alike < ALIKE {
        return Err(format!(
            "what vibrates at {} Hz looks like none of the model's slowest {MODES} vibrations (agreement {:.2} with that at {} Hz)",
            number(hertz(strongest.frequency)),
            alike,
            number(hertz(modes.frequencies[k]))
        ));
    }
    notes.push(format!(
        "measured: {} ± {} Hz, damping ratio {} ± {}; vibration {} of the model (agreement of shapes {alike:.2})",
        number(hertz(strongest.frequency)),
        number(hertz(strongest.frequency_sd)),
        number(strongest.damping),
        number(strongest.damping_sd),
        k + 1
    ));
    if asked.stiffness && told_exponent <= TELLS {
        notes.push("the body's weight, not its stiffness, brings it back: its frequency says little of the modulus".into());
    }
    let matched: Vec<&Vibration> = seen.iter().filter(|v| best(v, &modes, o, &record.things).1 >= ALIKE).collect();
    let damping = damping(plan, asked.damping, &matched, &mut notes);
    Ok(Told { stiffness: factor, damping, notes })
}

/// The dampings that are asked for, by least squares over `ζ = ½ (α/ω + β ω)` with the others as they are; one vibration gives one of them.
fn damping(plan: &Plan, mut asked: [bool; 2], seen: &[&Vibration], notes: &mut Vec<String>) -> [Option<f64>; 2] {
    const PATHS: [&str; 2] = ["material.mass_damping", "material.stiffness_damping"];
    let stated = PATHS.map(|p| plan.layout.resolve(p).map(|k| plan.theta[k]).next().unwrap_or(0.0));
    if asked == [true, true] && seen.len() < 2 {
        asked[0] = false;
        notes.push("one vibration tells one kind of damping: that by mass starts as stated".into());
    }
    let (mut a, mut b) = ([[0.0; 2]; 2], [0.0; 2]);
    for v in seen {
        let weight = 1.0 / (v.damping_sd.powi(2) + (ROUGH * v.damping).powi(2)).max(f64::MIN_POSITIVE);
        let row = [0.5 / v.frequency, 0.5 * v.frequency];
        let known: f64 = (0..2).filter(|i| !asked[*i]).map(|i| row[i] * stated[i]).sum();
        for i in 0..2 {
            b[i] += weight * row[i] * (v.damping - known);
            for j in 0..2 {
                a[i][j] += weight * row[i] * row[j];
            }
        }
    }
    let one = |i: usize| (asked[i] && a[i][i] > 0.0).then(|| b[i] / a[i][i]).filter(|x| *x > 0.0);
    if asked != [true, true] {
        return [one(0), one(1)];
    }
    let det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    let both = [(b[0] * a[1][1] - b[1] * a[0][1]) / det, (b[1] * a[0][0] - b[0] * a[1][0]) / det];
    if both.iter().all(|x| x.is_finite() && *x > 0.0) {
        return both.map(Some);
    }
    // One of them alone explains the ratios better than any positive pair.
    let cost = |i: usize, x: f64| a[i][i] * x * x - 2.0 * b[i] * x;
    let [alpha, beta] = [one(0), one(1)];
    match (alpha, beta) {
        (Some(x), Some(y)) if cost(0, x) < cost(1, y) => [Some(x), None],
        (_, beta) => [if beta.is_none() { alpha } else { None }, beta],
    }
}
