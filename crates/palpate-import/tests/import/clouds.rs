//! Sequences of point clouds.

use super::truth::*;
use glam::DVec3;
use palpate_import::{Background, Options, Unit};
use palpate_io::recording::{Recording, SeenFrom};
use std::fmt::Write;

/// Points of the ball that the camera sees, in an order of their own.
fn cloud(t: f64) -> Vec<DVec3> {
    let mut all: Vec<DVec3> = Vec::new();
    for i in 0..3000 {
        // Fibonacci's lattice on the sphere.
        let (z, a) = (1.0 - 2.0 * (f64::from(i) + 0.5) / 3000.0, f64::from(i) * 2.399963229728653);
        let n = DVec3::new(a.cos() * (1.0 - z * z).sqrt(), a.sin() * (1.0 - z * z).sqrt(), z);
        let p = center(t) + RADIUS * n;
        if n.dot(p) < 0.0 {
            all.push(p);
        }
    }
    all
}

fn ply(points: &[DVec3], scale: f64) -> String {
    let n = points.len();
    let mut t =
        format!("ply\nformat ascii 1.0\nelement vertex {n}\nproperty float x\nproperty float y\nproperty float z\nend_header\n");
    for p in points {
        writeln!(t, "{:.6} {:.6} {:.6}", p.x * scale, p.y * scale, p.z * scale).unwrap();
    }
    t
}

fn pcd(points: &[DVec3], data: &str) -> Vec<u8> {
    let n = points.len() + 1;
    let mut all = format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n\
         POINTS {n}\nDATA {data}\n"
    )
    .into_bytes();
    let mut rows: Vec<[f32; 3]> = points.iter().map(|p| p.as_vec3().to_array()).collect();
    rows.push([f32::NAN; 3]);
    match data {
        "ascii" => rows.iter().for_each(|r| all.extend(format!("{} {} {} 0\n", r[0], r[1], r[2]).as_bytes())),
        "binary" => rows.iter().for_each(|r| {
            r.iter().for_each(|x| all.extend(x.to_le_bytes()));
            all.extend([0; 4]);
        }),
        _ => {
            // Field by field, and in runs of literals: compressed by not compressing.
            let mut content: Vec<u8> = (0..3).flat_map(|a| rows.iter().flat_map(move |r| r[a].to_le_bytes())).collect();
            content.extend(vec![0; 4 * rows.len()]);
            let packed: Vec<u8> = content.chunks(32).flat_map(|c| [&[c.len() as u8 - 1], c].concat()).collect();
            all.extend((packed.len() as u32).to_le_bytes());
            all.extend((content.len() as u32).to_le_bytes());
            all.extend(packed);
        }
    }
    all
}

fn check(r: &Recording) {
    assert!(r.cameras.is_empty() && r.frames.is_empty() && r.clouds.len() == FRAMES);
    for (k, c) in r.clouds.iter().enumerate() {
        assert_eq!((c.from, c.points.len()), (SeenFrom::Origin(DVec3::ZERO), cloud(time(k)).len()));
        // Files have six digits behind the point, or those of a float.
        let off = c.points.iter().map(|p| (p.distance(center(c.time)) - RADIUS).abs()).fold(0.0, f64::max);
        assert!(off < 2e-6, "{off}");
    }
}

#[test]
fn a_sequence_of_any_kind_is_kept() {
    for kind in ["ply", "mm", "ascii", "binary", "binary_compressed"] {
        let bench = Bench::new();
        for k in 0..FRAMES {
            let points = cloud(time(k));
            match kind {
                "ply" => drop(bench.write(&format!("s/{k}.ply"), ply(&points, 1.0))),
                "mm" => drop(bench.write(&format!("s/{k}.ply"), ply(&points, 1000.0))),
                data => drop(bench.write(&format!("s/{k:03}.pcd"), pcd(&points, data))),
            }
        }
        let (imported, r, _) = bench.good("s", &Options { fps: Some(RATE), ..Options::default() });
        assert_eq!((imported.clouds, imported.images), (FRAMES, 0), "{kind}");
        assert!(imported.losses.is_empty(), "{:?}", imported.losses);
        check(&r);
        let unit = imported.guesses.iter().find(|g| g.what == "unit").unwrap();
        assert!(unit.text.contains(if kind == "mm" { "mm" } else { "are m," }), "{unit:?}");
    }
}

