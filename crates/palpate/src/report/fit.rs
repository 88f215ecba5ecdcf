//! The numbers of a fit for its result file, as CSV and as a short table.

use crate::curves;
use crate::engine::Backend;
use crate::experiment::Experiment;
use crate::fields;
use crate::fitting::{Distances, Fitted, FreeNumber, FromTracks, total};
use crate::residuals::ResidualSummary;
use crate::results::finite;
use crate::results::fit::{
    Cost, FieldReference, FitDocument, FoundCurve, Parameter, Parts, Residual, ResidualBefore, Run, Tracked,
};
use crate::results::frames::{FrameDistances, Frames};
use palpate_diagnose::stated;
use palpate_fit::{FittedParameter, Progress};
use palpate_model::params::unit_behind;

fn residual(r: &ResidualSummary) -> Residual {
    Residual { rms: finite(r.rms), noise: finite(r.noise), points: r.points, unmatched: r.unmatched, scenes: Vec::new() }
}

/// How many independent readings the data are worth, where that is known.
pub(super) fn worth(fitted: &Fitted) -> Option<String> {
    let n = fitted.result.independent;
    n.is_finite()
        .then(|| format!("± counts the data as {n:.0} independent readings: neighbouring residuals that go together count once"))
}

fn distances(d: &Distances) -> FrameDistances {
    let length = |x: Option<f64>| x.and_then(finite);
    FrameDistances { frames: d.frames, rms: finite(d.rms), rest: length(d.rest), unmoved: length(d.unmoved) }
}

fn unmatched(fitted: &Fitted) -> usize {
    fitted.after.iter().map(|r| r.unmatched).sum()
}

