//! Shares, visibility and free space on the device against the CPU's, on sheets that are bent and seen from several sides.

use super::*;
use crate::costs::rollout_tests::{seen, watched};
use crate::tests::scenes::{ball, device};
use glam::DVec3;
use palpate_engine::tracking::{Eye, Follow, Place, Pose, Prior, Problem, Pull};
use palpate_model::observation::{Camera, ObservedPoint};
use std::collections::{BTreeMap, BTreeSet};

/// Uniform numbers from −1 to 1 (splitmix64).
struct Noise(u64);

impl Noise {
    fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.number(), self.number(), self.number())
    }
}

/// A frame that lives long enough.
struct Case {
    points: Vec<ObservedPoint>,
    cameras: Vec<Camera>,
    places: Vec<Place>,
    spacing: f64,
}

impl Case {
    fn sighting(&self) -> Sighting<'_> {
        let Case { points, cameras, places, spacing } = self;
        Sighting { points, cameras, places, spacing: *spacing, noise: 1e-3 }
    }
}

/// Distance of neighbouring places [m].
const SPACING: f64 = 0.004;

/// A sheet of so many places, both sides 1 cm apart, that is bent by so much [1/m] about y, a metre from the origin; every third point lies on the
/// back, every 41st far behind what its camera sees, every 50th anywhere.
fn sheet(places: usize, points: usize, bend: f64, cameras: Vec<Camera>) -> Case {
    let mut noise = Noise(1 + places as u64);
    let half = places.div_ceil(2);
    let across = (half as f64).sqrt().ceil();
    let size = 0.5 * across * SPACING;
    let middle = DVec3::new(0.3, -0.2, 1.0);
    let at = |x: f64, y: f64, side: f64| {
        let normal = DVec3::new(-2.0 * bend * x, 0.0, 1.0).normalize();
        (middle + DVec3::new(x, y, bend * x * x) + 0.005 * side * normal, side * normal)
    };
    let place = |k: usize| {
        let (i, j) = ((k % half) as f64 % across, ((k % half) as f64 / across).floor());
        let jitter = 0.3 * SPACING * noise.vector();
        let side = if k < half { 1.0 } else { -1.0 };
        let (position, normal) = at(i * SPACING - size + jitter.x, j * SPACING - size + jitter.y, side);
        Place { position, normal, area: SPACING * SPACING * (1.0 + 0.5 * noise.number()) }
    };
    let places: Vec<Place> = (0..places).map(place).collect();
    let point = |n: usize| {
        let side = if n.is_multiple_of(3) { -1.0 } else { 1.0 };
        let (mut position, normal) = at(size * noise.number(), size * noise.number(), side);
        position += 0.001 * noise.vector() + 0.002 * normal;
        if n % 41 == 7 {
            position += 0.1 * cameras[n % cameras.len()].line(position);
        }
        if n % 50 == 9 {
            position = middle + 3.0 * size * noise.vector();
        }
        ObservedPoint { position, camera: (n % cameras.len()) as u32 }
    };
    Case { points: (0..points).map(point).collect(), places, spacing: SPACING, cameras }
}

/// From the front, from behind and aside, a scanner, and nobody knows from where.
fn four_cameras() -> Vec<Camera> {
    let center = DVec3::new(0.2, 0.1, 0.1);
    vec![
        Camera::Pinhole { center: DVec3::new(0.35, -0.25, 1.9), axis: DVec3::new(0.02, 0.03, -1.0).normalize() },
        Camera::Pinhole { center, axis: (DVec3::new(0.3, -0.2, 1.0) - center).normalize() },
        Camera::Scanner { center: DVec3::new(0.9, -0.3, 1.4) },
        Camera::Unknown,
    ]
}

fn gpu_and_cpu() -> Option<(Correspondence, palpate_cpu::Correspondence)> {
    Some((Correspondence::on(device(None)?), palpate_cpu::Correspondence))
}

