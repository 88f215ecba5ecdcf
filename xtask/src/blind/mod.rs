//! The blind suite: every effect of the library hidden in recordings that another grid, time step and element made, recordings with nothing
//! hidden, with two things at once, and with a load that nobody knows; what the diagnosis says about each, and how often it is right.

pub mod case;
pub mod hidden;
pub mod independent;
pub mod magnet;
pub mod record;
pub mod report;
pub mod scenes;
pub mod strength;

use crate::table;
use case::{Case, Outcome};
use glam::DVec3;
use hidden::{STRONG, TABLE, WEAK};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Which cases run, and how long each may take.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Only cases that hide one of these (separated by commas); "magnet", "pair" and "null" name groups.
    pub only: Option<String>,
    /// Only cases of this scene; "pebble" are the small ones of the tests.
    pub scene: Option<String>,
    /// Recordings with nothing hidden.
    pub nulls: usize,
    /// A fixed small subset.
    pub quick: bool,
    /// Time for the search of a case [s].
    pub budget: f64,
    /// Forget earlier outcomes of the cases that run.
    pub fresh: bool,
    /// Only say how strong each case is; nothing is diagnosed.
    pub strengths: bool,
    /// Say what is being computed.
    pub verbose: bool,
    /// The cases that another simulator records ([`independent`]) instead.
    pub independent: bool,
}

/// Cases of the quick subset, beside two nulls.
const QUICK: [&str; 13] = [
    "coulomb-friction ball strong",
    "contact-dissipation ball strong",
    "point-mass beam strong",
    "uniform-force beam strong",
    "air-drag blob strong",
    "two-part-stiffness beam strong",
    "structural-damping beam strong",
    "poisson-ratio ball strong",
    "rest-shape beam strong",
    "camera-pose blob strong",
    "depth-bias ball weak",
    "time-offset ball weak",
    "magnet blob",
];

/// Two things at once: names, scene.
const PAIRS: [([&str; 2], &str); 10] = [
    (["coulomb-friction", "air-drag"], "ball"),
    (["coulomb-friction", "initial-spin"], "torus"),
    (["two-part-stiffness", "marker-offset"], "beam"),
    (["two-part-stiffness", "depth-along-ray"], "plate"),
    (["two-part-stiffness", "camera-pose"], "plate"),
    // One more of each scene.
    (["air-drag", "camera-pose"], "blob"),
    (["uniform-force", "structural-damping"], "beam"),
    (["coulomb-friction", "depth-scale"], "torus"),
    (["stiffness-damping", "depth-bias"], "ball"),
    (["rest-shape", "time-offset"], "plate"),
];

/// A case of the tests on the small ball: what is hidden (a line of the table in any scene), nothing, or a magnet.
pub fn small(hidden: Option<&str>, magnet: bool, seed: u64) -> Option<Case> {
    let line = |name: &str| TABLE.iter().position(|h| h.name == name && h.scene == "ball").map(|k| (k, STRONG));
    let hidden: Vec<(usize, f64)> = match hidden {
        Some(name) => vec![line(name)?],
        None => Vec::new(),
    };
    let group = match (hidden.is_empty(), magnet) {
        (false, _) => "strong",
        (true, true) => "magnet",
        (true, false) => "null",
    };
    let name = hidden.first().map_or(group, |h| TABLE[h.0].name);
    let magnet = magnet.then_some((DVec3::new(0.08, 0.065, 0.04), STRONG));
    Some(Case { name: format!("{name} pebble {seed}"), scene: "pebble", group, hidden, magnet, seed })
}

/// Where the magnet is [m].
const MAGNETS: [(&str, [f64; 3]); 3] =
    [("blob", [0.12, 0.05, 0.22]), ("beam", [0.24, 0.08, 0.05]), ("plate", [0.06, 0.14, -0.03])];

/// Every case of the suite, with so many nulls.
pub fn cases(nulls: usize) -> Vec<Case> {
    let mut out = Vec::new();
    for (k, h) in TABLE.iter().enumerate() {
        for (strength, target) in [("strong", STRONG), ("weak", WEAK)] {
            out.push(Case {
                name: format!("{} {} {strength}", h.name, h.scene),
                scene: h.scene,
                group: strength,
                hidden: vec![(k, target)],
                magnet: None,
                seed: 1000 + 2 * k as u64 + u64::from(strength == "weak"),
            });
        }
    }
    for (i, (names, scene)) in PAIRS.iter().enumerate() {
        let place = |name: &&str| TABLE.iter().position(|h| h.name == *name && h.scene == *scene).map(|k| (k, STRONG));
        let name = format!("{} {} {scene}", names[0], names[1]);
        let hidden = names.iter().filter_map(place).collect();
        out.push(Case { name, scene, group: "pair", hidden, magnet: None, seed: 3000 + i as u64 });
    }
    for (i, (scene, place)) in MAGNETS.iter().enumerate() {
        let magnet = Some((DVec3::from(*place), STRONG));
        out.push(Case {
            name: format!("magnet {scene}"),
            scene,
            group: "magnet",
            hidden: Vec::new(),
            magnet,
            seed: 4000 + i as u64,
        });
    }
    for i in 0..nulls {
        let scene = scenes::NAMES[i % scenes::NAMES.len()];
        let name = format!("null {scene} {i}");
        out.push(Case { name, scene, group: "null", hidden: Vec::new(), magnet: None, seed: 5000 + i as u64 });
    }
    out
}

impl Options {
    fn wants(&self, c: &Case) -> bool {
        let hides = |name: &str| c.group == name || c.hidden.iter().any(|h| TABLE[h.0].name == name) || c.name == name;
        self.only.as_deref().is_none_or(|all| all.split(',').any(|name| hides(name.trim())))
            && self.scene.as_deref().is_none_or(|s| c.scene == s)
            && (!self.quick
                || QUICK.contains(&c.name.as_str())
                || c.group == "null" && (c.name.ends_with(" 2") || c.name.ends_with(" 0")))
    }
}

