//! Every cost by itself: derivatives against central differences, transposes against products.

use super::*;
use crate::collapse_tests::scene;
use palpate_model::cutcells::build::SUBDIVISIONS;
use palpate_model::effects::{Effect, find};
use palpate_model::observation::*;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::{Analytic, BodySource, ObservationSpec};

/// Numbers in [-1, 1], reproducible.
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        2.0 * (self.0 >> 11) as f64 / (1u64 << 53) as f64 - 1.0
    }

    pub(crate) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

/// An effect on the measurement with all its numbers away from zero.
fn effect(kind: &str, values: &[f64]) -> Effect {
    let mut effect = Effect::absent(find(kind).expect("the effect exists"));
    effect.values.iter_mut().zip(values).for_each(|(slot, v)| *slot = Some(*v));
    effect
}

/// A block that was seen by every kind of sensor a few times; effects on the measurement act on depth, markers and the clock.
pub(crate) fn seen() -> Plan {
    let mut s = scene(5e4);
    s.object.source = BodySource::Analytic(Analytic::Box { min: DVec3::new(0.003, 0.0, 0.1), max: DVec3::new(0.1, 0.06, 0.163) });
    s.time.steps = 3;
    s.effects = vec![
        effect("depth-bias", &[0.001]),
        effect("depth-scale", &[0.002]),
        effect("marker-offset", &[0.0, 1e-3, -2e-3, 3e-3]),
        effect("time-offset", &[1e-3]),
    ];
    let body = build_plan(&s, Observation::default(), &[]).unwrap().body.clone();
    let mut noise = Noise(11);
    let tracks = [DVec3::new(0.05, 0.03, 0.163), DVec3::new(0.03, 0.0, 0.12), DVec3::new(0.1, 0.04, 0.13)].to_vec();
    let rest =
        MarkerRest { name: "m".into(), position: DVec3::new(0.052, 0.028, 0.175), surface: Some(DVec3::new(0.05, 0.03, 0.163)) };
    let frames = [0.4, 1.3, 2.2].map(|step| {
        let points =
            body.patches.iter().step_by(3).map(|p| ObservedPoint { position: p.point + 1e-3 * noise.vector(), camera: 0 });
        let points = points.collect();
        let at = |noise: &mut Noise, site: u32, place: DVec3| ObservedMarker { site, position: place + 2e-3 * noise.vector() };
        let mut markers = vec![at(&mut noise, 0, rest.position)];
        markers.extend((1..).zip(&tracks).map(|(site, p)| at(&mut noise, site, *p)));
        let node = |noise: &mut Noise, node: u32| ObservedDisplacement { node, value: 1e-3 * noise.vector() };
        let displacements = (0..body.nodes.len() as u32).step_by(5).map(|n| node(&mut noise, n)).collect();
        Frame { time: s.time.start + step * s.time.step, points, markers, displacements, ..Frame::default() }
    });
    let observation = Observation {
        channels: vec![
            Channel::new(ReadingKind::Depth, 1e-3),
            Channel::new(ReadingKind::Marker, 2e-3),
            Channel::new(ReadingKind::Track, 3e-3),
            Channel::new(ReadingKind::Displacement, 4e-3),
        ],
        cameras: vec![Camera::Pinhole { center: DVec3::new(0.05, -0.6, 0.5), axis: DVec3::new(0.0, 0.6, -0.36).normalize() }],
        frames: frames.to_vec(),
        tracks: TrackRest { places: tracks, tolerance: None },
        ..Observation::default()
    };
    build_plan(&s, observation, &[rest]).unwrap_or_else(|e| panic!("{e}"))
}

/// A smooth displacement [m].
fn bent(plan: &Plan, size: f64) -> Nodes {
    plan.body.nodes.iter().map(|x| size * DVec3::new((20.0 * x.y).sin(), x.x * 5.0, (15.0 * x.x).cos() * x.z)).collect()
}

