//! One case: hide something, record it twice, diagnose the first recording with the second held out, and compare.

use super::hidden::{Hidden, Number, TABLE, same};
use super::magnet::Magnet;
use super::record::{Maker, observed};
use super::scenes::{Setup, setup};
use super::strength::{Moved, Ruler, rms};
use glam::DVec3;
use palpate::{Backend, DiagnoseOptions, Diagnosed, Error, Experiment, diagnose};
use palpate_diagnose::MapEntry;
use palpate_model::scene::Scene;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Duration;

/// What is hidden in which scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Name, unique in the suite: "coulomb-friction ball strong".
    pub name: String,
    /// Scene.
    pub scene: &'static str,
    /// Group of the report: weak, strong, null, pair, magnet.
    pub group: &'static str,
    /// Places in [`TABLE`] with the strength that is aimed at.
    pub hidden: Vec<(usize, f64)>,
    /// Where the magnet is and the strength that is aimed at.
    pub magnet: Option<(DVec3, f64)>,
    /// Seed of the recordings.
    pub seed: u64,
}

/// What was hidden and what was found.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Outcome {
    /// Name of the case.
    pub name: String,
    /// Its scene.
    pub scene: String,
    /// Its group.
    pub group: String,
    /// What was hidden.
    pub hidden: Vec<String>,
    /// Amplitudes over those of the table.
    pub amplitudes: Vec<f64>,
    /// How far it moves readings after refitting, in standard deviations (root mean square).
    pub strength: f64,
    /// Verdict; "failed" when there was none.
    pub verdict: String,
    /// Accepted effects in the order found.
    pub named: Vec<String>,
    /// What the first of them cannot be told from.
    pub indistinguishable: Vec<String>,
    /// What came closest without being accepted, and the share of the gap that it closes.
    pub close: Vec<(String, f64)>,
    /// Probability of the baseline's residuals by chance.
    pub p_value: Option<f64>,
    /// The same after what was added.
    pub p_value_after: Option<f64>,
    /// Size of residuals' structure before and after [m].
    #[serde(default)]
    pub structure: (f64, f64),
    /// Share of the found excess that lies where the hidden thing really acts.
    pub localisation: Option<f64>,
    /// Relative error of the hidden numbers, where named.
    pub parameter_error: Option<f64>,
    /// Share of the gap closed on the held-out recording.
    pub gap_closed: f64,
    /// Distance on the held-out recording before and after, and what noise and discretisation explain of it [m].
    #[serde(default)]
    pub held_out: Option<[f64; 3]>,
    /// Cosine between the mean slack force and the direction to the magnet.
    pub slack_points: Option<f64>,
    /// Wall-clock time of the diagnosis [s].
    pub seconds: f64,
    /// The answer in words, or why there is none.
    pub sentence: String,
}

impl Outcome {
    /// 1 when the first (with several hidden: every) hidden thing is named first, ½ when it is honestly said to be as good.
    pub fn score(&self) -> f64 {
        let named = |h: &String| self.named.iter().take(self.hidden.len()).any(|n| n == h);
        match self.group.as_str() {
            "null" => f64::from(u8::from(self.verdict == "adequate")),
            "magnet" => f64::from(u8::from(self.verdict == "unexplained")),
            _ if self.hidden.iter().all(named) => 1.0,
            "pair" => 0.0,
            _ if self.hidden.iter().all(|h| self.indistinguishable.contains(h)) => 0.5,
            _ => 0.0,
        }
    }

    /// As [`Outcome::score`], with names of the same physics counted as right.
    pub fn score_of_physics(&self) -> f64 {
        let right = self.named.first().zip(self.hidden.first()).is_some_and(|(n, h)| same(n, h));
        if self.hidden.len() == 1 && right { 1.0 } else { self.score() }
    }
}

impl Case {
    /// Puts everything into a true scene.
    fn hide(&self, scene: &Scene, amplitudes: &[f64]) -> Result<(Scene, Vec<(String, Number)>), Error> {
        let mut scene = scene.clone();
        let mut numbers = Vec::new();
        for ((k, _), a) in self.hidden.iter().zip(amplitudes) {
            numbers.extend(TABLE[*k].apply(&mut scene, *a)?.into_iter().map(|n| (TABLE[*k].name.to_string(), n)));
        }
        if let Some((place, _)) = self.magnet {
            scene = Magnet { place, force: amplitudes[0] * MAGNET }.apply(&scene)?;
        }
        Ok((scene, numbers))
    }

    /// Amplitudes that reach the strengths aimed at.
    fn amplitudes(&self, ruler: &Ruler) -> Result<Vec<f64>, Error> {
        let magnet = self.magnet.map(|(place, target)| {
            let put = |s: &mut Scene, a: f64| {
                s.effects = Magnet { place, force: a * MAGNET }.apply(s)?.effects;
                Ok(())
            };
            ruler.amplitude(target, put)
        });
        let effect = |(k, target): &(usize, f64)| -> Result<f64, Error> {
            let h: &Hidden = &TABLE[*k];
            ruler.amplitude(*target, |s, a| h.apply(s, a).map(|_| ()))
        };
        self.hidden.iter().map(effect).chain(magnet).collect()
    }

