//! Scenes read and written, and refused with what is wrong.

use super::*;
use crate::vtk::{Elements, Values, write_vtu};
use palpate_model::observation::ReadingKind;
use palpate_model::params::fields::{Basis, Blend, FieldSpec, Region, Scale, Varied};
use palpate_model::scene::FitParameter;

pub(super) const BASE: &str = r#"format = "scene/1"
[object]
shape = { ball = { radius = 0.05 } }   # a ball
cell_size = 0.01
[material]
density = 1000
youngs_modulus = 1e5   # soft
poisson_ratio = 0.4
[[plane]]
point = [0.1, 0, -0.06]
normal = [0, 0, 2]
[[mass]]
point = [0, 0, 0]
mass = 0.05
[time]
step = 0.008333
duration = 1.5
"#;

pub(super) fn read(extra: &str) -> Result<Loaded<Scene>, InputError> {
    parse_scene(&format!("{BASE}{extra}"), "some/scene.toml")
}

fn error(text: &str) -> String {
    parse_scene(text, "scene.toml").expect_err("must be refused").to_string()
}

/// The base scene with one text replaced by another, and the error it gives.
fn error_with(from: &str, to: &str) -> String {
    assert!(BASE.contains(from));
    error(&BASE.replace(from, to))
}

fn fit_error(parameter: &str) -> String {
    error(&format!("{BASE}[fit]\n[[fit.parameter]]\n{parameter}"))
}

#[test]
fn who_states_theta_means_its_scheme() {
    let scheme = |text: &str| {
        let base = BASE.replace("step = 0.008333", &format!("step = 0.008333\n{text}"));
        parse_scene(&base, Path::new("s.toml")).map(|r| (r.value.time.scheme.name, r.value.time.theta))
    };
    assert_eq!(scheme("theta = 0.5").unwrap(), ("theta", 0.5));
    assert_eq!(scheme("scheme = \"theta\"").unwrap(), ("theta", 0.6));
    let refused = scheme("scheme = \"tr-bdf2\"\ntheta = 0.5").unwrap_err().to_string();
    assert!(refused.contains("tr-bdf2") && refused.contains("has none"), "{refused}");
}

#[test]
fn absent_keys_take_the_documented_defaults() {
    let s = read("").unwrap().value;
    assert_eq!(s.time, Time { step: 0.008333, steps: 180, start: 0.0, ..Time::default() });
    assert_eq!(s.time.scheme.name, "tr-bdf2");
    assert_eq!(s.gravity, DVec3::new(0.0, 0.0, -9.81));
    assert_eq!(s.solver, Solver::default());
    assert_eq!(s.planes[0].normal, DVec3::Z);
    assert_eq!((s.material.mass_damping, s.material.stiffness_damping), (0.0, 0.0));
    let s = read("[observation]\nrecording = \"r\"\ncost = [\"markers\", \"sparse-surface\"]\n[fit]\n").unwrap().value;
    let o = s.observation.unwrap();
    assert_eq!(o.recording, Path::new("some/r"));
    assert_eq!((o.file.as_str(), o.band, o.every, o.pixel_stride), ("recording.toml", 4.0, 1, 1));
    assert_eq!(o.costs, [ReadingKind::Marker, ReadingKind::Depth]);
    assert_eq!((o.from, o.to), (f64::NEG_INFINITY, f64::INFINITY));
    let f = s.fit.unwrap();
    assert_eq!((f.optimizer, f.iterations, f.starts, f.seed, f.threads), (None, 50, 1, 1, 0));
}

