//! The table and what stands around it: absence, defaults, choices, paths and shares.

use super::driven::{Drive, Points};
use super::law::{COMMON, Followed};
use super::moving::Moving;
use super::{ALL, Effect, Site, Unstated, check_choices, find};
use crate::mechanics::motion::RigidMotion;
use crate::mechanics::path::Path;
use crate::mechanics::series::Series;
use crate::params::Transform;
use crate::scene::Analytic;
use crate::shape::Placed;
use glam::DVec3;

fn place(kind: &str) -> usize {
    find(kind).expect("the law is in the table")
}

#[test]
fn an_effect_is_absent_where_all_of_its_amplitudes_are() {
    let absent = |kind: &str, values: &[f64]| ALL[place(kind)].is_absent(values);
    assert!(absent("uniform-force", &[0.0, 0.0, 0.0]) && !absent("uniform-force", &[0.0, 1e-9, 0.0]));
    // The air's density and a tether's anchor are no amplitudes.
    assert!(absent("air-drag", &[0.0, 1.2]) && !absent("air-drag", &[0.1, 0.0]));
    // A ball that pushes has none: it is there, or the scene does not have it.
    assert!(!absent("push", &[0.0, 0.0]) && !absent("push", &[1.0, 0.02]));
    assert_eq!(find("air-drags"), None);
}

#[test]
fn tables_of_a_scene_and_directions_are_those_stated() {
    let tables = |name: &str| ALL.iter().filter(|l| l.table() == name).map(|l| l.kind).collect::<Vec<_>>();
    assert_eq!(tables("load"), ["file-load", "jet"]);
    assert_eq!(tables("attach"), ["attachment"]);
    assert_eq!(tables("obstacle"), ["obstacle"]);
    assert_eq!(tables("effect").len(), ALL.len() - 4);
    let mut directions: Vec<_> =
        ALL.iter().flat_map(|l| l.params.iter().filter(|p| p.is_direction()).map(|p| (l.kind, p.key))).collect();
    directions.dedup();
    let known = [
        ("second-plane", "normal"),
        ("two-part-stiffness", "direction"),
        ("transverse-anisotropy", "fibre"),
        ("depth-bias-part", "direction"),
    ];
    assert_eq!(directions, known);
    // Along x unless stated.
    let plane = Effect::absent(place("second-plane"));
    assert_eq!(plane.values[2..5], [Some(1.0), Some(0.0), Some(0.0)]);
}

/// Or an effect would count as absent for where it acts, and a diagnosis would take a place for a strength.
#[test]
fn places_and_velocities_of_the_air_are_no_amplitudes() {
    let vectors = |which: fn(Unstated) -> bool| {
        let of = |l: &'static super::Law| {
            l.params.iter().filter(move |p| p.axis.is_some() && which(p.default)).map(|p| (l.kind, p.key))
        };
        let all: Vec<_> = ALL.iter().flat_map(of).collect();
        all.chunks(3)
            .map(|c| c[0])
            .inspect(|c| assert_eq!(all.iter().filter(|o| *o == c).count(), 3, "{c:?}"))
            .collect::<Vec<_>>()
    };
    let on_body = ["point-mass", "tether", "impulse", "handle", "inclusion", "density-inclusion"];
    let found = vectors(|d| d == Unstated::OnBody);
    assert_eq!(found.iter().map(|f| f.0).collect::<Vec<_>>(), on_body);
    let of_body = [("tether", "anchor"), ("depth-bias-part", "position"), ("slack", "center")];
    assert_eq!(vectors(|d| d == Unstated::Center), of_body);
    assert_eq!(vectors(|d| d == Unstated::Reference), [("second-plane", "point")]);
    let offsets = [("attachment", "offset"), ("jet", "offset"), ("obstacle", "offset")];
    assert_eq!(vectors(|d| d == Unstated::Fixed(0.0)), offsets);
    let wind = ALL[place("wind")].params;
    assert!(wind[..6].iter().all(|p| p.default == Unstated::Stated(0.0) && ["mean", "gust"].contains(&p.key)));
    // Bounds of directions and of logarithms are those that keep numbers finite.
    for (kind, key, bound) in
        [("second-plane", "normal", 1e3), ("stiffness-modes", "square", 7.0), ("stiffness-modes", "mixed", 7.0)]
    {
        let of = ALL[place(kind)].params.iter().filter(|p| p.key == key);
        assert!(of.clone().count() == 3 && of.clone().all(|p| (p.lower, p.upper) == (-bound, bound)), "{kind} {key}");
    }
    // A stiffness goes by factors, all else by differences.
    let relative = |l: &'static super::Law| l.params.iter().filter(|p| p.transform != Transform::Linear).map(|p| (l.kind, p.key));
    assert_eq!(ALL.iter().flat_map(relative).collect::<Vec<_>>(), [("contact-stiffness", "change")]);
}

