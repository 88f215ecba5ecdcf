//! Recordings of arrays: what goes in comes out of files again, and what files would be refused for is refused.

use super::*;
use crate::recording::{read_recording, write_recording};
use glam::DAffine3;

fn tracks(vectors: Vec<DVec3>) -> Tracks {
    Tracks { times: vec![0.0, 0.1], vectors, noise: Noise { sigma: Some(0.001), systematic: 0.0 } }
}

fn two() -> Vec<DVec3> {
    vec![DVec3::new(1.0 / 3.0, 0.0, 0.0), DVec3::X, DVec3::NAN, DVec3::Y]
}

fn rest() -> Vec<DVec3> {
    vec![DVec3::ZERO, DVec3::X]
}

const POSE: [[f64; 4]; 4] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.5], [0.0, 0.0, 0.0, 1.0]];

fn stack() -> DepthStack {
    let camera = RecordedCamera {
        name: "cam".into(),
        width: 3,
        height: 2,
        focal: [100.0, 100.0],
        center: [1.0, 0.5],
        distortion: [0.0; 8],
        world_from_camera: DAffine3::IDENTITY,
        depth_scale: Some(0.001),
        depth_offset: 0.0,
        noise_sigma: Some(0.002),
        noise_systematic: 0.0,
    };
    let masks = Some([true, false].repeat(6));
    DepthStack {
        camera,
        pose: POSE,
        times: vec![0.0, 0.05],
        pixels: DepthPixels::Counts((0..12).map(|k| 1000 + k).collect()),
        masks,
    }
}

#[test]
fn arrays_are_what_they_were_when_they_have_been_files() {
    let marker = |name: &str, position| MarkerRest { name: name.into(), position, surface: Some(position) };
    let made = Recording::empty("two points", "a test")
        .with_points(tracks(two()), rest(), Some(0.5))
        .and_then(|r| r.with_displacements(tracks(two()), 2, rest()))
        .and_then(|r| r.with_markers(tracks(two()), vec![marker("a", DVec3::ZERO), marker("b", DVec3::X)]))
        .and_then(|r| r.with_depth(stack()))
        .unwrap();
    let folder = tempfile::tempdir().unwrap();
    write_recording(folder.path(), &made).unwrap();
    let read = read_recording(folder.path()).unwrap();
    // Bits, since NaN is not itself.
    let bits = |v: &[DVec3]| v.iter().flat_map(|v| v.to_array()).map(f64::to_bits).collect::<Vec<_>>();
    let (a, b) = (read.points.unwrap(), made.points.unwrap());
    assert_eq!((bits(&a.track.vectors), &a.track.times, bits(&a.rest)), (bits(&b.track.vectors), &b.track.times, bits(&b.rest)));
    assert_eq!((a.tolerance, a.track.noise_sigma), (b.tolerance, b.track.noise_sigma));
    let (a, b) = (read.displacements.unwrap(), made.displacements.unwrap());
    assert_eq!((bits(&a.track.vectors), bits(&a.nodes)), (bits(&b.track.vectors), bits(&b.nodes)));
    let (a, b) = (read.markers.unwrap(), made.markers.unwrap());
    assert_eq!((a.samples.len(), a.samples), (3, b.samples));
    assert_eq!(a.rest, b.rest);
    assert_eq!((read.frames, read.cameras), (made.frames, made.cameras));
}

#[test]
fn what_files_would_be_refused_for_is_refused_with_its_key() {
    let empty = || Recording::empty("", "");
    let points = |t: Tracks| empty().with_points(t, rest(), None).unwrap_err().to_string();
    let late = Tracks { times: vec![0.1, 0.1], ..tracks(two()) };
    assert_eq!(points(late), "<arrays>: points.times: 0.1 of frame 1 is not finite, or not after the one before");
    let few = Tracks { times: vec![0.1], ..tracks(two()) };
    assert_eq!(points(few), "<arrays>: points.times: holds 1 times for 2 frames");
    let half = [two(), vec![]].concat().into_iter().map(|v| DVec3::new(f64::NAN, v.y, v.z)).collect();
    assert!(points(tracks(half)).starts_with("<arrays>: points: 3 vectors are NaN in part only"));
    assert!(points(tracks(vec![DVec3::NAN; 4])).ends_with("all is NaN"));
    let loud = Tracks { noise: Noise { sigma: Some(0.0), systematic: 0.0 }, ..tracks(two()) };
    assert_eq!(points(loud), "<arrays>: points.noise_sigma: 0 is not allowed: must lie in [1e-9, 10] (m)");
    let lost = empty().with_points(tracks(two()), vec![DVec3::NAN, DVec3::X], None).unwrap_err().to_string();
    assert_eq!(lost, "<arrays>: points.rest: 1 of 2 places are not finite");
    let same = vec![MarkerRest { name: "a".into(), position: DVec3::X, surface: None }; 2];
    let twice = empty().with_markers(tracks(two()), same).unwrap_err().to_string();
    assert_eq!(twice, "<arrays>: markers.rest.name: \"a\" is given twice");
}

#[test]
fn cameras_of_arrays_are_checked() {
    let refused = |s: DepthStack| Recording::empty("", "").with_depth(s).unwrap_err().to_string();
    let millimetres = RecordedCamera { depth_scale: Some(1.0), ..stack().camera };
    let said = refused(DepthStack { camera: millimetres, ..stack() });
    assert!(said.starts_with("<arrays>: camera.depth_scale: the median depth") && said.contains("depth_scale = 0.001"), "{said}");
    let unscaled = RecordedCamera { depth_scale: None, ..stack().camera };
    let said = refused(DepthStack { camera: unscaled, ..stack() });
    assert!(said.starts_with("<arrays>: camera.depth_scale: camera \"cam\": is missing"), "{said}");
    let floats = DepthStack { pixels: DepthPixels::Metres(vec![1000.0; 12]), ..stack() };
    assert!(refused(floats).contains("are they millimetres? Floats are metres"));
    let mut leaning = POSE;
    leaning[0][1] = 0.5;
    assert!(refused(DepthStack { pose: leaning, ..stack() }).contains("camera.world_from_camera: not rigid"));
    let short = DepthStack { pixels: DepthPixels::Counts(vec![1000; 7]), ..stack() };
    assert!(refused(short).contains("frame.depth: camera \"cam\": depths or masks are no images of 3 × 2 pixels"));
    let dark = DepthStack { pixels: DepthPixels::Counts(vec![0; 12]), ..stack() };
    assert!(refused(dark).ends_with("no image holds a reading of the object"));
    let blind = RecordedCamera { focal: [0.0, 1.0], ..stack().camera };
    assert!(refused(DepthStack { camera: blind, ..stack() }).starts_with("<arrays>: camera.fx: 0 is not allowed"));
    let one = Recording::empty("", "").with_depth(stack()).unwrap();
    assert!(one.with_depth(stack()).unwrap_err().to_string().ends_with("two cameras are named \"cam\""));
}
