//! What `tracked.json` says of a tracked body.

use crate::experiment::short;
use crate::results::finite;
use crate::results::tracking::{FrameRow, RoundNumber, RoundRow, TrackingDocument};
use crate::tracking::{Refined, Round, RoundValue, TrackedFrame, median};
use palpate_engine::number;
use palpate_engine::tracking::Doubt;

/// The document of a body that was tracked in the recording of an experiment, with the rounds that it took, in so many seconds.
pub fn tracking_document(refined: &Refined, seconds: f64) -> TrackingDocument {
    let (experiment, tracked) = (&refined.experiment, &refined.tracked);
    let (verdict, reason) = verdict(refined);
    TrackingDocument {
        scene: experiment.scene().path.display().to_string(),
        verdict: verdict.into(),
        reason,
        prior: if tracked.dynamic { "dynamic" } else { "elastic" }.into(),
        recorded: tracked.recorded,
        nodes: experiment.plan().body.nodes.len(),
        places: tracked.surface.rest.len(),
        seconds,
        rounds: refined.rounds.iter().map(round).collect(),
        frames: tracked.frames.iter().map(row).collect(),
    }
}

/// What is wrong, in words.
pub(crate) fn words(doubt: &Doubt) -> String {
    match doubt {
        Doubt::Unmatched(share) => format!("only {:.0} % of the readings meet the body", 100.0 * share),
        Doubt::Far(rms) => format!("the body lies {} m from its readings", number(*rms)),
        Doubt::Pierced(share) => format!("{:.1} % of the rays pass through the body", 100.0 * share),
        Doubt::Jumped(factor) => format!("the elastic energy rose {:.0} times from the frame before", factor),
        Doubt::Unseen => "has no reading".into(),
    }
}

fn row(f: &TrackedFrame) -> FrameRow {
    let of = |seen: bool| median(f.deviation.iter().zip(&f.seen).filter(|(_, s)| **s == seen).map(|(d, _)| *d));
    FrameRow {
        time: f.time,
        readings: f.met.readings,
        matched: f.met.matched,
        rms: finite(f.met.rms),
        deviation_seen: of(true),
        deviation_hidden: of(false),
        seen: f.seen.iter().filter(|s| **s).count(),
        determined: finite(f.determined),
        temperature: finite(f.temperature),
        steps: f.steps,
        cold: f.cold,
        doubts: f.doubts.iter().map(words).collect(),
    }
}

fn round(r: &Round) -> RoundRow {
    let number = |v: &RoundValue| RoundNumber {
        path: v.path.clone(),
        value: finite(v.value),
        standard_error: v.standard_error.and_then(finite),
    };
    RoundRow {
        values: r.values.iter().map(number).collect(),
        moved: r.moved.and_then(finite),
        rms: finite(r.rms),
        temperature: finite(r.temperature),
    }
}

/// The verdict and why.
fn verdict(r: &Refined) -> (&'static str, String) {
    let t = &r.tracked;
    let doubted = t.frames.len() - t.sound();
    let first = t.frames.iter().find(|f| !f.doubts.is_empty());
    let why = first.map_or(String::new(), |f| {
        format!("{doubted} of {} frames are doubted, first at {} s: {}", t.frames.len(), short(f.time), words(&f.doubts[0]))
    });
    match (t.interrupted, doubted) {
        (true, _) => {
            ("interrupted", format!("{} of {} frames were tracked. {why}", t.frames.len(), t.recorded).trim_end().to_string())
        }
        (false, 0) if r.settled => ("tracked", String::new()),
        (false, 0) => match (&r.ended, r.rounds.last().and_then(|r| r.moved)) {
            (Some(why), _) => {
                let rounds = if r.rounds.len() == 1 { "one round".into() } else { format!("{} rounds", r.rounds.len()) };
                (
                    "doubtful",
                    format!("after {rounds} nothing was left to fit, as the model says more than the readings do; {why}"),
                )
            }
            (None, Some(moved)) => {
                ("doubtful", format!("after {} rounds a number still moved by {} standard errors", r.rounds.len(), number(moved)))
            }
            (None, None) => ("doubtful", "one round does not say whether its numbers would move in another".into()),
        },
        _ => ("doubtful", why),
    }
}
