//! What a hypothesis changes in a scene: an effect added, or numbers freed that the scene holds fixed. Both compete on equal terms.

use crate::laboratory::{Setting, Wall};
use glam::DVec3;
use palpate_model::effects::{ALL, Effect, EffectParam, Family, Law, Numbered, Site, Trial, Unstated};
use palpate_model::params::ParamKey;

/// One change of a scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// An effect of the table, with the values that its numbers start from.
    Effect(Effect),
    /// Numbers of the scene that become free.
    Freed {
        /// Name in reports.
        name: &'static str,
        /// One plain sentence, without full stop.
        sentence: &'static str,
        /// Dotted paths of the numbers.
        paths: Vec<String>,
    },
}

/// What an effect at an unknown place, or along an unknown direction, is aimed with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aim {
    /// A coordinate of a place on the body.
    Place,
    /// A component of a direction, whose length means nothing.
    Direction,
}

impl Change {
    /// Name: the effect's kind, or what is freed.
    pub fn kind(&self) -> &'static str {
        match self {
            Change::Effect(e) => e.law().kind,
            Change::Freed { name, .. } => name,
        }
    }

    /// Names of several, joined by a plus.
    pub fn kinds(changes: &[Change]) -> String {
        changes.iter().map(Change::kind).collect::<Vec<_>>().join(" + ")
    }

    /// What it would mean, for reports.
    pub fn sentence(&self) -> &'static str {
        match self {
            Change::Effect(e) => e.law().sentence,
            Change::Freed { sentence, .. } => sentence,
        }
    }

    /// True for two effects of one family of laws: a gradient of the stiffness and a body of two parts describe the same.
    pub fn is_kin(&self, other: &Change) -> bool {
        matches!((self, other), (Change::Effect(a), Change::Effect(b)) if a.law().family == b.law().family)
    }

    /// Places in the law's parameters of an effect that a fit may move, or 0 to n of freed numbers.
    pub fn free_slots(&self) -> Vec<usize> {
        match self {
            Change::Effect(e) => {
                let free = |p: &EffectParam| {
                    matches!(p.default, Unstated::Absent(_) | Unstated::Stated(_) | Unstated::Center | Unstated::OnBody)
                };
                (0..e.values.len()).filter(|s| free(&e.law().params[*s])).collect()
            }
            Change::Freed { paths, .. } => (0..paths.len()).collect(),
        }
    }

    /// Which of [`Change::free_slots`] are coordinates of a place on the body or components of a direction.
    pub fn aims(&self) -> Vec<Option<Aim>> {
        match self {
            Change::Effect(e) => {
                let aim = |p: &EffectParam| match p.default {
                    Unstated::OnBody => Some(Aim::Place),
                    _ if p.is_direction() => Some(Aim::Direction),
                    _ => None,
                };
                self.free_slots().into_iter().map(|s| aim(&e.law().params[s])).collect()
            }
            Change::Freed { paths, .. } => vec![None; paths.len()],
        }
    }

    /// What each free number is a component of: those of one vector are of one kind and size.
    pub fn groups(&self) -> Vec<String> {
        match self {
            Change::Effect(e) => {
                self.free_slots().into_iter().map(|s| format!("{} {}", e.law().kind, e.law().params[s].key)).collect()
            }
            Change::Freed { paths, .. } => {
                // The axis, and a scene's name behind it, do not count.
                let stem = |p: &String| {
                    let path = p.split(' ').next().unwrap_or(p);
                    ["x", "y", "z"].iter().find_map(|a| path.strip_suffix(&format!(".{a}"))).unwrap_or(path).to_string()
                };
                paths.iter().map(stem).collect()
            }
        }
    }

    /// True for an effect on what is read of a motion, and not on the motion: its sensitivities take no solve.
    pub fn is_read(&self) -> bool {
        matches!(self, Change::Effect(e) if matches!(e.law().site, Site::Readings(_) | Site::Clock | Site::Marker))
    }

    /// True for an effect that is tried so.
    pub fn is_tried(&self, how: Trial) -> bool {
        matches!(self, Change::Effect(e) if e.law().trial == how)
    }

    /// Typical sizes of the free numbers that are amplitudes, zero for others and for what is freed.
    pub fn typical(&self) -> Vec<f64> {
        let size = |slot: usize| match self {
            Change::Effect(e) if matches!(e.law().params[slot].default, Unstated::Absent(_)) => e.law().params[slot].typical,
            _ => 0.0,
        };
        self.free_slots().into_iter().map(size).collect()
    }

    /// Which of [`Change::free_slots`] have a derivative at "absent": amplitudes, or all freed numbers.
    pub fn amplitudes(&self) -> Vec<bool> {
        match self {
            Change::Effect(e) => {
                let amplitude = |s: usize| matches!(e.law().params[s].default, Unstated::Absent(_));
                self.free_slots().into_iter().map(amplitude).collect()
            }
            Change::Freed { paths, .. } => vec![true; paths.len()],
        }
    }
}

