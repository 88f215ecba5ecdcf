//! Recordings with faults.

use super::one_line;
use glam::{DAffine3, DVec3};
use palpate_io::recording::{DepthImage, RecordedCamera, RecordedFrame};
use palpate_io::{Recording, check_overlap, read_recording, write_recording};
use palpate_model::scene::CostKind;
use std::path::PathBuf;
use support::measured::compared;
use tempfile::TempDir;

/// Two frames of a wall half a metre in front of a camera.
fn wall() -> Recording {
    let (width, height) = (16, 12);
    let camera = RecordedCamera {
        name: "cam0".into(),
        width,
        height,
        focal: [20.0, 20.0],
        center: [7.5, 5.5],
        distortion: [0.0; 5],
        world_from_camera: DAffine3::IDENTITY,
        depth_scale: Some(0.001),
        depth_offset: 0.0,
        noise_sigma: Some(0.002),
        noise_systematic: 0.0,
    };
    let frame = |time| RecordedFrame {
        camera: 0,
        time,
        depth: Some(DepthImage { width, height, counts: vec![500; width * height] }),
        mask: Some(vec![true; width * height]),
    };
    Recording {
        path: PathBuf::new(),
        title: String::new(),
        source: String::new(),
        cameras: vec![camera],
        frames: vec![frame(0.0), frame(0.5)],
        markers: None,
        warnings: Vec::new(),
    }
}

fn written(recording: &Recording) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_recording(folder.path(), recording).unwrap();
    folder
}

fn fault(folder: &TempDir) -> String {
    one_line(read_recording(folder.path()).expect_err("must be refused"))
}

/// The error after a text of the recording's TOML was replaced.
fn fault_with(from: &str, to: &str) -> String {
    let folder = written(&wall());
    let path = folder.path().join("recording.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{from} not in {text}");
    std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
    fault(&folder)
}

#[test]
fn truncated_png() {
    let folder = written(&wall());
    let png = folder.path().join("depth/cam0/000001.png");
    let bytes = std::fs::read(&png).unwrap();
    std::fs::write(&png, &bytes[..bytes.len() - 20]).unwrap();
    let e = fault(&folder);
    assert!(e.contains("000001.png: not a readable PNG file (truncated?)"), "{e}");
}

#[test]
fn depth_in_the_wrong_unit() {
    let e = fault_with("depth_scale = 0.001", "depth_scale = 1");
    let wanted = "the median depth of camera \"cam0\" is 500.000000 m (500 counts), expected 0.02 to 20 m; depth_scale = 0.001 would make it 0.500 m";
    assert!(e.contains("camera.0.depth_scale: ") && e.contains(wanted), "{e}");
    let e = fault_with("depth_scale = 0.001", "depth_scale = 0.000001");
    assert!(e.contains("is 0.000500 m"), "{e}");
}

#[test]
fn frame_times_out_of_order() {
    let e = fault_with("time = 0.0", "time = 0.75");
    assert!(e.contains("frame.1.time: 0.5 comes after 0.75 in the file; frames are ordered by time"), "{e}");
}

#[test]
fn empty_mask() {
    let mut r = wall();
    r.frames[1].mask.as_mut().unwrap().fill(false);
    let e = fault(&written(&r));
    assert!(e.contains("frame.1.mask: is empty: no pixel is marked as the object (255)"), "{e}");
}

#[test]
fn zero_cameras() {
    let folder = written(&wall());
    let path = folder.path().join("recording.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let (from, to) = (text.find("[[camera]]").unwrap(), text.find("[[frame]]").unwrap());
    std::fs::write(&path, format!("{}{}", &text[..from], &text[to..])).unwrap();
    let e = fault(&folder);
    assert!(e.contains("frame: 2 frames but no [[camera]]"), "{e}");
}

#[test]
fn points_nowhere_near_the_object() {
    let folder = written(&wall());
    let r = read_recording(folder.path()).unwrap();
    let (o, _) = r.observation(&compared(CostKind::SparseSurface), &mut Vec::new()).unwrap();
    let body = |z: f64| (DVec3::new(-0.05, -0.05, z), DVec3::new(0.05, 0.05, z + 0.1));
    let (min, max) = body(0.5);
    check_overlap(&o, min, max).unwrap();
    let (min, max) = body(-2.0);
    let e = check_overlap(&o, min, max).unwrap_err();
    assert!(e.contains("nowhere near the object") && e.contains("median distance of 384 points") && e.contains("units"), "{e}");
}
