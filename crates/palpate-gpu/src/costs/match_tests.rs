//! Which cell a point is matched with, against the CPU: where cells overlap, and where a lane has as many points as it may have.

use super::bounds::Seen;
use super::tests::{Noise, scene};
use super::{MOST_LOOPS, Observer, POINTS_OF_STRIPE, Room, SCRATCH};
use crate::GpuBackend;
use crate::device::Gpu;
use crate::device::GpuError;
use crate::device::pipelines::shared::structs::NONE;
use crate::layout::Found;
use crate::tests::scenes::device;
use crate::world::{State, World};
use glam::DVec3;
use palpate_cpu::costs::depth::Depth;
use palpate_cpu::costs::matching::extend;
use palpate_cpu::costs::{Costs, Look};
use palpate_engine::{Backend, ParamBatch, Request};
use palpate_model::cutcells::pullback::{TURNED_AWAY, pull_back};
use palpate_model::effects::sensors::Sensors;
use palpate_model::observation::{Camera, Channel, Frame, Observation, ObservedPoint, ReadingKind};
use palpate_model::plan::Plan;
use palpate_model::plan::build::build_plan;
use palpate_model::scene::Analytic;
use std::sync::Arc;

/// Edge of a cell [m]: a power of two, so that places on the lattice are exact in single precision.
const H: f64 = 1.0 / 32.0;

/// The plan of a box (in cells) whose points (in cells) a camera sees from `eye` before anything moves.
fn plan_of((min, max): (DVec3, DVec3), points: &[DVec3], eye: DVec3) -> Plan {
    let scene = scene(Analytic::Box { min: H * min, max: H * max }, H);
    let cameras = vec![Camera::Pinhole { center: H * eye, axis: -eye.normalize() }];
    let points = points.iter().map(|p| ObservedPoint { position: H * *p, camera: 0 }).collect();
    let frames = vec![Frame { time: scene.time.start - 0.01, points, ..Frame::default() }];
    let observation =
        Observation { cameras, frames, channels: vec![Channel::new(ReadingKind::Depth, 0.05 * H)], ..Observation::default() };
    build_plan(&scene, observation, &[]).unwrap_or_else(|e| panic!("{e}"))
}

/// Cell and distance [m] of every point, and dJ/du.
struct Matched {
    points: Vec<Option<(u32, f64)>>,
    gradient: Vec<DVec3>,
}

/// The CPU's answer for a displacement field.
fn right(plan: &Plan, u: &[DVec3]) -> Matched {
    let sensors = Sensors::default();
    let look = Look { plan, observation: &plan.observation, sensors: &sensors, frame: 0 };
    let mut points = vec![None; plan.observation.frames[0].points.len()];
    Depth::new(plan, &plan.observation)
        .matches(look, u)
        .iter()
        .for_each(|m| points[m.point as usize] = Some((m.cell, m.place.phi)));
    let scale = 1.0 / plan.observation.residuals() as f64;
    let compared = Costs::new(plan, &plan.observation).compare(look, u.to_vec());
    Matched { points, gradient: compared.gradient(look, scale, &mut vec![0.0; plan.layout.len()]) }
}

/// A body at rest, displaced by this.
fn laid(world: &World, u: &[DVec3]) -> State {
    let state = State(world.lend(3));
    let quantum = 0.25 * H;
    let parts = |u: &DVec3| {
        let whole = (*u / quantum).round() * quantum;
        [whole, *u - whole].map(|v| [v.x as f32, v.y as f32, v.z as f32, 0.0])
    };
    let mut all: Vec<[f32; 4]> = (0..2).flat_map(|i| u.iter().map(move |u| parts(u)[i])).collect();
    all.resize(3 * u.len(), [0.0; 4]);
    world.gpu.queue.write_buffer(&state.0.buffer, 0, bytemuck::cast_slice(&all));
    state
}

