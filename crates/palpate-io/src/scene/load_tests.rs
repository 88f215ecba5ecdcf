//! Loads and attachments from files: what is read, and what is refused.

use super::parse_scene;
use super::tests::BASE;
use crate::npy::{Array, write_npz};
use palpate_model::effects::driven::Points;
use std::path::Path;

fn array(shape: &[usize], value: impl Fn(usize) -> f64) -> Array {
    Array { shape: shape.to_vec(), values: (0..shape.iter().product()).map(value).collect() }
}

/// A folder with arrays, and a recording of four points at three times.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let arrays = [
        ("forces", array(&[3, 2, 3], |k| k as f64)),
        ("two", array(&[2, 2, 3], |k| k as f64)),
        ("flat", array(&[2, 3], |k| k as f64)),
        ("broken", array(&[3, 2, 3], |k| if (3..6).contains(&k) { f64::NAN } else { 1.0 })),
        ("endless", array(&[3, 2, 3], |k| if k == 4 { f64::INFINITY } else { 1.0 })),
        ("index", array(&[2], |k| 5.0 * k as f64)),
        ("half", array(&[2], |k| 0.5 * k as f64)),
        ("times", array(&[3], |k| 0.1 * k as f64)),
        ("back", array(&[3], |k| -0.1 * k as f64)),
        ("points", array(&[3, 4, 3], |k| if k == 14 || k == 12 || k == 13 { f64::NAN } else { 1e-3 * k as f64 })),
    ];
    let named: Vec<(&str, &Array)> = arrays.iter().map(|(n, a)| (*n, a)).collect();
    write_npz(folder.path().join("a.npz"), &named).expect("it can be written");
    std::fs::create_dir(folder.path().join("seen")).expect("a folder");
    write_npz(folder.path().join("seen/points.npz"), &named).expect("it can be written");
    let text =
        "format = \"recording/1\"\n[points]\nfile = \"points.npz\"\ntimes = [0.5, 0.7, 1.0]\nrest = 0\nnoise_sigma = 1e-3\n";
    std::fs::write(folder.path().join("seen/recording.toml"), text).expect("it can be written");
    folder
}

const SEEN: &str = "[observation]\nrecording = \"seen\"\ncost = \"points\"\n";
const PLACES: &str = "places = [[0, 0, 0.05], [0, 0.05, 0]]\n";

fn load(rest: &str) -> String {
    format!("[[load]]\nkind = \"file\"\n{rest}")
}

fn attach(rest: &str) -> String {
    format!("[[attach]]\n{rest}")
}

