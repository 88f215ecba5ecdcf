//! What each law of points does, beside the formula that its file states, written out here in vectors.
//!
//! The tests of derivatives hold for any smooth potential. These hold for the right one only.

use super::law::{Asks, COMMON, Followed, GRAVITY, OLD, PLANE, Place, Point, STIFFNESS, TIME, VELOCITY, X};
use super::{ALL, Law, Site, find};
use glam::DVec3;

const RATE: f64 = 100.0;
const MEASURE: f64 = 0.7;
const WIDTH: f64 = 1e-4;

/// A point in a step.
#[derive(Clone, Copy)]
struct At {
    place: Place,
    z: [f64; COMMON],
}

/// A point of a static problem.
pub(super) fn still() -> Place {
    At::still().place
}

fn point(kind: &str) -> (&'static Law, &'static dyn Point) {
    let law = &ALL[find(kind).expect("the law is in the table")];
    match law.site {
        Site::Nodes(p) | Site::Surface(p) | Site::Contact(p) | Site::Driven(p) => (law, p),
        _ => panic!("{kind} is no law of points"),
    }
}

impl At {
    /// In a step of 1/[`RATE`] seconds with weight `theta` of the new state.
    fn step(theta: f64) -> At {
        let place = Place {
            rest: DVec3::ZERO,
            normal: DVec3::ZERO,
            measure: MEASURE,
            width: WIDTH,
            rate: RATE,
            inertia: RATE * RATE / theta,
            momentum: RATE / theta,
            followed: Followed::default(),
        };
        At { place, z: [0.0; COMMON] }
    }

    /// In a static problem.
    fn still() -> At {
        let at = At::step(1.0);
        At { place: Place { rate: 0.0, inertia: 0.0, momentum: 0.0, ..at.place }, ..at }
    }

    fn put(mut self, at: usize, v: DVec3) -> At {
        self.z[at..at + 3].copy_from_slice(&v.to_array());
        self
    }

    fn number(mut self, at: usize, v: f64) -> At {
        self.z[at] = v;
        self
    }

    /// Above a plane of this normal, height and stiffness.
    fn plane(self, normal: DVec3, height: f64, stiffness: f64) -> At {
        self.put(PLANE, normal).number(PLANE + 3, height).number(PLANE + 4, stiffness)
    }

    fn input(&self, law: &Law, numbers: &[f64]) -> Vec<f64> {
        assert_eq!(numbers.len(), law.params.len(), "{}", law.kind);
        self.z.iter().chain(numbers).copied().collect()
    }

    fn force(&self, kind: &str, numbers: &[f64]) -> DVec3 {
        let (law, point) = point(kind);
        -DVec3::from_array(point.gradient(&self.place, &self.input(law, numbers)))
    }

    fn energy(&self, kind: &str, numbers: &[f64]) -> f64 {
        let (law, point) = point(kind);
        point.value(&self.place, &self.input(law, numbers))
    }

    fn skips(&self, kind: &str, numbers: &[f64]) -> bool {
        let (law, point) = point(kind);
        point.skips(&self.place, &self.input(law, numbers))
    }
}

/// Equal but for rounding, or for what a law's smooth zero leaves.
fn same(found: DVec3, exact: DVec3, close: f64) {
    assert!((found - exact).length() <= close * exact.length(), "{found} is not {exact}");
}

const ROUNDING: f64 = 1e-12;
const A: DVec3 = DVec3::new(0.3, -0.2, 0.5);
const B: DVec3 = DVec3::new(-0.1, 0.4, 0.2);
const C: DVec3 = DVec3::new(0.05, 0.02, -0.3);

#[test]
fn loads_are_the_forces_stated() {
    same(At::still().force("uniform-force", &[2.0, -3.0, 5.0]), DVec3::new(2.0, -3.0, 5.0) * MEASURE, ROUNDING);

    // The file's forces at both ends of a step, in its weights; a clock that is late by 0.1 s sees them 0.1 s later.
    let mut at = At::step(0.6).number(TIME, 1.1);
    at.place.followed = Followed { time: 1.0, new: [A, B], old: [C, A] };
    let exact = 2.0 * MEASURE * (0.6 * (A + 0.1 * B) + 0.4 * (C + 0.1 * A));
    same(at.force("file-load", &[2.0]), exact, ROUNDING);
}

