//! The answer of a diagnosis.

use crate::judgement::prior::Strange;
use crate::laboratory::Model;
use crate::locate::{Place, direction};
use crate::movement::Movement;
use crate::quantity::{millimetres as mm, stated};
use crate::separation::Separated;
use glam::DVec3;
use palpate_engine::Stream;
use palpate_model::params::unit_behind;

/// What a diagnosis says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing is missing that the data could show.
    Adequate,
    /// Something is missing, and what was added explains it.
    MissingEffect,
    /// Something is missing that no known effect explains: surely so beside those that were added, if any explained most of it.
    Unexplained,
    /// Something is missing, and the search ended before every explanation was tried.
    Undecided,
}

impl Verdict {
    /// As result files write it.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Adequate => "adequate",
            Verdict::MissingEffect => "missing-effect",
            Verdict::Unexplained => "unexplained",
            Verdict::Undecided => "undecided",
        }
    }
}

/// What is said of candidates that there was no time to score.
pub(crate) const NOT_SCORED: &str = "not even scored";

/// Candidates that were not fitted, and numbers of what helps most, that a sentence names.
const TOLD: usize = 3;

/// How far measurement and model are apart.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Level {
    /// Root mean square distance of single points [m].
    pub rms: f64,
    /// What noise and discretisation alone would leave [m].
    pub noise: f64,
}

impl Level {
    /// What noise does not explain [m²], not negative.
    pub fn gap(&self) -> f64 {
        (self.rms * self.rms - self.noise * self.noise).max(0.0)
    }
}

/// A number of an effect: path in the changed scene, value, standard error, unit.
pub type FoundNumber = (String, f64, Option<f64>, String);

/// Numbers of an effect in words, each with its error and unit.
pub fn in_words(numbers: &[FoundNumber]) -> String {
    let number = |(path, value, error, unit): &FoundNumber| {
        let name = path.splitn(3, '.').last().unwrap_or(path);
        format!("{name} {}{}", stated(*value, *error), unit_behind(unit))
    };
    numbers.iter().map(number).collect::<Vec<_>>().join(", ")
}

/// An effect that was fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Name of the effect, or of what was freed.
    pub kind: String,
    /// What it means.
    pub sentence: String,
    /// Its numbers.
    pub parameters: Vec<FoundNumber>,
    /// How much better the model predicted what was left out with it than before, when it was added [nats], and the standard error of that.
    pub nats: (f64, f64),
    /// Share of the gap that it closed when it was added, on data left out.
    pub held_out_gain: f64,
    /// True when it is part of the corrected model.
    pub accepted: bool,
    /// Other candidates that predict data left out as well.
    pub indistinguishable_from: Vec<String>,
    /// What it, and each of those, does to the baseline's numbers.
    pub movements: Vec<Movement>,
    /// Measurement that would tell it best from them; `None` when there was none to be told from, or no time to look for one.
    pub separated_by: Option<Separated>,
}

/// A candidate's score where it is absent.
#[derive(Clone, Debug, PartialEq)]
pub struct Tried {
    /// Round of the search, from 1; 0 where the baseline's fit began.
    pub round: usize,
    /// Name.
    pub kind: String,
    /// Share of the squared residual that it promised.
    pub promised: f64,
    /// Share of the gap that it closed on data left out; `None` when it was not fitted.
    pub held_out_gain: Option<f64>,
    /// True where it was not fitted because the search ended before.
    pub open: bool,
}

/// Residuals of one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// Scene.
    pub scene: usize,
    /// Its time [s].
    pub time: f64,
    /// Root mean square distance of the baseline [m].
    pub before: f64,
    /// The same of the corrected model.
    pub after: f64,
}

/// One stretch of time of the slack force field.
#[derive(Clone, Debug, PartialEq)]
pub struct SlackWindow {
    /// Its middle [s].
    pub time: f64,
    /// Numbers of the slack effect in the order of its parameters.
    pub values: Vec<f64>,
}

