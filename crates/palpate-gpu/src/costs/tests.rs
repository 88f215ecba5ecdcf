//! Observation kernels against the CPU's passes, on given motions: several cameras, empty frames, frames between steps, before the
//! start and after the end, markers on stalks, points outside the band, observed nodes.

use super::{MOST_LOOPS, Observer, Room, Seen};
use crate::GpuBackend;
use crate::tests::scenes::{ball, device};
use crate::world::{State, World};
use glam::{DQuat, DVec3};
use palpate_cpu::costs::{Along, Costs, Look, blend};
use palpate_engine::{Backend, Direction, Evaluation, ParamBatch, Request};
use palpate_model::effects::Effect;
use palpate_model::effects::sensors::Sensors;
use palpate_model::observation::instant::instants;
use palpate_model::observation::{
    Camera, Channel, Frame, MarkerRest, Observation, ObservedDisplacement, ObservedMarker, ObservedPoint, ReadingKind,
};
use palpate_model::params::ParamKey;
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::{Analytic, BodySource, ObservationSpec, Resolution, Scene};

/// Cost, sums and derivatives agree to this much of their size. Rounding of φ is some 1e-7 of a cell, 1e-6 of a residual of a tenth
/// of a cell, slopes over a quarter of a cell have four times that; where a thousand terms of both signs nearly cancel, ten to a hundred
/// times that.
const AGREEMENT: f64 = 2e-4;

/// Reproducible numbers in [-1, 1].
pub(super) struct Noise(pub(super) u64);

