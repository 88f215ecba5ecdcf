//! What a scene leaves open or knows beforehand, and where the next fit starts.

use super::tests::{BASE, parameters, read};
use super::*;
use palpate_model::materials::viscosity::Viscosity;

#[test]
fn what_is_known_beforehand_is_a_pair_for_each_component_or_one_for_all() {
    let known = |text: &str| parameters(text).iter().map(|p| p.known).collect::<Vec<_>>();
    let density = "[[fit.parameter]]\npath = \"material.density\"\n";
    assert_eq!(known(density), [None]);
    assert_eq!(known(&format!("{density}known = [1070, 50]\n")), [Some((1070.0, 50.0))]);
    let gravity = "[[fit.parameter]]\npath = \"world.gravity\"\n";
    assert_eq!(known(&format!("{gravity}known = [0, 0.1]\n")), [Some((0.0, 0.1)); 3]);
    let each = known(&format!("{gravity}known = [[0, 0.1], [0, 0.2], [-9.81, 0.01]]\n"));
    assert_eq!(each, [Some((0.0, 0.1)), Some((0.0, 0.2)), Some((-9.81, 0.01))]);
    // An effect's number that the scene does not state starts where it is known to be.
    let lump = "[[fit.parameter]]\npath = \"effect.0.mass\"\nknown = [0.2, 0.1]\n[[effect]]\nkind = \"point-mass\"\n";
    assert_eq!(known(lump), [Some((0.2, 0.1))]);
}

#[test]
fn cells_and_step_may_be_left_open() {
    let open = BASE.replace("cell_size = 0.01\n", "").replace("step = 0.008333\n", "");
    let scene = parse_scene(&open, "scene.toml").unwrap().value;
    assert_eq!((scene.object.resolution, scene.time.open), (palpate_model::scene::Resolution::Open, Some(1.5)));
    assert_eq!(read("").unwrap().value.time.open, None);
    // What was chosen is written where a fit writes what it found.
    let values = [("object.cell_size".to_string(), 0.0125), ("time.step".to_string(), 0.003)];
    let text = write_scene(&open, &scene, &values, Path::new(".")).unwrap();
    let again = parse_scene(&text, "model.toml").unwrap().value;
    assert_eq!(again.object.resolution, palpate_model::scene::Resolution::CellSize(0.0125));
    assert_eq!((again.time.step, again.time.steps, again.time.open), (0.003, 500, None));
}

#[test]
fn the_next_fit_starts_where_this_one_ended() {
    let fit = "[fit]\nstarts = 3\n[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = [1e4, 1e6]\nknown = [1e5, 2e4]\n\
               [[fit.parameter]]\npath = \"world.gravity\"\nstart = [0, 0, [-11, -9]]\n\
               [[fit.parameter]]\npath = \"plane.0.theta\"\nstart = 1.6\n[[fit.parameter]]\npath = \"initial.velocity.y\"\n";
    let text = format!("{BASE}{fit}");
    let scene = parse_scene(&text, "scene.toml").unwrap().value;
    let found = [
        ("material.youngs_modulus", 123456.789),
        ("world.gravity.x", 0.5),
        ("world.gravity.y", 0.25),
        ("world.gravity.z", -9.5),
        ("initial.velocity.y", 0.125),
    ];
    let mut values: Vec<(String, f64)> = found.iter().map(|(p, v)| (p.to_string(), *v)).collect();
    values.push(("plane.0.theta".into(), 1.5));
    let text = write_scene(&text, &scene, &values, Path::new(".")).unwrap();
    assert!(text.contains("start = 123456.789   # fitted, was [1e4, 1e6]\nknown = [1e5, 2e4]"), "{text}");
    let again = parse_scene(&text, "model.toml").unwrap().value.fit.unwrap().parameters;
    for (path, value) in found {
        let p = again.iter().find(|p| p.path == path).expect("it is still free");
        assert_eq!(p.start, (value, value), "{path}");
    }
    // Measured from another axis as soon as the normal turns: what is written is the normal.
    assert!(!text.contains("1.6"), "{text}");
    assert_eq!(again[0].known, Some((1e5, 2e4)));
}