#[test]
fn a_full_scene_is_read() {
    let s = read(
        r#"[solver]
element = "corner"
linear = "cg"
tolerance = 1e-6
newton_iterations = 7
ghost = 0
[initial]
velocity = [1, 2, 3]
pivot = [0, 0, 1]
[[clamp]]
box = { min = [-1, -1, -1], max = [1, 1, 0] }
frame = "object"
[observation]
recording = "../r"
file = "silhouettes.toml"
cost = "markers"
frames = { from = -0.5, to = 0.5, every = 2 }
[[observation.marker]]
name = "m"
position = [0, 0, 0.05]
"#,
    )
    .unwrap()
    .value;
    assert_eq!((s.solver.element, s.solver.linear), (Element::Corner, LinearSolver::ConjugateGradient));
    assert_eq!((s.solver.tolerance, s.solver.newton_iterations, s.solver.ghost), (1e-6, 7, 0.0));
    assert_eq!((s.initial.velocity, s.initial.pivot), (DVec3::new(1.0, 2.0, 3.0), Some(DVec3::Z)));
    assert!(matches!(s.clamps[0].region, ClampRegion::Box { object_frame: true, .. }) && s.clamps[0].motion.is_none());
    let o = s.observation.unwrap();
    assert_eq!((o.from, o.to, o.every, o.file.as_str()), (-0.5, 0.5, 2, "silhouettes.toml"));
    assert_eq!(o.markers[0].position, DVec3::new(0.0, 0.0, 0.05));
}

#[test]
fn an_unknown_key_names_the_nearest_and_its_line() {
    let e = error_with("youngs_modulus", "youngs_modul");
    assert_eq!(e, "scene.toml:7: material.youngs_modul: unknown key; did you mean \"youngs_modulus\"?");
    assert!(error_with("radius = 0.05", "radius = 0.05, centre = [0, 0, 0]").contains("did you mean \"center\"?"));
    assert!(error_with("mass = 0.05", "mas = 0.05").starts_with("scene.toml:14: mass.0.mas: unknown key"));
    assert!(error_with("[time]", "[tiem]").contains("did you mean \"time\"?"));
    assert!(error_with("cell_size", "zzz").contains(
        "known: mesh, volume_mesh, points, state, pose, discretisation, cell_size, cells, edge_length, neighbours, weights,"
    ));
    assert!(error("format = \"scene/9\"\n").contains("reads \"scene/1\""));
    assert!(error("[object]\n").contains("format = \"scene/1\""));
}