/// Random directions in the numbers of measurement effects, `[Q]`, and changes of the displacement along them `[Q][N]`.
fn directions(plan: &Plan, count: usize) -> (Vec<Direction>, Vec<Nodes>) {
    let mut noise = Noise(3);
    let of_effects: Vec<usize> = plan.layout.effects().flat_map(|(_, range)| range).collect();
    let mut along = Vec::new();
    for q in 0..count {
        let mut d = vec![0.0; plan.layout.len()];
        of_effects.iter().for_each(|p| d[*p] = noise.next());
        along.push(if q == 0 { Direction::Parameter(of_effects[0]) } else { Direction::Dense(d) });
    }
    let du = (0..count).map(|_| plan.body.nodes.iter().map(|_| noise.vector()).collect()).collect();
    (along, du)
}

#[test]
fn derivatives_of_every_residual_are_those_of_differences() {
    let plan = seen();
    let costs = Costs::new(&plan, &plan.observation);
    let (along, du) = directions(&plan, 2);
    let u = bent(&plan, 1e-3);
    // Numbers that choose something (a marker) do not vary.
    let varies = |p: usize| plan.theta[p] != plan.theta[p].round() || plan.theta[p] != 0.0;
    let rows = |step: f64, q: usize| {
        let theta: Vec<f64> =
            (0..plan.theta.len()).map(|p| plan.theta[p] + if varies(p) { step * along[q].component(p) } else { 0.0 }).collect();
        let sensors = Sensors::new(&plan.layout, &theta);
        let moved = u.iter().zip(&du[q]).map(|(u, d)| *u + step * *d).collect();
        let look = Look { plan: &plan, observation: &plan.observation, sensors: &sensors, frame: 1 };
        costs.compare(look, moved).rows(look, Along { directions: &along, du: &du })
    };
    let far = |rest: DVec3| {
        let place = (rest - plan.body.cut().grid.position([0; 3])) * (SUBDIVISIONS as f64 / plan.body.cut().grid.h);
        (place - place.round()).abs().min_element() > 0.02
    };
    for q in 0..2 {
        let step = 1e-6;
        let (here, plus, minus) = (rows(0.0, q), rows(step, q), rows(-step, q));
        let mut compared = std::collections::BTreeMap::new();
        for (i, r) in here.residuals.iter().enumerate() {
            let (Some(a), Some(b)) = (plus.residuals[i].value, minus.residuals[i].value) else { continue };
            // Over a face of the distance's samples its slope jumps.
            if r.source.is_depth() && !far(r.rest) {
                continue;
            }
            let (found, right) = (here.sensitivity[2 * i + q], (a - b) / (2.0 * step));
            assert!((found - right).abs() < 1e-5, "{:?}: {found} and {right}", r.source);
            *compared.entry(r.source.sensor.kind()).or_insert(0) += 1;
        }
        println!("{compared:?}");
        assert!(compared.len() == 4 && compared.values().all(|n| *n >= 3), "{compared:?}");
    }
}

#[test]
fn vector_products_are_the_transpose_of_derivatives_of_every_cost() {
    let plan = seen();
    let sensors = Sensors::new(&plan.layout, &plan.theta);
    let look = Look { plan: &plan, observation: &plan.observation, sensors: &sensors, frame: 0 };
    let compared = Costs::new(&plan, &plan.observation).compare(look, bent(&plan, 1e-3));
    let (along, du) = directions(&plan, 3);
    let mut noise = Noise(5);
    for part in &compared.parts {
        let (mut factors, mut pushed) = (Vec::new(), vec![0.0; 3]);
        part.rows(look, &compared.u, Along { directions: &along, du: &du }, &mut |_, d| {
            let f = noise.next();
            factors.push(f);
            pushed.iter_mut().zip(d).for_each(|(sum, d)| *sum += f * d);
        });
        let (mut out, mut theta) = (vec![DVec3::ZERO; compared.u.len()], vec![0.0; plan.layout.len()]);
        part.pull(look, &compared.u, &factors, &mut out, &mut theta);
        for q in 0..3 {
            let by_u: f64 = out.iter().zip(&du[q]).map(|(a, b)| a.dot(*b)).sum();
            let by_theta: f64 = theta.iter().enumerate().map(|(p, t)| t * along[q].component(p)).sum();
            let size = pushed[q].abs().max(1.0);
            assert!((by_u + by_theta - pushed[q]).abs() < 1e-11 * size, "{by_u} + {by_theta}, {}", pushed[q]);
        }
    }
}

