//! What a fit compares with what, as one number: journals and batches go on only with what they were begun with.

use palpate_model::plan::Plan;

/// Where [`fnv1a`] begins.
pub(crate) const FNV_START: u64 = 0xcbf2_9ce4_8422_2325;

/// FNV-1a of some more bytes.
pub(crate) fn fnv1a(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// Identifies what a plan compares with what, up to the values of θ: FNV-1a over everything that enters the cost.
pub(crate) fn fingerprint(plan: &Plan) -> String {
    let mut hash = FNV_START;
    let mut eat = |x: u64| hash = fnv1a(hash, &x.to_le_bytes());
    let o = &plan.observation;
    let noise: Vec<f64> = o.channels.iter().flat_map(|c| [c.kind as usize as f64, c.noise, c.systematic]).collect();
    let numbers = [plan.band, plan.clock.step, plan.clock.theta, plan.body.length, plan.body.volume];
    noise.iter().chain(&numbers).for_each(|x| eat(x.to_bits()));
    [plan.clock.steps, plan.body.nodes.len(), plan.clamps.len(), plan.masses.len()].iter().for_each(|n| eat(*n as u64));
    plan.body.nodes.iter().chain([&plan.pivot]).for_each(|p| p.to_array().iter().for_each(|x| eat(x.to_bits())));
    plan.body.node_volume.iter().for_each(|x| eat(x.to_bits()));
    // The laws of effects, sensors among them, by name: places in a table may move between versions.
    let laws: Vec<&str> = plan.layout.effects().map(|(law, _)| law.kind).collect();
    let texts = [
        format!("{:?} {:?} {:?} {:?}", plan.solver, plan.initial, plan.planes, plan.clamps),
        format!("{:?} {:?} {:?} {laws:?}", plan.masses, o.markers, o.cameras),
    ];
    texts.iter().for_each(|t| t.bytes().for_each(|b| eat(u64::from(b))));
    // What a field does is told by the factors of unequal values.
    for f in &plan.fields {
        f.varied.path().bytes().for_each(|b| eat(u64::from(b)));
        let unequal: Vec<f64> = (0..f.count).map(|k| 1.0 + (k % 7) as f64).collect();
        f.factors(&unequal).iter().for_each(|x| eat(x.to_bits()));
    }
    for path in plan.followed.iter().flatten() {
        path.times.iter().chain(path.points.iter().flat_map(|p| p.as_ref())).for_each(|x| eat(x.to_bits()));
    }
    for sites in plan.driven.iter().flatten() {
        let places = sites.rest.iter().chain(&sites.series.vectors).flat_map(|p| p.as_ref());
        sites.series.times.iter().chain(places).for_each(|x| eat(x.to_bits()));
    }
    for moving in plan.moving.iter().flatten() {
        let m = &moving.motion;
        let places = m.translations.iter().chain([&moving.axis]).flat_map(|p| p.to_array());
        let numbers = m.times.iter().copied().chain(places).chain(m.rotations.iter().flat_map(|q| q.to_array()));
        numbers.for_each(|x| eat(x.to_bits()));
        let surface = moving.shape.iter().flat_map(|s| &s.surface.vertices).flat_map(|p| p.to_array());
        surface.for_each(|x| eat(x.to_bits()));
    }
    plan.times.iter().for_each(|t| eat(t.to_bits()));
    for f in &o.frames {
        eat(f.time.to_bits());
        f.noise.iter().chain(&f.drift).for_each(|x| eat(x.to_bits()));
        for p in &f.points {
            p.position.to_array().iter().for_each(|x| eat(x.to_bits()));
            eat(u64::from(p.camera));
        }
        for m in &f.markers {
            m.position.to_array().iter().for_each(|x| eat(x.to_bits()));
            eat(u64::from(m.site));
        }
        for d in &f.displacements {
            d.value.to_array().iter().for_each(|x| eat(x.to_bits()));
            eat(u64::from(d.node));
        }
    }
    format!("{hash:016x}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::Experiment;
    use glam::DVec3;
    use palpate_model::effects::ALL;
    use palpate_model::observation::{Camera, Observation};
    use std::sync::Arc;

    fn ball() -> Plan {
        let text = r#"
            format = "scene/1"
            [object]
            shape = { ball = { radius = 0.05, center = [0, 0, 0.3] } }
            cell_size = 0.025
            [material]
            density = 1000.0
            youngs_modulus = 2.0e4
            poisson_ratio = 0.4
            [time]
            step = 0.01
            steps = 2
            "#;
        Experiment::from_toml(text, "ball.toml").unwrap_or_else(|e| panic!("{e}")).plan().clone()
    }

    #[test]
    fn every_law_has_a_fingerprint_of_its_own_and_values_have_none() {
        let plain = ball();
        let mut known = vec![fingerprint(&plain)];
        for (number, law) in ALL.iter().enumerate() {
            let mut plan = plain.clone();
            plan.layout = palpate_model::params::Layout::new(plain.planes.len(), plain.masses.len(), &[number], &[]);
            let found = fingerprint(&plan);
            assert!(!known.contains(&found), "{} goes unnoticed", law.kind);
            known.push(found);
        }
        let mut stiffer = plain.clone();
        stiffer.theta[0] *= 2.0;
        assert_eq!(fingerprint(&stiffer), known[0]);
    }

    #[test]
    fn a_camera_that_is_moved_or_turned_is_another_recording() {
        let plan = ball();
        let with = |center: DVec3, axis: DVec3| {
            let observation = Observation { cameras: vec![Camera::Pinhole { center, axis }], ..(*plan.observation).clone() };
            fingerprint(&Plan { observation: Arc::new(observation), ..plan.clone() })
        };
        let all = [with(DVec3::ZERO, DVec3::Y), with(DVec3::ZERO, DVec3::Z), with(DVec3::X, DVec3::Y)];
        assert!(all[0] != all[1] && all[0] != all[2] && all[1] != all[2], "{all:?}");
    }
}