/// Runs what is asked for and not known yet, saves after every case, and prints the report over all cases asked for.
///
/// # Errors
/// Nothing fits the options, or a file cannot be read or written.
pub fn run(options: &Options) -> Result<(), String> {
    if options.independent {
        return independent::run(options);
    }
    let name = if options.quick { "blind-quick" } else { "blind" };
    let path = table::root().join("bench").join(format!("{name}.json"));
    let mut all = cases(options.nulls);
    if options.scene.as_deref() == Some("pebble") {
        let ball = TABLE.iter().filter(|h| h.scene == "ball").filter_map(|h| small(Some(h.name), false, 11));
        all = ball
            .chain((0..options.nulls as u64).filter_map(|i| small(None, false, 12 + i)))
            .chain(small(None, true, 13))
            .collect();
    }
    let wanted: Vec<Case> = all.into_iter().filter(|c| options.wants(c)).collect();
    if wanted.is_empty() {
        return Err("no case fits these options".into());
    }
    if options.strengths {
        for (i, c) in wanted.iter().enumerate() {
            println!("{}/{} {}", i + 1, wanted.len(), c.name);
            println!("  {}", c.strength(&Folder::new(&c.name)?.0).map_err(|e| e.to_string())?);
        }
        return Ok(());
    }
    let known = outcomes(&path, &wanted, options)?;
    report::print(&known.iter().collect::<Vec<_>>());
    println!("\nwritten to {}", path.display());
    Ok(())
}

/// A case that a suite runs.
trait Run {
    /// What is kept of it.
    type Kept: Serialize + DeserializeOwned;
    /// Its name, unique in the suite.
    fn name(&self) -> &str;
    /// Name of the case that something was kept of.
    fn name_of(kept: &Self::Kept) -> &str;
    /// What was kept, in one line.
    fn line(kept: &Self::Kept) -> String;
    /// Runs it in an empty folder, with so much time for the search.
    fn run(&self, folder: &Path, budget: Duration, say: &mut (dyn FnMut(&str) + Send)) -> Self::Kept;
}

impl Run for Case {
    type Kept = Outcome;

    fn name(&self) -> &str {
        &self.name
    }

    fn name_of(kept: &Outcome) -> &str {
        &kept.name
    }

    fn line(kept: &Outcome) -> String {
        report::line(kept)
    }

    fn run(&self, folder: &Path, budget: Duration, say: &mut (dyn FnMut(&str) + Send)) -> Outcome {
        Case::run(self, folder, budget, say)
    }
}

/// Outcomes of these cases: those that a file holds and of those that it does not, which run; it is saved after every one.
fn outcomes<C: Run>(path: &Path, wanted: &[C], options: &Options) -> Result<Vec<C::Kept>, String> {
    let mut known: Vec<C::Kept> = match std::fs::read_to_string(path) {
        Ok(text) => serde_json::from_str(&text).map_err(|e| format!("{}: {e}; remove it to start again", path.display()))?,
        Err(_) => Vec::new(),
    };
    let is_wanted = |kept: &C::Kept| wanted.iter().any(|c| c.name() == C::name_of(kept));
    if options.fresh {
        known.retain(|kept| !is_wanted(kept));
    }
    for (i, c) in wanted.iter().enumerate() {
        if known.iter().any(|kept| C::name_of(kept) == c.name()) {
            continue;
        }
        println!("{}/{} {}", i + 1, wanted.len(), c.name());
        let folder = Folder::new(c.name())?;
        let clock = Instant::now();
        let mut say = |what: &str| {
            if options.verbose {
                println!("  {:5.1} s {what}", clock.elapsed().as_secs_f64());
            }
        };
        let kept = c.run(&folder.0, Duration::from_secs_f64(options.budget), &mut say);
        println!("  {}", C::line(&kept));
        known.push(kept);
        save(path, &known)?;
    }
    known.retain(is_wanted);
    Ok(known)
}

/// Whole or not at all: a run may be stopped at any time.
fn save(path: &Path, known: &[impl Serialize]) -> Result<(), String> {
    let fail = |e: std::io::Error| format!("{}: {e}", path.display());
    let text = serde_json::to_string_pretty(known).map_err(|e| e.to_string())?;
    let new = path.with_extension("new");
    std::fs::create_dir_all(path.parent().unwrap_or(path)).map_err(fail)?;
    std::fs::write(&new, text + "\n").map_err(fail)?;
    std::fs::rename(&new, path).map_err(fail)
}

/// A folder of its own that goes when the case is done.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Result<Folder, String> {
        let path = std::env::temp_dir().join(format!("palpate-blind-{}-{}", std::process::id(), name.replace(' ', "-")));
        std::fs::create_dir_all(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(Folder(path))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Nothing depends on it any more.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_model::effects::{ALL, Family};

    #[test]
    fn every_effect_is_hidden_in_two_scenes_and_names_are_unique() {
        for law in ALL.iter().filter(|l| l.family != Family::Slack) {
            let scenes: Vec<&str> = TABLE.iter().filter(|h| h.name == law.kind).map(|h| h.scene).collect();
            assert!(scenes.len() >= 2 && scenes[0] != scenes[1], "{}: {scenes:?}", law.kind);
        }
        let all = cases(20);
        let mut names: Vec<&str> = all.iter().map(|c| c.name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), all.len());
        assert!(QUICK.iter().all(|q| names.contains(q)));
        assert!(all.iter().filter(|c| c.group == "pair").all(|c| c.hidden.len() == 2));
    }
}