#[test]
fn products_are_those_with_the_gauss_newton_matrix() {
    let plan = seen();
    let sensors = Sensors::new(&plan.layout, &plan.theta);
    let look = Look { plan: &plan, observation: &plan.observation, sensors: &sensors, frame: 2 };
    let compared = Costs::new(&plan, &plan.observation).compare(look, bent(&plan, 1e-3));
    let (along, du) = directions(&plan, 3);
    let (mut gradient, mut matrix) = (vec![0.0; 3], vec![0.0; 9]);
    let scale = 1.0 / plan.observation.residuals() as f64;
    compared.gauss_newton(look, Along { directions: &along, du: &du }, scale, &mut gradient, &mut matrix);
    for v in [[1.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.3, -1.2, 0.7]] {
        let dense = (0..plan.layout.len()).map(|p| (0..3).map(|q| v[q] * along[q].component(p)).sum()).collect();
        let moved = (0..compared.u.len()).map(|i| (0..3).map(|q| v[q] * du[q][i]).sum()).collect();
        let mut theta = vec![0.0; plan.layout.len()];
        let along_v = Along { directions: &[Direction::Dense(dense)], du: &[moved] };
        let out = compared.product(look, along_v, scale, &mut theta);
        for a in 0..3 {
            let right: f64 = (0..3).map(|b| matrix[3 * a + b] * v[b]).sum();
            let found = out.iter().zip(&du[a]).map(|(g, d)| g.dot(*d)).sum::<f64>()
                + theta.iter().enumerate().map(|(p, t)| t * along[a].component(p)).sum::<f64>();
            assert!((found - right).abs() < 1e-11 * matrix[0].abs().max(matrix[8].abs()), "{v:?}: {found} and {right}");
        }
    }
}

#[test]
fn without_a_line_of_sight_the_nearest_side_counts() {
    let mut s = scene(5e4);
    let h = build_plan(&s, Observation::default(), &[]).unwrap().body.length;
    let (min, max) = (h * DVec3::new(-4.0, -4.0, -1.5), h * DVec3::new(4.0, 4.0, 0.0));
    s.object.source = BodySource::Analytic(Analytic::Box { min, max });
    s.observation = Some(ObservationSpec::new("", vec![ReadingKind::Depth]));
    // A point a fifth of a cell above the bottom of a plate that is seen from above.
    let distance = |camera: Camera| {
        let points = vec![ObservedPoint { position: h * DVec3::new(0.1, 0.2, -1.3), camera: 0 }];
        let frames = vec![Frame { time: s.time.start, points, ..Frame::default() }];
        let channels = vec![Channel::new(ReadingKind::Depth, 0.01 * h)];
        let observation = Observation { cameras: vec![camera], frames, channels, ..Observation::default() };
        let plan = build_plan(&s, observation, &[]).unwrap_or_else(|e| panic!("{e}"));
        let look = Look { plan: &plan, observation: &plan.observation, sensors: &Sensors::default(), frame: 0 };
        let found = depth::Depth::new(&plan, &plan.observation).matches(look, &vec![DVec3::ZERO; plan.body.nodes.len()]);
        found[0].place.phi / h
    };
    let center = h * DVec3::new(0.0, 0.0, 500.0);
    let (front, back) = (distance(Camera::Pinhole { center, axis: DVec3::NEG_Z }), distance(Camera::Unknown));
    // The band interpolates the distance within cells: exact where a plane is nearest, as here.
    assert!((front + 1.3).abs() < 1e-3 && (back + 0.2).abs() < 1e-3, "{front} {back}");
    assert_eq!(distance(Camera::Scanner { center }), front);
}
