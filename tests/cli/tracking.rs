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
}
