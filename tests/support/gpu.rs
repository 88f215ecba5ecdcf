//! Whether tests of the GPU backend can run.

/// True when there is a usable adapter. Without one the test says that it is skipped, or fails where `PALPATE_GPU=require`.
pub fn there_is_one() -> bool {
    let found = palpate_gpu::adapters().iter().any(|a| a.refusal.is_none());
    let required = std::env::var("PALPATE_GPU").is_ok_and(|v| v == "require");
    assert!(
        found || !required,
        "PALPATE_GPU=require, but there is no usable graphics adapter; `cargo xtask test` says what to install"
    );
    if !found {
        eprintln!("skipped: no graphics adapter");
    }
    found
}
