//! Measured recordings, which do not travel with the project.

use std::path::PathBuf;

/// Folder of the recordings: `PALPATE_DATA`, or `shared/data` beside the workspace. Without it a test says so and passes; under
/// continuous integration (`CI` set, however it is spelt) it fails, so that nothing is skipped unseen.
pub fn data_dir() -> Option<PathBuf> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = std::env::var_os("PALPATE_DATA").map_or(beside, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    let text = format!("{} is no folder; set PALPATE_DATA to the recordings", folder.display());
    let integration = std::env::var("CI").unwrap_or_default();
    assert!(matches!(integration.as_str(), "" | "0" | "false"), "{text}");
    println!("skipped: no data ({text})");
    None
}
