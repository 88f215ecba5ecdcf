//! The verdict of a fit: one word, and the reasons for it, said first wherever the fit is told of.

use super::Fitted;
use crate::experiment::Experiment;
use crate::results::fit::{FitStatus, Verdict, VerdictWord};
use palpate_fit::Status;
use palpate_model::params::Transform;
use palpate_model::scene::ClampRegion;
use palpate_model::space::body::Patch;
use palpate_model::space::stencil::Stencil;

/// Standard errors from the optimum up to which a search that met no criterion has arrived all the same.
const NEAR: f64 = 0.1;
/// How many times what noise explains may remain.
const LEFT: f64 = 2.0;
/// Share of a value that cells and step may leave open, where the number is one that has a size.
const COARSE: f64 = 0.5;
/// Share of the surface that may be free where a body counts as held whole.
const FREE: f64 = 1e-3;

/// The verdict on a fit of these experiments.
pub fn verdict(fitted: &Fitted, experiments: &[Experiment]) -> Verdict {
    let (missing, doubts, bounds) = (missing(fitted), doubts(fitted, experiments), at_bounds(fitted));
    if !missing.is_empty() {
        return Verdict { word: VerdictWord::Interrupted, reasons: missing };
    }
    if !doubts.is_empty() {
        return Verdict { word: VerdictWord::NotToBeTrusted, reasons: doubts.into_iter().chain(bounds).collect() };
    }
    let word = if bounds.is_empty() { VerdictWord::Converged } else { VerdictWord::AtABound };
    Verdict { word, reasons: bounds }
}

/// What a fit that was cut short did not come to.
fn missing(fitted: &Fitted) -> Vec<String> {
    let mut out = match fitted.status() {
        FitStatus::Complete => return Vec::new(),
        FitStatus::Interrupted => Vec::new(),
        FitStatus::BrokenOff => fitted.result.broken.iter().map(|why| format!("the device failed: {why}")).collect(),
    };
    let runs = &fitted.result.runs;
    let cut = |s: &Status| matches!(s, Status::Interrupted | Status::Broken(_) | Status::Blind);
    let open = runs.iter().filter(|r| cut(&r.status)).count();
    let iterations = runs[fitted.result.best].iterations;
    out.push(match (open, runs.len()) {
        (0, _) => "the searches had ended; what follows them is missing".into(),
        (_, 1) => format!("the search was stopped after {iterations} iterations"),
        (open, all) => format!("{open} of {all} searches were stopped, the best one after {iterations} iterations"),
    });
    let distance = fitted.result.distance;
    if distance > NEAR {
        out.push(format!("the best point is about {} standard errors from an optimum", palpate_engine::number(two(distance))));
    }
    if fitted.result.parameters.iter().all(|p| p.standard_error.is_none()) {
        out.push("standard errors are missing".into());
    }
    if fitted.grid.is_none() {
        out.push("what cells and step do was not looked at".into());
    }
    out
}

/// A number with its first two digits.
fn two(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

/// Why the numbers should not be believed, if anything.
fn doubts(fitted: &Fitted, experiments: &[Experiment]) -> Vec<String> {
    let mut out = Vec::new();
    let (rms, noise, points) = fitted.residual();
    let unmatched: usize = fitted.after.iter().map(|r| r.unmatched).sum();
    let held = experiments.iter().filter(|e| held_whole(e)).map(|e| e.scene().path.display());
    out.extend(held.map(|scene| format!("{scene}: clamps hold the whole body; nothing of it can move by itself")));
    let best = &fitted.result.runs[fitted.result.best];
    if best.status == Status::Blind {
        // What else there is to say of such values follows from it.
        let text = "from no start anything of the recording could be seen: readings lie beyond the band around the body, or what is free \
                    changes nothing that is seen; begin elsewhere (`start`), or free something else";
        out.push(text.into());
        return out;
    }
    if points == 0 {
        out.push("nothing of the recording met the simulated body".into());
    } else if unmatched > points {
        out.push(format!(
            "{unmatched} of {} observed points meet no part of the simulated body even at the best fit; the values rest on the other {points}",
            points + unmatched
        ));
    }
    let distance = fitted.result.distance;
    // A search whose end is within the noise has arrived, whatever ended it.
    if best.status != Status::Converged && (distance.is_nan() || distance > NEAR) {
        let away = match distance {
            d if d.is_finite() => format!(", about {} standard errors from an optimum", palpate_engine::number(two(d))),
            _ => String::new(),
        };
        out.push(match &best.status {
            Status::IterationLimit => format!("the search used up its {} iterations before it converged{away}", best.iterations),
            _ => format!("the search found no better point and did not converge{away}"),
        });
    }
    if rms > LEFT * noise {
        out.push(format!(
            "the remaining residual of {:.3} mm is {:.1} times what noise explains ({:.3} mm): something in the model is missing or \
             wrong (`palpate diagnose` looks for it), or cells and time step are too coarse",
            rms * 1e3,
            rms / noise,
            noise * 1e3
        ));
    }
    for (i, n) in fitted.free.iter().enumerate() {
        let h = fitted.headline(i);
        let sized = fitted.result.parameters[i].transform == Transform::Log;
        if let Some(d) = h.parts.and_then(|p| p.discretisation).filter(|d| sized && *d > COARSE * h.value.abs()) {
            out.push(format!(
                "{}: cells and step leave {:.0} % of it open; take finer ones",
                n.label(),
                100.0 * d / h.value.abs()
            ));
        }
    }
    out
}

fn at_bounds(fitted: &Fitted) -> Vec<String> {
    let held = fitted.free.iter().zip(&fitted.result.parameters).filter_map(|(n, p)| Some((n, p, p.at_bound?)));
    held.map(|(n, p, side)| format!("{} is at its {} bound {}", n.label(), side.name(), palpate_engine::number(p.value)))
        .collect()
}

/// True where clamps hold all of a body's surface, up to a thousandth.
pub fn held_whole(e: &Experiment) -> bool {
    let (clamps, to_object) = (&e.scene().clamps, e.scene().object.pose.inverse());
    if clamps.is_empty() {
        return false;
    }
    let body = &e.plan().body;
    let holds = |(place, of): (&Patch, Stencil)| {
        clamps.iter().zip(&e.plan().clamps).any(|(c, site)| match &c.region {
            ClampRegion::Box { min, max, object_frame } => {
                let p = if *object_frame { to_object.transform_point3(place.point) } else { place.point };
                p.cmpge(*min).all() && p.cmple(*max).all()
            }
            ClampRegion::Group(_) => of.nodes.iter().all(|n| site.nodes.binary_search_by_key(n, |held| held.0).is_ok()),
        })
    };
    let free = body.pieces().filter(|piece| !holds(*piece)).count();
    free as f64 <= FREE * body.patches.len() as f64
}
