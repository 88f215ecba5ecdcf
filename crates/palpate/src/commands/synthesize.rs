//! `palpate synthesize`: motions that nobody has measured.

use super::frames::{Output, write_motion};
use super::simulate::{document, sentence};
use crate::cli::{Console, INTERRUPTED};
use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fitting::{demand, free_parameters, usual};
use crate::options::{BackendName, out_folder};
use crate::results::synthesis::{KeyframeDocument, LoopDocument, SearchDocument, SynthesisDocument};
use crate::results::{self, finite};
use crate::synthesis::{Led, Search};
use clap::Args;
use palpate_io::output::write_file;
use palpate_io::{InputError, append_effects, edit_scene, parse_scene, read_text, without_wishes, write_scene};
use palpate_model::scene::Scene;
use std::path::{Path, PathBuf};

const AFTER_HELP: &str = "\
Examples:
  palpate synthesize leaf.toml                          handles, wind, blows and balls of the scene, frames in out/leaf-motion/
  palpate synthesize found/model.toml --edit gravity=[0,0,-1.6]            what a fit has found, on the moon
  palpate synthesize found/model.toml --edit 'effect.0={ kind = \"wind\", mean = [4, 0, 0], gust = [2, 0, 0] }'
  palpate synthesize walk.toml --format vtu --every 5   keyframes: the forces that lead the body through them

A handle ([[handle]]) with a path pulls the body along it. Handles without one are free: their forces are found so that
the body passes the scene's keyframes ([[keyframe]]), with as little force as [synthesize] says, and ends as it began
where loop = true. Laws like wind, impulse and push are effects (palpate inspect --effects).

--edit changes a key of the scene before it is read: a dotted key and a TOML value. The number after the last row of
an array adds a row. The scene with all edits and all forces found is written as scene.toml beside the frames;
palpate simulate makes the same motion of it. synthesis.json says how keyframes are met, forces.csv holds the
forces at every step. The scene's recording is not read.";

/// Make a motion: handles, wind, pushes, edits, keyframes
#[derive(Clone, Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// Scene file, or the model.toml of a fit
    scene: PathBuf,
    /// Output folder [default: out/SCENE-motion]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Change a key of the scene, like material.youngs_modulus=2e4; any number of times
    #[arg(long, value_name = "KEY=VALUE")]
    edit: Vec<String>,
    /// What computes
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendName,
    #[command(flatten)]
    output: Output,
}

/// The scene with its edits, compared with nothing.
fn open(a: &Arguments) -> Result<Experiment, Error> {
    let text = edit_scene(&read_text(&a.scene)?, &a.scene, &a.edit)?;
    // Lines of an edited text are not those of the file.
    let unlined = |e: InputError| if a.edit.is_empty() { e } else { InputError { line: None, ..e } };
    let loaded = parse_scene(&text, &a.scene).map_err(unlined)?;
    let scene = Scene { observation: None, targets: Vec::new(), ..loaded.value };
    if scene.time.steps == 0 {
        let message = "0 leaves no motion to make; give a step and a duration".to_string();
        return Err(palpate_io::scene_error(&scene.path, &text, "time.duration", message).into());
    }
    Experiment::new(scene, text, loaded.warnings)
}

/// Finds the forces of free handles, where there are some.
fn lead(a: &Arguments, base: &Experiment, console: &mut Console) -> Result<Option<(Search, Led, Backend)>, Error> {
    let mut track = console.progress(base.scene().synthesis.iterations as u64, "leading");
    let start = a.backend.choose(base.plan(), 1, &mut track)?.0;
    let Some(search) = Search::new(base, start)? else { return Ok(None) };
    let (_, free, _) = free_parameters(std::slice::from_ref(&search.experiment))?;
    let demand = demand(&free, 0, usual(&free), 1);
    let (backend, note) = a.backend.choose_for(search.experiment.plan(), &demand, &mut track)?;
    track.aside(|| note.iter().for_each(|n| console.note(n)));
    track.on(0, "the first evaluations");
    let interrupt = console.interrupt.clone();
    let led = search.run(backend, &interrupt, &mut |p| track.on(u64::from(p.iteration > 0), &format!("cost {:.4}", p.cost)))?;
    track.finish();
    Ok(Some((search, led, backend)))
}