impl Noise {
    pub(super) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub(super) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

/// Displacement of a rest place at a time: a fall, a turn, a stretch and a bend; members differ by `size`.
pub(super) fn motion(size: f64, t: f64, x: DVec3) -> DVec3 {
    let c = x - DVec3::new(0.0, 0.0, 0.05);
    let turn = DQuat::from_scaled_axis(DVec3::new(0.4, 1.0, -0.3) * (0.3 + 6.0 * t * size));
    let bent = c + DVec3::new(0.05 * c.x, -0.04 * c.y, 0.08 * c.z) * size + DVec3::new(c.z * c.z, c.x * c.z, c.x * c.y) * 2.0 * t;
    turn * bent - c + DVec3::new(1.3 + 0.5 * t, -0.2, 0.4 - 2.0 * t - 5.0 * t * t)
}

pub(super) fn velocity(size: f64, t: f64, x: DVec3) -> DVec3 {
    (motion(size, t + 1e-6, x) - motion(size, t - 1e-6, x)) / 2e-6
}

/// Start of each member on the recording's clock [s], and how it differs.
pub(super) const MEMBERS: [(f64, f64); 3] = [(0.05, 1.0), (0.0437, 0.9), (0.0621, 1.15)];

/// Frames of a scene; `steps` of 10 ms from 0.05 s on.
pub(super) fn observed(scene: &Scene, rest: &[MarkerRest], per_patch: usize) -> Plan {
    let bare = build_plan(scene, Observation::default(), rest).unwrap_or_else(|e| panic!("{e}"));
    let body = &bare.body;
    let mut noise = Noise(7);
    let centers = [DVec3::new(2.3, 0.3, 1.2), DVec3::new(0.4, -0.9, 0.9), DVec3::new(1.2, 0.5, -0.7)];
    let cameras =
        centers.map(|center| Camera::Pinhole { center, axis: (DVec3::new(1.3, -0.2, 0.4) - center).normalize() }).to_vec();
    let h = body.cut().grid.h;
    let points = |time: f64, noise: &mut Noise| -> Vec<ObservedPoint> {
        let at = time - 0.05;
        let mut all = Vec::new();
        for p in &body.patches {
            for _ in 0..per_patch {
                let x = p.point + 0.4 * h * (noise.vector() - p.normal * noise.vector().dot(p.normal));
                let position = x + motion(1.0, at, x) + 0.25 * h * noise.vector();
                all.push(ObservedPoint { position, camera: (all.len() % 3) as u32 });
            }
        }
        // Some far away from the band, one of them very far.
        all.push(ObservedPoint { position: DVec3::new(1.3, -0.2, 1.4), camera: 1 });
        all.push(ObservedPoint { position: DVec3::new(60.0, -30.0, 9.0), camera: 0 });
        all
    };
    let markers = |time: f64, noise: &mut Noise, which: &[u32]| -> Vec<ObservedMarker> {
        let of = |&site: &u32| {
            let p = rest[site as usize].position;
            ObservedMarker { site, position: p + motion(1.05, time - 0.05, p) + 0.1 * h * noise.vector() }
        };
        which.iter().map(of).collect()
    };
    // Before the start, on a boundary, between (two in one step), empty, nodes, after the end.
    let (a, b, c) = (0.03, 0.06, 0.0634);
    let stalks: &[u32] = if rest.is_empty() { &[] } else { &[2, 0, 1] };
    let frames = vec![
        Frame { time: a, points: points(a, &mut noise), markers: markers(a, &mut noise, stalks), ..Frame::default() },
        Frame { time: b, points: points(b, &mut noise), ..Frame::default() },
        Frame {
            time: c,
            points: points(c, &mut noise),
            markers: markers(c, &mut noise, &stalks[..stalks.len() / 2]),
            ..Frame::default()
        },
        Frame { time: 0.0655, ..Frame::default() },
        Frame { time: 0.0671, markers: markers(0.0671, &mut noise, stalks), ..Frame::default() },
        Frame {
            time: 0.0723,
            displacements: ObservedDisplacement::of_all(
                body.nodes.iter().map(|x| motion(1.0, 0.0223, *x) + 0.1 * h * noise.vector()),
            ),
            ..Frame::default()
        },
        Frame { time: 0.2, points: points(0.08, &mut noise), ..Frame::default() },
    ];
    let observation = Observation {
        cameras,
        frames,
        channels: vec![
            Channel::new(ReadingKind::Depth, 0.05 * h),
            Channel::new(ReadingKind::Marker, 0.08 * h),
            Channel::new(ReadingKind::Displacement, 0.1 * h),
        ],
        ..Observation::default()
    };
    build_plan(scene, observation, rest).unwrap_or_else(|e| panic!("{e}"))
}

pub(super) fn scene(source: Analytic, h: f64) -> Scene {
    let mut s = ball(h);
    s.object.source = BodySource::Analytic(source);
    s.object.resolution = Resolution::CellSize(h);
    s.masses.clear();
    s.time.steps = 3;
    s.observation = Some(ObservationSpec { band: 2.0, ..ObservationSpec::new("recording", vec![ReadingKind::Depth]) });
    s
}

/// A ball with three markers, two of them on stalks, one surface point twice.
pub(super) fn ball_plan() -> Plan {
    ball_plan_with(Vec::new())
}

/// The same with effects.
pub(super) fn ball_plan_with(effects: Vec<Effect>) -> Plan {
    let center = DVec3::new(0.003, 0.001, 0.051);
    let marker = |name: &str, way: DVec3, length: f64| {
        let way = way.normalize();
        let surface = Some(center + 0.05 * way);
        MarkerRest { name: name.into(), position: center + (0.05 + length) * way, surface }
    };
    let rest =
        [marker("a", DVec3::X, 0.02), marker("b", DVec3::new(0.2, 1.0, 0.3), 0.0), marker("c", DVec3::new(1.0, 0.1, 0.9), 0.05)];
    observed(&Scene { effects, ..scene(Analytic::Ball { radius: 0.05, center }, 0.021) }, &rest, 3)
}

/// Numbers that are compared, and their name.
pub(super) type Part = (&'static str, Vec<f64>);
/// Everything that is compared.
pub(super) type Outcome = Vec<Part>;

fn flat(v: &[DVec3]) -> impl Iterator<Item = f64> + '_ {
    v.iter().flat_map(|v| v.to_array())
}

/// Derivatives of the state after k steps along direction q.
fn tangent(q: usize, k: usize, x: DVec3) -> [DVec3; 2] {
    let w = DVec3::new((30.0 * x.x + q as f64).sin(), (20.0 * x.z).cos() + 0.1 * k as f64, (25.0 * x.y - 2.0 * q as f64).sin());
    [0.01 * w, 0.5 * DVec3::new(w.y, w.z, w.x)]
}

/// Places in θ of the directions: two that only move the state, and the start.
fn directions(plan: &Plan) -> Vec<usize> {
    [ParamKey::YoungsModulus, ParamKey::TimeStart, ParamKey::Density].map(|k| plan.layout.index(k)).to_vec()
}

fn outcome(plan: &Plan, e: &Evaluation, adjoint: Vec<f64>) -> Outcome {
    let c = e.curvature.clone().unwrap_or_default();
    vec![
        ("cost", vec![e.cost]),
        ("matched", vec![e.matched as f64]),
        ("sum of squares", vec![e.sum_squares]),
        ("signed sum", vec![e.sum_signed]),
        ("gradient by the start", vec![e.gradient[plan.layout.index(ParamKey::TimeStart)]]),
        ("adjoint", adjoint),
        ("Gauss–Newton gradient", c.gradient),
        ("Gauss–Newton matrix", c.matrix),
    ]
}

/// The CPU's answer for one member.
pub(super) fn expected(plan: &Plan, member: usize) -> Outcome {
    let (start, size) = MEMBERS[member];
    let nodes = &plan.body.nodes;
    let (costs, sensors) = (Costs::new(plan, &plan.observation), Sensors::default());
    let scale = 1.0 / plan.observation.residuals() as f64;
    let keys = directions(plan);
    let along: Vec<Direction> = keys.iter().copied().map(Direction::Parameter).collect();
    let mut e = Evaluation { gradient: vec![0.0; plan.layout.len()], ..Evaluation::default() };
    let (mut gn, mut matrix) = (vec![0.0; 3], vec![0.0; 9]);
    let mut adjoint = Vec::new();
    let at = plan.layout.index(ParamKey::TimeStart);
    for k in 0..plan.clock.steps {
        let state = |k: usize| -> [Vec<DVec3>; 2] {
            let t = k as f64 * plan.clock.step;
            [nodes.iter().map(|x| motion(size, t, *x)).collect(), nodes.iter().map(|x| velocity(size, t, *x)).collect()]
        };
        let (a, b) = (state(k), state(k + 1));
        let ends = [&a[0][..], &a[1], &b[0], &b[1]];
        let mut adj = vec![vec![DVec3::ZERO; nodes.len()]; 4];
        for i in instants(&plan.recording(0), plan.clock.step, start, k) {
            let look = Look { plan, observation: &plan.observation, sensors: &sensors, frame: i.frame };
            let compared = costs.compare(look, blend(&i.value, ends));
            e.cost += scale * compared.sums.cost;
            e.matched += compared.sums.matched;
            e.sum_squares += compared.sums.squares;
            e.sum_signed += compared.sums.signed;
            let mut unused = vec![0.0; plan.layout.len()];
            let g = compared.gradient(look, scale, &mut unused);
            let rate = blend(&i.rate, ends);
            e.gradient[at] -= g.iter().zip(&rate).map(|(g, r)| g.dot(*r)).sum::<f64>();
            for (sum, factor) in adj.iter_mut().zip(i.value) {
                sum.iter_mut().zip(&g).for_each(|(s, g)| *s += factor * *g);
            }
            let du: Vec<Vec<DVec3>> = (0..3)
                .map(|q| {
                    let of = |k: usize, part: usize| nodes.iter().map(|x| tangent(q, k, *x)[part]).collect::<Vec<_>>();
                    let mut d = blend(&i.value, [&of(k, 0), &of(k, 1), &of(k + 1, 0), &of(k + 1, 1)]);
                    if keys[q] == at {
                        d.iter_mut().zip(&rate).for_each(|(d, r)| *d -= *r);
                    }
                    d
                })
                .collect();
            compared.gauss_newton(look, Along { directions: &along, du: &du }, scale, &mut gn, &mut matrix);
        }
        adjoint.extend(adj.iter().flat_map(|v| flat(v).collect::<Vec<_>>()));
    }
    e.curvature = Some(palpate_engine::Curvature { gradient: gn, matrix });
    outcome(plan, &e, adjoint)
}

fn single(v: DVec3) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, 0.0]
}