/// What any load could explain.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Slack {
    /// Share of the squared residual beyond noise.
    pub share: f64,
    /// The force field.
    pub windows: Vec<SlackWindow>,
}

impl SlackWindow {
    /// Force per volume at the body's centre [N/m³].
    pub fn force(&self) -> DVec3 {
        self.values.get(..3).map_or(DVec3::ZERO, DVec3::from_slice)
    }
}

/// Mean force over the mean of its size from which on a load is said to pull one way.
const STEADY: f64 = 0.5;

impl Slack {
    /// What the force at the body's centre does, in words.
    pub fn words(&self) -> String {
        let sum: DVec3 = self.windows.iter().map(SlackWindow::force).sum();
        let sizes: f64 = self.windows.iter().map(|w| w.force().length()).sum();
        match sum.length() >= STEADY * sizes {
            true => format!("pulls towards {}", direction(sum)),
            false => "changes its direction with time".into(),
        }
    }
}

/// One block of the residual map: a region of the rest surface during a stretch of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapEntry {
    /// Scene.
    pub scene: usize,
    /// What was read: a camera's distances, or a coordinate.
    pub stream: Stream,
    /// Number of the region.
    pub region: usize,
    /// Its middle on the rest shape [m].
    pub place: DVec3,
    /// First and last frame's time [s].
    pub time: (f64, f64),
    /// Residual of the baseline in standard deviations of the null.
    pub before: f64,
    /// The same of the corrected model.
    pub after: f64,
}

/// The whole answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnosis {
    /// What it says.
    pub verdict: Verdict,
    /// How much better the baseline predicts what was left out beside a discrepancy than alone [nats], and the standard error of that: positive
    /// where something is missing.
    pub missing: (f64, f64),
    /// The same of the corrected model.
    pub missing_after: (f64, f64),
    /// The fitted model of the scene as it is.
    pub baseline: Model,
    /// Its distance from the measurement.
    pub before: Level,
    /// Where the baseline fails.
    pub places: Vec<Place>,
    /// Residual map, block by block.
    pub map: Vec<MapEntry>,
    /// Effects that were accepted, then those that came closest.
    pub effects: Vec<Found>,
    /// Every candidate's score.
    pub tried: Vec<Tried>,
    /// Candidates that there was no time for.
    pub not_tried: Vec<String>,
    /// What candidates do to the free numbers: those that are named, those that are as good, and those that promise most of what was not fitted.
    pub movements: Vec<Movement>,
    /// What is strange about the numbers of the baseline, and of the corrected model.
    pub strange: (Vec<Strange>, Vec<Strange>),
    /// Residuals over time, instant by instant of every scene.
    pub course: Vec<Instant>,
    /// The corrected model.
    pub model: Model,
    /// Its distance from the measurement.
    pub after: Level,
    /// Distance on data that no fit has seen, before and after.
    pub held_out: Option<(Level, Level)>,
    /// Distance of data left out block by block, predicted from the rest [m], before and after.
    pub predicted: (f64, f64),
    /// Share of the gap that is closed.
    pub gap_closed: f64,
    /// What any load could explain of what the corrected model leaves; only for unexplained residuals.
    pub slack: Option<Slack>,
    /// Noise of single readings over the stated one.
    pub noise_ratio: f64,
    /// Factor by which correlation between readings raises the variance of means.
    pub design_effect: f64,
    /// What else whoever reads the answer must know, in sentences.
    pub caveats: Vec<String>,
    /// True when what is left still has structure that counts.
    pub remains: bool,
    /// True when it was stopped before its end.
    pub interrupted: bool,
    /// Why it is not even sure that something is missing: the baseline's fit was cut short, or it is not known what cells and step explain.
    pub unsure: Option<String>,
}

impl Diagnosis {
    /// The answer in one sentence, for a lab book, and what else must be known.
    pub fn sentence(&self) -> String {
        self.caveats.iter().fold(self.answer(), |all, c| format!("{all} {c}"))
    }