fn sure<T>(result: Result<T, Failure>) -> T {
    result.unwrap_or_else(|e| panic!("{e:?}"))
}

/// By how much shares differ at most: in P beside one, and in the mean that a place is drawn to, over the spread, weighted by P.
fn off(found: &[Share], right: &[Share], spread: f64) -> f64 {
    assert_eq!(found.len(), right.len());
    let one = |(a, b): (&Share, &Share)| {
        let weight = (a.0 - b.0).abs() / (1.0 + b.0);
        let pull = if b.0 > 0.0 { (a.1 - a.0 * (b.1 / b.0)).length() / spread / (1.0 + b.0) } else { 0.0 };
        weight.max(pull)
    };
    found.iter().zip(right).map(one).fold(0.0, f64::max)
}

/// Positions relative to the centre of a sheet of 0.3 m are right to 2e-8 m, so an exponent to 4 · 2e-8 m/σ: 1e-4 at σ = 0.8 mm. A pair at the
/// reach may be in on one side and out on the other, with e⁻⁸ = 3e-4 of the peak.
const CLOSE: f64 = 3e-4;

#[test]
fn shares_are_those_of_the_cpu_and_a_hundredth_of_the_spread_shows() {
    let Some((mut gpu, mut cpu)) = gpu_and_cpu() else { return };
    for (places, points, bend) in [(1500, 1100, 0.0), (3001, 2000, 3.0), (700, 2500, -6.0)] {
        let case = sheet(places, points, bend, four_cameras());
        let s = case.sighting();
        for spread in [0.25 * SPACING, SPACING, 4.0 * SPACING, 20.0 * SPACING] {
            let right = sure(cpu.shares(&s, spread, 0.05));
            let found = sure(gpu.shares(&s, spread, 0.05));
            let all: f64 = right.iter().map(|s| s.0).sum();
            let difference = off(&found, &right, spread);
            println!("{places} × {points}, σ = {spread}: Σ P = {all:.1}, off by {difference:.2e}");
            assert!(all > 0.1 * points as f64 && difference < CLOSE, "{difference}");
            let wrong = off(&sure(gpu.shares(&s, 1.01 * spread, 0.05)), &right, spread);
            assert!(wrong > CLOSE, "{spread}: {wrong}");
        }
    }
}

#[test]
fn wide_mixtures_of_many_are_thinned_as_on_the_cpu() {
    let Some((mut gpu, mut cpu)) = gpu_and_cpu() else { return };
    let case = sheet(4000, 3500, 2.0, four_cameras());
    let (s, spread) = (case.sighting(), 0.1);
    assert!(Mixing::new(s.points, s.places.len(), spread).thin > 1);
    let (found, right) = (sure(gpu.shares(&s, spread, 0.1)), sure(cpu.shares(&s, spread, 0.1)));
    assert!(right.iter().filter(|s| s.0 == 0.0).count() >= right.len() / 2);
    let difference = off(&found, &right, spread);
    assert!(difference < CLOSE, "{difference}");
}

#[test]
fn bits_repeat_whatever_was_asked_before() {
    let Some((mut gpu, _)) = gpu_and_cpu() else { return };
    let (case, other) = (sheet(1300, 900, 3.0, four_cameras()), sheet(2600, 2100, 0.0, four_cameras()));
    let bits =
        |shares: Vec<Share>| -> Vec<u64> { shares.iter().flat_map(|s| [s.0, s.1.x, s.1.y, s.1.z]).map(f64::to_bits).collect() };
    let first = bits(sure(gpu.shares(&case.sighting(), SPACING, 0.05)));
    // Larger buffers, which then hold what is left of a larger frame.
    sure(gpu.shares(&other.sighting(), 3.0 * SPACING, 0.05));
    sure(gpu.read(&other.sighting()));
    for _ in 0..3 {
        assert!(bits(sure(gpu.shares(&case.sighting(), SPACING, 0.05))) == first);
    }
    let mut fresh = Correspondence::on(gpu.gpu.clone());
    assert!(bits(sure(fresh.shares(&case.sighting(), SPACING, 0.05))) == first);
}

