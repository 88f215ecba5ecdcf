//! Bodies that are written for other simulators: files, what is told, and what is refused.

use super::BLOCK;
use std::fs;
use support::command::{arg, palpate, succeed};

/// What varies the stiffness of the block over its height.
const FIELD: &str = r#"
[[field]]
path = "material.youngs_modulus"
basis = "regions"
blend = "axis"
regions = [{ center = [0.02, 0.02, 0], radius = 0.01 }, { center = [0.02, 0.02, 0.08], radius = 0.01, value = 3.0 }]
"#;

#[test]
fn every_format_is_written_from_a_scene_and_from_the_folder_of_a_fit() {
    let folder = tempfile::tempdir().unwrap();
    let (found, out) = (folder.path().join("found"), folder.path().join("out"));
    fs::create_dir(&found).unwrap();
    let scene = found.join("model.toml");
    fs::write(&scene, BLOCK).unwrap();
    let formats = "mujoco,calculix,febio,sofa,usd,gmsh,urdf";
    for source in [&scene, &found] {
        let a = succeed(&["export", arg(source), "--format", formats, "--out", arg(&out), "--json"]);
        let told: serde_json::Value = serde_json::from_str(&a.out).unwrap();
        assert_eq!(told["format"], "export/1");
        // Cells that volumes are measured by round off edges by some 1e-4 where they do not meet the lattice.
        let volume = 0.04 * 0.04 * 0.08;
        assert!((told["volume"].as_f64().unwrap() / volume - 1.0).abs() < 5e-4, "{told}");
        assert!(told["held"][0].as_u64().unwrap() > 4 && told["quadratic"] == true, "{told}");
        for format in told["formats"].as_array().unwrap() {
            for file in format["files"].as_array().unwrap() {
                let text = fs::read_to_string(out.join(file.as_str().unwrap())).unwrap();
                assert!(text.len() > 500, "{file}");
            }
            let lost = format["left_out"].to_string();
            assert_eq!(
                lost.contains("material.mass_damping"),
                ["mujoco", "gmsh", "urdf"].contains(&format["name"].as_str().unwrap()),
                "{format}"
            );
            fs::remove_file(out.join(format["files"][0].as_str().unwrap())).unwrap();
        }
    }
}

#[test]
fn a_stiffness_that_varies_is_written_element_by_element_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (folder.path().join("block.toml"), folder.path().join("out"));
    fs::write(&scene, format!("{BLOCK}{FIELD}")).unwrap();
    let refused = palpate(&["export", arg(&scene), "--format", "calculix,mujoco", "--out", arg(&out)]);
    let why = "field on material.youngs_modulus cannot be written as mujoco: a flex has one modulus; formats that hold it: calculix, febio";
    assert!(refused.code == 2 && refused.err.contains(why) && !out.exists(), "{}", refused.err);
    succeed(&["export", arg(&scene), "--format", "calculix", "--out", arg(&out)]);
    let deck = fs::read_to_string(out.join("block.inp")).unwrap();
    let moduli: Vec<f64> = deck.split("*ELASTIC\n").skip(1).map(|t| t.split(',').next().unwrap().parse().unwrap()).collect();
    let (least, most) = moduli.iter().fold((f64::MAX, 0.0f64), |(a, b), e| (a.min(*e), b.max(*e)));
    // Cells have the value at their middles, a centimetre from the ends: an eighth of the way on a logarithmic scale.
    assert!(
        (least / 2.0e4 / 3f64.powf(0.125) - 1.0).abs() < 0.02 && (most / 6.0e4 * 3f64.powf(0.125) - 1.0).abs() < 0.02,
        "{least} {most}"
    );
}

#[test]
fn what_cannot_be_exported_says_what_can() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("block.toml");
    fs::write(&scene, BLOCK).unwrap();
    let s = arg(&scene);
    let cases: &[(&[&str], &str)] = &[
        (&[s, "--format", "mujco"], "is none of mujoco, calculix, febio, sofa, usd, gmsh, urdf"),
        (&[s, "--format", "sofa", "--element", "quadratic"], "--element quadratic: sofa has linear elements alone"),
        (&[s, "--format", "gmsh", "--edge-length", "-1"], "--edge-length -1: must be > 0 (m)"),
        (&[s, "--format", "gmsh", "--edge-length", "1e-5"], "--edge-length 0.00001: 0.00001 m gives a lattice of"),
        (&[arg(folder.path()), "--format", "gmsh"], "holds no model.toml; name a scene, or a fit's output folder"),
    ];
    for (arguments, why) in cases {
        let a = palpate(&[&["export"], *arguments].concat());
        assert!(a.code == 2 && a.err.contains(why) && a.err.trim_end().lines().count() == 1, "{arguments:?}: {}", a.err);
    }
}
