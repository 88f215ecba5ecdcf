//! Damaged bytes as a file of the reader `mcap`, by cargo-fuzz.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let dir = tempfile::tempdir().expect("a folder");
    let (_, target) = palpate_fuzz::TARGETS.into_iter().find(|t| t.0 == "mcap").expect("it is there");
    target(dir.path(), data);
});
