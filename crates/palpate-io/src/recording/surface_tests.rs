//! Clouds, depth in metres and rational lenses: written and read again, and refused with what is wrong.

use super::*;
use crate::cloud::write_cloud;
use crate::npy::{Array, write_npz};
use glam::{DAffine3, DQuat, DVec3};
use palpate_model::observation::{Camera, ReadingKind, Sensor};
use palpate_model::scene::ObservationSpec;
use std::fs;
use tempfile::TempDir;

/// An Azure Kinect's depth camera in its wide mode, with the coefficients of a device.
fn kinect() -> RecordedCamera {
    RecordedCamera {
        name: "kinect".into(),
        width: 512,
        height: 512,
        focal: [252.0, 252.0],
        center: [259.0, 258.0],
        distortion: [3.130577, 2.324939, 0.000081, -0.000051, 0.130416, 3.458652, 3.350115, 0.662942],
        world_from_camera: DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.3), DVec3::new(0.1, 0.2, -0.5)),
        depth_scale: None,
        depth_offset: 0.0,
        noise_sigma: Some(0.003),
        noise_systematic: 0.0,
    }
}

fn small(name: &str) -> RecordedCamera {
    let (focal, center, distortion) = ([10.0, 11.0], [3.4, 2.6], [0.0; 8]);
    RecordedCamera { name: name.into(), width: 8, height: 6, focal, center, distortion, ..kinect() }
}

/// World points that the cameras see half a metre away.
fn points() -> Vec<DVec3> {
    let place = |i: usize| small("").point((i % 8) as f64, (i / 8) as f64, 0.5 + 0.001 * i as f64).unwrap();
    (0..48).map(place).collect()
}

fn cloud(file: &str, time: f64, from: SeenFrom) -> RecordedCloud {
    RecordedCloud { file: file.into(), time, from, points: points(), noise_sigma: Some(0.004), noise_systematic: 0.001 }
}

