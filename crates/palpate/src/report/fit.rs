//! The numbers of a fit for its result file, as CSV and as a short table.

use crate::experiment::Experiment;
use crate::fitting::{Fitted, FreeNumber, total};
use crate::residuals::ResidualSummary;
use crate::results::finite;
use crate::results::fit::{Cost, FieldReference, FitDocument, Parameter, Residual, ResidualBefore, Run};
use palpate_diagnose::stated;
use palpate_fit::{FittedParameter, Progress};
use palpate_model::params::unit_behind;

fn residual(r: &ResidualSummary) -> Residual {
    Residual { rms: finite(r.rms), noise: finite(r.noise), points: r.points, unmatched: r.unmatched, scenes: Vec::new() }
}

/// A plain word where the result rests on the smaller part of what was observed; `None` where it does not.
fn mostly_unmatched(fitted: &Fitted) -> Option<String> {
    let points = fitted.residual().2;
    let unmatched = unmatched(fitted);
    (unmatched > points).then(|| {
        format!(
            "not to be trusted: {unmatched} of {} observed points meet no part of the simulated body even at the best fit; the values \
             rest on the other {points}",
            points + unmatched
        )
    })
}

/// How many independent readings the data are worth, where that is known.
pub(super) fn worth(fitted: &Fitted) -> Option<String> {
    let n = fitted.result.independent;
    n.is_finite()
        .then(|| format!("± counts the data as {n:.0} independent readings: neighbouring residuals that go together count once"))
}

fn unmatched(fitted: &Fitted) -> usize {
    fitted.after.iter().map(|r| r.unmatched).sum()
}

fn parameter(fitted: &Fitted, i: usize) -> Parameter {
    let (number, found) = (&fitted.free[i], &fitted.result.parameters[i]);
    Parameter {
        path: number.path.clone(),
        value: finite(found.value),
        standard_error: found.standard_error.and_then(finite),
        unit: found.unit.clone(),
        finer_grid_shift: fitted.grid_shift.as_ref().and_then(|s| finite(s[i])),
        scene: number.scene,
        at_bound: found.at_bound,
    }
}

fn run(fitted: &Fitted, run: &palpate_fit::Run) -> Run {
    let named = || fitted.free.iter().zip(&fitted.result.parameters);
    let labelled = |values: &[f64]| named().filter_map(|(n, p)| Some((n.label(), finite(*values.get(p.index)?)))).collect();
    Run {
        start: labelled(&run.start),
        end: labelled(&run.end),
        start_cost: finite(run.start_cost),
        cost: finite(run.cost),
        iterations: run.iterations,
        evaluations: run.evaluations,
        products: run.products,
        status: run.status.name().into(),
    }
}

/// What `result.json` says of a fit of these experiments, whose fields lie beside it.
pub fn fit_document(fitted: &Fitted, experiments: &[Experiment], fields: Vec<FieldReference>) -> FitDocument {
    let r = &fitted.result;
    let (rms, noise, points) = fitted.residual();
    let before: Option<Vec<ResidualSummary>> = fitted.before.iter().cloned().collect();
    let scenes: Vec<String> = experiments.iter().map(|e| e.scene().path.display().to_string()).collect();
    FitDocument {
        version: env!("CARGO_PKG_VERSION").into(),
        backend: fitted.backend.into(),
        scene: scenes.first().cloned(),
        scenes,
        optimizer: fitted.optimizer.name().into(),
        status: fitted.status(),
        error: r.broken.clone(),
        parameters: (0..fitted.free.len()).map(|i| parameter(fitted, i)).collect(),
        fields,
        correlation: r.correlation.iter().map(|row| row.iter().map(|c| finite(*c)).collect()).collect(),
        cost: Cost { initial: finite(r.initial_cost), last: finite(r.cost) },
        reduced_chi_square: finite(r.reduced_chi_square),
        independent_readings: finite(r.independent),
        residual: Residual {
            rms: finite(rms),
            noise: finite(noise),
            points,
            unmatched: unmatched(fitted),
            scenes: fitted.after.iter().map(residual).collect(),
        },
        residual_before: before.map(|b| ResidualBefore { rms: finite(total(&b, |r| r.rms)) }),
        best: r.best,
        runs: r.runs.iter().map(|r| run(fitted, r)).collect(),
        warnings: mostly_unmatched(fitted).into_iter().chain(fitted.warnings.iter().cloned()).collect(),
        evaluations: r.evaluations,
        seconds: r.seconds,
    }
}

