//! Acceptance of what came with Chen et al., Virtual Elastic Objects (CVPR 2022): sequences of equilibria under known loads, jets, obstacles and what a body
//! carries. `bench/veo.jsonl` holds a row a case and commit.

mod bars;
mod carried;
mod clouds;
mod interactions;
mod states;
mod toy;

use super::acceptance::Aim;
use super::acceptance::Bound::{AtLeast, AtMost, Below, Between};
use super::acceptance::Figure::{Of, Over};
use super::cases::{Case, Figures, Set};
use crate::rows::Measured;

/// The study.
pub const SET: Set = Set {
    name: "veo",
    page: "docs/veo.md",
    cases: &CASES,
    aims: AIMS,
    more: &[("veo-toy", toy::table)],
    measured: Measured::Fits,
};

const CASES: [(&str, Case); 19] = [
    ("states", |data, _| states::run(data, &[])),
    ("states-0", |data, _| states::run(data, states::LOADS[0])),
    ("states-52", |data, _| states::run(data, states::LOADS[1])),
    ("states-102", |data, _| states::run(data, states::LOADS[2])),
    ("held-out", |data, _| states::run(data, states::HALF)),
    ("bars-4", |_, _| bars::thick(4)),
    ("bars-6", |_, _| bars::thick(6)),
    ("bars-modes", |_, _| bars::modes()),
    ("bars-finer", |_, _| bars::finer()),
    ("both-bodies", |_, folder| clouds::both(folder)),
    ("two-parts", |_, folder| clouds::two_parts(folder)),
    ("cloud-states", |data, folder| clouds::beam(data, folder, &[])),
    ("toy", |_, folder| toy::run(folder, false)),
    ("toy-tet", |_, folder| toy::run(folder, true)),
    ("frames-100", |_, folder| clouds::frames(folder)),
    ("jet-plate", |_, _| interactions::plate()),
    ("jet-sphere", |_, _| interactions::sphere()),
    ("obstacle", |_, _| interactions::obstacle()),
    ("carried", |_, folder| carried::run(folder)),
];

const MODULUS: &str = "E [kPa]";
const RMS: &str = "rms [mm]";
const TEST: &str = "rms of the other frames [mm]";
const ROWS: &str = "rows and completeness, largest error";
const COLUMNS: &str = "columns, largest error over h²";
const PULLED: &str = "E in tension, largest error [%]";
const NARROWED: &str = "Poisson's ratio, largest error [%]";
const BENT: &str = "EI, mean";
const PUBLISHED: &str = "E by published weights, mean";
const FEWEST: &str = "fewest zero modes";
const ZEROS: &str = "zero modes";
const NEXT: &str = "next mode over the shear modulus";
const HELD: &str = "rms of the other states, per point over one modulus";
const RATIO: &str = "outer half over inner half";
const TIPS: &str = "tip of points over tip of cells";
const HUNDRED: &str = "cost and gradient of 100 frames [s]";
const LN: &str = "ln of the moduli's ratio";
const UNMOVED: &str = "rms of the other frames, not moving [mm]";

