//! What a fit or a diagnosis leaves behind for people and programs: result files, tables, pages with pictures.

mod diagnosis;
mod files;
mod fit;
mod html;
mod pictures;
mod plots;
mod tracking;

pub use diagnosis::{diagnosis_document, diagnosis_summary};
pub use files::{write_fit, write_report};
pub use fit::{fit_document, history_csv, number, summary, whole_document};
pub use html::{DiagnosisInput, ReportInput, diagnosis_html, fit_html};
pub use pictures::{FramePicture, pictures};
pub use tracking::tracking_document;