/// A hypothesis to be tried: one change, with the starts that it is tried from.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The same effect from different places.
    pub variants: Vec<Change>,
}

impl Candidate {
    /// Name of its change.
    pub fn kind(&self) -> &'static str {
        self.variants[0].kind()
    }
}

/// Numbers of a scene that are usually held fixed and that a hypothesis may free.
struct Freeable {
    /// Names in reports: one of the hypothesis that frees all of them together, or those of the first, second and further ones where each is
    /// a hypothesis of its own.
    names: &'static [&'static str],
    /// What it would mean.
    sentence: &'static str,
    /// Their paths; one that ends in a dot stands for all paths below it.
    paths: &'static [&'static str],
}

const fn together(name: &'static [&'static str; 1], sentence: &'static str, paths: &'static [&'static str]) -> Freeable {
    Freeable { names: name, sentence, paths }
}

const FREEABLE: [Freeable; 11] = [
    together(&["poisson-ratio"], "the material keeps its volume better or worse than assumed", &["material.poisson_ratio"]),
    together(&["mass-damping"], "slow motion is damped more or less than assumed", &["material.mass_damping"]),
    together(&["stiffness-damping"], "fast vibration is damped more or less than assumed", &["material.stiffness_damping"]),
    together(&["stiffness"], "the material is stiffer or softer than assumed", &["material.youngs_modulus"]),
    together(&["density"], "the body is heavier or lighter than assumed", &["material.density", "material.mass"]),
    together(&["gravity"], "gravity has another size or direction than assumed", &["world.gravity."]),
    together(&["initial-velocity"], "the body moves at the start in another way than assumed", &["initial.velocity."]),
    together(&["initial-spin"], "the body spins at the start in another way than assumed", &["initial.angular_velocity."]),
    together(&["release-time"], "the motion starts at another time than assumed", &["time.start"]),
    together(&["plane-pose"], "the ground lies higher, lower or more tilted than assumed", &["plane."]),
    Freeable {
        names: &["point-mass-value", "second-point-mass-value", "further-point-mass-value"],
        sentence: "a point mass is heavier or lighter than assumed",
        paths: &["mass."],
    },
];

impl Freeable {
    /// The hypotheses that free those of these numbers that a scene holds fixed.
    fn changes(&self, held: &[String]) -> Vec<Change> {
        let mine: Vec<String> = held.iter().filter(|p| self.paths.iter().any(|x| names(x, p))).cloned().collect();
        let change = |name, paths| Change::Freed { name, sentence: self.sentence, paths };
        match self.names {
            _ if mine.is_empty() => Vec::new(),
            [name] => vec![change(name, mine)],
            several => {
                let name = |i: usize| several[i.min(several.len() - 1)];
                mine.into_iter().enumerate().map(|(i, path)| change(name(i), vec![path])).collect()
            }
        }
    }
}

/// True when a path is the one named, up to the scene's name behind it; a name that ends in a dot stands for all paths below it.
fn names(name: &str, path: &str) -> bool {
    path.strip_prefix(name).is_some_and(|rest| name.ends_with('.') || rest.is_empty() || rest.starts_with(' '))
}

