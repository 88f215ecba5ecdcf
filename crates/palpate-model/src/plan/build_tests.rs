//! Plans made from scenes: places of clamps, masses and markers.

use super::*;
use crate::cutcells::clamp_edge::{Held, slope};
use crate::mechanics::motion::RigidMotion;
use crate::plan::ClampCell;
use crate::scene::*;
use glam::{DMat3, DQuat, DVec3};
use std::path::PathBuf;

/// A beam 0.2 × 0.05 × 0.04 m on the lattice of h = 0.01 m, unless posed.
fn scene() -> Scene {
    Scene {
        path: PathBuf::new(),
        title: String::new(),
        object: Object {
            source: BodySource::Analytic(Analytic::Box { min: DVec3::ZERO, max: DVec3::new(0.2, 0.05, 0.04) }),
            pose: DAffine3::IDENTITY,
            resolution: Resolution::CellSize(0.01),
        },
        material: Material {
            model: &crate::materials::ALL[0],
            inertia: Inertia::Density(1000.0),
            youngs_modulus: 1e5,
            poisson_ratio: 0.4,
            mass_damping: 0.1,
            stiffness_damping: 0.01,
            viscosity: None,
        },
        gravity: DVec3::new(0.0, 0.0, -9.81),
        clamps: vec![],
        planes: vec![],
        masses: vec![],
        effects: Vec::new(),
        fields: Vec::new(),
        curves: Default::default(),
        initial: Initial { velocity: DVec3::X, angular_velocity: DVec3::Y, pivot: None, state: InitialShape::Rest },
        time: Time { step: 0.01, steps: 10, start: 0.5, ..Time::weighted(0.6) },
        solver: Solver::default(),
        observation: None,
        targets: Vec::new(),
        synthesis: Synthesis::default(),
        tracking: crate::scene::Tracking::default(),
        fit: None,
    }
}

fn plan(scene: &Scene) -> Result<Plan, PlanError> {
    build_plan(scene, Observation::default(), &[])
}

/// Held area [m²], volume [m³] and ∫ n dS [m²].
fn held(site: &ClampSite) -> (f64, f64, DVec3) {
    let sum = |m: &[[f64; 8]; 8]| m.iter().flatten().sum::<f64>();
    (
        site.cells.iter().map(|c| sum(&c.surface_mass)).sum(),
        site.cells.iter().map(|c| sum(&c.volume_mass)).sum(),
        site.cells.iter().flat_map(|c| c.surface_normal).sum(),
    )
}

#[test]
fn clamps_hold_what_their_box_cuts_out_of_the_body() {
    let mut scene = scene();
    // The end x = 0 only touched; then 0.015 m of the beam, cutting cells in half.
    scene.clamps.push(Clamp::still(DVec3::new(-0.1, -0.1, -0.1), DVec3::new(0.0, 0.1, 0.1)));
    scene.clamps.push(Clamp::still(DVec3::new(-0.1, -0.1, -0.1), DVec3::new(0.015, 0.1, 0.1)));
    // Inside the body: all six faces.
    scene.clamps.push(Clamp::still(DVec3::splat(0.015), DVec3::splat(0.025)));
    let plan = plan(&scene).unwrap();
    let end = 0.05 * 0.04;
    for (site, area, volume, normal) in [
        (&plan.clamps[0], end, 0.0, -DVec3::X * end),
        (&plan.clamps[1], end, 0.015 * end, -DVec3::X * end),
        (&plan.clamps[2], 6e-4, 1e-6, DVec3::ZERO),
    ] {
        let (a, v, n) = held(site);
        assert!((a - area).abs() < 1e-14 && (v - volume).abs() < 1e-16 && (n - normal).length() < 1e-14, "{a} {v} {n}");
        for c in &site.cells {
            // Where something is free, mean gradients reproduce the gradient of linear fields.
            if c.free(&plan.body).fraction == 0.0 {
                assert!(c.mean_gradient == [DVec3::ZERO; 8]);
                continue;
            }
            let nodes = plan.body.cells()[c.cell as usize].nodes;
            let mut f = DMat3::ZERO;
            for i in 0..8 {
                let (x, g) = (plan.body.nodes[nodes[i] as usize], c.mean_gradient[i]);
                f += DMat3::from_cols(x * g.x, x * g.y, x * g.z);
            }
            assert!((0..3).all(|k| (f.col(k) - DMat3::IDENTITY.col(k)).length() < 1e-12), "{f}");
        }
    }
}

