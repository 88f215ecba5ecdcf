//! What was promised of the published results, beside what the last rows say: the table of `docs/real2sim.md`.

use super::{CASES, Figures, Row};

/// One line: a figure of a case, the paper's own or what was there before, and what is aimed at.
struct Aim {
    id: &'static str,
    what: &'static str,
    case: &'static str,
    figure: fn(&Figures) -> Option<f64>,
    paper: &'static str,
    aim: &'static str,
    met: fn(f64) -> bool,
}

fn of(figures: &Figures, name: &str) -> Option<f64> {
    figures.get(name).copied()
}

const fn aim(
    id: &'static str,
    what: &'static str,
    case: &'static str,
    figure: fn(&Figures) -> Option<f64>,
    paper: &'static str,
    aim: &'static str,
    met: fn(f64) -> bool,
) -> Aim {
    Aim { id, what, case, figure, paper, aim, met }
}

/// |x| at most so much away from one.
fn within(x: f64, part: f64) -> bool {
    (x - 1.0).abs() <= part
}

fn miss(f: &Figures) -> Option<f64> {
    of(f, "miss [mm]")
}

fn coarsened(f: &Figures) -> Option<f64> {
    of(f, "after over before")
}

fn second(f: &Figures) -> Option<f64> {
    of(f, "second motion, transferred over refitted")
}

fn moduli(f: &Figures) -> Option<f64> {
    of(f, "E, second over first")
}

fn frequency(f: &Figures) -> Option<f64> {
    of(f, "beam-load52: frequency off [%]")
}

fn light(f: &Figures) -> Option<f64> {
    of(f, "beam-gravity: damping ratio over measured")
}

fn heavy(f: &Figures) -> Option<f64> {
    of(f, "beam-load52: damping ratio over measured")
}

fn step(f: &Figures) -> Option<f64> {
    of(f, "step of E at x [mm]")
}

fn soft(f: &Figures) -> Option<f64> {
    of(f, "clamped half of the bar: E, geometric mean [kPa]")
}

fn unseen(f: &Figures) -> Option<f64> {
    of(f, "free half of the bar: undetermined share")
}

fn to_parts(f: &Figures) -> Option<f64> {
    Some(of(f, "residual [mm]")? / of(f, "residual of two parts [mm]")?)
}

fn known(f: &Figures) -> Option<f64> {
    of(f, "their share with error < 20 %")
}

fn inside(f: &Figures) -> Option<f64> {
    of(f, "cells inside their 95 % band")
}