/// The state of all members after k steps: u as a multiple of a power of two and the rest, v.
pub(super) fn upload(world: &World, k: usize) -> State {
    let state = State(world.lend(3));
    let plan = &world.plan;
    let quantum = (0.25 * plan.body.cut().grid.h).log2().floor().exp2();
    let mut parts = [Vec::new(), Vec::new(), Vec::new()];
    for (_, size) in &MEMBERS[..world.members()] {
        for x in &plan.body.nodes {
            let t = k as f64 * plan.clock.step;
            let u = motion(*size, t, *x);
            let whole = (u / quantum).round() * quantum;
            parts[0].push(single(whole));
            parts[1].push(single(u - whole));
            parts[2].push(single(velocity(*size, t, *x)));
        }
    }
    world.gpu.queue.write_buffer(&state.0.buffer, 0, bytemuck::cast_slice(&parts.concat()));
    state
}

/// The device's answer for `members` members.
pub(super) fn found(backend: &GpuBackend, plan: &Plan, members: usize, room: Option<Room>) -> Vec<Outcome> {
    let mut world = backend.build(plan, members).unwrap_or_else(|e| panic!("{e}"));
    if let Some(room) = room {
        world.observer = Observer::within(&world.gpu, plan, members, room).unwrap_or_else(|e| panic!("{e}"));
    }
    let rows: Vec<Vec<f64>> = MEMBERS[..members]
        .iter()
        .map(|m| {
            let mut theta = plan.theta.clone();
            theta[plan.layout.index(ParamKey::TimeStart)] = m.0;
            theta
        })
        .collect();
    backend.set_params(&mut world, &ParamBatch::from_rows(&rows));
    let keys = directions(plan);
    let mut tally = backend.new_tally(&world, &Request { sensitivities: keys.to_vec(), ..Request::default() });
    let n = plan.body.nodes.len();
    let mut adjoints = vec![Vec::new(); members];
    let tangents = |k: usize| {
        let t = backend.new_tangent(&world, &Direction::parameters(&keys));
        for (q, part) in t.parts.iter().enumerate() {
            let of = |i: usize| plan.body.nodes.iter().map(move |x| single(tangent(q, k, *x)[i]));
            let all: Vec<[f32; 4]> = (0..2).flat_map(|i| (0..members).flat_map(move |_| of(i))).collect();
            world.gpu.queue.write_buffer(&part.buffer, 0, bytemuck::cast_slice(&all));
        }
        t
    };
    for k in 0..plan.clock.steps {
        let (now, next) = (upload(&world, k), upload(&world, k + 1));
        backend.observe(&world, k, &now, &next, &mut tally);
        backend.observe_tangent(&world, k, &now, &next, &tangents(k), &tangents(k + 1), &mut tally);
        let (mut adj, mut adj_now) = (backend.new_adjoint(&world), backend.new_adjoint(&world));
        backend.observe_adjoint(&world, k, &now, &next, &mut adj, &mut adj_now, &mut tally);
        for side in [&adj_now, &adj] {
            let all: Vec<[f32; 4]> = world.gpu.download(&side.0.buffer, 2 * members * n).unwrap_or_else(|e| panic!("{e}"));
            for part in 0..2 {
                for (m, out) in adjoints.iter_mut().enumerate() {
                    let at = (part * members + m) * n;
                    out.extend(all[at..at + n].iter().flat_map(|v| [v[0], v[1], v[2]]).map(f64::from));
                }
            }
        }
    }
    let all = backend.read(&world, &tally);
    all.iter().zip(adjoints).map(|(e, a)| outcome(plan, e, a)).collect()
}

