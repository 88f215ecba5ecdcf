//! Point clouds as measurements, end to end: simulated, written in every format, read, fitted and tracked.

use glam::DVec3;
use palpate::render::{Pinhole, Sensor};
use palpate::synthetic::{Observers, observe};
use palpate::{Backend, Experiment, FitOptions};
use palpate_io::recording::{DepthPixels, RawDepth, RecordedCloud, Recording, SeenFrom};
use palpate_io::{read_recording, write_recording};
use std::ops::ControlFlow;
use std::path::Path;
use std::process::Command;

/// The first steps of the bar.
fn bar() -> String {
    include_str!("bar.toml").replace("steps = 12", "steps = 8")
}

const FREE: &str = r#"
    [fit]
    [[fit.parameter]]
    path = "material.youngs_modulus"
    start = 8.0e4
"#;

const TRUTH: f64 = 6.0e4;

/// What one camera sees of the bar.
fn seen() -> Recording {
    let truth = Experiment::from_toml(&bar(), "bar.toml").unwrap_or_else(|e| panic!("{e}"));
    let camera = Pinhole::looking_at(DVec3::new(0.1, -0.35, 0.12), DVec3::new(0.06, 0.0, 0.0), DVec3::Z, 24.0, 40, 40);
    let observers = Observers {
        cameras: vec![camera.unwrap_or_else(|e| panic!("{e}"))],
        markers: Vec::new(),
        points: Vec::new(),
        displacements: false,
        times: (0..=8).map(|k| 0.01 * f64::from(k)).collect(),
        sensor: Sensor { noise: 5e-4, dropout: 0.1, depth_scale: 1e-4, seed: 4 },
    };
    observe(&truth, Backend::Cpu, &observers, |_| ControlFlow::Continue(())).unwrap_or_else(|e| panic!("{e}"))
}

/// The pixels of images as clouds in files of a kind.
fn as_clouds(images: &Recording, kind: &str, from: SeenFrom) -> Recording {
    let clouds = images.frames.iter().map(|f| {
        let camera = &images.cameras[f.camera];
        let place = |(u, v, c): (usize, usize, RawDepth)| camera.point(u as f64, v as f64, camera.depth(c)).expect("a pinhole");
        RecordedCloud {
            file: format!("0.{kind}").into(),
            time: f.time,
            from,
            points: f.readings().map(place).collect(),
            noise_sigma: camera.noise_sigma,
            noise_systematic: 0.0,
        }
    });
    Recording { clouds: clouds.collect(), frames: Vec::new(), ..images.clone() }
}

/// The same images in metres.
fn in_metres(images: &Recording) -> Recording {
    let mut r = images.clone();
    for f in &mut r.frames {
        let camera = &images.cameras[f.camera];
        if let Some(d) = &mut f.depth {
            let metres = |i: usize| d.pixels.reading(i).map_or(f32::NAN, |z| camera.depth(z) as f32);
            d.pixels = DepthPixels::Metres((0..d.pixels.count()).map(metres).collect());
        }
    }
    r.cameras.iter_mut().for_each(|c| c.depth_scale = None);
    r
}

/// The bar with what was measured of it in a folder beside the scene.
fn scene(recording: &str) -> String {
    let bar = bar();
    format!("{bar}\n[observation]\nrecording = \"{recording}\"\ncost = \"sparse-surface\"\n{FREE}")
}

/// Stiffness found, and its standard error.
fn fitted(folder: &Path, name: &str) -> (f64, f64) {
    let experiment = Experiment::from_toml(&scene(name), folder.join("bar.toml")).unwrap_or_else(|e| panic!("{name}: {e}"));
    let fitted = experiment.fit(FitOptions { backend: Backend::Cpu, ..FitOptions::default() }).unwrap_or_else(|e| panic!("{e}"));
    let (after, p) = (&fitted.after[0], &fitted.result.parameters[0]);
    let error = p.standard_error.expect("an error is known");
    println!(
        "{name}: E = {} ± {error}, rms {:.2e} m, noise alone {:.2e} m, {} readings",
        p.value, after.rms, after.noise, after.points
    );
    assert!(after.rms < 1.25 * after.noise, "{name}: {} m and {} m", after.rms, after.noise);
    (p.value, error)
}