#[test]
fn boxes_in_the_object_frame_turn_with_it() {
    let mut scene = scene();
    scene.object.pose = DAffine3::from_rotation_translation(
        DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.6),
        DVec3::new(0.013, 0.0, -0.2),
    );
    let motion = RigidMotion { times: vec![0.0], translations: vec![DVec3::ZERO], rotations: vec![DQuat::IDENTITY] };
    let region = Clamp::still(DVec3::new(-0.1, -0.1, -0.1), DVec3::new(0.06, 0.1, 0.1));
    scene.clamps = vec![region.in_object_frame().moved(Some(motion))];
    let plan = plan(&scene).unwrap();
    assert!(plan.clamps[0].motion.is_some());
    let (area, volume, _) = held(&plan.clamps[0]);
    // Tilted edges are rounded off within h/16: a thousandth of volume and of a section.
    assert!((volume / (0.06 * 0.002) - 1.0).abs() < 2e-3, "{volume}");
    assert!((area / 0.002 - 1.0).abs() < 2e-3, "{area}");
    assert!((plan.body.volume / 0.0004 - 1.0).abs() < 2e-3);
}

#[test]
fn clamps_that_leap_are_found_with_the_step_in_which_they_do() {
    let region = Clamp::still(DVec3::new(-0.1, -0.1, -0.1), DVec3::new(0.02, 0.1, 0.1));
    let leaps = |rows: &[(f64, DVec3)]| {
        let motion = RigidMotion {
            times: rows.iter().map(|r| r.0).collect(),
            translations: rows.iter().map(|r| r.1).collect(),
            rotations: vec![DQuat::IDENTITY; rows.len()],
        };
        let plan = plan(&Scene { clamps: vec![region.clone().moved(Some(motion))], ..scene() }).unwrap();
        // The scene starts at half a second and has ten steps of ten milliseconds.
        plan.jumps(0.5, 0.1)
    };
    // Ten centimetres a second: a millimetre a step, evenly.
    assert!(leaps(&[(0.5, DVec3::ZERO), (0.6, 0.01 * DVec3::Y)]).is_empty());
    // Still, and 3 cm away from one step to the next; held again.
    let sudden = leaps(&[(0.5, DVec3::ZERO), (0.54, DVec3::ZERO), (0.55, 0.03 * DVec3::Y), (0.6, 0.03 * DVec3::Y)]);
    assert!(sudden.len() == 1 && (sudden[0].from - 0.54).abs() < 1e-9 && (sudden[0].to - 0.55).abs() < 1e-9, "{sudden:?}");
    assert!((sudden[0].distance - 0.03).abs() < 1e-9, "{sudden:?}");
    assert_eq!(sudden[0].to_string(), "clamp.0 jumps by 0.03 m within a step, from 0.54 s to 0.55 s");
    // Half a metre away from the rest place from the beginning: places instead of ways.
    let away = leaps(&[(0.5, 0.5 * DVec3::Z)]);
    assert_eq!(away[0].to_string(), "clamp.0 is 0.5 m away from its rest place at the start, 0.5 s");
}

#[test]
fn clamp_beside_the_body_is_an_error_that_names_it() {
    let mut scene = scene();
    scene.clamps.push(Clamp::still(DVec3::new(-0.1, -0.1, -0.1), DVec3::new(0.01, 0.1, 0.1)));
    scene.clamps.push(Clamp::still(DVec3::splat(1.0), DVec3::splat(2.0)));
    let message = plan(&scene).unwrap_err().to_string();
    assert!(message.starts_with("clamp.1.box: ") && message.contains("0.2, 0.05, 0.04"), "{message}");
}

#[test]
fn theta_follows_the_layout() {
    let mut scene = scene();
    scene.material.inertia = Inertia::Mass(0.8);
    let normal = DVec3::new(0.1, 0.2, 1.0).normalize();
    scene.planes.push(Plane { point: DVec3::new(0.0, 0.0, -0.3), normal, stiffness: Some(1e6) });
    scene.masses.push(PointMass { point: DVec3::new(0.2, 0.02, 0.02), mass: 0.05 });
    let plan = plan(&scene).unwrap();
    let physics = crate::plan::Physics::new(&plan.layout, &plan.theta);
    assert!((physics.density - 0.8 / 0.0004).abs() < 1e-9, "mass over volume: {}", physics.density);
    assert_eq!((physics.velocity, physics.angular_velocity, physics.start), (DVec3::X, DVec3::Y, 0.5));
    let [height, theta, phi] = physics.planes[0];
    assert!((height + 0.3 * normal.z).abs() < 1e-15);
    assert!((plan.planes[0].normal(theta, phi)[0] - normal).length() < 1e-14);
    assert_eq!((plan.planes[0].stiffness, physics.masses[0]), (Some(1e6), 0.05));
    assert!((plan.pivot - DVec3::new(0.1, 0.025, 0.02)).length() < 1e-14, "pivot: {}", plan.pivot);
}

