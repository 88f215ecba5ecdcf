//! Acceptance of what came with Wang et al., Deformation Capture and Modeling of Soft Objects (SIGGRAPH 2015): tracking without correspondences, starts
//! by vibrations, rounds of tracking and fitting, control regions on their synthetic bar, and motions that are made. `bench/capture.jsonl` holds a row a case and commit.

mod controls;
mod keyframes;
mod tracking;
mod vibrations;

use super::acceptance::Aim;
use super::acceptance::Bound::{AtLeast, AtMost, Between};
use super::acceptance::Figure::{Of, Over};
use super::cases::{Case, Figures, Set};
use crate::rows::Measured;

/// The study.
pub const SET: Set =
    Set { name: "capture", page: "docs/capture.md", cases: &CASES, aims: AIMS, more: &[], measured: Measured::Tracking };

const CASES: [(&str, Case); 17] = [
    ("controls-1", |_, folder| controls::run(folder, 1, controls::Truth::Finer)),
    ("controls-2", |_, folder| controls::run(folder, 2, controls::Truth::Finer)),
    ("controls-8", |_, folder| controls::run(folder, 8, controls::Truth::Finer)),
    ("controls-1-same", |_, folder| controls::run(folder, 1, controls::Truth::Same)),
    ("controls-8-same", |_, folder| controls::run(folder, 8, controls::Truth::Same)),
    ("bar-3", |_, folder| tracking::run(folder, tracking::Body::Bar, 3, 1.0)),
    ("bar-1", |_, folder| tracking::run(folder, tracking::Body::Bar, 1, 1.0)),
    ("bar-3-stiff", |_, folder| tracking::run(folder, tracking::Body::Bar, 3, 10.0)),
    ("bar-1-stiff", |_, folder| tracking::run(folder, tracking::Body::Bar, 1, 10.0)),
    ("sheet-3", |_, folder| tracking::run(folder, tracking::Body::Sheet, 3, 1.0)),
    ("sheet-1", |_, folder| tracking::run(folder, tracking::Body::Sheet, 1, 1.0)),
    ("rounds", |_, folder| tracking::rounds(folder)),
    ("led", |_, folder| tracking::led(folder)),
    ("vibrations-14", |_, folder| vibrations::run(folder, 0.14)),
    ("vibrations-47", |_, folder| vibrations::run(folder, 0.47)),
    ("vibrations-94", |_, folder| vibrations::run(folder, 0.94)),
    ("keyframes", |_, folder| keyframes::run(folder)),
];

const RMS: &str = "rms of the surface [mm]";
const HIDDEN: &str = "rms of what is hidden [mm]";
const INSIDE: &str = "share within 2 sd, seen";
const INSIDE_HIDDEN: &str = "share within 2 sd, hidden";
const SETTLED: &str = "rounds until they settled";
const FRAME: &str = "seconds a warm frame";
const WORST: &str = "worst E, off [%]";
const DAMPING: &str = "stiffness damping, off [%]";
const EVALUATIONS: &str = "evaluations";
const SECONDS: &str = "seconds of the fit";
const MISS: &str = "worst keyframe, off [mm]";
const START: &str = "worst start, E off [%]";