#[test]
fn numbers_out_of_range_say_what_is_allowed() {
    for (from, to, wanted) in [
        ("poisson_ratio = 0.4", "poisson_ratio = 0.6", "0.6 is not allowed: must lie in (-1, 0.5)"),
        ("youngs_modulus = 1e5", "youngs_modulus = nan", "NaN is not a number that can be used"),
        ("youngs_modulus = 1e5", "youngs_modulus = -1", "must be > 0"),
        ("youngs_modulus = 1e5", "youngs_modulus = \"1e5\"", "expected a number, found a string"),
        ("cell_size = 0.01", "cell_size = 0", "must be > 0"),
        ("cell_size = 0.01", "cell_size = inf", "inf is not a number"),
        ("cell_size = 0.01", "cell_size = 0.2", "larger than the object"),
        ("step = 0.008333", "step = 0", "must be > 0"),
        ("step = 0.008333", "step = 0.01\ntheta = 0.4", "must lie in [0.5, 1)"),
        ("step = 0.008333", "step = 0.01\ntheta = 1.0", "must lie in [0.5, 1)"),
        ("step = 0.008333\nduration = 1.5", "steps = 3", "time.step: missing"),
        ("duration = 1.5", "duration = 0", "static-equilibrium"),
        ("cell_size = 0.01", "cell_size = 0.01\nstate = \"hanging\"", "allowed: \"rest\", \"static\""),
        ("duration = 1.5", "duration = 1.5\nsteps = 3", "exclude each other"),
        ("normal = [0, 0, 2]", "normal = [0, 0, 0]", "has no length"),
        ("normal = [0, 0, 2]", "normal = [0, 0]", "array of 3 numbers, found 2"),
        ("cell_size = 0.01", "cell_size = 0.01\nmesh = \"a.obj\"", "exclude each other"),
        ("radius = 0.05", "radius = 60", "in millimetres? lengths are in metres: scale by 0.001"),
        ("density = 1000", "density = 1000\nmass = 1", "exclude each other"),
        ("density = 1000", "model = \"mooney\"\ndensity = 1000", "allowed: \"corotated-linear\", \"neo-hookean\""),
        ("[time]", "[[effect]]\nkind = \"coulomb-frction\"\n[time]", "did you mean \"coulomb-friction\""),
        ("[time]", "[[effect]]\ncoefficient = 0.3\n[time]", "kind: missing"),
        ("[time]", "[[effect]]\nkind = \"coulomb-friction\"\ncoeficient = 0.3\n[time]", "did you mean \"coefficient\""),
        ("[time]", "[[effect]]\nkind = \"coulomb-friction\"\ncoefficient = -1\n[time]", "must lie in [0, 10]"),
        ("[time]", "[[effect]]\nkind = \"uniform-force\"\nforce = 3\n[time]", "array of 3 numbers"),
        ("[time]", "[[effect]]\nkind = \"camera-pose\"\ncamera = 0.5\n[time]", "0.5 is not allowed: number of the camera"),
        ("[time]", "[[effect]]\nkind = \"marker-offset\"\nmarker = -1\n[time]", "is a whole number from 0"),
        (
            "[time]",
            "[[effect]]\nkind = \"camera-pose\"\n[fit]\n[[fit.parameter]]\npath = \"effect.0.camera\"\n[time]",
            "effect.0.camera chooses one thing among several and cannot be fitted",
        ),
        ("[time]", "[[clamp]]\nbox = { min = [0, 0, 0], max = [1, -1, 1] }\n[time]", "y: -1 must be larger than min = 0"),
        ("[time]", "[fit]\noptimizer = \"adam\"\n[time]", "\"adam\" is not known; allowed: \"rprop\", \"gradient-descent\""),
        ("[time]", "[observation]\nrecording = \"r\"\ncost = \"silhouette\"\n[time]", "not available in this version"),
        ("[time]", "[fit]\nstarts = 0\n[time]", "0 is out of range"),
        ("[object]", "[object]\npose = [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]]", "scales by 2"),
    ] {
        let e = error_with(from, to);
        assert!(e.contains(wanted), "{to}: {e}");
        assert!(e.starts_with("scene.toml:") && !e.contains('\n'), "{e}");
    }
    // Bounds have a unit where there is one.
    for (kind, wanted) in [
        ("coulomb-friction\"\ncoefficient = -1", "must lie in [0, 10]"),
        ("adhesion\"\npressure = -1", "must lie in [0, 1000000000] Pa"),
    ] {
        let e = error_with("[time]", &format!("[[effect]]\nkind = \"{kind}\n[time]"));
        assert!(e.ends_with(wanted), "{e}");
    }
}

#[test]
fn broken_toml_names_the_line() {
    let e = error("format = \"scene/1\"\n[object\n");
    assert!(e.starts_with("scene.toml:2: not valid TOML"), "{e}");
}

#[test]
fn suspicious_units_are_warnings() {
    let w = parse_scene(&BASE.replace("1e5", "5").replace("density = 1000", "density = 1.07"), "s.toml").unwrap().warnings;
    assert_eq!(w.len(), 2, "{w:?}");
    assert!(w[0].contains("is it in Pa?") && w[1].contains("1 g/cm³ is 1000 kg/m³"));
}

#[test]
fn a_static_problem_needs_no_step() {
    let s = parse_scene(
        &BASE.replace("step = 0.008333\nduration = 1.5", "duration = 0\n[initial]\nstate = \"static-equilibrium\""),
        "s.toml",
    );
    assert_eq!(s.unwrap().value.time.steps, 0);
}

pub(super) fn parameters(text: &str) -> Vec<FitParameter> {
    read(&format!("[fit]\n{text}")).unwrap().value.fit.unwrap().parameters
}

