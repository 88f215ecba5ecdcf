//! Recordings with faults.

use super::{SCENE, after_place, changed, folder, refused, write};
use glam::{DAffine3, DVec3};
use palpate_io::recording::{DepthImage, DepthPixels, RecordedCamera, RecordedFrame};
use palpate_io::{Recording, write_recording};
use std::path::{Path, PathBuf};
use support::command::{arg, succeed};
use tempfile::TempDir;

/// Compares [`SCENE`] with the recording beside it; the table begins at line 15.
const OBSERVATION: &str = "[observation]\nrecording = \"seen\"\ncost = \"sparse-surface\"\n\n[time]";

/// Two frames of a wall half a metre in front of a camera: the plane z = 0 around the body of [`SCENE`].
fn wall() -> Recording {
    let (width, height) = (16, 12);
    let camera = RecordedCamera {
        name: "cam0".into(),
        width,
        height,
        focal: [20.0, 20.0],
        center: [7.5, 5.5],
        distortion: [0.0; 8],
        world_from_camera: DAffine3::from_translation(DVec3::new(0.05, 0.015, -0.5)),
        depth_scale: Some(0.001),
        depth_offset: 0.0,
        noise_sigma: Some(0.002),
        noise_systematic: 0.0,
    };
    let frame = |time| RecordedFrame {
        camera: 0,
        time,
        depth: Some(DepthImage { width, height, pixels: DepthPixels::Counts(vec![500; width * height]) }),
        mask: Some(vec![true; width * height]),
    };
    Recording {
        path: PathBuf::new(),
        title: String::new(),
        source: String::new(),
        cameras: vec![camera],
        frames: vec![frame(0.0), frame(0.05)],
        clouds: Vec::new(),
        markers: None,
        points: None,
        displacements: None,
        warnings: Vec::new(),
    }
}

/// A scene and the recording it is compared with.
struct Case {
    folder: TempDir,
    scene: PathBuf,
}

impl Case {
    fn new(recording: &Recording) -> Case {
        let folder = folder();
        write_recording(folder.path().join("seen"), recording).unwrap();
        let scene = write(folder.path(), &changed(SCENE, "[time]", OBSERVATION));
        Case { folder, scene }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join("seen").join(name)
    }

    /// Replaces a text of the recording's TOML, or of the scene.
    fn change(self, file: &Path, from: &str, to: &str) -> Case {
        let text = std::fs::read_to_string(file).unwrap();
        std::fs::write(file, changed(&text, from, to)).unwrap();
        self
    }

    fn change_recording(self, from: &str, to: &str) -> Case {
        let file = self.file("recording.toml");
        self.change(&file, from, to)
    }

    fn change_scene(self, from: &str, to: &str) -> Case {
        let file = self.scene.clone();
        self.change(&file, from, to)
    }

    /// What a fit of the scene is refused with; `inspect` says the same.
    fn fault(&self) -> String {
        let out = self.folder.path().join("out");
        let e = refused(&["fit", arg(&self.scene), "--out", arg(&out)], 2);
        assert!(!out.exists(), "nothing is written when something is wrong");
        assert_eq!(refused(&["inspect", arg(&self.scene)], 2), e);
        e
    }

    /// The same without file and line of the recording, which are checked.
    fn fault_of_recording(&self, line: usize) -> String {
        after_place(&self.fault(), &self.file("recording.toml"), line)
    }

    /// The same without file and line of the scene, which are checked.
    fn fault_of_scene(&self, line: usize) -> String {
        after_place(&self.fault(), &self.scene, line)
    }
}

#[test]
fn the_recording_without_faults_is_accepted() {
    let case = Case::new(&wall());
    let told = succeed(&["inspect", arg(&case.scene)]).out;
    assert!(told.contains("2 frames from 0.0000 s to 0.0500 s") && !told.contains("warning"), "{told}");
}

#[test]
fn truncated_png() {
    let case = Case::new(&wall());
    let png = case.file("depth/cam0/000001.png");
    let bytes = std::fs::read(&png).unwrap();
    std::fs::write(&png, &bytes[..bytes.len() - 20]).unwrap();
    let e = case.fault();
    assert!(e.starts_with(&format!("{}: not a readable PNG file (truncated?)", png.display())), "{e}");
}

#[test]
fn images_that_are_not_there() {
    for (file, line) in [("depth/cam0/000001.png", 35), ("mask/cam0/000001.png", 36)] {
        let case = Case::new(&wall());
        let png = case.file(file);
        std::fs::remove_file(&png).unwrap();
        let key = file.split('/').next().unwrap();
        assert_eq!(case.fault_of_recording(line), format!("frame.1.{key}: there is no file {}", png.display()));
    }
}

#[test]
fn depth_in_the_wrong_unit() {
    let e = Case::new(&wall()).change_recording("depth_scale = 0.001", "depth_scale = 1.0").fault_of_recording(21);
    let wanted = "the median depth of camera \"cam0\" is 500.000000 m (500 counts), expected 0.02 to 20 m; depth_scale = 0.001 would make it 0.500 m";
    assert_eq!(e, format!("camera.0.depth_scale: {wanted}"));
    let e = Case::new(&wall()).change_recording("depth_scale = 0.001", "depth_scale = 0.000001").fault_of_recording(21);
    assert!(e.contains("is 0.000500 m"), "{e}");
}