#[test]
fn point_masses_sit_on_or_near_the_body() {
    let mut scene = scene();
    let inside = DVec3::new(0.113, 0.021, 0.017);
    for point in [inside, DVec3::new(0.2, 0.05, 0.04), DVec3::new(0.207, 0.02, 0.02)] {
        scene.masses = vec![PointMass { point, mass: 1.0 }];
        let plan = plan(&scene).unwrap();
        let x = plan.masses.get(0).at(&plan.body.nodes);
        assert!((x - point.min(DVec3::new(0.2, 0.05, 0.04))).length() < 1e-14, "{x}");
    }
    scene.masses = vec![PointMass { point: inside, mass: 1.0 }, PointMass { point: DVec3::new(0.3, 0.0, 0.0), mass: 1.0 }];
    let message = plan(&scene).unwrap_err().to_string();
    assert!(message.starts_with("mass.1.point: ") && message.contains("0.1000 m away"), "{message}");
}

#[test]
fn resolution_errors_name_their_key() {
    let mut scene = scene();
    scene.object.resolution = Resolution::Cells(40);
    assert!((build_body(&scene).unwrap().0.length - 0.005).abs() < 1e-17);
    scene.object.resolution = Resolution::CellSize(1.0);
    let message = build_body(&scene).unwrap_err().to_string();
    assert!(message.starts_with("object.cell_size: ") && message.contains("0.2000 × 0.0500 × 0.0400"), "{message}");
    scene.object.resolution = Resolution::Cells(0);
    assert!(build_body(&scene).unwrap_err().to_string().starts_with("object.cells: "));
}

#[test]
fn markers_are_attached_in_the_order_given() {
    let scene = scene();
    let rest = |name: &str, position, surface| MarkerRest { name: name.into(), position, surface };
    let tip = DVec3::new(0.2, 0.02, 0.02);
    let markers = [rest("stalk", tip + DVec3::X * 0.01, Some(tip)), rest("nearest", DVec3::new(0.1, 0.02, 0.045), None)];
    let plan = build_plan(&scene, Observation::default(), &markers).unwrap();
    let sites = &plan.observation.markers;
    assert_eq!(sites.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["stalk", "nearest"]);
    // A turned and shifted body carries the markers along.
    let (r, b) = (DMat3::from_rotation_y(0.5), DVec3::new(0.0, 1.0, 0.0));
    for (site, rest) in sites.iter().zip(&markers) {
        let (x, f) = site.carry(|n| r * plan.body.nodes[n] + b);
        assert!((x + f * site.stalk - (r * rest.position + b)).length() < 1e-12);
    }
    assert!((sites[1].stalk - DVec3::Z * 0.005).length() < 1e-14);
    let far = [rest("far", tip, Some(DVec3::splat(9.0)))];
    let message = build_plan(&scene, Observation::default(), &far).unwrap_err().to_string();
    assert!(message.starts_with("markers.rest \"far\".surface: "), "{message}");
    for surface in [None, Some(tip)] {
        let far = [rest("far", DVec3::splat(9.0), surface)];
        let message = build_plan(&scene, Observation::default(), &far).unwrap_err().to_string();
        assert!(
            message.starts_with("markers.rest \"far\".position: ") && message.contains("the body's diagonal, 0.21"),
            "{message}"
        );
    }
}

/// Largest difference of two lists of clamp cells' moments, in units of a full cell's; cells that hold nothing may be missing.
fn apart(a: &[ClampCell], b: &[ClampCell], h: f64) -> f64 {
    let numbers = |c: &ClampCell| {
        let surface = c.surface_mass.iter().flatten().map(|x| x / (h * h));
        let normal = c.surface_normal.iter().flat_map(|n| n.to_array()).map(|x| x / (h * h));
        surface.chain(normal).chain(c.volume_mass.iter().flatten().map(|x| x / h.powi(3))).collect::<Vec<f64>>()
    };
    let one_way = |a: &[ClampCell], b: &[ClampCell]| {
        let off = |c: &ClampCell| match b.iter().find(|d| d.cell == c.cell) {
            Some(d) => numbers(c).iter().zip(numbers(d)).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max),
            None => numbers(c).into_iter().map(f64::abs).fold(0.0, f64::max),
        };
        a.iter().map(off).fold(0.0, f64::max)
    };
    one_way(a, b).max(one_way(b, a))
}

