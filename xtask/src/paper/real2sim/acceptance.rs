//! What was promised of the published results, and bodies of cells and of tetrahedra side by side.

use crate::paper::acceptance::Aim;
use crate::paper::acceptance::Bound::{Around, AtLeast, AtMost, Below, Between};
use crate::paper::acceptance::Figure::{Of, Over};
use crate::paper::cases::Row;

const MISS: &str = "miss [mm]";
const COARSENED: &str = "after over before";
const SECOND: &str = "second motion, transferred over refitted";
const MODULI: &str = "E, second over first";
const FREQUENCY: &str = "beam-load52: frequency off [%]";
const LIGHT: &str = "beam-gravity: damping ratio over measured";
const HEAVY: &str = "beam-load52: damping ratio over measured";
const STEP: &str = "step of E at x [mm]";
const SOFT: &str = "clamped half of the bar: E, geometric mean [kPa]";
const KNOWN: &str = "their share with error < 20 %";
const INSIDE: &str = "cells inside their 95 % band";

/// What was promised.
pub const AIMS: &[Aim] = &[
    ("A6", "disk, homogeneous: miss [mm]", "disk-homogeneous", Of(MISS), "0.81", Below(0.81)),
    ("A6", "disk, curves of 5 corners: miss [mm]", "disk-curve-5", Of(MISS), "0.45", Below(0.45)),
    ("A6", "disk, curves of 17 corners: miss [mm]", "disk-curve-17", Of(MISS), "0.42 (21)", Below(0.42)),
    ("A6", "disk, a modulus a cell: miss [mm]", "disk-modulus", Of(MISS), "0.33", Below(0.33)),
    ("A6", "disk, a density a node: miss [mm]", "disk-density", Of(MISS), "0.08", Below(0.08)),
    ("A7", "coarse cells of 15 mm: error after over before", "coarsening-15mm", Of(COARSENED), "0.27", AtMost(0.25)),
    ("A7", "of 20 mm", "coarsening-20mm", Of(COARSENED), "0.28", AtMost(0.25)),
    ("A7", "of 30 mm", "coarsening-30mm", Of(COARSENED), "0.30", AtMost(0.25)),
    ("A7", "second motion, 15 mm: transferred over refitted", "coarsening-15mm", Of(SECOND), "1.12", AtMost(1.1)),
    ("A7", "20 mm", "coarsening-20mm", Of(SECOND), "1.12", AtMost(1.1)),
    ("A7", "30 mm", "coarsening-30mm", Of(SECOND), "1.12", AtMost(1.1)),
    ("A8", "beams on cells: E with 52 g over E without", "beams-cells", Of(MODULI), "–", Around(1.0, 0.03)),
    ("A8", "beams on tetrahedra: the same", "beams-tet10", Of(MODULI), "–", Around(1.0, 0.03)),
    ("A8", "52 g on cells: frequency off [%]", "beams-cells", Of(FREQUENCY), "–", Around(0.0, 3.0)),
    ("A8", "52 g on tetrahedra: frequency off [%]", "beams-tet10", Of(FREQUENCY), "–", Around(0.0, 3.0)),
    (
        "A8",
        "52 g by the numbers of the other beam: rms [mm]",
        "beams-cells",
        Of("beam-load52 by the other's numbers: rms [mm]"),
        "–",
        Below(1.71),
    ),
    (
        "A8",
        "own weight by those of the beam with 52 g: rms [mm]",
        "beams-cells",
        Of("beam-gravity by the other's numbers: rms [mm]"),
        "–",
        Below(0.72),
    ),
    ("A9", "Rayleigh, own weight: damping over measured", "beams-rayleigh", Of(LIGHT), "–", Around(1.0, 0.1)),
    ("A9", "Rayleigh, 52 g", "beams-rayleigh", Of(HEAVY), "–", Around(1.0, 0.1)),
    ("A9", "power law, own weight", "beams-viscosity", Of(LIGHT), "–", Around(1.0, 0.1)),
    ("A9", "power law, 52 g", "beams-viscosity", Of(HEAVY), "–", Around(1.0, 0.1)),
    ("A9", "structural, own weight", "beams-structural", Of(LIGHT), "–", Around(1.0, 0.1)),
    ("A9", "structural, 52 g", "beams-structural", Of(HEAVY), "–", Around(1.0, 0.1)),
    ("A10", "two materials, Matérn: E of the soft half [kPa]", "hanging-matern", Of(SOFT), "–", Between(60.0, 126.0)),
    ("A10", "edge-preserving: the same", "hanging-parts", Of(SOFT), "–", Between(60.0, 126.0)),
    ("A10", "Matérn: step of E at x [mm]", "hanging-matern", Of(STEP), "–", Around(0.0, 15.0)),
    ("A10", "edge-preserving: the same", "hanging-parts", Of(STEP), "–", Around(0.0, 15.0)),
    (
        "A10",
        "edge-preserving: share of the free half that is undetermined",
        "hanging-parts",
        Of("free half of the bar: undetermined share"),
        "–",
        AtLeast(0.9),
    ),
    (
        "A10",
        "edge-preserving: residual over that of two parts",
        "hanging-parts",
        Over("residual [mm]", "residual of two parts [mm]"),
        "–",
        AtMost(1.0),
    ),
    ("A11", "bar, Matérn: error < 20 % where sd < 20 %", "bar-two-clamps", Of(KNOWN), "–", AtLeast(1.0)),
    ("A11", "bar, edge-preserving: the same", "bar-two-clamps-parts", Of(KNOWN), "–", AtLeast(1.0)),
    ("A11", "bar, Matérn: cells inside the 95 % band", "bar-two-clamps", Of(INSIDE), "–", AtLeast(0.9)),
    ("A11", "bar, edge-preserving: the same", "bar-two-clamps-parts", Of(INSIDE), "–", AtLeast(0.9)),
    (
        "speed",
        "gradient by 10 080 cells over that by one number",
        "ten-thousand-cells",
        Over("gradient by all cells [s]", "gradient by one modulus [s]"),
        "–",
        AtMost(1.1),
    ),
];

