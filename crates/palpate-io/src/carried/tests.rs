//! Turned files are what their content turned is.

use super::Carried;
use glam::{DMat3, DQuat, DVec3};
use palpate_model::mechanics::splat::harmonics;
use std::path::PathBuf;

const TURN: [f64; 4] = [0.3, -0.5, 0.2, 0.7];
const AWAY: DVec3 = DVec3::new(0.4, -0.1, 2.0);

fn turn() -> DMat3 {
    DMat3::from_quat(DQuat::from_array(TURN).normalize())
}

/// Writes a file, carries it by the turn and reads the bytes back.
fn carried(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let (from, to) = (folder.path().join(name), folder.path().join(format!("moved-{name}")));
    std::fs::write(&from, bytes).expect("it is written");
    let file = Carried::read(&from).unwrap_or_else(|e| panic!("{e}"));
    let places = file.places().to_vec();
    file.write(&to, |i| (turn() * places[i] + AWAY, turn())).expect("it is written");
    (folder, to)
}

#[test]
fn a_mesh_keeps_all_but_its_places_and_normals() {
    let text = "# a face\nmtllib a.mtl\nv 1 0 0 0.5 0.5 1\nv 0 1 0\nv 0 0 1\nvt 0 1\nvn 0 0 1\nusemtl red\nf 1/1/1 2/1/1 3//1\nf -1 -2 -3\n";
    let (_folder, path) = carried("mesh.obj", text.as_bytes());
    let lines: Vec<String> = std::fs::read_to_string(&path).unwrap().lines().map(str::to_string).collect();
    let kept = ["# a face", "mtllib a.mtl", "vt 0 1", "usemtl red", "f 1/1 2/1 3", "f -1 -2 -3"];
    assert!(kept.iter().all(|k| lines.iter().any(|l| l == k)), "{lines:?}");
    assert!(lines.iter().all(|l| !l.starts_with("vn")) && lines[2].ends_with(" 0.5 0.5 1"));
    let back = Carried::read(&path).unwrap();
    for (p, x) in back.places().iter().zip([DVec3::X, DVec3::Y, DVec3::Z]) {
        assert!((*p - (turn() * x + AWAY)).length() < 1e-15);
    }
}

/// A splat file of one splat with harmonics to a degree.
fn splats(rest: usize, numbers: &[f32]) -> Vec<u8> {
    let mut names: Vec<String> = ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"].map(String::from).to_vec();
    names.extend((0..rest).map(|k| format!("f_rest_{k}")));
    names.extend(["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"].map(String::from));
    assert_eq!(names.len(), numbers.len());
    let head: String = names.iter().map(|n| format!("property float {n}\n")).collect();
    let mut bytes = format!("ply\nformat binary_little_endian 1.0\nelement vertex 1\n{head}end_header\n").into_bytes();
    numbers.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    bytes
}

/// The last numbers of a file.
fn tail(path: &std::path::Path, count: usize) -> Vec<f64> {
    let bytes = std::fs::read(path).unwrap();
    let rows = bytes[bytes.len() - 4 * count..].chunks_exact(4);
    rows.map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))).collect()
}

#[test]
fn a_splat_turns_with_its_size_and_colour() {
    // Single precision keeps 6e-8 of a number.
    const CLOSE: f64 = 1e-6;
    for rest in [0, 9, 24, 45] {
        let mut before = vec![0.1, 0.2, -0.3, 0.0, 0.0, 1.0, 0.7, 0.8, 0.9];
        before.extend((0..rest).map(|k| (k as f32 * 1.7).sin()));
        before.extend([2.5, -3.0, -4.0, -6.0, 1.4, 0.2, -0.6, 0.4]);
        let (_folder, path) = carried("splats.ply", &splats(rest, &before));
        let (after, n) = (tail(&path, before.len()), before.len());
        let of = |row: &[f64], at: usize| DVec3::from_slice(&row[at..at + 3]);
        let before: Vec<f64> = before.iter().map(|x| f64::from(*x)).collect();
        assert!((of(&after, 0) - (turn() * of(&before, 0) + AWAY)).length() < CLOSE);
        assert!((of(&after, 3) - turn() * DVec3::Z).length() < CLOSE);
        // Constant colour and opacity stay to the last bit.
        assert_eq!((&after[6..9], after[n - 8]), (&before[6..9], before[n - 8]));
        let covariance = |row: &[f64]| {
            let q = DQuat::from_xyzw(row[n - 3], row[n - 2], row[n - 1], row[n - 4]).normalize();
            let s = of(row, n - 7).exp();
            DMat3::from_quat(q) * DMat3::from_diagonal(s * s) * DMat3::from_quat(q).transpose()
        };
        let (found, wanted) = (covariance(&after), turn() * covariance(&before) * turn().transpose());
        // Of the largest, e⁻⁶.
        assert!((0..3).all(|c| (found.col(c) - wanted.col(c)).length() < 2.0 * CLOSE * (-6.0f64).exp()));
        let (channel, d) = (rest / 3, DVec3::new(0.36, -0.48, 0.8));
        for c in 0..3 {
            let colour = |row: &[f64], d: DVec3| {
                let part = &row[9 + c * channel..9 + (c + 1) * channel];
                harmonics(d).iter().zip(part).map(|(h, c)| h * c).sum::<f64>()
            };
            assert!((colour(&after, turn() * d) - colour(&before, d)).abs() < CLOSE);
        }
    }
}

#[test]
fn what_cannot_be_carried_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let refused = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("it is written");
        Carried::read(&path).expect_err(name).to_string()
    };
    assert!(refused("a.stl", b"solid").contains(".obj"));
    assert!(refused("a.obj", b"v 1 2\n").contains("line 1"));
    assert!(refused("b.obj", b"# nothing\n").contains("no vertex"));
    assert!(refused("a.ply", b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n").contains("binary"));
    let head = |rest: &str| format!("ply\nformat binary_little_endian 1.0\nelement vertex 9\n{rest}end_header\n");
    let xyz = "property float x\nproperty float y\nproperty float z\n";
    assert!(refused("b.ply", head(xyz).as_bytes()).contains("shorter"));
    assert!(refused("c.ply", head("property float x\n").as_bytes()).contains("\"y\""));
    assert!(refused("d.ply", &splats(3, &[0.0; 20])).contains("f_rest"));
    assert!(refused("e.ply", b"no").contains("PLY"));
}