#[test]
fn fit_parameters_take_bounds_from_the_registry_and_starts_from_the_scene() {
    let p = parameters("[[fit.parameter]]\npath = \"material.youngs_modulus\"\n[[fit.parameter]]\npath = \"plane.0.height\"\n");
    assert_eq!((p[0].start, p[0].bounds), ((1e5, 1e5), (1e-3, 1e13)));
    assert_eq!(p[1].start, (-0.06, -0.06));
    let p = parameters("[[fit.parameter]]\npath = \"world.gravity\"\n");
    assert_eq!(p.iter().map(|p| p.path.as_str()).collect::<Vec<_>>(), ["world.gravity.x", "world.gravity.y", "world.gravity.z"]);
    assert_eq!(p[2].start, (-9.81, -9.81));
    let p = parameters("[[fit.parameter]]\npath = \"world.gravity\"\nstart = [0, [-1, 1], -9]\nbounds = [-20, 20]\n");
    assert_eq!((p[0].start, p[1].start, p[2].start), ((0.0, 0.0), (-1.0, 1.0), (-9.0, -9.0)));
    assert!(p.iter().all(|p| p.bounds == (-20.0, 20.0)));
    let p = parameters("[[fit.parameter]]\npath = \"initial.velocity.y\"\nper_scene = true\n");
    assert!(p[0].per_scene && p.len() == 1);
}

#[test]
fn impossible_fits_are_refused_with_the_way_out() {
    for (text, wanted) in [
        ("path = \"material.youngs_modulos\"", "did you mean \"material.youngs_modulus\"?"),
        ("path = \"plane.1.height\"", "no [[plane]] number 1"),
        ("path = \"material.mass\"", "this scene gives material.density"),
        ("path = \"material.youngs_modulus\"\nbounds = [1, 10]", "[1, 10] excludes the scene's value 100000"),
        ("path = \"material.youngs_modulus\"\nstart = [1, 100]\nbounds = [10, 1000]", "[10, 1000] excludes start [1, 100]"),
        ("path = \"material.mass_damping\"", "set start to a number > 0"),
        (
            "path = \"material.density\"\nknown = 1070",
            "fit.parameter.0.known: expected a pair [value, standard deviation], found",
        ),
        ("path = \"material.density\"\nknown = [1070]", "expected a pair [value, standard deviation], found an array"),
        (
            "path = \"world.gravity\"\nknown = [[0, 1], [0, 1]]",
            "standard deviation], or an array of three of these, found an array",
        ),
        ("path = \"material.density\"\nknown = [1070, 0]", "[1070, 0]: the standard deviation must be > 0"),
        ("path = \"material.density\"\nknown = [1e9, 1]", "material.density: 1e9 lies outside the bounds [0.001, 100000]"),
        ("path = \"material.youngs_modulus\"\nbounds = [0, 1e7]", "must be > 0"),
        ("path = \"material.poisson_ratio\"\nbounds = [0, 0.5]", "must lie in (-1, 0.5)"),
        ("path = \"mass.0.mass\"\nbounds = [2, 1]", "low must not exceed high"),
        ("path = \"mass.0.mass\"\nstart = \"x\"", "found a string"),
        ("path = \"mass.0.mass\"\n[[fit.parameter]]\npath = \"mass.0.mass\"", "given twice"),
    ] {
        let e = fit_error(text);
        assert!(e.contains(wanted), "{text}: {e}");
    }
}

#[test]
fn found_values_are_written_in_place_and_read_again() {
    let scene = read("").unwrap().value;
    let values: Vec<(String, f64)> = [
        ("material.youngs_modulus", 123456.789),
        ("material.mass_damping", 0.25),
        ("world.gravity.x", 0.5),
        ("initial.velocity.z", -2.0),
        ("mass.0.mass", 0.07),
        ("time.start", 0.125),
        ("plane.0.height", -0.05),
        ("plane.0.theta", 1.5),
    ]
    .map(|(p, v)| (p.to_string(), v))
    .to_vec();
    let text = write_scene(BASE, &scene, &values, Path::new("some/out")).unwrap();
    assert!(text.contains("# a ball") && text.contains("youngs_modulus = 123456.789   # fitted, was 1e5: soft"), "{text}");
    let again = parse_scene(&text, "some/out/model.toml").unwrap().value;
    assert_eq!(again.material.youngs_modulus, 123456.789);
    assert_eq!(again.material.mass_damping, 0.25);
    assert_eq!(again.gravity, DVec3::new(0.5, 0.0, -9.81));
    assert_eq!(again.initial.velocity, DVec3::new(0.0, 0.0, -2.0));
    assert_eq!((again.masses[0].mass, again.time.start), (0.07, 0.125));
    let plane = again.planes[0];
    let site = palpate_model::plan::PlaneSite { polar_axis: 0, stiffness: None };
    // Two trigonometric round trips.
    assert!((plane.point.dot(plane.normal) + 0.05).abs() < 1e-15);
    assert!((site.angles(plane.normal).0 - 1.5).abs() < 1e-14, "the normal z is measured from axis x");
    assert!(write_scene(BASE, &scene, &[("plane.3.height".to_string(), 0.0)], Path::new(".")).is_err());
    assert!(write_scene(BASE, &scene, &[("time.start".to_string(), f64::NAN)], Path::new(".")).is_err());
}