fn sample() -> Recording {
    let metres: Vec<f32> = (0..48).map(|i| if i % 5 == 0 { f32::NAN } else { 0.5 + 1e-6 * i as f32 }).collect();
    let depth = DepthImage { width: 8, height: 6, pixels: DepthPixels::Metres(metres) };
    let origin = SeenFrom::Origin(DVec3::new(0.1, 0.2, -0.5));
    Recording {
        path: PathBuf::new(),
        title: String::new(),
        source: String::new(),
        cameras: vec![small("left"), kinect()],
        frames: vec![RecordedFrame { camera: 0, time: 0.1, depth: Some(depth), mask: None }],
        clouds: vec![
            cloud("a.ply", 0.0, SeenFrom::Camera(0)),
            cloud("b.pcd", 0.1, origin),
            cloud("c.npz", 0.2, SeenFrom::Unknown),
            cloud("d.ply", 0.3, origin),
        ],
        markers: None,
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

fn all_depth() -> ObservationSpec {
    ObservationSpec::new(PathBuf::new(), vec![ReadingKind::Depth])
}

#[test]
fn clouds_and_metres_are_read_again_as_they_were() {
    let folder = written();
    let r = read_recording(folder.path()).unwrap();
    let s = sample();
    assert_eq!(r.frames, s.frames);
    let cloudless = |c: &RecordedCloud| RecordedCloud { file: PathBuf::new(), ..c.clone() };
    let both = [&r, &s].map(|r| r.clouds.iter().map(cloudless).collect::<Vec<_>>());
    assert_eq!(both[0], both[1]);
    assert_eq!((r.cameras[1].distortion, r.cameras[0].distortion), (s.cameras[1].distortion, [0.0; 8]));
    assert_eq!(r.warnings.len(), 1, "one cloud has no line of sight: {:?}", r.warnings);
}

#[test]
fn clouds_become_points_of_what_saw_them() {
    let folder = written();
    let r = read_recording(folder.path()).unwrap();
    let mut warnings = Vec::new();
    let (o, _) = r.observation(&all_depth(), &mut warnings).unwrap();
    assert_eq!(
        o.frames.iter().map(|f| (f.time, f.points.len())).collect::<Vec<_>>(),
        [(0.0, 48), (0.1, 38 + 48), (0.2, 48), (0.3, 48)]
    );
    let origin = Camera::Scanner { center: DVec3::new(0.1, 0.2, -0.5) };
    assert_eq!((o.cameras.len(), o.camera_count()), (4, 2));
    assert_eq!((&o.cameras[2], &o.cameras[3]), (&origin, &Camera::Unknown));
    let sensor = |frame: usize| o.sensor_of_point(o.frames[frame].points.last().unwrap());
    assert_eq!(
        [sensor(0), sensor(1), sensor(2), sensor(3)],
        [Sensor::Camera(0), Sensor::Cloud(2), Sensor::Cloud(3), Sensor::Cloud(2)]
    );
    assert_eq!((o.name(Sensor::Cloud(2)), o.frames[0].points[7].position), ("cloud 0".into(), points()[7]));
    // The image with 3 mm, clouds of its camera, from the origin and from nowhere with 4 mm each.
    let mean: f64 = (0.003f64.powi(2) + 3.0 * 0.004f64.powi(2)) / 4.0;
    assert!((o.noise(ReadingKind::Depth) - mean.sqrt()).abs() < 1e-15 && o.systematic(ReadingKind::Depth) == 0.001);
    let thin = ObservationSpec { every: 2, pixel_stride: 2, ..all_depth() };
    let (o, _) = r.observation(&thin, &mut warnings).unwrap();
    assert_eq!(o.frames.iter().map(|f| (f.time, f.points.len())).collect::<Vec<_>>(), [(0.0, 12), (0.2, 12)]);
}

#[test]
fn a_stack_of_clouds_is_one_table() {
    let folder = tempfile::tempdir().unwrap();
    let mut values: Vec<f64> = [points(), points()].concat().iter().flat_map(|p| (1000.0 * *p).to_array()).collect();
    values[..6].fill(f64::NAN);
    write_npz(folder.path().join("s.npz"), &[("seen", &Array { shape: vec![2, 48, 3], values: values.clone() })]).unwrap();
    let text = "format = \"recording/1\"\n[[cloud]]\nfile = \"s.npz\"\narray = \"seen\"\nrate = 10\nstart = 1\nunit = \"mm\"\norigin = [0.1, 0.2, -0.5]\n\
                noise_sigma = 0.001\ntransform = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n";
    fs::write(folder.path().join("recording.toml"), text).unwrap();
    let r = read_recording(folder.path()).unwrap();
    assert_eq!(r.clouds.iter().map(|c| (c.time, c.points.len())).collect::<Vec<_>>(), [(1.0, 46), (1.1, 48)]);
    assert!((r.clouds[1].points[5] - points()[5]).length() < 1e-15);

    let error = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        fs::write(folder.path().join("recording.toml"), text.replace(from, to)).unwrap();
        read_recording(folder.path()).unwrap_err().to_string()
    };
    for (from, to, wanted) in [
        ("unit = \"mm\"\n", "", "cloud.0.file: its points lie from where they were seen by"),
        ("unit = \"mm\"\n", "", "unit = \"mm\" would make it about 0.350 m"),
        ("unit = \"mm\"\norigin = [0.1, 0.2, -0.5]\n", "", "its points lie from their middle by"),
        ("rate = 10\nstart = 1", "time = 1", "is one time for 2 clouds; give `times` or `rate`"),
        ("rate = 10\nstart = 1", "", "cloud.0.times: missing"),
        ("array = \"seen\"", "array = \"sen\"", "holds no array \"sen\"; did you mean \"seen\"?"),
        ("origin = [0.1, 0.2, -0.5]", "orign = [0.1, 0.2, -0.5]", "unknown key; did you mean \"origin\"?"),
        ("origin", "camera = \"x\"\norigin", "a cloud was seen by a `camera` or from an `origin`, not both"),
        ("origin = [0.1, 0.2, -0.5]", "camera = \"x\"", "no [[camera]] is named \"x\"; none is known here"),
        ("\"s.npz\"", "\"s.xyz\"", "there is no file"),
        ("\"s.npz\"", "\"../s.npz\"", "leaves the recording's folder"),
    ] {
        let e = error(from, to);
        assert!(e.contains(wanted), "{to}: {e}");
    }
    values.fill(f64::NAN);
    write_npz(folder.path().join("s.npz"), &[("seen", &Array { shape: vec![2, 48, 3], values })]).unwrap();
    assert!(error("array", "array").contains("holds not a single finite point"));
    write_npz(folder.path().join("s.npz"), &[("seen", &Array { shape: vec![2, 48], values: vec![0.0; 96] })]).unwrap();
    assert!(error("array", "array").contains("has shape (2, 48), expected (points, 3) or (frames, points, 3)"));
}

/// The error after one text of the sample's table was replaced.
fn error(from: &str, to: &str) -> String {
    let folder = written();
    let path = folder.path().join("recording.toml");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{from} not in {text}");
    fs::write(&path, text.replacen(from, to, 1)).unwrap();
    read_recording(folder.path()).expect_err("must be refused").to_string()
}

#[test]
fn faults_of_clouds_are_named() {
    for (from, to, wanted) in [
        ("time = 0.3", "time = 0.15", "cloud.3.time: 0.15 comes after 0.2 in the file; clouds are ordered by time"),
        ("time = 0.3", "time = nan", "NaN is not a number"),
        ("time = 0.3\n", "", "cloud.3.time: missing; expected a number (s)"),
        ("time = 0.3", "times = [0.3]", "goes with arrays (.npy, .npz); a file of one cloud has a `time`"),
        ("noise_sigma = 0.004", "x = 1", "unknown key"),
        (
            "distortion = [3.130577",
            "distortion = [1, 3.130577",
            "expected 5 numbers (k1 k2 p1 p2 k3) or 8 (k4 k5 k6 as well), found 9",
        ),
        ("distortion = [3.130577", "distortion = [-93.130577", "cannot be inverted at pixel"),
    ] {
        let e = error(from, to);
        assert!(e.contains(wanted), "{to}: {e}");
    }
    let folder = written();
    let twice = fs::read_to_string(folder.path().join("recording.toml"))
        .unwrap()
        .replace("time = 0.3", "time = 0.2")
        .replace("time = 0.2\nnoise_sigma", "time = 0.2\norigin = [0.1, 0.2, -0.5]\nnoise_sigma");
    fs::write(folder.path().join("recording.toml"), twice).unwrap();
    let e = read_recording(folder.path()).unwrap_err().to_string();
    assert!(e.contains("a cloud from [0.1, 0.2, -0.5] occurs twice at 0.2 s"), "{e}");
}

#[test]
fn empty_clouds_are_worth_a_word_and_all_of_them_an_error() {
    let folder = written();
    write_cloud(folder.path().join("cloud/000001.pcd"), &[]).unwrap();
    write_cloud(folder.path().join("cloud/000003.ply"), &[DVec3::NAN, DVec3::new(0.0, f64::INFINITY, 0.0)]).unwrap();
    let r = read_recording(folder.path()).unwrap();
    assert!(r.warnings.iter().any(|w| w.contains("2 of 4 clouds hold no finite point")), "{:?}", r.warnings);
    write_cloud(folder.path().join("cloud/000000.ply"), &[]).unwrap();
    let empty = Array { shape: vec![0, 3], values: Vec::new() };
    write_npz(folder.path().join("cloud/000002.npz"), &[("points", &empty)]).unwrap();
    let e = read_recording(folder.path()).unwrap_err().to_string();
    assert!(e.contains("cloud.0.file: holds not a single finite point, and neither do the other clouds"), "{e}");
}

#[test]
fn a_cloud_that_its_camera_cannot_have_seen_is_refused() {
    let folder = written();
    let file = folder.path().join("cloud/000000.ply");
    let back = small("").world_from_camera.inverse();
    let local: Vec<DVec3> = points().iter().map(|p| back.transform_point3(*p)).collect();
    write_cloud(&file, &local).unwrap();
    let e = read_recording(folder.path()).unwrap_err().to_string();
    assert!(e.contains("% of its points lie in the image of camera \"left\"; they seem to be in the camera's axes"), "{e}");
    // A third of the points beside the image.
    let aside = points().iter().enumerate().map(|(i, p)| if i % 3 == 0 { *p + DVec3::X } else { *p }).collect::<Vec<_>>();
    write_cloud(&file, &aside).unwrap();
    let w = read_recording(folder.path()).unwrap().warnings;
    assert!(w.iter().any(|w| w.contains("only 67 % of its points lie in the image of camera \"left\"")), "{w:?}");
}

#[test]
fn depth_in_metres_needs_no_scale_and_is_checked() {
    let folder = written();
    let text = fs::read_to_string(folder.path().join("recording.toml")).unwrap();
    assert!(text.contains("depth = \"depth/cam0/000000.tiff\"") && !text.contains("depth_scale"), "{text}");
    let npy = |values: Vec<f64>, shape: Vec<usize>| {
        write_npz(folder.path().join("a.npz"), &[("a", &Array { shape, values })]).unwrap();
        // An archive without compression holds the bytes of an .npy file.
        let archive = fs::File::open(folder.path().join("a.npz")).unwrap();
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut zip::ZipArchive::new(archive).unwrap().by_index(0).unwrap(), &mut bytes).unwrap();
        fs::write(folder.path().join("depth.npy"), bytes).unwrap();
        fs::write(folder.path().join("recording.toml"), text.replace("depth/cam0/000000.tiff", "depth.npy")).unwrap();
        read_recording(folder.path())
    };
    let depths = || (0..48).map(|i| if i == 7 { f64::INFINITY } else { 0.1 * f64::from(i % 11) });
    let r = npy(depths().collect(), vec![6, 8]).unwrap();
    // Inf and 0 are no readings.
    assert_eq!(r.frames[0].readings().count(), depths().filter(|z| z.is_finite() && *z > 0.0).count());
    assert_eq!(r.frames[0].readings().next(), Some((1, 0, RawDepth::Metres(0.1))));
    let e = npy(depths().map(|z| 1000.0 * z).collect(), vec![6, 8]).unwrap_err().to_string();
    assert!(e.contains("floats, which are metres") && e.contains("are they millimetres?"), "{e}");
    let e = npy(depths().collect(), vec![8, 6]).unwrap_err().to_string();
    assert!(e.contains("is 6 × 8 pixels, its camera has 8 × 6"), "{e}");
    let r = npy(vec![f64::NAN; 48], vec![6, 8]).unwrap();
    assert!(r.warnings.iter().any(|w| w.contains("holds no reading of the object")), "{:?}", r.warnings);

    let folder = written();
    let tiff = folder.path().join("depth/cam0/000000.tiff");
    let bytes = fs::read(&tiff).unwrap();
    (0..bytes.len()).step_by(7).for_each(|n| {
        fs::write(&tiff, &bytes[..n]).unwrap();
        let e = read_recording(folder.path()).unwrap_err().to_string();
        assert!(e.contains("000000.tiff: "), "{n}: {e}");
    });
}

