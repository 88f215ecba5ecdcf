//! Both beams fitted with materials and schemes: the scene with two keys changed.

use super::report::Row;
use super::studies::{BEAMS, row};
use super::{fit, open};
use palpate::Error;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Materials, by their names in a scene.
const MATERIALS: [&str; 2] = ["corotated-linear", "neo-hookean"];
/// Schemes: how they are called in the table, and the keys of a scene's `[time]`.
const SCHEMES: [(&str, &str); 2] = [("θ = ½", "scheme = \"theta\"\ntheta = 0.5"), ("TR-BDF2", "scheme = \"tr-bdf2\"")];

/// A fit of one beam.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Variant {
    /// Name of the recording.
    pub recording: String,
    /// Name of the material.
    pub material: String,
    /// Name of the scheme.
    pub scheme: String,
    /// How the search ended, or why there is none.
    pub ending: String,
    /// What it found; nothing where it failed.
    pub found: Option<Row>,
}

/// Fits them all. A fit that fails is a row that says so.
///
/// # Errors
/// A scene or its recording cannot be read, or what was fitted cannot be simulated again.
pub fn measure(data: &Path) -> Result<Vec<Variant>, Error> {
    let mut all = Vec::new();
    for beam in &BEAMS {
        for material in MATERIALS {
            for (scheme, keys) in SCHEMES {
                let changes = [("\"corotated-linear\"", &*format!("\"{material}\"")), ("theta    = 0.5", keys)];
                let experiment = open(data, beam.scene, &changes)?;
                let (ending, found) = match fit(&experiment) {
                    Ok(f) => {
                        let run = &f.result.runs[f.result.best];
                        let ending = format!("{}, {} iterations", run.status.name(), run.iterations);
                        (ending, Some(row(beam.name, beam, &experiment, &f, 0)?))
                    }
                    Err(e) => (e.to_string(), None),
                };
                let (material, scheme) = (material.to_string(), scheme.to_string());
                let made = Variant { recording: beam.name.into(), material, scheme, ending, found };
                println!("{}", line(&made));
                all.push(made);
            }
        }
    }
    Ok(all)
}

fn line(v: &Variant) -> String {
    let mut cells = vec![v.recording.clone(), v.material.clone(), v.scheme.clone()];
    match &v.found {
        None => cells.extend(std::iter::repeat_n("–".to_string(), 5)),
        Some(r) => {
            let error = r.standard_error.map_or(String::new(), |e| format!(" ± {:.1}", 1e-3 * e));
            cells.push(format!("{:.1}{error} kPa", 1e-3 * r.youngs_modulus));
            let swing = [
                r.damping_ratio.map(|p| p.text(1.0, 4)),
                r.frequency.map(|p| p.compared(1.0, 3, " Hz")),
                r.sag.map(|p| p.compared(1e3, 2, " mm")),
            ];
            cells.extend(swing.map(|s| s.unwrap_or_else(|| "–".into())));
            cells.push(format!("{:.3} ({:.3}) mm", 1e3 * r.rms, 1e3 * r.noise));
        }
    }
    cells.push(v.ending.clone());
    format!("| {} |", cells.join(" | "))
}

/// The table as docs/real-data.md has it.
pub fn markdown(all: &[Variant]) -> String {
    let head = "| recording | material | scheme | E ± standard error | damping ratio | frequency | sag in the swing | residual, rms (noise) | search |";
    let rule = format!("|{}", "---|".repeat(9));
    let rows = all.iter().map(line);
    [head.to_string(), rule].into_iter().chain(rows).map(|l| l + "\n").collect()
}