#[test]
fn relative_paths_hold_from_another_folder() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("a/b")).unwrap();
    let extra = "[observation]\nrecording = \"../rec\"  # mine\ncost = \"markers\"\n";
    let text = format!("{BASE}{extra}");
    let scene = parse_scene(&text, folder.path().join("a/b/scene.toml")).unwrap().value;
    let out = write_scene(&text, &scene, &[], &folder.path().join("a/out/deep")).unwrap();
    assert!(out.contains("recording = \"../../rec\"  # mine"), "{out}");
}

#[test]
fn errors_found_later_still_name_the_line() {
    for (key, line) in [("object.cell_size", Some(4)), ("mass.0.point", Some(13)), ("plane.0", Some(9)), ("clamp.0.box", None)] {
        // The text at hand is what counts; there is no such file.
        let e = scene_error(Path::new("scene.toml"), BASE, key, "no");
        assert_eq!((e.line, e.key.as_str()), (line, key));
    }
}

fn fields(text: &str) -> Result<Vec<FieldSpec>, String> {
    read(&format!("[[field]]\n{text}")).map(|s| s.value.fields).map_err(|e| e.to_string())
}

const REGIONS: &str = "path = \"material.youngs_modulus\"\nbasis = \"regions\"\nregions = [{ center = [0, 0, 0], radius = 0.01, value = 2 }, \
     { center = [0.1, 0, 0], radius = 0.02 }]\n";

#[test]
fn fields_are_read_with_their_defaults() {
    let f = fields(REGIONS).unwrap().remove(0);
    let regions = [(0.0, 0.01, 2.0), (0.1, 0.02, 1.0)];
    let regions = regions.map(|(x, radius, value)| Region { center: DVec3::new(x, 0.0, 0.0), radius, value });
    assert_eq!((f.varied, f.scale, f.values), (Varied::Modulus, Scale::Log, None));
    assert_eq!(f.basis, Basis::Regions(regions.to_vec(), Blend::Harmonic));
    let two = "path = \"material.density\"\nbasis = \"nodes\"\nscale = \"linear\"\n[[field]]\npath = \"material.density\"\nbasis = \"cells\"\n";
    let f = fields(two).unwrap();
    assert_eq!((f[0].scale, &f[0].basis, &f[1].basis), (Scale::Linear, &Basis::Nodes, &Basis::Cells));
}