    fn answer(&self) -> String {
        let apart =
            format!("measurement and model are {} apart, noise and grid explain {}", mm(self.before.rms), mm(self.before.noise));
        let place = self.places.first().map_or(String::new(), |w| format!(", mostly at: {}", w.region));
        let slack = |begin: &str, end: &str| {
            let say =
                |s: &Slack| format!("{begin} would explain {:.0} % of what is left and {}{end}", 100.0 * s.share, s.words());
            self.slack.as_ref().map_or(String::new(), say)
        };
        match self.verdict {
            Verdict::Adequate => format!("Nothing is missing that these data could show: {apart}."),
            Verdict::Undecided if self.unsure.is_some() => {
                let why = self.unsure.as_deref().unwrap_or_default();
                let close = self.effects.first().map_or(String::new(), |e| format!("; {}", helps(e)));
                format!("Nothing is decided: {why}; so far {apart}{close}.{}", self.open())
            }
            Verdict::Unexplained if self.effects.iter().any(|e| e.accepted) => {
                let (added, load) = (self.added(), slack(" A free load", "."));
                format!(
                    "Something is missing that no known effect explains: {apart}{place}. The nearest that is known: {added}{load}"
                )
            }
            Verdict::Unexplained | Verdict::Undecided => {
                let open = self.verdict == Verdict::Undecided;
                let none = if open { "nothing helps so far" } else { "no known effect helps" };
                let close = self.effects.first().map_or(none.to_string(), helps);
                let why = match (open, self.interrupted) {
                    (false, _) => " that no known effect explains",
                    (true, true) => ", and the search was interrupted before every known effect was tried",
                    (true, false) => ", and the time was over before every known effect was tried",
                };
                let open = if open { self.open() } else { String::new() };
                // Where what is left has no structure, candidates that promise something are why the search went on.
                let what =
                    if self.remains || !self.effects.is_empty() { "Something is missing" } else { "Something may be missing" };
                format!("{what}{why}: {apart}{place}; {close}{}.{open}", slack("; a free load", ""))
            }
            Verdict::MissingEffect => {
                let caution = if self.remains { self.caution() } else { String::new() };
                format!("The model lacks something{place}: {}{caution}{}", self.added(), self.unfinished())
            }
        }
    }

    /// What was added, what that does to the distance, and what to the fitted numbers; a sentence or more.
    fn added(&self) -> String {
        let in_full = |e: &Found| {
            let others = match e.indistinguishable_from.as_slice() {
                [] => String::new(),
                others => format!("; these data cannot tell it from {}", others.join(", ")),
            };
            format!("{} ({}: {}{others})", e.sentence, e.kind, in_words(&e.parameters))
        };
        let what: Vec<String> = self.effects.iter().filter(|e| e.accepted).map(in_full).collect();
        format!(
            "{}. That brings the distance from {} to {} (noise and grid: {}) and closes {:.0} % of the gap on data left out.{}",
            what.join("; and "),
            mm(self.before.rms),
            mm(self.after.rms),
            mm(self.after.noise),
            100.0 * self.gap_closed,
            self.moved(),
        )
    }

    /// What the corrected model does to the free number that it moves most, where that is more than its error.
    fn moved(&self) -> String {
        let first = self.movements.first().filter(|m| m.fitted && m.is_beyond_error());
        first.map_or(String::new(), |m| format!(" {}", m.sentence()))
    }

    /// Candidates that were not fitted because the search ended before, the most promising first.
    pub fn not_yet_fitted(&self) -> Vec<&Tried> {
        let mut all: Vec<&Tried> = self.tried.iter().filter(|t| t.open).collect();
        all.sort_by(|a, b| b.promised.total_cmp(&a.promised));
        all
    }

