//! What goes along with a motion is the same whichever backend computes it: a block that a ball presses and a jet blows on, with a mesh and splats.

use super::BLOCK;
use std::fs;
use std::path::Path;
use support::command::{arg, succeed};

const TOUCHED: &str = r#"
[[obstacle]]
shape = { ball = { radius = 0.02, center = [0, 0, 0] } }
motion = "path.csv"
stiffness = 2.0e6

[[load]]
kind = "jet"
axis = [0, 1, 0]
offset = [0.02, -0.15, 0.06]
thrust = 0.3
"#;

const PATH: &str = "time,x,y,z,qx,qy,qz,qw\n0,-0.021,0.02,0.06,0,0,0,1\n0.2,-0.016,0.02,0.06,0,0,0,1\n";

/// Three splats in and beside the block, with scales that differ.
fn splats() -> Vec<u8> {
    let names = [
        "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2",
        "rot_3",
    ];
    let head: String = names.iter().map(|n| format!("property float {n}\n")).collect();
    let mut bytes = format!("ply\nformat binary_little_endian 1.0\nelement vertex 3\n{head}end_header\n").into_bytes();
    for place in [[0.02, 0.02, 0.07], [0.041, 0.01, 0.06], [0.01, 0.03, 0.084]] {
        let row = place.into_iter().chain([0.7, 0.8, 0.9, 2.5, -7.0, -5.5, -6.2, 0.8, 0.2, -0.4, 0.4]);
        row.for_each(|x: f32| bytes.extend(x.to_le_bytes()));
    }
    bytes
}

/// Numbers of the vertices of an OBJ file.
fn vertices(path: &Path) -> Vec<f64> {
    let text = fs::read_to_string(path).unwrap();
    let lines = text.lines().filter_map(|l| l.strip_prefix("v "));
    lines.flat_map(|l| l.split_whitespace().map(|x| x.parse().unwrap()).collect::<Vec<f64>>()).collect()
}

/// Numbers of the splats of a PLY file.
fn numbers(path: &Path) -> Vec<f64> {
    let bytes = fs::read(path).unwrap();
    let rows = bytes[bytes.len() - 4 * 3 * 14..].chunks_exact(4);
    rows.map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))).collect()
}

#[test]
fn a_mesh_and_splats_go_where_the_body_goes_on_either_backend() {
    if !support::gpu::there_is_one() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    fs::write(file("scene.toml"), BLOCK.replace("steps = 16", "steps = 8") + TOUCHED).unwrap();
    fs::write(file("path.csv"), PATH).unwrap();
    fs::write(file("skin.obj"), "v 0 0.041 0.06\nv 0.04 0.041 0.06\nv 0.02 0.02 0.085\nf 1 2 3\n").unwrap();
    fs::write(file("toy.ply"), splats()).unwrap();
    let carry = format!("{},{}", arg(&file("skin.obj")), arg(&file("toy.ply")));
    for backend in ["cpu", "gpu"] {
        let out = file(backend);
        let told = succeed(&["simulate", arg(&file("scene.toml")), "--backend", backend, "--carry", &carry, "--out", arg(&out)]);
        assert!(told.out.contains(&format!("({backend})")), "{}", told.out);
    }
    let of = |backend: &str, name: &str| file(backend).join(name);
    let off = |a: &[f64], b: &[f64]| {
        assert!(a.len() == b.len() && a.iter().chain(b).all(|x| x.is_finite()), "{a:?} {b:?}");
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let [before, cpu, gpu] = [("cpu", 0), ("cpu", 8), ("gpu", 8)].map(|(b, k)| vertices(&of(b, &format!("skin_{k:05}.obj"))));
    assert_eq!(gpu.len(), 9);
    // Single precision leaves some 1e-7 of a displacement of centimetres, in every step.
    println!("vertices move {:.2e} m, off by {:.1e} m", off(&before, &cpu), off(&cpu, &gpu));
    assert!(off(&before, &cpu) > 5e-3 && off(&cpu, &gpu) < 1e-6);
    let [before, cpu, gpu] = [("cpu", 0), ("cpu", 8), ("gpu", 8)].map(|(b, k)| numbers(&of(b, &format!("toy_{k:05}.ply"))));
    println!("numbers of splats change by {:.2e}, off by {:.1e}", off(&before, &cpu), off(&cpu, &gpu));
    // Logarithms of scales and quaternions follow from the deformation: that of a cell of 2 cm.
    assert!(off(&before, &cpu) > 0.05 && off(&cpu, &gpu) < 5e-5);
}