#[test]
fn slack_is_affine_in_place_and_a_bell_in_time() {
    let (center, rest) = (DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.4, -0.1, 0.25));
    let mut numbers: Vec<f64> = [A, B, C, A + C, center].iter().flat_map(|v| v.to_array()).collect();
    numbers.extend([2.0, 0.5]);
    let from = rest - center;
    let whole = (A + B * from.x + C * from.y + (A + C) * from.z) * MEASURE;
    let force = |time: f64| {
        let mut at = At::step(0.6).number(TIME, time);
        at.place.rest = rest;
        (at.force("slack", &numbers), at.skips("slack", &numbers))
    };
    for (time, part) in [(2.0, 1.0), (2.25, 0.5), (1.75, 0.5)] {
        let (found, skipped) = force(time);
        assert!(!skipped);
        same(found, part * whole, ROUNDING);
    }
    for time in [1.4, 1.5, 2.5, 2.6] {
        assert_eq!(force(time), (DVec3::ZERO, true));
    }
}

#[test]
fn an_impulse_is_a_spline_in_the_middle_of_its_step() {
    // From 1 s on for 0.4 s: a knot every 0.1 s. The forces of a step of θ = ½ act half a step before its end.
    let numbers = [2.0, -1.0, 3.0, 0.0, 0.0, 0.0, 0.01, 1.0, 0.4];
    let momentum = DVec3::new(2.0, -1.0, 3.0);
    for (theta, early) in [(0.5, 0.005), (1.0, 0.0)] {
        // The cubic B-spline at its knots and in the middle between two.
        for (knots, height) in [(1.0, 1.0 / 6.0), (1.5, 23.0 / 48.0), (2.0, 2.0 / 3.0), (3.0, 1.0 / 6.0)] {
            let at = At::step(theta).number(TIME, 1.0 + 0.1 * knots + early);
            same(at.force("impulse", &numbers), momentum * (height / 0.1 * MEASURE), ROUNDING);
            assert!(!at.skips("impulse", &numbers) && !At { place: At::still().place, ..at }.force("impulse", &numbers).is_nan());
        }
        for time in [0.99, 1.41] {
            let at = At::step(theta).number(TIME, time + early);
            assert!(at.skips("impulse", &numbers) && at.force("impulse", &numbers).length() < 1e-12);
        }
    }
    let (law, blow) = point("impulse");
    let still = At::still().number(TIME, 1.2);
    assert!(blow.sleeps(&still.place, &still.input(law, &numbers)), "nothing strikes a body in equilibrium");
    let step = At::step(0.5).number(TIME, 1.2);
    assert!(!blow.sleeps(&step.place, &step.input(law, &numbers)));
}

#[test]
fn springs_pull_by_both_states_in_the_weights_of_the_step() {
    let (x, old, rest, place) = (DVec3::new(0.31, 0.2, -0.1), DVec3::new(0.3, 0.22, -0.13), A, B);
    let moving = |theta: f64| {
        let mut at = At::step(theta).put(X, x).put(OLD, old).number(TIME, 1.1);
        (at.place.rest, at.place.followed) = (rest, Followed { time: 1.0, new: [B, C], old: [A, B] });
        at
    };
    for theta in [0.5, 0.6, 1.0] {
        let at = moving(theta);
        let pull = |new: DVec3, old: DVec3| -30.0 * MEASURE * (theta * new + (1.0 - theta) * old);
        // The anchor and the place that it holds draw by their distance: at rest the spring is stress-free where both meet.
        let tether = [[30.0].as_slice(), &place.to_array(), &C.to_array(), &[0.01]].concat();
        same(at.force("tether", &tether), pull(x - rest + place - C, old - rest + place - C), ROUNDING);
        let handle = [[30.0].as_slice(), &place.to_array(), &[0.01]].concat();
        let [now, then] = [B + 0.1 * C, A + 0.1 * B];
        same(at.force("handle", &handle), pull(x - rest + place - now, old - rest + place - then), ROUNDING);
        let attachment = [[30.0].as_slice(), &C.to_array()].concat();
        same(at.force("attachment", &attachment), pull(x - now - C, old - then - C), ROUNDING);
    }
}