/// The device's answer, with work cut into such parts.
fn found(gpu: &Arc<Gpu>, plan: &Plan, u: &[DVec3], room: Room) -> Matched {
    let backend = GpuBackend::on(gpu.clone());
    let mut world = backend.build(plan, 1).unwrap_or_else(|e| panic!("{e}"));
    world.observer = Observer::within(gpu, plan, 1, room).unwrap_or_else(|e| panic!("{e}"));
    backend.set_params(&mut world, &ParamBatch::from_rows(std::slice::from_ref(&plan.theta)));
    let mut tally = backend.new_tally(&world, &Request::default());
    let (now, next) = (laid(&world, u), laid(&world, u));
    let (mut adj, mut adj_now) = (backend.new_adjoint(&world), backend.new_adjoint(&world));
    backend.observe_adjoint(&world, 0, &now, &next, &mut adj, &mut adj_now, &mut tally);
    let gradient: Vec<[f32; 4]> = gpu.download(&adj_now.0.buffer, u.len()).unwrap_or_else(|e| panic!("{e}"));
    let order = &world.observer.shots.point_order;
    let places: Vec<Found> = gpu.download(&world.observer.buffers["found"], order.len()).unwrap_or_else(|e| panic!("{e}"));
    let mut points = vec![None; order.len()];
    for (point, f) in order.iter().zip(&places).filter(|(_, f)| f.cell != NONE) {
        points[*point as usize] = Some((f.cell, f64::from(f.phi)));
    }
    Matched { points, gradient: gradient.iter().map(|g| DVec3::new(g[0].into(), g[1].into(), g[2].into())).collect() }
}

/// Largest difference of two gradients over the largest part of the second.
fn off(a: &[DVec3], b: &[DVec3]) -> f64 {
    let size = b.iter().fold(1e-30, |m: f64, v| m.max(v.length()));
    a.iter().zip(b).map(|(a, b)| (*a - *b).length() / size).fold(0.0, |w, d| if d > w || d.is_nan() { d } else { w })
}

/// All holders of a point, in their order.
fn holders(plan: &Plan, u: &[DVec3], point: &ObservedPoint) -> Vec<Holder> {
    let (body, all) = (&*plan.body, extend(&plan.body, u));
    let rest = |a: usize| if a < body.nodes.len() { body.nodes[a] } else { body.band.nodes[a - body.nodes.len()] };
    let line = plan.observation.cameras[0].line(point.position);
    let hold = |(c, cell): (usize, &palpate_model::cutcells::domain::BandCell)| {
        let place = pull_back(&cell.nodes.map(|a| rest(a as usize) + all[a as usize]), &cell.sdf, point.position)?;
        Some((c as u32, place.phi.abs(), place.gradient.dot(line) <= TURNED_AWAY * place.gradient.length()))
    };
    body.band.cells.iter().enumerate().filter_map(hold).collect()
}

/// The right part of a bar of 6 × 4 × 2 cells, pushed into the left one: the cells between are inside out and hold nothing.
const BAR: (DVec3, DVec3) = (DVec3::ZERO, DVec3::new(6.0, 4.0, 2.0));
/// Where its camera stands.
const ABOVE: DVec3 = DVec3::new(2.5, 2.0, 60.0);

fn pushed(plan: &Plan, by: impl Fn(DVec3) -> DVec3) -> Vec<DVec3> {
    plan.body.nodes.iter().map(|x| if x.x > 3.5 * H { H * by(*x / H) } else { DVec3::ZERO }).collect()
}

/// 9 × 8 × 9 places of the overlap, in cells, whose mean is exact as well; on faces of cells, or off them by `aside`.
fn overlap(z: [f64; 2], aside: f64) -> Vec<DVec3> {
    let along = |low: f64, high: f64, k: i32| low + (high - low) * f64::from(k) / 8.0;
    let place = |n: i32| {
        let y = 1.125 + 0.25 * f64::from(n / 9 % 8);
        DVec3::new(along(2.0 + aside, 3.0 - aside, n % 9), y, along(z[0], z[1], n / 72))
    };
    (0..648).map(place).collect()
}

