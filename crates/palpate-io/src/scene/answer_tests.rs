//! What a scene leaves open or knows beforehand, and where the next fit starts.

use super::tests::{BASE, parameters, read};
use super::*;

#[test]
fn what_is_known_beforehand_is_a_pair_for_each_component_or_one_for_all() {
    let known = |text: &str| parameters(text).iter().map(|p| p.known).collect::<Vec<_>>();
    let density = "[[fit.parameter]]\npath = \"material.density\"\n";
    assert_eq!(known(density), [None]);
    assert_eq!(known(&format!("{density}known = [1070, 50]\n")), [Some((1070.0, 50.0))]);
    let gravity = "[[fit.parameter]]\npath = \"world.gravity\"\n";
    assert_eq!(known(&format!("{gravity}known = [0, 0.1]\n")), [Some((0.0, 0.1)); 3]);
    let each = known(&format!("{gravity}known = [[0, 0.1], [0, 0.2], [-9.81, 0.01]]\n"));
    assert_eq!(each, [Some((0.0, 0.1)), Some((0.0, 0.2)), Some((-9.81, 0.01))]);
    // An effect's number that the scene does not state starts where it is known to be.
    let lump = "[[fit.parameter]]\npath = \"effect.0.mass\"\nknown = [0.2, 0.1]\n[[effect]]\nkind = \"point-mass\"\n";
    assert_eq!(known(lump), [Some((0.2, 0.1))]);
}

#[test]
fn cells_and_step_may_be_left_open() {
    let open = BASE.replace("cell_size = 0.01\n", "").replace("step = 0.008333\n", "");
    let scene = parse_scene(&open, "scene.toml").unwrap().value;
    assert_eq!((scene.object.resolution, scene.time.open), (palpate_model::scene::Resolution::Open, Some(1.5)));
    assert_eq!(read("").unwrap().value.time.open, None);
    // What was chosen is written where a fit writes what it found.
    let values = [("object.cell_size".to_string(), 0.0125), ("time.step".to_string(), 0.003)];
    let text = write_scene(&open, &scene, &values, Path::new(".")).unwrap();
    let again = parse_scene(&text, "model.toml").unwrap().value;
    assert_eq!(again.object.resolution, palpate_model::scene::Resolution::CellSize(0.0125));
    assert_eq!((again.time.step, again.time.steps, again.time.open), (0.003, 500, None));
}

#[test]
fn the_next_fit_starts_where_this_one_ended() {
    let fit = "[fit]\nstarts = 3\n[[fit.parameter]]\npath = \"material.youngs_modulus\"\nstart = [1e4, 1e6]\nknown = [1e5, 2e4]\n\
               [[fit.parameter]]\npath = \"world.gravity\"\nstart = [0, 0, [-11, -9]]\n\
               [[fit.parameter]]\npath = \"plane.0.theta\"\nstart = 1.6\n[[fit.parameter]]\npath = \"initial.velocity.y\"\n";
    let text = format!("{BASE}{fit}");
    let scene = parse_scene(&text, "scene.toml").unwrap().value;
    let found = [
        ("material.youngs_modulus", 123456.789),
        ("world.gravity.x", 0.5),
        ("world.gravity.y", 0.25),
        ("world.gravity.z", -9.5),
        ("initial.velocity.y", 0.125),
    ];
    let mut values: Vec<(String, f64)> = found.iter().map(|(p, v)| (p.to_string(), *v)).collect();
    values.push(("plane.0.theta".into(), 1.5));
    let text = write_scene(&text, &scene, &values, Path::new(".")).unwrap();
    assert!(text.contains("start = 123456.789   # fitted, was [1e4, 1e6]\nknown = [1e5, 2e4]"), "{text}");
    let again = parse_scene(&text, "model.toml").unwrap().value.fit.unwrap().parameters;
    for (path, value) in found {
        let p = again.iter().find(|p| p.path == path).expect("it is still free");
        assert_eq!(p.start, (value, value), "{path}");
    }
    // Measured from another axis as soon as the normal turns: what is written is the normal.
    assert!(!text.contains("1.6"), "{text}");
    assert_eq!(again[0].known, Some((1e5, 2e4)));
}
