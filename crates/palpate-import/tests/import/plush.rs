//! Folders laid out as the PLUSH data set: a hanging toy that is blown at, and a wall behind it.

use super::torch::{Entry, file};
use super::truth::{Bench, damaged};
use glam::DVec3;
use palpate_import::Options;
use palpate_io::npy::{Array, write_npz};
use palpate_io::read_scene;
use zip::CompressionMethod::{Deflated, Stored};

const FRAMES: usize = 9;
/// Vertices of the toy, of which the first are fixed; the others are wall.
const TOY: usize = 320;
const FIXED: usize = 12;
const ALL: usize = 400;

/// A vertex in a frame [m].
fn vertex(i: usize, frame: usize) -> DVec3 {
    let k = i as f64;
    if i >= TOY {
        return DVec3::new((0.7 * k).sin(), (0.9 * k).cos(), -1.0);
    }
    // Over a cylinder that hangs from its top; what is lower sways farther.
    let height = if i < FIXED { 0.1 } else { 0.099 - 0.2 * k / TOY as f64 };
    let sway = 0.02 * (0.1 - height) / 0.2 * (frame as f64).sin();
    DVec3::new(0.03 * (2.4 * k).cos() + sway, height, 0.03 * (2.4 * k).sin() - 0.3)
}

/// Puts a frame into the folder.
fn frame(bench: &Bench, k: usize, count: usize) {
    let values = (0..count).flat_map(|i| vertex(i, k).to_array()).collect();
    bench.write("toy/reconstruction/x", "");
    let path = bench.path(&format!("toy/reconstruction/{k:05}.npz"));
    write_npz(path, &[("vertices", &Array { shape: vec![count, 3], values })]).unwrap();
}

