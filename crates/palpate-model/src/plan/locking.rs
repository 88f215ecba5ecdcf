//! How much too stiff linear tetrahedra make a body: an estimate by numbers from a bar that bends.

use crate::scene::Tetrahedron;
use crate::space::body::Body;

/// Elements across the bar.
const ACROSS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
/// Poisson's ratios.
const NU: [f64; 4] = [0.3, 0.45, 0.49, 0.499];
/// What is missing of the sag of a bar of 100 × 30 × 30 mm under its own weight that one end face holds, `[elements across][ν]`; against quadratic
/// elements of five across.
const MISSING: [[f64; 4]; 4] =
    [[0.74, 0.81, 0.87, 0.89], [0.46, 0.65, 0.82, 0.88], [0.21, 0.39, 0.66, 0.86], [0.07, 0.17, 0.41, 0.77]];

/// A body of linear tetrahedra.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Locking {
    /// Elements across the body, about.
    pub across: f64,
    /// Part of the sag of a bar of as many elements across that is missing, at the body's Poisson's ratio.
    pub missing: f64,
}

/// The estimate; `None` for other bodies.
pub fn locking(body: &Body, kind: Tetrahedron, nu: f64) -> Option<Locking> {
    if body.points.is_empty() || kind != Tetrahedron::Linear {
        return None;
    }
    // A long bar of square section is four times as thick as its volume over its surface.
    let across = 4.0 * body.volume / body.area / body.length;
    Some(Locking { across, missing: missing(across, nu) })
}

/// Part of the sag that is missing with so many elements across the bar.
///
/// Between the table's numbers linear in the logarithms of the elements across and of ½ − ν; with more elements than there the rest falls with their
/// square, and lower ratios count as the lowest.
pub fn missing(across: f64, nu: f64) -> f64 {
    let (row, down) = between(&ACROSS.map(f64::ln), across.ln());
    let (column, right) = between(&NU.map(|nu| -(0.5 - nu).ln()), -(0.5 - nu).max(1e-12).ln());
    let at = |i: usize| MISSING[i][column] * (1.0 - right) + MISSING[i][column + 1] * right;
    let finer = (across / ACROSS[ACROSS.len() - 1]).max(1.0);
    (at(row) * (1.0 - down) + at(row + 1) * down) / (finer * finer)
}

/// The interval of increasing numbers that holds x, or the nearest, and how far along x lies.
fn between(all: &[f64; 4], x: f64) -> (usize, f64) {
    let k = all[1..3].iter().filter(|a| **a <= x).count();
    (k, ((x - all[k]) / (all[k + 1] - all[k])).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_the_table_are_met_and_others_lie_between() {
        for (i, n) in ACROSS.iter().enumerate() {
            for (j, nu) in NU.iter().enumerate() {
                assert!((missing(*n, *nu) - MISSING[i][j]).abs() < 1e-12);
            }
        }
        assert_eq!((missing(0.5, 0.3), missing(4.0, 0.0)), (0.74, 0.21));
        assert!((missing(16.0, 0.3) - 0.07 / 4.0).abs() < 1e-12 && missing(3.0, 0.47) > 0.39 && missing(3.0, 0.47) < 0.82);
        assert!(missing(4.0, 0.4999999) < 0.8601);
    }
}
