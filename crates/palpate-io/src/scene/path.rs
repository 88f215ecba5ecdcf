//! A path that something follows: rows in the scene, or a CSV file beside it.

use super::rows::rows;
use crate::document::Table;
use crate::error::InputError;
use glam::DVec3;
use palpate_model::mechanics::path::Path;
use std::sync::Arc;

const COLUMNS: [&str; 4] = ["time", "x", "y", "z"];

/// The path under a key, where there is one.
pub(super) fn path(t: &Table, key: &str) -> Result<Option<Arc<Path>>, InputError> {
    let mut path = Path::default();
    if t.is_str(key) {
        let Some(file) = t.optional_file(key)? else { return Ok(None) };
        for (line, [time, x, y, z]) in rows(&file, COLUMNS)? {
            if path.times.last().is_some_and(|last| *last >= time) {
                return Err(InputError::line(&file, line, format!("time {time} does not come after the row before it")));
            }
            path.times.push(time);
            path.points.push(DVec3::new(x, y, z));
        }
        if path.times.is_empty() {
            return Err(InputError::file(&file, "holds no row"));
        }
        return Ok(Some(Arc::new(path)));
    }
    let Some(rows) = t.optional_rows::<4>(key)? else { return Ok(None) };
    for [time, x, y, z] in rows {
        if path.times.last().is_some_and(|last| *last >= time) {
            return Err(t.error(key, format!("time {time} does not come after the row before it")));
        }
        path.times.push(time);
        path.points.push(DVec3::new(x, y, z));
    }
    if path.times.is_empty() { Err(t.error(key, "holds no row; give [[time, x, y, z], …]")) } else { Ok(Some(Arc::new(path))) }
}