#[test]
fn defaults_stand_still_and_places_are_the_bodys_centre() {
    for law in 0..ALL.len() {
        let effect = Effect::absent(law);
        let kind = effect.law().kind;
        assert_eq!(effect.path.is_some(), ["push", "handle"].contains(&kind), "{kind}");
        assert_eq!(effect.drive.is_some(), ["file-load", "attachment"].contains(&kind), "{kind}");
        assert_eq!(effect.moving.is_some(), ["jet", "obstacle"].contains(&kind), "{kind}");
        assert!(effect.moving.is_none_or(|m| m.axis.is_normalized()), "{kind}: it blows nowhere");
    }
    let tether = Effect::absent(place("tether"));
    let center = DVec3::new(3.0, 4.0, 5.0);
    let values: Vec<f64> = (0..8).map(|slot| tether.value(slot, center)).collect();
    assert_eq!(values, [0.0, 3.0, 4.0, 5.0, 3.0, 4.0, 5.0, 0.01]);
    let stated = Effect { values: vec![Some(7.0); 8], ..tether };
    assert_eq!(stated.value(1, center), 7.0);
    let nozzle = Moving::nozzle(DVec3::new(0.0, 3.0, 4.0), RigidMotion::default());
    assert!((nozzle.axis - DVec3::new(0.0, 0.6, 0.8)).length() < 1e-15 && nozzle.shape.is_none());
    let ball = Analytic::Ball { radius: 0.1, center: DVec3::ZERO };
    let obstacle = Moving::obstacle(&Placed::new(ball, glam::DAffine3::IDENTITY), 0.01, RigidMotion::default());
    let shape = obstacle.shape.expect("an obstacle has a shape");
    // A tenth of a cell is far above what a cubic spline leaves of a ball ten cells wide.
    assert!((shape.distance.at(DVec3::X * 0.13).value - 0.03).abs() < 1e-3 && shape.surface.volume() > 0.0);
    let still = Drive::still();
    assert!(still.points.len() == 1 && !still.points.is_empty());
    assert_eq!(Points::Places(vec![DVec3::ZERO; 3], None).len(), 3);
    assert!(Points::Nodes(Vec::new()).is_empty());
}

#[test]
fn a_camera_or_marker_that_does_not_exist_is_refused() {
    let chosen = |kind: &str, number: f64| {
        let mut effect = Effect::absent(place(kind));
        effect.values[0] = Some(number);
        vec![Effect::absent(place("air-drag")), effect]
    };
    let refusal = |effects: &[Effect], cameras, markers| check_choices(effects, cameras, markers).unwrap_err();
    assert_eq!(check_choices(&chosen("camera-pose", 1.0), 2, 0), Ok(()));
    assert_eq!(check_choices(&chosen("marker-offset", 2.0), 0, 3), Ok(()));
    // The seed of eddies is none of several.
    let mut wind = Effect::absent(place("wind"));
    wind.values[9] = Some(1e6);
    assert_eq!(check_choices(&[wind], 0, 0), Ok(()));
    for (kind, key, number, cameras, markers, message) in [
        ("camera-pose", "effect.1.camera", 2.0, 2, 9, "there is no camera number 2; they are 0 to 1"),
        ("camera-pose", "effect.1.camera", 1.0, 1, 9, "there is no camera number 1; the only one is 0"),
        ("camera-pose", "effect.1.camera", 0.0, 0, 9, "there is no camera that the effect could concern"),
        ("marker-offset", "effect.1.marker", 3.0, 9, 3, "there is no marker number 3; they are 0 to 2"),
    ] {
        assert_eq!(refusal(&chosen(kind, number), cameras, markers), (key.to_string(), message.to_string()));
    }
}