const AIMS: &[Aim] = &[
    ("A", "bar, 1 control: E off [%]", "controls-1", Of(WORST), "–", AtMost(5.0)),
    ("A", "2 controls: worst E off [%]", "controls-2", Of(WORST), "–", AtMost(5.0)),
    ("A", "8 controls: worst E off [%]", "controls-8", Of(WORST), "37", AtMost(5.0)),
    ("A", "1 control: β off [%]", "controls-1", Of(DAMPING), "60", AtMost(5.0)),
    ("A", "8 controls: β off [%]", "controls-8", Of(DAMPING), "40", AtMost(5.0)),
    ("A", "1 control, same cells: E off [%]", "controls-1-same", Of(WORST), "–", AtMost(0.1)),
    ("A", "8 controls, same cells: worst E off [%]", "controls-8-same", Of(WORST), "–", AtMost(0.1)),
    ("A″", "1 control: evaluations", "controls-1", Of(EVALUATIONS), "250", AtMost(15.0)),
    ("A″", "2 controls", "controls-2", Of(EVALUATIONS), "250", AtMost(15.0)),
    ("A″", "8 controls", "controls-8", Of(EVALUATIONS), "250", AtMost(15.0)),
    ("A″", "1 control: time of the fit [s]", "controls-1", Of(SECONDS), "720", AtMost(60.0)),
    ("A″", "2 controls", "controls-2", Of(SECONDS), "1800", AtMost(120.0)),
    ("A″", "8 controls", "controls-8", Of(SECONDS), "5400", AtMost(480.0)),
    ("E", "bar, 3 cameras: rms of the surface [mm]", "bar-3", Of(RMS), "–", AtMost(1.0)),
    ("E", "1 camera", "bar-1", Of(RMS), "–", AtMost(1.2)),
    ("E", "3 cameras: what is hidden", "bar-3", Of(HIDDEN), "–", AtMost(1.5)),
    ("E", "1 camera: what is hidden", "bar-1", Of(HIDDEN), "–", AtMost(1.5)),
    ("E", "ten times too stiff, 3 cameras", "bar-3-stiff", Of(RMS), "–", AtMost(2.0)),
    ("E", "ten times too stiff, 1 camera", "bar-1-stiff", Of(RMS), "–", AtMost(2.4)),
    ("E", "folding sheet, 3 cameras", "sheet-3", Of(RMS), "–", AtMost(1.0)),
    ("E", "folding sheet, 1 camera", "sheet-1", Of(RMS), "–", AtMost(1.2)),
    ("E", "a warm frame [s]", "bar-3", Of(FRAME), "1.6 to 12", AtMost(0.7)),
    ("E", "share within 2 sd, seen, 3 cameras", "bar-3", Of(INSIDE), "–", Between(0.9, 0.97)),
    ("E", "hidden, 3 cameras", "bar-3", Of(INSIDE_HIDDEN), "–", Between(0.9, 0.97)),
    ("E", "seen, 1 camera", "bar-1", Of(INSIDE), "–", Between(0.9, 0.97)),
    ("E", "hidden, 1 camera", "bar-1", Of(INSIDE_HIDDEN), "–", Between(0.9, 0.97)),
    (
        "F",
        "second round's rms over the first's, from 10 E",
        "rounds",
        Over("rms after 1 round [mm]", "rms without a round [mm]"),
        "–",
        AtMost(0.7),
    ),
    ("F", "last move in standard errors", "rounds", Of("last move"), "–", AtMost(0.3)),
    ("F", "rounds until then", "rounds", Of(SETTLED), "2 to 3", AtMost(4.0)),
    ("F", "E after them, off [%]", "rounds", Of("E off [%]"), "–", AtMost(5.0)),
    ("F", "a fit of the depth images from 10 E, led by tracking: E off [%]", "led", Of("E off [%]"), "–", AtMost(5.0)),
    ("G", "sag of 14 % of the length: worst start, E off [%]", "vibrations-14", Of(START), "–", AtMost(5.0)),
    ("G", "47 %", "vibrations-47", Of(START), "–", AtMost(5.0)),
    ("G", "94 %", "vibrations-94", Of(START), "–", AtMost(5.0)),
    ("G", "94 %: starts that found the vibration", "vibrations-94", Of("starts that found it"), "–", AtLeast(3.0)),
    ("J", "five keyframes: worst miss [mm]", "keyframes", Of(MISS), "–", AtMost(1.0)),
    ("J", "bar of 756 nodes: steps a second", "keyframes", Of("steps a second"), "–", AtLeast(30.0)),
];

/// How far a value is from the truth [%].
fn off(value: f64, truth: f64) -> f64 {
    100.0 * (value / truth - 1.0).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_aim_is_one_of_a_case() {
        assert!(AIMS.iter().all(|a| CASES.iter().any(|c| c.0 == a.2)));
    }
}