#[test]
fn noise_of_no_size() {
    let e = Case::new(&wall()).change_recording("noise_sigma = 0.002", "noise_sigma = 1e-200").fault_of_recording(23);
    assert_eq!(e, "camera.0.noise_sigma: 1e-200 is not allowed: must lie in [1e-9, 10] (m)");
}

#[test]
fn frame_times_out_of_order() {
    let e = Case::new(&wall()).change_recording("time = 0.0\n", "time = 0.75\n").fault_of_recording(34);
    assert_eq!(e, "frame.1.time: 0.05 comes after 0.75 in the file; frames are ordered by time");
}

#[test]
fn empty_mask() {
    let mut r = wall();
    r.frames[1].mask.as_mut().unwrap().fill(false);
    let e = Case::new(&r).fault_of_recording(36);
    assert_eq!(e, "frame.1.mask: is empty: no pixel is marked as the object (255)");
}

#[test]
fn zero_cameras() {
    let case = Case::new(&wall());
    let path = case.file("recording.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let (from, to) = (text.find("[[camera]]").unwrap(), text.find("[[frame]]").unwrap());
    std::fs::write(&path, format!("{}{}", &text[..from], &text[to..])).unwrap();
    let e = case.fault();
    assert!(e.ends_with("frame: 2 frames but no [[camera]]; every frame needs one"), "{e}");
}

#[test]
fn points_nowhere_near_the_object() {
    let case = Case::new(&wall()).change_recording("-0.5]", "3.5]");
    let e = case.fault_of_scene(16);
    assert!(e.starts_with("observation.recording: the recording lies nowhere near the object"), "{e}");
    assert!(e.contains("median distance of 384 points") && e.contains("units"), "{e}");
}

#[test]
fn a_cost_that_the_recording_does_not_serve() {
    let case = Case::new(&wall()).change_scene("\"sparse-surface\"", "\"markers\"");
    let toml = case.file("recording.toml");
    assert_eq!(case.fault_of_scene(17), format!("observation.cost: \"markers\" needs [markers], which {} lacks", toml.display()));
}

#[test]
fn frames_that_are_not_there() {
    let case = Case::new(&wall()).change_scene("\n\n[time]", "\nframes = { from = 5, to = 9 }\n\n[time]");
    let toml = case.file("recording.toml");
    let wanted = "observation.frames: no depth reading of the object is left between 5 s and 9 s";
    assert_eq!(case.fault_of_scene(18), format!("{wanted}; {} has them from 0 s to 0.05 s", toml.display()));
}

#[test]
fn frames_outside_the_simulated_time() {
    // Ten steps of 10 ms; all frames lie before or after them.
    for start in [0.2, -0.2] {
        let case = Case::new(&wall()).change_scene("steps = 10", &format!("steps = 10\nstart = {start}"));
        let e = case.fault_of_scene(15);
        let simulated = format!("outside the simulated time ({start:.4} s to {:.4} s)", start + 0.1);
        assert!(e.starts_with("observation.frames: all 2 frames (0.0000 s to 0.0500 s) lie ") && e.contains(&simulated), "{e}");
        // Where the start is what is looked for, it need not be right.
        let free = case.change_scene("[[fit.parameter]]", "[[fit.parameter]]\npath = \"time.start\"\n\n[[fit.parameter]]");
        succeed(&["inspect", arg(&free.scene)]);
    }
    // Some of them: a word is enough.
    let case = Case::new(&wall()).change_scene("steps = 10", "steps = 2");
    let told = succeed(&["inspect", arg(&case.scene)]).out;
    assert!(
        told.contains("warning: ") && told.contains("1 of 2 frames (0.0000 s to 0.0500 s) lie outside the simulated time"),
        "{told}"
    );
}

#[test]
fn a_marker_beside_the_body() {
    let folder = folder();
    let seen = folder.path().join("seen");
    std::fs::create_dir(&seen).unwrap();
    std::fs::write(seen.join("markers.csv"), "time,name,x,y,z\n0,tip,0.1,0.015,0.03\n0.05,tip,0.1,0.015,0.02\n").unwrap();
    let rest = "name = \"tip\"\nposition = [0.1, 0.015, 0.03]\nsurface = [0.4, 0, 0]\n";
    let toml = "format = \"recording/1\"\n\n[markers]\nfile = \"markers.csv\"\nnoise_sigma = 0.001\n\n";
    std::fs::write(seen.join("recording.toml"), format!("{toml}[[markers.rest]]\n{rest}")).unwrap();
    let observation = OBSERVATION.replace("sparse-surface", "markers");
    let scene = write(folder.path(), &changed(SCENE, "[time]", &observation));
    let e = after_place(&refused(&["inspect", arg(&scene)], 2), &seen.join("recording.toml"), 10);
    assert!(e.starts_with("markers.rest.0.surface: [0.4, 0, 0] m lies 0.3000 m from the body's surface; allowed are"), "{e}");
    // The scene's word comes before the recording's.
    let own = observation.replace("[time]", &format!("[[observation.marker]]\n{rest}\n[time]"));
    let scene = write(folder.path(), &changed(SCENE, "[time]", &own));
    let e = after_place(&refused(&["inspect", arg(&scene)], 2), &scene, 22);
    assert!(e.starts_with("observation.marker.0.surface: [0.4, 0, 0] m lies 0.3000 m from the body's surface"), "{e}");
}
