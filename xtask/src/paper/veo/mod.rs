//! Acceptance of what came with Chen et al., Virtual Elastic Objects (CVPR 2022): sequences of equilibria under known loads. `bench/veo.jsonl` holds a
//! row a case and commit.

mod states;

use super::acceptance::Aim;
use super::acceptance::Bound::{AtMost, Below, Between};
use super::acceptance::Figure::{Of, Over};
use super::cases::{Case, Figures, Set};
use crate::rows::Measured;

/// The study.
pub const SET: Set = Set { name: "veo", page: "docs/veo.md", cases: &CASES, aims: AIMS, more: &[], measured: Measured::Fits };

const CASES: [(&str, Case); 5] = [
    ("states", |data, _| states::run(data, &[])),
    ("states-0", |data, _| states::run(data, states::LOADS[0])),
    ("states-52", |data, _| states::run(data, states::LOADS[1])),
    ("states-102", |data, _| states::run(data, states::LOADS[2])),
    ("held-out", |data, _| states::run(data, states::HALF)),
];

const MODULUS: &str = "E [kPa]";
const RMS: &str = "rms [mm]";
const TEST: &str = "rms of the other frames [mm]";
const UNMOVED: &str = "rms of the other frames, not moving [mm]";

/// E within a tenth of fits of single states on hexahedra: 253 to 259, 246 to 248 and 253 to 261 kPa.
const AIMS: &[Aim] = &[
    ("A13", "E of all six states [kPa]", "states", Of(MODULUS), "–", Between(221.4, 287.1)),
    ("A13", "own weight: E [kPa]", "states-0", Of(MODULUS), "–", Between(227.7, 284.9)),
    ("A13", "52 g: E [kPa]", "states-52", Of(MODULUS), "–", Between(221.4, 272.8)),
    ("A13", "102 g: E [kPa]", "states-102", Of(MODULUS), "–", Between(227.7, 287.1)),
    ("A13", "all six states: rms [mm]", "states", Of(RMS), "–", AtMost(2.4)),
    (
        "A13",
        "second runs by the first ones: rms over that of a body that does not move",
        "held-out",
        Over(TEST, UNMOVED),
        "–",
        Below(0.5),
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_aim_is_one_of_a_case() {
        assert!(AIMS.iter().all(|a| CASES.iter().any(|c| c.0 == a.2)));
    }
}
