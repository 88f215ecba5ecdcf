//! A ball dropped on a rigid plane: what it keeps of its speed.

use super::report::{Requirement, Row};
use super::scenes;
use glam::DVec3;
use palpate_model::scene::Analytic;

const RADIUS: f64 = 0.05;
/// Speed at touch-down [m/s]: a contact of a third of the radius.
const SPEED: f64 = 0.3;

/// What is left of the speed, and of the kinetic energy, after a bounce in so many steps during Hertz's time of contact.
fn restitution(steps_a_contact: f64) -> Result<[f64; 2], String> {
    let h = RADIUS / 5.0;
    let gap = 0.3 * h;
    let center = DVec3::new(0.013 * h, 0.026 * h, RADIUS + gap);
    let mut s = scenes::body(Analytic::Ball { radius: RADIUS, center }, h);
    let stiffness = s.material.youngs_modulus / (1.0 - s.material.poisson_ratio.powi(2));
    let mass = 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3) * 1000.0;
    let approach = (15.0 * mass * SPEED * SPEED / (16.0 * stiffness * RADIUS.sqrt())).powf(0.4);
    let contact = 2.943 * approach / SPEED;
    let step = contact / steps_a_contact;
    s.planes = vec![scenes::plane(DVec3::Z)];
    s.initial.velocity = DVec3::new(0.0, 0.0, -SPEED);
    // Until it is in the air again.
    s.time = scenes::steps(step, ((gap / SPEED + 1.6 * contact) / step) as usize);
    let (plan, end) = scenes::end(&s)?;
    let squares: Vec<DVec3> = end.velocity.iter().map(|v| *v * *v).collect();
    let energy = scenes::mean(&plan, &squares).element_sum();
    Ok([scenes::mean(&plan, &end.velocity).z / SPEED, energy / (SPEED * SPEED)])
}

/// The study.
///
/// # Errors
/// A ball cannot be simulated.
pub fn run() -> Result<Vec<Row>, String> {
    let rayleigh = "elastic: vibration keeps about (v/50)·√(ρ/E), 0.06 % (Rayleigh, *Phil. Mag.* 11, 1906)";
    let stated = "stated: second order, a quarter of the steps' number loses at most as much again";
    let mut rows = Vec::new();
    for (steps, least, source) in [(40.0, 0.985, rayleigh), (20.0, 0.98, rayleigh), (10.0, 0.97, stated)] {
        let [speed, energy] = restitution(steps)?;
        let row = |what: &str, least, x| {
            Row::new(format!("{steps} steps a contact: {what}"), Requirement::AtLeast(least), x, "", source)
        };
        rows.push(row("speed after over speed before", least, speed));
        rows.push(Row::new(
            format!("{steps} steps a contact: kinetic energy after over before"),
            Requirement::Between { least: least * least - 0.01, most: 1.0 },
            energy,
            "",
            source,
        ));
    }
    Ok(rows)
}