/// The same bodies of cells and of tetrahedra: the two cases, and the figures that stand side by side.
const PAIRS: &[(&str, &str, &[&str])] = &[
    (
        "beams-cells",
        "beams-tet10",
        &[
            "beam-gravity: nodes",
            "beam-gravity: E [kPa]",
            "beam-gravity: its standard error [kPa]",
            "beam-gravity: frequency off [%]",
            "beam-gravity: damping ratio over measured",
            "beam-gravity: rms [mm]",
            "beam-gravity by the other's numbers: rms [mm]",
            "beam-load52: E [kPa]",
            "beam-load52: its standard error [kPa]",
            "beam-load52: frequency off [%]",
            "beam-load52: damping ratio over measured",
            "beam-load52: rms [mm]",
            "beam-load52 by the other's numbers: rms [mm]",
            "sag at rest under 0 g over measured, by beam-gravity",
            "sag at rest under 52 g over measured, by beam-gravity",
            "sag at rest under 102 g over measured, by beam-gravity",
            "sag at rest under 0 g over measured, by beam-load52",
            "sag at rest under 52 g over measured, by beam-load52",
            "sag at rest under 102 g over measured, by beam-load52",
        ],
    ),
    (
        "beams-viscosity",
        "beams-viscosity-tet10",
        &[
            "E [kPa]",
            "material.viscosity.coefficient",
            "material.viscosity.exponent",
            "beam-gravity: damping ratio over measured",
            "beam-load52: damping ratio over measured",
            "rms of both [mm]",
        ],
    ),
    (
        "moldstar-cells",
        "moldstar-tet10",
        &[
            "moldstar: nodes",
            "moldstar: E [kPa]",
            "moldstar: its standard error [kPa]",
            "moldstar: frequency off [%]",
            "moldstar: damping ratio over measured",
            "moldstar: rms [mm]",
        ],
    ),
    (
        "hanging-parts",
        "hanging-tet10",
        &[
            "cells",
            "two parts: E of the clamped half [kPa]",
            "two parts: E of the free half [kPa]",
            "clamped half of the bar: E, geometric mean [kPa]",
            "free half of the bar: E, geometric mean [kPa]",
            "free half of the bar: undetermined share",
            "residual [mm]",
            "residual of two parts [mm]",
        ],
    ),
];

/// Cells and tetrahedra side by side, in Markdown.
pub fn side_by_side(rows: &[Row]) -> String {
    let mut out = String::from("| | cells | tetrahedra |\n|---|---|---|\n");
    for (cells, tetrahedra, figures) in PAIRS {
        let row = |case: &str| rows.iter().rev().find(|r| r.case == case);
        let said =
            |case: &str, name: &str| row(case).and_then(|r| r.figures.get(name)).map_or("–".into(), |x| format!("{x:.3}"));
        out += &format!("| **{cells}, {tetrahedra}** | | |\n");
        figures.iter().for_each(|name| out += &format!("| {name} | {} | {} |\n", said(cells, name), said(tetrahedra, name)));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::SET;
    use super::*;

    #[test]
    fn every_aim_is_one_of_a_case() {
        let known = |case: &str| SET.cases.iter().any(|c| c.0 == case);
        assert!(AIMS.iter().all(|a| known(a.2)));
        let lines = crate::paper::acceptance::markdown(AIMS, &[]);
        assert_eq!(lines.lines().count(), AIMS.len() + 2);
        assert!(PAIRS.iter().all(|p| known(p.0) && known(p.1)));
    }
}
