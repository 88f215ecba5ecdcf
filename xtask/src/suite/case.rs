//! One case: what is hidden in which scene, how it is recorded, and what a right answer says.

use super::drawn;
use super::foreign;
use super::hidden::{Hidden, Number, TABLE, same};
use super::magnet::Magnet;
use super::named;
use super::record::{Maker, observed};
use super::regions::Bins;
use super::setup::Setup;
use crate::tetrahedra::change::Change;
use crate::tetrahedra::motion::{Resolution, simulate};
use crate::tetrahedra::watch::record;
use glam::DVec3;
use palpate::{Error, Experiment};
use palpate_diagnose::Way;
use palpate_io::write_recording;
use palpate_model::scene::Scene;
use palpate_model::shape::shape_of;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Groups of cases, in the order of reports.
pub const GROUPS: [&str; 5] = ["strong", "weak", "pair", "outside", "null"];

/// Who simulates a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Simulator {
    /// Palpate's cut cells: finer, in shorter steps and with another element than the method is given.
    #[default]
    Cells,
    /// Quadratic tetrahedra that share nothing with palpate.
    Tetrahedra,
}

/// Something hidden.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Put {
    /// What.
    pub what: String,
    /// Strength that its amplitude aims at, in standard deviations of readings after refitting.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aim: Option<f64>,
    /// Its size over that of the table; nothing until `--calibrate` has found it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub amplitude: Option<f64>,
}

fn yes() -> bool {
    true
}

fn is_yes(x: &bool) -> bool {
    *x
}

/// A case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// Name, unique in the suite.
    pub name: String,
    /// One of [`GROUPS`].
    pub group: String,
    /// Name of a scene, or `drawn KIND NUMBER`.
    pub scene: String,
    /// Who recorded it.
    #[serde(default)]
    pub simulator: Simulator,
    /// Seed of the recordings.
    pub seed: u64,
    /// Whether a second recording is held out.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub held_out: bool,
    /// What all that is hidden leaves of the readings once the free numbers are refitted, in standard deviations, root mean square.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strength: Option<f64>,
    /// Where and when it moves readings (`Bins::acts`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub acts: Option<String>,
    /// What is hidden.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub hidden: Vec<Put>,
}

/// What a right answer says.
#[derive(Clone, Debug)]
pub struct Truth {
    /// The verdict.
    pub verdict: &'static str,
    /// For everything hidden the names that are right, the first the one that was used.
    pub names: Vec<Vec<String>>,
    /// Hidden numbers, with the place in `names` they belong to.
    pub numbers: Vec<(usize, Number)>,
    /// True where all numbers may have the other sign.
    pub mirrored: bool,
    /// Young's modulus [Pa].
    pub modulus: f64,
    /// Bins of place and time.
    pub bins: Bins,
    /// Those in which something acts.
    pub acts: String,
}

/// The recordings of a case, opened with what a method is given.
pub struct Recorded {
    /// To be explained.
    pub seen: Experiment,
    /// Held out.
    pub other: Option<Experiment>,
}

/// Names of the same physics: what the first is called may be called the others as well.
fn names_of(what: &str) -> Vec<String> {
    let all = palpate_model::effects::ALL.iter().map(|l| l.kind).chain(["gravity", "release-time"]);
    std::iter::once(what.to_string()).chain(all.filter(|k| *k != what && same(k, what)).map(String::from)).collect()
}

impl Case {
    /// What it is recorded of and what a method is given.
    ///
    /// # Errors
    /// There is no such scene.
    pub fn setup(&self) -> Result<Setup, Error> {
        let drawn = self.scene.strip_prefix("drawn ").and_then(|rest| rest.split_once(' '));
        let found = match drawn {
            Some((kind, number)) => number.parse().ok().and_then(|n| drawn::setup(kind, n)),
            None => named::setup(&self.scene),
        };
        found.ok_or_else(|| Error::Input(format!("case \"{}\": there is no scene \"{}\"", self.name, self.scene)))
    }

