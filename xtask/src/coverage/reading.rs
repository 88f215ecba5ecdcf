//! What a fit says, as rows: the only place that reads its answer.

use super::bodies::Truth;
use super::fits::Trial;
use super::report::Row;
use crate::real::report::Made;
use palpate::{Error, Fitted};

/// A row for every free number of a trial; of a fit that failed one without values.
pub fn rows(made: &Made, truth: &Truth, t: &Trial, outcome: Result<&Fitted, &Error>, seconds: f64) -> Vec<Row> {
    let row = |k: usize| {
        let free = &t.free[k];
        let mut row = Row {
            made: made.clone(),
            case: t.name.clone(),
            body: truth.kind.into(),
            seed: t.seed,
            set: t.set.into(),
            sensors: sensors(t),
            noise: t.setup.noise,
            parameter: free.path.into(),
            truth: free.truth,
            value: None,
            uncorrected: None,
            standard_error: None,
            parts: None,
            verdict: "failed".into(),
            seconds: (100.0 * seconds).round() / 100.0,
        };
        match outcome {
            Err(e) => row.verdict = format!("failed: {e}"),
            Ok(fitted) => {
                let said = fitted.free.iter().position(|f| f.path == free.path).map(|i| fitted.headline(i));
                row.value = said.map(|h| h.value);
                row.uncorrected = said.and_then(|h| h.uncorrected);
                let parts = said.and_then(|h| h.parts);
                row.standard_error = parts.map(|p| p.total());
                row.parts = parts.map(|p| [p.noise, p.discretisation.unwrap_or(0.0), p.systematic]);
                row.verdict = fitted.verdict.word.name().into();
            }
        }
        row
    };
    (0..t.free.len()).map(row).collect()
}

fn sensors(t: &Trial) -> String {
    match (t.setup.cameras.len(), t.setup.markers.is_empty()) {
        (0, _) => "markers".into(),
        (n, true) => format!("{n} camera{}", if n == 1 { "" } else { "s" }),
        (n, false) => format!("{n} camera{} and markers", if n == 1 { "" } else { "s" }),
    }
}
