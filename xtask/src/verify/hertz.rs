//! A ball between two rigid plates: force and contact against the exact linear solution, and that against Hertz.

use super::report::{Requirement, Row};
use super::scenes;
use super::sphere::{Squeezed, squeeze};
use glam::DVec3;
use palpate_cpu::terms::contact::touches;
use palpate_model::mechanics::plane;
use palpate_model::plan::Physics;
use palpate_model::scene::{Analytic, Clamp, InitialShape, Plane};

const NU: f64 = 0.3;
const SOURCE: &str = "Legendre series of the elastic sphere";

/// Part of Hertz's force and of his approach that a small contact of the exact solution has.
fn against_hertz(contact: f64) -> [f64; 2] {
    let Squeezed { force, approach, .. } = squeeze(NU, contact);
    // F = 4/3 E* √R δ^(3/2), E* = E/(1 − ν²), for this force.
    let hertz = (0.75 * (1.0 - NU * NU) * force).powf(2.0 / 3.0);
    [approach / hertz, approach]
}

/// Force [E R²] and radius of the contact [R] of a ball with `cells` to its radius that plates press flat by `approach` [R] on either side,
/// with the lattice shifted by `off` cells.
fn press(cells: f64, approach: f64, off: DVec3) -> Result<[f64; 2], String> {
    let h = 1.0 / cells;
    let c = off * h;
    let mut s = scenes::body(Analytic::Ball { radius: 1.0, center: c }, h);
    s.material.youngs_modulus = 1.0;
    s.material.poisson_ratio = NU;
    // It holds the ball against drifting and turning where nothing moves or is strained much.
    let core = DVec3::splat(0.06);
    s.clamps = vec![Clamp::still(c - core, c + core)];
    let at = |n: DVec3| Plane { point: c - n * (1.0 - approach), ..scenes::plane(n) };
    s.planes = vec![at(DVec3::Z), at(-DVec3::Z)];
    s.initial.state = InitialShape::StaticEquilibrium;
    let (plan, state) = scenes::end(&s)?;
    let planes = plane::planes(&plan, &Physics::new(&plan.layout, &plan.theta));
    let (mut force, mut second) = (0.0, 0.0);
    for (patch, t) in touches(&plan.body, &planes[0], 1.0, [&state.displacement; 2]) {
        force += t.area * t.pressure;
        second += t.area * t.pressure * (patch.point - c).truncate().length_squared();
    }
    // Of Hertz's pressure the mean square of the distance is 2/5 of the radius'.
    Ok([force, (2.5 * second / force).sqrt()])
}

/// The study.
///
/// # Errors
/// A ball cannot be pressed.
pub fn run() -> Result<Vec<Row>, String> {
    let hertz = "Hertz, *J. reine angew. Math.* 92, 1881";
    let mut rows = vec![Row::new(
        "the series itself, contact of 0.02 R: approach over Hertz's",
        Requirement::Within { value: 1.0, part: 0.02 },
        against_hertz(0.02)[0],
        "",
        hertz,
    )];
    let exact = squeeze(NU, 0.2);
    let places = [DVec3::new(0.013, 0.026, 0.3), DVec3::new(0.25, 0.5, 0.77)];
    for (cells, part) in [(8.0, 0.06), (12.0, 0.03)] {
        let found = places.into_iter().map(|p| press(cells, exact.approach, p)).collect::<Result<Vec<_>, _>>()?;
        let mean = |k: usize| found.iter().map(|f| f[k]).sum::<f64>() / found.len() as f64;
        let what = format!("contact of 0.2 R, {:.1} cells: ", 0.2 * cells);
        let row = |name: &str, value, part, x, unit| {
            Row::new(format!("{what}{name}"), Requirement::Within { value, part }, x, unit, SOURCE)
        };
        rows.push(row("force", exact.force, part, mean(0), "E R²"));
        if part > 0.03 {
            // So few patches of the surface touch that the pressure's moment is off by 8 %.
            continue;
        }
        let pressure = |force: f64, radius: f64| force / (std::f64::consts::PI * radius * radius);
        rows.push(row("radius, by the second moment of the pressure", exact.radius, part, mean(1), "R"));
        rows.push(row("mean pressure", pressure(exact.force, exact.radius), part, pressure(mean(0), mean(1)), "E"));
    }
    Ok(rows)
}