/// Every hypothesis for a scene: the table of effects, and what the scene holds fixed.
pub fn candidates(setting: &Setting) -> Vec<Candidate> {
    let mut out = Vec::new();
    let acts = |l: &Law| (setting.cells || !l.needs_cells()) && (setting.sight || !matches!(l.site, Site::Readings(_)));
    let tried = |l: &Law| l.trial != Trial::Never && l.family != Family::Slack && acts(l);
    for (law, l) in ALL.iter().enumerate().filter(|(_, l)| tried(l)) {
        let choices = l.params.iter().find_map(|p| match p.default {
            Unstated::Choice(Numbered::Camera) => Some(setting.cameras),
            Unstated::Choice(Numbered::Marker) => Some(setting.markers),
            _ => None,
        });
        for choice in 0..choices.unwrap_or(1) {
            let mut effect = Effect::absent(law);
            for (v, p) in effect.values.iter_mut().zip(l.params) {
                match p.default {
                    Unstated::Choice(_) => *v = Some(choice as f64),
                    Unstated::Center | Unstated::Reference | Unstated::OnBody => {
                        *v = Some(setting.center[usize::from(p.axis.unwrap_or(0))])
                    }
                    Unstated::Sharp(_) => *v = Some(setting.spot),
                    _ => {}
                }
            }
            let variants = match l.trial {
                Trial::Walls if !setting.walls.is_empty() => at_walls(&effect, &setting.walls),
                Trial::Starts | Trial::Walls => spread(&effect, setting),
                Trial::Score | Trial::Saturates | Trial::Never => vec![effect],
            };
            out.push(Candidate { variants: variants.into_iter().map(Change::Effect).collect() });
        }
    }
    let freed = FREEABLE.iter().flat_map(|f| f.changes(&setting.held));
    out.extend(freed.map(|change| Candidate { variants: vec![change] }));
    out
}

/// Van der Corput's sequence in a base: point i of the unit interval, evenly spread for any number of points.
fn radical_inverse(mut i: usize, base: usize) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0 / base as f64);
    while i > 0 {
        value += (i % base) as f64 * digit;
        i /= base;
        digit /= base as f64;
    }
    value
}

/// The same effect at spread values of the numbers that have no value at "absent": points on the body's surface for places, directions
/// over the sphere, numbers over some typical sizes (a Halton sequence over all of them).
fn spread(effect: &Effect, setting: &Setting) -> Vec<Effect> {
    const BASES: [usize; 8] = [2, 3, 5, 7, 11, 13, 17, 19];
    let params = effect.law().params;
    let open = |p: &EffectParam| matches!(p.default, Unstated::Stated(_) | Unstated::Center | Unstated::OnBody);
    let vectors: Vec<usize> = (0..params.len()).filter(|s| open(&params[*s]) && params[*s].axis == Some(0)).collect();
    let numbers: Vec<usize> = (0..params.len()).filter(|s| open(&params[*s]) && params[*s].axis.is_none()).collect();
    let dimensions = 2 * vectors.len() + numbers.len();
    let count = match dimensions {
        0 => 1,
        1 => 6,
        2 => 12,
        _ => 20,
    };
    let mut out = Vec::new();
    for i in 0..count {
        let mut e = effect.clone();
        let unit = |d: usize| radical_inverse(i + 1, BASES[d % BASES.len()]);
        for (k, &s) in vectors.iter().enumerate() {
            let value = if params[s].unit == "m" {
                let places = &setting.places;
                // The first place walks through all of them; further ones lie anywhere around the body.
                let at = if k == 0 { i * places.len() / count } else { (unit(2 * k) * places.len() as f64) as usize };
                let at = places.get(at).copied().unwrap_or(setting.center);
                if k == 0 { at } else { setting.center + (1.0 + unit(2 * k + 1)) * (at - setting.center) }
            } else {
                let (z, a) = (2.0 * unit(2 * k) - 1.0, std::f64::consts::TAU * unit(2 * k + 1));
                let r = (1.0 - z * z).sqrt();
                DVec3::new(r * a.cos(), r * a.sin(), z)
            };
            (0..3).for_each(|a| e.values[s + a] = Some(value[a]));
        }
        for (k, &s) in numbers.iter().enumerate() {
            let p = &params[s];
            let middle = p.default.value().unwrap_or(0.0);
            // Six typical sizes either way: half a turn for angles of half a radian.
            let (low, high) = ((middle - 6.0 * p.typical).max(p.lower), (middle + 6.0 * p.typical).min(p.upper));
            e.values[s] = Some(low + (high - low) * unit(2 * vectors.len() + k));
        }
        out.push(e);
    }
    out
}

/// A plane at each of these places.
fn at_walls(effect: &Effect, walls: &[Wall]) -> Vec<Effect> {
    let at = |wall: &Wall| {
        let mut e = effect.clone();
        let n = wall.normal;
        for (v, p) in e.values.iter_mut().zip(effect.law().params) {
            match p.key {
                "normal" => *v = p.axis.map(|a| n[usize::from(a)]),
                "distance" => *v = Some(wall.distance),
                _ => {}
            }
        }
        e
    };
    walls.iter().map(at).collect()
}