/// What differs by more than the agreed part of its size, with that part.
pub(super) fn differences(a: &Outcome, b: &Outcome) -> Vec<(&'static str, f64)> {
    let off = |(x, y): (&Part, &Part)| {
        assert_eq!((x.0, x.1.len()), (y.0, y.1.len()));
        let size = y.1.iter().fold(1e-30, |s: f64, v| s.max(v.abs()));
        let worst =
            x.1.iter().zip(&y.1).map(|(x, y)| (x - y).abs()).fold(0.0, |w: f64, d| if d > w || d.is_nan() { d } else { w });
        (x.0, worst / size)
    };
    let all: Vec<_> = a.iter().zip(b).map(off).collect();
    println!("{}", all.iter().map(|(name, d)| format!("{name} {d:.1e}")).collect::<Vec<_>>().join(", "));
    // Not a number is a difference as well.
    all.into_iter().filter(|d| d.1.is_nan() || d.1 > AGREEMENT).collect()
}

#[test]
fn cost_and_derivatives_are_those_of_the_cpu_and_one_percent_shows() {
    let Some(gpu) = device(None) else { return };
    let backend = GpuBackend::on(gpu);
    let plan = ball_plan();
    let all = found(&backend, &plan, 3, None);
    for (m, found) in all.iter().enumerate() {
        let right = expected(&plan, m);
        assert!(right.iter().all(|(_, v)| v.iter().any(|x| *x != 0.0) && !v.is_empty()), "{m}: something is not tested");
        let off = differences(found, &right);
        assert!(off.is_empty(), "member {m}: {off:?}");
        // Wrong by one percent in one place of any of them, the comparison fails.
        for i in 0..found.len() {
            let mut wrong = found.clone();
            let v = &mut wrong[i].1;
            let place = (0..v.len()).max_by(|a, b| v[*a].abs().total_cmp(&v[*b].abs())).unwrap_or(0);
            v[place] *= 1.01;
            assert_eq!(differences(&wrong, &right).len(), 1, "{} wrong by 1 % was not seen", wrong[i].0);
        }
    }
    // The same bits again; alone; and with work cut into many parts.
    assert_eq!(found(&backend, &plan, 3, None), all);
    assert_eq!(found(&backend, &plan, 1, None)[0], all[0]);
    let small = found(&backend, &plan, 3, Some(Room { points: 64, scratch: 1 }));
    for (m, found) in small.iter().enumerate() {
        let off = differences(found, &expected(&plan, m));
        assert!(off.is_empty(), "in parts, member {m}: {off:?}");
    }
}