#[test]
fn a_viscosity_is_read_fitted_and_written_back() {
    let with = |inner: &str| BASE.replace("density = 1000\n", &format!("density = 1000\nviscosity = {{ {inner} }}\n"));
    assert_ne!(with(""), BASE);
    let fit = "[fit]\n[[fit.parameter]]\npath = \"material.viscosity.coefficient\"\nstart = [1, 100]\n\
               [[fit.parameter]]\npath = \"material.viscosity.exponent\"\n";
    let text = format!("{}{fit}", with("coefficient = 8.0, exponent = 0.8"));
    let scene = parse_scene(&text, "scene.toml").unwrap().value;
    assert_eq!(scene.material.viscosity, Some(Viscosity { coefficient: 8.0, exponent: 0.8 }));
    let parameters = &scene.fit.as_ref().unwrap().parameters;
    assert_eq!((parameters[0].start, parameters[1].start), ((1.0, 100.0), (0.8, 0.8)));
    assert_eq!((parameters[0].bounds, parameters[1].bounds), ((1e-9, 1e9), (0.1, 3.0)));
    let values = [("material.viscosity.coefficient".to_string(), 12.5), ("material.viscosity.exponent".to_string(), 0.95)];
    let again = parse_scene(&write_scene(&text, &scene, &values, Path::new(".")).unwrap(), "model.toml").unwrap().value;
    assert_eq!(again.material.viscosity, Some(Viscosity { coefficient: 12.5, exponent: 0.95 }));
    // Newtonian where no more is said.
    let plain = parse_scene(&with("coefficient = 2"), "scene.toml").unwrap().value;
    assert_eq!(plain.material.viscosity, Some(Viscosity { coefficient: 2.0, exponent: 1.0 }));
    for (inner, message) in [
        ("exponent = 1", "material.viscosity.coefficient"),
        ("coefficient = -1", "must be ≥ 0"),
        ("coefficient = 1, exponent = 5", "must lie in [0.1, 3]"),
        ("coefficient = 1, power = 1", "known: coefficient, exponent"),
    ] {
        let refused = parse_scene(&with(inner), "scene.toml").expect_err(inner).to_string();
        assert!(refused.contains(message), "{refused}");
    }
    let none = format!("{BASE}{fit}");
    let refused = parse_scene(&none, "scene.toml").expect_err("there is none").to_string();
    assert!(refused.contains("material.viscosity.coefficient"), "{refused}");
}

