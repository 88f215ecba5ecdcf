//! Stacks of depth images and tracks in arrays of NumPy.

use super::truth::*;
use palpate_import::{Options, Unit};
use palpate_io::npy::{Array, write_npz};
use palpate_io::recording::DepthPixels;

fn array(shape: &[usize], values: Vec<f64>) -> Array {
    Array { shape: shape.to_vec(), values }
}

/// An `.npy` file in version 1.0 with these bytes behind its header.
fn npy(descr: &str, shape: &str, bytes: &[u8]) -> Vec<u8> {
    let mut head = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
    while (head.len() + 11) % 64 != 0 {
        head.push(' ');
    }
    head.push('\n');
    let mut all = b"\x93NUMPY\x01\x00".to_vec();
    all.extend((head.len() as u16).to_le_bytes());
    all.extend(head.as_bytes());
    all.extend(bytes);
    all
}

fn stack(scale: f64) -> Vec<f64> {
    (0..FRAMES).flat_map(|k| image(time(k)).into_iter().map(move |z| z * scale)).collect()
}

fn matrix() -> Array {
    array(&[3, 3], vec![FOCAL, 0.0, CENTER[0], 0.0, FOCAL, CENTER[1], 0.0, 0.0, 1.0])
}

fn times() -> Array {
    array(&[FRAMES], (0..FRAMES).map(time).collect())
}

fn far() -> Options {
    Options { far: Some(0.9), ..Options::default() }
}

#[test]
fn floats_in_metres_or_millimetres_are_recognised() {
    for (scale, word) in [(1.0, "metres"), (1000.0, "millimetres")] {
        let bench = Bench::new();
        let depth = array(&[FRAMES, SIZE[1], SIZE[0]], stack(scale));
        write_npz(bench.path("ball.npz"), &[("depth", &depth), ("K", &matrix()), ("times", &times())]).unwrap();
        let (imported, r, _) = bench.good("ball.npz", &far());
        assert_eq!((imported.format, imported.images), ("npy", FRAMES));
        let (off, n) = off_ball(&r);
        // Single precision: some 1e-7 of 1.2 m.
        assert!(off < 5e-7 && n > 1000, "{off} {n}");
        assert!(imported.guesses.iter().any(|g| g.what == "unit" && g.text.contains(word)), "{:?}", imported.guesses);
        assert!(imported.losses.is_empty(), "{:?}", imported.losses);
        assert!(r.frames.iter().all(|f| matches!(f.depth.as_ref().unwrap().pixels, DepthPixels::Metres(_))));
    }
}

#[test]
fn counts_in_single_files_go_through_untouched() {
    let bench = Bench::new();
    let bytes: Vec<u8> = (0..FRAMES).flat_map(|k| counts(time(k), 0.00025)).flat_map(u16::to_le_bytes).collect();
    bench.write("d/depth.npy", npy("<u2", &format!("({FRAMES}, {}, {})", SIZE[1], SIZE[0]), &bytes));
    let k: Vec<u8> = [FOCAL, FOCAL, CENTER[0], CENTER[1]].iter().flat_map(|x| x.to_le_bytes()).collect();
    bench.write("d/intrinsics.npy", npy("<f8", "(4,)", &k));
    bench.write("d/fps.npy", npy("<i8", "(1,)", &30i64.to_le_bytes()));
    let (_, r, _) = bench.good("d", &Options { depth_scale: Some(0.00025), ..far() });
    let (off, _) = off_ball(&r);
    // Half a count.
    assert!(off < 0.00015, "{off}");
    assert!((r.frames[3].time - time(3)).abs() < 1e-12);
}

#[test]
fn tracks_become_points() {
    // Three points are no matrices; matrices beside four points are no tracks.
    let turns = array(&[FRAMES, 3, 3], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0].repeat(FRAMES));
    for (count, beside) in [(4, Some(("R", &turns))), (3, None)] {
        let bench = Bench::new();
        let mut places: Vec<f64> = Vec::new();
        for k in 0..FRAMES {
            for (i, m) in marks().into_iter().take(count).enumerate() {
                let p = (center(time(k)) + m) * 1000.0;
                let gone = i == 1 && k == 7;
                places.extend(if gone { [f64::NAN; 3] } else { p.to_array() });
            }
        }
        let (tracks, times) = (array(&[FRAMES, count, 3], places), times());
        let all: Vec<(&str, &Array)> = [("tracks", &tracks), ("times", &times)].into_iter().chain(beside).collect();
        write_npz(bench.path("t.npz"), &all).unwrap();
        let up = Some(-glam::DVec3::Y);
        let (imported, r, scene) = bench.good("t.npz", &Options { up, ..Options::default() });
        assert_eq!((imported.tracked_readings, imported.format), (count * FRAMES - 1, "npy"));
        let p = r.points.as_ref().unwrap();
        for t in 0..FRAMES {
            for (i, x) in p.track.seen(t) {
                // Doubles, there and back through a unit.
                assert!(x.distance(center(time(t)) + marks()[i]) < 1e-12);
            }
        }
        assert!(imported.guesses.iter().any(|g| g.what == "unit" && g.text.contains("mm")), "{:?}", imported.guesses);
        assert!(scene.contains("cost = \"points\"") && scene.contains("gravity = [0.0, 9.81, 0.0]"), "{scene}");
    }
}