#[test]
fn loops_stay_bounded_and_strays_do_not_stretch_the_cubes() {
    let mut noise = Noise(3);
    let mut points: Vec<[f32; 3]> = (0..50_000).map(|_| (0.1 * noise.vector()).as_vec3().to_array()).collect();
    points.push([1e30, -1e9, 4.0]);
    let cubes = super::shots::Cubes::new(&points, 0.001);
    assert!(cubes.size.iter().all(|n| (2..=400).contains(n)), "{:?}", cubes.size);
    assert_eq!(*cubes.starts.last().unwrap_or(&0) as usize, points.len());
    let edge = 1.0 / cubes.inverse_edge;
    // 40 cubes across 0.2 m.
    assert!(edge < 0.0075, "{edge}");

    let plan = ball_plan();
    let (shots, band, sites) =
        (super::Shots::of(&plan, &[(0, Sensors::default())]), super::BandTables::new(&plan), super::SiteTables::new(&plan));
    let mut crowd = shots.clone();
    crowd.shots[0].cubes = [4000, 40, 40];
    let sight = |points: u32, stripes: u32| super::Sight {
        points,
        stripes,
        nodes: 1_000_000,
        rows: points,
        markers: 100,
        ..Default::default()
    };
    // A million points in the stripes that they get, the largest lattice of cubes, a million nodes.
    let longest = Seen::new(&sight(1_000_000, 50), &crowd, &band, &sites).loops();
    assert!(longest.iter().all(|l| l.1 <= MOST_LOOPS), "{longest:?}");
    // In one stripe they would be too many, and are refused.
    assert!(Seen::new(&sight(1_000_000, 1), &crowd, &band, &sites).check().is_err());
}