#[test]
fn impossible_fields_are_refused_with_what_is_allowed() {
    for (text, wanted) in [
        ("basis = \"cells\"", "field.0.path: missing; expected"),
        ("path = \"material.poisson_ratio\"", "allowed: \"material.youngs_modulus\", \"material.density\""),
        ("path = \"material.density\"", "field.0.basis: missing; expected"),
        ("path = \"material.density\"\nbasis = \"modes\"", "allowed: \"cells\", \"nodes\", \"points\", \"regions\""),
        ("path = \"material.density\"\nbasis = \"regions\"", "field.0.regions: missing; expected"),
        ("path = \"material.density\"\nbasis = \"cells\"\nblend = \"axis\"", "field.0.blend: belongs to basis = \"regions\""),
        ("path = \"material.density\"\nbasis = \"cells\"\nfile = \"none.npy\"", "field.0.file: there is no file"),
        ("path = \"material.density\"\nbasis = \"cells\"\narray = \"a\"", "names an array of file, which is missing"),
        (&format!("{REGIONS}file = \"a.npy\""), "field.0.file: belongs to basis = \"cells\", \"nodes\" or \"points\""),
        (&REGIONS.replace("value = 2", "value = 0"), "a factor must be > 0"),
        (&REGIONS.replace("radius = 0.02", "radius = -1"), "field.0.regions.1.radius"),
        (
            "path = \"material.density\"\nbasis = \"cells\"\nprior = { length = 1.0 }",
            "field.0.prior.kind: missing; expected \"matern\" or \"edge-preserving\"",
        ),
        (
            "path = \"material.density\"\nbasis = \"cells\"\nprior = { kind = \"matern\", length = -1.0 }",
            "field.0.prior.length: -1 is not allowed: must be \"auto\" or a number > 0 (m)",
        ),
        (
            "path = \"material.density\"\nbasis = \"cells\"\nprior = { kind = \"matern\", deviation = \"some\" }",
            "field.0.prior.deviation: \"some\" is not allowed: must be \"auto\"",
        ),
        (
            "path = \"material.density\"\nbasis = \"cells\"\nprior = { kind = \"edge-preserving\", length = 0.1 }",
            "field.0.prior.length: belongs to kind = \"matern\"",
        ),
        (
            &format!("{REGIONS}prior = {{ kind = \"matern\" }}"),
            "field.0.prior: belongs to basis = \"cells\", \"nodes\" or \"points\"",
        ),
        (&REGIONS.replace("0.1", "0").replace("regions = [", "blend = \"axis\"\nregions = ["), "is that of the region before"),
        (&format!("{REGIONS}bases = 1"), "did you mean \"basis\"?"),
    ] {
        let e = fields(text).expect_err(text);
        assert!(e.contains(wanted), "{text}: {e}");
    }
}

#[test]
fn values_of_fields_come_from_arrays_and_grids() {
    use crate::npy::{Array, write_npz};
    let folder = tempfile::tempdir().unwrap();
    let read = |text: &str| {
        let text = format!("{BASE}[[field]]\npath = \"material.youngs_modulus\"\nbasis = \"cells\"\n{text}");
        parse_scene(&text, folder.path().join("scene.toml"))
            .map(|s| s.value.fields[0].values.clone().unwrap())
            .map_err(|e| e.to_string())
    };
    let array = |values: &[f64]| Array { shape: vec![values.len()], values: values.to_vec() };
    let (good, bad) = (array(&[0.5, 2.0]), array(&[0.5, -2.0]));
    let square = Array { shape: vec![1, 2], ..good.clone() };
    write_npz(folder.path().join("a.npz"), &[("good", &good), ("bad", &bad), ("square", &square)]).unwrap();
    assert_eq!(read("file = \"a.npz\"\narray = \"good\"\n").unwrap(), [0.5, 2.0]);
    for (text, wanted) in [
        ("file = \"a.npz\"", "holds 3 arrays"),
        ("file = \"a.npz\"\narray = \"goood\"", "did you mean \"good\"?"),
        ("file = \"a.npz\"\narray = \"bad\"", "value 1 is -2; a factor must be > 0"),
        ("file = \"a.npz\"\narray = \"square\"", "has shape (1, 2); expected one axis"),
        ("file = \"scene.txt\"", "is not an .npy, .npz or .vtu file"),
    ] {
        std::fs::write(folder.path().join("scene.txt"), "").unwrap();
        let e = read(text).expect_err(text);
        assert!(e.contains(wanted), "{text}: {e}");
    }
    let elements = Elements::triangles(&[[0, 1, 2], [0, 2, 1]]);
    let cells = [("E", Values::Numbers(&[3.0, 4.0])), ("other", Values::Numbers(&[1.0, 1.0]))];
    write_vtu(folder.path().join("a.vtu"), &[DVec3::ZERO; 3], &elements, &[], &cells).unwrap();
    assert_eq!(read("file = \"a.vtu\"\narray = \"E\"\n").unwrap(), [3.0, 4.0]);
    assert!(read("file = \"a.vtu\"\n").unwrap_err().contains("has 2 cell arrays (E, other)"));
    assert!(read("file = \"a.vtu\"\narray = \"F\"\n").unwrap_err().contains("has no cell array \"F\""));
}

