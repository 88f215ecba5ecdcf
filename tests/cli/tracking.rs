//! `palpate track`: the moving body out of a depth recording, whatever moved it, and what a fit makes of it.

use palpate_io::npy::read_array;
use std::path::Path;
use support::command::{arg, json, palpate, succeed};

/// A bar that is let go and swings down by a third of its length.
const BAR: &str = r#"
format = "scene/1"
title = "Bar"

[object]
shape = { box = { min = [0.0, -0.02, -0.02], max = [0.16, 0.02, 0.02] } }
cell_size = 0.02

[material]
density = 1000.0
youngs_modulus = 5.0e4
poisson_ratio = 0.4
stiffness_damping = 0.002

[[clamp]]
box = { min = [-0.01, -0.1, -0.1], max = [0.0001, 0.1, 0.1] }

[time]
step = 0.005
duration = 0.3
"#;

const OBSERVED: &str = "
[observation]
recording = \"seen\"
cost = \"sparse-surface\"
";

/// The bar's surface at rest, not at the corners, which nobody sees as they are.
fn places() -> Vec<f64> {
    let mut all = Vec::new();
    for i in 0..15 {
        for (y, z) in [(-0.02, 0.0), (0.02, 0.0), (0.0, -0.02), (0.0, 0.02)] {
            all.extend([0.01 + 0.01 * f64::from(i), y, z]);
        }
    }
    all
}

fn npy(path: &Path, values: &[f64]) {
    let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, 3), }}", values.len() / 3);
    let padded = format!("{header:<117}\n");
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(padded.bytes());
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    std::fs::write(path, bytes).unwrap();
}

/// A folder with what two cameras saw of the bar, `seen`, and where its surface was, `truth`; both on cells half as large.
fn observed() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    std::fs::write(file("bar.toml"), BAR).unwrap();
    npy(&file("places.npy"), &places());
    let (scene, seen, truth, points) = (file("bar.toml"), file("seen"), file("truth"), file("places.npy"));
    let cameras =
        ["eye=0.1,-0.5,0.15 target=0.08,0,-0.02 fov=30 size=64x48", "eye=0.4,0.3,0.2 target=0.08,0,-0.02 fov=30 size=64x48"];
    let every = ["--fps", "30", "--refine", "2"];
    let depth =
        ["--noise", "0.001", "--depth-scale", "0.0001", "--camera", cameras[0], "--camera", cameras[1], "--out", arg(&seen)];
    succeed(&[&["observe", arg(&scene)][..], &every, &depth].concat());
    succeed(&[&["observe", arg(&scene), "--points", arg(&points), "--out", arg(&truth)][..], &every].concat());
    folder
}

/// Root mean square of how far tracked places of the surface lie from the truth [m], over all frames of `out`, the first of which is
/// number `first` of the truth; how far they moved; and the share within two standard deviations.
fn misses(folder: &Path, out: &str, first: usize) -> (f64, f64, f64) {
    let tracked = |name: &str| read_array(&folder.join(out).join("tracked.npz"), Some(name)).unwrap();
    let (rest, surface, sigma) = (tracked("rest"), tracked("surface"), tracked("sigma"));
    let truth = read_array(&folder.join("truth/points.npz"), Some("points")).unwrap();
    let places = places();
    let (count, vertices) = (places.len() / 3, rest.shape[0]);
    let at = |values: &[f64], k: usize| [values[3 * k], values[3 * k + 1], values[3 * k + 2]];
    let away = |a: [f64; 3], b: [f64; 3]| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>().sqrt();
    let (mut squares, mut moved, mut inside, mut all) = (0.0, 0.0f64, 0usize, 0usize);
    for p in 0..count {
        let place = at(&places, p);
        let near =
            (0..vertices).min_by(|a, b| away(at(&rest.values, *a), place).total_cmp(&away(at(&rest.values, *b), place))).unwrap();
        let offset: [f64; 3] = std::array::from_fn(|c| place[c] - at(&rest.values, near)[c]);
        for f in 0..surface.shape[0] {
            let (found, right) = (at(&surface.values, f * vertices + near), at(&truth.values, (f + first) * count + p));
            // The nearest vertex stands for the place: they are a few millimetres apart and turn with the body.
            let found: [f64; 3] = std::array::from_fn(|c| found[c] + offset[c]);
            squares += away(found, right).powi(2);
            moved = moved.max(away(place, right));
            for c in 0..3 {
                inside += usize::from((found[c] - right[c]).abs() < 2.0 * sigma.values[f * vertices + near]);
            }
            all += 1;
        }
    }
    ((squares / all as f64).sqrt(), moved, inside as f64 / (3 * all) as f64)
}