/// The slack effect over windows of time that add up to one: `windows` hats between `from` and `to` [s]; empty when the table has none.
pub fn slack(setting: &Setting, from: f64, to: f64, windows: usize) -> Vec<Change> {
    let Some(law) = ALL.iter().position(|l| l.family == Family::Slack) else { return Vec::new() };
    let slot = |key: &str| ALL[law].params.iter().position(|p| p.key == key);
    let spacing = (to - from) / (windows.max(2) - 1) as f64;
    (0..windows)
        .map(|w| {
            let mut e = Effect::absent(law);
            for (v, p) in e.values.iter_mut().zip(ALL[law].params) {
                v.get_or_insert(setting.center[usize::from(p.axis.unwrap_or(0))]);
            }
            if let (Some(t), Some(width)) = (slot("time"), slot("width")) {
                e.values[t] = Some(from + w as f64 * spacing);
                e.values[width] = Some(spacing.max(1e-6));
            }
            Change::Effect(e)
        })
        .collect()
}

/// Paths of a scene's numbers by their keys that a diagnosis may free: everything but the effects.
pub fn can_be_freed(key: ParamKey) -> bool {
    !matches!(key, ParamKey::Effect { .. })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laboratory::Laboratory;
    use crate::tests::bench::Bench;

    #[test]
    fn a_plane_is_tried_where_the_measured_body_stops() {
        let normal = DVec3::new(0.3, -0.5, 0.81).normalize();
        let mut setting = Bench::new(1, &[], false).setting().clone();
        setting.walls = vec![Wall { normal, distance: 0.07 }];
        let planes = candidates(&setting).into_iter().find(|c| c.kind() == "second-plane").unwrap();
        let [Change::Effect(e)] = &planes.variants[..] else { panic!("{planes:?}") };
        let first = |key: &str| e.law().params.iter().position(|p| p.key == key).unwrap();
        let stated: Vec<f64> = (0..3).map(|axis| e.values[first("normal") + axis].unwrap()).collect();
        assert!((DVec3::from_slice(&stated) - normal).length() < 1e-12);
        assert_eq!(e.values[first("distance")], Some(0.07));
        // Stiffness, distance and a direction: the point that distances are counted from stays.
        assert_eq!(planes.variants[0].free_slots().len(), 5);
        assert!(planes.variants[0].is_tried(Trial::Walls));
        assert_eq!(planes.variants[0].typical().len(), 5);
        // What moves edges within cells is not tried where there are none.
        let edges = |setting: &Setting| candidates(setting).iter().filter(|c| c.kind() == "clamp-edge").count();
        assert_eq!((edges(&setting), edges(&Setting { cells: false, ..setting.clone() })), (1, 0));
        // What moves readings along lines of sight is not tried where there are none.
        let biases = |setting: &Setting| candidates(setting).iter().filter(|c| c.kind() == "depth-bias").count();
        assert_eq!((biases(&setting), biases(&Setting { sight: false, ..setting.clone() })), (1, 0));
        // Without such planes it is tried all around.
        setting.walls.clear();
        assert!(candidates(&setting).iter().any(|c| c.kind() == "second-plane" && c.variants.len() > 8));
    }

    #[test]
    fn numbers_that_a_scene_holds_are_freed_together_or_one_by_one() {
        let mut setting = Bench::new(1, &[], false).setting().clone();
        let held = ["mass.0.mass", "material.mass", "mass.1.mass", "world.gravity.x", "mass.2.mass", "mass.3.mass [scene 2]"];
        setting.held = held.map(String::from).to_vec();
        let freed = |c: Candidate| match &c.variants[..] {
            [Change::Freed { name, paths, .. }] => Some((*name, paths.join(" + "))),
            _ => None,
        };
        let found: Vec<(&str, String)> = candidates(&setting).into_iter().filter_map(freed).collect();
        let expected = [
            ("density", "material.mass"),
            ("gravity", "world.gravity.x"),
            ("point-mass-value", "mass.0.mass"),
            ("second-point-mass-value", "mass.1.mass"),
            ("further-point-mass-value", "mass.2.mass"),
            ("further-point-mass-value", "mass.3.mass [scene 2]"),
        ];
        assert_eq!(found, expected.map(|(name, paths)| (name, paths.to_string())));
    }
}