/// A cell that holds a point: number, |φ|, whether the camera sees that side.
type Holder = (u32, f64, bool);

/// The least |φ| of the sides that the camera sees.
fn nearest(all: &[Holder]) -> f64 {
    all.iter().filter(|h| h.2).fold(f64::INFINITY, |m, h| m.min(h.1))
}

/// Matches of the device are those of the CPU, again and with points in many stripes, and so is the gradient; returns of how many
/// points `counts` is true, given all holders in their order.
fn compare(plan: &Plan, u: &[DVec3], counts: impl Fn(&[Holder]) -> bool) -> Option<usize> {
    let gpu = device(None)?;
    let whole = Room { points: POINTS_OF_STRIPE, scratch: SCRATCH };
    let right = right(plan, u);
    let [first, others @ ..] = [whole, whole, Room { points: 64, ..whole }].map(|room| found(&gpu, plan, u, room));
    assert!(others.iter().all(|f| f.points == first.points), "matches differ from run to run");
    let mut counted = 0;
    for (p, point) in plan.observation.frames[0].points.iter().enumerate() {
        let (all, at) = (holders(plan, u, point), point.position / H);
        counted += usize::from(counts(&all));
        let (Some((cell, phi)), Some((own, own_phi))) = (first.points[p], right.points[p]) else {
            panic!("{at}: {:?} is not {:?} of {all:?}", first.points[p], right.points[p]);
        };
        assert!(cell == own && (phi - own_phi).abs() < 1e-5 * H, "{at}: {cell} {phi} is not {own} {own_phi} of {all:?}");
    }
    let apart = off(&first.gradient, &right.gradient);
    println!("{counted} of {} points; gradients {apart:.1e} apart", right.points.len());
    assert!(apart < 2e-4, "{apart}");
    Some(counted)
}

#[test]
fn of_two_cells_that_hold_a_point_the_one_with_its_surface_nearer_wins() {
    // The right part is rolled: its surface lies deeper than the left one's on one side, and higher on the other.
    let plan = plan_of(BAR, &overlap([1.1, 1.8], 0.05), ABOVE);
    let u = pushed(&plan, |x| DVec3::new(-2.0, 0.0, 0.15 * (x.y - 2.0)));
    for first in [true, false] {
        let wins = |all: &[Holder]| all.len() > 1 && (all[0].1 == nearest(all)) == first;
        let Some(count) = compare(&plan, &u, wins) else { return };
        assert!(count > 200, "{count}: the lower number wins: {first}");
    }
}

#[test]
fn of_cells_that_hold_a_point_at_the_same_distance_the_lowest_number_wins() {
    let plan = plan_of(BAR, &overlap([1.125, 1.875], 0.0), ABOVE);
    let u = pushed(&plan, |_| DVec3::new(-2.0, 0.0, 0.0));
    let ties = |all: &[Holder]| all.len() > 1 && all.iter().all(|h| h.2 && h.1 == all[0].1);
    let Some(count) = compare(&plan, &u, ties) else { return };
    assert_eq!(count, 648);
}

#[test]
fn of_two_cells_that_hold_a_point_the_one_that_the_camera_sees_wins() {
    // The bottom of the right part lies in the top of the left one.
    let plan = plan_of(BAR, &overlap([1.72, 1.98], 0.05), ABOVE);
    let u = pushed(&plan, |_| DVec3::new(-2.0, 0.0, 1.7));
    let Some(count) = compare(&plan, &u, |all| all.iter().any(|h| !h.2 && h.1 < 0.9 * nearest(all))) else { return };
    assert!(count > 200, "{count}");
}

/// Steps of Newton's method to the place ξ = η = 1 − δ of a cell whose edge ξ = η = 1 is pushed in so far that it turns flat there:
/// from the middle, the distance to that edge halves with every step until it is δ.
fn steps_to(delta: f64) -> u64 {
    let mut from = 0.5;
    for count in 1.. {
        let next = 0.5 * (from + delta * delta / from);
        if from - next < 1e-4 {
            return count;
        }
        from = next;
    }
    0
}