/// One row per run and iteration: `run,iteration,cost,<one column per number>`; full precision. Fields are left out.
pub fn history_csv(fitted: &Fitted) -> String {
    let mut csv = csv::Writer::from_writer(Vec::new());
    let mut rows = vec![["run", "iteration", "cost"].map(str::to_string).to_vec()];
    rows[0].extend(fitted.free.iter().map(|n| n.label()));
    let row = |p: &Progress| {
        let mut row = vec![p.start.to_string(), p.iteration.to_string(), format!("{:?}", p.cost)];
        row.extend(fitted.result.parameters.iter().map(|found| format!("{:?}", p.values[found.index])));
        row
    };
    rows.extend(fitted.history.iter().map(row));
    for r in rows {
        csv.write_record(&r).expect("writing to memory cannot fail");
    }
    String::from_utf8(csv.into_inner().expect("writing to memory cannot fail")).expect("numbers and paths are UTF-8")
}

/// A number with as many digits as people read: four, without exponent where that is short.
pub fn number(x: f64) -> String {
    if x == 0.0 || (1e-3..1e5).contains(&x.abs()) {
        let digits = if x == 0.0 { 0 } else { (3 - x.abs().log10().floor() as i32).max(0) as usize };
        format!("{x:.digits$}")
    } else {
        format!("{x:.3e}")
    }
}

/// A found field in a line.
pub(super) fn field_line(f: &FieldReference) -> String {
    let text = |x: Option<f64>| x.map_or("?".into(), number);
    format!(
        "{} of {}, {} {}: factors {} to {}, median {}; {}, {}",
        f.path,
        f.varies,
        f.count,
        f.basis,
        text(f.min),
        text(f.max),
        text(f.median),
        f.file,
        f.grid
    )
}

/// Short table for the terminal.
pub fn summary(fitted: &Fitted, fields: &[FieldReference]) -> String {
    let width = fitted.free.iter().map(|n| n.label().chars().count()).max().unwrap_or(0);
    let row = |(i, (n, p)): (usize, (&FreeNumber, &FittedParameter))| {
        let unit = unit_behind(&p.unit);
        let unsure = if p.standard_error.is_none() { " (no standard error)" } else { "" };
        let shift = fitted.grid_shift.as_ref().map(|s| 100.0 * s[i] / p.value.abs());
        let shift = shift.map_or(String::new(), |s| format!("; cells and step half as large: {s:+.1} %"));
        format!("  {:width$}  {}{unit}{unsure}{shift}\n", n.label(), stated(p.value, p.standard_error))
    };
    let mut text: String = fitted.free.iter().zip(&fitted.result.parameters).enumerate().map(row).collect();
    fields.iter().for_each(|f| text += &format!("  {}\n", field_line(f)));
    text += &fitted.chosen.as_ref().map_or(String::new(), |c| format!("  {c}\n"));
    let (rms, noise, points) = fitted.residual();
    let before: Option<Vec<ResidualSummary>> = fitted.before.iter().cloned().collect();
    let before = before.map_or(String::new(), |b| format!("{:.3} mm before, ", total(&b, |r| r.rms) * 1e3));
    text += &format!(
        "  residual: {before}{:.3} mm now ({:.3} mm from noise and the shape's rounding), {points} points",
        rms * 1e3,
        noise * 1e3
    );
    text += &worth(fitted).map_or(String::new(), |w| format!("\n  {w}"));
    if fitted.grid_shift.is_none() && fitted.result.parameters.iter().any(|p| p.standard_error.is_some()) {
        text += "\n  ± is what noise leaves open; what cells and time step add to it, --grid-check finds out";
    }
    text += &mostly_unmatched(fitted).map_or(String::new(), |w| format!("\n  {w}"));
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_digits() {
        for (x, text) in
            [(0.45, "0.4500"), (-9.81, "-9.810"), (12345.6, "12346"), (1.2e5, "1.200e5"), (0.0, "0"), (3.2e-7, "3.200e-7")]
        {
            assert_eq!(number(x), text);
        }
    }
}
