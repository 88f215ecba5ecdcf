//! A block that slides to rest, and a ball that rolls or slips down a slope.

use super::report::{Requirement, Row};
use super::scenes::{self, G};
use glam::DVec3;
use palpate_engine::Snapshot;
use palpate_model::mechanics::contact;
use palpate_model::plan::Plan;
use palpate_model::scene::Analytic;

const SOURCE: &str = "rigid body, Coulomb friction";

/// Height above the plane at which the layer of a body carries a pressure [m], by bisection.
fn height(pressure: f64, young: f64, cell: f64) -> f64 {
    let (stiffness, width) = (contact::DEFAULT_STIFFNESS * young / cell, contact::WIDTH * cell);
    let (mut low, mut high) = (-pressure / stiffness, width);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if contact::pressure(middle, stiffness, width).0 > pressure { low = middle } else { high = middle }
    }
    low
}

/// Way of a block that starts at 0.5 m/s with friction 0.4, over v²/2μg.
fn slide() -> Result<f64, String> {
    let (speed, coefficient, cell, tall, young) = (0.5, 0.4, 0.01, 0.02, 2e5);
    let z = height(1000.0 * G * tall, young, cell);
    let shape = Analytic::Box { min: DVec3::new(-0.03, -0.02, z), max: DVec3::new(0.03, 0.02, z + tall) };
    let mut s = scenes::body(shape, cell);
    s.material.youngs_modulus = young;
    s.material.stiffness_damping = 0.002;
    s.gravity = DVec3::new(0.0, 0.0, -G);
    s.planes = vec![scenes::plane(DVec3::Z)];
    s.initial.velocity = DVec3::new(speed, 0.0, 0.0);
    s.effects = vec![scenes::friction(coefficient)];
    s.time = scenes::steps(0.002, 90);
    let (plan, end) = scenes::end(&s)?;
    Ok(scenes::mean(&plan, &end.displacement).x / (speed * speed / (2.0 * coefficient * G)))
}

/// A ball on a slope of tan α = ¼ after `time`, and the slope's upward and downhill directions.
fn descend(coefficient: f64, time: f64) -> Result<(Plan, Snapshot, DVec3), String> {
    let radius = 0.05;
    let up = DVec3::new(0.25, 0.0, 1.0).normalize();
    let mut s = scenes::body(Analytic::Ball { radius, center: up * radius }, radius / 4.0);
    s.gravity = DVec3::new(0.0, 0.0, -G);
    s.planes = vec![scenes::plane(up)];
    s.effects = vec![scenes::friction(coefficient)];
    s.time = scenes::steps(0.005, (time / 0.005) as usize);
    let (plan, end) = scenes::end(&s)?;
    let along = (DVec3::NEG_Z + up * up.z).normalize();
    Ok((plan, end, along))
}

/// Spin about the level axis [rad/s]: angular momentum over the moment of inertia, both of the nodes' masses.
fn spin(plan: &Plan, s: &Snapshot, axis: DVec3) -> f64 {
    let place = |i: usize| plan.body.nodes[i] + s.displacement[i];
    let all: Vec<DVec3> = (0..s.displacement.len()).map(place).collect();
    let (center, velocity) = (scenes::mean(plan, &all), scenes::mean(plan, &s.velocity));
    let of = |f: &dyn Fn(DVec3, DVec3) -> f64| {
        (0..all.len()).map(|i| plan.body.node_volume[i] * f(all[i] - center, s.velocity[i] - velocity)).sum::<f64>()
    };
    of(&|x, v| x.cross(v).dot(axis)) / of(&|x, _| x.cross(axis).length_squared())
}

/// The study.
///
/// # Errors
/// Something cannot be simulated.
pub fn run() -> Result<Vec<Row>, String> {
    let within = |what: &str, value, part, x, unit| Row::new(what, Requirement::Within { value, part }, x, unit, SOURCE);
    let mut rows = vec![within("block: way to rest over v²/2μg", 1.0, 0.02, slide()?, "")];
    let time = 0.4;
    let slope = 0.25f64.atan();
    let (plan, end, along) = descend(0.4, time)?;
    let way = scenes::mean(&plan, &end.displacement).dot(along);
    let expected = 0.5 * 5.0 / 7.0 * G * slope.sin() * time * time;
    rows.push(within("ball that rolls (μ = 0.4): way at 5/7 g sin α", expected, 0.015, way, "m"));
    // It slips where tan α > 7/2 μ.
    let coefficient = 0.04;
    let (plan, end, along) = descend(coefficient, time)?;
    let way = scenes::mean(&plan, &end.displacement).dot(along);
    let expected = 0.5 * G * (slope.sin() - coefficient * slope.cos()) * time * time;
    rows.push(within("ball that slips (μ = 0.04): way at g (sin α − μ cos α)", expected, 0.015, way, "m"));
    // The ball's own surface moves uphill at its lowest point.
    let turning = spin(&plan, &end, DVec3::Y).abs();
    let expected = 2.5 * coefficient * G * slope.cos() * time / 0.05;
    rows.push(within("the same: spin at 5/2 μ g cos α / R", expected, 0.05, turning, "rad/s"));
    Ok(rows)
}
