//! What a fit or a diagnosis leaves behind for people and programs: result files, tables, pages with pictures.

mod data;
mod diagnosis;
mod files;
mod fit;
mod html;
mod plots;
mod quantity;
mod stage;
mod tracking;

pub use data::{Compared, FRAMES, Simulated};
pub use diagnosis::{diagnosis_document, diagnosis_summary};
pub use files::{write_fit, write_report};
pub use fit::{fit_document, history_csv, number, summary, whole_document};
pub use html::{DiagnosisInput, ReportInput, diagnosis_html, fit_html, read_report};
pub use quantity::quantity;
pub use stage::pair;

use crate::render::Picture;
use crate::results::report::Chart;

pub use tracking::tracking_document;
pub(crate) use tracking::words;

pub(crate) use data::scenes as report_data;
pub(crate) use html::diagnosis_title;

/// A chart as SVG; `None` when there is nothing to draw.
pub fn chart_svg(chart: &Chart) -> Option<String> {
    chart.svg()
}

/// A chart as a picture; `None` when there is nothing to draw.
pub fn chart_picture(chart: &Chart) -> Option<Picture> {
    chart.picture()
}
