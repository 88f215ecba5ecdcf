//! Recordings read and written, and refused with what is wrong.

use super::*;
use glam::{DAffine3, DQuat, DVec3};
use palpate_model::observation::Observation;
use palpate_model::observation::ReadingKind;
use palpate_model::scene::ObservationSpec;
use std::fs;
use tempfile::TempDir;

fn camera(name: &str) -> RecordedCamera {
    RecordedCamera {
        name: name.into(),
        width: 8,
        height: 6,
        focal: [10.0, 11.0],
        center: [3.4, 2.6],
        distortion: [0.1, -0.02, 0.001, -0.002, 0.003, 0.0, 0.0, 0.0],
        world_from_camera: DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.3), DVec3::new(0.1, 0.2, -0.5)),
        depth_scale: Some(0.001),
        depth_offset: -0.01,
        noise_sigma: Some(0.003),
        noise_systematic: 0.001,
    }
}

fn sample() -> Recording {
    let counts: Vec<u16> = (0..48).map(|i| if i % 5 == 0 { 0 } else { 500 + i }).collect();
    let depth = DepthImage { width: 8, height: 6, pixels: DepthPixels::Counts(counts) };
    let mask: Vec<bool> = (0..48).map(|i| i % 2 == 0).collect();
    let frame = |camera, time| RecordedFrame { camera, time, depth: Some(depth.clone()), mask: Some(mask.clone()) };
    let mut silhouette = frame(0, 0.2);
    silhouette.depth = None;
    let sample = |time, marker, x| MarkerSample { time, marker, position: DVec3::new(x, 0.1, 1.0 / 3.0) };
    Recording {
        path: PathBuf::new(),
        title: "a \"quoted\" title".into(),
        source: "made up".into(),
        cameras: vec![camera("left"), camera("right one")],
        frames: vec![frame(0, -0.1), frame(1, -0.1), frame(0, 0.1), silhouette],
        clouds: Vec::new(),
        markers: Some(RecordedMarkers {
            file: PathBuf::new(),
            names: vec!["a".into(), "b".into()],
            samples: vec![sample(-0.1, 0, 0.0), sample(-0.1, 1, 0.5), sample(0.05, 1, 0.6)],
            noise_sigma: Some(0.0005),
            noise_systematic: 0.0,
            rest: vec![
                MarkerRest { name: "a".into(), position: DVec3::X, surface: Some(DVec3::Y) },
                MarkerRest { name: "b".into(), position: DVec3::Z, surface: None },
            ],
        }),
        points: None,
        displacements: None,
        warnings: Vec::new(),
    }
}

fn written() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_recording(folder.path(), &sample()).unwrap();
    folder
}

fn spec(costs: &[ReadingKind]) -> ObservationSpec {
    ObservationSpec::new(PathBuf::new(), costs.to_vec())
}

/// The error after one text in a file of the sample was replaced (every time it occurs).
fn error(file: &str, from: &str, to: &str) -> String {
    let folder = written();
    let path = folder.path().join(file);
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{from} not in {text}");
    fs::write(&path, text.replace(from, to)).unwrap();
    let e = read_recording(folder.path()).expect_err("must be refused").to_string();
    assert!(!e.contains('\n') && e.contains(folder.path().to_str().unwrap()), "{e}");
    e
}

#[test]
fn what_is_written_is_read_again() {
    let folder = written();
    let r = read_recording(folder.path()).unwrap();
    let s = sample();
    assert_eq!((&r.title, &r.source, &r.frames), (&s.title, &s.source, &s.frames));
    assert!(r.warnings.is_empty());
    for (a, b) in r.cameras.iter().zip(&s.cameras) {
        // The rotation is made orthonormal again, which costs a rounding.
        let d = a.world_from_camera.matrix3 - b.world_from_camera.matrix3;
        assert!(d.to_cols_array().iter().all(|x| x.abs() < 1e-15));
        assert_eq!(&RecordedCamera { world_from_camera: b.world_from_camera, ..a.clone() }, b);
    }
    let (a, b) = (r.markers.unwrap(), s.markers.unwrap());
    assert_eq!((a.names, a.samples, a.rest, a.noise_sigma), (b.names, b.samples, b.rest, b.noise_sigma));
    assert!(read_recording(folder.path().join("recording.toml")).is_ok(), "the file itself is accepted too");
}

