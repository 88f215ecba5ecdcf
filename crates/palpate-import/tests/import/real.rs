//! Real measurements, in the layouts that they come in.

use super::truth::Bench;
use palpate_import::{Options, Unit};
use palpate_io::read_recording;
use std::fmt::Write;
use std::fs;
use std::path::PathBuf;

/// The folder with real measurements; `None` where it is not, which is a failure where tests must not be skipped.
fn data(name: &str) -> Option<PathBuf> {
    let folder = std::env::var("PALPATE_DATA").map_or_else(|_| PathBuf::from("../../../shared/data"), PathBuf::from).join(name);
    if !folder.is_dir() {
        assert!(std::env::var("CI").is_err(), "{} is not there", folder.display());
        eprintln!("skipped: {} is not there", folder.display());
        return None;
    }
    Some(folder)
}

#[test]
fn a_measured_beam_as_its_cameras_exported_it() {
    let Some(folder) = data("beam-mocap-gravity-a") else { return };
    let truth = read_recording(&folder).unwrap();
    let m = truth.markers.unwrap();
    let mut times: Vec<f64> = m.samples.iter().map(|s| s.time).collect();
    times.dedup();
    let mut t = format!(
        "NO_OF_FRAMES\t{}\nNO_OF_CAMERAS\t8\nNO_OF_MARKERS\t3\nFREQUENCY\t100\nDATA_INCLUDED\t3D\nMARKER_NAMES\t{}\n",
        times.len(),
        m.names.join("\t")
    );
    for time in &times {
        let row: Vec<String> = (0..3)
            .map(|k| {
                let seen = m.samples.iter().find(|s| s.time == *time && s.marker == k);
                seen.map_or("\t\t".into(), |s| {
                    format!("{:.3}\t{:.3}\t{:.3}", 1e3 * s.position.x, 1e3 * s.position.y, 1e3 * s.position.z)
                })
            })
            .collect();
        writeln!(t, "{}", row.join("\t")).unwrap();
    }
    let bench = Bench::new();
    bench.write("beam.tsv", t);
    let clamp = Some([glam::DVec3::new(-0.01, -0.01, -0.01), glam::DVec3::new(0.0005, 0.04, 0.04)]);
    let o = Options { mesh: Some(folder.join("object.obj")), clamp, ..Options::default() };
    let (imported, r, scene) = bench.good("beam.tsv", &o);
    let mine = r.markers.unwrap();
    assert_eq!((imported.format, mine.samples.len()), ("qualisys", m.samples.len()));
    for (a, b) in mine.samples.iter().zip(&m.samples) {
        // Both have six digits of a metre.
        assert!(a.position.distance(b.position) < 2e-6 && (a.time - b.time).abs() < 1e-9, "{a:?} {b:?}");
    }
    // The mesh is where the markers are, the beam moves from the first sample on, and four seconds are more than is fitted at first.
    assert!(
        scene.contains("[1.0, 0.0, 0.0, 0.0]") && scene.contains("duration = 2.0") && scene.contains("start = 0.0"),
        "{scene}"
    );
}

#[test]
fn a_measured_depth_image_as_a_camera_s_folder() {
    let Some(folder) = data("cantilever-ecoflex-hanging") else { return };
    let truth = read_recording(&folder).unwrap();
    let c = &truth.cameras[0];
    let bench = Bench::new();
    fs::create_dir_all(bench.path("l515/depth")).unwrap();
    fs::copy(folder.join("depth/cam0/000000.png"), bench.path("l515/depth/000000.png")).unwrap();
    let json = format!(
        r#"{{"width": {}, "height": {}, "fx": {}, "fy": {}, "ppx": {}, "ppy": {}, "coeffs": [0,0,0,0,0], "depth_scale": {}}}"#,
        c.width,
        c.height,
        c.focal[0],
        c.focal[1],
        c.center[0],
        c.center[1],
        c.depth_scale.unwrap()
    );
    bench.write("l515/intrinsics.json", json);
    // The free part of the cantilever, as a box of the world that the camera's pose leads to.
    let within = Some([glam::DVec3::new(-0.12, -0.16, -0.06), glam::DVec3::new(0.06, 0.045, 0.04)]);
    let o = Options {
        mesh: Some(folder.join("object.obj")),
        mesh_unit: Some(Unit::Metre),
        camera_pose: Some(c.world_from_camera),
        pose: Some(glam::DAffine3::IDENTITY),
        up: Some(glam::DVec3::Y),
        within,
        ..Options::default()
    };
    let (imported, r, scene) = bench.good("l515", &o);
    let points = |r: &palpate_io::Recording| -> Vec<[i64; 3]> {
        let camera = &r.cameras[0];
        let all = r.frames[0].readings().map(|(u, v, n)| camera.point(u as f64, v as f64, camera.depth(n)).unwrap());
        // Micrometres: poses are written with all their digits.
        all.map(|p| (p * 1e6).round().to_array().map(|x| x as i64)).collect()
    };
    let (mine, theirs) = (points(&r), points(&truth));
    let known: std::collections::BTreeSet<_> = mine.iter().collect();
    let found = theirs.iter().filter(|p| known.contains(p)).count();
    // The box ends where the block begins, and takes a little of the rig that the hand-made mask leaves out.
    assert!(found * 10 > theirs.len() * 9, "{found} of {} ({} in the box)", theirs.len(), mine.len());
    assert!(imported.depth_readings > 1000 && scene.contains("static-equilibrium") && scene.contains("[[clamp]]"), "{scene}");
}