#[test]
fn a_field_is_fitted_as_a_whole_or_value_by_value() {
    let fit = |field: &str, parameter: &str| {
        let text = format!("[[field]]\n{field}[fit]\n[[fit.parameter]]\n{parameter}");
        read(&text).map(|s| s.value.fit.unwrap().parameters).map_err(|e| e.to_string())
    };
    let cells = "path = \"material.youngs_modulus\"\nbasis = \"cells\"\n";
    let p = fit(cells, "path = \"field.0\"\nstart = [0.5, 2]\nbounds = [0.1, 10]\n").unwrap();
    assert_eq!((p.len(), p[0].path.as_str(), p[0].start, p[0].bounds), (1, "field.0", (0.5, 2.0), (0.1, 10.0)));
    let p = fit(cells, "path = \"field.0.17\"\n").unwrap();
    assert_eq!((p[0].path.as_str(), p[0].start, p[0].bounds), ("field.0.17", (1.0, 1.0), (1e-6, 1e6)));
    let p = fit(REGIONS, "path = \"field.0\"\nbounds = [0.1, 10]\n").unwrap();
    let all: Vec<_> = p.iter().map(|p| (p.path.as_str(), p.start.0, p.bounds)).collect();
    assert_eq!(all, [("field.0.0", 2.0, (0.1, 10.0)), ("field.0.1", 1.0, (0.1, 10.0))]);
    for (field, path, wanted) in [
        (cells, "field.1", "this scene has no [[field]] number 1"),
        (REGIONS, "field.0.2", "field 0 has 2 regions"),
        (cells, "field.0.x", "say \"field.0\", or \"field.0.3\" for one of its cells"),
    ] {
        let e = fit(field, &format!("path = \"{path}\"\n")).expect_err(path);
        assert!(e.contains(wanted), "{path}: {e}");
    }
    assert!(fit(cells, "path = \"field.0\"\nbounds = [0, 10]\n").unwrap_err().contains("must be > 0"));
}

#[test]
fn found_regions_are_written_in_place_and_files_are_named() {
    let text = format!("{BASE}[[field]]\n{REGIONS}[[field]]\npath = \"material.density\"\nbasis = \"nodes\"\n");
    let scene = parse_scene(&text, "some/scene.toml").unwrap().value;
    let values = [("field.0.0".to_string(), 0.25), ("field.0.1".to_string(), 4.5), ("field.1.7".to_string(), 3.0)];
    let written = write_scene(&text, &scene, &values, Path::new("some")).unwrap();
    let Basis::Regions(regions, _) = parse_scene(&written, "some/model.toml").unwrap().value.fields.remove(0).basis else {
        panic!()
    };
    assert_eq!(regions.iter().map(|r| r.value).collect::<Vec<_>>(), [0.25, 4.5]);
    let named = name_field_files(&written, &scene, &[(1, "field-1.npz".into(), "values")]).unwrap();
    assert!(named.contains("file = \"field-1.npz\"\narray = \"values\""), "{named}");
    assert!(name_field_files(&written, &scene, &[(2, "field-2.npz".into(), "values")]).is_err());
}

#[test]
fn a_static_shape_is_where_the_motion_starts() {
    let given = BASE.replace("cell_size = 0.01", "cell_size = 0.01\nstate = \"static\"");
    assert_eq!(parse_scene(&given, "scene.toml").unwrap().value.initial.state, InitialShape::Given);
    let fault = |text: &str| parse_scene(text, "scene.toml").unwrap_err().to_string();
    let twice = given.replace("[time]", "[initial]\nstate = \"rest\"\n[time]");
    assert!(fault(&twice).contains("belongs to object.state = \"rest\""), "{}", fault(&twice));
    let nothing = given.replace("duration = 1.5", "duration = 0");
    assert!(fault(&nothing).contains("needs steps"), "{}", fault(&nothing));
}
