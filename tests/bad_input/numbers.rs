//! Numbers and names in a scene.

use super::scene_fault;
use palpate_io::output::write_file;

#[test]
fn nan_in_toml() {
    let e = scene_fault("youngs_modulus = 2e5", "youngs_modulus = nan", 9);
    assert!(e.contains("material.youngs_modulus: NaN is not a number that can be used"), "{e}");
    let e = scene_fault("min = [0, 0, 0]", "min = [0, -inf, 0]", 4);
    assert!(e.contains("object.shape.box.min: -inf is not a number"), "{e}");
}

#[test]
fn bounds_that_exclude_the_start() {
    let e = scene_fault("start = 1e5", "start = 1e2", 25);
    assert!(e.contains("fit.parameter.0.bounds: material.youngs_modulus: [1000, 1000000] excludes start 100"), "{e}");
    let e = scene_fault("start = 1e5\nbounds = [1e3, 1e6]", "bounds = [1e3, 1e4]", 24);
    assert!(e.contains("excludes the scene's value 200000"), "{e}");
}

#[test]
fn unknown_optimiser() {
    let e = scene_fault("gauss-newton", "adam", 20);
    let known = "\"rprop\", \"gradient-descent\", \"lbfgs\", \"gauss-newton\", \"nelder-mead\"";
    assert!(e.contains(&format!("fit.optimizer: \"adam\" is not known; allowed: {known}")), "{e}");
}

#[test]
fn misspelt_key() {
    let e = scene_fault("youngs_modulus = 2e5", "youngs_modul = 2e5", 9);
    assert!(e.ends_with("scene.toml:9: material.youngs_modul: unknown key; did you mean \"youngs_modulus\"?"), "{e}");
}

#[cfg(target_os = "linux")]
#[test]
fn disk_full() {
    if !std::path::Path::new("/dev/full").exists() {
        println!("skipped: no /dev/full");
        return;
    }
    let e = write_file("/dev/full", |w| w.write_all(b"anything")).unwrap_err().to_string();
    assert!(e.starts_with("/dev/full: cannot be written: No space left on device"), "{e}");
}