#[test]
fn loads_become_effects_with_their_times() {
    let folder = folder();
    let read =
        |more: &str| parse_scene(&format!("{BASE}{more}"), folder.path().join("s.toml")).unwrap_or_else(|e| panic!("{e}")).value;
    let of = |text: String| read(&text).effects.remove(0);
    let by_recording = of(load(&format!("forces = \"a.npz:forces\"\n{PLACES}{SEEN}")));
    let drive = by_recording.drive.as_ref().expect("it is driven");
    assert_eq!((by_recording.law().kind, by_recording.values[0]), ("file-load", Some(1.0)));
    assert_eq!((drive.series.times.as_slice(), drive.series.count), (&[0.5, 0.7, 1.0][..], 2));
    // The second point in the first row.
    assert_eq!(drive.series.at(1, 0.5)[0].to_array(), [3.0, 4.0, 5.0]);
    let by_node = of(load("forces = \"a.npz:forces\"\nindex = \"a.npz:index\"\nrate = 10\nstart = 1\nfactor = -2\n"));
    let drive = by_node.drive.as_ref().expect("it is driven");
    assert_eq!((&drive.points, by_node.values[0]), (&Points::Nodes(vec![0, 5]), Some(-2.0)));
    assert!((drive.series.times[2] - 1.2).abs() < 1e-15);
    let shared = of(load(&format!("total = [[0, 0, -1], [0, 0, -3]]\ntimes = [0, 2]\n{PLACES}")));
    let force = |t: f64| shared.drive.as_ref().map(|d| d.series.at(0, t)[0].z);
    assert_eq!([force(0.0), force(1.0), force(9.0)], [Some(-0.5), Some(-1.0), Some(-1.5)]);
    let constant = of(load(&format!("forces = \"a.npz:flat\"\n{PLACES}")));
    assert_eq!(constant.drive.map(|d| d.series.times.len()), Some(1));
    // Two of the recording's points, of which the first is not seen at the second time.
    let strings = of(attach(&format!("points = [0, 3]\ntrack = \"recording\"\nstiffness = 1e4\n{SEEN}")));
    let drive = strings.drive.as_ref().expect("it is driven");
    assert_eq!((strings.law().kind, drive.tracked.as_slice()), ("attachment", &[0, 3][..]));
    assert!(drive.series.at(0, 0.7)[0].is_nan() && drive.series.at(1, 0.7)[0].is_finite());
    let own = of(attach(&format!("track = \"a.npz:forces\"\nstiffness = 3\ntimes = \"a.npz:times\"\n{PLACES}")));
    assert!(own.drive.is_some_and(|d| d.tracked.is_empty() && d.series.times[1] == 0.1));
    // Fitted by the names of their tables.
    let both = format!(
        "{}{}[fit]\n[[fit.parameter]]\npath = \"load.0.factor\"\n[[fit.parameter]]\npath = \"attach.0.offset\"\n",
        load(&format!("forces = \"a.npz:flat\"\n{PLACES}")),
        attach(&format!("track = \"a.npz:flat\"\nstiffness = 3\n{PLACES}"))
    );
    let fit = read(&both).fit.expect("it has one");
    let paths: Vec<&str> = fit.parameters.iter().map(|p| p.path.as_str()).collect();
    assert_eq!(paths, ["load.0.factor", "attach.0.offset.x", "attach.0.offset.y", "attach.0.offset.z"]);
}

#[test]
fn what_does_not_go_together_is_refused() {
    let folder = folder();
    let error = |more: String| {
        let read = parse_scene(&format!("{BASE}{more}"), folder.path().join("s.toml"));
        read.err().map_or_else(|| panic!("must be refused: {more}"), |e| e.to_string())
    };
    let of_load = |rest: &str| error(load(rest));
    let of_attach = |rest: &str| error(attach(rest));
    let forces = |name: &str, more: &str| of_load(&format!("forces = \"a.npz:{name}\"\n{PLACES}{more}"));
    for (said, message) in [
        (error("[[load]]\nforces = \"a.npz:flat\"\n".into()), "load.0.kind: missing"),
        (error("[[load]]\nkind = \"fan\"\n".into()), "\"fan\" is not known; allowed: \"file\", \"jet\""),
        (of_load("forces = \"a.npz:flat\"\n"), "load.0.places: missing"),
        (of_load(PLACES), "load.0.forces: missing"),
        (of_load(&format!("forces = \"a.npz:flat\"\nindex = [0, 1]\n{PLACES}")), "exclude each other"),
        (of_load("forces = \"a.npz:flat\"\nindex = [0, -1]\n"), "load.0.index: -1 is no number from 0 on"),
        (of_load("forces = \"a.npz:flat\"\nindex = \"a.npz:half\"\n"), "0.5 (number 1) is no index"),
        (of_load("forces = \"a.npz:flat\"\nindex = [0, 1, 2]\n"), "has shape (2, 3), expected (T, 3, 3) or (3, 3)"),
        (of_load(&format!("forces = \"none.npy\"\n{PLACES}")), "there is no file"),
        (of_load(&format!("forces = \"a.csv\"\n{PLACES}")), "neither an .npy file nor"),
        (forces("times", ""), "has shape (3,), expected (T, 2, 3)"),
        (forces("broken", "rate = 10\n"), "the force on point 1 of row 0 is NaN"),
        (forces("endless", "rate = 10\n"), "are infinite"),
        (forces("forces", ""), "load.0.times: missing; expected 3 times"),
        (forces("two", SEEN), "load.0.forces: has 2 rows, and"),
        (forces("forces", "times = [0, 1]\n"), "load.0.times: holds 2 times for 3 frames"),
        (forces("forces", "times = \"a.npz:back\"\n"), "not after the one before"),
        (forces("forces", "rate = 10\ntimes = [0, 1, 2]\n"), "exclude each other"),
        (forces("flat", "factr = 2\n"), "did you mean \"factor\"?"),
        (of_attach("track = \"recording\"\nstiffness = 1\n"), "needs the recording of an [observation]"),
        (of_attach(&format!("track = \"recording\"\n{SEEN}")), "attach.0.stiffness: missing"),
        (of_attach(&format!("track = \"recording\"\nstiffness = 0\n{SEEN}")), "must lie in (0, 1e12]"),
        (of_attach(&format!("track = \"recording\"\nstiffness = 1\npoints = [0, 4]\n{SEEN}")), "4 (number 1) is no point"),
        (of_attach(&format!("track = \"recording\"\nstiffness = 1\nrate = 3\n{SEEN}")), "belongs to a track from a file"),
        (of_attach("track = \"a.npz:flat\"\nstiffness = 1\n"), "attach.0.places: missing"),
        (of_attach("stiffness = 1\n"), "attach.0.track: missing"),
        (error("[[effect]]\nkind = \"file-load\"\n".into()), "is written as a table [[load]]"),
        (error("[fit]\n[[fit.parameter]]\npath = \"load.0.factor\"\n".into()), "this scene has no [[load]] number 0"),
        (error("[fit]\nframes = { train = {} }\n".into()), "says neither every, count nor numbers"),
    ] {
        assert!(said.contains(message), "{message}: {said}");
    }
}