#[test]
fn pixels_become_world_points_that_project_back() {
    let c = camera("c");
    for (u, v) in [(0.0, 0.0), (7.0, 5.0), (3.4, 2.6), (1.0, 4.0)] {
        let p = c.point(u, v, 0.7).unwrap();
        let (uv, z) = c.project(p).unwrap();
        // The undistortion stops at 1e-12, times a focal length of ten pixels.
        assert!((uv[0] - u).abs() < 1e-10 && (uv[1] - v).abs() < 1e-10 && (z - 0.7).abs() < 1e-12, "{uv:?}");
    }
    assert!(c.project(c.position() - c.world_from_camera.transform_vector3(DVec3::Z)).is_none(), "behind the camera");
}

#[test]
fn distortion_is_opencvs() {
    let mut c = camera("c");
    c.world_from_camera = DAffine3::IDENTITY;
    (c.focal, c.center) = ([100.0, 200.0], [50.0, 30.0]);
    // k1, k2, p1, p2, k3.
    c.distortion = [0.4, -0.8, 0.02, 0.05, 1.6, 0.0, 0.0, 0.0];
    // (0.6, 0.8, 2) has x = 0.3, y = 0.4, r² = 0.25, r⁴ = 0.0625, r⁶ = 0.015625.
    // Radial: 1 + 0.4·0.25 − 0.8·0.0625 + 1.6·0.015625 = 1 + 0.1 − 0.05 + 0.025 = 1.075.
    // Tangential: 2·0.02·0.12 + 0.05·(0.25 + 2·0.09) = 0.0048 + 0.0215 = 0.0263 in x,
    //             0.02·(0.25 + 2·0.16) + 2·0.05·0.12 = 0.0114 + 0.012 = 0.0234 in y.
    // x_d = 0.3·1.075 + 0.0263 = 0.3488 and y_d = 0.4·1.075 + 0.0234 = 0.4534, so
    // u = 100·0.3488 + 50 = 84.88 and v = 200·0.4534 + 30 = 120.68.
    let ([u, v], depth) = c.project(DVec3::new(0.6, 0.8, 2.0)).unwrap();
    assert!((u - 84.88).abs() < 1e-12 && (v - 120.68).abs() < 1e-12 && depth == 2.0, "{u} {v} {depth}");
    // Files hold the coefficients in the same order.
    let text = fs::read_to_string(written().path().join("recording.toml")).unwrap();
    assert!(text.contains("distortion = [0.1, -0.02, 0.001, -0.002, 0.003]"), "{text}");
}

#[test]
fn frames_group_instants_and_choices_thin_them() {
    let folder = written();
    let r = read_recording(folder.path()).unwrap();
    let mut warnings = Vec::new();
    let both = spec(&[ReadingKind::Depth, ReadingKind::Marker]);
    let (o, rest) = r.observation(&both, &mut warnings).unwrap();
    let times: Vec<f64> = o.frames.iter().map(|f| f.time).collect();
    assert_eq!(times, [-0.1, 0.05, 0.1]);
    // Even pixels with a reading: 24 even ones less those divisible by ten.
    assert_eq!(o.frames[0].points.len(), 2 * 19);
    assert_eq!((o.frames[0].markers.len(), o.frames[1].markers.len(), o.frames[2].points.len()), (2, 1, 19));
    assert_eq!(
        (o.noise(ReadingKind::Depth), o.noise(ReadingKind::Marker), o.systematic(ReadingKind::Depth)),
        (0.003, 0.0005, 0.001)
    );
    assert_eq!(rest.iter().map(|r| r.name.as_str()).collect::<Vec<_>>(), ["a", "b"]);
    assert!(o.markers.is_empty() && warnings.is_empty());
    let first = o.frames[0].points[0];
    // Pixel (2, 0) holds 502 counts of a millimetre, less a centimetre.
    let expected = r.cameras[0].point(2.0, 0.0, 0.492).unwrap();
    assert!((first.position - expected).length() < 1e-15 && first.camera == 0);

    let thin = ObservationSpec { every: 2, pixel_stride: 2, ..both.clone() };
    let (o, _) = r.observation(&thin, &mut warnings).unwrap();
    assert_eq!(o.frames.len(), 1, "every second image time and marker time is left out");
    // Even columns of rows 0, 2, 4, less pixels 0 and 20 without a reading.
    assert_eq!(o.frames[0].points.len(), 2 * (12 - 2));
    let late = ObservationSpec { from: 0.0, to: 0.07, ..spec(&[ReadingKind::Marker]) };
    assert_eq!(r.observation(&late, &mut warnings).unwrap().0.frames.len(), 1);
    let never = ObservationSpec { from: 5.0, ..both };
    let e = r.observation(&never, &mut warnings).unwrap_err().to_string();
    assert!(e.starts_with("observation.frames: no depth reading of the object is left from 5 s on; "), "{e}");
    assert!(e.ends_with("has them from -0.1 s to 0.1 s"), "{e}");
}

