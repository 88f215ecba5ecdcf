//! The list of effects, as printed and as documented.

use palpate_model::effects::ALL;
use serde_json::Value;
use support::command::{palpate, succeed};

#[test]
fn the_page_of_effects_is_what_inspect_prints() {
    let page = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/effects.md");
    let written = std::fs::read_to_string(&page).unwrap();
    let printed = succeed(&["inspect", "--effects"]).out;
    let lines = || printed.lines().zip(written.lines());
    let first = lines().position(|(a, b)| a != b).unwrap_or(lines().count());
    assert!(
        printed == written,
        "docs/effects.md differs from line {} on; write it anew with: cargo run --release -p palpate -- inspect --effects > docs/effects.md",
        first + 1
    );
    assert!(ALL.iter().all(|l| printed.contains(&format!("### `{}`", l.kind))));
}

#[test]
fn effects_as_json_name_every_parameter() {
    let all: Value = serde_json::from_str(&succeed(&["inspect", "--effects", "--json"]).out).unwrap();
    let effects = all["effects"].as_array().unwrap();
    assert_eq!(effects.len(), ALL.len());
    for (json, law) in effects.iter().zip(ALL) {
        assert_eq!(json["kind"], law.kind);
        let numbers: u64 = json["parameters"].as_array().unwrap().iter().map(|p| p["components"].as_u64().unwrap()).sum();
        assert_eq!(numbers as usize, law.params.len(), "{}", law.kind);
    }
    let both = palpate(&["inspect", "--effects", "scene.toml"]);
    assert_eq!(both.code, 2, "{}", both.err);
}
