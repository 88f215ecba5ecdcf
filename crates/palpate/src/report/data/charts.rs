//! Charts of residuals, of searches and of curves of stiffness.

use super::motion::Motion;
use crate::experiment::Experiment;
use crate::fitting::Fitted;
use crate::report::quantity::{millimetres, name, quantity, unit_for};
use crate::results::fit::FoundCurve;
use crate::results::report::{Chart, Role, SceneData, Series, Style, Topic};
use glam::DVec3;

/// Stretches of a body's axis whose readings are taken together.
const STRETCHES: usize = 40;
/// Most searches that have a label of their own.
const LABELLED: usize = 6;
/// Most numbers whose way is shown.
const NUMBERS: usize = 6;

/// Both motions' way of being drawn.
const ROLES: [(Role, Style); 2] = [(Role::Before, Style::Dashed), (Role::After, Style::Line)];

/// The residual over time; of a single frame, along the body.
pub fn residuals(e: &Experiment, scene: &SceneData, motions: [Option<&Motion>; 2], names: [&str; 2]) -> Option<Chart> {
    if scene.times.len() == 1 { along(e, scene, motions, names) } else { over_time(scene, names) }
}

fn over_time(scene: &SceneData, names: [&str; 2]) -> Option<Chart> {
    let mut series = Vec::new();
    let ends = [*scene.times.first()?, *scene.times.last()?];
    if scene.noise.is_finite() {
        series.push(Series::new("noise alone", Role::Noise, Style::Dashed, ends.map(|t| (t, scene.noise * 1e3))));
    }
    let mut told = Vec::new();
    for (m, (role, style)) in ROLES.into_iter().enumerate() {
        let all: Vec<(f64, f64)> = scene.times.iter().zip(&scene.rms[m]).filter_map(|(t, r)| Some((*t, (*r)? * 1e3))).collect();
        let largest = all.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1));
        told.extend(largest.map(|(t, r)| format!("{} at most {r:.3} mm, at {t:.4} s", names[m])));
        if !all.is_empty() {
            series.push(Series::new(names[m], role, style, all));
        }
    }
    (!told.is_empty()).then(|| Chart {
        key: "residual".into(),
        topic: Topic::Residual,
        title: "Distance between measurement and model, frame by frame".into(),
        words: format!(
            "Root mean square distance over time: {}. Noise alone would leave {}.",
            told.join("; "),
            millimetres(scene.noise)
        ),
        x: "time [s]".into(),
        y: "rms distance [mm]".into(),
        main: true,
        series,
        ..Chart::default()
    })
}

/// Residuals of a single frame against the place along the longest axis of the body.
fn along(e: &Experiment, scene: &SceneData, motions: [Option<&Motion>; 2], names: [&str; 2]) -> Option<Chart> {
    let (lo, hi) = e.shape().bounds();
    let size = (hi - lo).to_array();
    let axis = (0..3).max_by(|a, b| size[*a].total_cmp(&size[*b]).then(b.cmp(a)))?;
    let signed = motions[1]?.signed;
    let mut series = Vec::new();
    let mut told = Vec::new();
    for (m, (role, style)) in ROLES.into_iter().enumerate() {
        let all = motions[m].map(|m| &m.along[..]).unwrap_or_default();
        let points = |all: &[(DVec3, f64)]| all.iter().map(|p| (p.0[axis] * 1e3, p.1 * 1e3)).collect::<Vec<_>>();
        if all.len() > 3 * STRETCHES {
            series.push(Series::new(names[m], role, style, means(&points(all))));
        } else if !all.is_empty() {
            // A line would be taken for a course between readings.
            series.push(Series::new(names[m], role, Style::Dots, points(all)));
        }
        let rms = scene.rms[m].first().copied().flatten();
        told.extend(rms.map(|r| format!("{} {}", names[m], millimetres(r))));
    }
    let range = motions[1]?
        .along
        .iter()
        .map(|p| p.0[axis] * 1e3)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    if series.is_empty() || range.0 > range.1 {
        return None;
    }
    if scene.noise.is_finite() {
        for sign in if signed { vec![1.0, -1.0] } else { vec![1.0] } {
            let label = if sign > 0.0 { "noise alone" } else { "" };
            series.insert(
                0,
                Series::new(label, Role::Noise, Style::Dashed, [range.0, range.1].map(|x| (x, sign * scene.noise * 1e3))),
            );
        }
    }
    let coordinate = ["x", "y", "z"][axis];
    let (what, y) = match signed {
        true => ("Mean signed distance of depth points along the body, positive outside it", "mean distance [mm]"),
        false => ("Distance of every reading along the body", "distance [mm]"),
    };
    Some(Chart {
        key: "residual".into(),
        topic: Topic::Residual,
        title: what.into(),
        words: format!(
            "{what}, along {coordinate}. Root mean square: {}. Noise alone would leave {}.",
            told.join(", "),
            millimetres(scene.noise)
        ),
        x: format!("{coordinate} [mm]"),
        y: y.into(),
        main: true,
        series,
        ..Chart::default()
    })
}

