//! Runs a loop with the widest vector instructions of this processor.

/// Calls `f` compiled for the processor at hand (AVX2 on x86, else the baseline). Multiplications and additions are not fused, so
/// the order of operations written down decides the bits, not the processor. What `f` calls must be inlined to profit.
#[inline(always)]
pub fn wide<R>(f: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(f)
}
