//! The suite: every effect of the library hidden in recordings that another grid, step and element, or another simulator altogether, made;
//! recordings with nothing hidden, with two things at once, and with what the library does not know. What palpate and methods beside it say of
//! each, how often they are right, and the same recordings for methods of others. `benchmark/README.md` says how it is scored.

mod ablation;
pub mod answer;
mod baselines;
mod calibrate;
pub mod case;
mod drawn;
mod foreign;
mod hidden;
mod list;
mod magnet;
mod methods;
mod named;
mod record;
mod regions;
pub mod report;
pub mod rules;
pub mod score;
pub mod settle;
pub mod setup;
mod short;
mod strength;
mod watched;

use crate::rows::{self, hash};
use crate::table;
use answer::Answer;
use case::{Case, GROUPS, Put, Simulator};
use list::List;
use methods::Method;
use score::Row;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Root mean square change of readings by a strong effect, in standard deviations of the noise.
const STRONG: f64 = 10.0;

/// Which cases run, by whom, and for how long.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Only these: groups, names, scenes, kinds of scenes or what is hidden, separated by commas.
    pub only: Option<String>,
    /// Methods, separated by commas.
    pub method: String,
    /// At most so many of every group.
    pub first: Option<usize>,
    /// Stop after so many minutes.
    pub slice: Option<f64>,
    /// Time for the search of one case, of all its processors together [s].
    pub budget: f64,
    /// Measure again what this commit has measured already.
    pub fresh: bool,
    /// Let rows of other commits count as well.
    pub keep: bool,
    /// Say what is being computed.
    pub verbose: bool,
    /// What to do instead of measuring.
    pub instead: Instead,
}

/// What to do.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Instead {
    /// Measure.
    #[default]
    Nothing,
    /// Find amplitudes of cases that have none.
    Calibrate,
    /// Write recordings and scenes for other methods.
    Record(PathBuf),
    /// Score answers of another method.
    Score(PathBuf),
    /// Measure the suite with a search of other numbers.
    Ablate,
    /// Make the measurements that ties propose.
    Settle,
    /// Print and store the report.
    Report,
}

impl Options {
    /// True once the slice that began with a clock is over.
    fn is_over(&self, clock: &Instant) -> bool {
        self.slice.is_some_and(|minutes| clock.elapsed().as_secs_f64() > 60.0 * minutes)
    }

    /// Says what is being computed, where that is asked for.
    fn say<'a>(&'a self, clock: &'a Instant) -> impl FnMut(&str) + Send + 'a {
        move |what| {
            if self.verbose {
                println!("  {:5.1} s {what}", clock.elapsed().as_secs_f64());
            }
        }
    }

    fn wants(&self, c: &Case) -> bool {
        let word = |w: &str| c.scene.split(' ').any(|s| s == w) || c.hidden.iter().any(|h| h.what == w);
        let asked = |w: &str| c.group == w || c.name == w || c.scene == w || word(w);
        self.only.as_deref().is_none_or(|all| all.split(',').any(|w| asked(w.trim())))
    }

    /// The cases that are asked for, in an order that spreads every slice over all of them.
    fn wanted(&self, mut all: Vec<Case>) -> Result<Vec<Case>, String> {
        all.retain(|c| self.wants(c));
        all.sort_by_key(|c| hash(&c.name));
        if let Some(first) = self.first {
            let mut seen = [0; GROUPS.len()];
            all.retain(|c| match GROUPS.iter().position(|g| *g == c.group) {
                Some(g) => {
                    seen[g] += 1;
                    seen[g] <= first
                }
                None => false,
            });
        }
        if all.is_empty() { Err(format!("no case fits; groups are {}", GROUPS.join(", "))) } else { Ok(all) }
    }
}