#[test]
fn curves_of_stiffness_are_read_fitted_and_written_back() {
    let with = |inner: &str| BASE.replace("density = 1000\n", &format!("density = 1000\n{inner}\n"));
    let model = "model = \"principal-stretch\"";
    let curves = "stretch_curve = { stretches = [0.7, 1.3], factors = [1.5, 2.0] }\nvolume_curve = { ratios = [0.8] }";
    let fit = "[fit]\n[[fit.parameter]]\npath = \"material.stretch_curve.factors\"\nbounds = [0.1, 10]\n\
               [[fit.parameter]]\npath = \"material.volume_curve.factors.0\"\n";
    let text = format!("{}{fit}", with(&format!("{model}\n{curves}")));
    let scene = parse_scene(&text, "scene.toml").unwrap().value;
    assert_eq!((scene.curves.stretch.stretches.clone(), scene.curves.volume.factors.clone()), (vec![0.7, 1.3], vec![1.0]));
    let parameters = &scene.fit.as_ref().unwrap().parameters;
    let found: Vec<_> = parameters.iter().map(|p| (p.path.as_str(), p.start.0, p.bounds)).collect();
    assert_eq!(
        found,
        [
            ("material.stretch_curve.factors.0", 1.5, (0.1, 10.0)),
            ("material.stretch_curve.factors.1", 2.0, (0.1, 10.0)),
            ("material.volume_curve.factors.0", 1.0, (1e-3, 1e3)),
        ]
    );
    let values = [("material.stretch_curve.factors.1".to_string(), 3.25)];
    let again = parse_scene(&write_scene(&text, &scene, &values, Path::new(".")).unwrap(), "model.toml").unwrap().value;
    assert_eq!(again.curves.stretch.factors, [1.5, 3.25]);
    for (inner, message) in [
        (curves, "corotated-linear has no curves; set model = \"principal-stretch\""),
        (&format!("{model}\nstretch_curve = {{ factors = [1] }}"), "material.stretch_curve.stretches"),
        (&format!("{model}\nstretch_curve = {{ stretches = [1.2, 0.9] }}"), "must have increasing corners"),
        (&format!("{model}\nstretch_curve = {{ stretches = [0.9, 1] }}"), "has a corner at 1"),
        (&format!("{model}\nvolume_curve = {{ ratios = [0.9], factors = [1, 2] }}"), "1 corners and 2 factors"),
    ] {
        let refused = parse_scene(&with(inner), "scene.toml").expect_err(inner).to_string();
        assert!(refused.contains(message), "{refused}");
    }
}

#[test]
fn tetrahedra_may_be_made_and_their_edge_left_open() {
    use palpate_model::scene::Resolution;
    let of = |text: &str| parse_scene(&BASE.replace("cell_size = 0.01\n", text), "scene.toml");
    let made = "discretisation = \"tetrahedra\"\n";
    let scene = of(made).unwrap().value;
    assert_eq!(scene.object.resolution, Resolution::OpenEdge);
    let text = BASE.replace("cell_size = 0.01\n", made);
    let text = write_scene(&text, &scene, &[("object.edge_length".to_string(), 0.0125)], Path::new(".")).unwrap();
    assert_eq!(parse_scene(&text, "model.toml").unwrap().value.object.resolution, Resolution::Edge(0.0125));
    assert_eq!(of("discretisation = \"cells\"\ncells = 9\n").unwrap().value.object.resolution, Resolution::Cells(9));
    let e = of(&format!("{made}edge_length = 0.2\n")).unwrap_err().to_string();
    assert_eq!(e, "scene.toml:5: object.edge_length: 0.2 m is larger than the object, whose longest side is 0.1000 m");
    let e = of("discretisation = \"voxels\"\n").unwrap_err().to_string();
    assert_eq!(e, "scene.toml:4: object.discretisation: \"voxels\" is not known; allowed: \"cells\", \"tetrahedra\"");
}

#[test]
fn a_clamp_has_a_box_or_a_group() {
    let fault = |text: &str| read(&format!("[[clamp]]\n{text}")).unwrap_err().message;
    let whole = "box = { min = [0, 0, 0], max = [1, 1, 1] }\n";
    assert_eq!(fault(&format!("{whole}group = \"base\"\n")), "box and group exclude each other; give one");
    assert_eq!(
        fault("frame = \"world\"\n"),
        "missing; expected box = { min = [x, y, z], max = [x, y, z] }, or group = \"NAME\" of a volume mesh"
    );
    assert_eq!(
        fault("group = \"base\"\nframe = \"object\"\n"),
        "belongs to a box; a group has its nodes wherever the body is placed"
    );
    let scene = read("[[clamp]]\ngroup = \"base\"\n").unwrap().value;
    assert_eq!(scene.clamps[0].region, ClampRegion::Group("base".into()));
}