#[test]
fn what_contradicts_itself_is_refused() {
    let depth = array(&[FRAMES, SIZE[1], SIZE[0]], stack(1.0));
    let broken = |k: usize, x: f64| {
        let mut m = matrix();
        m.values[k] = x;
        m
    };
    let with = |t: Vec<f64>| array(&[t.len()], t);
    let mut twice: Vec<f64> = (0..FRAMES).map(time).collect();
    twice[5] = twice[4];
    let cases: [(&str, Array, Array, &[&str]); 6] = [
        ("times", matrix(), with(vec![0.0; 3]), &["times", "3 times for 12 frames"]),
        ("a time twice", matrix(), with(twice), &["time 5"]),
        ("NaN among times", matrix(), with(vec![f64::NAN; FRAMES]), &["time 0 is NaN"]),
        ("NaN", broken(0, f64::NAN), times(), &["\"K\"", "NaN"]),
        ("another size", broken(2, 640.0), times(), &["principal point", "120 × 160"]),
        ("skew", broken(1, 2.0), times(), &["expected [[fx, 0, cx]"]),
    ];
    for (name, k, t, words) in cases {
        let bench = Bench::new();
        write_npz(bench.path("ball.npz"), &[("depth", &depth), ("K", &k), ("times", &t)]).unwrap();
        let e = bench.bad("ball.npz", &far());
        assert!(words.iter().all(|w| e.contains(w)), "{name}: {e}");
    }
    let bench = Bench::new();
    write_npz(bench.path("ball.npz"), &[("depth", &depth)]).unwrap();
    let e = bench.bad("ball.npz", &far());
    assert!(e.contains("no intrinsics"), "{e}");
    write_npz(bench.path("two.npz"), &[("a", &depth), ("b", &depth)]).unwrap();
    let e = bench.bad("two.npz", &far());
    assert!(e.contains("--pick") && e.contains("a, b"), "{e}");
    let half = array(&[2, 1, 3], vec![0.0, f64::NAN, 0.0, 0.1, 0.1, 0.1]);
    write_npz(bench.path("half.npz"), &[("tracks", &half)]).unwrap();
    let e = bench.bad("half.npz", &Options::default());
    assert!(e.contains("point 0 of frame 0") && e.contains("NaN in x, y and z"), "{e}");
    let small = array(&[2, 2, 3], (0..12).map(|i| f64::from(i) * 1e-3).collect());
    write_npz(bench.path("small.npz"), &[("tracks", &small)]).unwrap();
    let e = bench.bad("small.npz", &Options { unit: Some(Unit::Millimetre), ..Options::default() });
    assert!(e.contains("--unit m would make it"), "{e}");
    for bytes in
        [&b"\x93NUMPY"[..], b"PK\x03\x04", &npy("<u2", "(99999999999, 9999999999, 99999)", b""), &npy("<u2", "(4, 4, 4)", b"123")]
    {
        bench.write("bad.npz", bytes);
        bench.bad("bad.npz", &Options { format: Some("npy".into()), ..Options::default() });
    }
}

#[test]
fn damaged_arrays_never_panic() {
    let bench = Bench::new();
    let depth = array(&[2, SIZE[1], SIZE[0]], [image(0.0), image(0.2)].concat());
    write_npz(bench.path("ball.npz"), &[("depth", &depth), ("K", &matrix())]).unwrap();
    let bytes = std::fs::read(bench.path("ball.npz")).unwrap();
    let (head, rest) = bytes.split_at(256);
    for k in 0..60 {
        let bench = Bench::new();
        let b = if k % 2 == 0 { damaged(&bytes, k) } else { [&damaged(head, k)[..], rest].concat() };
        bench.write("b.npz", b);
        let _ = bench.import("b.npz", &Options { format: Some("npy".into()), ..far() });
    }
}
