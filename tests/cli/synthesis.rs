//! `palpate synthesize`: hands, wind and edits, forces that lead through keyframes, and what is refused.

use std::path::Path;
use support::command::{arg, json, palpate, succeed};

const BAR: &str = r#"
format = "scene/1"
[object]
shape = { box = { min = [0, 0, 0], max = [0.4, 0.1, 0.1] } }
cells = 8
[material]
density = 1000
youngs_modulus = 2e5
poisson_ratio = 0.4
stiffness_damping = 2e-3
[[clamp]]
box = { min = [-0.01, -0.01, -0.01], max = [0.001, 0.11, 0.11] }
[initial]
state = "static-equilibrium"
[time]
step = 0.02
duration = 0.4
"#;

/// A hand that lifts the bar's end, a gale, a blow, and a ball that presses on it from the side.
const ACTING: &str = r#"
[[handle]]
point = [0.4, 0.05, 0.05]
radius = 0.03
stiffness = 2000
path = "lift.csv"
[[effect]]
kind = "wind"
mean = [0, 8, 0]
gust = [0, 4, 0]
noise = 1
length = 0.2
[[effect]]
kind = "impulse"
momentum = [0, 0, 0.1]
point = [0.2, 0.05, 0.05]
duration = 0.08
[[effect]]
kind = "push"
radius = 0.04
path = [[0, 0.2, 0.2, 0.05], [0.3, 0.2, 0.13, 0.05]]
"#;

const LED: &str = r#"
[[handle]]
point = [0.4, 0.05, 0.05]
radius = 0.03
[synthesize]
force = 50
knots = 8
[[keyframe]]
time = 0.2
sigma = 3e-4
points = [[0.4, 0.05, 0.05]]
positions = [[0.39, 0.07, 0.06]]
[[keyframe]]
time = 0.4
sigma = 5e-4
points = [[0.4, 0.05, 0.05]]
positions = [[0.39, 0.04, 0.05]]
"#;

