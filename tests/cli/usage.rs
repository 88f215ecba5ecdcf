//! Answers to right and wrong questions.

use super::{BLOCK, CAMERA, STIFFNESS, observed};
use std::fs;
use support::command::{arg, palpate, succeed};

#[test]
fn help_teaches_and_versions_are_told() {
    for command in ["import", "simulate", "observe", "fit", "inspect", "diagnose", "export"] {
        let a = succeed(&[command, "--help"]);
        assert!(a.out.contains("Examples:") && a.out.contains(&format!("palpate {command}")), "{}", a.out);
    }
    assert!(succeed(&["--help"]).out.contains("Exit codes"));
    assert!(succeed(&["--version"]).out.starts_with("palpate "));
}

#[test]
fn wrong_usage_exits_2_and_names_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    fs::write(file("block.toml"), BLOCK).unwrap();
    fs::write(file("typo.toml"), BLOCK.replace("youngs_modulus", "young_modulus")).unwrap();
    fs::write(file("markers.csv"), "name,x,y,z\ntip,0,0,0.08\nfar,1,1,1\n").unwrap();
    fs::write(file("tip.csv"), "name,x,y,z\ntip,0,0,0.08\n").unwrap();
    let (scene, typo, out, markers) = (file("block.toml"), file("typo.toml"), file("out"), file("markers.csv"));
    let tip = file("tip.csv");
    let (s, o) = (arg(&scene), arg(&out));
    let cases: &[(&[&str], &[&str])] = &[
        (&["simulate"], &["SCENE"]),
        (&["simulate", s, "--evry", "2"], &["--evry", "--every"]),
        (&["simulate", s, "--every", "two"], &["--every", "two"]),
        (&["simulte", s], &["simulate"]),
        (&["simulate", "no-such.toml"], &["no-such.toml", "no such file"]),
        (&["simulate", arg(&typo)], &["typo.toml:11", "young_modulus", "youngs_modulus"]),
        (&["simulate", s, "--backend", "tpu"], &["tpu", "--backend", "gpu"]),
        (&["simulate", s, "--format", "stl"], &["stl", "obj"]),
        (&["simulate", s, "--every", "0"], &["--every", "must be a whole number from 1"]),
        (&["fit", s, "--threads", "-1"], &["'-1' for '--threads <N>': must be a whole number from 0 to 4096"]),
        (&["fit", s, "--starts", "0"], &["'0' for '--starts <N>': must be a whole number from 1 to 1000000"]),
        (&["simulate", s, "--progress", "dots"], &["dots", "--progress", "none", "bar", "lines"]),
        (&["observe", s, "--out", o], &["--camera", "--markers"]),
        (&["observe", s, "--out", o, "--camera", "eye=1,0,0"], &["eye=1,0,0", "target"]),
        (&["observe", s, "--out", o, "--camera", "eye=1,0,0 target=2,0,0"], &["never sees"]),
        (&["observe", s, "--out", o, "--camera", CAMERA, "--noise", "-1"], &["--noise -1", "[0, 1] (m)"]),
        (&["observe", s, "--out", o, "--camera", CAMERA, "--depth-scale", "1e-9"], &["--depth-scale 1e-9", "no pixel", "65535"]),
        (
            &["observe", s, "--out", arg(&typo), "--camera", CAMERA, "--depth-scale", "7"],
            &["--depth-scale 7", "at most 1 (m per"],
        ),
        (&["observe", s, "--out", o, "--markers", arg(&tip), "--dropout", "0.999999"], &["--dropout 0.999999", "no marker"]),
        (&["observe", s, "--out", o, "--camera", CAMERA, "--dropout", "1.5"], &["--dropout 1.5", "[0, 1)"]),
        (&["observe", s, "--out", o, "--camera", CAMERA, "--times", "0.1,9"], &["9 s", "not simulated"]),
        (&["observe", s, "--out", o, "--markers", arg(&markers)], &["markers.csv:3", "far", "surface"]),
        (&["fit", s, "--out", o], &["block.toml", "fit.parameter"]),
        (&["fit", s, "--optimizer", "magic"], &["magic", "gauss-newton"]),
        (&["inspect", "no-such"], &["no-such"]),
        (&["diagnose", s, "--out", o], &["block.toml", "observation", "recording"]),
        (&["diagnose", s, "--out", o, "--budget", "0"], &["--budget 0", "> 0", "minutes"]),
        (&["diagnose", s, "--out", o, "--budget", "soon"], &["--budget", "soon"]),
        (&["diagnose", s, "--out", o, "--held-out", "no-such.toml"], &["no-such.toml", "no such file"]),
    ];
    for (arguments, words) in cases {
        let a = palpate(arguments);
        assert_eq!(a.code, 2, "{arguments:?}: {}{}", a.out, a.err);
        assert_eq!(a.out, "", "{arguments:?}");
        let errors = a.err.lines().filter(|l| !l.starts_with("warning: ") && !l.starts_with("backend: "));
        assert_eq!(errors.count(), 1, "{arguments:?}: {}", a.err);
        for w in *words {
            assert!(a.err.contains(w), "{arguments:?}: \"{w}\" is not in: {}", a.err);
        }
    }
    assert!(!out.join("recording.toml").exists(), "nothing is written when something is wrong");
}