#[test]
fn unstated_noise_is_assumed_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let mut s = sample();
    s.cameras.iter_mut().for_each(|c| c.noise_sigma = None);
    s.markers.as_mut().unwrap().noise_sigma = None;
    write_recording(folder.path(), &s).unwrap();
    let r = read_recording(folder.path()).unwrap();
    let mut warnings = Vec::new();
    let (o, _) = r.observation(&spec(&[ReadingKind::Depth, ReadingKind::Marker]), &mut warnings).unwrap();
    assert_eq!((o.noise(ReadingKind::Depth), o.noise(ReadingKind::Marker), warnings.len()), (0.002, 0.001, 3));
}

#[test]
fn every_marker_needs_a_rest_place() {
    let folder = tempfile::tempdir().unwrap();
    let mut s = sample();
    s.markers.as_mut().unwrap().rest.pop();
    write_recording(folder.path(), &s).unwrap();
    let r = read_recording(folder.path()).unwrap();
    let mut spec = spec(&[ReadingKind::Marker]);
    let e = r.observation(&spec, &mut Vec::new()).unwrap_err().to_string();
    assert!(e.contains("no rest position for b; give [[markers.rest]]"), "{e}");
    spec.markers.push(MarkerRest { name: "b".into(), position: DVec3::NEG_X, surface: None });
    let (_, rest) = r.observation(&spec, &mut Vec::new()).unwrap();
    assert_eq!(rest[1].position, DVec3::NEG_X);
    spec.markers.push(MarkerRest { name: "c".into(), position: DVec3::NEG_X, surface: None });
    assert!(r.observation(&spec, &mut Vec::new()).unwrap_err().to_string().contains("\"c\" does not occur"));
}

#[test]
fn faults_of_the_text_are_named() {
    for (file, from, to, wanted) in [
        ("recording.toml", "recording/1", "recording/2", "reads \"recording/1\""),
        ("recording.toml", "depth_scale", "depth_scal", "did you mean \"depth_scale\"?"),
        ("recording.toml", "time = 0.1", "time = -0.3", "-0.3 comes after -0.1 in the file; frames are ordered by time"),
        ("recording.toml", "time = 0.1\n", "time = nan\n", "NaN is not a number"),
        ("recording.toml", "camera = \"left\"", "camera = \"lefd\"", "no [[camera]] is named \"lefd\"; did you mean \"left\"?"),
        ("recording.toml", "camera = \"right one\"", "camera = \"left\"", "has two frames at -0.1"),
        ("recording.toml", "name = \"right one\"", "name = \"left\"", "two cameras are named"),
        ("recording.toml", "noise_sigma = 0.003", "noise_sigma = -0.003", "must lie in [1e-9, 10] (m)"),
        (
            "recording.toml",
            "depth_scale = 0.001",
            "depth_scale = 1.0",
            "expected 0.02 to 20 m; depth_scale = 0.001 would make it",
        ),
        ("recording.toml", "depth_offset = -0.01", "depth_offset = 100", "depth_offset: adds 100 m to the readings of camera"),
        ("recording.toml", "depth_scale = 0.001\n", "", "depth_scale: missing; expected metres per PNG count"),
        ("recording.toml", "width = 8", "width = 9", "is 8 × 6 pixels, its camera has 9 × 6"),
        ("recording.toml", "[0, 0, 0, 1]", "[0, 0, 1, 1]", "not rigid: the last row"),
        ("recording.toml", "distortion = [0.1,", "distortion = [-90.0,", "cannot be inverted"),
        ("recording.toml", "\"depth/cam0/000000.png\"", "\"../x.png\"", "leaves the recording's folder"),
        ("recording.toml", "\"depth/cam0/000000.png\"", "\"/etc/x.png\"", "leaves the recording's folder"),
        ("recording.toml", "\"depth/cam0/000000.png\"", "\"depth/no.png\"", "frame.0.depth: there is no file"),
        (
            "recording.toml",
            "\"depth/cam0/000000.png\"",
            "\"mask/cam0/000000.png\"",
            "has 8 bits in 1 channels, a depth image is 16-bit",
        ),
        ("recording.toml", "\"mask/cam0/000000.png\"", "\"depth/cam0/000000.png\"", "a mask is 8-bit"),
        ("recording.toml", "name = \"b\"", "name = \"c\"", "\"c\" does not occur in"),
        ("recording.toml", "units = \"m, s\"", "units = \"mm, s\"", "a recording is in \"m, s\""),
        ("markers.csv", "0.05,b", "-0.5,b", "markers.csv:4: time: -0.5 comes after -0.1"),
        ("markers.csv", "-0.1,b", "-0.1,a", "markers.csv:3: name: \"a\" occurs twice at time -0.1"),
        ("markers.csv", "0.5,0.1", "nan,0.1", "markers.csv:3: x: \"nan\" is not a finite number"),
        ("markers.csv", "time,name,x", "t,name,x", "columns are \"t,name,x,y,z\", expected \"time,name,x,y,z\""),
        ("markers.csv", "0.05,b,0.6,0.1,", "0.05,b,0.6,", "markers.csv:4: not a readable CSV file"),
    ] {
        let e = error(file, from, to);
        assert!(e.contains(wanted), "{from} → {to}: {e}");
    }
}