#[test]
fn other_values_are_as_if_somebody_had_typed_them() {
    let fit = "[fit]\nstarts = 3\n[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = [1e4, 1e6]\n";
    let text = format!("{BASE}{fit}");
    let scene = parse_scene(&text, "some/scene.toml").unwrap().value;
    let values = [("material.youngs_modulus".to_string(), 3.0e4), ("world.gravity.x".to_string(), 0.5)];
    let again = scene_with_values(&text, &scene, &values).unwrap();
    assert!(!again.contains("fitted, was") && again.contains("start = [1e4, 1e6]"), "{again}");
    let changed = parse_scene(&again, "some/scene.toml").unwrap().value;
    assert_eq!((changed.material.youngs_modulus, changed.gravity.x), (3.0e4, 0.5));
    assert_eq!((changed.gravity.y, changed.material.poisson_ratio), (scene.gravity.y, scene.material.poisson_ratio));
    let refused = scene_with_values(&text, &scene, &[("plane.3.height".to_string(), 0.0)]).unwrap_err().to_string();
    assert_eq!(refused, "some/scene.toml: plane.3.height: not a number of this scene");
}

#[test]
fn a_normal_is_freed_as_a_direction() {
    let read = |more: &str| {
        let text = format!("{BASE}[fit]\n[[fit.parameter]]\npath = \"plane.0.normal\"\n{more}");
        (parse_scene(&text, "scene.toml").map(|s| s.value.fit.unwrap().parameters), text)
    };
    // The scene's plane is level: its angles are measured from x.
    let angles = |p: &[palpate_model::scene::FitParameter]| {
        assert_eq!(p.iter().map(|p| p.path.as_str()).collect::<Vec<_>>(), ["plane.0.theta", "plane.0.phi"]);
        let site = palpate_model::plan::PlaneSite { polar_axis: 0, stiffness: None };
        site.normal(p[0].start.0, p[1].start.0)[0]
    };
    let p = read("").0.unwrap();
    // Sines and cosines of a right angle round.
    assert!((angles(&p) - DVec3::Z).length() < 1e-15, "{p:?}");
    assert_eq!(p[0].bounds, (f64::NEG_INFINITY, f64::INFINITY));
    let tilted = DVec3::new(0.3, 0.5, 0.9);
    let (p, text) = read("start = [0.3, 0.5, 0.9]\nwithin = 0.2\n");
    let p = p.unwrap();
    assert!((angles(&p) - tilted.normalize()).length() < 1e-15, "{p:?}");
    let far = |k: usize| p[k].bounds.1 - p[k].start.0;
    assert!((far(0) - 0.2).abs() < 1e-12 && (far(1) * p[0].start.0.sin() - 0.2).abs() < 1e-12, "{p:?}");
    // What was found goes into the plane; the start has served.
    let scene = parse_scene(&text, "scene.toml").unwrap().value;
    let found = [("plane.0.theta".to_string(), p[0].start.0), ("plane.0.phi".to_string(), p[1].start.0)];
    let text = write_scene(&text, &scene, &found, Path::new(".")).unwrap();
    let again = parse_scene(&text, "model.toml").unwrap().value;
    assert!((again.planes[0].normal - tilted.normalize()).length() < 1e-14 && !text.contains("start = [0.3"), "{text}");
    for (more, wanted) in [
        ("start = [0, 0, 0]", "fit.parameter.0.start: has no length"),
        ("start = [1, 0, 0.01]", "is nearly along x, far from the plane's normal"),
        ("bounds = [0, 1]", "say within (rad) how far it may turn"),
        ("known = [0, 1]", "plane.0.theta and .phi take known"),
        ("within = 4", "must be in (0, π] (rad)"),
    ] {
        let e = read(more).0.unwrap_err().to_string();
        assert!(e.contains(wanted), "{more}: {e}");
    }
    let text = format!("{BASE}[fit]\n[[fit.parameter]]\npath = \"world.gravity\"\nwithin = 0.1\n");
    let e = parse_scene(&text, "scene.toml").unwrap_err().to_string();
    assert!(e.contains("belongs to the normal of a plane, not to world.gravity"), "{e}");
}