#[test]
fn sizes_around_a_block_of_the_sort_agree() {
    let Some((mut gpu, mut cpu)) = gpu_and_cpu() else { return };
    for (places, points) in [(1, 1), (2, 513), (511, 3), (512, 512), (513, 1024), (1025, 1026), (1537, 200)] {
        let case = sheet(places, points, 1.0, four_cameras());
        let s = case.sighting();
        let difference = off(&sure(gpu.shares(&s, 2.0 * SPACING, 0.05)), &sure(cpu.shares(&s, 2.0 * SPACING, 0.05)), SPACING);
        assert!(difference < CLOSE, "{places} × {points}: {difference}");
    }
}

#[test]
fn nobody_and_those_far_away_have_no_share() {
    let Some((mut gpu, mut cpu)) = gpu_and_cpu() else { return };
    let whole = sheet(600, 500, 1.0, four_cameras());
    let far = |p: &ObservedPoint| ObservedPoint { position: p.position + DVec3::new(40.0, -70.0, 3.0), ..*p };
    let cases = [
        Case { points: Vec::new(), ..sheet(600, 1, 1.0, four_cameras()) },
        Case { places: Vec::new(), ..sheet(1, 500, 1.0, four_cameras()) },
        Case { points: whole.points.iter().map(far).collect(), ..sheet(600, 1, 1.0, four_cameras()) },
    ];
    for case in &cases {
        let s = case.sighting();
        let found = sure(gpu.shares(&s, SPACING, 0.05));
        assert_eq!(found.len(), s.places.len());
        assert!(found.iter().all(|s| *s == (0.0, DVec3::ZERO)));
        assert_eq!(sure(gpu.rays(&s)), sure(cpu.rays(&s)));
        assert_eq!(sure(gpu.read(&s)), sure(cpu.read(&s)));
        assert_eq!(sure(gpu.visible(&s)).len(), 4);
    }
    // Without outliers a point that has no place near it belongs to nobody all the same.
    let s = cases[2].sighting();
    assert!(sure(gpu.shares(&s, SPACING, 0.0)).iter().all(|s| s.0 == 0.0));
    // With nothing but outliers no place has a share; a body that no camera sees has none.
    let behind = Camera::Pinhole { center: DVec3::new(0.3, -0.2, 3.0), axis: DVec3::Z };
    let unseen = sheet(600, 500, 1.0, vec![behind]);
    for (s, outliers) in [(whole.sighting(), 1.0), (unseen.sighting(), 0.05)] {
        let (found, right) = (sure(gpu.shares(&s, SPACING, outliers)), sure(cpu.shares(&s, SPACING, outliers)));
        assert!(right.iter().all(|s| s.0 == 0.0) && found.iter().all(|s| s.0 < 1e-20));
    }
}

#[test]
fn more_than_a_kernel_can_loop_over_is_refused() {
    let Some((mut gpu, _)) = gpu_and_cpu() else { return };
    let point = ObservedPoint { position: DVec3::ZERO, camera: 0 };
    let case = Case { points: vec![point; MOST_ITEMS + 1], ..sheet(10, 1, 0.0, four_cameras()) };
    let refusal = gpu.shares(&case.sighting(), SPACING, 0.05).err().map(|e| e.message());
    assert!(refusal.as_ref().is_some_and(|m| m.contains("depth points")), "{refusal:?}");
}

/// Pixels that a position may lie in, as single precision sees it: coordinates up to a few hundred are right to 1e-4.
fn pixels(eye: &Eye, p: DVec3) -> BTreeSet<(i64, i64)> {
    let away = p - eye.center;
    let at = |side: DVec3, shift: f64| (away.dot(side) / away.dot(eye.axis) / eye.pixel + shift).round() as i64;
    let shifts = [-1e-4, 1e-4];
    shifts.iter().flat_map(|a| shifts.map(|b| (at(eye.right, *a), at(eye.down, b)))).collect()
}