#[test]
fn lanes_with_as_many_points_as_a_build_accepts_lose_none() {
    let Some(gpu) = device(None) else { return };
    // As many points in one stripe and one row of cubes as loops may have: three times what a stripe is given otherwise. The bound of
    // `match_points` is reached first, so that a loop of `pull_points` never has more than these.
    let seen = |points: u64| Seen {
        nodes: 8,
        layers: 1,
        rows_of_cubes: 1,
        points,
        stripes: 1,
        extension: 1,
        fold: 1,
        corners: 8,
        rows: points,
        markers: 0,
        site: 0,
        sites: 0,
        readings: 0,
    };
    let most = (1..100_000).rev().find(|n| seen(*n).check().is_ok()).unwrap_or(0);
    let room = Room { points: 100_000, scratch: SCRATCH };

    // In one cell, near the edge along which it is flat, where Newton's method is slow; out of the cost's band. The last eight, one of
    // every lane, are in the band, not near the edge and not where two pieces of the distances meet: all of the gradient is theirs.
    const DELTA: f64 = 0.003;
    let (last, mut noise) = (most - 8, Noise(5));
    let mut place = |n: u64| {
        let height = 0.5 + 0.4 * noise.next();
        let [x, y] = if n < last { [1.0 - DELTA; 2] } else { [0.53, 0.25 + 0.01 * (n - last) as f64] };
        DVec3::new(x - 0.5 * x * y, y - 0.5 * x * y, height)
    };
    let mut points: Vec<DVec3> = (0..most).map(&mut place).collect();
    let shape = (DVec3::new(0.1, 0.1, 0.0), DVec3::new(0.6, 0.6, 1.0));
    let of = |points: &[DVec3]| {
        let mut plan = plan_of(shape, points, DVec3::new(20.0, 20.0, 0.5));
        plan.band = 0.3 * H;
        plan
    };
    let plan = of(&points);
    let edge = |x: &DVec3| x.x > 0.5 * H && x.y > 0.5 * H;
    let u: Vec<DVec3> =
        plan.body.nodes.iter().map(|x| if edge(x) { DVec3::new(-0.5, -0.5, 0.0) * H } else { DVec3::ZERO }).collect();

    let visits = most.div_ceil(8) * (1 + steps_to(DELTA));
    println!("{most} points; a lane of `match_points` loops {visits} times, one of `pull_points` {most} times");
    assert!(visits > MOST_LOOPS * 4 / 5 && most > MOST_LOOPS / 2);
    let (found, exact) = (found(&gpu, &plan, &u, room), right(&plan, &u));
    let lost = (0..most as usize).filter(|p| found.points[*p].is_none()).count();
    assert_eq!(lost, 0, "of {most} points");
    for (p, (a, b)) in found.points.iter().zip(&exact.points).enumerate() {
        // Near the edge rounding moves a place by 1e-7/δ of the cell.
        let close = |a: f64, b: f64| (a - b).abs() < if p < last as usize { 1e-3 } else { 1e-5 } * H;
        assert!(a.zip(*b).is_some_and(|(a, b)| a.0 == b.0 && close(a.1, b.1)), "{p}: {a:?} is not {b:?}");
    }
    let apart = off(&found.gradient, &exact.gradient);
    println!("gradients {apart:.1e} apart");
    assert!(apart < 2e-4, "{apart}");
    // Without the very last point it is another.
    points.truncate(most as usize - 1);
    let fewer = right(&of(&points), &u).gradient.iter().map(|g| *g * (1.0 - 1.0 / most as f64)).collect::<Vec<_>>();
    assert!(off(&fewer, &exact.gradient) > 1e-2);

    // One point more is refused.
    points.extend([place(0), place(0)]);
    let refused = Observer::within(&gpu, &of(&points), 1, room).err();
    assert!(matches!(&refused, Some(GpuError::Limit { what, .. }) if what.contains("match_points")), "{refused:?}");
}