#[test]
fn a_swinging_bar_is_tracked_with_the_wrong_stiffness_and_becomes_a_recording() {
    let folder = observed();
    let file = |name: &str| folder.path().join(name);
    // Twice as stiff, and without damping.
    let guess = BAR.replace("5.0e4", "1.0e5").replace("stiffness_damping = 0.002\n", "");
    std::fs::write(file("track.toml"), guess + OBSERVED).unwrap();
    let out = file("out");
    let told = succeed(&["track", arg(&file("track.toml")), "--out", arg(&out), "--format", "ply,vtu"]);
    assert!(told.out.starts_with("tracked\n"), "{}", told.out);
    let (miss, moved, inside) = misses(folder.path(), "out", 0);
    println!("{miss} m away, {moved} m moved, {inside} within two standard deviations");
    // The noise is a millimetre, and cells are 20 mm long; what is not seen is as near.
    assert!(moved > 0.05 && miss < 0.0015 && inside > 0.9, "{miss} {moved} {inside}");
    let rows = json(out.join("tracked.json"));
    assert_eq!((rows["format"].as_str(), rows["verdict"].as_str()), (Some("tracking/1"), Some("tracked")));
    assert_eq!(rows["frames"].as_array().unwrap().len(), 10);
    for name in ["frame_00000.ply", "frame_00009.vtu", "series.pvd"] {
        assert!(out.join(name).exists(), "{name}");
    }
    // What was tracked is a measurement; the same numbers come out as went into the recording.
    let scene = out.join("scene.toml");
    let text = std::fs::read_to_string(&scene).unwrap();
    let fit = "\n[[fit.parameter]]\npath = \"material.youngs_modulus\"\nbounds = [1e4, 1e6]\n\n[[fit.parameter]]\npath = \
               \"material.stiffness_damping\"\nstart = 0.001\nbounds = [1e-5, 0.02]\n";
    std::fs::write(&scene, text + fit).unwrap();
    succeed(&["fit", arg(&scene), "--out", arg(&file("found")), "--no-grid-check"]);
    let young = json(file("found").join("result.json"))["parameters"][0]["value"].as_f64().unwrap();
    // Within what cells of twice the edge and a prior of twice the stiffness leave.
    assert!((young / 5e4 - 1.0).abs() < 0.15, "{young}");
}

#[test]
fn a_bar_that_is_far_from_where_it_is_thought_is_found() {
    let folder = observed();
    let file = |name: &str| folder.path().join(name);
    let late = OBSERVED.to_string() + "frames = { from = 0.26, to = 0.31 }\nband = 1.0\n";
    std::fs::write(file("late.toml"), BAR.to_string() + &late).unwrap();
    succeed(&["track", arg(&file("late.toml")), "--out", arg(&file("late"))]);
    let rows = json(file("late/tracked.json"));
    assert_eq!(rows["frames"][0]["cold"], true, "{rows}");
    let (miss, moved, _) = misses(folder.path(), "late", 8);
    assert!(moved > 0.1 && miss < 0.003, "{miss} {moved}");
    // A device that says which readings belong where leads to the same place.
    if !support::gpu::there_is_one() {
        return;
    }
    let late = file("late-gpu");
    succeed(&["track", arg(&file("late.toml")), "--out", arg(&late), "--backend", "gpu"]);
    let on_device = json(late.join("tracked.json"));
    assert_eq!(on_device["frames"][0]["cold"], true, "{on_device}");
    let surface = |out: &str| read_array(&file(out).join("tracked.npz"), Some("surface")).unwrap().values;
    let (a, b) = (surface("late"), surface("late-gpu"));
    let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let first = a.len() / rows["frames"].as_array().unwrap().len();
    let (cold, all) = (apart(&a[..first], &b[..first]), apart(&a, &b));
    println!("{cold} m apart in the cold frame, {all} m in all");
    // Shares agree to 1e-5. In frames after the first a reading at the edge of the band may belong or not, which is worth a part of its noise.
    assert!(a.len() == b.len() && cold < 1e-5 && all < 1e-3, "{cold} {all}");
}