/// What a camera's picture is in doubt about.
struct Doubts {
    eye: Eye,
    /// Pixels whose nearest place may be another.
    pixels: BTreeSet<(i64, i64)>,
    nearest: BTreeMap<(i64, i64), f64>,
}

impl Doubts {
    fn new(eye: Eye, places: &[Place]) -> Doubts {
        let (mut doubtful, mut nearest) = (BTreeSet::new(), BTreeMap::new());
        for p in places {
            let away = p.position - eye.center;
            let cosine = p.normal.normalize().dot(away.normalize());
            let own = pixels(&eye, p.position);
            // Single precision tells a cosine to 1e-6 or better.
            if cosine < 1e-5 && (cosine.abs() < 1e-5 || own.len() > 1) {
                doubtful.extend(own);
            } else if cosine < 0.0 {
                let depth = nearest.entry(own.into_iter().next().unwrap_or_default()).or_insert(f64::INFINITY);
                *depth = depth.min(away.dot(eye.axis));
            }
        }
        Doubts { eye, pixels: doubtful, nearest }
    }

    /// Whether single precision may see a position otherwise.
    fn about(&self, p: DVec3, slack: f64) -> bool {
        let own = pixels(&self.eye, p);
        let depth = (p - self.eye.center).dot(self.eye.axis);
        let at_slack = |pixel| self.nearest.get(pixel).is_some_and(|n| (depth - n - slack).abs() < 1e-6);
        own.len() > 1 || own.iter().any(|pixel| self.pixels.contains(pixel) || at_slack(pixel))
    }
}

#[test]
fn who_is_seen_and_read_is_what_the_cpu_says() {
    let Some((mut gpu, mut cpu)) = gpu_and_cpu() else { return };
    for (places, points, bend) in [(3000, 2000, 0.0), (2999, 1500, 5.0), (600, 3000, -8.0)] {
        let case = sheet(places, points, bend, four_cameras());
        let s = case.sighting();
        let doubts: Vec<Option<Doubts>> = s.eyes().into_iter().map(|e| Some(Doubts::new(e?, s.places))).collect();
        let (found, right) = (sure(gpu.visible(&s)), sure(cpu.visible(&s)));
        let mut doubtful = vec![false; places];
        for (c, doubts) in doubts.iter().enumerate() {
            let seen = right[c].iter().filter(|seen| **seen).count();
            // Both sides are never seen together but by a camera without lines of sight.
            assert!(if c == 3 { seen == places } else { seen > places / 20 && seen < places }, "{c}: {seen}");
            for k in 0..places {
                let about = doubts.as_ref().is_some_and(|d| d.about(s.places[k].position, s.slack()));
                assert!(about || found[c][k] == right[c][k], "camera {c}, place {k}");
                doubtful[k] |= about;
            }
        }
        // A reading at the edge of a pixel puts both of them in doubt.
        let mut edges: Vec<BTreeSet<(i64, i64)>> = vec![BTreeSet::new(); 4];
        for p in s.points {
            if let Some(d) = &doubts[p.camera as usize] {
                let own = pixels(&d.eye, p.position);
                edges[p.camera as usize].extend(if own.len() > 1 { own } else { BTreeSet::new() });
            }
        }
        let at_edge = |k: usize| {
            let of = |(d, edges): (&Option<Doubts>, &BTreeSet<_>)| {
                d.as_ref().is_some_and(|d| pixels(&d.eye, s.places[k].position).iter().any(|p| edges.contains(p)))
            };
            doubts.iter().zip(&edges).any(of)
        };
        let (found, right) = (sure(gpu.read(&s)), sure(cpu.read(&s)));
        let sure_ones: Vec<usize> = (0..places).filter(|k| !doubtful[*k] && !at_edge(*k)).collect();
        println!("{places} places: {} beyond doubt", sure_ones.len());
        assert!(sure_ones.len() > places * 9 / 10);
        sure_ones.iter().for_each(|k| assert_eq!(found[*k], right[*k], "place {k}"));
        assert!(right.iter().any(|r| *r) && right.iter().any(|r| !*r));
    }
}

