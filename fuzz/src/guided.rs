//! What cargo-fuzz does with a file: the target that is called like the binary reads it in a folder of its own.

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let dir = tempfile::tempdir().expect("a folder");
    let (_, target) = palpate_fuzz::TARGETS.into_iter().find(|t| t.0 == env!("CARGO_BIN_NAME")).expect("it is there");
    target(dir.path(), data);
});
