//! Numbers that a law and its twin in WGSL both state are the same. Probes of both at random states would not tell: what keeps a root
//! smooth is far smaller than what it is added to.

use palpate_model::effects::law::Asks;
use palpate_model::effects::{ALL, Law, Site};
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

fn read(path: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..").join(path);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// What of a Rust file states the law itself: no comments, tests and bounds of parameters.
fn law_of(text: &str) -> String {
    let text = text.split("#[cfg(test)]").next().unwrap_or("");
    let mut params = false;
    let mut kept = String::new();
    for line in text.lines().map(str::trim).filter(|l| !l.starts_with("//")) {
        params |= line.starts_with("const PARAMS");
        if !params {
            kept.push_str(line);
            kept.push('\n');
        }
        params &= !line.ends_with(';');
    }
    kept
}

/// Constants of a file, by name: all but whole numbers.
fn constants(text: &str) -> BTreeMap<String, String> {
    let of = |line: &str| {
        let line = line.trim();
        let (name, value) = line.strip_prefix("pub ").unwrap_or(line).strip_prefix("const ")?.split_once('=')?;
        let (name, kind) = name.split_once(':').unwrap_or((name, "f64"));
        (kind.trim() == "f64").then(|| (name.trim().to_string(), value.trim().trim_end_matches(';').to_string()))
    };
    text.lines().filter_map(of).collect()
}

/// Numbers with an exponent: those that stand for something small and not for a part of a formula.
fn small(text: &str) -> Vec<&str> {
    let words = text.split(|c: char| !(c.is_alphanumeric() || c == '.' || c == '-'));
    words.filter(|w| w.starts_with(|c: char| c.is_ascii_digit()) && w.contains("e-") && w.parse::<f64>().is_ok()).collect()
}

/// What differs between a law and its twin, whose constants begin with the law's name.
fn differences(kind: &str, law: &str, twin: &str) -> Vec<String> {
    let law = law_of(law);
    let twin: String = twin.lines().filter(|l| !l.trim_start().starts_with("//")).map(|l| format!("{l}\n")).collect();
    let own: BTreeMap<String, String> =
        constants(&law).into_iter().map(|(name, v)| (format!("{}_{name}", kind.to_uppercase()), v)).collect();
    let other = constants(&twin);
    let all = own.iter().filter(|c| other.get(c.0) != Some(c.1)).chain(other.iter().filter(|c| own.get(c.0) != Some(c.1)));
    let mut out: Vec<String> = all.map(|(name, value)| format!("{name} = {value}")).collect();
    let known = small(&law);
    out.extend(small(&twin).into_iter().filter(|n| !known.contains(n)).map(str::to_string));
    out
}

fn has_twin(law: &Law) -> bool {
    matches!(law.site, Site::Nodes(_) | Site::Surface(_) | Site::Contact(_) | Site::Cells(_)) && law.asks() == Asks::Nothing
}

#[test]
fn laws_and_their_twins_state_the_same_constants() {
    let (mut laws, mut named) = (0, 0);
    for law in ALL.iter().filter(|l| has_twin(l)) {
        let name = law.kind.replace('-', "_");
        let own = read(&format!("crates/palpate-model/src/effects/{name}.rs"));
        assert_eq!(differences(&name, &own, &read(&format!("shaders/effects/{name}.wgsl"))), Vec::<String>::new(), "{name}");
        laws += 1;
        named += constants(&law_of(&own)).len();
    }
    for model in palpate_model::materials::ALL.iter().filter(|m| !m.is_linear && m.has_twin()) {
        let name = model.name.replace('-', "_");
        let own = read(&format!("crates/palpate-model/src/materials/{name}.rs"));
        assert_eq!(differences(&name, &own, &read(&format!("shaders/materials/{name}.wgsl"))), Vec::<String>::new(), "{name}");
    }
    println!("{laws} laws with {named} constants");
    assert!(laws >= 14 && named >= 5, "{laws} {named}");
    // Of contact the rest comes from the host.
    let (own, twin) = (law_of(&read("crates/palpate-model/src/mechanics/contact.rs")), read("shaders/shared/contact.wgsl"));
    assert!(small(&twin).iter().all(|n| small(&own).contains(n)) && !small(&twin).is_empty(), "{:?}", small(&twin));
}

#[test]
fn a_constant_that_differs_is_missing_or_is_not_named_is_seen() {
    let params = "const PARAMS: [P; 1] = [\n    number(\"a\", [1e-6, 1e5]),\n];\n";
    let law = &format!("/// Rate [1/s].\nconst SLOW: f64 = 1e-2;\n{params}fn f() {{ x + SLOW + 1e-12 }}");
    let twin = "// with 1e-7\nconst SOME_LAW_SLOW = 1e-2;\nfn some_law() { x + SOME_LAW_SLOW + 1e-12 }";
    assert_eq!(differences("some_law", law, twin), Vec::<String>::new());
    let wrong = [("SLOW = 1e-2", "SLOW = 2e-2"), ("const SOME_LAW_SLOW = 1e-2;\n", ""), ("1e-12", "1e-11"), ("1e-12", "1e-6")];
    for (from, to) in wrong {
        assert_ne!(differences("some_law", law, &twin.replace(from, to)), Vec::<String>::new(), "{from} → {to}");
    }
    assert_ne!(differences("some_law", &law.replace("= 1e-2", "= 3e-2"), twin), Vec::<String>::new());
}