#[test]
fn a_rational_lens_leads_there_and_back() {
    let c = kinect();
    assert_eq!(c.folded(), None);
    for (u, v) in [(0.0, 256.0), (300.0, 20.0), (259.0, 258.0), (500.0, 400.0)] {
        let p = c.point(u, v, 0.7).unwrap();
        let (uv, z) = c.project(p).unwrap();
        // Newton's method stops at 1e-12, times a focal length of 252 pixels.
        assert!((uv[0] - u).abs() < 1e-9 && (uv[1] - v).abs() < 1e-9 && (z - 0.7).abs() < 1e-12, "{uv:?}");
    }
    // x/z = 0.3, y/z = 0.4 has r² = 0.25: above 1 + 0.25 (k1 + 0.25 (k2 + 0.25 k3)), below the same of k4, k5, k6.
    let above = 1.0 + 0.25 * (3.130577 + 0.25 * (2.324939 + 0.25 * 0.130416));
    let below = 1.0 + 0.25 * (3.458652 + 0.25 * (3.350115 + 0.25 * 0.662942));
    let shift = 2.0 * 0.000081 * 0.12 - 0.000051 * (0.25 + 2.0 * 0.09);
    let (uv, _) = c.project(c.world_from_camera.transform_point3(DVec3::new(0.3, 0.4, 1.0))).unwrap();
    assert!((uv[0] - (252.0 * (0.3 * above / below + shift) + 259.0)).abs() < 1e-9, "{uv:?}");
}