    /// The first of these in words.
    fn open(&self) -> String {
        let all = self.not_yet_fitted();
        let one = |t: &&Tried| format!("{} ({:.0} % of the squared residual)", t.kind, 100.0 * t.promised);
        let told: Vec<String> = all.iter().take(TOLD).map(one).collect();
        let more = and_more(all.len().saturating_sub(TOLD));
        let unscored = match self.not_tried.iter().filter(|n| n.contains(NOT_SCORED)).count() {
            0 => String::new(),
            n => format!(" Not even scored: {n} candidates."),
        };
        match all.len() {
            0 => unscored,
            _ => format!(" Not yet fitted, by what sensitivities promise: {}{more}.{unscored}", told.join(", ")),
        }
    }

    /// What keeps the answer from being the whole one.
    fn caution(&self) -> String {
        " What is left still has structure: something else is missing as well, or this is only the nearest that is known."
            .to_string()
    }

    /// What was not tried to its end although an answer was found; empty when nothing is open.
    fn unfinished(&self) -> String {
        let known =
            |k: &str| self.effects.iter().any(|e| e.accepted && (e.kind == k || e.indistinguishable_from.iter().any(|o| o == k)));
        let open: Vec<&str> = self.not_tried.iter().filter_map(|n| n.split(": ").next()).filter(|k| !known(k)).collect();
        let why = if self.interrupted { "was interrupted" } else { "ended" };
        match open.len() {
            0 if self.interrupted => " The search was interrupted.".into(),
            0 => String::new(),
            n if n <= 4 => format!(" The search {why} before it had tried to the end: {}.", open.join(", ")),
            n => format!(" The search {why} before it had tried to the end: {} and {} more.", open[..3].join(", "), n - 3),
        }
    }
}

/// How many are not told.
fn and_more(left: usize) -> String {
    if left == 0 { String::new() } else { format!(" and {left} more") }
}

/// The effect that came closest, in words: its first numbers too, which is where an amplitude stands.
fn helps(e: &Found) -> String {
    let told = &e.parameters[..TOLD.min(e.parameters.len())];
    let more = and_more(e.parameters.len() - told.len());
    let numbers = if told.is_empty() { String::new() } else { format!(" ({}{more})", in_words(told)) };
    format!(
        "the known effect that helps most, {}{numbers}, closes {:.0} % of the gap on data left out",
        e.kind,
        100.0 * e.held_out_gain
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slack(forces: &[[f64; 3]]) -> Slack {
        let window = |f: &[f64; 3]| SlackWindow { time: 0.0, values: f.iter().copied().chain([0.0; 14]).collect() };
        Slack { share: 0.8, windows: forces.iter().map(window).collect() }
    }

    #[test]
    fn what_helps_most_is_told_with_its_first_numbers() {
        let number = |name: &str| (format!("effect.0.{name}"), 0.024, Some(0.0011), "m".to_string());
        let told = |names: &[&str]| {
            helps(&Found {
                kind: "depth-bias-part".into(),
                sentence: String::new(),
                parameters: names.iter().map(|n| number(n)).collect(),
                nats: (254.0, 25.0),
                held_out_gain: 0.94,
                accepted: false,
                indistinguishable_from: Vec::new(),
                movements: Vec::new(),
                separated_by: None,
            })
        };
        let closes = ", closes 94 % of the gap on data left out";
        let begins = |numbers: &str| format!("the known effect that helps most, depth-bias-part{numbers}{closes}");
        assert_eq!(told(&[]), begins(""));
        assert_eq!(told(&["bias"]), begins(" (bias 0.0240 ± 0.0011 m)"));
        assert_eq!(
            told(&["a", "b", "c", "d", "e"]),
            begins(" (a 0.0240 ± 0.0011 m, b 0.0240 ± 0.0011 m, c 0.0240 ± 0.0011 m and 2 more)")
        );
    }

    #[test]
    fn a_load_that_nobody_has_named_pulls_somewhere_or_changes() {
        assert_eq!(slack(&[[900.0, 40.0, -500.0], [300.0, -20.0, -200.0]]).words(), "pulls towards +x, -z");
        assert_eq!(slack(&[[900.0, 0.0, 0.0], [-800.0, 0.0, 0.0]]).words(), "changes its direction with time");
    }
}