#[test]
fn an_added_mass_has_weight_and_inertia() {
    let (way, velocity, g) = (DVec3::new(0.01, -0.02, 0.005), DVec3::new(0.5, 0.3, -0.4), DVec3::new(1.0, 2.0, -9.0));
    for theta in [0.5, 0.6] {
        let at = At::step(theta).put(X, A + way).put(OLD, A).put(VELOCITY, velocity).put(GRAVITY, g);
        // The θ-scheme's way is (1 − θ) of the old velocity and θ of the new one.
        let acceleration = (way * RATE - velocity) * RATE / theta;
        let along = acceleration.project_onto(g);
        for hung in [0.0, 0.3, 1.0] {
            let exact = 2.0 * MEASURE * (g - acceleration * (1.0 - hung) - along * hung);
            // The square of gravity has 1e-12 added.
            same(at.force("point-mass", &[2.0, 0.0, 0.0, 0.0, 0.01, hung]), exact, 1e-11);
        }
        // Where gravity is as small as what keeps the quotient finite, half of what hangs does.
        let few = DVec3::Z * 1e-6;
        let exact = 2.0 * MEASURE * (few - acceleration * 0.7 - DVec3::Z * (0.5 * 0.3 * acceleration.z));
        same(at.put(GRAVITY, few).force("point-mass", &[2.0, 0.0, 0.0, 0.0, 0.01, 0.3]), exact, ROUNDING);
        // Without gravity nothing hangs.
        let exact = -2.0 * MEASURE * acceleration * 0.7;
        same(at.put(GRAVITY, DVec3::ZERO).force("point-mass", &[2.0, 0.0, 0.0, 0.0, 0.01, 0.3]), exact, ROUNDING);
    }
}

#[test]
fn loads_at_a_place_are_shared_by_a_bell() {
    let place = DVec3::new(0.1, -0.2, 0.3);
    let p = place.to_array();
    let all = [
        ("point-mass", vec![1.0, p[0], p[1], p[2], 0.05, 0.0]),
        ("tether", vec![1.0, p[0], p[1], p[2], 9.0, 9.0, 9.0, 0.05]),
        ("handle", vec![1.0, p[0], p[1], p[2], 0.05]),
        ("impulse", vec![9.0, 9.0, 9.0, p[0], p[1], p[2], 0.05, 0.0, 1.0]),
    ];
    for (kind, numbers) in all {
        let share = |x: DVec3| point(kind).1.shared(x, &numbers).expect("it is shared").0;
        // Twice the radius away a sixteenth, in every direction; √2 of it is nearly what exp(−d²/r²) is there as well.
        assert!((share(place) - 1.0).abs() < ROUNDING, "{kind}");
        for axis in DVec3::AXES {
            assert!((share(place + 0.1 * axis) - 1.0 / 16.0).abs() < ROUNDING, "{kind}");
            assert!((share(place - 0.05 * axis) - 0.4096).abs() < ROUNDING, "{kind}");
        }
    }
    assert!(point("uniform-force").1.shared(place, &[1.0, 0.0, 0.0]).is_none());
}