/// Means of y over equal stretches of x.
fn means(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let (lo, hi) = points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(p.0), b.max(p.0)));
    let width = ((hi - lo) / STRETCHES as f64).max(1e-12);
    let mut sums = [(0.0, 0.0); STRETCHES];
    for (x, y) in points {
        let k = (((x - lo) / width) as usize).min(STRETCHES - 1);
        sums[k] = (sums[k].0 + y, sums[k].1 + 1.0);
    }
    // Fewer than three points say nothing of a mean.
    let mean = |(k, (sum, n)): (usize, &(f64, f64))| (*n >= 3.0).then(|| (lo + (k as f64 + 0.5) * width, sum / n));
    sums.iter().enumerate().filter_map(mean).collect()
}

/// Cost and numbers of every search by iteration.
pub fn searches(fitted: &Fitted) -> Vec<Chart> {
    let r = &fitted.result;
    let mut order: Vec<usize> = (0..r.runs.len()).filter(|k| *k != r.best).collect();
    // The best is drawn last, over all others.
    order.push(r.best);
    let label = |k: usize| match k {
        k if k == r.best => format!("start {} (best)", k + 1),
        k if r.runs.len() <= LABELLED => format!("start {}", k + 1),
        k if k == order[0] => "other starts".into(),
        _ => String::new(),
    };
    let series = |value: &dyn Fn(&palpate_fit::Progress) -> f64| -> Vec<Series> {
        let one = |k: &usize| {
            let mine = fitted.history.iter().filter(|h| h.start == *k).map(|h| (h.iteration as f64, value(h)));
            let (role, style) = if *k == r.best { ROLES[1] } else { (Role::Search, Style::Line) };
            Series::new(label(*k), role, style, mine)
        };
        order.iter().map(one).filter(|s| !s.x.0.is_empty()).collect()
    };
    let base = Chart { topic: Topic::Search, x: "iteration".into(), logarithmic: true, main: true, ..Chart::default() };
    let ends: Vec<f64> = r.runs.iter().map(|r| r.cost).filter(|c| c.is_finite()).collect();
    let best = ends.iter().copied().fold(f64::INFINITY, f64::min);
    let same = ends.iter().filter(|c| **c <= best * 1.01).count();
    let mut out = vec![Chart {
        key: "search-cost".into(),
        subject: "cost".into(),
        title: "Cost of every search".into(),
        words: format!(
            "Cost by iteration of {} searches. {same} of them end within a hundredth of the best, {best:.4}.",
            r.runs.len()
        ),
        y: "cost".into(),
        series: series(&|h| h.cost),
        ..base.clone()
    }];
    for (n, p) in fitted.free.iter().zip(&r.parameters).take(NUMBERS) {
        let values: Vec<f64> = fitted.history.iter().filter_map(|h| h.values.get(p.index).copied()).collect();
        let largest = values.iter().map(|v| v.abs()).fold(0.0, f64::max);
        let (factor, unit) = unit_for(p.value.abs().max(largest * 1e-3), &p.unit);
        let all = series(&|h| h.values.get(p.index).map_or(f64::NAN, |v| v * factor));
        let what = name(&n.label());
        out.push(Chart {
            key: format!("search-{}", p.index),
            subject: what.clone(),
            title: format!("{what} in every search"),
            words: format!(
                "{what} by iteration of {} searches; the best ends at {}.",
                r.runs.len(),
                quantity(p.value, p.standard_error, &p.unit)
            ),
            y: if unit.is_empty() { what } else { format!("{what} [{unit}]") },
            logarithmic: values.iter().all(|v| *v > 0.0) && largest > 3.0 * values.iter().copied().fold(f64::INFINITY, f64::min),
            series: all,
            ..base.clone()
        });
    }
    out.retain(|c| c.series.iter().any(|s| s.x.0.len() > 1));
    out
}

/// A curve of stiffness with its band.
pub fn curve(number: usize, found: &FoundCurve) -> Chart {
    let what = if found.path.ends_with("volume_curve") { "ratio of volumes" } else { "principal stretch" };
    let labels = [
        ("factor", Role::After, Style::Line),
        ("± one standard error", Role::Noise, Style::Dashed),
        ("", Role::Noise, Style::Dashed),
    ];
    let series =
        labels.into_iter().zip(found.band()).map(|((label, role, style), points)| Series::new(label, role, style, points));
    Chart {
        key: format!("curve-{number}"),
        topic: Topic::Curve,
        subject: found.path.clone(),
        title: format!("Stiffness over that at rest: {}", found.path),
        words: format!("Factor of stiffness of {} against the {what}, with one standard error.", found.path),
        x: what.into(),
        y: "factor".into(),
        main: true,
        series: series.collect(),
        ..Chart::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_of_their_stretch() {
        let points: Vec<(f64, f64)> = (0..4000).map(|k| (f64::from(k) * 0.01, if k < 2000 { 1.0 } else { -1.0 })).collect();
        let m = means(&points);
        assert_eq!(m.len(), STRETCHES);
        assert!(m[..19].iter().all(|p| p.1 == 1.0) && m[21..].iter().all(|p| p.1 == -1.0));
        assert!((m[0].0 - 0.5).abs() < 0.01);
    }
}
