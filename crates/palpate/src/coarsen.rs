//! Numerical coarsening (Hahn et al., Real2Sim, 2019, Sec. 6.1): numbers with which a body of coarse elements moves like one of fine ones. They
//! make up for the coarse elements' errors, so they belong to that mesh and say nothing of the material.

use crate::embed::Embedding;
use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{FitOptions, Fitted, fit};
use crate::interrupt::Interrupt;
use crate::motions::{Motion, motions};
use crate::render::Sensor;
use crate::residuals::{ResidualSummary, spread};
use crate::results::coarsening::{BoundNumber, Check, CoarseningDocument};
use crate::synthetic::{Observers, observe};
use glam::DVec3;
use palpate_engine::Stop;
use palpate_fit::Progress;
use palpate_io::output::{make_folder, write_file};
use palpate_io::{recast_scene, write_recording};
use palpate_model::scene::Resolution;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Names of the files in the output folder.
const SCENE: &str = "coarse.toml";
const MODEL: &str = "model.toml";
const RECORDINGS: [&str; 2] = ["recording", "recording-check"];
/// Deviation that counts as noise, as a share of the body's size: what a coarse body cannot follow is systematic, and this only scales it.
const NOISE: f64 = 1e-4;

/// How to coarsen.
pub struct CoarsenOptions<'a> {
    /// Elements of the coarse body.
    pub resolution: Resolution,
    /// Paths of the numbers that are fitted.
    pub free: Vec<String>,
    /// Points of the surface that are compared.
    pub points: usize,
    /// Times that are compared.
    pub frames: usize,
    /// What computes.
    pub backend: Backend,
    /// Stops in good order.
    pub interrupt: Interrupt,
    /// Hears what is done.
    pub hear: &'a mut (dyn FnMut(&str) + Send),
}

/// What was found, and where it lies.
pub struct Coarsened {
    /// `coarsening.json`.
    pub document: CoarseningDocument,
    /// The coarse scene with its numbers.
    pub model: PathBuf,
}

/// Numbers that are fitted where nobody names some: stiffness, and the damping that the scene has.
pub fn usual_numbers(fine: &Experiment) -> Vec<String> {
    let m = &fine.scene().material;
    let mut out = vec!["material.youngs_modulus".to_string(), "material.poisson_ratio".into()];
    if m.stiffness_damping > 0.0 {
        out.push("material.stiffness_damping".into());
    }
    if m.viscosity.is_some_and(|v| v.coefficient > 0.0) {
        out.extend(["material.viscosity.coefficient".into(), "material.viscosity.exponent".into()]);
    }
    out
}

/// Fits a coarse body to the motion of a fine one, checks it on a second motion, and writes everything into a folder.
///
/// # Errors
/// The coarse body is none, or a simulation or fit fails.
pub fn coarsen(fine: &Experiment, folder: &Path, options: CoarsenOptions) -> Result<Coarsened, Error> {
    if !fine.plan.clock.moves() {
        return Err(fine.fault("time", "a static scene has no motion to follow; give it a duration"));
    }
    let CoarsenOptions { resolution, free, points, frames, backend, interrupt, hear } = options;
    make_folder(folder)?;
    let watch = watch(fine, points, frames);
    // The first motion beside the scene's own that the fine body takes; a body that nothing moves has none.
    let second = motions(fine).into_iter().next();
    let all = std::iter::once(None).chain(second.as_ref().map(Some));
    for (name, motion) in RECORDINGS.iter().zip(all) {
        hear(&format!("the fine body in {}", motion.map_or("its own motion", |m| m.what.as_str())));
        let moved = motion.map(|m| m.of(fine));
        record(moved.as_ref().unwrap_or(fine), &watch, backend, &folder.join(name))?;
    }
    let text = |recording: &str| recast_scene(fine.text(), fine.scene(), resolution, recording, &free, folder);
    let path = folder.join(SCENE);
    let own = text(RECORDINGS[0])?;
    write_file(&path, |w| w.write_all(own.as_bytes()))?;
    let coarse = Experiment::open(&path)?;
    let rms = |e: &Experiment, theta: &[f64]| ResidualSummary::new(e, backend, theta, &Stop::default()).map(|r| r.rms);
    let before = rms(&coarse, &coarse.plan.theta)?;
    hear("the coarse body's numbers");
    let fitted = search(&coarse, backend, &interrupt)?;
    let after = fitted.residual().0;
    let mut check = None;
    if let (Some(motion), false) = (&second, fitted.interrupted) {
        hear(&format!("the coarse body in {}", motion.what));
        check = Some(checked(&text(RECORDINGS[1])?, &path, motion, &fitted, backend, &interrupt)?);
    }
    let document = CoarseningDocument {
        mesh: mesh(&coarse),
        fine: mesh(fine),
        nodes: [fine.plan.body.nodes.len(), coarse.plan.body.nodes.len()],
        numbers: numbers(&coarse, &fitted),
        before,
        after,
        check,
        interrupted: fitted.interrupted,
        warnings: coarse.warnings().to_vec(),
    };
    let values = fitted.values_of(0, &coarse);
    let model = palpate_io::write_scene(coarse.text(), coarse.scene(), &values, folder)?;
    let bound = format!(
        "# The numbers of this scene make {} move like {}.\n# They belong to this mesh and are no properties of the material.\n",
        document.mesh, document.fine
    );
    write_file(folder.join(MODEL), |w| w.write_all(format!("{bound}{model}").as_bytes()))?;
    crate::results::write(folder.join("coarsening.json"), &document)?;
    Ok(Coarsened { document, model: folder.join(MODEL) })
}

