//! Wind on the surface: a steady part, a gust that comes and goes, and eddies drawn by a seed.
//!
//! A patch of area A and normal n that moves at ẏ feels f = ½ ρ A [C_n |v_r·n| (v_r·n) n + C_t |v_t| v_t], v_r = w(y, t) − ẏ the wind as it
//! meets it and v_t the part along the surface (Wang et al. 2015 show wind; the form is that of thin shells, Baraff & Witkin, *Large Steps in
//! Cloth Simulation*, 1998, with squares as in the drag equation). Only the mean velocity ẏ of the step is new: normal, place and
//! air are those of the old state, and so a dissipation potential ∝ |v_r|³ exists, convex and exact. Every patch stands for itself: lee
//! sides are sucked as windward sides are pressed, and nothing shadows anything.
//!
//! w = mean + gust sin(2π f t) + eddies. These are [`EDDIES`] waves of length ℓ, give or take a half, across their own direction and hence free of
//! divergence (Kraichnan, *Phys. Fluids* 13, 1970), carried along by the mean wind, of `noise` root mean square along each axis. None of it acts in
//! a static problem.

use super::law::{Asks, Input, Number, Place, PointLaw, dot, sub};
use super::{EffectParam, Family, Law, Numbered, Site, Trial, Unstated, component, number};
use glam::DVec3;
use std::cell::RefCell;
use std::f64::consts::TAU;

/// Waves that the eddies are the sum of: more cost time in proportion and look the same.
const EDDIES: usize = 8;

/// Way of a step [m] over which forces go smoothly through zero, as in [`super::air_drag`].
const SMOOTH: f64 = 1e-6;

pub(super) const LAW: Law = Law {
    kind: "wind",
    family: Family::Load,
    sentence: "wind blows on the body",
    params: &PARAMS,
    trial: Trial::Never,
    site: Site::Surface(&Wind),
};

const MEAN: &str = "its steady velocity";
const GUST: &str = "amplitude of the gusts";

const fn velocity(key: &'static str, axis: u8, doc: &'static str) -> EffectParam {
    EffectParam { default: Unstated::Stated(0.0), ..component(key, axis, "m/s", 1.0, doc) }
}

const PARAMS: [EffectParam; 13] = [
    velocity("mean", 0, MEAN),
    velocity("mean", 1, MEAN),
    velocity("mean", 2, MEAN),
    velocity("gust", 0, GUST),
    velocity("gust", 1, GUST),
    velocity("gust", 2, GUST),
    number("frequency", "1/s", [0.0, 1e6, 1.0], Unstated::Stated(1.0), "gusts a second"),
    number("noise", "m/s", [0.0, 1e3, 1.0], Unstated::Stated(0.0), "root mean square of eddies along each axis"),
    number("length", "m", [1e-6, 1e6, 0.1], Unstated::Stated(0.1), "length of the eddies' waves"),
    number("seed", "1", [0.0, 1e15, 1.0], Unstated::Choice(Numbered::Seed), "number of the draw of the eddies"),
    number(
        "normal",
        "1",
        [0.0, 1e6, 1.0],
        Unstated::Stated(0.6),
        "pressure on a patch across the wind over dynamic pressure; half the drag coefficient of a plate",
    ),
    number("tangential", "1", [0.0, 1e6, 0.1], Unstated::Stated(0.02), "friction along a patch over dynamic pressure"),
    number("fluid_density", "kg/m³", [1e-6, 1e5, 1.2], Unstated::Stated(1.2), "density of the air"),
];

struct Wind;

/// A wave: unit direction, unit amplitude across it, phase, length and pace over the mean ones.
#[derive(Clone, Copy)]
struct Eddy {
    direction: DVec3,
    amplitude: DVec3,
    phase: f64,
    shorter: f64,
    pace: f64,
}

