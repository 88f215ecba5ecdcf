//! What a page shows of a scene: curves, the body in space, what cameras saw, residuals.

use super::chart;
use crate::report::quantity::millimetres;
use crate::report::stage::pair;
use crate::results::report::{Overlay, ReportData, SceneData, Topic};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, html};

/// Pictures of the body in space where no program runs, and on paper.
const PICTURES: usize = 3;
/// Width of each of both motions in them [pixels].
const WIDTH: usize = 440;

/// A scene's part of a page.
pub fn scene(data: &ReportData, number: usize) -> Markup {
    let scene = &data.scenes[number];
    let of = |topic: Topic| data.charts.iter().filter(move |c| c.scene == Some(number) && c.topic == topic);
    let tracks: Vec<_> = of(Topic::Track).collect();
    html! {
        section.scene aria-label=(scene.name) {
            @if data.scenes.len() > 1 { h2 { "Scene " (number + 1) ": " (scene.name) } }
            @if !tracks.is_empty() {
                h2 { "Measured against simulated" }
                @for c in tracks.iter().filter(|c| c.main) { (chart(c)) }
                @if tracks.len() > 1 {
                    details.explorer data-tracks=(number) hidden { summary { "All " (tracks.len()) " curves" } }
                }
            }
            (space(data, number))
            (overlays(data, &scene.overlays))
            @if of(Topic::Residual).next().is_some() {
                h2 { @if scene.times.len() == 1 { "Residual along the body" } @else { "Residual over time" } }
                @for c in of(Topic::Residual) { (chart(c)) }
            }
            @if of(Topic::Histogram).next().is_some() {
                h2 { "Residuals against the noise" }
                @for c in of(Topic::Histogram) { (chart(c)) }
            }
        }
    }
}

/// The body in space, with a slider over time where programs run.
fn space(data: &ReportData, number: usize) -> Markup {
    let scene = &data.scenes[number];
    if scene.shown.is_empty() {
        return Markup::default();
    }
    let depth = scene.shown.iter().flat_map(|f| f.motions.iter().flatten()).any(|m| !m.points.0.is_empty());
    let others = scene.shown.iter().flat_map(|f| f.motions.iter().flatten()).any(|m| !m.measured.0.is_empty());
    let full = millimetres(scene.scale);
    html! {
        h2 { "Residual on the body" }
        figure.space data-scene=(number) {
            div.static {
                @for k in pictures(scene) {
                    img alt=(words(data, scene, k)) src={ "data:image/png;base64," (STANDARD.encode(pair(data, scene, k, WIDTH).png())) };
                }
            }
            figcaption {
                @if depth {
                    "Dots are measured points, the surface has the mean of those around: blue where the measurement lies inside the model, grey on it, red "
                    "outside; full colour at " (full) ". Black dots met no part of the body; surface without colour was not measured. "
                }
                @if others {
                    "A white ring is a measured marker or point, the dot where the model has it; the redder the line between, the farther (full colour at "
                    (full) "). "
                }
                "Both motions stand in the same frame; axes in millimetres, marks every " (millimetres(scene.tick)) "."
            }
        }
    }
}

/// Frames that stand as pictures: the first, the worst and the last.
fn pictures(scene: &SceneData) -> Vec<usize> {
    let mut all = vec![0, scene.worst, scene.shown.len() - 1];
    all.sort_unstable();
    all.dedup();
    all.truncate(PICTURES);
    all
}

/// A shown frame in words.
fn words(data: &ReportData, scene: &SceneData, k: usize) -> String {
    let f = &scene.shown[k];
    let apart = |m: usize| {
        let rms = scene.rms[m].get(f.frame).copied().flatten()?;
        f.motions[m].as_ref().map(|_| format!("{}: {} apart", data.motions[m], millimetres(rms)))
    };
    let told: Vec<String> = (0..2).filter_map(apart).collect();
    format!("The simulated body with what was measured at {:.4} s. {}.", f.time, told.join("; "))
}

fn overlays(data: &ReportData, all: &[Overlay]) -> Markup {
    html! {
        @if !all.is_empty() {
            h2 { "Camera overlay" }
            figure.overlays {
                @for o in all {
                    img alt=(o.words) src={ "data:image/png;base64," (o.png) };
                }
                figcaption {
                    "Left: measured depth, near dark and far light, what the mask leaves out paler; outlines of the body: " b.before { (data.motions[0]) }
                    " in orange, " b.after { (data.motions[1]) } " in blue, of the mask in black. Right: measured minus simulated depth of the latter; hatched where "
                    "the body should be seen and nothing was measured, dark where the mask has the object and the model has not. Depths and camera are as they "
                    "were recorded: what a measurement effect of the scene corrects is still in them."
                }
            }
        }
    }
}