#[test]
fn faults_of_images_are_named() {
    let folder = written();
    let path = folder.path().join("depth/cam0/000001.png");
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let e = read_recording(folder.path()).unwrap_err().to_string();
    assert!(e.contains("depth/cam0/000001.png: not a readable PNG file (truncated?)"), "{e}");

    let folder = tempfile::tempdir().unwrap();
    let mut s = sample();
    s.frames[2].mask = Some(vec![false; 48]);
    write_recording(folder.path(), &s).unwrap();
    let e = read_recording(folder.path()).unwrap_err().to_string();
    assert!(e.contains("frame.2.mask: is empty"), "{e}");

    let folder = tempfile::tempdir().unwrap();
    let mut s = sample();
    s.frames[2].depth.as_mut().unwrap().pixels = DepthPixels::Counts(vec![0; 48]);
    write_recording(folder.path(), &s).unwrap();
    let w = read_recording(folder.path()).unwrap().warnings;
    assert!(w.len() == 1 && w[0].contains("holds no reading of the object"), "{w:?}");
}

#[test]
fn frames_without_cameras_are_refused() {
    let folder = written();
    let path = folder.path().join("recording.toml");
    let text = fs::read_to_string(&path).unwrap();
    let (head, tail) = (text.find("[[camera]]").unwrap(), text.find("[[frame]]").unwrap());
    fs::write(&path, format!("{}{}", &text[..head], &text[tail..])).unwrap();
    let e = read_recording(folder.path()).unwrap_err().to_string();
    assert!(e.contains("4 frames but no [[camera]]"), "{e}");
    fs::write(&path, &text[..head]).unwrap();
    assert!(read_recording(folder.path()).unwrap_err().to_string().contains("nothing was measured"));
}

#[test]
fn a_recording_elsewhere_is_refused_with_numbers() {
    let folder = written();
    let r = read_recording(folder.path()).unwrap();
    let (o, _) = r.observation(&spec(&[ReadingKind::Depth]), &mut Vec::new()).unwrap();
    let c = o.frames[0].points[0].position;
    assert_eq!(check_overlap(&o, c - DVec3::splat(0.1), c + DVec3::splat(0.1)), Ok(()));
    let far = c + DVec3::new(0.0, 0.0, 7.0);
    let e = check_overlap(&o, far - DVec3::splat(0.1), far + DVec3::splat(0.1)).unwrap_err();
    assert!(e.contains("nowhere near") && e.contains("diagonal of 0.3464 m") && e.contains("object.pose"), "{e}");
    let mut large = o.clone();
    large.frames.iter_mut().flat_map(|f| &mut f.points).for_each(|p| p.position *= 1000.0);
    let e = check_overlap(&large, c - DVec3::splat(0.1), c + DVec3::splat(0.1)).unwrap_err();
    assert!(
        e.ends_with("is the recording in millimetres? Multiplied by 0.001 it lies at the object: convert it to metres"),
        "{e}"
    );
    assert_eq!(check_overlap(&Observation::default(), far, far), Ok(()), "nothing measured is another error");
}

#[test]
fn frames_that_memory_has_no_room_for_are_refused_before_one_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::from(
        "format = \"recording/1\"\n[[camera]]\nname = \"c\"\nwidth = 65536\nheight = 65536\nfx = 4.0\nfy = 4.0\ncx = 1.5\ncy = 1.0\n\
         depth_scale = 0.001\nworld_from_camera = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n",
    );
    // 13 TB of counts.
    (0..1500).for_each(|k| text += &format!("[[frame]]\ncamera = \"c\"\ntime = {k}.0\ndepth = \"0.png\"\n"));
    fs::write(folder.path().join("recording.toml"), text).unwrap();
    fs::write(folder.path().join("0.png"), b"no image").unwrap();
    let e = read_recording(folder.path()).unwrap_err().to_string();
    assert!(e.contains("frame: 1500 frames take 12884.9 GB at least, and ") && e.contains(" of memory are left"), "{e}");
}