#[test]
fn a_sequence_has_no_step_of_its_own() {
    let with = |time: &str, more: &str| {
        let text = BASE.replace("step = 0.008333\nduration = 1.5\n", time);
        parse_scene(&format!("{text}{more}"), Path::new("s.toml")).map(|s| s.value)
    };
    let scene = with("mode = \"quasi-static\"\n", "").unwrap();
    assert!(scene.time.scheme.still && scene.time.steps == 0);
    let stated = with("mode = \"quasi-static\"\nstep = 0.5\nduration = 2\n", "").unwrap();
    assert_eq!((stated.time.steps, stated.time.step), (4, 0.5));
    for (time, more, message) in [
        ("mode = \"still\"\n", "", "allowed: \"dynamic\", \"quasi-static\""),
        ("mode = \"quasi-static\"\nscheme = \"bdf2\"\n", "", "belongs to mode = \"dynamic\""),
        ("mode = \"quasi-static\"\nstep = 0.5\n", "", "time.duration: missing"),
        ("mode = \"quasi-static\"\nduration = 2\n", "", "time.step: missing"),
        ("mode = \"quasi-static\"\n", "[initial]\nvelocity = [1, 0, 0]\n", "has no inertia"),
        (
            "mode = \"quasi-static\"\n",
            "[fit]\n[[fit.parameter]]\npath = \"time.start\"\n",
            "has no part in a quasi-static sequence",
        ),
    ] {
        let said = with(time, more).unwrap_err().to_string();
        assert!(said.contains(message), "{message}: {said}");
    }
}

const PATH: &str = "time,x,y,z,qx,qy,qz,qw\n0,0,0,0.2,0,0,0,1\n1,0,0,0.1,0,0,0.6,0.8\n";

