//! `[points]` and `[displacements]`: what is read, what is written, and what is refused.

use super::*;
use crate::npy::write_npz;
use crate::recording::{Recording, read_recording, write_recording};
use palpate_model::observation::ReadingKind;
use palpate_model::scene::ObservationSpec;

fn array(shape: &[usize], values: &[f64]) -> Array {
    Array { shape: shape.to_vec(), values: values.to_vec() }
}

/// Two points at three times, the second of them unseen at the second.
fn track() -> Array {
    let n = f64::NAN;
    array(&[3, 2, 3], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 1.1, 2.0, 3.0, n, n, n, 1.2, 2.0, 3.0, 4.2, 5.0, 6.0])
}

/// A folder with these arrays in `a.npz` and a recording that has this table.
fn folder(arrays: &[(&str, &Array)], table: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_npz(folder.path().join("a.npz"), arrays).unwrap();
    std::fs::write(folder.path().join("recording.toml"), format!("format = \"recording/1\"\n{table}\n")).unwrap();
    folder
}

fn read(arrays: &[(&str, &Array)], table: &str) -> Result<Recording, String> {
    let folder = folder(arrays, table);
    read_recording(folder.path()).map_err(|e| e.to_string().replace(&folder.path().display().to_string(), "R"))
}

fn spec(kind: ReadingKind) -> ObservationSpec {
    ObservationSpec::new("r", vec![kind])
}

/// As equal as vectors with NaN can be.
fn same(a: &[DVec3], b: &[DVec3]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a == b || (a.is_nan() && b.is_nan()))
}

#[test]
fn points_are_read_in_their_unit_and_axes() {
    let table = "[points]\nfile = \"a.npz\"\nrate = 10\nstart = 0.5\nrest = 0\nunit = \"mm\"\nnoise_sigma = 0.001\n\
                 transform = [[0, -1, 0, 1], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]";
    let r = read(&[("points", &track())], table).unwrap();
    let p = r.points.as_ref().unwrap();
    assert_eq!((p.track.count(), p.track.readings(), &p.track.times), (2, 5, &vec![0.5, 0.6, 0.7]));
    assert!((p.rest[1] - DVec3::new(0.995, 0.004, 0.006)).length() < 1e-15, "{}", p.rest[1]);
    let mut warnings = Vec::new();
    let (o, rest) = r.observation(&spec(ReadingKind::Track), &mut warnings).unwrap();
    assert!(rest.is_empty() && warnings.is_empty(), "{warnings:?}");
    assert_eq!(o.frames.iter().map(|f| f.markers.len()).collect::<Vec<_>>(), [2, 1, 2]);
    assert_eq!((o.frames[1].markers[0].site, o.noise(ReadingKind::Track), o.tracks.places.len()), (0, 0.001, 2));
    let e = r.observation(&spec(ReadingKind::Displacement), &mut warnings).unwrap_err().to_string();
    assert!(e.contains("\"displacements\" needs [displacements]"), "{e}");
    let late = ObservationSpec { from: 2.0, ..spec(ReadingKind::Track) };
    let e = r.observation(&late, &mut warnings).unwrap_err().to_string();
    assert!(e.contains("no tracked point is left from 2 s on") && e.contains("from 0.5 s to 0.7"), "{e}");
}