/// The bar with two free numbers, begun at this modulus and without a word on damping.
fn fitted_from(young: f64, warm: &str) -> String {
    let fit = "\n[[fit.parameter]]\npath = \"material.youngs_modulus\"\nbounds = [1e2, 1e8]\n\n[[fit.parameter]]\npath = \
               \"material.stiffness_damping\"\nstart = 1e-4\nbounds = [1e-6, 0.1]\n";
    BAR.replace("5.0e4", &format!("{young:e}")) + OBSERVED + &format!("\n[fit]\nwarm_start = \"{warm}\"\n") + fit
}

fn value(result: &serde_json::Value, i: usize) -> f64 {
    result["parameters"][i]["value"].as_f64().unwrap()
}

#[test]
fn vibrations_start_a_fit_from_a_hundredth_and_a_hundred_times_the_modulus() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    std::fs::write(file("bar.toml"), BAR.replace("duration = 0.3", "duration = 0.8")).unwrap();
    npy(&file("places.npy"), &places());
    succeed(&[
        "observe",
        arg(&file("bar.toml")),
        "--points",
        arg(&file("places.npy")),
        "--fps",
        "30",
        "--out",
        arg(&file("seen")),
    ]);
    let scene =
        |young: f64| fitted_from(young, "modal").replace("duration = 0.3", "duration = 0.8").replace("sparse-surface", "points");
    for young in [5e2, 5e6] {
        std::fs::write(file("fit.toml"), scene(young)).unwrap();
        succeed(&["fit", arg(&file("fit.toml")), "--out", arg(&file("found")), "--no-grid-check"]);
        let result = json(file("found/result.json"));
        let start = result["runs"][0]["start"]["material.youngs_modulus"].as_f64().unwrap();
        println!("from {young}: start {start}, {}", result["notes"]);
        // It swings through two thirds of its length, where it is slower than a small vibration by some percent.
        assert!((start / 5e4 - 1.0).abs() < 0.1, "{start}");
        // Tracks without noise, by the same cells and steps.
        assert!((value(&result, 0) / 5e4 - 1.0).abs() < 1e-3 && (value(&result, 1) / 0.002 - 1.0).abs() < 1e-2, "{result}");
    }
    // What says nothing is said, and the fit begins as stated.
    std::fs::write(file("fit.toml"), scene(4e4).replace("duration = 0.8", "duration = 0.8\nstart = 0.7")).unwrap();
    succeed(&["fit", arg(&file("fit.toml")), "--out", arg(&file("found")), "--no-grid-check", "--iterations", "0"]);
    let result = json(file("found/result.json"));
    assert!(result["notes"][0].as_str().unwrap().contains("no start by vibrations"), "{}", result["notes"]);
}