/// The text of the scene that makes the motion, as it holds in a folder.
fn settled(base: &Experiment, found: Option<&(Search, Led, Backend)>, folder: &Path) -> Result<String, Error> {
    // What was left open and chosen is what the forces were found for.
    let chosen: Vec<(String, f64)> = base.chosen().iter().map(|(key, value, _)| (key.to_string(), *value)).collect();
    let text = write_scene(base.text(), base.scene(), &chosen, folder)?;
    let text = without_wishes(&text, base.scene())?;
    Ok(match found {
        Some((search, led, _)) => append_effects(&text, base.scene(), &search.effects(led))?,
        None => text,
    })
}

fn search_document(found: &(Search, Led, Backend)) -> SearchDocument {
    let (_, led, backend) = found;
    let (fitted, result) = (&led.fitted, &led.fitted.result);
    SearchDocument {
        backend: backend.name().into(),
        optimizer: fitted.optimizer.name().into(),
        coefficients: result.parameters.len(),
        evaluations: result.evaluations,
        seconds: result.seconds,
        interrupted: fitted.interrupted,
        cost: [finite(result.initial_cost), finite(result.cost)],
        largest_force: led.forces.iter().flatten().map(|f| f.length()).fold(0.0, f64::max),
        keyframes: (led.met.iter())
            .map(|m| KeyframeDocument { time: m.time, points: m.points, rms: finite(m.rms), worst: finite(m.worst) })
            .collect(),
        closed: led.closed.map(|[gap, speed]| LoopDocument { gap: finite(gap), speed: finite(speed) }),
    }
}

/// What the search came to, line by line.
fn lines(d: &SearchDocument) -> Vec<String> {
    let mm = |x: Option<f64>| x.map_or("?".to_string(), |x| format!("{:.3} mm", 1e3 * x));
    let mut out = vec![format!(
        "{} coefficients in {} evaluations, {:.1} s ({}, {}); largest force {:.3} N",
        d.coefficients, d.evaluations, d.seconds, d.optimizer, d.backend, d.largest_force
    )];
    for k in &d.keyframes {
        out.push(format!(
            "  keyframe at {:.4} s: {} points, off by {} (rms), {} at most",
            k.time,
            k.points,
            mm(k.rms),
            mm(k.worst)
        ));
    }
    if let Some(c) = &d.closed {
        let speed = c.speed.map_or("?".to_string(), |v| format!("{v:.3e} m/s"));
        out.push(format!("  the loop closes within {} and {speed}", mm(c.gap)));
    }
    out
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    let folder = out_folder(&a.out, &a.scene, "-motion");
    let (base, track, lock) = crate::folder::begin(&folder, "synthesizing", console, || open(a))?;
    track.finish();
    let found = lead(a, &base, console)?;
    lock.check()?;
    let model = folder.join("scene.toml");
    let text = settled(&base, found.as_ref(), &folder)?;
    write_file(&model, |w| w.write_all(text.as_bytes()))?;
    if let Some((search, led, _)) = &found {
        let csv = search.csv(led);
        write_file(folder.join("forces.csv"), |w| w.write_all(csv.as_bytes()))?;
    }
    let stopped = found.as_ref().is_some_and(|(_, led, _)| led.fitted.interrupted);
    let experiment = Experiment::open_without_recording(&model)?;
    let mut track = console.progress(0, "simulating");
    let (backend, note) = a.backend.choose(experiment.plan(), 1, &mut track)?;
    track.aside(|| note.iter().for_each(|n| console.note(n)));
    let written = write_motion(&experiment, backend, &folder, &a.output, track, console)?;
    let search = found.as_ref().map(search_document);
    let result = SynthesisDocument {
        motion: document(&experiment, &folder, backend.name(), &written),
        model: model.display().to_string(),
        search,
    };
    results::write(folder.join("synthesis.json"), &result)?;
    if console.json() {
        console.print(&results::line(&result));
    } else {
        result.search.iter().flat_map(lines).for_each(|line| console.print(&line));
        console.print(&sentence(&result.motion));
    }
    Ok(if stopped || written.interrupted.is_some() { INTERRUPTED } else { 0 })
}