#[test]
fn air_brakes_by_the_drag_equation() {
    let way = DVec3::new(0.02, -0.01, 0.03);
    let at = |way: DVec3| At::step(0.6).put(X, A + way).put(OLD, A);
    let v = way * RATE;
    // The micrometre that makes zero smooth is 4e-10 of the way, squared.
    same(at(way).force("air-drag", &[0.8, 1.2]), -0.5 * 0.8 * 1.2 * MEASURE * v.length() * v, 1e-9);
    assert_eq!(at(DVec3::ZERO).force("air-drag", &[0.8, 1.2]), DVec3::ZERO);
    assert!(At::still().skips("air-drag", &[0.8, 1.2]) && !at(way).skips("air-drag", &[0.8, 1.2]));
}

/// Deep under a plane, where pressure is stiffness times depth, going from one depth to another; and how far it slides.
fn under(theta: f64, depths: [f64; 2], slide: f64) -> (At, DVec3, DVec3) {
    let n = DVec3::new(1.0, 2.0, 2.0) / 3.0;
    let t = DVec3::new(2.0, 1.0, -2.0) / 3.0;
    let [old, new] = depths.map(|d| n * (0.05 - d));
    (At::step(theta).put(OLD, old).put(X, new + slide * t).plane(n, 0.05, 2e5).number(STIFFNESS, 3e5), n, t)
}

#[test]
fn contact_is_the_mean_along_the_last_part_of_the_way() {
    let (old, new) = (1e-3, 3e-3);
    // The whole way at θ = ½, its second half at 0.55, its end from 0.6 on.
    for (theta, mean) in [(0.5, 0.5), (0.55, 0.75), (0.6, 1.0), (1.0, 1.0)] {
        let depth = old + mean * (new - old);
        let (at, n, _) = under(theta, [old, new], 0.0);
        same(at.force("contact-stiffness", &[0.5]), n * (0.5 * 2e5 * depth * MEASURE), 1e-10);
        // A plane of the law's own: of any length of its normal, 0.02 m behind a point.
        let from = n * 0.07;
        let plane = [[1.5, 0.02].as_slice(), &(n * 3.0).to_array(), &from.to_array()].concat();
        same(at.force("second-plane", &plane), n * (1.5 * 3e5 * depth * MEASURE), 1e-10);
        // A ball on a path, which the clock's shift moves as well.
        let mut ball = at.number(TIME, 1.1);
        let center = |depth: f64, velocity: DVec3| n * (0.05 - depth) - n * (0.02 - depth) - 0.1 * velocity;
        ball.place.followed = Followed { time: 1.0, new: [center(new, A), A], old: [center(old, B), B] };
        same(ball.force("push", &[1.5, 0.02]), n * (1.5 * 3e5 * depth * MEASURE), 1e-10);
        assert!(!at.skips("contact-stiffness", &[0.5]) && !at.skips("second-plane", &plane) && !ball.skips("push", &[1.5, 0.02]));
        // What touches in neither state is passed over, what touches in one of them is not.
        let (above, ..) = under(theta, [-3e-4, -2e-4], 0.0);
        let (leaving, ..) = under(theta, [1e-4, -2e-4], 0.0);
        assert!(above.skips("contact-stiffness", &[0.5]) && !leaving.skips("contact-stiffness", &[0.5]));
        assert!(above.skips("second-plane", &plane) && !leaving.skips("second-plane", &plane));
        ball.place.followed.new[0] -= n;
        ball.place.followed.old[0] -= n;
        assert!(ball.skips("push", &[1.5, 0.02]));
        // At its very centre a ball pushes nowhere.
        ball.place.followed.new[0] = n * (0.05 - new) - 0.1 * A;
        assert!(ball.force("push", &[1.5, 0.02]).is_finite());
    }
}