/// Does what is asked for.
///
/// # Errors
/// Nothing fits the options, or a file cannot be read or written.
pub fn run(options: &Options) -> Result<(), String> {
    let list = List::read()?;
    match &options.instead {
        Instead::Calibrate => return calibrate(list, options),
        Instead::Report => {
            let all = all_rows(&list.cases()?)?;
            report::write(&all)?;
            rules::write(&all)?;
            ablation::write(&rows::load(&rows::path("ablation"))?)?;
            return settle::write(&rows::load(&rows::path("settle"))?);
        }
        Instead::Record(folder) => return record(&options.wanted(list.cases()?)?, folder),
        Instead::Score(file) => return score_file(&list.cases()?, file),
        Instead::Settle => return settle(&options.wanted(list.cases()?)?, options),
        Instead::Nothing | Instead::Ablate => {}
    }
    let (methods, path): (Vec<Method>, _) = if options.instead == Instead::Ablate {
        let others = (0..ablation::ALL.len()).map(Method::Ablated);
        (std::iter::once(Method::Palpate).chain(others).collect(), rows::path("ablation"))
    } else {
        let named = options.method.split(',').map(|m| m.trim().parse()).collect::<Result<_, String>>()?;
        (named, rows::path("suite"))
    };
    let made = rows::measured(rows::Measured::Diagnoses)?;
    let known: Vec<Row> = rows::load(&path)?;
    let is_known = |c: &Case, m: Method| {
        let same = |r: &&Row| r.case == c.name && r.method == m.name() && (options.keep || r.made.is_same(&made));
        !options.fresh && known.iter().any(|r| same(&r))
    };
    let wanted = options.wanted(list.cases()?)?;
    let clock = Instant::now();
    let mut done = 0;
    let (ready, raw): (Vec<&Case>, Vec<&Case>) = wanted.iter().partition(|c| c.hidden.iter().all(|h| h.amplitude.is_some()));
    if !raw.is_empty() {
        println!("{} cases have no amplitude yet: cargo xtask suite --calibrate", raw.len());
    }
    for (i, c) in ready.iter().enumerate() {
        let open: Vec<Method> = methods.iter().copied().filter(|m| !is_known(c, *m)).collect();
        if open.is_empty() {
            continue;
        }
        if options.is_over(&clock) {
            println!("the slice is over: {done} answers, cases from {}/{} on are open", i + 1, ready.len());
            return Ok(());
        }
        println!("{}/{} {}", i + 1, ready.len(), c.name);
        for row in measure(c, &open, options, &made)? {
            println!("  {}", report::line(&row));
            rows::append(&path, &row)?;
            done += 1;
        }
    }
    println!("\n{done} answers appended to {}; cargo xtask suite --report prints the table", path.display());
    Ok(())
}

/// Makes the measurements that ties propose: of cases with a name, whose last answer has something as good.
fn settle(wanted: &[Case], options: &Options) -> Result<(), String> {
    let (made, path) = (rows::measured(rows::Measured::Diagnoses)?, rows::path("settle"));
    let (all, known): (Vec<Row>, Vec<settle::Row>) = (rows::load(&rows::path("suite"))?, rows::load(&path)?);
    let newest = |c: &Case| all.iter().rev().find(|r| r.case == c.name && r.method == Method::Palpate.name());
    let is_known = |c: &Case| known.iter().any(|r| r.case == c.name && (options.keep || r.made.is_same(&made)));
    let ties = |c: &&Case| !["outside", "null"].contains(&c.group.as_str()) && newest(c).is_some_and(|r| !r.as_good.is_empty());
    let open: Vec<&Case> = wanted.iter().filter(ties).filter(|c| options.fresh || !is_known(c)).collect();
    let clock = Instant::now();
    for (i, c) in open.iter().enumerate() {
        if options.is_over(&clock) {
            println!("the slice is over: {} cases are open", open.len() - i);
            return Ok(());
        }
        println!("{}/{} {}", i + 1, open.len(), c.name);
        let budget = Duration::from_secs_f64(options.budget);
        let row = settle::measure(&made, c, folder()?.path(), budget, &mut options.say(&clock));
        let row = row.map_err(|e| format!("{}: {e}", c.name))?;
        println!("  {}", settle::line(&row));
        rows::append(&path, &row)?;
    }
    println!("\ncargo xtask suite --report prints the table");
    Ok(())
}

