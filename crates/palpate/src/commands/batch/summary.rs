//! Summaries of a batch, of one of its shards, and of one scene: where they lie, and how they are written.

use crate::error::Error;
use crate::results;
use crate::results::batch::{BatchDocument, BatchRow, Shard, ShardSummary};
use palpate_io::InputError;
use palpate_io::output::write_file;
use std::path::{Path, PathBuf};

/// Folder with the summaries of shards.
const SHARDS: &str = "shards";

/// File in a scene's folder with its row of the summary.
const ROW: &str = "row.json";

/// Where a summary lies, without `.json` or `.csv`: the batch's in `summary`, that of a shard in `shards/2-of-3`, which no other writes.
pub fn place(out: &Path, shard: Option<Shard>) -> PathBuf {
    shard.map_or_else(|| out.join("summary"), |s| out.join(SHARDS).join(format!("{}-of-{}", s.number, s.of)))
}

/// Writes a summary in both forms.
pub fn write(place: &Path, summary: &BatchDocument) -> Result<(), Error> {
    results::write(place.with_extension("json"), summary)?;
    Ok(write_file(place.with_extension("csv"), |w| w.write_all(table(summary).as_bytes()))?)
}

/// The summaries of shards in an output folder, in the order of their shards; none where there is no such folder.
pub fn of_shards(out: &Path) -> Result<Vec<(PathBuf, ShardSummary)>, Error> {
    let folder = out.join(SHARDS);
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let unreadable = |e: std::io::Error| InputError::file(&folder, format!("cannot be read: {e}"));
    let files = std::fs::read_dir(&folder).map_err(unreadable)?.filter_map(|f| Some(f.ok()?.path()));
    let mut found = Vec::new();
    // Hidden ones are being written.
    let hidden = |f: &Path| f.file_name().is_some_and(|n| n.to_string_lossy().starts_with('.'));
    for file in files.filter(|f| f.extension().is_some_and(|e| e == "json") && !hidden(f)) {
        let summary = results::read::<BatchDocument>(&file)?;
        let part = summary.shard.ok_or_else(|| InputError::file(&file, "is no summary of a shard"))?;
        found.push((file, part));
    }
    found.sort_by_key(|(_, s)| (s.shard.of, s.shard.number));
    Ok(found)
}

/// The row that a scene's folder holds; `None` where none was written.
pub fn row(folder: &Path) -> Result<Option<BatchRow>, InputError> {
    let path = folder.join(ROW);
    if path.exists() { results::read(path).map(Some) } else { Ok(None) }
}

/// Writes it.
pub fn write_row(folder: &Path, row: &BatchRow) -> Result<(), Error> {
    results::write(folder.join(ROW), row)
}

/// Removes it, where there is one: the scene is fitted anew.
pub fn remove_row(folder: &Path) -> Result<(), Error> {
    let path = folder.join(ROW);
    match std::fs::remove_file(&path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::write(&path, e)),
        _ => Ok(()),
    }
}

/// `summary.csv`: one row a scene, two columns a parameter (value and standard error), over the parameters of all scenes.
fn table(summary: &BatchDocument) -> String {
    let number = |v: Option<f64>| v.map_or(String::new(), |v| format!("{v:?}"));
    let parameters = |r: &BatchRow| r.parameters.clone().unwrap_or_default();
    let mut paths: Vec<String> = Vec::new();
    for p in summary.scenes.iter().flat_map(parameters) {
        if !paths.contains(&p.path) {
            paths.push(p.path);
        }
    }
    let mut csv = csv::Writer::from_writer(Vec::new());
    let mut head =
        ["name", "scene", "status", "seconds", "backend", "cost", "rms", "noise", "points"].map(str::to_string).to_vec();
    head.extend(paths.iter().flat_map(|p| [p.clone(), format!("{p} standard error")]));
    head.push("message".into());
    csv.write_record(&head).expect("writing to memory cannot fail");
    for r in &summary.scenes {
        let residual = r.residual.as_ref();
        let mut row = vec![r.name.clone(), r.scene.clone(), r.status.name().into(), number(Some(r.seconds))];
        row.extend([r.backend.clone().unwrap_or_default(), number(r.cost)]);
        row.extend([number(residual.and_then(|r| r.rms)), number(residual.and_then(|r| r.noise))]);
        row.push(residual.map_or(String::new(), |r| r.points.to_string()));
        for path in &paths {
            let found = parameters(r).into_iter().find(|p| p.path == *path).unwrap_or_default();
            row.extend([number(found.value), number(found.standard_error)]);
        }
        row.push(r.message.clone());
        csv.write_record(&row).expect("writing to memory cannot fail");
    }
    String::from_utf8(csv.into_inner().expect("writing to memory cannot fail")).expect("names and numbers are UTF-8")
}