#[test]
fn adhesion_pulls_by_its_pressure_and_fades_over_its_range() {
    let numbers = [500.0, 1e-3];
    let at = |gap: f64| under(1.0, [-gap, -gap], 0.0);
    // ∫ of the quintic step 6 s⁵ − 15 s⁴ + 10 s³ has the values of the step itself as its slope.
    for (gap, part) in
        [(-3e-3, 1.0), (WIDTH, 1.0), (WIDTH + 2.5e-4, 0.896484375), (WIDTH + 5e-4, 0.5), (WIDTH + 7.5e-4, 0.103515625)]
    {
        let (at, n, _) = at(gap);
        same(at.force("adhesion", &numbers), -n * (500.0 * part * MEASURE), 1e-9);
        assert!(!at.skips("adhesion", &numbers));
    }
    let (far, ..) = at(WIDTH + 1.1e-3);
    assert!(far.skips("adhesion", &numbers) && far.force("adhesion", &numbers) == DVec3::ZERO);
    // The work of pulling off is half of pressure times range, and from deeper pressure times way more.
    let work = |gap: f64| far.energy("adhesion", &numbers) - at(gap).0.energy("adhesion", &numbers);
    for (gap, way) in [(WIDTH, 0.5e-3), (WIDTH - 2e-3, 2.5e-3)] {
        assert!((work(gap) - 500.0 * way * MEASURE).abs() < 1e-9 * work(gap), "{}", work(gap));
    }
}

#[test]
fn friction_is_the_coefficient_times_pressure_against_the_sliding() {
    // At 2 m/s, and at the speed below which it goes to zero. Sinking in meanwhile changes nothing.
    for (speed, part) in [(2.0, 1.0), (5e-3, 0.5f64.sqrt()), (0.0, 0.0)] {
        let (at, _, t) = under(0.6, [1e-3, 3e-3], speed / RATE);
        let exact = -t * (0.3 * 2e5 * 1e-3 * MEASURE * part);
        // Of full sliding (5e-3/2)²/2 is missing.
        let found = at.force("coulomb-friction", &[0.3]);
        assert!((found - exact).length() < 4e-6 * (0.3 * 2e5 * 1e-3 * MEASURE), "{speed}: {found} {exact}");
        assert!(!at.skips("coulomb-friction", &[0.3]));
    }
    let (above, ..) = under(0.6, [-1e-3, -2e-3], 0.01);
    let still = At { place: At::still().place, ..under(0.6, [1e-3, 3e-3], 0.01).0 };
    assert!(above.skips("coulomb-friction", &[0.3]) && still.skips("coulomb-friction", &[0.3]));
}

#[test]
fn contact_dissipates_by_pressure_and_speed_of_approach() {
    let (at, n, _) = under(0.6, [1e-3, 3e-3], 0.01);
    // 2 mm deeper in a step of a hundredth of a second.
    same(at.force("contact-dissipation", &[1.5]), n * (1.5 * 2e5 * 1e-3 * 0.2 * MEASURE), 1e-10);
    let (above, ..) = under(0.6, [-1e-3, -2e-3], 0.01);
    let still = At { place: At::still().place, ..at };
    assert!(!at.skips("contact-dissipation", &[1.5]));
    assert!(above.skips("contact-dissipation", &[1.5]) && still.skips("contact-dissipation", &[1.5]));
}

#[test]
fn a_static_problem_has_the_new_state_alone() {
    let still = At::still().place;
    assert_eq!((still.lead(), still.theta()), (0.0, 1.0));
    let step = At::step(0.6).place;
    assert!((step.theta() - 0.6).abs() < ROUNDING && (step.lead() - 0.004).abs() < ROUNDING);
}

#[test]
fn the_table_says_what_laws_ask_for_and_which_are_loads() {
    let kinds = |which: &dyn Fn(&Law) -> bool| ALL.iter().filter(|l| which(l)).map(|l| l.kind).collect::<Vec<_>>();
    assert_eq!(kinds(&|l| l.asks() == Asks::Path), ["push", "handle"]);
    assert_eq!(kinds(&|l| l.asks() == Asks::Series), ["file-load", "attachment"]);
    assert_eq!(kinds(&|l| l.asks() == Asks::Normal), ["wind"]);
    assert_eq!(kinds(&|l| l.is_load()), ["uniform-force", "impulse", "file-load", "slack"]);
    assert_eq!(kinds(&|l| l.moves()), ["jet", "obstacle"]);
    assert_eq!(kinds(&|l| l.needs_cells()), ["clamp-edge"]);
}
