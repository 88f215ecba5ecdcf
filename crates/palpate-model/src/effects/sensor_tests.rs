//! Laws of readings: undone is what was applied, derivatives by central differences, and signs by hand.

use super::sensors::{MOST, Sensors};
use super::{ALL, Law, Site, Unstated};
use crate::mechanics::rotation::tests::Noise;
use crate::observation::{Camera, MarkerSite, Observation, ObservedPoint, ReadingKind};
use crate::params::{Layout, ParamKey};
use glam::{DAffine3, DMat3, DVec3};

fn reading_laws() -> Vec<usize> {
    (0..ALL.len()).filter(|l| matches!(ALL[*l].site, Site::Readings(_))).collect()
}

/// A camera that looks at points around the origin from half a metre.
fn camera() -> Camera {
    Camera::Pinhole { center: DVec3::new(0.3, -0.4, 0.1), axis: DVec3::new(-0.6, 0.75, -0.1).normalize() }
}

/// A layout with these effects, and random values for their parameters.
fn effects(laws: &[usize], noise: &mut Noise) -> (Layout, Vec<f64>) {
    let layout = Layout::new(0, 0, laws, &[]);
    let value = |key: &ParamKey| match *key {
        ParamKey::Effect { law, slot, .. } => {
            let p = &ALL[usize::from(law)].params[usize::from(slot)];
            match p.default {
                Unstated::Choice(_) => 0.0,
                Unstated::Center | Unstated::Reference | Unstated::OnBody => noise.uniform(-0.02, 0.02),
                // Never the wrong half space.
                Unstated::Stated(v) => v + 0.5 * noise.uniform(-1.0, 1.0),
                Unstated::Sharp(v) | Unstated::Fixed(v) => v,
                Unstated::Absent(_) => p.typical * noise.uniform(-1.0, 1.0),
            }
        }
        _ => 0.0,
    };
    let theta = layout.keys.iter().map(value).collect();
    (layout, theta)
}

/// All laws of readings in one chain, and each alone.
fn chains() -> Vec<Vec<usize>> {
    let laws = reading_laws();
    let alone = laws.iter().map(|l| vec![*l]);
    alone.chain([laws.clone(), laws.iter().rev().copied().collect()]).collect()
}

#[test]
fn what_is_applied_is_undone() {
    let mut noise = Noise(3);
    for chain in chains() {
        for _ in 0..50 {
            let (layout, theta) = effects(&chain, &mut noise);
            let sensors = Sensors::new(&layout, &theta);
            let truly = camera();
            let point = 0.1 * noise.vector(1.0);
            // A recording of this camera: the pixel is the same in its own frame, the depth and the stated pose differ.
            let Camera::Pinhole { center, axis } = truly else { panic!("{truly:?}") };
            let x = axis.any_orthonormal_vector();
            let pose = DAffine3::from_mat3_translation(DMat3::from_cols(x, axis.cross(x), axis), center);
            let pixel = pose.inverse().transform_point3(point);
            let stated = sensors.stated_pose(0, pose);
            let rigid = stated.matrix3.transpose() * stated.matrix3 - DMat3::IDENTITY;
            assert!(rigid.to_cols_array().iter().all(|e| e.abs() < 1e-14), "a pose stays rigid");
            let read = stated.transform_point3(pixel * (sensors.read(&truly, 0, point) / pixel.z));
            let camera = Camera::Pinhole { center: stated.translation, axis: stated.matrix3.z_axis };
            let seen = sensors.truth(&camera, &ObservedPoint { position: read, camera: 0 });
            // 1e-13 of half a metre, a hundred times that where the inverse is found by halving.
            assert!((seen.position() - point).length() < 1e-11, "{sensors:?}: {} {point}", seen.position());
            assert!((DVec3::from_array(seen.center) - center).length() < 1e-13);
            assert!((DVec3::from_array(seen.axis) - axis).length() < 1e-13);
            assert!(sensors.cameras(&[camera])[0].center().is_some_and(|c| (c - center).length() < 1e-13));
            assert!(sensors.true_pose(0, stated).abs_diff_eq(pose, 1e-13));
        }
    }
}