#[test]
fn clouds_of_every_format_say_what_the_images_say() {
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
    let images = seen();
    let write = |name: &str, r: &Recording| write_recording(folder.path().join(name), r).unwrap_or_else(|e| panic!("{e}"));
    write("images", &images);
    let (by_images, error) = fitted(folder.path(), "images");
    assert!((by_images - TRUTH).abs() < 3.0 * error && error < 0.1 * TRUTH, "{by_images} ± {error}");
    let origin = SeenFrom::Origin(images.cameras[0].position());
    for (name, kind, from) in [("ply", "ply", origin), ("pcd", "pcd", SeenFrom::Camera(0)), ("npz", "npz", origin)] {
        write(name, &as_clouds(&images, kind, from));
        let found = fitted(folder.path(), name).0;
        // The same points on the same lines of sight: what is left is rounding, and where the optimiser stops.
        assert!((found - by_images).abs() < 1e-6 * TRUTH, "{name}: {found} and {by_images}");
    }
    write("metres", &in_metres(&images));
    let found = fitted(folder.path(), "metres").0;
    // Single precision rounds by 3e-8 m of 0.4 m, a ten-thousandth of the noise.
    assert!((found - by_images).abs() < 1e-5 * TRUTH, "metres: {found} and {by_images}");
    let mut blind = as_clouds(&images, "ply", SeenFrom::Unknown);
    blind.cameras.clear();
    write("blind", &blind);
    let read = read_recording(folder.path().join("blind")).unwrap_or_else(|e| panic!("{e}"));
    assert!(read.warnings.iter().any(|w| w.contains("neither camera nor origin")), "{:?}", read.warnings);
    let (found, error) = fitted(folder.path(), "blind");
    assert!((found - TRUTH).abs() < 4.0 * error, "{found} ± {error}");
}

#[test]
fn clouds_without_lines_of_sight_are_tracked() {
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("{e}"));
    let images = seen();
    for (name, from) in [("blind", SeenFrom::Unknown), ("seen", SeenFrom::Origin(images.cameras[0].position()))] {
        write_recording(folder.path().join(name), &as_clouds(&images, "npz", from)).unwrap_or_else(|e| panic!("{e}"));
        let file = folder.path().join(format!("{name}.toml"));
        std::fs::write(&file, scene(name)).unwrap_or_else(|e| panic!("{e}"));
        let out = folder.path().join(format!("{name}-out"));
        let run = Command::new(env!("CARGO_BIN_EXE_palpate")).arg("track").arg(&file).arg("--out").arg(&out).output();
        let run = run.unwrap_or_else(|e| panic!("{e}"));
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        let text = std::fs::read_to_string(out.join("tracked.json")).unwrap_or_else(|e| panic!("{e}"));
        let tracked: serde_json::Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(tracked["verdict"], "tracked", "{name}: {text}");
        let frames = tracked["frames"].as_array().expect("frames are listed");
        assert_eq!(frames.len(), images.frames.len());
        for f in frames {
            let [rms, readings, matched, seen] = ["rms", "readings", "matched", "seen"].map(|k| f[k].as_f64().expect("a number"));
            // Noise of half a millimetre, less what the shape takes of it; nothing is lost, and the camera sees a part of the surface.
            assert!(rms < 6e-4 && matched == readings && seen > 100.0, "{name}: {f}");
        }
        let told = Command::new(env!("CARGO_BIN_EXE_palpate")).arg("inspect").arg(folder.path().join(name)).output();
        let told = String::from_utf8_lossy(&told.unwrap_or_else(|e| panic!("{e}")).stdout).into_owned();
        assert!(
            told.contains("9 from 0.0000 s to 0.0800 s") && told.contains("without lines of sight") == (name == "blind"),
            "{told}"
        );
    }
}