/// A folder of its own that goes when the case is done.
fn folder() -> Result<tempfile::TempDir, String> {
    tempfile::tempdir().map_err(|e| format!("no folder for recordings: {e}"))
}

/// The answers of some methods to one case, scored. Failures are answers too.
fn measure(c: &Case, methods: &[Method], options: &Options, made: &crate::real::report::Made) -> Result<Vec<Row>, String> {
    let folder = folder()?;
    let clock = Instant::now();
    let mut say = options.say(&clock);
    let truth = c.truth().map_err(|e| e.to_string())?;
    say("recordings");
    let recorded = c.record(folder.path());
    let budget = Duration::from_secs_f64(options.budget);
    let mut row = |m: &Method| {
        let answer = match &recorded {
            Ok(r) => m.answer(&c.name, r, budget, &mut say).map_err(|e| e.to_string()),
            Err(e) => Err(format!("no recording: {e}")),
        };
        let answer = answer.unwrap_or_else(|why| Answer::failed(&c.name, why));
        score::score(made, m.name(), c, &truth, &answer)
    };
    Ok(methods.iter().map(&mut row).collect())
}

/// Finds what is not known yet of the cases that are asked for, and stores the list after every one.
fn calibrate(mut list: List, options: &Options) -> Result<(), String> {
    let clock = Instant::now();
    let mut order: Vec<usize> = (0..list.case.len()).collect();
    // What is hidden weakly, or with something else, starts from the amplitude that is strong by itself.
    order.sort_by_key(|k| (list.case[*k].hidden.len() > 1, list.case[*k].group == "weak", hash(&list.case[*k].name)));
    for k in order {
        let strong: Vec<Case> = list.case.iter().filter(|c| c.group == "strong" && c.strength.is_some()).cloned().collect();
        let c = &mut list.case[k];
        if !options.wants(c) || c.hidden.is_empty() || c.strength.is_some() && c.acts.is_some() {
            continue;
        }
        if options.is_over(&clock) {
            println!("the slice is over");
            return Ok(());
        }
        let folder = folder()?;
        match c.calibrate(folder.path(), &strong) {
            Ok(()) => {
                let amplitudes: Vec<f64> = c.hidden.iter().filter_map(|h| h.amplitude).collect();
                println!("{}: {:.2} σ, amplitude {amplitudes:?}", c.name, c.strength.unwrap_or(0.0));
                list.write()?;
            }
            Err(e) => println!("{}: {e}", c.name),
        }
    }
    Ok(())
}

/// Writes recordings and scenes of cases for methods of others. A case that cannot be recorded does not keep the others from it.
fn record(cases: &[Case], folder: &Path) -> Result<(), String> {
    let mut failed = Vec::new();
    for (i, c) in cases.iter().enumerate() {
        let place = folder.join(c.name.replace(' ', "-"));
        println!("{}/{} {}", i + 1, cases.len(), place.display());
        if let Err(why) = record_one(c, &place) {
            println!("  {why}");
            failed.push(c.name.as_str());
        }
    }
    println!("\n{} cases; answers go to cargo xtask suite --score FILE (benchmark/README.md)", cases.len() - failed.len());
    if failed.is_empty() { Ok(()) } else { Err(format!("not recorded: {}", failed.join(", "))) }
}

fn record_one(c: &Case, place: &Path) -> Result<(), String> {
    std::fs::create_dir_all(place).map_err(|e| format!("{}: {e}", place.display()))?;
    c.record(place).map_err(|e| e.to_string())?;
    let setup = c.setup().map_err(|e| e.to_string())?;
    for (name, other) in [("seen", false), ("other", true)].into_iter().filter(|(_, other)| !other || c.held_out) {
        let file = place.join(format!("{name}.toml"));
        std::fs::write(&file, setup.text(Path::new(name), other)).map_err(|e| format!("{}: {e}", file.display()))?;
    }
    Ok(())
}