#[test]
fn slopes_match_central_differences() {
    let mut noise = Noise(4);
    for chain in chains() {
        for round in 0..30 {
            let (layout, mut theta) = effects(&chain, &mut noise);
            if round == 0 {
                // Exactly absent, where a diagnosis asks.
                theta.fill(0.0);
                for (p, key) in layout.keys.iter().enumerate() {
                    if let ParamKey::Effect { law, slot, .. } = *key {
                        let default = ALL[usize::from(law)].params[usize::from(slot)].default;
                        theta[p] = default.value().unwrap_or(0.0);
                    }
                }
            }
            let point = ObservedPoint { position: 0.1 * noise.vector(1.0), camera: 0 };
            let mut slopes = vec![DVec3::ZERO; theta.len()];
            Sensors::new(&layout, &theta).point_slopes(&camera(), &point, |_| true, |at, d| slopes[at] += d);
            for p in 0..theta.len() {
                let ParamKey::Effect { law, slot, .. } = layout.keys[p] else { continue };
                let spec = &ALL[usize::from(law)].params[usize::from(slot)];
                if matches!(spec.default, Unstated::Choice(_)) {
                    assert_eq!(slopes[p], DVec3::ZERO, "a choice has no derivative");
                    continue;
                }
                // Steps of 1e-4 of a size that matters: truncation 1e-8 of the third derivative, rounding 1e-12.
                let step = 1e-4 * spec.typical.min(theta[p].abs().max(1e-2));
                let at = |s: f64| {
                    let mut t = theta.clone();
                    t[p] += s * step;
                    Sensors::new(&layout, &t).truth(&camera(), &point).position()
                };
                let fd = (at(-2.0) - 8.0 * at(-1.0) + 8.0 * at(1.0) - at(2.0)) / (12.0 * step);
                let size = slopes[p].length().max(0.01);
                assert!((fd - slopes[p]).length() < 1e-6 * size, "{} {}: {fd} {}", ALL[chain[0]].kind, spec.key, slopes[p]);
            }
        }
    }
}

fn alone(kind: &str, values: &[(usize, f64)]) -> Sensors {
    let law = super::find(kind).expect("the law is in the table");
    let layout = Layout::new(0, 0, &[law], &[]);
    let first = layout.len() - ALL[law].params.len();
    let mut theta = vec![0.0; layout.len()];
    for (slot, p) in ALL[law].params.iter().enumerate() {
        theta[first + slot] = p.default.value().unwrap_or(0.0);
    }
    values.iter().for_each(|(slot, v)| theta[first + slot] = *v);
    Sensors::new(&layout, &theta)
}

#[test]
fn readings_are_the_truth_and_the_effect() {
    // One metre before the camera, 0.3 m to its side: the ray is √1.09 m long.
    let camera = Camera::Pinhole { center: DVec3::ZERO, axis: DVec3::Z };
    let point = DVec3::new(0.3, 0.0, 1.0);
    let read = |s: &Sensors| s.read(&camera, 0, point);
    assert!((read(&alone("depth-bias", &[(0, 0.02)])) - 1.02).abs() < 1e-15);
    assert!((read(&alone("depth-scale", &[(0, -0.05)])) - 0.95).abs() < 1e-15);
    assert!((read(&alone("depth-along-ray", &[(0, 1.0)])) - 1.09f64.sqrt()).abs() < 1e-15);
    // The plane x = 0: everything at 0.3 m, nothing at −0.3 m, half at the plane.
    let part = alone("depth-bias-part", &[(0, 0.02), (4, 0.0)]);
    assert!((read(&part) - 1.02).abs() < 1e-9);
    assert!((part.read(&camera, 0, DVec3::new(-0.3, 0.0, 1.0)) - 1.0).abs() < 1e-9);
    assert!((part.read(&camera, 0, DVec3::new(0.0, 0.0, 1.0)) - 1.01).abs() < 1e-9);
    // Of the plane's direction the length does not count: half a width before it the bias has its tanh.
    let part = alone("depth-bias-part", &[(0, 0.02), (1, 2.0), (4, 0.0), (7, 0.6)]);
    let seen = ObservedPoint { position: point, camera: 0 };
    let bias = 0.01 * (1.0 + 0.5f64.tanh());
    assert!((part.truth(&camera, &seen).position() - point * (1.0 - bias)).length() < 1e-15);
    // A scanner errs along its rays, and nobody knows the rays of points that were seen from nowhere.
    let bias = alone("depth-bias", &[(0, 0.02)]);
    let seen = ObservedPoint { position: point, camera: 0 };
    let along = bias.truth(&Camera::Scanner { center: DVec3::ZERO }, &seen).position();
    assert!((along - (1.0 - 0.02 / 1.09f64.sqrt()) * point).length() < 1e-15);
    assert_eq!(bias.truth(&Camera::Unknown, &seen).position(), point);
    bias.point_slopes(&Camera::Unknown, &seen, |_| true, |at, by| panic!("{at} {by}"));
    let cameras = [Camera::Scanner { center: point }, Camera::Unknown];
    assert_eq!(bias.cameras(&cameras), cameras);
    // A camera stated 1 cm further to the right sees everything 1 cm further to the right; only the one that it concerns.
    let moved = alone("camera-pose", &[(0, 1.0), (1, 0.01)]);
    let seen = |camera_number| ObservedPoint { position: point, camera: camera_number };
    assert!((moved.truth(&camera, &seen(1)).position() - (point - 0.01 * DVec3::X)).length() < 1e-15);
    assert_eq!(moved.truth(&camera, &seen(0)).position(), point);
    // Turned by a quarter about the axis, to the left: the true point lies to the right.
    let turned = alone("camera-pose", &[(6, std::f64::consts::FRAC_PI_2)]);
    assert!((turned.truth(&camera, &seen(0)).position() - DVec3::new(0.0, -0.3, 1.0)).length() < 1e-15);
    // Turned by half, where the cosine is not zero.
    let turned = alone("camera-pose", &[(6, std::f64::consts::PI)]);
    assert!((turned.truth(&camera, &seen(0)).position() - DVec3::new(-0.3, 0.0, 1.0)).length() < 1e-15);
    assert_eq!(alone("time-offset", &[(0, 0.25)]).ahead(), 0.25);
    let marker = alone("marker-offset", &[(0, 2.0), (1, 1.0), (3, 3.0)]);
    assert_eq!((marker.marker_offset(2), marker.marker_offset(0)), (DVec3::new(1.0, 0.0, 3.0), DVec3::ZERO));
}

