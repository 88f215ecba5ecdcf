//! What is hidden in recordings of the tetrahedra: effects that the library knows, with their numbers, and those that it does not.

use super::hidden::Number;
use crate::tetrahedra::change::{Change, Spot};
use crate::tetrahedra::outside::{Kind, Outside};
use glam::DVec3;

const fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// Puts something of an amplitude into a change.
type Put = fn(&mut Change, f64);
/// Numbers of an amplitude: path, truth, and what a scene that does not know it says.
type Numbers = fn(f64) -> Vec<(&'static str, f64, f64)>;

/// Effects that the library knows: name, scene, what they change, and their numbers where the law is the same.
const KNOWN: &[(&str, &str, Put, Numbers)] = &[
    ("point-mass", "rod", |c, a| c.masses.push((v(0.2, 0.0, 0.115), 0.01 * a)), |a| vec![("mass", 0.01 * a, 0.0)]),
    (
        "uniform-force",
        "rod",
        |c, a| c.force = v(0.0, 250.0 * a, 0.0),
        |a| vec![("force.x", 0.0, 0.0), ("force.y", 250.0 * a, 0.0), ("force.z", 0.0, 0.0)],
    ),
    (
        "gravity",
        "rod",
        |c, a| c.gravity = v(0.2 * a, 0.3 * a, 0.0),
        |a| {
            vec![
                ("world.gravity.x", 8.496 + 0.2 * a, 8.496),
                ("world.gravity.y", 0.3 * a, 0.0),
                ("world.gravity.z", -4.905, -4.905),
            ]
        },
    ),
    ("time-offset", "rod", |c, a| c.clock = 0.01 * a.min(1.8), |a| vec![("offset", 0.01 * a.min(1.8), 0.0)]),
    ("air-drag", "rod", |c, a| c.drag = 30.0 * a, |a| vec![("coefficient", 30.0 * a, 0.0)]),
    ("two-part-stiffness", "rod", |c, a| c.soft = Some((DVec3::X, 0.1, (-0.5 * a).exp())), |a| vec![("ratio", -0.5 * a, 0.0)]),
    ("rest-shape", "rod", |c, a| c.bend = 0.4 * a, |a| vec![("bend_x_to_z", 0.4 * a, 0.0)]),
    ("initial-spin", "rod", |c, a| c.spin = v(0.0, 0.0, 0.6 * a), |a| vec![("initial.angular_velocity.z", 3.0 + 0.6 * a, 3.0)]),
    (
        "tether",
        "rod",
        |c, a| c.tether = Some((v(0.18, 0.0, 0.13), v(0.15, 0.1, 0.2), 1.5 * a)),
        |a| vec![("stiffness", 1.5 * a, 0.0)],
    ),
    (
        "marker-offset",
        "rod",
        |c, a| c.marker = Some((2, v(0.003 * a, 0.002 * a, 0.0))),
        |a| vec![("offset.x", 0.003 * a, 0.0), ("offset.y", 0.002 * a, 0.0)],
    ),
    ("mass-damping", "rod", |c, a| c.damping[0] = 0.6 * a, |a| vec![("material.mass_damping", 0.6 * a, 0.0)]),
    (
        "density-inclusion",
        "rod",
        |c, a| c.dense = Some(Spot { center: v(0.15, 0.0, 0.115), radius: 0.022, factor: a.exp() }),
        |_| vec![],
    ),
    (
        "inclusion",
        "bar",
        |c, a| c.inclusion = Some(Spot { center: v(0.1, 0.0, 0.115), radius: 0.025, factor: (-a).exp() }),
        |_| vec![],
    ),
    ("two-part-stiffness", "bar", |c, a| c.soft = Some((DVec3::X, 0.1, (-0.5 * a).exp())), |a| vec![("ratio", -0.5 * a, 0.0)]),
    ("point-mass", "bar", |c, a| c.masses.push((v(0.2, 0.0, 0.115), 0.015 * a)), |a| vec![("mass", 0.015 * a, 0.0)]),
    ("depth-bias", "bar", |c, a| c.depth_bias = 0.003 * a, |a| vec![("bias", 0.003 * a, 0.0)]),
    ("depth-scale", "bar", |c, a| c.depth_scale = 0.006 * a, |a| vec![("error", 0.006 * a, 0.0)]),
    ("depth-along-ray", "bar", |c, a| c.along_ray = 0.3 * a, |a| vec![("blend", 0.3 * a, 0.0)]),
    (
        "camera-pose",
        "bar",
        |c, a| c.camera = [v(0.003 * a, 0.0, 0.0), v(0.0, 0.004 * a, 0.006 * a)],
        |a| vec![("translation.x", 0.003 * a, 0.0), ("translation.y", 0.0, 0.0), ("translation.z", 0.0, 0.0)],
    ),
    ("coulomb-friction", "pea", |c, a| c.friction = 0.2 * a.min(2.5), |a| vec![("coefficient", 0.2 * a.min(2.5), 0.0)]),
    ("air-drag", "pea", |c, a| c.drag = 8.0 * a, |a| vec![("coefficient", 8.0 * a, 0.0)]),
    ("plane-pose", "pea", |c, a| c.height = 0.002 * a, |_| vec![]),
    (
        "poisson-ratio",
        "pea",
        |c, a| c.poisson = -0.08 * a.min(4.0),
        |a| vec![("material.poisson_ratio", 0.4 - 0.08 * a.min(4.0), 0.4)],
    ),
    (
        "stiffness-damping",
        "pea",
        |c, a| c.damping[1] = 0.004 * a,
        |a| vec![("material.stiffness_damping", 0.002 + 0.004 * a, 0.002)],
    ),
    (
        "initial-velocity",
        "pea",
        |c, a| c.velocity = v(0.03 * a, 0.04 * a, 0.0),
        |a| vec![("initial.velocity.x", 0.03 * a, 0.0), ("initial.velocity.y", 0.04 * a, 0.0), ("initial.velocity.z", 0.0, 0.0)],
    ),
    ("time-offset", "slab", |c, a| c.clock = 0.005 * a.min(3.0), |a| vec![("offset", 0.005 * a.min(3.0), 0.0)]),
    ("two-part-stiffness", "slab", |c, a| c.soft = Some((DVec3::X, 0.0, (-0.5 * a).exp())), |a| vec![("ratio", -0.5 * a, 0.0)]),
    (
        "uniform-force",
        "slab",
        |c, a| c.force = v(0.0, 250.0 * a, 0.0),
        |a| vec![("force.x", 0.0, 0.0), ("force.y", 250.0 * a, 0.0), ("force.z", 0.0, 0.0)],
    ),
    (
        "initial-spin",
        "slab",
        |c, a| c.spin = v(0.5 * a, 0.0, 0.4 * a),
        |a| vec![("initial.angular_velocity.x", 6.0 + 0.5 * a, 6.0), ("initial.angular_velocity.z", 1.5 + 0.4 * a, 1.5)],
    ),
    ("point-mass", "pillar", |c, a| c.masses.push((v(0.02, 0.0, 0.12), 0.01 * a)), |a| vec![("mass", 0.01 * a, 0.0)]),
    (
        "tether",
        "pillar",
        |c, a| c.tether = Some((v(0.0, 0.0, 0.115), v(0.15, 0.1, 0.1), 3.0 * a)),
        |a| vec![("stiffness", 3.0 * a, 0.0)],
    ),
    (
        "camera-pose",
        "pillar",
        |c, a| c.camera = [v(0.003 * a, 0.0, 0.0), v(0.0, 0.004 * a, 0.006 * a)],
        |a| vec![("translation.x", 0.003 * a, 0.0), ("translation.y", 0.0, 0.0), ("translation.z", 0.0, 0.0)],
    ),
];

/// What the library does not know: name, scene, what it is, and its size at amplitude one.
const UNKNOWN: &[(&str, &str, Kind, f64)] = &[
    ("magnet", "rod", Kind::Magnet { at: v(0.24, 0.1, 0.02) }, 3e3),
    ("magnet", "bar", Kind::Magnet { at: v(0.1, 0.05, 0.0) }, 3e3),
    ("magnet", "pea", Kind::Magnet { at: v(0.15, 0.2, 0.1) }, 4e3),
    ("magnet", "slab", Kind::Magnet { at: v(0.05, 0.12, 0.0) }, 3e3),
    ("thread", "rod", Kind::Thread { on: v(0.2, 0.0, 0.115), towards: v(0.2, 0.4, 0.3), until: 0.24 }, 0.05),
    ("thread", "pea", Kind::Thread { on: v(0.0, 0.0, 0.11), towards: v(0.3, 0.3, 0.3), until: 0.15 }, 0.5),
    ("thread", "pillar", Kind::Thread { on: v(0.0, 0.0, 0.12), towards: v(-0.3, 0.3, 0.3), until: 0.16 }, 0.1),
    ("swelling", "rod", Kind::Swelling { side: v(0.0, 0.0, 1.0), time: 0.5 }, 0.01),
    ("swelling", "slab", Kind::Swelling { side: v(0.0, 1.0, 0.0), time: 0.4 }, 0.01),
    ("swelling", "pea", Kind::Swelling { side: v(1.0, 0.0, 0.3), time: 0.3 }, 0.05),
    ("actuator", "rod", Kind::Actuator { side: v(0.0, 1.0, 0.0), frequency: 4.0 }, 0.01),
    ("actuator", "bar", Kind::Actuator { side: v(0.0, 0.0, 1.0), frequency: 5.0 }, 0.01),
    ("actuator", "pillar", Kind::Actuator { side: v(1.0, 0.0, 0.0), frequency: 6.0 }, 0.02),
    ("actuator", "slab", Kind::Actuator { side: v(0.0, 1.0, 0.0), frequency: 5.0 }, 0.01),
    ("runner", "rod", Kind::Runner { from: v(0.06, 0.0, 0.115), to: v(0.19, 0.0, 0.115), frequency: 2.5 }, 0.02),
    ("runner", "slab", Kind::Runner { from: v(-0.06, 0.0, 0.02), to: v(0.06, 0.0, 0.02), frequency: 4.0 }, 0.05),
    ("heave", "pea", Kind::Heave { frequency: 3.0 }, 0.004),
    ("vortex", "pea", Kind::Vortex { about: v(0.1, 0.0, 0.05), axis: v(0.0, 0.0, 1.0) }, 40.0),
    ("vortex", "slab", Kind::Vortex { about: v(0.0, 0.0, 0.05), axis: v(0.0, 0.0, 1.0) }, 60.0),
    ("turning", "rod", Kind::Turning { axis: v(0.0, 0.0, 1.0) }, 0.3),
    ("turning", "pea", Kind::Turning { axis: v(1.0, 0.0, 0.0) }, 0.4),
    ("turning", "pillar", Kind::Turning { axis: v(0.0, 1.0, 0.0) }, 0.5),
    ("hardening", "rod", Kind::Hardening, 0.5),
    ("hardening", "pillar", Kind::Hardening, 1.0),
    ("patch", "rod", Kind::Patch { on: v(0.16, 0.0, 0.13), until: 0.22 }, 4.0),
    ("patch", "pea", Kind::Patch { on: v(-0.01, 0.0, 0.01), until: 0.18 }, 20.0),
    ("patch", "pillar", Kind::Patch { on: v(0.0, 0.0, 0.12), until: 0.15 }, 10.0),
    ("shaking", "rod", Kind::Shaking { along: v(0.0, 1.0, 0.0), frequency: 5.0 }, 0.001),
    ("shaking", "bar", Kind::Shaking { along: v(0.0, 0.0, 1.0), frequency: 6.0 }, 0.001),
    ("shaking", "pillar", Kind::Shaking { along: v(1.0, 0.0, 0.0), frequency: 8.0 }, 0.001),
    ("gusts", "rod", Kind::Gusts { along: v(0.0, 1.0, 0.0), frequency: 4.0 }, 400.0),
    ("gusts", "slab", Kind::Gusts { along: v(0.3, 1.0, 0.0), frequency: 6.0 }, 500.0),
    ("drift", "bar", Kind::Drift { along: v(0.5, 1.0, 0.0) }, 0.01),
    ("drift", "slab", Kind::Drift { along: v(0.0, 1.0, 0.3) }, 0.01),
    ("ripple", "bar", Kind::Ripple { pixels: 7.0 }, 0.003),
];

/// Puts something that is hidden in a scene into a change; its numbers. `None` where no line says how.
pub fn apply(what: &str, scene: &str, amplitude: f64, change: &mut Change) -> Option<Vec<Number>> {
    if let Some((.., put, numbers)) = KNOWN.iter().find(|k| k.0 == what && k.1 == scene) {
        put(change, amplitude);
        let number = |(path, truth, absent): (&str, f64, f64)| Number { path: path.into(), truth, absent, scale: 1.0 };
        return Some(numbers(amplitude).into_iter().map(number).collect());
    }
    let (.., kind, size) = UNKNOWN.iter().find(|k| k.0 == what && k.1 == scene)?;
    change.outside = Some(Outside { kind: *kind, size: amplitude * size });
    Some(Vec::new())
}

/// Where a magnet stands beside a scene [m].
pub fn pole(scene: &str) -> Option<DVec3> {
    UNKNOWN.iter().find(|k| k.0 == "magnet" && k.1 == scene).and_then(|k| match k.2 {
        Kind::Magnet { at } => Some(at),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::super::list::List;
    use super::*;
    use crate::suite::case::Simulator;

    /// A line that no case uses, or a case that no line tells how to make, is a mistake.
    #[test]
    fn every_line_is_a_case_and_every_case_has_its_lines() {
        let all = List::read().unwrap().cases().unwrap();
        let of: Vec<_> = all.iter().filter(|c| c.simulator == Simulator::Tetrahedra).collect();
        for (what, scene) in KNOWN.iter().map(|k| (k.0, k.1)).chain(UNKNOWN.iter().map(|k| (k.0, k.1))) {
            assert!(of.iter().any(|c| c.scene == scene && c.hidden.iter().any(|h| h.what == what)), "{what} {scene}");
        }
        for c in of {
            for h in &c.hidden {
                let mut change = Change::default();
                assert!(apply(&h.what, &c.scene, 1.0, &mut change).is_some(), "{}", c.name);
                assert_ne!(change, Change::default(), "{}", c.name);
            }
        }
    }
}
