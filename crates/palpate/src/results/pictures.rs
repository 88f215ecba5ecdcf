//! What `palpate pictures --json` prints.

use super::Document;
use serde::{Deserialize, Serialize};

/// Pictures that were drawn of a report (`pictures/1`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PicturesDocument {
    /// The report.
    pub report: String,
    /// The folder.
    pub out: String,
    /// The files in it, in the order in which they were written.
    pub files: Vec<String>,
}

impl Document for PicturesDocument {
    const FORMAT: &'static str = "pictures/1";
}

#[cfg(test)]
mod tests {
    use super::super::tests::round_trip;
    use super::*;

    #[test]
    fn drawn_pictures_are_what_they_were_when_they_are_read_again() {
        let drawn =
            PicturesDocument { report: "a/report.html".into(), out: "a/pictures".into(), files: vec!["space-0.gif".into()] };
        assert_eq!(round_trip(&drawn)["files"][0], "space-0.gif");
    }
}