#[test]
fn slopes_that_nobody_wants_are_left_out() {
    let (layout, theta) = effects(&reading_laws(), &mut Noise(5));
    let sensors = Sensors::new(&layout, &theta);
    let seen = ObservedPoint { position: DVec3::new(0.05, 0.02, -0.04), camera: 0 };
    let of = |wanted: &dyn Fn(usize) -> bool| {
        let mut found = Vec::new();
        sensors.point_slopes(&camera(), &seen, wanted, |at, by| found.push((at, by)));
        found
    };
    let all = of(&|_| true);
    assert!(all.len() > 10);
    for (at, by) in &all {
        assert_eq!(of(&|place| place == *at), [(*at, *by)]);
    }
    assert!(of(&|_| false).is_empty());
}

#[test]
fn points_clocks_and_sites_are_those_of_the_effects() {
    let point = DVec3::new(0.3, 0.0, 1.0);
    let cameras = [Camera::Pinhole { center: DVec3::ZERO, axis: DVec3::Z }];
    let seen = [ObservedPoint { position: point, camera: 0 }];
    // A bias of 2 cm is taken off a depth of 1 m; without laws of readings the recording's points are the true ones.
    let bias = alone("depth-bias", &[(0, 0.02)]);
    let moved = bias.points(&cameras, &seen).expect("they move");
    assert!(!bias.exact_points() && moved.len() == 1 && (moved[0].position - 0.98 * point).length() < 1e-15);
    let clock = alone("time-offset", &[(0, 0.25)]);
    assert!(clock.exact_points() && clock.points(&cameras, &seen).is_none());
    let (layout, theta) = effects(&[super::find("time-offset").unwrap(), super::find("time-offset").unwrap()], &mut Noise(6));
    let two = Sensors::new(&layout, &theta);
    assert_eq!(two.clocks().iter().map(|p| theta[*p]).sum::<f64>(), two.ahead());
    assert_eq!(two.clocks(), [layout.len() - 2, layout.len() - 1]);
    let site = |name: &str| MarkerSite {
        name: name.into(),
        kind: ReadingKind::Marker,
        stencil: Default::default(),
        stalk: DVec3::new(0.1, 0.2, 0.3),
    };
    let observation = Observation { markers: vec![site("a"), site("b")], ..Default::default() };
    let offset = alone("marker-offset", &[(0, 1.0), (1, 1.0), (3, 3.0)]);
    assert_eq!(offset.site(&observation, 0).stalk, DVec3::new(0.1, 0.2, 0.3));
    assert_eq!(
        (offset.site(&observation, 1).stalk, offset.site(&observation, 1).name.as_str()),
        (DVec3::new(1.1, 0.2, 3.3), "b")
    );
    assert_eq!(offset.marker_places(0).count(), 0);
    assert_eq!(offset.marker_places(1).count(), 1);
}

#[test]
fn laws_of_readings_fit_their_room() {
    for law in reading_laws() {
        let law: &Law = &ALL[law];
        assert!(law.params.len() <= MOST, "{}", law.kind);
    }
}
