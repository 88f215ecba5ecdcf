//! The files of a fit in its folder.

use super::{FramePicture, ReportInput, fit_document, fit_html, history_csv, pictures};
use crate::curves;
use crate::engine::Backend;
use crate::error::Error;
use crate::experiment::Experiment;
use crate::fields::{files_of, write_fields};
use crate::fitting::Fitted;
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

/// Pictures of one scene before and after; a start that cannot be simulated has none.
type Pair = (Vec<FramePicture>, Vec<FramePicture>);

fn scene_pictures(e: &Experiment, fitted: &Fitted, s: usize, backend: Backend, count: usize, scale: f64) -> Result<Pair, Error> {
    let theta = &fitted.theta_start[s];
    let stop = Stop::default();
    let before = pictures(e, backend, theta, count, scale, &stop).unwrap_or_default();
    Ok((before, pictures(e, backend, &fitted.result.theta[s], count, scale, &stop)?))
}

/// Writes `report.html` beside them, with so many pictures a scene; `command` is said to give the same result.
///
/// # Errors
/// The file cannot be written, or a picture not simulated.
pub fn write_report(
    folder: &Path,
    experiments: &[Experiment],
    fitted: &Fitted,
    result: &FitDocument,
    backend: Backend,
    pictures: usize,
    command: String,
) -> Result<(), Error> {
    let (rms, noise, _) = fitted.residual();
    let scale = if rms.is_finite() { 2.0 * rms.max(noise) } else { noise.max(1e-3) };
    let pictures = experiments.iter().enumerate().map(|(s, e)| match pictures {
        0 => Ok((Vec::new(), Vec::new())),
        n => scene_pictures(e, fitted, s, backend, n, scale),
    });
    let pictures = pictures.collect::<Result<Vec<_>, _>>()?;
    let (fields, curves) = (&result.fields[..], &result.curves[..]);
    let page = fit_html(&ReportInput { fitted, experiments, fields, curves, pictures, scale, command });
    Ok(write_file(folder.join("report.html"), |w| w.write_all(page.as_bytes()))?)
}
