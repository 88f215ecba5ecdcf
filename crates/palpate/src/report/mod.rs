//! What a fit or a diagnosis leaves behind for people and programs: result files, tables, pages with pictures.

mod diagnosis;
mod fit;
mod html;
mod pictures;
mod plots;

pub use diagnosis::{diagnosis_document, diagnosis_summary};
pub use fit::{fit_document, history_csv, number, summary};
pub use html::{DiagnosisInput, ReportInput, diagnosis_html, fit_html};
pub use pictures::{FramePicture, pictures};