#[test]
fn a_shifted_edge_holds_what_a_larger_box_would() {
    let mut scene = scene();
    // Off the lattice and turned: edge and surface cut cells. The box is wide across, and ends 0.031 m along the beam in its own frame.
    scene.object.pose = DAffine3::from_rotation_translation(DQuat::from_rotation_z(0.3), DVec3::new(0.003, 0.001, 0.002));
    let boxed = |end: f64| {
        let mut scene = scene.clone();
        scene.clamps = vec![Clamp::still(DVec3::splat(-1.0), DVec3::new(end, 0.0501, 0.0398)).in_object_frame()];
        plan(&scene).unwrap()
    };
    let stated = boxed(0.031);
    let (body, site) = (&stated.body, &stated.clamps[0]);
    let h = body.length;
    // The lateral faces lie 0.1 mm outside and 0.2 mm inside the beam: beside it, so that they stay.
    for shift in [0.0, 0.004, 0.023, -0.007, -0.026, 0.1] {
        let held = site.edge.cells(body, &site.cells, shift);
        let now: Vec<ClampCell> = held.iter().map(|h| h.now.clone()).collect();
        assert!(now.is_sorted_by_key(|c| c.cell));
        // Sums over the same pieces in another order.
        assert!(apart(&now, &boxed(0.031 + shift).clamps[0].cells, h) < 1e-9, "{shift} m");
        if shift == 0.0 {
            let same = |c: &ClampCell| now.iter().any(|n| format!("{n:?}") == format!("{c:?}"));
            assert!(site.cells.iter().all(same), "at 0 the plan's own cells");
        }
        // The held volume grows by the beam's cross section, as far as the box reaches across it.
        let sum = |c: &ClampCell| c.volume_mass.iter().flatten().sum::<f64>();
        let by = |h: &Held| h.near.as_ref().map_or(0.0, |(f, step)| slope(sum(&h.now), sum(&f[0]), sum(&f[1]), *step));
        let section: f64 = held.iter().map(by).sum();
        // The body's volume is second order in the sub-lattice at its edges (0.2 %).
        assert!((section / (0.05 * 0.0398) - 1.0).abs() < 4e-3, "{shift} m: {section} m²");
    }
}

#[test]
fn a_clamp_that_only_touches_the_body_has_an_edge() {
    let mut scene = scene();
    scene.clamps = vec![Clamp::still(DVec3::splat(-1.0), DVec3::new(0.0, 1.0, 1.0))];
    let plan = plan(&scene).unwrap();
    let site = &plan.clamps[0];
    let volume = |held: &[Held]| held.iter().flat_map(|h| h.now.volume_mass.as_flattened()).sum::<f64>();
    assert!(volume(&site.edge.cells(&plan.body, &site.cells, 0.0)) == 0.0);
    let grown = volume(&site.edge.cells(&plan.body, &site.cells, 0.005));
    assert!((grown / (0.005 * 0.05 * 0.04) - 1.0).abs() < 1e-9, "{grown} m³");
    // A box around the whole body has no edge on it.
    let mut whole = scene.clone();
    whole.clamps = vec![Clamp::still(DVec3::splat(-1.0), DVec3::ONE)];
    let whole = super::tests::plan(&whole).unwrap();
    let site = &whole.clamps[0];
    assert!(site.edge.cells(&whole.body, &site.cells, -0.05).iter().all(|h| h.near.is_none()));
}

#[test]
fn a_shape_that_is_filled_keeps_its_volume_and_turns_with_its_pose() {
    let mut scene = scene();
    scene.object.source = BodySource::Analytic(Analytic::Ball { radius: 0.05, center: DVec3::new(0.1, 0.0, 0.0) });
    for edge in [0.05, 0.03] {
        scene.object.resolution = Resolution::Edge(edge);
        scene.object.pose = DAffine3::IDENTITY;
        let (mesh, kept) = made(&scene.object).unwrap();
        let exact = 4.0 / 3.0 * std::f64::consts::PI * 0.05f64.powi(3);
        // Chords of an eighth of the edge are missing in what measures the volume.
        assert!((mesh.volume() / exact - 1.0).abs() < 0.01, "{edge} m: {kept:?}, {} m³", mesh.volume());
        assert!(kept.error < -0.01 && kept.moved > 0.0, "{edge} m: {kept:?}");
        scene.object.pose = DAffine3::from_rotation_translation(DQuat::from_rotation_z(0.7), DVec3::Y);
        let (turned, _) = made(&scene.object).unwrap();
        assert_eq!(turned, mesh.transformed(&scene.object.pose), "the mesh does not depend on the pose");
    }
    scene.clamps = vec![Clamp::group("base")];
    let e = build_plan(&scene, Observation::default(), &[]).unwrap_err();
    assert_eq!(e.key, "clamp.0.group");
    assert!(e.message.contains("the tetrahedra of this body are made here: give a box"), "{e}");
    scene.object.resolution = Resolution::CellSize(0.02);
    let e = build_plan(&scene, Observation::default(), &[]).unwrap_err();
    assert!(e.key == "clamp.0.group" && e.message.contains("this body is cut out of a lattice: give a box"), "{e}");
    scene.object.resolution = Resolution::Edge(1e-5);
    assert_eq!(build_plan(&scene, Observation::default(), &[]).unwrap_err().key, "object.edge_length");
}