#[test]
fn a_folder_that_cannot_be_made_is_known_before_the_simulation() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    // Nothing holds this block, so that its simulation cannot even begin.
    let (head, rest) = BLOCK.split_once("[[clamp]]").unwrap();
    let free = head.to_string() + rest.split_once("}\n").unwrap().1;
    fs::write(file("free.toml"), free.replace("[initial]", "[initial]\nstate = \"static-equilibrium\"")).unwrap();
    fs::write(file("taken"), "a file").unwrap();
    let (scene, out) = (file("free.toml"), file("taken").join("seen"));
    for verb in [&["simulate", arg(&scene)][..], &["observe", arg(&scene), "--camera", CAMERA]] {
        let a = palpate(&[verb, &["--out", arg(&out)]].concat());
        assert_eq!(a.code, 2, "{}", a.err);
        assert!(a.err.contains("taken is a file; give a folder") && !a.err.contains("hint"), "{}", a.err);
    }
}

#[test]
fn a_simulation_that_cannot_go_on_exits_1_with_a_hint() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("free.toml");
    // Nothing holds the body, so there is no equilibrium to start from.
    let text = BLOCK.replace("[initial]", "[initial]\nstate = \"static-equilibrium\"");
    let (head, rest) = text.split_once("[[clamp]]").unwrap();
    fs::write(&path, head.to_string() + rest.split_once("}\n").unwrap().1).unwrap();
    let a = palpate(&["simulate", arg(&path), "--out", arg(&folder.path().join("out"))]);
    assert_eq!(a.code, 1, "{}{}", a.out, a.err);
    assert!(a.err.contains("hint:"), "{}", a.err);
}

