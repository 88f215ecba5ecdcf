//! `[object] points`: what is read, and what is refused.

use crate::cloud::write_cloud;
use crate::npy::{Array, write_npz};
use crate::scene::parse_scene;
use glam::DVec3;
use palpate_model::scene::{BodySource, Resolution, Scene};
use palpate_model::space::stars::Weights;
use std::path::Path;

/// 5 × 4 × 3 points 10 mm apart, as a cloud and as an array, and what is none.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |n: usize| 0.01 * DVec3::new((n % 5) as f64 + 0.5, (n / 5 % 4) as f64 + 0.5, (n / 20) as f64 + 0.5);
    let points: Vec<DVec3> = (0..60).map(at).collect();
    let array =
        |points: &[DVec3]| Array { shape: vec![points.len(), 3], values: points.iter().flat_map(|p| p.to_array()).collect() };
    let file = |name: &str| folder.path().join(name);
    write_cloud(file("a.ply"), &points).expect("it can be written");
    write_npz(file("a.npz"), &[("rest", &array(&points))]).expect("it can be written");
    write_npz(file("few.npz"), &[("rest", &array(&points[..4]))]).expect("it can be written");
    write_npz(file("flat.npz"), &[("rest", &Array { shape: vec![180], ..array(&points) })]).expect("it can be written");
    let mut twice = points.clone();
    twice[7] = twice[3];
    write_cloud(file("twice.pcd"), &twice).expect("it can be written");
    folder
}

fn read(folder: &Path, object: &str) -> Result<Scene, String> {
    let text = format!(
        "format = \"scene/1\"\n[object]\n{object}\n[material]\ndensity = 1000\nyoungs_modulus = 1e5\npoisson_ratio = 0.3\n\
         [time]\nstep = 0.01\nsteps = 1\n"
    );
    parse_scene(&text, folder.join("s.toml")).map(|s| s.value).map_err(|e| e.to_string())
}

#[test]
fn clouds_become_points_or_cells() {
    let folder = folder();
    let of = |object: &str| read(folder.path(), object).unwrap_or_else(|e| panic!("{e}")).object;
    let stars =
        of("points = \"a.npz\"\ndiscretisation = \"points\"\nneighbours = 8\nweights = \"published\"\nresidual_penalty = 0.1");
    let BodySource::Cloud(cloud) = &stars.source else { panic!("{:?}", stars.source) };
    assert_eq!((cloud.points.len(), cloud.stars.neighbours, cloud.stars.weights), (60, 8, Weights::Published));
    assert_eq!((cloud.stars.residual_penalty, stars.resolution), (0.1, Resolution::Own));
    assert!((cloud.points[59] - DVec3::new(0.045, 0.035, 0.025)).length() < 1e-12);
    let cells = of("points = \"a.ply\"\nvolume = 6e-5\ncell_size = 0.01");
    let BodySource::Mesh { shape, .. } = &cells.source else { panic!("{:?}", cells.source) };
    assert!((shape.mesh().volume() / 6e-5 - 1.0).abs() < 1e-6, "{}", shape.mesh().volume());
    assert_eq!(cells.resolution, Resolution::CellSize(0.01));
    let stated =
        of("points = \"a.ply\"\ndiscretisation = \"points\"\nshape = { box = { min = [0, 0, 0], max = [0.05, 0.04, 0.03] } }");
    let BodySource::Cloud(cloud) = &stated.source else { panic!("{:?}", stated.source) };
    assert!(matches!(cloud.hull, BodySource::Analytic(_)) && cloud.stars.neighbours == 6);
}

#[test]
fn what_is_no_cloud_is_refused() {
    let folder = folder();
    for (object, wanted) in [
        ("points = \"none.npy\"", "s.toml:3: object.points: there is no file"),
        ("points = \"s.csv\"", "there is no file"),
        ("points = \"few.npz\"", "few.npz: holds 4 points; a body needs 8 or more"),
        ("points = \"flat.npz\"", "has shape (180,), expected (N, 3)"),
        ("points = \"twice.pcd\"", "2 of 60 points lie at the place of another one, points 3 and 7"),
        ("points = \"a.ply\"\nneighbours = 6", "s.toml:4: object.neighbours: belongs to discretisation = \"points\""),
        ("points = \"a.ply\"\nvolume_mesh = \"a.msh\"", "points and volume_mesh exclude each other"),
        ("points = \"a.ply\"\ndiscretisation = \"points\"\ncell_size = 0.01", "the points say how fine the body is"),
        ("points = \"a.ply\"\ndiscretisation = \"points\"\nneighbours = 3", "s.toml:5: object.neighbours"),
        ("points = \"a.ply\"\ndiscretisation = \"points\"\nweights = \"publishd\"", "allowed: \"compatible\", \"published\""),
        ("points = \"a.ply\"\ndiscretisation = \"points\"\nresidual_penalty = -1", "must lie in [0, 10]"),
        ("points = \"a.ply\"\nvolume = 60", "is not what these points fill"),
        (
            "points = \"a.ply\"\nvolume = 6e-5\nshape = { ball = { radius = 1 } }",
            "is that of the mesh or shape beside the points",
        ),
        ("shape = { ball = { radius = 1 } }\nvolume = 1", "object.volume: belongs to bodies of object.points"),
        ("shape = { ball = { radius = 1 } }\ndiscretisation = \"points\"", "\"points\" is that of a cloud"),
        ("points = \"a.ply\"\n[[field]]\npath = \"material.density\"\nbasis = \"points\"", "belongs to bodies of points"),
        (
            "points = \"a.ply\"\ndiscretisation = \"points\"\n[solver]\nelement = \"tet4\"",
            "belongs to bodies of cells or tetrahedra",
        ),
    ] {
        let e = read(folder.path(), object).err().unwrap_or_else(|| panic!("{object} is read"));
        assert!(e.contains(wanted), "{object}: {e}");
    }
}