fn folder(scenes: &[(&str, String)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in scenes {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

/// Mean of the vertices of an OBJ file with x above this.
fn mean(path: &Path, beyond: f64) -> [f64; 3] {
    let text = std::fs::read_to_string(path).unwrap();
    let vertex = |line: &str| -> Option<Vec<f64>> { line.strip_prefix("v ")?.split(' ').map(|x| x.parse().ok()).collect() };
    let all: Vec<Vec<f64>> = text.lines().filter_map(vertex).filter(|v| v[0] > beyond).collect();
    assert!(!all.is_empty());
    [0, 1, 2].map(|a| all.iter().map(|v| v[a]).sum::<f64>() / all.len() as f64)
}

#[test]
fn hands_wind_blows_and_balls_move_a_body_and_the_scene_written_moves_it_again() {
    let f =
        folder(&[("bar.toml", format!("{BAR}{ACTING}")), ("lift.csv", "time,x,y,z\n0,0.4,0.05,0\n0.4,0.39,0.05,0.1\n".into())]);
    let (scene, out, again) = (f.path().join("bar.toml"), f.path().join("a/out"), f.path().join("again"));
    let said = succeed(&["synthesize", arg(&scene), "--out", arg(&out)]);
    assert!(said.out.contains("20 steps"), "{}", said.out);
    let document = json(out.join("synthesis.json"));
    assert_eq!((document["format"].as_str(), document["motion"]["frames"].as_u64()), (Some("synthesis/1"), Some(21)));
    assert!(document["search"].is_null());
    // Paths hold from the other folder, and the same motion comes to the last bit.
    succeed(&["simulate", arg(&out.join("scene.toml")), "--out", arg(&again)]);
    let frame = |folder: &Path, k: usize| std::fs::read(folder.join(format!("frame_{k:05}.obj"))).unwrap();
    assert!([0, 7, 20].iter().all(|k| frame(&out, *k) == frame(&again, *k)));
    // Each of them does what it is there for: without it the end, or the middle, is elsewhere.
    let end = |folder: &Path, beyond: f64| mean(&folder.join("frame_00020.obj"), beyond);
    let without = |edit: &str, name: &str| {
        let out = f.path().join(name);
        succeed(&["synthesize", arg(&scene), "--out", arg(&out), "--edit", edit]);
        out
    };
    let all = end(&out, 0.35);
    assert!(all[2] - end(&without("handle.0.stiffness=1e-3", "loose"), 0.35)[2] > 0.01, "the hand lifts the end");
    assert!(all[1] - end(&without("effect.0.normal=0", "calm"), 0.35)[1] > 5e-4, "the wind blows it sideways");
    let middle = end(&out, 0.15)[1];
    assert!(end(&without("effect.2.stiffness=0", "free"), 0.15)[1] - middle > 1e-3, "the ball presses it back");
    let early = |folder: &Path| mean(&folder.join("frame_00004.obj"), 0.15)[2];
    assert!(early(&out) - early(&without("effect.1.momentum=[0, 0, 0]", "still")) > 5e-4, "the blow throws it up");
}

#[test]
fn keyframes_are_met_and_edits_are_kept() {
    let f = folder(&[("led.toml", format!("{BAR}{LED}"))]);
    let (scene, out, again) = (f.path().join("led.toml"), f.path().join("out"), f.path().join("again"));
    let edits = ["--edit", "material.youngs_modulus=3e5", "--edit", "gravity=[0, 0, -5]"];
    let said = succeed(&[&["synthesize", arg(&scene), "--out", arg(&out), "--every", "20"][..], &edits].concat());
    assert!(said.out.contains("24 coefficients") && said.out.contains("keyframe at 0.2000 s"), "{}", said.out);
    let search = &json(out.join("synthesis.json"))["search"];
    let keyframes = search["keyframes"].as_array().unwrap();
    assert_eq!(keyframes.iter().map(|k| k["points"].as_u64().unwrap()).collect::<Vec<_>>(), [1, 1]);
    assert!(keyframes.iter().all(|k| k["worst"].as_f64().unwrap() < 1e-3), "{keyframes:?}");
    let text = std::fs::read_to_string(out.join("scene.toml")).unwrap();
    assert!(text.contains("3e5") && !text.contains("keyframe") && text.matches("\"impulse\"").count() == 8, "{text}");
    // A head and a row for the start and every step.
    assert_eq!(std::fs::read_to_string(out.join("forces.csv")).unwrap().lines().count(), 22);
    succeed(&["simulate", arg(&out.join("scene.toml")), "--out", arg(&again), "--every", "20"]);
    let frame = |folder: &Path| std::fs::read(folder.join("frame_00020.obj")).unwrap();
    assert_eq!(frame(&out), frame(&again));
}

#[test]
fn what_makes_no_motion_is_refused_with_its_key() {
    let held = "[[handle]]\npoint = [0.9, 0.05, 0.05]\nstiffness = 3\npath = [[0, 0, 0, 0]]\n";
    let short = "[[effect]]\nkind = \"impulse\"\nmomentum = [0, 0, 1]\nduration = 0.05\n";
    let late = LED.replace("time = 0.4", "time = 0.5");
    let f = folder(&[
        ("bar.toml", BAR.into()),
        ("nothing.toml", format!("{BAR}{held}")),
        ("short.toml", format!("{BAR}{short}")),
        ("late.toml", format!("{BAR}{late}")),
    ]);
    let refused = |name: &str, more: &[&str]| {
        let scene = f.path().join(name);
        let out = f.path().join("out");
        let a = palpate(&[&["synthesize", arg(&scene), "--out", arg(&out)][..], more].concat());
        assert_eq!(a.code, 2, "{}{}", a.out, a.err);
        assert!(!out.exists(), "nothing is written");
        a.err
    };
    for (said, message) in [
        (refused("nothing.toml", &[]), "handle.0.point"),
        (refused("nothing.toml", &[]), "from the nearest node of the body"),
        (refused("short.toml", &[]), "effect.0.duration: 0.05 s is shorter than 4 steps (0.08 s)"),
        (refused("late.toml", &[]), "keyframe.1.time: 0.5 s lies outside the motion"),
        (refused("bar.toml", &["--edit", "material.youngs_modulu=3"]), "did you mean \"youngs_modulus\"?"),
        (refused("bar.toml", &["--edit", "material.youngs_modulus=-3"]), "material.youngs_modulus"),
        (refused("bar.toml", &["--edit", "effect.0={ kind = \"wnd\" }"]), "did you mean \"wind\"?"),
        (refused("bar.toml", &["--edit", "gravity"]), "needs a key and a value"),
        (refused("bar.toml", &["--edit", "time.duration=0"]), "time.duration"),
    ] {
        assert!(said.contains(message), "{message}: {said}");
    }
}
