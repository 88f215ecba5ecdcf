//! Numbers and names in a scene.

use super::scene_fault;

#[test]
fn nan_in_toml() {
    let e = scene_fault("youngs_modulus = 2e5", "youngs_modulus = nan", 9);
    assert!(e.starts_with("material.youngs_modulus: NaN is not a number that can be used"), "{e}");
    let e = scene_fault("min = [0, 0, 0]", "min = [0, -inf, 0]", 4);
    assert!(e.starts_with("object.shape.box.min: -inf is not a number"), "{e}");
}

#[test]
fn numbers_of_any_size_are_printed_short() {
    let e = scene_fault("max = [0.1, 0.03, 0.03]", "max = [1e308, 0.03, 0.03]", 4);
    assert!(e.starts_with("object.shape: its longest side is 1e308 m; in millimetres?"), "{e}");
    let e = scene_fault("poisson_ratio = 0.45", "poisson_ratio = -1e200", 10);
    assert_eq!(e, "material.poisson_ratio: -1e200 is not allowed: must lie in (-1, 0.5)");
}

#[test]
fn bounds_that_exclude_the_start() {
    let e = scene_fault("start = 1e5", "start = 1e2", 25);
    assert_eq!(e, "fit.parameter.0.bounds: material.youngs_modulus: [1000, 1000000] excludes start 100");
    let e = scene_fault("start = 1e5\nbounds = [1e3, 1e6]", "bounds = [1e3, 1e4]", 24);
    assert!(e.ends_with("excludes the scene's value 200000"), "{e}");
}

#[test]
fn unknown_optimiser() {
    let e = scene_fault("gauss-newton", "adam", 20);
    let known = "\"rprop\", \"gradient-descent\", \"lbfgs\", \"gauss-newton\", \"gauss-newton-cg\", \"nelder-mead\"";
    assert_eq!(e, format!("fit.optimizer: \"adam\" is not known; allowed: {known}"));
}

#[test]
fn misspelt_key() {
    let e = scene_fault("youngs_modulus = 2e5", "youngs_modul = 2e5", 9);
    assert_eq!(e, "material.youngs_modul: unknown key; did you mean \"youngs_modulus\"?");
}