#[test]
fn jets_and_obstacles_move_as_files_say() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("path.csv"), PATH).expect("it can be written");
    let read = |more: &str| {
        let read = parse_scene(&format!("{BASE}{more}"), folder.path().join("s.toml"));
        read.unwrap_or_else(|e| panic!("{e}")).value
    };
    let jet = "[[load]]\nkind = \"jet\"\nmotion = \"path.csv\"\naxis = [0, 0, -2]\noffset = [0, 0.1, 0]\nthrust = 0.15\n";
    let ball = "[[obstacle]]\nshape = { ball = { radius = 0.02 } }\nmotion = \"path.csv\"\nstiffness = 1e6\n";
    let scene = read(&format!(
        "{jet}{ball}[fit]\n[[fit.parameter]]\npath = \"load.0.spread\"\n[[fit.parameter]]\npath = \"obstacle.0.offset\"\n"
    ));
    let [jet, obstacle] = &scene.effects[..] else { panic!("two effects") };
    assert_eq!((jet.law().kind, &jet.values[..]), ("jet", &[0.15, 0.1, 0.0, 0.1, 0.0].map(Some)[..]));
    let nozzle = jet.moving.as_ref().expect("it moves");
    assert_eq!(nozzle.axis, -glam::DVec3::Z);
    assert!((nozzle.motion.at(0.5).1.z - 0.15).abs() < 1e-15);
    let solid = obstacle.moving.as_ref().and_then(|m| m.shape.clone()).expect("it has a shape");
    assert_eq!((obstacle.law().kind, obstacle.values[0], solid.distance.spacing()), ("obstacle", Some(1e6), 0.04 / 64.0));
    assert!((solid.distance.at(glam::DVec3::new(0.03, 0.0, 0.0)).value - 0.01).abs() < 1e-6);
    let fit = scene.fit.as_ref().expect("it has one");
    assert_eq!(fit.parameters.iter().map(|p| p.path.as_str()).collect::<Vec<_>>()[..2], ["load.0.spread", "obstacle.0.offset.x"]);
    // Fitted values go back into their tables.
    let text = format!("{BASE}{ball}");
    let values = [("obstacle.0.offset.y".to_string(), 1e-3), ("obstacle.0.stiffness".to_string(), 2e6)];
    let written = super::scene_with_values(&text, &read(ball), &values).unwrap_or_else(|e| panic!("{e}"));
    let again = parse_scene(&written, folder.path().join("t.toml")).unwrap_or_else(|e| panic!("{e}")).value;
    assert_eq!(again.effects[0].values, [2e6, 0.0, 1e-3, 0.0].map(Some));
}

#[test]
fn jets_and_obstacles_that_cannot_be_are_refused() {
    let error = |more: &str| {
        let read = parse_scene(&format!("{BASE}{more}"), "s.toml");
        read.err().map_or_else(|| panic!("must be refused: {more}"), |e| e.to_string())
    };
    let jet = |rest: &str| error(&format!("[[load]]\nkind = \"jet\"\n{rest}"));
    let ball = |rest: &str| error(&format!("[[obstacle]]\nshape = {{ ball = {{ radius = 0.02 }} }}\n{rest}"));
    for (said, message) in [
        (jet(""), "load.0.thrust: missing"),
        (jet("thrust = -1\n"), "must lie in [0, 1e6] (N)"),
        (jet("thrust = 1\nspread = 0\n"), "must lie in [0.001, 10]"),
        (jet("thrust = 1\naxis = [0, 0, 0]\n"), "load.0.axis: has no length"),
        (jet("thrust = 1\nfactor = 2\n"), "belongs to kind = \"file\""),
        (jet("thrust = 1\nspred = 2\n"), "did you mean \"spread\"?"),
        (error(&load("thrust = 1\n")), "belongs to kind = \"jet\""),
        (jet("thrust = 1\nmotion = \"none.csv\"\n"), "none.csv"),
        (ball(""), "obstacle.0.stiffness: missing"),
        (ball("stiffness = -1\n"), "must lie in [0, 1e15] (Pa/m)"),
        (ball("stiffness = 1\nmesh = \"a.obj\"\n"), "exclude each other"),
        (ball("stiffness = 1\ncell_size = 1e-5\n"), "at most 4000000 are allowed"),
        (error("[[obstacle]]\nstiffness = 1\n"), "obstacle.0.mesh: missing"),
        (
            error("[[obstacle]]\nshape = { box = { min = [0, 0, 0], max = [1, 1, 0.01] } }\nstiffness = 1\n"),
            "which does not see it",
        ),
        (error("[[effect]]\nkind = \"jet\"\n"), "is written as a table [[load]]"),
        (error("[fit]\n[[fit.parameter]]\npath = \"obstacle.0.offset\"\n"), "this scene has no [[obstacle]] number 0"),
    ] {
        assert!(said.contains(message), "{message}: {said}");
    }
}
