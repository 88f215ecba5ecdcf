//! From a camera's folder to a fit: what `palpate import` writes is inspected and fitted as it is.

use palpate_io::{read_mesh, read_recording};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;

/// A soft ball that falls on the floor.
const TRUTH: &str = r#"
format = "scene/1"
[object]
mesh = "ball.obj"
pose = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.12], [0, 0, 0, 1]]
cells = 8
[material]
density = 1000.0
youngs_modulus = 5.0e4
poisson_ratio = 0.4
stiffness_damping = 0.001
[[plane]]
point = [0, 0, 0]
normal = [0, 0, 1]
[time]
step = 0.004
duration = 0.24
"#;

fn palpate(folder: &Path, words: &str) -> (i32, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    command.current_dir(folder).env("XDG_RUNTIME_DIR", std::env::temp_dir()).args(words.split_whitespace());
    let o = command.output().expect("the program starts");
    let text = |b: Vec<u8>| String::from_utf8(b).expect("the command line speaks UTF-8");
    (o.status.code().expect("no signal"), text(o.stdout), text(o.stderr))
}

/// A ball of 5 cm about the origin: an octahedron whose faces are cut into four five times, on the sphere.
fn ball(scale: f64) -> String {
    let (mut v, mut t) = (Vec::<[f64; 3]>::new(), Vec::<[usize; 3]>::new());
    v.extend([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]);
    t.extend([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]);
    for _ in 0..4 {
        let mut next = Vec::new();
        let mut middle = |a: usize, b: usize| {
            let m: [f64; 3] = std::array::from_fn(|i| v[a][i] + v[b][i]);
            let n = m.iter().map(|x| x * x).sum::<f64>().sqrt();
            v.push(m.map(|x| x / n));
            v.len() - 1
        };
        for [a, b, c] in t {
            let (d, e, f) = (middle(a, b), middle(b, c), middle(c, a));
            next.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
        }
        t = next;
    }
    let r = 0.05 * scale;
    let v: String = v.iter().map(|p| format!("v {} {} {}\n", r * p[0], r * p[1], r * p[2])).collect();
    let t: String = t.iter().map(|t| format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1)).collect();
    v + &t
}

#[test]
fn a_camera_s_folder_is_fitted_in_three_commands() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    fs::write(at("ball.obj"), ball(1.0)).expect("writable");
    fs::write(at("ball-mm.obj"), ball(1000.0)).expect("writable");
    read_mesh(at("ball.obj")).expect("a closed ball");
    fs::write(at("truth.toml"), TRUTH).expect("writable");
    let mut observe = Command::new(env!("CARGO_BIN_EXE_palpate"));
    observe.current_dir(folder.path()).args([
        "observe",
        "truth.toml",
        "--backend",
        "cpu",
        "--fps",
        "50",
        "--noise",
        "0.001",
        "--camera",
    ]);
    observe.args(["eye=0.5,-0.4,0.2 target=0,0,0.07 fov=30 size=128x120", "--out", "seen"]);
    assert!(observe.status().expect("the program starts").success());

    // The same as a RealSense camera's folder.
    let r = read_recording(at("seen")).expect("a recording");
    let c = &r.cameras[0];
    fs::create_dir_all(at("take")).expect("writable");
    fs::rename(at("seen/depth/cam0"), at("take/depth")).expect("writable");
    let json = format!(
        r#"{{"width": {}, "height": {}, "fx": {}, "fy": {}, "ppx": {}, "ppy": {}, "coeffs": [0, 0, 0, 0, 0], "depth_scale": {}, "fps": 50}}"#,
        c.width,
        c.height,
        c.focal[0],
        c.focal[1],
        c.center[0],
        c.center[1],
        c.depth_scale.expect("depth")
    );
    fs::write(at("take/intrinsics.json"), json).expect("writable");
    let m = c.world_from_camera.matrix3;
    let row =
        |i: usize| format!("{:?},{:?},{:?},{:?}", m.col(0)[i], m.col(1)[i], m.col(2)[i], c.world_from_camera.translation[i]);
    let pose = format!("{},{},{},0,0,0,1", row(0), row(1), row(2));

    let (code, out, err) = palpate(
        folder.path(),
        &format!(
            "import take --mesh ball-mm.obj --camera-pose {pose} --up z --floor 0 --poisson 0.4 --density 1000 --noise 0.001 --out ball"
        ),
    );
    assert_eq!(code, 0, "{err}");
    for word in ["realsense", "guesses", "--release", "--mesh-unit", "next: palpate inspect"] {
        assert!(out.contains(word), "{word}: {out}");
    }
    let (code, out, err) = palpate(folder.path(), "inspect ball/scene.toml");
    assert!(code == 0 && out.contains("to be found"), "{err}{out}");
    let (code, out, err) = palpate(folder.path(), "fit ball/scene.toml --backend cpu --no-grid-check --out found");
    assert_eq!(code, 0, "{err}{out}");
    let result: Value = serde_json::from_str(&fs::read_to_string(at("found/result.json")).expect("a result")).expect("JSON");
    let young = result["parameters"].as_array().and_then(|p| p[0]["value"].as_f64()).expect("a value");
    // Start 1e5 Pa, truth 5e4 on cells half as large: a fit that looks at its grid says ± 6 % for that, and two of these are allowed. The pose, guessed
    // from the near side of the ball, is a tenth of a millimetre off.
    assert!((young / 5e4 - 1.0).abs() < 0.12, "{young}\n{out}");

    let (code, out, err) = palpate(folder.path(), "import take --far 0.01 --out none");
    assert!(code == 2 && out.is_empty() && err.contains("error: --far: no reading"), "{err}");
    let (code, out, _) = palpate(folder.path(), "import take --json --out json");
    let json: Value = serde_json::from_str(&out).expect("JSON");
    assert!(code == 0 && json["format"] == "import/1" && json["guesses"].as_array().is_some_and(|g| g.len() > 5), "{out}");
}

#[test]
fn markers_are_inspected_and_fitted_as_they_were_imported() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut t = String::from(
        "Trajectories\n100\n,,tip,,,mid,,,base,,\nFrame,Sub Frame,X,Y,Z,X,Y,Z,X,Y,Z\n,,mm,mm,mm,mm,mm,mm,mm,mm,mm\n",
    );
    for i in 0..40 {
        // A beam's swing of 5 mm at 5 Hz, begun after a tenth of a second.
        let s = f64::max(0.0, f64::from(i) * 0.01 - 0.1);
        let z = -2.5 * (1.0 - (31.4 * s).cos());
        t += &format!("{i},0,100,15,{:.3},50,15,{:.3},0,15,30\n", 30.0 + z, 30.0 + 0.3 * z);
    }
    fs::write(folder.path().join("beam.csv"), t).expect("writable");
    let (code, out, err) =
        palpate(folder.path(), "import beam.csv --clamp -0.01,-0.01,-0.1,0.01,0.1,0.1 --duration 0.1 --out beam");
    assert!(code == 0 && out.contains("vicon"), "{err}");
    // Cells and step are left open, and chosen by the noise of markers.
    let (code, out, err) = palpate(folder.path(), "inspect beam/scene.toml");
    assert!(code == 0 && out.contains("noise 1.00 mm (markers)"), "{err}{out}");
    let (code, out, err) = palpate(folder.path(), "fit beam/scene.toml --backend cpu --iterations 1 --no-grid-check --out found");
    assert!(code == 0 && out.contains("material.youngs_modulus"), "{err}{out}");
}
