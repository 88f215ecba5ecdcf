//! Which discretisation suits a body: the one that needs fewer nodes for the same error in bending.
//!
//! Two cells through a thickness t that bends are off by 3 % (ν = 0.3) to 7 % (0.45), and so are two quadratic tetrahedra
//! ([docs/method.md]: the beam of both elements). Cells are cubes of edge t/2 everywhere: V/h³ + A/2h² nodes. Tetrahedra of a mesh that follows
//! the surface may be flat: t/2 high and as long as the motion allows, ℓ = L/16 for the lowest modes of a body of length L, if that is more.
//! Six of them fill a brick with eight nodes of its own: 8 V/(ℓ² t/2), and a quarter more for the outer layer.
//!
//! Cells need no mesher and take depth, so they are named as long as they are affordable ([`MOST_CELLS`]), whatever tetrahedra would need.

use crate::choose::{MOST_CELLS, thickness, two};
use crate::experiment::Experiment;
use palpate_engine::number;
use palpate_model::scene::BodySource;

/// Elements through a thickness.
const THROUGH: f64 = 2.0;
/// Quadratic elements along the longest side: lowest bending modes are right within a percent.
const ALONG: f64 = 16.0;

/// What suits a body, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Suited {
    /// Name as in `object.discretisation`.
    pub discretisation: &'static str,
    /// The reason, in words.
    pub reason: String,
}

/// Nodes for one error in bending.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Needed {
    cells: f64,
    tetrahedra: f64,
}

impl Needed {
    /// Of a body of this volume [m³], surface [m²], thickness and length [m].
    fn of(volume: f64, area: f64, thickness: f64, length: f64) -> Needed {
        let h = thickness / THROUGH;
        let long = (length / ALONG).max(h);
        Needed { cells: volume / h.powi(3) + 0.5 * area / (h * h), tetrahedra: 1.25 * 8.0 * volume / (long * long * h) }
    }

    fn cells_suit(self) -> bool {
        self.cells <= MOST_CELLS || self.cells <= self.tetrahedra
    }
}

/// What suits the body of an experiment.
pub(crate) fn suited(e: &Experiment) -> Suited {
    let (body, thick) = (&e.plan().body, thickness(e.shape()));
    let needed = Needed::of(body.volume, body.area, thick, body.size());
    let [cells, tetrahedra, t] = [needed.cells, needed.tetrahedra, thick].map(|x| number(two(x)));
    let bend = format!("two through {t} m of thickness bend within some 5 %");
    if let BodySource::Tetrahedra { .. } = e.scene().object.source {
        let reason = format!("a mesh is given that follows the surface; of cells, {bend} and take about {cells} nodes");
        return Suited { discretisation: "tetrahedra", reason };
    }
    if let BodySource::Cloud(cloud) = &e.scene().object.source {
        let reason = format!(
            "its modulus is that of the material whatever the spacing, and {bend} with about {cells} nodes; the {} points given serve where they are \
             what is asked for",
            cloud.points.len()
        );
        return Suited { discretisation: "cells", reason };
    }
    match needed.cells_suit() {
        true => Suited {
            discretisation: "cells",
            reason: format!("{bend} and take about {cells} nodes, quadratic tetrahedra {tetrahedra} for the same"),
        },
        false => Suited {
            discretisation: "tetrahedra",
            reason: format!(
                "of cells, {bend}, but take about {cells} nodes; quadratic tetrahedra that lie flat in the thin parts take {tetrahedra}: \
                 give a volume_mesh"
            ),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thick_bodies_suit_cells_and_wide_sheets_tetrahedra() {
        let slab = |x: f64, y: f64, z: f64| Needed::of(x * y * z, 2.0 * (x * y + y * z + x * z), z, x);
        let beam = slab(0.1, 0.03, 0.03);
        // 7 × 2 × 2 cells of 15 mm have 72 nodes, and quadratic tetrahedra of the same edges five times as many.
        assert!(beam.cells_suit() && (beam.cells / 72.0 - 1.0).abs() < 0.3, "{beam:?}");
        assert!((3.0..8.0).contains(&(beam.tetrahedra / beam.cells)), "{beam:?}");
        let plate = slab(0.3, 0.3, 0.01);
        assert!(plate.cells_suit(), "affordable: {plate:?}");
        let sheet = slab(0.3, 0.3, 0.001);
        assert!(!sheet.cells_suit() && sheet.cells > 7e5 && sheet.tetrahedra < 2e4, "{sheet:?}");
        // Large, but no part of it thin: tetrahedra would be as small.
        let block = slab(5.0, 5.0, 2.0);
        let fine = Needed::of(50.0, 130.0, 0.05, 5.0);
        assert!(block.cells_suit() && !fine.cells_suit(), "{fine:?}");
    }

    #[test]
    fn the_reason_names_thickness_and_nodes() {
        let text = "format = \"scene/1\"\n[object]\nshape = { box = { min = [0, 0, 0], max = [0.3, 0.3, 0.004] } }\ncell_size = 0.004\n\
            [material]\ndensity = 1000.0\nyoungs_modulus = 1.0e5\npoisson_ratio = 0.4\n[time]\nstep = 0.01\nsteps = 1\n";
        let of = |text: &str| suited(&Experiment::from_toml(text, "sheet.toml").unwrap_or_else(|e| panic!("{e}")));
        let sheet = of(text);
        assert_eq!(sheet.discretisation, "tetrahedra");
        assert!(sheet.reason.contains("m of thickness bend within some 5 %, but take about"), "{sheet:?}");
        let bar = of(&text.replace("0.004] }", "0.05] }").replace("cell_size = 0.004", "cell_size = 0.05"));
        assert!(bar.discretisation == "cells" && bar.reason.ends_with("for the same"), "{bar:?}");
    }
}
