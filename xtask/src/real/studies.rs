//! The tables: each recording's own fit, both beams with one modulus, what one beam says of the other, and how the load of 52 g may hang.

use super::report::{Made, Pair, Report, Row, Slice};
use super::tracks::{Sighting, rms, track};
use super::{diagnoses, fit, found, height_at_rest, models, open, scene_path, swings};
use crate::{rows, table};
use clap::ValueEnum;
use glam::DVec3;
use palpate::{Error, Experiment, FitOptions, Fitted};
use palpate_model::params::ParamKey;
use std::path::{Path, PathBuf};

const MODULUS: &str = "material.youngs_modulus";
const DAMPING: &str = "material.stiffness_damping";
/// Numbers of the material that one beam gives to the other.
pub(crate) const VALUES: [&str; 2] = [MODULUS, DAMPING];

/// A scene that fits a recording, and the marker whose swing is compared with a guess of its frequency [Hz]; none where nothing swings.
#[derive(Clone, Copy)]
pub(super) struct Recorded {
    pub name: &'static str,
    pub scene: &'static str,
    marker: Option<(&'static str, f64)>,
    /// Texts of the scene that end it before the recording does, and what they are where it does not.
    pub(super) whole: &'static [(&'static str, &'static str)],
}

pub(super) const BEAMS: [Recorded; 2] = [
    Recorded {
        name: "Dragon Skin beam, own weight",
        scene: "beam-gravity",
        marker: Some(("tip1", 7.5)),
        whole: &[("duration = 1.0", "duration = 4.2"), ("to = 1.06", "to = 9.0")],
    },
    Recorded {
        name: "the same beam with 52 g",
        scene: "beam-load52",
        marker: Some(("tip1", 4.3)),
        whole: &[("duration = 1.6", "duration = 5.4"), ("to = 1.7", "to = 9.0")],
    },
];

const fn still(name: &'static str, scene: &'static str) -> Recorded {
    Recorded { name, scene, marker: None, whole: &[] }
}

const CANTILEVERS: [Recorded; 5] = [
    Recorded {
        name: "MoldStar cantilever, swinging",
        scene: "cantilever-moldstar-oscillating",
        marker: Some(("head_outer_top", 2.6)),
        whole: &[],
    },
    still("Ecoflex cantilever, hanging", "cantilever-ecoflex-hanging"),
    still("the same with the camera's bias", "cantilever-ecoflex-hanging-raw"),
    still("two materials as one, hanging", "cantilever-two-materials-hanging"),
    still("the same with the camera's biases", "cantilever-two-materials-hanging-raw"),
];

/// Time on a recording's clock [s] from which a beam counts as at rest.
const LATE: f64 = 3.0;

/// How a fit did on one of its scenes.
pub(super) fn row(name: &str, recorded: &Recorded, experiment: &Experiment, fitted: &Fitted, scene: usize) -> Result<Row, Error> {
    let theta = &fitted.result.theta[scene];
    let modulus = fitted.result.parameters.iter().find(|p| p.path == MODULUS);
    let damping = fitted.result.parameters.iter().find(|p| p.path == DAMPING);
    let of_plan = || theta[experiment.plan().layout.index(ParamKey::YoungsModulus)];
    let left = &fitted.after[scene];
    let mut row = Row {
        name: name.into(),
        youngs_modulus: modulus.map_or_else(of_plan, |p| p.value),
        standard_error: modulus.and_then(|p| p.standard_error),
        damping_ratio: None,
        frequency: None,
        sag: None,
        rms: left.rms,
        noise: left.noise,
        marker_rms: None,
        stiffness_damping: damping.and_then(|p| Some([p.value, p.standard_error?])),
        late_sag: None,
    };
    if let Some((marker, guess)) = recorded.marker {
        let (seen, simulated) = swings(experiment, theta, marker, guess)?;
        let rest = height_at_rest(experiment, marker);
        row.damping_ratio = Some(Pair { simulated: simulated.damping_ratio(), measured: seen.damping_ratio() });
        row.frequency = Some(Pair { simulated: simulated.frequency, measured: seen.frequency });
        row.sag = Some(Pair { simulated: rest - simulated.centre, measured: rest - seen.centre });
    }
    Ok(row)
}

/// Mean sag of a marker from [`LATE`] on; none where the recording ends before.
fn late_sag(experiment: &Experiment, track: &[Sighting], marker: &str) -> Option<Pair> {
    let late: Vec<&Sighting> = track.iter().filter(|s| s.time >= LATE).collect();
    let rest = height_at_rest(experiment, marker);
    let sag =
        |of: fn(&Sighting) -> DVec3| rest - late.iter().map(|s| of(s).dot(experiment.up())).sum::<f64>() / late.len() as f64;
    (!late.is_empty()).then(|| Pair { simulated: sag(|s| s.simulated), measured: sag(|s| s.seen) })
}

/// Each recording by itself, and the beams with one modulus; the fits of the beams by themselves are handed on.
fn recordings(data: &Path) -> Result<(Vec<Row>, [Fitted; 2]), Error> {
    let mut rows = Vec::new();
    let mut own = |r: &Recorded| {
        let experiment = open(data, r.scene, &[])?;
        let fitted = fit(&experiment)?;
        let mut row = row(r.name, r, &experiment, &fitted, 0)?;
        if let (Some((marker, _)), false) = (r.marker, r.whole.is_empty()) {
            let whole = open(data, r.scene, r.whole)?;
            let seen = |e: &Experiment| track(e, &fitted.result.theta[0], marker);
            let all = seen(&whole)?;
            row.marker_rms = Some([rms(&seen(&experiment)?), rms(&all)]);
            row.late_sag = late_sag(&whole, &all, marker);
        }
        rows.push(told(row));
        Ok::<_, Error>((experiment, fitted))
    };
    let ((unloaded, first), (loaded, second)) = (own(&BEAMS[0])?, own(&BEAMS[1])?);
    let beams = [unloaded, loaded];
    for r in &CANTILEVERS {
        own(r)?;
    }
    let joint = palpate::fit(&beams, FitOptions::default())?;
    for (s, (beam, name)) in beams.iter().zip(["both beams, one E: own weight", "both beams, one E: with 52 g"]).enumerate() {
        rows.insert(2 + s, told(row(name, &BEAMS[s], beam, &joint, s)?));
    }
    Ok((rows, [first, second]))
}

/// E and damping of one beam, only the start fitted to the other.
fn predictions(data: &Path, own: &[Fitted; 2]) -> Result<Vec<Row>, Error> {
    let mut rows = Vec::new();
    for (from, to) in [(0, 1), (1, 0)] {
        let scene = BEAMS[to].scene;
        let changes = stated(scene, VALUES.map(|path| found(&own[from], path)))?;
        let changes: Vec<(&str, &str)> = changes.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
        let other = open(data, scene, &changes)?;
        let name = format!("{} → {}", BEAMS[from].scene, scene);
        let fitted = fit(&other)?;
        let mut row = row(&name, &BEAMS[to], &other, &fitted, 0)?;
        let (marker, _) = BEAMS[to].marker.expect("beams have markers");
        let whole = open(data, scene, &[&changes[..], BEAMS[to].whole].concat())?;
        row.late_sag = late_sag(&whole, &track(&whole, &fitted.result.theta[0], marker)?, marker);
        rows.push(told(row));
    }
    Ok(rows)
}

/// A recording's own fit with one thing changed in its scene.
const VARIANTS: [(&str, usize, (&str, &str)); 4] = [
    ("Ecoflex, cells of 7.5 mm", 1, ("cell_size = 0.01 ", "cell_size = 0.0075 ")),
    ("Ecoflex, a band of 2 cells", 1, ("band      = 4.0", "band = 2.0")),
    ("Ecoflex, a band of 8 cells", 1, ("band      = 4.0", "band = 8.0")),
    ("MoldStar, with the gravity across that the rig shows", 0, ("gravity = [0.0, -9.80, 0.0]", "gravity = [0.0, -9.80, -0.49]")),
];

fn variants(data: &Path) -> Result<Vec<Row>, Error> {
    let of = |(name, which, change): &(&str, usize, (&str, &str))| {
        let recorded = &CANTILEVERS[*which];
        let experiment = open(data, recorded.scene, &[*change])?;
        Ok(told(row(name, recorded, &experiment, &fit(&experiment)?, 0)?))
    };
    VARIANTS.iter().map(of).collect()
}

/// Texts of a scene, and what they are where it states these values of [`VALUES`] instead of fitting them.
///
/// # Errors
/// It cannot be read.
pub(crate) fn stated(scene: &str, values: [f64; 2]) -> Result<Vec<(String, String)>, Error> {
    let text = read(scene)?;
    let mut changes = Vec::new();
    for (path, value) in VALUES.into_iter().zip(values) {
        let key = path.trim_start_matches("material.");
        let line = text.lines().find(|l| l.starts_with(key)).unwrap_or_default().to_string();
        changes.push((line, format!("{key} = {value}")));
        changes.push((free(&text, path), String::new()));
    }
    Ok(changes)
}

fn read(scene: &str) -> Result<String, Error> {
    let path = scene_path(scene);
    std::fs::read_to_string(&path).map_err(|e| Error::Input(format!("{}: {e}", path.display())))
}

/// The table of a scene's text that makes `path` free.
fn free(text: &str, path: &str) -> String {
    let named = format!("\"{path}\"");
    let tables = text.match_indices("[[fit.parameter]]").map(|(at, _)| &text[at..]);
    let table = tables.map(|t| &t[..t[2..].find("[[").map_or(t.len(), |e| e + 2)]).find(|t| t.contains(&named));
    table.unwrap_or_default().to_string()
}

/// How the load of 52 g may act.
struct Load {
    name: &'static str,
    /// Where, in the plane of bending [m].
    x: f64,
    z: f64,
    /// Over the whole width, or in its middle.
    wide: bool,
    /// On a string: its inertia across gravity is not felt.
    hangs: bool,
    /// Gravity along the motion capture's own vertical.
    tilted: bool,
}

const EDGE: Load =
    Load { name: "the scene: over the width of the upper edge", x: 0.1, z: 0.03, wide: true, hangs: false, tilted: false };
const LOADS: [Load; 7] = [
    EDGE,
    Load { name: "the same, hanging on a string", hangs: true, ..EDGE },
    Load { name: "the same, with the motion capture's own vertical", tilted: true, ..EDGE },
    Load { name: "in the middle of the upper edge", wide: false, ..EDGE },
    Load { name: "over the width at mid height", z: 0.015, ..EDGE },
    Load { name: "over the width of the lower edge", z: 0.0, ..EDGE },
    Load { name: "over the width of the upper side, 5 mm behind the edge", x: 0.095, ..EDGE },
];

/// Size of the region that carries a load on a string [m]: half as wide as its places are apart.
const HOLD: f64 = 0.004;
/// Gravity in the scene, and along the vertical that the recording states [m/s²].
const GRAVITY: [&str; 2] = ["gravity = [0.0, 0.0, -9.807]", "gravity = [1.145, 0.189, -9.738]"];

impl Load {
    /// The scene's tables for it.
    fn tables(&self) -> String {
        const WIDE: [(f64, f64); 5] = [(0.0, 0.125), (0.0075, 0.25), (0.015, 0.25), (0.0225, 0.25), (0.03, 0.125)];
        let shares = if self.wide { &WIDE[..] } else { &[(0.015, 1.0)] };
        let one = |(y, share): &(f64, f64)| {
            let (point, mass) = (format!("[{}, {y}, {}]", self.x, self.z), 0.052 * share);
            if self.hangs {
                format!("[[effect]]\nkind = \"point-mass\"\npoint = {point}\nmass = {mass}\nradius = {HOLD}\nhung = 1\n\n")
            } else {
                format!("[[mass]]\npoint = {point}\nmass = {mass}\n\n")
            }
        };
        shares.iter().map(one).collect()
    }
}

/// The fit of the loaded beam with each of them.
fn loads(data: &Path) -> Result<Vec<Row>, Error> {
    let text = read(BEAMS[1].scene)?;
    let [first, last] = [text.find("[[mass]]"), text.rfind("[[mass]]")].map(Option::unwrap_or_default);
    let end = text[last..].find("\n\n").map_or(text.len(), |e| last + e + 2);
    let of = |load: &Load| {
        let gravity = GRAVITY[usize::from(load.tilted)];
        let changes = [(&text[first..end], load.tables()), (GRAVITY[0], gravity.into())];
        let changes: Vec<(&str, &str)> = changes.iter().map(|(a, b)| (*a, b.as_str())).collect();
        let experiment = open(data, BEAMS[1].scene, &changes)?;
        Ok(told(row(load.name, &BEAMS[1], &experiment, &fit(&experiment)?, 0)?))
    };
    LOADS.iter().map(of).collect()
}

/// Says that a row is there: the whole takes minutes.
fn told(row: Row) -> Row {
    println!("{}: {:.1} kPa, {:.2} mm", row.name, 1e-3 * row.youngs_modulus, 1e3 * row.rms);
    row
}

/// Computes tables, all or those named, prints them and writes them into `bench/real.json`.
///
/// # Errors
/// There are no recordings, or a fit fails that is not expected to.
pub fn run(only: &[Slice]) -> Result<PathBuf, String> {
    let data = crate::bench::data().ok_or("no recordings: set PALPATE_DATA to their folder")?;
    let wanted = wanted(only);
    let mut report = Report::load(&table::root())?;
    let made = Made::now()?;
    let mut measure = || -> Result<(), Error> {
        let mut own = None;
        for slice in &wanted {
            match slice {
                Slice::Recordings => {
                    let (rows, fits) = recordings(&data)?;
                    (report.recordings, own) = (rows, Some(fits));
                }
                Slice::Predictions => {
                    let alone = || -> Result<[Fitted; 2], Error> {
                        let of = |r: &Recorded| fit(&open(&data, r.scene, &[])?);
                        Ok([of(&BEAMS[0])?, of(&BEAMS[1])?])
                    };
                    let fits = own.take().map_or_else(alone, Ok)?;
                    report.predictions = predictions(&data, &fits)?;
                }
                Slice::Loads => report.loads = loads(&data)?,
                Slice::Variants => report.variants = variants(&data)?,
                Slice::Models => report.models = models::measure(&data)?,
                Slice::Diagnoses => {
                    let mut answers = std::mem::take(&mut report.diagnoses);
                    let mut keep = |answers: &[diagnoses::Answer]| {
                        report.diagnoses = answers.to_vec();
                        table::save("real", &report).map(|_| ()).map_err(Error::Failed)
                    };
                    let made = rows::measured(rows::Measured::Diagnoses).map_err(Error::Failed)?;
                    diagnoses::measure(&data, &made, &mut answers, &mut keep)?;
                    report.diagnoses = answers;
                }
            }
            report.made.insert(*slice, made.clone());
        }
        Ok(())
    };
    measure().map_err(|e| e.to_string())?;
    let path = table::save("real", &report)?;
    tell(only)?;
    Ok(path)
}

/// These tables, or all.
fn wanted(only: &[Slice]) -> Vec<Slice> {
    Slice::value_variants().iter().copied().filter(|s| only.is_empty() || only.contains(s)).collect()
}

/// Prints tables of what was measured, and writes those that a page has from the file.
///
/// # Errors
/// A file cannot be read or written.
pub fn tell(only: &[Slice]) -> Result<(), String> {
    let report = Report::load(&table::root())?;
    wanted(only).iter().for_each(|s| report.print(*s));
    table::replace("docs/real-data.md", "models", &models::markdown(&report.models))?;
    table::replace("docs/real-data.md", "diagnoses", &diagnoses::markdown(&report.diagnoses))
}
