//! Failures are found by bits: compilers may take it that no number is NaN or infinite, and then leave out comparisons that only such a
//! number would fail.

// True for a number that is neither infinite nor NaN: those have all bits of the exponent.
fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

fn all_finite(v: vec3<f32>) -> bool {
    return is_finite(v.x) && is_finite(v.y) && is_finite(v.z);
}