#[test]
fn inspect_tells_sizes_and_problems_of_scenes_and_recordings() {
    let folder = observed(BLOCK);
    let file = |name: &str| folder.path().join(name);
    let (scene, seen) = (file("fit.toml"), file("seen"));
    let text = succeed(&["inspect", arg(&scene)]).out;
    for word in ["0.0400 × 0.0400 × 0.0800 m", "0.128000 kg", "16 full, 0 cut", "45", "135", "17 frames", "youngs_modulus"] {
        assert!(text.contains(word), "\"{word}\" is not in:\n{text}");
    }
    let v: serde_json::Value = serde_json::from_str(&succeed(&["inspect", arg(&scene), "--json"]).out).unwrap();
    assert_eq!((v["cells"]["all"].as_u64(), v["degrees_of_freedom"].as_u64()), (Some(16), Some(135)));
    assert!((v["volume"].as_f64().unwrap() - 1.28e-4).abs() < 1e-12);
    // Three starts of Gauss-Newton at once, each with a matrix of 3 × 3 blocks: every node has 8 to 27 neighbours.
    assert_eq!(v["batch"].as_u64(), Some(3));
    assert!(v["memory"].as_f64().is_some_and(|m| m > 3.0 * 72.0 * 8.0 * 45.0), "{}", v["memory"]);
    let v: serde_json::Value = serde_json::from_str(&succeed(&["inspect", arg(&seen), "--json"]).out).unwrap();
    assert_eq!((&v["kind"], v["frames"]["count"].as_u64()), (&"recording".into(), Some(17)));
    // One camera: what an image shows is what a frame has.
    let [low, high] = [0, 1].map(|k| v["frames"]["readings_per_image"][k].as_u64().unwrap());
    assert!(0 < low && low < high, "{}", v["frames"]);
    assert!(text.contains(&format!("1 camera, {low} to {high} depth points a frame")), "{text}");

    // The same recording around a body a metre away.
    let far = (BLOCK.to_string() + STIFFNESS).replace("[object]", "[object]\npose = [[1,0,0,1],[0,1,0,0],[0,0,1,0],[0,0,0,1]]");
    fs::write(
        file("far.toml"),
        far.replace("min = [-0.01,", "min = [0.99,").replace("max = [0.05, 0.05, 0.001]", "max = [1.05, 0.05, 0.001]"),
    )
    .unwrap();
    let a = palpate(&["inspect", arg(&file("far.toml"))]);
    assert_eq!(a.code, 2, "{}", a.out);
    assert!(a.err.contains("far.toml") && a.err.contains("nowhere near"), "{}", a.err);
}

#[test]
fn inspect_counts_the_edges_that_were_open() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    // Six faces of a box at (x, y), in OBJ's numbering behind `first` vertices.
    let solid = |x: f64, y: f64, first: usize| {
        let corner = |k: usize| [x + 0.04 * (k & 1) as f64, y + 0.04 * (k >> 1 & 1) as f64, 0.08 * (k >> 2) as f64];
        let mut text: String = (0..8).map(corner).map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
        for face in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
            let [a, b, c, d] = face.map(|k| k + first + 1);
            text += &format!("f {a} {b} {c} {d}\n");
        }
        text
    };
    // Two boxes that share an edge, where four triangles meet; and a ball without one of its triangles.
    fs::write(file("pair.obj"), solid(0.0, 0.0, 0) + &solid(0.04, 0.04, 8)).unwrap();
    let ball = palpate_model::scene::Analytic::Ball { radius: 0.04, center: glam::DVec3::new(0.02, 0.02, 0.04) };
    let placed = palpate_model::shape::Placed::new(ball, glam::DAffine3::IDENTITY);
    let mut holed = palpate_model::shape::Shape::surface(&placed, 0.01);
    holed.triangles.remove(40);
    palpate_io::write_obj(file("holed.obj"), &holed).unwrap();
    let shape = "shape = { box = { min = [0, 0, 0], max = [0.04, 0.04, 0.08] } }";
    assert!(BLOCK.contains(shape));
    for (name, open, said, warning) in [
        ("pair", 0, "0 (closed)", "touches itself along 1 edges"),
        ("holed", 3, "3 in the file (closed by the repair)", "repaired: closed small holes: 1"),
    ] {
        let scene = file(&format!("{name}.toml"));
        fs::write(&scene, BLOCK.replace(shape, &format!("mesh = \"{name}.obj\""))).unwrap();
        let text = succeed(&["inspect", arg(&scene)]).out;
        let line = text.lines().find(|l| l.trim_start().starts_with("open edges ")).unwrap_or_else(|| panic!("{text}"));
        assert_eq!(line.trim_start().trim_start_matches("open edges").trim(), said, "{text}");
        assert!(text.contains(warning), "{text}");
        let v: serde_json::Value = serde_json::from_str(&succeed(&["inspect", arg(&scene), "--json"]).out).unwrap();
        assert_eq!(v["open_edges"], open, "{name}");
    }
}

