//! Damaged bytes as a file of the reader `camera`, by cargo-fuzz.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let dir = tempfile::tempdir().expect("a folder");
    let (_, target) = palpate_fuzz::TARGETS.into_iter().find(|t| t.0 == "camera").expect("it is there");
    target(dir.path(), data);
});
