//! `[[effect]]`: laws beyond the material. The keys of each kind come from the table of laws.

use super::path::path;
use crate::document::Table;
use crate::error::InputError;
use crate::keys::suggest;
use palpate_model::effects::law::Asks;
use palpate_model::effects::{self, Effect, EffectParam, Unstated};
use palpate_model::params::unit_behind;

/// Every effect of a scene, in the order of the file.
pub(super) fn effects(root: &Table) -> Result<Vec<Effect>, InputError> {
    root.tables("effect")?.iter().map(effect).collect()
}

fn effect(t: &Table) -> Result<Effect, InputError> {
    let kind = t.optional_str("kind")?.ok_or_else(|| t.missing("kind", "the name of an effect"))?;
    let kinds: Vec<&str> = effects::ALL.iter().map(|l| l.kind).collect();
    let law =
        effects::find(kind).ok_or_else(|| t.error("kind", format!("\"{kind}\" is not an effect; {}", suggest(kind, &kinds))))?;
    if effects::ALL[law].table() != "effect" {
        return Err(t.error("kind", format!("\"{kind}\" is written as a table [[{}]]", effects::ALL[law].table())));
    }
    let mut known = vec!["kind"];
    known.extend(effects::ALL[law].params.iter().filter(|p| p.axis.unwrap_or(0) == 0).map(|p| p.key));
    let follows = effects::ALL[law].asks() == Asks::Path;
    known.extend(follows.then_some("path"));
    if let Some(unknown) = t.names().into_iter().find(|k| !known.contains(k)) {
        return Err(t.error(unknown, format!("unknown key of \"{kind}\"; {}", suggest(unknown, &known))));
    }
    let mut out = Effect::absent(law);
    for (value, p) in out.values.iter_mut().zip(effects::ALL[law].params) {
        if let Some(stated) = stated(t, p)? {
            *value = Some(stated);
        }
    }
    if follows {
        let path = path(t, "path")?;
        out.path =
            Some(path.ok_or_else(|| t.missing("path", "the name of a CSV file time,x,y,z, or rows [[time, x, y, z], …]"))?);
    }
    Ok(out)
}

/// A parameter's value where the file states it, checked against its bounds.
fn stated(t: &Table, p: &EffectParam) -> Result<Option<f64>, InputError> {
    let value = match p.axis {
        None => t.optional_f64(p.key)?,
        Some(a) => t.optional_vec3(p.key)?.map(|v| v[usize::from(a)]),
    };
    match value {
        Some(v) if matches!(p.default, Unstated::Choice(_)) && !(v.fract() == 0.0 && (p.lower..=p.upper).contains(&v)) => {
            Err(t.error(p.key, format!("{v} is not allowed: {} is a whole number from 0", p.doc)))
        }
        Some(v) if !(p.lower..=p.upper).contains(&v) => {
            let unit = unit_behind(p.unit);
            Err(t.error(p.key, format!("{v} is not allowed: {} must lie in [{}, {}]{unit}", p.doc, p.lower, p.upper)))
        }
        v => Ok(v),
    }
}
