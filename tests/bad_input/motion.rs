//! The CSV of a clamp that moves.

use super::{SCENE, changed, folder, refused, write};
use palpate::{Backend, Experiment};
use std::path::{Path, PathBuf};
use support::command::{arg, palpate, succeed};

const HEADER: &str = "time,x,y,z,qx,qy,qz,qw";

/// A scene whose clamp moves as the file beside it says.
fn scene(folder: &Path, motion: &str) -> PathBuf {
    std::fs::write(folder.join("clamp.csv"), motion).unwrap();
    write(folder, &changed(SCENE, "[time]", "motion = \"clamp.csv\"\n\n[world]\ngravity = [0, 0, 0]\n\n[time]"))
}

#[test]
fn a_clamp_takes_the_body_along() {
    let folder = folder();
    // A centimetre along y within the simulated tenth of a second, and back to where the clamp began.
    let path = scene(folder.path(), &format!("{HEADER}\n0, 0,0,0, 0,0,0,1\n0.05, 0,0.01,0, 0,0,0,1\n0.1, 0,0.01,0, 0,0,0,1\n"));
    succeed(&["simulate", arg(&path), "--out", arg(&folder.path().join("out")), "--every", "10"]);
    let e = Experiment::open(&path).unwrap();
    let motion = e.scene().clamps[0].motion.as_ref().unwrap();
    assert_eq!((motion.times.as_slice(), motion.translations[1].y), (&[0.0, 0.05, 0.1][..], 0.01));
    let end = e.simulate(Backend::Cpu).unwrap();
    let states = end.snapshots.len() - 1;
    let held = e.plan().body.nodes.iter().zip(&end.snapshots[states].displacement).filter(|(x, _)| x.x < 1e-9);
    let moved: Vec<f64> = held.map(|(_, u)| u.y).collect();
    // The penalty of the clamp yields by some per cent of a millimetre.
    assert!(!moved.is_empty() && moved.iter().all(|y| (y - 0.01).abs() < 5e-4), "{moved:?}");
}

#[test]
fn a_clamp_that_leaps_is_named_and_not_a_pivot() {
    let folder = folder();
    // Metres that were meant as millimetres: the held end is thirty body lengths away within a step.
    let motion = format!("{HEADER}\n0, 0,0,0, 0,0,0,1\n0.05, 0,0,0, 0,0,0,1\n0.051, 0,3,0, 0,0,0,1\n0.1, 0,3,0, 0,0,0,1\n");
    let path = scene(folder.path(), &motion);
    let a = palpate(&["inspect", arg(&path)]);
    assert!(a.code == 0 && a.out.contains("clamp.0 jumps by 3"), "{}", a.out);
    assert!(a.out.contains("is its motion in metres and seconds, and relative to the rest place?"), "{}", a.out);
    // Where the body cannot follow, the error says so and no more. The curve through the rows swings back before a leap of kilometres.
    let path = scene(folder.path(), &motion.replace(" 0,3,0,", " 0,3000,0,"));
    let out = folder.path().join("out");
    let error = refused(&["simulate", arg(&path), "--backend", "cpu", "--out", arg(&out)], 1);
    assert!(error.contains("clamp.0 jumps by 94.1176 m within a step, from 0 s to 0.01 s"), "{error}");
    assert!(error.contains("check the rows of the clamp's motion file"), "{error}");
    assert!(error.len() < 350 && !error.contains("pivot"), "{error}");
    // Places in the world instead of ways from the rest place.
    let path = scene(folder.path(), &format!("{HEADER}\n0, 0,0.5,0, 0,0,0,1\n0.1, 0,0.5,0, 0,0,0,1\n"));
    let a = palpate(&["inspect", arg(&path)]);
    assert!(a.code == 0 && a.out.contains("clamp.0 is 0.5 m away from its rest place at the start, 0 s"), "{}", a.out);
}

#[test]
fn faults_of_the_file_are_named() {
    let folder = folder();
    for (motion, place, wanted) in [
        ("time,x,y,z,qw,qx,qy,qz\n".to_string(), ":1", "columns are time,x,y,z,qw,qx,qy,qz, expected time,x,y,z,qx,qy,qz,qw"),
        (format!("{HEADER}\n0,0,0,nan,0,0,0,1\n"), ":2", "z: \"nan\" is not a finite number"),
        (format!("{HEADER}\n0,0,0,0,0,0,0,1\n0,0,0,0,0,0,0,1\n"), ":3", "time 0 does not come after the row before it"),
        (format!("{HEADER}\n0,0,0,0,0,0,0,1\n1,0,0,0,1,0,0,1\n"), ":3", "qx,qy,qz,qw has length 1.414"),
        (format!("{HEADER}\n0,0,0,0,0,0,0\n"), ":2", "not a readable CSV file"),
        (format!("{HEADER}\n"), "", "holds no row"),
    ] {
        let path = scene(folder.path(), &motion);
        let e = refused(&["inspect", arg(&path)], 2);
        let file = format!("{}{place}: ", folder.path().join("clamp.csv").display());
        assert!(e.strip_prefix(&file).is_some_and(|e| e.starts_with(wanted)), "{e}");
    }
}