/// Wave `k` of a seed; SplitMix64 (Steele, Lea & Flood, OOPSLA 2014) makes the numbers.
fn eddy(seed: u64, k: usize) -> Eddy {
    let mut state = seed.wrapping_mul(EDDIES as u64).wrapping_add(k as u64).wrapping_mul(0xD129_0B26_89A4_C5B5);
    let mut draw = || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut x = (state ^ (state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    };
    let (height, around) = (2.0 * draw() - 1.0, TAU * draw());
    let flat = (1.0 - height * height).sqrt();
    let direction = DVec3::new(flat * around.cos(), flat * around.sin(), height);
    let (u, angle) = (direction.any_orthonormal_vector(), TAU * draw());
    let amplitude = u * angle.cos() + direction.cross(u) * angle.sin();
    Eddy { direction, amplitude, phase: TAU * draw(), shorter: 0.5 + draw(), pace: 2.0 * draw() - 1.0 }
}

thread_local! {
    /// The waves of the last seed: every patch asks for the same ones, and making them takes ten times as long as adding them.
    static LAST: RefCell<(Option<u64>, [Eddy; EDDIES])> = const { RefCell::new((None, NONE)) };
}

const NONE: [Eddy; EDDIES] =
    [Eddy { direction: DVec3::ZERO, amplitude: DVec3::ZERO, phase: 0.0, shorter: 0.0, pace: 0.0 }; EDDIES];

/// The waves of a seed.
fn eddies(seed: u64) -> [Eddy; EDDIES] {
    LAST.with_borrow_mut(|(known, waves)| {
        if *known != Some(seed) {
            (*known, *waves) = (Some(seed), std::array::from_fn(|k| eddy(seed, k)));
        }
        *waves
    })
}

/// Velocity of the air [m/s] at the old place and at `time` [s].
fn air<D: Number>(at: &Input<D>, time: D) -> [D; 3] {
    if at.is_moved() {
        return blow(at.old(), time, |i| at.p(i));
    }
    blow(at.old().map(|y| y.re()), time.re(), |i| at.p(i).re()).map(D::from)
}

/// The same at a place `y` [m], from the law's parameters.
fn blow<D: Number>(y: [D; 3], time: D, p: impl Fn(usize) -> D) -> [D; 3] {
    let swing = (time * p(6) * TAU).sin();
    let mut w: [D; 3] = std::array::from_fn(|i| p(i) + p(3 + i) * swing);
    let from: [D; 3] = std::array::from_fn(|i| y[i] - p(i) * time);
    // The mean square of a wave is ½, and three axes share it.
    let size = p(7) * (6.0 / EDDIES as f64).sqrt();
    for e in eddies(p(9).re().round() as u64) {
        let along = from[0] * e.direction.x + from[1] * e.direction.y + from[2] * e.direction.z + p(7) * time * e.pace;
        let wave = size * (along / p(8) * (TAU * e.shorter) + e.phase).cos();
        (0..3).for_each(|i| w[i] += wave * e.amplitude[i]);
    }
    w
}

impl PointLaw for Wind {
    const ASKS: Asks = Asks::Normal;

    fn potential<D: Number>(&self, place: &Place, at: Input<D>) -> D {
        let (n, way) = (at.normal(), at.way());
        let met = sub(air(&at, at.time() - place.lead()), way.map(|s| s * place.rate));
        let through = dot(met, n);
        let along: [D; 3] = std::array::from_fn(|i| met[i] - n[i] * through);
        let smooth = (SMOOTH * place.rate).powi(2);
        let cube = |square: D| (square + smooth).sqrt().powi(3);
        let power = at.p(10) * cube(through * through) + at.p(11) * cube(dot(along, along));
        at.p(12) * power * (place.measure / (6.0 * place.rate))
    }

    fn idle(&self, place: &Place, z: &[f64]) -> bool {
        self.asleep(place, z)
    }

    fn asleep(&self, place: &Place, _z: &[f64]) -> bool {
        place.rate == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::law::{COMMON, OLD, PLANE, Point, TIME};
    use glam::{DQuat, DVec2};

    const RATE: f64 = 100.0;

    /// A patch of 1 m² and its input, at rest at the origin.
    fn patch(normal: DVec3, numbers: &[f64]) -> (Place, Vec<f64>) {
        let place = Place {
            rest: DVec3::ZERO,
            normal,
            measure: 1.0,
            width: 1e-3,
            rate: RATE,
            inertia: RATE * RATE,
            momentum: RATE,
            followed: Default::default(),
        };
        let mut z = vec![0.0; COMMON];
        z[PLANE..PLANE + 3].copy_from_slice(&normal.to_array());
        z.extend(numbers);
        (place, z)
    }

    #[test]
    fn a_plate_feels_the_drag_equation_and_a_gust_its_sine() {
        let wind = |mean: f64, gust: f64| [mean, 0.0, 0.0, gust, 0.0, 0.0, 0.5, 0.0, 0.1, 0.0, 0.6, 0.02, 1.2];
        let force = |normal, mean, gust, time: f64, speed: f64| {
            let (place, mut z) = patch(normal, &wind(mean, gust));
            z[TIME] = time;
            z[0] = speed / RATE;
            -DVec3::from_array(Wind.gradient(&place, &z))
        };
        // ½ ρ A C v², the same on either side of the plate; the smooth zero, 0.1 mm/s wide here, adds 1e-9 of it.
        let near = |f: DVec3, exact: f64| (f - DVec3::X * exact).length() < 1e-8 * (1.0 + exact);
        for normal in [DVec3::X, -DVec3::X] {
            assert!(near(force(normal, 3.0, 0.0, 0.0, 0.0), 0.5 * 1.2 * 0.6 * 9.0));
        }
        assert!(near(force(DVec3::Y, 3.0, 0.0, 0.0, 0.0), 0.5 * 1.2 * 0.02 * 9.0));
        // Half a second of half a gust a second is its top; a patch that goes with the wind feels nothing.
        assert!(near(force(DVec3::X, 3.0, 2.0, 0.5, 0.0), 0.5 * 1.2 * 0.6 * 25.0));
        assert!(near(force(DVec3::X, 3.0, 0.0, 0.0, 3.0), 0.0));
        // Askew, the plate is pushed along its normal more than along the wind.
        let askew = force(DVec3::new(1.0, 1.0, 0.0).normalize(), 3.0, 0.0, 0.0, 0.0);
        assert!(askew.y > 0.9 * askew.x && askew.y < askew.x, "{askew}");
    }

    #[test]
    fn eddies_are_of_the_size_stated_and_free_of_divergence() {
        let numbers = |seed: f64| [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.7, 0.2, seed, 0.6, 0.02, 1.2];
        let velocity = |y: DVec3, time: f64, seed: f64| {
            let (_, mut z) = patch(DVec3::X, &numbers(seed));
            z[OLD..OLD + 3].copy_from_slice(&y.to_array());
            DVec3::from_array(air(&Input::new(&z), time)) - DVec3::X
        };
        let (mut sum, mut count) = (0.0, 0.0);
        for seed in 0..400 {
            let y = DVec3::new(0.1 * f64::from(seed), 0.37, -0.2);
            sum += velocity(y, 0.3, f64::from(seed)).length_squared() / 3.0;
            count += 1.0;
        }
        let rms = (sum / count).sqrt();
        // 3200 waves of mean square ½ scatter by some 2 %.
        assert!((rms - 0.7).abs() < 0.06, "{rms}");
        let (y, d) = (DVec3::new(0.3, -0.1, 0.2), 1e-5);
        let slope = |a: usize| {
            let e = DVec3::AXES[a] * d;
            (velocity(y + e, 0.3, 5.0) - velocity(y - e, 0.3, 5.0)) / (2.0 * d)
        };
        let divergence = slope(0).x + slope(1).y + slope(2).z;
        // Single slopes are of the size 0.7 · 2π/0.2; differences leave 1e-9 of that.
        assert!(divergence.abs() < 1e-6 && slope(0).length() > 1.0, "{divergence}");
        assert_eq!(velocity(y, 0.3, 5.0), velocity(y, 0.3, 5.0));
        assert!((velocity(y, 0.3, 5.0) - velocity(y, 0.3, 6.0)).length() > 1e-3);
    }

    #[test]
    fn eddies_that_are_not_there_yet_have_a_derivative() {
        let numbers = |noise: f64| [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, noise, 0.2, 4.0, 0.6, 0.02, 1.2];
        let force = |noise: f64| {
            let (place, z) = patch(DVec3::X, &numbers(noise));
            DVec3::from_array(Wind.gradient(&place, &z))
        };
        let (place, z) = patch(DVec3::X, &numbers(0.0));
        let mut by = [0.0];
        Wind.transposed(&place, &z, [1.0, 0.0, 0.0], COMMON + 7..COMMON + 8, &mut by);
        let difference = (force(1e-6) - force(-1e-6)).x / 2e-6;
        assert!((by[0] - difference).abs() < 1e-6 * difference.abs() && difference.abs() > 1e-3, "{} {difference}", by[0]);
    }

    /// A seed means the same wind for ever: its numbers are those of SplitMix64, which other tests draw theirs from.
    #[test]
    fn waves_are_drawn_evenly_by_a_published_generator() {
        let (mut directions, mut squares) = (DVec3::ZERO, DVec3::ZERO);
        for seed in 0..500u64 {
            for k in 0..EDDIES {
                let e = eddy(seed, k);
                let mut draws =
                    crate::mechanics::rotation::tests::Noise((8 * seed + k as u64).wrapping_mul(0xD129_0B26_89A4_C5B5));
                let mut draw = || draws.uniform(0.0, 1.0);
                let (height, around, angle) = (2.0 * draw() - 1.0, TAU * draw(), TAU * draw());
                assert_eq!(e.direction.z, height);
                assert!((e.direction.truncate() - DVec2::from_angle(around) * (1.0 - height * height).sqrt()).length() < 1e-14);
                assert!((e.direction.length() - 1.0).abs() < 1e-14 && (e.amplitude.length() - 1.0).abs() < 1e-14);
                assert!(e.direction.dot(e.amplitude).abs() < 1e-14);
                // Turned by the angle about the wave's direction, to the left.
                let u = e.direction.any_orthonormal_vector();
                assert!((DQuat::from_axis_angle(e.direction, angle) * u - e.amplitude).length() < 1e-13);
                assert_eq!((e.phase, e.shorter, e.pace), (TAU * draw(), 0.5 + draw(), 2.0 * draw() - 1.0));
                directions += e.direction / 4000.0;
                squares += e.direction * e.direction / 4000.0;
            }
        }
        // On the unit sphere: means of 4000 of variance 1/3 and 4/45 scatter by 0.009 and 0.005.
        assert!(
            directions.abs().max_element() < 0.04 && (squares - 1.0 / 3.0).abs().max_element() < 0.02,
            "{directions} {squares}"
        );
    }

    #[test]
    fn the_air_is_mean_and_gust_and_waves_that_it_carries() {
        let (mean, gust) = (DVec3::new(1.0, -2.0, 0.5), DVec3::new(0.3, 0.7, -0.4));
        let (frequency, noise, length, seed, y, time) = (0.8, 0.7, 0.2, 9.0, DVec3::new(0.3, -0.1, 0.2), 1.3);
        let numbers = [&mean.to_array()[..], &gust.to_array(), &[frequency, noise, length, seed, 0.6, 0.02, 1.2]].concat();
        let (_, mut z) = patch(DVec3::X, &numbers);
        z[OLD..OLD + 3].copy_from_slice(&y.to_array());
        let found = DVec3::from_array(air(&Input::new(&z), time));
        let mut exact = mean + gust * (TAU * frequency * time).sin();
        for k in 0..EDDIES {
            let e = eddy(9, k);
            let along = (y - mean * time).dot(e.direction) + noise * e.pace * time;
            exact += e.amplitude * (noise * (6.0f64 / 8.0).sqrt() * (TAU * e.shorter * along / length + e.phase).cos());
        }
        assert!((found - exact).length() < 1e-12, "{found} {exact}");
    }

    #[test]
    fn forces_act_within_the_step_and_go_smoothly_through_zero() {
        // θ = ½: the gust is taken half a step before the new state, a quarter of its period after zero.
        let numbers = [0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.5, 0.0, 0.1, 0.0, 0.6, 0.02, 1.2];
        let (mut place, mut z) = patch(DVec3::X, &numbers);
        place.momentum = 2.0 * RATE;
        z[TIME] = 0.3 + 0.5 / RATE;
        let wind = 2.0 * (TAU * 0.5 * 0.3).sin();
        let force = -Wind.gradient(&place, &z)[0];
        assert!((force / (0.5 * 1.2 * 0.6 * wind * wind) - 1.0).abs() < 1e-7, "{force}");
        // In still air a patch that moves by a micrometre feels √2 of v² of it.
        let (place, mut z) = patch(DVec3::X, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.1, 0.0, 0.6, 0.02, 1.2]);
        z[0] = SMOOTH;
        let speed = SMOOTH * RATE;
        let force = Wind.gradient(&place, &z)[0];
        assert!((force / (0.5 * 1.2 * 0.6 * speed * speed * 2f64.sqrt()) - 1.0).abs() < 1e-9, "{force}");
    }
}