fn mask() -> [(&'static str, Entry); 2] {
    let object = (0..TOY as i64).collect();
    [("objectInd", Entry::Longs(object)), ("fixed", Entry::Bools((0..ALL).map(|i| i < FIXED).collect()))]
}

fn toy() -> Bench {
    let bench = Bench::new();
    (0..FRAMES).for_each(|k| frame(&bench, k, ALL));
    bench.write("toy/reconstruction/mask.pt", file(&mask(), Stored));
    let even = (0..ALL).map(|i| i % 2 == 0).collect();
    let split = [
        ("trainingInd", Entry::List(vec![0, 3, 7])),
        ("valInd", Entry::Longs(vec![1, 2, 4, 5, 6, 8])),
        ("sampledVerts", Entry::Bools(even)),
    ];
    bench.write("toy/simulation/simInfo.pt", file(&split, Stored));
    // The marker a quarter turn about z in the second frame, lost in the third.
    let path = "[{\"rvecs\": [[1,0,0],[0,1,0],[0,0,1]], \"tvecs\": [10, 20, 300]},
        {\"rvecs\": [[0,-1,0],[1,0,0],[0,0,1]], \"tvecs\": [[10], [20], [300]]}, null]";
    bench.write("toy/capture/aruco_path.json", path);
    bench.write("toy/capture/calibration.json", "{\"cam0001\": {}, \"cam0002\": {}}");
    bench.write("toy/simulation/val_GT/0.obj", "v 0 0 0\n");
    bench
}

#[test]
fn tracks_nozzle_and_frames_to_train_on_become_a_recording_and_a_scene() {
    let bench = toy();
    let (imported, r, scene) = bench.good("toy", &Options::default());
    // Every second vertex of the toy was sampled.
    assert_eq!((imported.format, imported.tracked_readings), ("plush", FRAMES * TOY / 2));
    let p = r.points.as_ref().unwrap();
    for t in 0..FRAMES {
        assert!((p.track.times[t] - t as f64 / 40.0).abs() < 1e-12);
        for (i, x) in p.track.seen(t) {
            // Doubles, written and read.
            assert!(x.distance(vertex(2 * i, t)) < 1e-12, "{i} {t}");
        }
    }
    for wanted in [
        "mode = \"quasi-static\"",
        "[[attach]]\ntrack = \"recording\"\npoints = [0, 1, 2, 3, 4, 5]\n",
        "frames = { train = { numbers = [0, 3, 7] } }",
        "gravity = [0.0, -9.81, 0.0]",
        "cost = \"points\"",
    ] {
        assert!(scene.contains(wanted), "{wanted}: {scene}");
    }
    for absent in ["[initial]", "[[plane]]", "[[clamp]]", "damping", "time.start"] {
        assert!(!scene.contains(absent), "{absent}: {scene}");
    }
    let read = read_scene(bench.path("out/scene.toml")).unwrap().value;
    let train = read.fit.unwrap().frames.unwrap();
    assert_eq!((0..FRAMES).filter(|k| train.holds(*k)).collect::<Vec<_>>(), [0, 3, 7]);
    // (0, 105, 0) mm from the marker, then y and z turned round.
    let nozzle = std::fs::read_to_string(bench.path("out/nozzle.csv")).unwrap();
    let rows: Vec<Vec<f64>> = nozzle.lines().skip(1).map(|l| l.split(',').map(|x| x.parse().unwrap()).collect()).collect();
    let wanted = [[0.0, 0.01, -0.125, -0.3, 0.0, 0.0, 1.0], [0.025, -0.095, -0.02, -0.3, 0.0, 0.0, 1.0]];
    assert_eq!(rows.len(), 2, "{nozzle}");
    assert!(rows.iter().flatten().zip(wanted.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-12), "{nozzle}");
    let said = [imported.facts.join("\n"), imported.losses.join("\n")].concat();
    for wanted in ["2 cameras", "3 frames to train on, 6 to try it on", "no law of a jet", "published simulation"] {
        assert!(said.contains(wanted), "{wanted}: {said}");
    }
    for what in ["unit", "axis", "shape", "attachment", "rate"] {
        assert!(imported.guesses.iter().any(|g| g.what == what), "{what}: {:?}", imported.guesses);
    }
}

#[test]
fn points_are_thinned_and_frames_left_out() {
    let bench = toy();
    let (_, r, scene) = bench.good("toy", &Options { points: Some(50), every: Some(3), ..Options::default() });
    let p = r.points.as_ref().unwrap();
    assert_eq!((p.rest.len(), p.track.times.len()), (50, 3));
    // Of the frames trained on, 0 and 3 are left, as 0 and 1; six fixed points are fewer than a fifth and stay.
    assert!(scene.contains("numbers = [0, 1]") && scene.contains("points = [0, 1, 2, 3, 4, 5]"), "{scene}");
    // Far from each other: the smallest distance is a good part of what 50 points on the cylinder's 0.2 m by 0.19 m have.
    let near = |i: usize| (6..50).filter(|j| *j != i).map(|j| p.rest[i].distance(p.rest[j])).fold(f64::INFINITY, f64::min);
    let least = (6..50).map(near).fold(f64::INFINITY, f64::min);
    assert!(least > 0.5 * (0.2f64 * 0.19 / 50.0).sqrt(), "{least}");
}

#[test]
fn a_folder_without_mask_is_held_at_its_top() {
    let bench = toy();
    std::fs::remove_file(bench.path("toy/reconstruction/mask.pt")).unwrap();
    std::fs::remove_file(bench.path("toy/simulation/simInfo.pt")).unwrap();
    let (imported, r, scene) = bench.good("toy", &Options::default());
    assert_eq!(r.points.as_ref().unwrap().rest.len(), ALL);
    assert!(imported.guesses.iter().any(|g| g.what == "object" && g.text.contains("there is no mask.pt")));
    assert!(scene.contains("[[clamp]]") && !scene.contains("[[attach]]") && !scene.contains("train"), "{scene}");
}

#[test]
fn what_is_wrong_is_named() {
    let with = |change: &dyn Fn(&Bench)| {
        let bench = toy();
        change(&bench);
        bench.bad("toy", &Options { format: Some("plush".into()), ..Options::default() })
    };
    let masked =
        |entries: Vec<(&'static str, Entry)>| with(&|b| drop(b.write("toy/reconstruction/mask.pt", file(&entries, Stored))));
    let one = |entry: Entry| masked(vec![("objectInd", entry)]);
    for (e, wanted) in [
        (with(&|b| frame(b, 4, ALL - 1)), "00004.npz: holds 399 vertices, reconstruction/00000.npz holds 400"),
        (with(&|b| drop(b.write("toy/reconstruction/00000.npz", "PK"))), "is not a readable .npz file"),
        (
            with(&|b| drop(b.write("toy/capture/aruco_path.json", "[{\"rvecs\": [1, 2, 3]}]"))),
            "0.rvecs: holds 3 finite numbers, expected 9",
        ),
        (
            with(&|b| drop(b.write("toy/capture/aruco_path.json", "[{\"rvecs\": [1,0,0,0,2,0,0,0,1], \"tvecs\": [0,0,0]}]"))),
            "is no rotation matrix",
        ),
        (one(Entry::Longs(vec![0, 400])), "names vertex 400; there are 400"),
        (one(Entry::Longs(vec![-1])), "names vertex -1"),
        (one(Entry::Halved(vec![0.5, 1.0, 2.0])), "holds fractions"),
        (
            one(Entry::Raw(b"cnumpy.core.multiarray\n_reconstruct\n)R".to_vec())),
            "is made by numpy.core.multiarray._reconstruct, which is not read",
        ),
        (one(Entry::Raw(b")\x81".to_vec())), "opcode NEWOBJ at byte"),
        (one(Entry::Raw(b"cposix\nsystem\nX\x04\x00\x00\x00true\x85R".to_vec())), "is made by posix.system, which is not read"),
        (masked(vec![("other", Entry::List(vec![1]))]), "has no entry \"objectInd\"; there are: other (1,)"),
        (
            with(&|b| drop(b.write("toy/reconstruction/mask.pt", file(&mask(), Deflated)))),
            "is compressed, which torch.save does not do",
        ),
        (
            with(&|b| drop(b.write("toy/reconstruction/mask.pt", b"\x80\x02\x8a\x0al\xfc\x9cF\xf9 j\xa8P\x19."))),
            "before 1.6; load it and save it again",
        ),
        (with(&|b| drop(b.write("toy/reconstruction/mask.pt", "text"))), "is no file of torch.save"),
    ] {
        assert!(e.contains(wanted), "{wanted}: {e}");
    }
    let bench = toy();
    let e = bench.bad("toy", &Options { release: Some(0.1), ..Options::default() });
    assert!(e.contains("--release") && e.contains("are equilibria"), "{e}");
}

#[test]
fn damaged_files_of_torch_never_panic() {
    let bytes = file(&mask(), Stored);
    // The pickle begins some forty bytes behind the archive's first entry.
    let (head, rest) = bytes.split_at(400);
    for k in 0..80 {
        let bench = toy();
        let b = if k % 2 == 0 { damaged(&bytes, k) } else { [&damaged(head, k)[..], rest].concat() };
        bench.write("toy/reconstruction/mask.pt", b);
        let _ = bench.import("toy", &Options::default());
    }
}