#[test]
fn displacements_are_turned_but_not_shifted() {
    let table = "[displacements]\nfile = \"a.npz\"\narray = \"u\"\ntimes = [0, 0.1, 0.2]\nnodes = \"x\"\n\
                 transform = [[0, -1, 0, 1], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]";
    let nodes = array(&[2, 3], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let r = read(&[("u", &track()), ("x", &nodes)], table).unwrap();
    let d = r.displacements.as_ref().unwrap();
    assert!((d.track.vectors[0] - DVec3::new(-2.0, 1.0, 3.0)).length() < 1e-14, "{}", d.track.vectors[0]);
    assert!((d.nodes[1] - DVec3::new(1.0, 1.0, 0.0)).length() < 1e-14, "{}", d.nodes[1]);
    let mut warnings = Vec::new();
    let (o, _) = r.observation(&spec(ReadingKind::Displacement), &mut warnings).unwrap();
    assert!(warnings.len() == 1 && warnings[0].contains("displacements state no noise_sigma"), "{warnings:?}");
    assert_eq!((o.residuals(), o.nodes.as_ref().unwrap().count), (15, 2));
    assert_eq!(o.frames[1].displacements[0].node, 0);
}

#[test]
fn what_is_written_is_read_back() {
    let table = "[points]\nfile = \"a.npz\"\ntimes = [0.0, 0.1, 0.25]\nrest = 2\ntolerance = 0.02\nnoise_sigma = 0.002\n\
                 [displacements]\nfile = \"a.npz\"\narray = \"points\"\nrate = 3";
    let r = read(&[("points", &track())], table).unwrap();
    let folder = tempfile::tempdir().unwrap();
    write_recording(folder.path(), &r).unwrap();
    let s = read_recording(folder.path()).unwrap();
    let (a, b) = (r.points.unwrap(), s.points.unwrap());
    assert!(same(&a.track.vectors, &b.track.vectors) && a.track.times == b.track.times);
    assert_eq!((a.rest, a.tolerance, a.track.noise_sigma), (b.rest, b.tolerance, b.track.noise_sigma));
    let (a, b) = (r.displacements.unwrap(), s.displacements.unwrap());
    assert!(same(&a.track.vectors, &b.track.vectors) && a.track.times == b.track.times && b.nodes.is_empty());
}

#[test]
fn rest_places_come_from_a_file_of_their_own() {
    let folder = folder(&[("points", &track())], "[points]\nfile = \"a.npz\"\nrate = 1\nrest = \"rest.npz:x\"");
    write_npz(folder.path().join("rest.npz"), &[("x", &array(&[2, 3], &[0.0; 6]))]).unwrap();
    assert_eq!(read_recording(folder.path()).unwrap().points.unwrap().rest, [DVec3::ZERO; 2]);
}

#[test]
fn faults_are_named() {
    let (t, n) = (track(), f64::NAN);
    let flat = array(&[3, 6], &[0.0; 18]);
    let infinite = array(&[1, 1, 3], &[0.0, f64::INFINITY, 0.0]);
    let partly = array(&[1, 2, 3], &[0.0, 0.0, 0.0, n, 0.0, 0.0]);
    let unseen = array(&[1, 1, 3], &[n; 3]);
    let two = array(&[2], &[0.0, 0.1]);
    let falling = array(&[3], &[0.0, 0.2, 0.1]);
    let base = "[points]\nfile = \"a.npz\"\n";
    for (arrays, rest, expected) in [
        (
            vec![("points", &flat)],
            "rate = 1\nrest = 0",
            "R/recording.toml:3: points.file: has shape (3, 6), expected (frames, points, 3)",
        ),
        (vec![("points", &infinite)], "rate = 1\nrest = 0", "points.file: 1 of 3 numbers are infinite"),
        (vec![("points", &partly)], "rate = 1\nrest = 0", "points.file: 1 vectors are NaN in part only, the first is number 1"),
        (vec![("points", &unseen)], "rate = 1\nrest = 0", "points.file: holds not a single reading"),
        (vec![("tracks", &t)], "rate = 1\nrest = 0", "R/a.npz: holds no array \"points\"; known: tracks"),
        (vec![("tracks", &t)], "array = \"track\"\nrate = 1\nrest = 0", "holds no array \"track\"; did you mean \"tracks\"?"),
        (vec![("points", &t)], "rest = 0", "points.times: missing; expected numbers (s) or an array"),
        (vec![("points", &t)], "times = [0, 1]\nrest = 0", "points.times: expected an array of 3 numbers, found 2"),
        (vec![("points", &t), ("t", &two)], "times = \"t\"\nrest = 0", "points.times: holds 2 times for 3 frames"),
        (
            vec![("points", &t), ("t", &falling)],
            "times = \"t\"\nrest = 0",
            "points.times: 0.1 of frame 2 is not finite, or not after",
        ),
        (vec![("points", &t)], "rate = 1", "points.rest: missing; expected the number of a frame at rest"),
        (vec![("points", &t)], "rate = 1\nrest = 3", "points.rest: 3 is out of range; expected a whole number from 0 to 2"),
        (vec![("points", &t)], "rate = 1\nrest = 1", "points.rest: 1 of 2 points were not seen in frame 1"),
        (vec![("points", &t)], "rate = 1\nrest = \"points\"", "points.rest: \"points\" has shape (3, 2, 3), expected (2, 3)"),
        (
            vec![("points", &t)],
            "rate = 1\nrest = 0\nunit = \"inch\"",
            "points.unit: \"inch\" is not known; allowed: \"m\", \"cm\", \"mm\"",
        ),
        (vec![("points", &t)], "rate = 0\nrest = 0", "points.rate: 0 is not allowed: must be > 0 (1/s)"),
        (vec![("points", &t)], "rate = 1\nrest = 0\nrset = 1", "points.rset: unknown key; did you mean \"rest\"?"),
        (vec![("points", &t)], "rate = 1\nrest = \"../x.npy\"", "leaves the recording's folder"),
    ] {
        let e = read(&arrays, &format!("{base}{rest}")).unwrap_err();
        assert!(e.contains(expected), "{e}\ninstead of {expected}");
    }
}