/// E within a tenth of fits of single states on hexahedra: 253 to 259, 246 to 248 and 253 to 261 kPa.
const AIMS: &[Aim] = &[
    ("A9", "jet on a plate: force over thrust", "jet-plate", Of("force on a plate over thrust"), "–", Between(0.99, 1.01)),
    (
        "A9",
        "jet on a plate askew by 30°: error over thrust",
        "jet-plate",
        Of("plate askew: error of the force over thrust"),
        "–",
        AtMost(0.02),
    ),
    (
        "A9",
        "even stream on a sphere: drag coefficient",
        "jet-sphere",
        Of("drag coefficient of a sphere, 12 cells to its radius"),
        "–",
        Between(0.99, 1.01),
    ),
    (
        "A10",
        "ball between obstacles: force over that between planes",
        "obstacle",
        Of("force over that of a plane"),
        "–",
        Between(0.98, 1.02),
    ),
    ("A10", "both forces' sum over one", "obstacle", Of("what both forces leave over one"), "–", AtMost(0.02)),
    (
        "A10",
        "largest difference of the displacement over the largest",
        "obstacle",
        Of("largest difference of the displacement over the largest"),
        "–",
        AtMost(0.02),
    ),
    ("A11", "turned mesh: error over size", "carried", Of("mesh: error over size"), "–", AtMost(1e-6)),
    (
        "A11",
        "turned splats: error of places over size",
        "carried",
        Of("splats: error of the places over size"),
        "–",
        AtMost(1e-6),
    ),
    (
        "A11",
        "turned splats: error of covariances over their size",
        "carried",
        Of("splats: error of the covariance over its size"),
        "–",
        AtMost(2e-6),
    ),
    ("A11", "turned splats: error of the colour", "carried", Of("splats: error of the colour"), "–", AtMost(1e-6)),
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
    ("A1", "4 points thick: row sums and completeness", "bars-4", Of(ROWS), "–", AtMost(1e-12)),
    ("A1", "column sums over h²", "bars-4", Of(COLUMNS), "–", AtMost(1e-10)),
    ("A1", "6 points thick: row sums and completeness", "bars-6", Of(ROWS), "–", AtMost(1e-12)),
    ("A1", "column sums over h²", "bars-6", Of(COLUMNS), "–", AtMost(1e-10)),
    ("A2", "4 points thick, 5 draws: largest error of E [%]", "bars-4", Of(PULLED), "–", AtMost(0.1)),
    ("A2", "of Poisson's ratio [%]", "bars-4", Of(NARROWED), "–", AtMost(0.1)),
    ("A2", "6 points thick: of E [%]", "bars-6", Of(PULLED), "–", AtMost(0.1)),
    ("A2", "of Poisson's ratio [%]", "bars-6", Of(NARROWED), "–", AtMost(0.1)),
    ("A2", "published weights, 4 points thick: E, mean", "bars-4", Of(PUBLISHED), "–", Between(0.5, 0.7)),
    ("A2", "6 points thick", "bars-6", Of(PUBLISHED), "–", Between(0.5, 0.7)),
    ("A3", "4 points thick: EI, mean of 5 draws", "bars-4", Of(BENT), "–", AtLeast(0.92)),
    ("A3", "6 points thick", "bars-6", Of(BENT), "–", AtLeast(0.95)),
    ("A3", "zero modes of 5³ points, most of 5 draws", "bars-modes", Of(ZEROS), "–", Between(6.0, 6.0)),
    ("A3", "the next one over μ, least", "bars-modes", Of(NEXT), "–", AtLeast(0.2)),
    ("A4", "EI of 16k points over that of 4k", "bars-finer", Over("EI, 16k points", "EI, 4k points"), "–", Between(0.97, 1.03)),
    ("A8", "bar of two parts: per point over one modulus, states not fitted", "two-parts", Of(HELD), "–", AtMost(0.1)),
    ("A8", "stiffness of the outer half over the inner one", "two-parts", Of(RATIO), "–", Between(0.2, 0.3)),
    ("A12", "tip of points over that of cells, one cloud", "both-bodies", Of(TIPS), "–", Between(0.95, 1.05)),
    ("A12", "ln of the moduli's ratio", "both-bodies", Of(LN), "–", Between(-0.1, 0.1)),
    ("§", "100 frames of 3100 points: cost and gradient [s]", "frames-100", Of(HUNDRED), "–", AtMost(10.0)),
    ("A13", "points: E of all six states [kPa]", "cloud-states", Of(MODULUS), "–", Between(221.4, 287.1)),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_aim_is_one_of_a_case() {
        assert!(AIMS.iter().all(|a| CASES.iter().any(|c| c.0 == a.2)));
    }
}