    /// How strong it is, in one line.
    ///
    /// # Errors
    /// The scene cannot be simulated with it.
    pub fn strength(&self, folder: &Path) -> Result<String, Error> {
        let setup = setup(self.scene).ok_or_else(|| Error::Input(format!("{}: no such scene", self.scene)))?;
        let ruler = Ruler::new(setup, &folder.join("ruler"))?;
        let amplitudes = self.amplitudes(&ruler)?;
        let strength = rms(&self.moved(&ruler, &amplitudes)?);
        let hidden = self.hide(&setup.truth(false)?, &amplitudes)?.1;
        let numbers: Vec<String> = hidden.iter().map(|(_, n)| format!("{} {:.4}", n.path, n.truth)).collect();
        Ok(format!("{strength:.2} σ, amplitude {amplitudes:.3?}: {}", numbers.join(", ")))
    }

    fn moved(&self, ruler: &Ruler, amplitudes: &[f64]) -> Result<Vec<Moved>, Error> {
        ruler.left(|s| {
            *s = self.hide(s, amplitudes)?.0;
            Ok(())
        })
    }

    /// Runs the case in an empty folder; `budget` bounds the diagnosis. Failures are outcomes too.
    pub fn run(&self, folder: &Path, budget: Duration, say: &mut (dyn FnMut(&str) + Send)) -> Outcome {
        let hidden = self.hidden.iter().map(|h| TABLE[h.0].name.to_string()).collect();
        let mut out = Outcome::new(&self.name, self.scene, self.group, hidden);
        if let Err(e) = self.fill(&mut out, folder, budget, say) {
            out.sentence = e.to_string();
        }
        out
    }

    fn fill(&self, out: &mut Outcome, folder: &Path, budget: Duration, say: &mut (dyn FnMut(&str) + Send)) -> Result<(), Error> {
        let setup = setup(self.scene).ok_or_else(|| Error::Input(format!("{}: no such scene", self.scene)))?;
        say("strength");
        let ruler = Ruler::new(setup, &folder.join("ruler"))?;
        out.amplitudes = self.amplitudes(&ruler)?;
        say("recordings");
        let mut weaker = WEAKER;
        let (seen, held_out) = loop {
            let both = self
                .recorded(setup, &out.amplitudes, folder, false)
                .and_then(|seen| Ok((seen, self.recorded(setup, &out.amplitudes, folder, true)?)));
            match both {
                // What the diagnosis' own grid can simulate may be too much for a finer one.
                Err(e) if weaker > 0 && e.exit_code() == 1 => {
                    weaker -= 1;
                    out.amplitudes.iter_mut().for_each(|a| *a *= 0.7);
                }
                other => break other?,
            }
        };
        let moved = self.moved(&ruler, &out.amplitudes)?;
        out.strength = rms(&moved);
        let numbers = self.hide(&setup.truth(false)?, &out.amplitudes)?.1;
        let options = DiagnoseOptions {
            backend: Backend::Cpu,
            budget: Some(budget),
            on_progress: Some(&mut *say),
            ..DiagnoseOptions::default()
        };
        let found = diagnose(&[seen], Some(&held_out), options)?;
        for t in found.diagnosis.tried.iter().filter(|t| t.held_out_gain.is_some() || t.promised > 0.3) {
            let gain = t.held_out_gain.map_or("not judged".into(), |g| format!("closes {g:.3}"));
            say(&format!("round {}: {} promised {:.3}, {gain}", t.round, t.kind, t.promised));
        }
        out.compare(&found, &moved, &numbers);
        if let (Some((place, _)), Some(slack)) = (self.magnet, &found.diagnosis.slack) {
            let force = slack.windows.iter().map(|w| w.values.iter().take(3).copied().collect::<Vec<f64>>());
            let force: DVec3 = force.filter(|f| f.len() == 3).map(|f| DVec3::new(f[0], f[1], f[2])).sum();
            let center = found.experiments[0].plan().body.center;
            out.slack_points = Some(force.normalize_or_zero().dot((place - center).normalize_or_zero()));
        }
        Ok(())
    }

    /// The experiment of the diagnosis with a recording of the truth.
    fn recorded(&self, setup: &Setup, amplitudes: &[f64], folder: &Path, other: bool) -> Result<Experiment, Error> {
        let (scene, _) = self.hide(&setup.truth(other)?, amplitudes)?;
        let maker = Maker::other(2 * self.seed + u64::from(other));
        let place = folder.join(if other { "other" } else { "seen" });
        observed(setup, &scene, &maker, &place, other)
    }
}

/// How often a recording that cannot be simulated is tried with three tenths less of what it hides.
const WEAKER: usize = 3;