/// What a body is made of, in words.
fn mesh(e: &Experiment) -> String {
    let body = &e.plan.body;
    let kind = match (&body.cut, &body.points.stars) {
        (Some(_), _) => "cells",
        (None, Some(_)) => "points",
        (None, None) => "tetrahedra",
    };
    format!("{} {kind} of {:.4} mm", body.elements(), 1e3 * body.length)
}

/// Points and times that are compared.
fn watch(fine: &Experiment, points: usize, frames: usize) -> Observers {
    let (surface, _): (Embedding, _) = fine.surface(0.5 * fine.plan.body.length);
    let all: Vec<usize> = (0..surface.rest.len()).collect();
    let points: Vec<DVec3> = spread(&all, points.max(1)).into_iter().map(|k| surface.rest[k]).collect();
    let (start, end) = (fine.scene().time.start, fine.end_time());
    let times = (1..=frames.max(1)).map(|k| start + (end - start) * k as f64 / frames.max(1) as f64).collect();
    let sensor = Sensor { noise: 0.0, dropout: 0.0, depth_scale: 1e-3, seed: 1 };
    Observers { cameras: Vec::new(), markers: Vec::new(), points, displacements: false, times, sensor }
}

fn record(fine: &Experiment, watch: &Observers, backend: Backend, to: &Path) -> Result<(), Error> {
    let mut recording = observe(fine, backend, watch, |_| ControlFlow::Continue(()))?;
    let (low, high) = fine.shape().bounds();
    if let Some(points) = &mut recording.points {
        points.track.noise_sigma = Some(NOISE * (high - low).max_element());
        // The coarse body has its surface elsewhere, by a part of a cell.
        points.tolerance = Some((high - low).max_element());
    }
    Ok(write_recording(to, &recording)?)
}

fn search(coarse: &Experiment, backend: Backend, interrupt: &Interrupt) -> Result<Fitted, Error> {
    fit(
        std::slice::from_ref(coarse),
        FitOptions {
            backend,
            interrupt: interrupt.clone(),
            on_iteration: None::<&mut (dyn FnMut(&Progress) + Send)>,
            ..FitOptions::default()
        },
    )
}

/// The coarse body in the second motion: with the fine one's numbers, with those found, and with those fitted to this motion itself.
fn checked(
    text: &str,
    path: &Path,
    motion: &Motion,
    found: &Fitted,
    backend: Backend,
    interrupt: &Interrupt,
) -> Result<Check, Error> {
    let coarse = motion.of(&Experiment::from_toml(text, path)?);
    let rms = |theta: &[f64]| ResidualSummary::new(&coarse, backend, theta, &Stop::default()).map(|r| r.rms);
    let before = rms(&coarse.plan.theta)?;
    let mut theta = coarse.plan.theta.clone();
    for (path, value) in found.values_of(0, &coarse) {
        let place = coarse.plan.layout.resolve(&path);
        theta[place.start] = value;
    }
    let transferred = rms(&theta)?;
    let refitted = search(&coarse, backend, interrupt)?.residual().0;
    Ok(Check { motion: motion.what.clone(), before, transferred, refitted })
}

fn numbers(coarse: &Experiment, fitted: &Fitted) -> Vec<BoundNumber> {
    let own = |path: &str| coarse.plan.theta[coarse.plan.layout.resolve(path).start];
    let all = fitted.free.iter().zip(&fitted.result.parameters);
    all.map(|(n, p)| BoundNumber { path: n.path.clone(), fine: own(&n.path), coarse: p.value, unit: p.unit.clone() }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cantilever that falls from rest into its sag and swings, fine enough to be followed.
    const BEAM: &str = r#"
        format = "scene/1"
        [object]
        shape = { box = { min = [0, 0, 0], max = [0.08, 0.016, 0.016] } }
        cell_size = 0.004
        [material]
        density = 1000.0
        youngs_modulus = 5.0e4
        poisson_ratio = 0.4
        stiffness_damping = 0.004
        [solver]
        element = "trilinear"
        [[clamp]]
        box = { min = [-1, -1, -1], max = [0.0001, 1, 1] }
        [time]
        step = 0.01
        steps = 30
    "#;

    /// Plain trilinear elements lock in bending: coarse ones need another modulus to swing alike.
    #[test]
    fn a_coarse_body_moves_like_a_fine_one_with_numbers_of_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let fine = Experiment::from_toml(BEAM, folder.path().join("beam.toml")).unwrap_or_else(|e| panic!("{e}"));
        let options = CoarsenOptions {
            resolution: Resolution::CellSize(0.016),
            free: usual_numbers(&fine),
            points: 40,
            frames: 10,
            backend: Backend::Cpu,
            interrupt: Interrupt::default(),
            hear: &mut |_| {},
        };
        let done = coarsen(&fine, folder.path(), options).unwrap_or_else(|e| panic!("{e}"));
        let d = &done.document;
        println!("{d:#?}");
        assert!(d.after < 0.25 * d.before, "{} of {}", d.after, d.before);
        let check = d.check.as_ref().expect("a clamped body can be shaken");
        assert!(check.transferred < 0.5 * check.before && check.refitted <= check.transferred * 1.001, "{check:?}");
        assert!(d.numbers[0].coarse < 0.8 * d.numbers[0].fine, "{:?}", d.numbers);
        let text = std::fs::read_to_string(&done.model).unwrap();
        assert!(text.starts_with("# The numbers of this scene make 5 cells of 16.0000 mm move like"), "{text}");
        let again = Experiment::open(&done.model).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(again.scene().material.youngs_modulus, d.numbers[0].coarse);
    }
}
