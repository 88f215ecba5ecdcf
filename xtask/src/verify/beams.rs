//! A cantilever in large deflections against the elastica.

use super::report::{Requirement, Row};
use super::scenes;
use glam::DVec3;
use palpate_model::materials::ALL;
use palpate_model::scene::{Analytic, Clamp, InitialShape, PointMass};

const LENGTH: f64 = 0.32;
const THICK: f64 = 0.02;

/// Deflection and shortening over the length of an inextensible beam with P L²/EI = `load` at its end, by shooting: θ″ = −load cos θ with
/// θ(0) = 0, θ′(1) = 0 (Bisshopp & Drucker 1945).
fn elastica(load: f64) -> [f64; 2] {
    const STEPS: usize = 2000;
    let shoot = |start: f64| {
        let rates = |y: [f64; 4]| [y[1], -load * y[0].cos(), y[0].sin(), y[0].cos()];
        let mut y = [0.0, start, 0.0, 0.0];
        let h = 1.0 / STEPS as f64;
        let along = |y: [f64; 4], k: [f64; 4], f: f64| std::array::from_fn(|i| y[i] + f * k[i]);
        for _ in 0..STEPS {
            let a = rates(y);
            let b = rates(along(y, a, 0.5 * h));
            let c = rates(along(y, b, 0.5 * h));
            let d = rates(along(y, c, h));
            y = std::array::from_fn(|i| y[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
        }
        y
    };
    let (mut low, mut high) = (0.0, load);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if shoot(middle)[1] > 0.0 { high = middle } else { low = middle }
    }
    let y = shoot(low);
    [y[2], 1.0 - y[3]]
}

/// Deflection and shortening of the end of a beam with a weight there, over its length, on cells of `h`; `off` moves it across the lattice
/// [cells].
fn bend(model: usize, load: f64, h: f64, off: f64) -> Result<[f64; 2], String> {
    let side = DVec3::new(0.0, off * h, off * h);
    let shape = Analytic::Box { min: DVec3::new(-THICK, 0.0, 0.0) + side, max: DVec3::new(LENGTH, THICK, THICK) + side };
    let mut s = scenes::body(shape, h);
    s.material.model = &ALL[model];
    // Its own weight is a millionth of the load.
    s.material.inertia = palpate_model::scene::Inertia::Density(1e-3);
    let force = load * s.material.youngs_modulus * THICK.powi(4) / 12.0 / (LENGTH * LENGTH);
    s.gravity = DVec3::new(0.0, 0.0, -10.0);
    let tip = DVec3::new(LENGTH, 0.5 * THICK, 0.5 * THICK) + side;
    s.masses = vec![PointMass { point: tip, mass: force / 10.0 }];
    s.clamps = vec![Clamp::still(DVec3::splat(-1.0), DVec3::new(0.0, 1.0, 1.0))];
    s.initial.state = InitialShape::StaticEquilibrium;
    let (plan, state) = scenes::end(&s)?;
    // Mean over the end's face, which the load dents at one point only.
    let (mut sum, mut area) = (DVec3::ZERO, 0.0);
    for (patch, place) in plan.body.pieces().filter(|(p, _)| p.normal.x > 0.99) {
        sum += patch.area * place.at(&state.displacement);
        area += patch.area;
    }
    let u = sum / area;
    Ok([-u.z / LENGTH, -u.x / LENGTH])
}

/// The study.
///
/// # Errors
/// A beam has no equilibrium.
pub fn run() -> Result<Vec<Row>, String> {
    let mut rows = Vec::new();
    let source = "elastica (Bisshopp & Drucker, *Quart. Appl. Math.* 3, 1945), integrated";
    let [two, four] = [0.01, 0.005];
    let whole = "2 whole cells";
    for (model, load, h, off, cells) in [
        (0, 1.0, two, 0.0, whole),
        (0, 4.0, two, 0.0, whole),
        (1, 4.0, two, 0.0, whole),
        // The ghost penalty stiffens what is two cut cells thick by some per cent.
        (0, 4.0, four, 0.4, "4 cells and cut ones"),
        (1, 4.0, four, 0.4, "4 cells and cut ones"),
    ] {
        let (exact, found) = (elastica(load), bend(model, load, h, off)?);
        let name = format!("{}, P L²/EI = {load}, {cells} across", ALL[model].name);
        for (k, what, part) in [(0, "deflection", 0.015), (1, "shortening", 0.03)] {
            let requirement = Requirement::Within { value: exact[k], part };
            rows.push(Row::new(format!("{name}: {what}"), requirement, found[k], "L", source));
        }
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_elastica_is_the_linear_beam_at_small_loads_and_shortens_by_its_square() {
        let [deflection, shortening] = super::elastica(0.01);
        assert!((deflection / (0.01 / 3.0) - 1.0).abs() < 1e-4, "{deflection}");
        // ½ ∫ w′² = P²/15.
        assert!((shortening / (1e-4 / 15.0) - 1.0).abs() < 1e-3, "{shortening}");
    }
}
