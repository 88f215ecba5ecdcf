//! The library of effects as a page: what `palpate inspect --effects` prints, and what `docs/effects.md` is.

use crate::results::effects::{EffectKey, EffectLaw, EffectsDocument};
use crate::results::finite;
use palpate_model::effects::law::Asks;
use palpate_model::effects::{ALL, EffectParam, Family, Law, Trial, Unstated};

const HEAD: &str = "\
# Effects

Laws that a scene may add to the material, its planes and clamps. Each is a table of the scene file,

```toml
[[effect]]
kind = \"coulomb-friction\"
coefficient = 0.3
```

can be simulated, and its numbers can be fitted as `effect.0.coefficient` (effects are counted from 0, components of vectors end
in `.x`, `.y`, `.z`). A key that is left out has its default; where that is marked *absent*, the effect does nothing then. Equations,
sources and limits stand at the head of each law's file in `crates/palpate-model/src/effects/`.

This page is the output of `palpate inspect --effects`.";

/// What stands above the effects of a family.
fn title(family: Family) -> (&'static str, &'static str) {
    match family {
        Family::Contact => ("Contact", "Between the body and planes."),
        Family::Load => ("Loads", "Forces on the body."),
        Family::Material => ("Material", "What the body is made of."),
        Family::Shape => ("Shape and supports", "Rest shape, state at the start, clamps."),
        Family::Measurement => (
            "Measurement",
            "How it was measured: what is compared changes, the motion does not. The sign of all: *reading = truth + effect*. With a depth bias
of +0.02 m readings are 2 cm too large. With an offset of a camera the recording states it so far off its true pose. With a time offset the
recording's clock is ahead by it. With an offset of a marker the marker sits so far from its stated place. A fit undoes the effect before it
compares (in reverse order of the scene); `palpate observe` applies it to the recording that it makes.",
        ),
        Family::Slack => ("Slack", "A free force field: a bound on what any load could explain, never an explanation."),
    }
}

fn trial(law: &Law) -> &'static str {
    match law.trial {
        Trial::Score => "by its derivative where it is absent",
        Trial::Saturates => "by its derivative where it is absent, and from a typical size",
        Trial::Starts | Trial::Walls => "by short fits from several starts",
        Trial::Never => "not by itself",
    }
}

/// Numbers as people write them: no rounding, powers of ten where they are shorter.
fn short(v: f64) -> String {
    let (plain, power) = (format!("{v}"), format!("{v:e}"));
    if power.len() < plain.len() { power } else { plain }
}

fn allowed(p: &EffectParam) -> String {
    match (p.lower.is_finite(), p.upper.is_finite()) {
        (true, true) => format!("{} to {}", short(p.lower), short(p.upper)),
        (true, false) => format!("from {}", short(p.lower)),
        (false, true) => format!("up to {}", short(p.upper)),
        (false, false) => "any".to_string(),
    }
}

fn default(p: &EffectParam) -> String {
    match p.default {
        Unstated::Absent(v) => format!("{} (absent)", short(v)),
        Unstated::Choice(_) => "0 (a choice, not fitted)".to_string(),
        _ => p.default.value().map_or("centre of mass".to_string(), short),
    }
}

/// Parameters with the components of a vector as one.
fn keys(law: &Law) -> impl Iterator<Item = &EffectParam> {
    law.params.iter().filter(|p| p.axis.unwrap_or(0) == 0)
}

/// The page, in Markdown.
pub fn markdown() -> String {
    let mut text = HEAD.to_string();
    let families =
        [Family::Contact, Family::Load, Family::Material, Family::Shape, Family::Measurement, Family::Slack].into_iter();
    for family in families.filter(|f| ALL.iter().any(|l| l.family == *f)) {
        let (name, about) = title(family);
        text += &format!("\n\n## {name}\n\n{about}");
        for law in ALL.iter().filter(|l| l.family == family) {
            text += &format!("\n\n### `{}`\n\nIn reports: “{}”. A diagnosis tries it {}.\n", law.kind, law.sentence, trial(law));
            text += "\n| key | unit | allowed | default | meaning |\n|---|---|---|---|---|";
            for p in keys(law) {
                let unit = if p.unit == "1" { "–" } else { p.unit };
                let vector = if p.axis.is_some() { "vector: " } else { "" };
                text += &format!("\n| `{}` | {unit} | {} | {} | {vector}{} |", p.key, allowed(p), default(p), p.doc);
            }
            if law.table() != "effect" {
                text += &format!("\n\nWritten as a table `[[{}]]` ([scene format](scene-format.md)).", law.table());
            }
            if law.asks() == Asks::Path {
                text += "\n| `path` | s, m | times increasing | – | what it follows: a CSV file `time,x,y,z`, or rows `[[time, x, y, z], …]`; not fitted |";
            }
        }
    }
    text
}

/// The same for programs; bounds that do not exist are `None`.
pub fn document() -> EffectsDocument {
    let key = |p: &EffectParam| EffectKey {
        key: p.key.into(),
        components: if p.axis.is_some() { 3 } else { 1 },
        unit: p.unit.into(),
        lower: finite(p.lower),
        upper: finite(p.upper),
        typical: p.typical,
        default: p.default.value(),
        absent: matches!(p.default, Unstated::Absent(_)),
        doc: p.doc.into(),
    };
    let law = |l: &Law| EffectLaw {
        kind: l.kind.into(),
        family: title(l.family).0.into(),
        sentence: l.sentence.into(),
        trial: trial(l).into(),
        parameters: keys(l).map(key).collect(),
    };
    EffectsDocument { effects: ALL.iter().map(law).collect() }
}