/// Answers of another method, one JSON object a line, scored; the method has the name of the file.
fn scored(cases: &[Case], file: &Path) -> Result<Vec<Row>, String> {
    let method = file.file_stem().map_or_else(|| "other".into(), |s| s.to_string_lossy().into_owned());
    let row = |a: Answer| {
        let c = cases.iter().find(|c| c.name == a.case);
        let c = c.ok_or_else(|| format!("{}: there is no case \"{}\"", file.display(), a.case))?;
        let truth = c.truth().map_err(|e| e.to_string())?;
        Ok(score::score(&crate::real::report::Made::default(), &method, c, &truth, &a))
    };
    rows::load::<Answer>(file)?.into_iter().map(row).collect()
}

/// Prints scores of another method.
fn score_file(cases: &[Case], file: &Path) -> Result<(), String> {
    let all = scored(cases, file)?;
    all.iter().for_each(|row| println!("{}: {}", row.case, report::line(row)));
    report::print(&all);
    Ok(())
}

/// What was measured here, and answers of others that `bench/answers` keeps.
fn all_rows(cases: &[Case]) -> Result<Vec<Row>, String> {
    let mut all: Vec<Row> = rows::load(&rows::path("suite"))?;
    let folder = table::root().join("bench/answers");
    let fail = |e: std::io::Error| format!("{}: {e}", folder.display());
    let mut files =
        std::fs::read_dir(&folder).map_err(fail)?.map(|e| e.map(|e| e.path())).collect::<Result<Vec<_>, _>>().map_err(fail)?;
    files.sort();
    for file in files {
        all.extend(scored(cases, &file)?);
    }
    Ok(all)
}

/// A case of the tests on the small ball: what is hidden, nothing, or a magnet; calibrated in `folder`.
///
/// # Errors
/// It cannot be simulated.
pub fn small(hidden: Option<&str>, seed: u64, folder: &Path) -> Result<Case, palpate::Error> {
    let group = match hidden {
        Some("magnet") => "outside",
        Some(_) => "strong",
        None => "null",
    };
    let put = |what: &str| Put { what: what.into(), aim: Some(STRONG), amplitude: None };
    let mut c = Case {
        name: format!("{} ball {seed}", hidden.unwrap_or("null")),
        group: group.into(),
        scene: "ball".into(),
        simulator: Simulator::Cells,
        seed,
        held_out: true,
        strength: None,
        acts: None,
        hidden: hidden.map(put).into_iter().collect(),
    };
    c.calibrate(folder, &[])?;
    Ok(c)
}

/// Palpate's answer to a case, scored.
///
/// # Errors
/// It cannot be recorded.
pub fn answered(c: &Case, folder: &Path, budget: Duration) -> Result<Row, palpate::Error> {
    let recorded = c.record(folder)?;
    let answer = Method::Palpate.answer(&c.name, &recorded, budget, &mut |_| ())?;
    let made = crate::real::report::Made::default();
    Ok(score::score(&made, Method::Palpate.name(), c, &c.truth()?, &answer))
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_model::effects::{ALL, Trial};

    #[test]
    fn every_effect_is_hidden_in_two_scenes_strong_and_weak_and_names_are_unique() {
        let all = List::read().unwrap().cases().unwrap();
        for law in ALL.iter().filter(|l| l.trial != Trial::Never) {
            for group in ["strong", "weak"] {
                let hides = |c: &&Case| c.group == group && c.hidden.iter().any(|h| h.what == law.kind);
                let mut scenes: Vec<&str> = all.iter().filter(hides).map(|c| c.scene.as_str()).collect();
                scenes.sort_unstable();
                scenes.dedup();
                assert!(scenes.len() >= 2, "{} {group}: {scenes:?}", law.kind);
            }
        }
        let mut names: Vec<&str> = all.iter().map(|c| c.name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), all.len());
        let of = |group: &str| all.iter().filter(|c| c.group == group).collect::<Vec<_>>();
        assert!(of("pair").iter().all(|c| c.hidden.len() == 2) && of("pair").len() >= 60);
        assert!(of("null").iter().all(|c| c.hidden.is_empty()) && of("null").len() >= 300);
        assert!(of("outside").len() >= 30);
        assert!(all.iter().all(|c| GROUPS.contains(&c.group.as_str())));
        assert!(all.iter().all(|c| c.setup().and_then(|s| s.truth(true)).is_ok()));
    }
}