/// Force per volume of a magnet of amplitude one at its unit distance [N/m³], a tenth of the weight of water.
const MAGNET: f64 = 1e3;

impl Outcome {
    /// Nothing said yet.
    pub(super) fn new(name: &str, scene: &str, group: &str, hidden: Vec<String>) -> Outcome {
        Outcome {
            name: name.into(),
            scene: scene.into(),
            group: group.into(),
            hidden,
            amplitudes: Vec::new(),
            strength: 0.0,
            verdict: "failed".into(),
            named: Vec::new(),
            indistinguishable: Vec::new(),
            close: Vec::new(),
            p_value: None,
            p_value_after: None,
            structure: (0.0, 0.0),
            localisation: None,
            parameter_error: None,
            gap_closed: 0.0,
            held_out: None,
            slack_points: None,
            seconds: 0.0,
            sentence: String::new(),
        }
    }

    /// What the diagnosis says, without comparing it with the truth.
    pub(super) fn answer(&mut self, found: &Diagnosed) {
        let d = &found.diagnosis;
        self.verdict = d.verdict.name().into();
        self.sentence = d.sentence();
        self.seconds = found.seconds;
        self.gap_closed = d.gap_closed;
        self.held_out = d.held_out.map(|(before, after)| [before.rms, after.rms, after.noise]);
        (self.p_value, self.p_value_after) = (Some(d.p_value), Some(d.p_value_after));
        self.structure = d.structure;
        let accepted: Vec<_> = d.effects.iter().filter(|e| e.accepted).collect();
        self.named = accepted.iter().map(|e| e.kind.clone()).collect();
        self.indistinguishable = accepted.first().map(|e| e.indistinguishable_from.clone()).unwrap_or_default();
        self.close = d.effects.iter().filter(|e| !e.accepted).map(|e| (e.kind.clone(), e.held_out_gain)).collect();
    }

    fn compare(&mut self, found: &Diagnosed, moved: &[Moved], numbers: &[(String, Number)]) {
        self.answer(found);
        let d = &found.diagnosis;
        let accepted: Vec<_> = d.effects.iter().filter(|e| e.accepted).collect();
        // Of everything that belongs to what was named; a number that the answer does not state is as wrong as it can be.
        let mut off = (0.0, 0.0);
        let stated = |kind: &str, path: &str| {
            let mut all = accepted.iter().filter(|e| e.kind == kind).flat_map(|e| &e.parameters);
            all.find(|p| p.0 == path || p.0.splitn(3, '.').last() == Some(path)).map(|p| p.1)
        };
        for (kind, n) in numbers.iter().filter(|(kind, _)| self.named.contains(kind)) {
            let direction = DVec3::from(["x", "y", "z"].map(|a| stated(kind, &format!("direction.{a}")).unwrap_or(0.0)));
            // A body whose one part is softer is one whose other part is stiffer.
            let mirrored = TABLE.iter().any(|h| h.name == kind && h.scene == self.scene && h.faces_away(direction));
            let value = stated(kind, &n.path).map(|v| if mirrored { -v } else { v });
            off.0 += ((value.unwrap_or(n.absent) - n.truth) / n.scale).powi(2);
            off.1 += ((n.truth - n.absent) / n.scale).powi(2);
        }
        self.parameter_error = (off.1 > 0.0).then(|| (off.0 / off.1).sqrt());
        self.localisation = localisation(&d.map, moved);
    }
}

/// Share of the squared excess of a residual map in those blocks that hold 90 % of what really moved.
fn localisation(map: &[MapEntry], moved: &[Moved]) -> Option<f64> {
    // What really moved in every block: the square of the sum over its readings, over their number, as the null counts it.
    let mut real = vec![(0.0, 0.0); map.len()];
    for m in moved {
        let near = |b: &usize| (map[*b].place.distance(m.rest), b.to_owned());
        let during = |e: &MapEntry| (e.time.0 - 1e-9..=e.time.1 + 1e-9).contains(&m.time);
        let blocks = (0..map.len()).filter(|b| map[*b].stream == m.stream && during(&map[*b]));
        if let Some((_, b)) = blocks.map(|b| near(&b)).min_by(|a, b| a.0.total_cmp(&b.0)) {
            real[b].0 += m.change;
            real[b].1 += 1.0;
        }
    }
    let real: Vec<f64> = real.iter().map(|(sum, n)| sum * sum / f64::max(*n, 1.0)).collect();
    let mut order: Vec<usize> = (0..map.len()).collect();
    order.sort_by(|a, b| real[*b].total_cmp(&real[*a]));
    let total: f64 = real.iter().sum();
    let excess = |b: usize| (map[b].before * map[b].before - 1.0).max(0.0);
    let all: f64 = (0..map.len()).map(excess).sum();
    let (mut held, mut inside) = (0.0, 0.0);
    for b in order {
        if held >= 0.9 * total {
            break;
        }
        held += real[b];
        inside += excess(b);
    }
    (total > 0.0 && all > 0.0).then(|| inside / all)
}