fn parameter(fitted: &Fitted, i: usize) -> Parameter {
    let (number, found) = (&fitted.free[i], &fitted.result.parameters[i]);
    let headline = fitted.headline(i);
    let parts = |p: crate::fitting::Parts| Parts {
        noise: finite(p.noise),
        discretisation: p.discretisation.and_then(finite),
        systematic: finite(p.systematic),
    };
    Parameter {
        path: number.path.clone(),
        value: finite(headline.value),
        standard_error: headline.parts.and_then(|p| finite(p.total())),
        parts: headline.parts.map(parts),
        uncorrected: headline.uncorrected.and_then(finite),
        unit: found.unit.clone(),
        finer_grid_shift: fitted.grid.as_ref().and_then(|g| finite(g.numbers[i].drift)),
        known: found.known.map(|(value, sd)| [value, sd]),
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

/// What `result.json` says of a fit of these experiments, for whoever keeps fields in memory: their files have names as if they were written.
/// What was found is simulated once more where it is a curve.
pub fn whole_document(fitted: &Fitted, experiments: &[Experiment], backend: Backend) -> FitDocument {
    // What was found stands without them.
    let curves = curves::found(experiments, fitted, backend).unwrap_or_default();
    fit_document(fitted, experiments, fields::references(experiments, fitted), curves)
}

/// What `result.json` says of a fit of these experiments, whose fields lie beside it, with the curves found.
pub fn fit_document(
    fitted: &Fitted,
    experiments: &[Experiment],
    fields: Vec<FieldReference>,
    curves: Vec<FoundCurve>,
) -> FitDocument {
    let r = &fitted.result;
    let (rms, noise, points) = fitted.residual();
    let before: Option<Vec<ResidualSummary>> = fitted.before.iter().cloned().collect();
    let scenes: Vec<String> = experiments.iter().map(|e| e.scene().path.display().to_string()).collect();
    FitDocument {
        verdict: fitted.verdict.clone(),
        version: env!("CARGO_PKG_VERSION").into(),
        backend: fitted.backend.into(),
        scene: scenes.first().cloned(),
        scenes,
        optimizer: fitted.optimizer.name().into(),
        status: fitted.status(),
        error: r.broken.clone(),
        parameters: (0..fitted.free.len()).map(|i| parameter(fitted, i)).collect(),
        fields,
        curves,
        normals: fitted.normals.clone(),
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
        frames: fitted.held_out.as_ref().map(|h| Frames { train: distances(&h.train), test: distances(&h.test) }),
        residual_before: before.map(|b| ResidualBefore { rms: finite(total(&b, |r| r.rms)) }),
        best: r.best,
        runs: r.runs.iter().map(|r| run(fitted, r)).collect(),
        notes: fitted.notes.clone(),
        from_tracks: from_tracks(fitted),
        warnings: fitted.warnings.clone(),
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

/// What a number was known to be before the recording was looked at, and what that makes of it; empty where nothing was.
pub(super) fn beforehand(p: &FittedParameter) -> String {
    let Some((value, sd)) = p.known else { return String::new() };
    let unit = unit_behind(&p.unit);
    let known = format!("known to be {} ± {}{unit} beforehand", number(value), number(sd));
    match p.standard_error {
        Some(now) => format!("{known}; the recording brings it to ± {}{unit}", number(now)),
        None => known,
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

/// What is known of a found field with a prior, in sentences; none without.
pub(super) fn posterior_lines(f: &FieldReference) -> Vec<String> {
    let Some(p) = &f.posterior else { return Vec::new() };
    let text = |x: Option<f64>| x.map_or("?".into(), number);
    let whose = |key: &str| if p.chosen.iter().any(|c| c == key) { "chosen by the recording" } else { "as stated" };
    let length = p.length.map_or(String::new(), |l| format!("length {} m ({}), ", number(l), whose("length")));
    let best = format!("{length}deviation {} ({})", text(p.deviation), whose("deviation"));
    let one = p.tried.iter().find(|t| t.deviation == 0.0).and_then(|t| t.evidence);
    let one = match one {
        Some(0.0) => "; one value everywhere explains the recording best".into(),
        Some(e) => format!("; one value everywhere is e^{:.1} times less likely", -e),
        None => String::new(),
    };
    let percent = p.undetermined_share.map_or("?".into(), |s| format!("{:.0}", 100.0 * s));
    let mut out = vec![
        format!("prior of {}: {}, {best}{one}", f.path, p.prior),
        format!(
            "the recording tells about {} numbers of it; standard deviation of the logarithm {} to {}, median {}{}",
            p.effective.map_or("?".into(), |e| format!("{e:.1}")),
            text(p.sd[0]),
            text(p.sd[2]),
            text(p.sd[1]),
            p.residuals_as_one.filter(|n| *n > 1.0).map_or(String::new(), |n| format!("; {} residuals count as one", number(n)))
        ),
    ];
    out.push(match p.undetermined {
        0 => format!("the recording says something of each of the {} {}", f.count, f.basis),
        n => format!(
            "{n} of {} {} are undetermined, {percent} % of the volume: what stands there is the prior's (`undetermined` in {})",
            f.count, f.basis, f.grid
        ),
    });
    out
}

/// The parts of a number's error, and what was done to its value; empty where there is nothing to say.
fn parts(fitted: &Fitted, i: usize) -> String {
    let (h, effect) = (fitted.headline(i), fitted.grid.as_ref().map(|g| g.numbers[i]));
    let Some(parts) = h.parts else { return String::new() };
    let short = |x: f64| palpate_engine::number(format!("{x:.1e}").parse().unwrap_or(x));
    let mut all = vec![format!("noise {}", short(parts.noise))];
    all.extend(parts.discretisation.map(|d| format!("discretisation {}", short(d))));
    all.extend((parts.systematic > 0.0).then(|| format!("systematic {}", short(parts.systematic))));
    let mut text = all.join(", ");
    if let (Some(before), Some(order)) = (h.uncorrected, effect.and_then(|e| e.order)) {
        text += &format!(
            "; corrected from {} on these cells, order {order:.1}",
            stated(before, Some(parts.noise)).split(" ±").next().unwrap_or("")
        );
    }
    text
}

/// What the check of cells and step was and took; or that there was none.
pub(super) fn grid_line(fitted: &Fitted) -> String {
    match &fitted.grid {
        None => "± is what noise leaves open; what cells and time step add to it was not looked at".into(),
        Some(g) => {
            let coarser = match &g.coarser {
                None => String::new(),
                Some(Ok(())) => format!(", and one with {} twice as large", g.what),
                Some(Err(why)) => format!("; none with {} twice as large ({why})", g.what),
            };
            format!("discretisation: by an evaluation with {} half as large{coarser}, {:.1} s", g.what, g.seconds)
        }
    }
}

/// What a fit of tracked points found, and how far that is from what was found at last, in standard errors of the difference.
pub(super) fn from_tracks(fitted: &Fitted) -> Vec<Tracked> {
    let one = |(i, t): (usize, &FromTracks)| {
        let now = &fitted.result.parameters[i];
        let error = now.standard_error.zip(t.standard_error).map(|(a, b)| a.hypot(b));
        Tracked {
            path: fitted.free[i].path.clone(),
            scene: fitted.free[i].scene,
            value: finite(t.value),
            standard_error: t.standard_error.and_then(finite),
            distance: error.and_then(|e| finite((now.value - t.value).abs() / e)),
        }
    };
    fitted.tracked.iter().enumerate().map(one).collect()
}

/// The same in a line, where there is any.
pub(super) fn other_way(fitted: &Fitted) -> Option<String> {
    let all = from_tracks(fitted);
    let text = |t: &Tracked| {
        let far = t.distance.map_or(String::new(), |d| format!(", {d:.1} standard errors away"));
        format!("{} {}{far}", t.path, stated(t.value.unwrap_or(f64::NAN), t.standard_error))
    };
    (!all.is_empty()).then(|| format!("by tracked points alone: {}", all.iter().map(text).collect::<Vec<_>>().join("; ")))
}

/// Short table for the terminal.
pub fn summary(fitted: &Fitted, fields: &[FieldReference]) -> String {
    let width = fitted.free.iter().map(|n| n.label().chars().count()).max().unwrap_or(0);
    let row = |(i, (n, p)): (usize, (&FreeNumber, &FittedParameter))| {
        let (unit, h) = (unit_behind(&p.unit), fitted.headline(i));
        let unsure = if p.standard_error.is_none() { " (no standard error)" } else { "" };
        let known = if p.known.is_some() { format!(" ({})", beforehand(p)) } else { String::new() };
        let parts = if fitted.grid.is_some() { parts(fitted, i) } else { String::new() };
        let parts = if parts.is_empty() { parts } else { format!(" ({parts})") };
        format!("  {:width$}  {}{unit}{unsure}{parts}{known}\n", n.label(), stated(h.value, h.parts.map(|p| p.total())))
    };
    let mut text = format!("  {}\n", fitted.verdict);
    text.extend(fitted.free.iter().zip(&fitted.result.parameters).enumerate().map(row));
    fitted.normals.iter().for_each(|n| text += &format!("  {}\n", n.line(fitted.after.len())));
    let lines = |f: &FieldReference| [vec![field_line(f)], posterior_lines(f)].concat();
    fields.iter().flat_map(lines).for_each(|line| text += &format!("  {line}\n"));
    fitted.notes.iter().for_each(|n| text += &format!("  {n}\n"));
    text += &other_way(fitted).map_or(String::new(), |l| format!("  {l}\n"));
    let (rms, noise, points) = fitted.residual();
    let before: Option<Vec<ResidualSummary>> = fitted.before.iter().cloned().collect();
    let before = before.map_or(String::new(), |b| format!("{:.3} mm before, ", total(&b, |r| r.rms) * 1e3));
    text += &format!(
        "  residual: {before}{:.3} mm now ({:.3} mm from noise and the shape's rounding), {points} points",
        rms * 1e3,
        noise * 1e3
    );
    text += &fitted.held_out.as_ref().map_or(String::new(), |h| format!("\n  frames: {}", h.sentence()));
    text += &worth(fitted).map_or(String::new(), |w| format!("\n  {w}"));
    if fitted.result.parameters.iter().any(|p| p.standard_error.is_some()) {
        text += &format!("\n  {}", grid_line(fitted));
    }
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
