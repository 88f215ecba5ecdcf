//! Whether tests of the GPU backend can run, and the device that they run on.

use palpate_gpu::{Choice, Gpu};
use std::sync::Arc;

/// The adapter that the environment chooses, opened; none where [`there_is_one`] says that a test is skipped.
pub fn device() -> Option<Arc<Gpu>> {
    there_is_one().then(|| Gpu::open(&Choice::from_env()).unwrap_or_else(|e| panic!("{e}")))
}

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