#[test]
fn a_recording_depends_on_the_seed_alone() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    fs::write(file("block.toml"), BLOCK).unwrap();
    let scene = file("block.toml");
    let record = |name: &str, seed: &str| {
        let out = file(name);
        let (a, b) = (["observe", arg(&scene), "--camera", CAMERA, "--noise", "0.001", "--dropout", "0.05"], ["--seed", seed]);
        succeed(&[&a[..], &b[..], &["--fps", "50", "--out", arg(&out)]].concat());
        let bytes = |f: &str| fs::read(out.join(f)).unwrap();
        (bytes("depth/cam0/000003.png"), bytes("mask/cam0/000003.png"), bytes("recording.toml"))
    };
    let (a, b, c) = (record("a", "1"), record("b", "1"), record("c", "2"));
    assert!(a == b, "same seed, same bytes");
    assert!(a.0 != c.0, "another seed, other noise");
    assert!(a.1 == c.1 && a.2 == c.2, "noise does not touch masks and cameras");
    let again = palpate(&["observe", arg(&scene), "--camera", CAMERA, "--out", arg(&file("a"))]);
    assert_eq!(again.code, 2);
    assert!(again.err.contains("--force"), "{}", again.err);
}

#[test]
fn simulate_writes_what_was_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    fs::write(file("block.toml"), BLOCK).unwrap();
    let (scene, out) = (file("block.toml"), file("frames"));
    let a =
        succeed(&["simulate", arg(&scene), "--out", arg(&out), "--format", "obj,vtu,png", "--every", "10", "--json", "--quiet"]);
    assert_eq!(a.err, "", "--quiet");
    let v: serde_json::Value = serde_json::from_str(&a.out).unwrap();
    // States 0 and 10, and always the last.
    assert_eq!((v["frames"].as_u64(), v["files"].as_u64()), (Some(3), Some(9)));
    for name in ["frame_00000.obj", "frame_00010.vtu", "frame_00016.png", "series.pvd"] {
        assert!(out.join(name).exists(), "{name}");
    }
    // Hexahedra with the share of each that the body fills, and no arrays of fields that the scene does not have.
    let fractions = palpate_io::vtk::read_vtu_array(&out.join("frame_00010.vtu"), Some("fraction"), true).unwrap();
    assert_eq!(fractions, [1.0; 16]);
    let picture = image::open(out.join("frame_00010.png")).unwrap().to_rgb8();
    let body = picture.pixels().filter(|p| p.0[2] > p.0[0].saturating_add(20)).count();
    assert!(body > 5000, "the body is to be seen: {body} blue pixels of {}", picture.len() / 3);
}

#[test]
fn a_shorter_simulation_leaves_no_frames_of_a_longer_one() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    fs::write(file("block.toml"), BLOCK).unwrap();
    let (scene, out) = (file("block.toml"), file("frames"));
    let simulate = |every: &str, format: &str| {
        succeed(&["simulate", arg(&scene), "--backend", "cpu", "--out", arg(&out), "--format", format, "--every", every]).err
    };
    assert!(!simulate("1", "obj,ply").contains("removed"));
    // What only looks similar, and a series that begins elsewhere, belong to somebody else.
    let foreign = ["frame_7.obj", "frame_00003.obj.bak", "frame_00003.png"];
    foreign.iter().for_each(|name| fs::write(out.join(name), "mine").unwrap());
    let told = simulate("8", "obj,png");
    assert!(told.contains(&format!("removed from {}: 14 frames of an earlier simulation", out.display())), "{told}");
    let count = |ending: &str| {
        let names = fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        names.filter(|n| n.ends_with(ending) && !foreign.contains(&n.as_str())).count()
    };
    // The format that was not asked for again is left alone.
    assert_eq!([".obj", ".png", ".ply"].map(count), [3, 3, 17]);
    assert!(foreign.iter().all(|name| fs::read(out.join(name)).unwrap() == b"mine"));
}
