//! What a fit leaves behind: `result.json`, `history.csv`, `model.toml`, `report.html`.

mod diagnosis;
mod html;
mod pictures;
mod plots;
mod result;

pub use diagnosis::{DiagnosisInput, diagnosis_html, diagnosis_json, diagnosis_summary};
pub use html::{ReportInput, html};
pub use pictures::{FramePicture, pictures};
pub use result::{history_csv, number, result_json, summary};