#[test]
fn what_is_followed_is_known_at_both_ends_of_a_step() {
    let [a, b] = [DVec3::X, DVec3::new(3.0, 2.0, 0.0)];
    let path = Path { times: vec![0.0, 2.0], points: vec![a, b] };
    let series = Series { count: 2, times: vec![0.0, 2.0], vectors: vec![DVec3::Z, a, DVec3::Z, b] };
    let both = |time: f64, rate: f64| [Followed::of(&path, time, rate), Followed::of_series(&series, 1, time, rate)];
    for (number, found) in both(1.5, 4.0).into_iter().enumerate() {
        let at = |t: f64| if number == 0 { path.at(t) } else { series.at(1, t) };
        assert_eq!((found.time, found.new, found.old), (1.5, at(1.5), at(1.25)));
    }
    // A static problem has one state.
    for found in both(1.5, 0.0) {
        assert_eq!(found.old, found.new);
        assert!(found.new[0].is_finite());
    }
}

#[test]
fn shares_add_to_one_by_volume_and_their_slopes_to_nothing() {
    let law = &ALL[place("point-mass")];
    let Site::Nodes(point) = law.site else { panic!("it acts on nodes") };
    let nodes = [DVec3::ZERO, DVec3::new(0.05, 0.0, 0.02), DVec3::new(-0.03, 0.04, 0.0)];
    let volumes = [1.0, 2.0, 0.5];
    let p = [0.1, 0.01, 0.02, -0.01, 0.03, 0.0];
    let shares = |p: &[f64]| point.shares(&nodes, &volumes, p).expect("nodes share it");
    let (values, slopes) = shares(&p);
    let weights: Vec<f64> = nodes
        .iter()
        .zip(volumes)
        .map(|(x, v)| v * (1.0 + (*x - DVec3::new(0.01, 0.02, -0.01)).length_squared() / (4.0 * 0.03 * 0.03)).powi(-4))
        .collect();
    let sum: f64 = weights.iter().sum();
    assert_eq!((values.len(), slopes.len()), (3, p.len()));
    assert!(values.iter().zip(&weights).all(|(s, w)| (s - w / sum).abs() < 1e-14));
    for (i, slope) in slopes.iter().enumerate() {
        let moved = |by: f64| {
            let mut p = p;
            p[i] += by;
            shares(&p).0
        };
        // A step of 1e-6 of lengths of 0.03: (1e-6/0.03)² of the third derivative, and rounding of 1e-10.
        let (more, less) = (moved(1e-6), moved(-1e-6));
        assert!((0..3).all(|k| ((more[k] - less[k]) / 2e-6 - slope[k]).abs() < 1e-6), "{i}: {slope:?}");
        assert!(slope.iter().sum::<f64>().abs() < 1e-12);
    }
    // Far beyond all, where weights underflow, nothing is shared, and nothing is infinite.
    let (far, slopes) = shares(&[0.1, 1e45, 0.0, 0.0, 1e-6, 0.0]);
    assert!(far.iter().chain(slopes.iter().flatten()).all(|s| *s == 0.0), "{far:?}");
    let uniform = &ALL[place("uniform-force")];
    let Site::Nodes(point) = uniform.site else { panic!("it acts on nodes") };
    assert!(point.shares(&nodes, &volumes, &[1.0, 0.0, 0.0]).is_none());
    // A law that never sleeps, and one that does in a static problem.
    let (z, still) = (vec![0.0; COMMON + 13], super::force_tests::still());
    assert!(!point.sleeps(&still, &z[..COMMON + 3]));
    let Site::Surface(wind) = ALL[place("wind")].site else { panic!("it acts on the surface") };
    assert!(wind.sleeps(&still, &z) && wind.skips(&still, &z));
    assert!(!wind.sleeps(&super::law::Place { rate: 100.0, ..still }, &z));
}
