//! `palpate place`: control regions where the recording asks for them.

use crate::cli::{Console, INTERRUPTED};
use crate::error::Error;
use crate::experiment::Experiment;
use crate::memory::Demand;
use crate::options::{BackendName, count, out_folder};
use crate::placing::{PlaceOptions, Placement, place};
use crate::results;
use crate::results::finite;
use crate::results::placement::{ControlRow, PlaceRoundRow, PlacementDocument};
use clap::{Args, ValueEnum};
use palpate_diagnose::stated;
use palpate_engine::number;
use palpate_io::output::write_file;
use palpate_model::params::ParamKey;
use palpate_model::params::fields::{Blend, Varied};
use std::path::PathBuf;
use std::time::Instant;

const AFTER_HELP: &str = "\
Examples:
  palpate place arm.toml --out parts                       where the stiffness varies, in parts/scene.toml
  palpate place arm.toml --most 4 --blend harmonic         at most four regions, with smooth passages between them
  palpate place arm.toml --number stiffness-damping
  palpate place arm.toml --out parts && palpate fit parts/scene.toml

The scene has the number free in [fit]. It is fitted as one value first. Then the body is cut into 24 zones, and the gradient and curvature
of that fit tell where a second value would explain the recording best; it is placed where the logarithm of the evidence grows by more
than that of the number of places that were tried, the scene is fitted again, and so on.

placed.json (placement/1) has the controls with factors and errors, and what each fit said. scene.toml is the scene with them as a
[[field]] of regions, their values free: `palpate fit` reads it.";

/// Find over which regions of the body a number varies
#[derive(Clone, Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub struct Arguments {
    /// Scene file with a recording, and the number free in [fit]
    scene: PathBuf,
    /// Output folder [default: out/SCENE-placed]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// The number
    #[arg(long, value_enum, default_value = "youngs-modulus")]
    number: Number,
    /// Most controls
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = count(2..=24), allow_negative_numbers = true)]
    most: u64,
    /// How they share the body: the nearest alone, or smoothly
    #[arg(long, value_enum, default_value = "nearest")]
    blend: Sharing,
    /// What computes
    #[arg(long, value_enum, default_value = "auto")]
    backend: BackendName,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Number {
    /// material.youngs_modulus
    YoungsModulus,
    /// material.density
    Density,
    /// material.stiffness_damping
    StiffnessDamping,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Sharing {
    /// The nearest alone
    Nearest,
    /// By Laplace's equation between them
    Harmonic,
}

impl Number {
    fn varied(self) -> (Varied, ParamKey) {
        match self {
            Number::YoungsModulus => (Varied::Modulus, ParamKey::YoungsModulus),
            Number::Density => (Varied::Density, ParamKey::Density),
            Number::StiffnessDamping => (Varied::Damping, ParamKey::StiffnessDamping),
        }
    }
}

fn document(a: &Arguments, p: &Placement, seconds: f64) -> PlacementDocument {
    let (varied, key) = a.number.varied();
    let plan = p.experiment.plan();
    let verdict = match (p.interrupted, p.controls.is_empty()) {
        (true, _) => "interrupted",
        (false, true) => "one everywhere",
        (false, false) => "placed",
    };
    let control = |c: &crate::placing::Placed| ControlRow {
        center: c.region.center.to_array(),
        radius: c.region.radius,
        factor: finite(c.region.value),
        standard_error: c.standard_error.and_then(finite),
    };
    let round = |r: &crate::placing::PlaceRound| PlaceRoundRow {
        controls: r.controls,
        cost: finite(r.cost),
        reduced_chi_square: finite(r.reduced_chi_square),
        gain: r.gain.and_then(finite),
        tried: r.tried,
    };
    PlacementDocument {
        scene: a.scene.display().to_string(),
        verdict: verdict.into(),
        number: varied.path().into(),
        unit: key.spec().unit.into(),
        value: finite(plan.theta[plan.layout.index(key)]),
        blend: if a.blend == Sharing::Nearest { Blend::Nearest } else { Blend::Harmonic }.name().into(),
        seconds,
        controls: p.controls.iter().map(control).collect(),
        rounds: p.rounds.iter().map(round).collect(),
    }
}

pub fn run(a: &Arguments, console: &mut Console) -> Result<i32, Error> {
    let folder = out_folder(&a.out, &a.scene, "-placed");
    let (experiment, mut progress, lock) = crate::folder::begin(&folder, "placing", console, || Experiment::open(&a.scene))?;
    let clock = Instant::now();
    let (backend, note) = a.backend.choose_for(experiment.plan(), &Demand::forward(1), &mut progress)?;
    progress.aside(|| note.iter().for_each(|n| console.note(n)));
    let options = PlaceOptions {
        varied: a.number.varied().0,
        most: a.most as usize,
        blend: if a.blend == Sharing::Nearest { Blend::Nearest } else { Blend::Harmonic },
        backend,
        interrupt: console.interrupt.clone(),
    };
    let placement = place(&experiment, &options, |what| progress.on(0, what))?;
    progress.finish();
    lock.check()?;
    let document = document(a, &placement, clock.elapsed().as_secs_f64());
    let scene = palpate_io::scene_in(placement.experiment.text(), placement.experiment.scene(), &folder)?;
    write_file(folder.join("scene.toml"), |w| w.write_all(scene.as_bytes()))?;
    results::write(folder.join("placed.json"), &document)?;
    if console.json() {
        console.print(&results::line(&document));
    } else {
        print(console, &document);
        console.print(&format!("files in {}", folder.display()));
    }
    Ok(if placement.interrupted { INTERRUPTED } else { 0 })
}

fn print(console: &mut Console, d: &PlacementDocument) {
    let base = d.value.unwrap_or(f64::NAN);
    console.print(&format!("{}: {} {} {}", d.verdict, d.number, number(base), d.unit));
    for (k, c) in d.controls.iter().enumerate() {
        let factor = c.factor.unwrap_or(f64::NAN);
        let value = stated(factor * base, c.standard_error.map(|e| e * base));
        let at = c.center.map(number).join(", ");
        console.print(&format!("  region {k} around ({at}) m: {value} {}", d.unit));
    }
    for r in &d.rounds {
        let chi = number(r.reduced_chi_square.unwrap_or(f64::NAN));
        let next = match r.gain {
            Some(gain) => {
                let asked = (r.tried as f64).ln();
                format!("; one more would add {gain:.1} to the evidence's logarithm, {asked:.1} are asked of {} places", r.tried)
            }
            None => String::new(),
        };
        console.print(&format!("  {} of them: residuals {chi} times the noise's (mean square){next}", r.controls));
    }
}
