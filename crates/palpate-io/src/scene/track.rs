//! `[track]`: how `palpate track` follows the body.

use crate::document::Table;
use crate::error::InputError;
use palpate_model::scene::Tracking;

/// The table, or what holds without it.
pub(super) fn tracking(root: &Table) -> Result<Tracking, InputError> {
    let mut found = Tracking::default();
    let Some(t) = root.optional_table("track")? else { return Ok(found) };
    found.dynamic = t.optional_choice("prior", &[("elastic", false), ("dynamic", true)])?;
    if !matches!(t.optional_str("temperature"), Ok(Some("auto"))) {
        let text = "is not allowed: must be > 0 (J), or \"auto\"";
        found.temperature = t.f64_where("temperature", |x| x > 0.0, text)?;
    }
    let share = t.f64_where("outliers", |x| (0.0..0.9).contains(&x), "is not allowed: must be in [0, 0.9)")?;
    found.outliers = share.unwrap_or(found.outliers);
    found.spread = t.f64_where("soft_start", |x| x > 0.0, "is not allowed: must be > 0 (m)")?;
    Ok(found)
}