const AIMS: &[Aim] = &[
    aim("A6", "disk, homogeneous: miss [mm]", "disk-homogeneous", miss, "0.81", "< 0.81", |x| x < 0.81),
    aim("A6", "disk, curves of 5 corners: miss [mm]", "disk-curve-5", miss, "0.45", "< 0.45", |x| x < 0.45),
    aim("A6", "disk, curves of 17 corners: miss [mm]", "disk-curve-17", miss, "0.42 (21)", "< 0.42", |x| x < 0.42),
    aim("A6", "disk, a modulus a cell: miss [mm]", "disk-modulus", miss, "0.33", "< 0.33", |x| x < 0.33),
    aim("A6", "disk, a density a node: miss [mm]", "disk-density", miss, "0.08", "< 0.08", |x| x < 0.08),
    aim("A7", "coarse cells of 15 mm: error after over before", "coarsening-15mm", coarsened, "0.27", "≤ 0.25", |x| x <= 0.25),
    aim("A7", "of 20 mm", "coarsening-20mm", coarsened, "0.28", "≤ 0.25", |x| x <= 0.25),
    aim("A7", "of 30 mm", "coarsening-30mm", coarsened, "0.30", "≤ 0.25", |x| x <= 0.25),
    aim("A7", "second motion, 15 mm: transferred over refitted", "coarsening-15mm", second, "1.12", "≤ 1.10", |x| x <= 1.1),
    aim("A7", "20 mm", "coarsening-20mm", second, "1.12", "≤ 1.10", |x| x <= 1.1),
    aim("A7", "30 mm", "coarsening-30mm", second, "1.12", "≤ 1.10", |x| x <= 1.1),
    aim("A8", "beams on cells: E with 52 g over E without", "beams-cells", moduli, "–", "1 ± 0.03", |x| within(x, 0.03)),
    aim("A8", "beams on tetrahedra: the same", "beams-tet10", moduli, "–", "1 ± 0.03", |x| within(x, 0.03)),
    aim("A8", "52 g on cells: frequency off [%]", "beams-cells", frequency, "–", "± 3", |x| x.abs() <= 3.0),
    aim("A8", "52 g on tetrahedra: frequency off [%]", "beams-tet10", frequency, "–", "± 3", |x| x.abs() <= 3.0),
    aim(
        "A8",
        "52 g by the numbers of the other beam: rms [mm]",
        "beams-cells",
        |f| of(f, "beam-load52 by the other's numbers: rms [mm]"),
        "–",
        "< 1.71",
        |x| x < 1.71,
    ),
    aim(
        "A8",
        "own weight by those of the beam with 52 g: rms [mm]",
        "beams-cells",
        |f| of(f, "beam-gravity by the other's numbers: rms [mm]"),
        "–",
        "< 0.72",
        |x| x < 0.72,
    ),
    aim("A9", "Rayleigh, own weight: damping over measured", "beams-rayleigh", light, "–", "1 ± 0.1", |x| within(x, 0.1)),
    aim("A9", "Rayleigh, 52 g", "beams-rayleigh", heavy, "–", "1 ± 0.1", |x| within(x, 0.1)),
    aim("A9", "power law, own weight", "beams-viscosity", light, "–", "1 ± 0.1", |x| within(x, 0.1)),
    aim("A9", "power law, 52 g", "beams-viscosity", heavy, "–", "1 ± 0.1", |x| within(x, 0.1)),
    aim("A9", "structural, own weight", "beams-structural", light, "–", "1 ± 0.1", |x| within(x, 0.1)),
    aim("A9", "structural, 52 g", "beams-structural", heavy, "–", "1 ± 0.1", |x| within(x, 0.1)),
    aim("A10", "two materials, Matérn: E of the soft half [kPa]", "hanging-matern", soft, "–", "60 to 126", |x| {
        (60.0..=126.0).contains(&x)
    }),
    aim("A10", "edge-preserving: the same", "hanging-parts", soft, "–", "60 to 126", |x| (60.0..=126.0).contains(&x)),
    aim("A10", "Matérn: step of E at x [mm]", "hanging-matern", step, "–", "0 ± 15", |x| x.abs() <= 15.0),
    aim("A10", "edge-preserving: the same", "hanging-parts", step, "–", "0 ± 15", |x| x.abs() <= 15.0),
    aim("A10", "edge-preserving: share of the free half that is undetermined", "hanging-parts", unseen, "–", "all", |x| {
        x > 0.9
    }),
    aim("A10", "edge-preserving: residual over that of two parts", "hanging-parts", to_parts, "–", "≤ 1", |x| x <= 1.0),
    aim("A11", "bar, Matérn: error < 20 % where sd < 20 %", "bar-two-clamps", known, "–", "1", |x| x >= 1.0),
    aim("A11", "bar, edge-preserving: the same", "bar-two-clamps-parts", known, "–", "1", |x| x >= 1.0),
    aim("A11", "bar, Matérn: cells inside the 95 % band", "bar-two-clamps", inside, "–", "≥ 0.9", |x| x >= 0.9),
    aim("A11", "bar, edge-preserving: the same", "bar-two-clamps-parts", inside, "–", "≥ 0.9", |x| x >= 0.9),
    aim(
        "speed",
        "gradient by 10 080 cells over that by one number",
        "ten-thousand-cells",
        |f| Some(of(f, "gradient by all cells [s]")? / of(f, "gradient by one modulus [s]")?),
        "–",
        "≤ 1.1",
        |x| x <= 1.1,
    ),
];

/// The table in Markdown; cases without a row stand with a dash.
pub fn markdown(rows: &[Row]) -> String {
    let mut out = String::from("| | | paper | aim | here | | measured |\n|---|---|---|---|---|---|---|\n");
    for a in AIMS {
        debug_assert!(CASES.iter().any(|c| c.0 == a.case));
        let row = rows.iter().rev().find(|r| r.case == a.case);
        let (here, met, measured) = match row.and_then(|r| Some((r, (a.figure)(&r.figures)?))) {
            Some((r, x)) => {
                let word = if (a.met)(x) { "met" } else { "missed" };
                (format!("{x:.3}"), word, format!("{}, {}, {:.0} s", r.made.date, r.made.commit, r.seconds))
            }
            None => ("–".into(), "–", "–".into()),
        };
        out += &format!("| {} | {} | {} | {} | {here} | {met} | {measured} |\n", a.id, a.what, a.paper, a.aim);
    }
    out
}

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
            |case: &str, name: &str| row(case).and_then(|r| of(&r.figures, name)).map_or("–".into(), |x| format!("{x:.3}"));
        out += &format!("| **{cells}, {tetrahedra}** | | |\n");
        figures.iter().for_each(|name| out += &format!("| {name} | {} | {} |\n", said(cells, name), said(tetrahedra, name)));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_aim_is_one_of_a_case() {
        assert!(AIMS.iter().all(|a| CASES.iter().any(|c| c.0 == a.case)));
        let lines = markdown(&[]);
        assert_eq!(lines.lines().count(), AIMS.len() + 2);
        let known = |case: &str| CASES.iter().any(|c| c.0 == case);
        assert!(PAIRS.iter().all(|p| known(p.0) && known(p.1)));
    }
}