#[test]
fn ranges_and_boxes_take_points_away_and_a_background_makes_images() {
    let bench = Bench::new();
    // A wall behind the ball, and nothing else in the first cloud.
    let wall = |z: f64| (0..900).map(move |i| DVec3::new(0.02 * f64::from(i % 30) - 0.3, 0.02 * f64::from(i / 30) - 0.3, z));
    for k in 0..FRAMES {
        let mut points = cloud(time(k));
        points.extend(wall(2.0));
        bench.write(&format!("s/{k}.ply"), ply(&points, 1.0));
    }
    let base = Options { fps: Some(RATE), unit: Some(Unit::Metre), ..Options::default() };
    let (imported, r, _) = bench.good("s", &Options { far: Some(1.5), ..base.clone() });
    check(&r);
    assert!(imported.facts.iter().any(|f| f.contains("are taken for the object")), "{:?}", imported.facts);
    let (_, r, _) = Bench::good(&bench, "s", &Options { remove_plane: true, force: true, ..base.clone() });
    check(&r);
    let e = bench.import("s", &Options { near: Some(3.0), force: true, ..base.clone() }).unwrap_err().to_string();
    assert!(e.contains("no point of any cloud is left"), "{e}");
    let (imported, r, _) =
        bench.good("s", &Options { background: Some(Background::Frames(0, 0)), far: Some(1.5), force: true, ..base });
    assert!(r.clouds.is_empty() && imported.images > 0, "{:?}", imported.losses);
}

#[test]
fn what_contradicts_itself_is_refused() {
    let one = pcd(&cloud(0.0), "binary");
    let text = |from: &str, to: &str| {
        let at = one.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        [&one[..at], to.as_bytes(), &one[at + from.len()..]].concat()
    };
    let cases: [(&str, Vec<u8>, &str); 6] = [
        ("announced", text("POINTS 1", "POINTS 2"), "WIDTH × HEIGHT"),
        ("truncated", one[..one.len() - 8].to_vec(), "ends before"),
        ("no z", text("x y z rgb", "x y w rgb"), "FIELDS lack"),
        ("half a header", one[..60].to_vec(), "ends before its line DATA"),
        ("a kind", text("DATA binary", "DATA banana"), "DATA banana"),
        ("all NaN", pcd(&[], "ascii"), "none of its 1 points is finite"),
    ];
    for (name, bytes, words) in cases {
        let bench = Bench::new();
        bench.write("s/0.pcd", bytes);
        let e = bench.bad("s", &Options::default());
        assert!(e.contains("0.pcd") && e.contains(words), "{name}: {e}");
    }
    let bench = Bench::new();
    bench.write("s/0.ply", "ply\nformat ascii 1.0\nelement vertex 1000000000000\nproperty float x\nend_header\n1\n");
    let e = bench.bad("s", &Options::default());
    assert!(e.contains("0.ply"), "{e}");
    bench.write("s/0.ply", ply(&[], 1.0));
    let e = bench.bad("s", &Options::default());
    assert!(e.contains("finite") || e.contains("no point"), "{e}");
}

#[test]
fn damaged_clouds_never_panic() {
    let points = cloud(0.0);
    let all = [
        ("0.pcd", pcd(&points, "binary_compressed")),
        ("0.pcd", pcd(&points, "ascii")),
        ("0.ply", ply(&points, 1.0).into_bytes()),
    ];
    for (file, bytes) in all {
        // The head is where damage does most.
        let (head, rest) = bytes.split_at(200);
        for k in 0..80 {
            let bench = Bench::new();
            let b = if k % 2 == 0 { damaged(&bytes, k) } else { [&damaged(head, k)[..], rest].concat() };
            bench.write(&format!("s/{file}"), b);
            let _ = bench.import("s", &Options::default());
        }
    }
}