#[test]
fn rays_through_the_body_are_those_of_the_cpu() {
    let Some((mut gpu, mut cpu)) = gpu_and_cpu() else { return };
    for (places, points, bend) in [(3000, 2000, 0.0), (2999, 1500, 5.0), (600, 3000, -8.0)] {
        let case = sheet(places, points, bend, four_cameras());
        let s = case.sighting();
        let eyes = s.eyes();
        let doubts: Vec<Option<Doubts>> = eyes.into_iter().map(|e| Some(Doubts::new(e?, s.places))).collect();
        let about = |p: &&ObservedPoint| doubts[p.camera as usize].as_ref().is_some_and(|d| d.about(p.position, s.depth()));
        let doubtful = s.points.iter().filter(about).count();
        let (found, right) = (sure(gpu.rays(&s)), sure(cpu.rays(&s)));
        println!("{right:?}, on the device {found:?}, in doubt {doubtful}");
        assert!(right.met > points / 4 && right.through > 10 && doubtful < points / 20);
        assert!(found.met.abs_diff(right.met) <= doubtful && found.through.abs_diff(right.through) <= doubtful);
    }
}

/// Points and places in cubes that touch: what both halves of the E-step look at each.
fn pairs(s: &Sighting, reach: f64) -> usize {
    let low = s.places.iter().map(|p| p.position).fold(DVec3::INFINITY, DVec3::min) - DVec3::splat(reach);
    let cube = |p: DVec3| ((p - low) / reach).floor().as_i64vec3();
    let mut held = BTreeMap::<[i64; 3], usize>::new();
    s.places.iter().for_each(|p| *held.entry(cube(p.position).to_array()).or_default() += 1);
    let around = |p: &ObservedPoint| -> usize {
        let c = cube(p.position);
        let one = |k: i64| held.get(&[c.x + k % 3 - 1, c.y + k / 3 % 3 - 1, c.z + k / 9 - 1]).copied().unwrap_or(0);
        (0..27).map(one).sum()
    };
    s.points.iter().map(around).sum()
}

/// Bytes that the passes of an E-step read and write, each by itself: entries are sorted in so many dispatches, with a bisection each.
fn bytes(s: &Sighting, pairs: usize) -> usize {
    let (k, n, c) = (s.places.len(), s.points.len(), s.cameras.len());
    let span = k.max(n).next_multiple_of(BLOCK as usize);
    let merges = (span as f64 / f64::from(BLOCK)).log2().ceil() as usize;
    let entries = (2 + c) * span;
    // Keys with what they are made of; a block; merges with two reads of a bisection's steps, mean of its length.
    let hash = entries * (8 + 32) + entries * 16 + merges * entries * (16 + 2 * 8 * 11);
    let seen = c * k * (32 + 64 + 13 * 8 + 4) + c * k * 4;
    // Entry, position, weight; the second half also reads the point's inverse.
    hash + seen + pairs * (28 + 32) + (n + k) * (9 * 8 + 16 + 16)
}

/// Times that an E-step is repeated.
const RUNS: u32 = 40;

/// What this process has spent on all cores [s], in hundredths; zero where the system does not tell.
fn processor_time() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // After the name, which may hold blanks: the twelfth and the thirteenth are user's and system's time.
    let numbers: Vec<f64> = text.rsplit(')').next().unwrap_or("").split(' ').filter_map(|n| n.parse().ok()).collect();
    numbers.get(10..12).map_or(0.0, |ticks| ticks.iter().sum::<f64>() / 100.0)
}