#[test]
fn a_fit_of_depth_images_from_far_off_is_led_by_tracking() {
    let folder = observed();
    let file = |name: &str| folder.path().join(name);
    // A band of one cell sees half of what it should see.
    let scene = |young, start: &str| {
        let narrow = fitted_from(young, "tracked").replace("cost = \"sparse-surface\"", "cost = \"sparse-surface\"\nband = 1.0");
        narrow.replace("start = 1e-4", start)
    };
    std::fs::write(file("far.toml"), scene(1e6, "start = 1e-4")).unwrap();
    let told = succeed(&["fit", arg(&file("far.toml")), "--out", arg(&file("found")), "--no-grid-check"]);
    let result = json(file("found/result.json"));
    println!("{}", told.out);
    // Within what cells of twice the edge change, as without tracking from near by.
    assert!((value(&result, 0) / 5e4 - 1.0).abs() < 0.1, "{result}");
    assert!(result["notes"][0].as_str().unwrap().contains("it was tracked"), "{}", result["notes"]);
    let tracks = &result["from_tracks"][0];
    assert!(tracks["distance"].as_f64().is_some() && tracks["path"] == "material.youngs_modulus", "{tracks}");
    // From near by nothing is tracked.
    std::fs::write(file("near.toml"), scene(5.2e4, "start = 2e-3")).unwrap();
    let near = file("near");
    succeed(&["fit", arg(&file("near.toml")), "--out", arg(&near), "--no-grid-check"]);
    let direct = json(near.join("result.json"));
    assert!(direct["notes"][0].as_str().unwrap().contains("start as stated"), "{}", direct["notes"]);
    assert!(direct.get("from_tracks").is_none());
    // Both ways lead to the same minimum.
    assert!((value(&direct, 0) / value(&result, 0) - 1.0).abs() < 1e-3, "{} {}", value(&direct, 0), value(&result, 0));
}

#[test]
fn tracking_and_fitting_in_turns_settles() {
    let folder = observed();
    let file = |name: &str| folder.path().join(name);
    std::fs::write(file("far.toml"), fitted_from(5e5, "none")).unwrap();
    let out = file("out");
    let told = succeed(&["track", arg(&file("far.toml")), "--out", arg(&out), "--refine", "4"]);
    println!("{}", told.out);
    let rows = json(out.join("tracked.json"));
    let rounds = rows["rounds"].as_array().unwrap();
    let young = |k: usize| rounds[k]["values"][0]["value"].as_f64().unwrap();
    let last = rounds.len() - 1;
    assert!(rows["verdict"] == "tracked" && rounds[last]["moved"].as_f64().unwrap() < 0.3, "{rows}");
    assert!((young(last) / 5e4 - 1.0).abs() < 0.1, "{rounds:?}");
    // The prior is wrong by less than before.
    let temperature = |k: usize| rounds[k]["temperature"].as_f64().unwrap();
    assert!(temperature(last) < temperature(0), "{rounds:?}");
    // A fit of the depth images goes on from there.
    let told = succeed(&["fit", arg(&file("far.toml")), "--from", arg(&out), "--out", arg(&file("found")), "--no-grid-check"]);
    assert!(told.out.contains("by tracked points alone"), "{}", told.out);
    let (a, b) = (json(file("found/result.json")), palpate(&["fit", arg(&file("far.toml")), "--from", arg(folder.path())]));
    assert!((value(&a, 0) / 5e4 - 1.0).abs() < 0.1, "{a}");
    assert!(b.code == 2 && b.err.contains("--from") && b.err.contains("palpate track"), "{}", b.err);
}

#[test]
fn what_cannot_be_tracked_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.toml");
    let refused = |text: String, words: &[&str]| {
        std::fs::write(&scene, text).unwrap();
        let a = palpate(&["track", arg(&scene), "--out", arg(&folder.path().join("out"))]);
        assert!(a.code == 2 && words.iter().all(|w| a.err.contains(w)), "{} {}", a.code, a.err);
    };
    refused(BAR.into(), &["observation", "nothing to track"]);
    refused(BAR.to_string() + "[track]\nprior = \"soft\"\n", &["track.prior", "elastic", "dynamic"]);
    refused(BAR.to_string() + "[track]\ntemperature = -1.0\n", &["track.temperature", "auto"]);
    refused(BAR.to_string() + "[track]\noutliers = 1.5\n", &["track.outliers", "[0, 0.9)"]);
    refused(BAR.to_string() + "[track]\nsoft_stat = 1.5\n", &["soft_stat", "soft_start"]);
    refused(BAR.to_string() + "[fit]\nwarm_start = \"cold\"\n", &["fit.warm_start", "modal", "tracked"]);
}