    pub(super) fn line(&self, put: &Put) -> Result<&'static Hidden, Error> {
        let fits = |h: &&Hidden| h.name == put.what && h.scene == self.scene;
        let none = || Error::Input(format!("case \"{}\": nothing says how to hide {} in {}", self.name, put.what, self.scene));
        TABLE.iter().find(fits).ok_or_else(none)
    }

    pub(super) fn amplitudes(&self) -> Result<Vec<f64>, Error> {
        let missing = || Error::Input(format!("case \"{}\" has no amplitude yet: cargo xtask suite --calibrate", self.name));
        self.hidden.iter().map(|h| h.amplitude.ok_or_else(missing)).collect()
    }

    /// Puts everything into a true scene of the cells.
    pub(super) fn hide(&self, scene: &Scene, amplitudes: &[f64]) -> Result<(Scene, Vec<(usize, Number)>), Error> {
        let mut scene = scene.clone();
        let mut numbers = Vec::new();
        for (k, (put, a)) in self.hidden.iter().zip(amplitudes).enumerate() {
            if put.what == "magnet" {
                scene = Magnet::near(&self.scene, *a)?.apply(&scene)?;
            } else {
                numbers.extend(self.line(put)?.apply(&mut scene, *a)?.into_iter().map(|n| (k, n)));
            }
        }
        Ok((scene, numbers))
    }

    /// What is hidden of the tetrahedra.
    pub(super) fn change(&self, amplitudes: &[f64]) -> Result<(Change, Vec<(usize, Number)>), Error> {
        let (mut change, mut numbers) = (Change::default(), Vec::new());
        for (k, (put, a)) in self.hidden.iter().zip(amplitudes).enumerate() {
            let none =
                || Error::Input(format!("case \"{}\": nothing says how to hide {} in {}", self.name, put.what, self.scene));
            let of = foreign::apply(&put.what, &self.scene, *a, &mut change).ok_or_else(none)?;
            numbers.extend(of.into_iter().map(|n| (k, n)));
        }
        Ok((change, numbers))
    }

    /// A recording of the tetrahedra, opened; without a seed it has no noise.
    pub(super) fn watched(
        &self,
        setup: &Setup,
        change: &Change,
        place: &Path,
        other: bool,
        seed: Option<u64>,
    ) -> Result<Experiment, Error> {
        let scene = setup.truth(other)?;
        let end = scene.time.step * scene.time.steps as f64 - SPARE;
        let times: Vec<f64> = (1..).map(|k| f64::from(k) * setup.spacing).take_while(|t| *t < end).collect();
        let motion = simulate(&scene, change, &times, RESOLUTION)?;
        let recording = record(&motion, change, &setup.watchers(seed.is_some(), seed.unwrap_or(0))?)?;
        write_recording(place, &recording).map_err(|e| Error::Failed(e.to_string()))?;
        let text = setup.text(place, other);
        Experiment::new(setup.parse(&text)?, text, Vec::new())
    }

    /// Records it in an empty folder.
    ///
    /// # Errors
    /// It cannot be simulated, or its files not be written.
    pub fn record(&self, folder: &Path) -> Result<Recorded, Error> {
        let amplitudes = self.amplitudes()?;
        let one = |other: bool| self.one_recording(&amplitudes, folder, other);
        Ok(Recorded { seen: one(false)?, other: if self.held_out { Some(one(true)?) } else { None } })
    }

    fn one_recording(&self, amplitudes: &[f64], folder: &Path, other: bool) -> Result<Experiment, Error> {
        let place = folder.join(if other { "other" } else { "seen" });
        let setup = self.setup()?;
        if self.simulator == Simulator::Tetrahedra {
            let seed = 2 * self.seed + u64::from(other);
            return self.watched(&setup, &self.change(amplitudes)?.0, &place, other, Some(seed));
        }
        let (scene, _) = self.hide(&setup.truth(other)?, amplitudes)?;
        observed(&setup, &scene, &Maker::other(self.seed, other), &place, other)
    }

    /// One more recording of what was seen, made as a way says. Gravity turns as it truly is, and everything else stays with the setup.
    ///
    /// # Errors
    /// As [`Case::record`].
    pub fn next(&self, way: &Way, folder: &Path) -> Result<Experiment, Error> {
        let (amplitudes, place) = (self.amplitudes()?, folder.join("next"));
        let (setup, maker) = (self.setup()?.moved(way), Maker::other(self.seed, false));
        let (stated, seed) = (setup.clone().turned(way.turn)?, NEXT + maker.seed);
        if self.simulator == Simulator::Tetrahedra {
            let change = self.change(&amplitudes)?.0;
            let change = Change { gravity: way.turn * change.gravity, ..change };
            return self.watched(&stated, &change, &place, false, Some(seed));
        }
        let (mut scene, _) = self.hide(&setup.truth(false)?, &amplitudes)?;
        scene.gravity = way.turn * scene.gravity;
        observed(&stated, &scene, &Maker { seed, ..maker }, &place, false)
    }

    /// What is right.
    ///
    /// # Errors
    /// The scene cannot be read.
    pub fn truth(&self) -> Result<Truth, Error> {
        let setup = self.setup()?;
        let scene = setup.truth(false)?;
        let amplitudes = self.amplitudes()?;
        let numbers = match self.simulator {
            Simulator::Cells => self.hide(&scene, &amplitudes)?.1,
            Simulator::Tetrahedra => self.change(&amplitudes)?.1,
        };
        let verdict = match self.group.as_str() {
            "null" => "adequate",
            "outside" => "unexplained",
            _ => "missing-effect",
        };
        let known = self.hidden.iter().filter(|_| self.group != "outside");
        Ok(Truth {
            verdict,
            names: known.map(|h| names_of(&h.what)).collect(),
            numbers,
            mirrored: self.hidden.iter().any(|h| h.what == "two-part-stiffness"),
            modulus: scene.material.youngs_modulus,
            bins: bins(&scene),
            acts: self.acts.clone().unwrap_or_default(),
        })
    }

    /// Direction from the body's centre to a magnet, where there is one.
    pub fn pole(&self) -> Option<DVec3> {
        let hides = self.hidden.iter().any(|h| h.what == "magnet");
        let place = match self.simulator {
            Simulator::Cells => hides.then(|| Magnet::near(&self.scene, 1.0).ok().map(|m| m.place))??,
            Simulator::Tetrahedra => hides.then(|| foreign::pole(&self.scene))??,
        };
        let (low, high) = shape_of(&self.setup().ok()?.truth(false).ok()?.object).bounds();
        (place - 0.5 * (low + high)).try_normalize()
    }
}

/// Seeds of further recordings come behind those of all cases.
const NEXT: u64 = 1 << 32;
/// Of the tetrahedra.
const RESOLUTION: Resolution = Resolution { fine: 1, substeps: 5 };
/// The last frame is taken this long before the scene ends [s]: room for a clock that is off.
const SPARE: f64 = 0.02;

/// Bins of a scene: the box of its rest shape and its simulated time.
pub(super) fn bins(scene: &Scene) -> Bins {
    let start = scene.time.start;
    Bins::new(shape_of(&scene.object).bounds(), (start, start + scene.time.step * scene.time.steps as f64))
}
