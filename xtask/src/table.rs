//! Tables for people and JSON for later comparison.

use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Prints rows with columns as wide as their widest cell; the first row is the heading.
pub fn print(title: &str, rows: &[Vec<String>]) {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| rows.iter().filter_map(|r| r.get(c)).map(|s| s.chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    println!("\n{title}");
    for (i, row) in rows.iter().enumerate() {
        let line: Vec<String> = row.iter().zip(&widths).map(|(s, w)| format!("{s:>w$}")).collect();
        println!("  {}", line.join("  "));
        if i == 0 {
            println!("  {}", widths.iter().map(|w| "-".repeat(*w)).collect::<Vec<_>>().join("  "));
        }
    }
}

/// Day of a time as the number of seconds since 1970 says it, `YYYY-MM-DD` in UTC.
pub fn today() -> String {
    let seconds = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(0, |d| d.as_secs());
    date(seconds / 86400)
}

/// Civil date of a day counted from 1970-01-01 (Hinnant, chrono-compatible low-level date algorithms, 2013).
fn date(day: u64) -> String {
    let z = day + 719_468;
    let (era, doe) = (z / 146_097, z % 146_097);
    let yoe = (doe - doe / 1460 + doe / 36_524 - doe / 146_096) / 365;
    let doy = doe - (365 * yoe + yoe / 4 - yoe / 100);
    let mp = (5 * doy + 2) / 153;
    let month = if mp < 10 { mp + 3 } else { mp - 9 };
    let year = yoe + era * 400 + u64::from(month <= 2);
    format!("{year:04}-{month:02}-{:02}", doy - (153 * mp + 2) / 5 + 1)
}

/// Writes a value as JSON to `bench/NAME.json` under the workspace and returns the path.
///
/// # Errors
/// The file cannot be written.
pub fn save(name: &str, value: &impl Serialize) -> Result<PathBuf, String> {
    let path = root().join("bench").join(format!("{name}.json"));
    let text = serde_json::to_string_pretty(value).map_err(|e| e.to_string())?;
    let fail = |e: std::io::Error| format!("{}: {e}", path.display());
    std::fs::create_dir_all(root().join("bench")).map_err(fail)?;
    std::fs::write(&path, text + "\n").map_err(fail)?;
    Ok(path)
}

/// What `bench/NAME.json` holds; nothing where there is no file.
///
/// # Errors
/// The file is there and holds something else.
pub fn stored<T: DeserializeOwned + Default>(root: &Path, name: &str) -> Result<T, String> {
    let path = root.join("bench").join(format!("{name}.json"));
    let Ok(text) = std::fs::read_to_string(&path) else { return Ok(T::default()) };
    serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))
}

/// The line that stands before and after a generated table.
pub fn mark(name: &str) -> String {
    format!("<!-- {name} table -->\n")
}

/// Puts a generated table between the two marks of a page.
///
/// # Errors
/// The page cannot be read or written, or has no two marks.
pub fn replace(page: &str, name: &str, text: &str) -> Result<(), String> {
    let path = root().join(page);
    let fail = |e: std::io::Error| format!("{}: {e}", path.display());
    let old = std::fs::read_to_string(&path).map_err(fail)?;
    let mark = mark(name);
    let parts: Vec<&str> = old.split(&mark).collect();
    let [before, _, after] = parts[..] else {
        return Err(format!("{}: there must be two lines {}", path.display(), mark.trim()));
    };
    std::fs::write(&path, format!("{before}{mark}{text}{mark}{after}")).map_err(fail)
}

/// Stores what a table is made of as `bench/NAME.json`, says where, and puts the table into its page.
///
/// # Errors
/// As of [`save`] and [`replace`].
pub fn publish(page: &str, name: &str, value: &impl Serialize, text: &str) -> Result<(), String> {
    println!("written to {}", save(name, value)?.display());
    replace(page, name, text)
}

/// Root of the workspace.
pub fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here).to_path_buf()
}

/// What git says in the workspace.
///
/// # Errors
/// It does not answer, or refuses.
pub fn git(arguments: &[&str]) -> Result<String, String> {
    let out = Command::new("git").current_dir(root()).args(arguments).output().map_err(|e| format!("git: {e}"))?;
    let text = String::from_utf8_lossy(if out.status.success() { &out.stdout } else { &out.stderr }).trim().to_string();
    if out.status.success() { Ok(text) } else { Err(format!("git {}: {text}", arguments.join(" "))) }
}

#[cfg(test)]
mod tests {
    #[test]
    fn days_have_their_dates() {
        for (day, text) in [(0, "1970-01-01"), (11_016, "2000-02-29"), (11_017, "2000-03-01"), (20_454, "2026-01-01")] {
            assert_eq!(super::date(day), text);
        }
    }
}
