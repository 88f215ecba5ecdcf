//! `palpate batch --merge`: one summary out of what the shards left, and the names of what is missing.

use super::summary;
use crate::cli::Console;
use crate::error::Error;
use crate::lock::{Held, NAME};
use crate::results;
use crate::results::batch::{BatchDocument, BatchRow, RowStatus, Shard, ShardSummary};
use palpate_io::InputError;
use std::path::{Path, PathBuf};

/// The names of all scenes, which every shard lists.
fn list(out: &Path, shards: &[(PathBuf, ShardSummary)]) -> Result<Vec<String>, Error> {
    let Some((first, known)) = shards.first() else {
        let message = "holds no summary of a shard (shards/K-of-N.json); palpate batch PATH --shard K/N --out OUT writes them";
        return Err(InputError::file(out, message).into());
    };
    if let Some((file, other)) = shards.iter().find(|(_, s)| s.all != known.all) {
        let place = known.all.iter().zip(&other.all).take_while(|(a, b)| a == b).count();
        let name = |all: &[String]| all.get(place).map_or("none".into(), |n| format!("\"{n}\""));
        let message = format!(
            "is of other scenes than {}: number {} is {} here and {} there; run all shards again with --resume and the same scenes, \
             or remove summaries of shards that are no longer meant",
            first.display(),
            place + 1,
            name(&other.all),
            name(&known.all)
        );
        return Err(InputError::file(file, message).into());
    }
    Ok(known.all.clone())
}

/// What a scene's folder says of it, or why it says nothing.
fn row(out: &Path, name: &str) -> BatchRow {
    let folder = out.join(name);
    let lost = |why: String| BatchRow { status: RowStatus::Lost, message: why, ..BatchRow::begun(name, Path::new("")) };
    let locked = || Held::look(&folder.join(NAME)).ok().flatten().filter(|h| !h.has_ended());
    match (summary::row(&folder), locked()) {
        (Ok(Some(row)), _) => row,
        (Ok(None), Some(held)) => lost(format!("has no result; {held} has its lock")),
        (Ok(None), None) => lost("has no result".into()),
        (Err(e), _) => lost(e.to_string()),
    }
}

/// Scenes that no shard has finished, under the shards that they belong to, in the order of these.
fn missing(rows: &[BatchRow], shards: &[(PathBuf, ShardSummary)]) -> Vec<String> {
    // Usually one; with --resume a batch can be gone on with in another number of shards.
    let mut numbers: Vec<usize> = shards.iter().map(|(_, s)| s.shard.of).collect();
    numbers.dedup();
    let mut lines: Vec<(Vec<Shard>, Vec<String>)> = Vec::new();
    for (place, row) in rows.iter().enumerate() {
        let why = match row.status {
            RowStatus::Lost => row.message.clone(),
            RowStatus::Interrupted => "was interrupted".into(),
            RowStatus::Complete | RowStatus::BadInput | RowStatus::Failed | RowStatus::Busy => continue,
        };
        let owners: Vec<Shard> = numbers.iter().map(|n| Shard::with(place, *n)).collect();
        let said = format!("{} {why}", row.name);
        match lines.iter_mut().find(|(o, _)| *o == owners) {
            Some((_, scenes)) => scenes.push(said),
            None => lines.push((owners, vec![said])),
        }
    }
    lines.sort_by_key(|(owners, _)| owners.iter().map(|s| s.number).collect::<Vec<_>>());
    let line = |(owners, scenes): (Vec<Shard>, Vec<String>)| {
        let begun = owners.iter().any(|o| shards.iter().any(|(_, s)| s.shard == *o));
        let owners: Vec<String> = owners.iter().map(Shard::to_string).collect();
        let state = if begun { "is not finished" } else { "has not begun" };
        format!("shard {} {state}: {}", owners.join(" or "), scenes.join(", "))
    };
    lines.into_iter().map(line).collect()
}

/// Merges; exit code 1 where a scene is not complete.
pub fn run(out: &Path, console: &mut Console) -> Result<i32, Error> {
    let shards = summary::of_shards(out)?;
    let rows: Vec<BatchRow> = list(out, &shards)?.iter().map(|name| row(out, name)).collect();
    // What is missing is what was asked for: --quiet does not silence it.
    let missing = missing(&rows, &shards);
    console.warn(&missing);
    if !missing.is_empty() {
        console.note("run these shards again with --resume, and merge again");
    }
    for r in rows.iter().filter(|r| matches!(r.status, RowStatus::BadInput | RowStatus::Failed)) {
        console.note(&format!("{}: {}: {}", r.name, r.status.name(), r.message));
    }
    let all = BatchDocument::of(rows);
    let place = summary::place(out, None);
    summary::write(&place, &all)?;
    if console.json() {
        console.print(&results::line(&all));
    } else {
        let file = place.with_extension("csv");
        console.print(&format!("{} of {} scenes complete: {}", all.complete, all.scenes.len(), file.display()));
    }
    Ok(i32::from(all.complete < all.scenes.len()))
}
