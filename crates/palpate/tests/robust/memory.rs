//! Memory that is short: it is said before it is taken, and what was let begin has it to its end.

use super::{BLOCK, Place, run};
use std::fs;
use std::process::Command;

/// Runs palpate on two threads of the CPU with so many addresses [KiB]; what it writes is in `out`.
fn run_within(limit: u32, place: &Place, command: &str) -> (Option<i32>, String, String) {
    let line = format!("ulimit -v {limit}; exec \"$0\" {command} --backend cpu --out \"$1\"");
    let mut shell = Command::new("sh");
    shell.arg("-c").arg(line).arg(env!("CARGO_BIN_EXE_palpate")).arg(place.at("out"));
    run(shell.env("RAYON_NUM_THREADS", "2"))
}

#[test]
fn short_memory_is_said_before_it_is_taken() {
    let place = Place::new();
    // Some 200,000 cells, 500,000 quadratic tetrahedra.
    let cells = place.write("cells.toml", &BLOCK.replace("cell_size = 0.02", "cell_size = 0.0009"));
    let tetrahedra = BLOCK.replace("cell_size = 0.02", "discretisation = \"tetrahedra\"\nedge_length = 0.0015");
    let tetrahedra = place.write("tetrahedra.toml", &tetrahedra);
    // Too little for the body, just enough, and of cells enough for it but not for a simulation.
    for (scene, limits, hint) in [
        (&cells, &[600_000, 850_000, 1_050_000, 1_400_000][..], "take coarser cells"),
        (&tetrahedra, &[600_000, 1_700_000], "take larger tetrahedra: object.edge_length"),
    ] {
        for limit in limits {
            let (code, _, err) = run_within(*limit, &place, &format!("simulate \"{}\"", scene.display()));
            let last = err.lines().last().unwrap_or_default();
            assert_eq!(code, Some(1), "{limit}: {err}");
            for word in ["error: ", " takes about ", " of memory are left (limit of the shell, ulimit -v", "hint: ", hint] {
                assert!(last.contains(word), "\"{word}\" is not in: {err}");
            }
        }
    }
}

/// Runs a command under ever higher limits of memory until one lets it begin; what it writes then is in `out`.
fn under_limits(place: &Place, command: &str, file: &str) {
    // How much more each time [KiB]: less than a product of matrices reserves.
    let mut refused = 0;
    for limit in (400_000..8_000_000).step_by(60_000) {
        let (code, _, err) = run_within(limit, place, command);
        if code == Some(0) {
            break;
        }
        assert!(
            matches!(code, Some(1 | 2)) && err.contains(" of memory are left (limit of the shell, ulimit -v"),
            "{limit}: {err}"
        );
        refused += 1;
    }
    assert!(refused > 0 && place.at("out").join(file).exists(), "{refused} refused");
}

#[test]
fn what_is_let_begin_has_memory_to_its_end() {
    let place = Place::new();
    let scene = fs::read_to_string(place.observed()).expect("a scene");
    let finer = scene.replace("cell_size = 0.02", "cell_size = 0.008").replace("iterations = 12", "iterations = 1");
    let (finer, scene) = (place.write("finer.toml", &finer), place.write("coarse.toml", &scene));
    for threads in ["", "--threads 2"] {
        under_limits(&place, &format!("fit \"{}\" --pictures 0 {threads}", finer.display()), "result.json");
        fs::remove_dir_all(place.at("out")).expect("it was written");
    }
    under_limits(&place, &format!("diagnose \"{}\" --pictures 0 --budget 0.1", scene.display()), "diagnosis.json");
}