#[test]
// It times: other work on the machine would be timed with it.
#[ignore = "slow: cargo xtask test --full"]
fn a_frame_of_7200_places_and_6000_points() {
    let Some(gpu) = device(None) else { return };
    let case = sheet(7200, 6000, 2.0, four_cameras()[..3].to_vec());
    let s = case.sighting();
    let mut counted = Correspondence::on(gpu.clone()).counted().unwrap_or_else(|e| panic!("{e}"));
    sure(counted.shares(&s, SPACING, 0.05));
    let pairs = pairs(&s, 4.0 * SPACING);
    println!("{:?}, {pairs} pairs, {:.1} MB", counted.dispatches(), 1e-6 * bytes(&s, pairs) as f64);
    // Least and mean time of the E-step, and what all cores together spent on one [ms].
    let clock = |who: &mut dyn Correspond| {
        sure(who.shares(&s, SPACING, 0.05));
        let (mut least, before, begun) = (f64::INFINITY, processor_time(), std::time::Instant::now());
        for _ in 0..RUNS {
            let begun = std::time::Instant::now();
            sure(who.shares(&s, SPACING, 0.05));
            least = begun.elapsed().as_secs_f64().min(least);
        }
        let mean = begun.elapsed().as_secs_f64() / f64::from(RUNS);
        let spent = (processor_time() - before) / f64::from(RUNS);
        format!("least {:.2} ms, mean {:.2} ms, {:.2} ms of processor time", 1e3 * least, 1e3 * mean, 1e3 * spent)
    };
    println!("CPU: {}", clock(&mut palpate_cpu::Correspondence));
    println!("{}: {}", gpu.name, clock(&mut Correspondence::on(gpu.clone())));
    let mut timed = Correspondence::on(gpu.clone()).timed();
    (0..4).for_each(|_| _ = sure(timed.shares(&s, SPACING, 0.05)));
    for (name, time) in timed.pass_times() {
        println!("  {name}: {:.3} ms in {} dispatches", time.nanoseconds / 4e6, time.count / 4);
    }
    let shares = sure(Correspondence::on(gpu).shares(&s, SPACING, 0.05));
    assert!(shares.iter().map(|s| s.0).sum::<f64>() > 3000.0);
}

#[test]
fn a_tracker_that_asks_the_device_takes_the_steps_of_one_that_does_not() {
    let Some(gpu) = device(None) else { return };
    let mut scene = ball(0.02);
    scene.observation = watched();
    let plan = seen(&scene);
    let nodes = plan.body.nodes.len();
    let mut alone = palpate_cpu::Tracker::new(&plan);
    let mut asking = palpate_cpu::Tracker::with(&plan, Box::new(Correspondence::on(gpu)));
    let pose = Pose { displacement: vec![DVec3::ZERO; nodes], velocity: vec![DVec3::ZERO; nodes] };
    let problem = Problem { frame: 1, prior: Prior::Held(&pose, 0.02), temperature: 1e-3 };
    let (mut a, mut b) = (pose.displacement.clone(), pose.displacement.clone());
    for spread in [0.03, 0.02, 0.01] {
        let pull = Pull::Mixture { spread, outliers: 0.05 };
        let fall = sure(alone.approach(&problem, pull, &mut a));
        assert!((sure(asking.approach(&problem, pull, &mut b)) / fall - 1.0).abs() < 1e-2, "{fall}");
    }
    let largest = a.iter().map(|v| v.length()).fold(0.0, f64::max);
    let apart = a.iter().zip(&b).map(|(a, b)| (*a - *b).length()).fold(0.0, f64::max);
    println!("moved by {largest:.2e} m, apart by {apart:.2e} m");
    // Directions are solved for to a hundredth; what shares differ by is far below.
    assert!(largest > 1e-5 && apart < 1e-2 * largest);
    assert!((sure(alone.pierced(1, &a)) - sure(asking.pierced(1, &a))).abs() < 0.02);
    let (right, found) = (sure(alone.seen(1, &a)), sure(asking.seen(1, &a)));
    let same = right.iter().zip(&found).filter(|(a, b)| a == b).count();
    assert!(right.iter().any(|r| *r) && same * 50 >= right.len() * 49, "{same} of {}", right.len());
}
