//! The files of a fit in its folder.

use super::data::{Compared, Simulated, curve, scenes, searches};
use super::html::fit_title;
use super::{ReportInput, fit_document, fit_html, history_csv};
use crate::curves;
use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fields::{files_of, write_fields};
use crate::fitting::Fitted;
use crate::residuals::ResidualSummary;
use crate::results;
use crate::results::fit::FitDocument;
use palpate_engine::Stop;
use palpate_io::output::{make_folder, write_file};
use std::path::Path;

/// Writes `result.json`, `history.csv`, the scenes with what was found and the files of fields into a folder; returns the first.
///
/// # Errors
/// A file cannot be written.
pub fn write_fit(folder: &Path, experiments: &[Experiment], fitted: &Fitted, backend: Backend) -> Result<FitDocument, Error> {
    make_folder(folder)?;
    let text = |name: &str, content: &str| write_file(folder.join(name), |w| w.write_all(content.as_bytes()));
    let found = write_fields(folder, experiments, fitted)?;
    // What was found stands without them.
    let curves = curves::found(experiments, fitted, backend).unwrap_or_default();
    let result = fit_document(fitted, experiments, found, curves);
    results::write(folder.join("result.json"), &result)?;
    text("history.csv", &history_csv(fitted))?;
    for (s, e) in experiments.iter().enumerate() {
        let mut values = fitted.values_of(s, e);
        // What was chosen for this fit is what its values belong to.
        values.extend(e.chosen().iter().map(|(key, value, _)| (key.to_string(), *value)));
        let model = palpate_io::write_scene(e.text(), e.scene(), &values, folder)?;
        let model = palpate_io::name_field_files(&model, e.scene(), &files_of(&result.fields, s, e))?;
        let name = if experiments.len() == 1 { "model.toml".to_string() } else { format!("model-{}.toml", s + 1) };
        text(&name, &model)?;
    }
    Ok(result)
}

/// Writes `report.html` beside them, with at most `pictures` frames of a scene in space (0: no motion is simulated
/// for it); `command` is said to give the same result.
///
/// # Errors
/// The file cannot be written, or what was found cannot be simulated.
pub fn write_report(
    folder: &Path,
    experiments: &[Experiment],
    fitted: &Fitted,
    result: &FitDocument,
    backend: Backend,
    pictures: usize,
    command: String,
) -> Result<(), Error> {
    let frames = |r: &ResidualSummary| r.frames.iter().map(|f| f.rms).collect();
    let mut compared = Vec::new();
    for (s, experiment) in experiments.iter().enumerate() {
        let theta = [&fitted.theta_start[s], &fitted.result.theta[s]];
        let [before, after] = theta.map(|theta| (pictures > 0).then_some(Simulated { experiment, theta }));
        let noise = fitted.after[s].noise;
        let rms = [fitted.before[s].as_ref().map_or(Vec::new(), frames), frames(&fitted.after[s])];
        compared.push(Compared { before, after, experiment, noise, rms, measure: 1 });
    }
    let mut data = scenes(&fit_title(experiments), ["start values", "fitted"], &compared, backend, pictures, &Stop::default())?;
    data.charts.extend(searches(fitted));
    data.charts.extend(result.curves.iter().enumerate().map(|(k, c)| curve(k, c)));
    let (fields, curves) = (&result.fields[..], &result.curves[..]);
    let page = fit_html(&ReportInput { fitted, experiments, fields, curves, data, command });
    Ok(write_file(folder.join("report.html"), |w| w.write_all(page.as_bytes()))?)
}
