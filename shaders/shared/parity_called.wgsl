//! Whether an iteration is odd, as the call says.
// use shared/asks

fn parity() -> u32 {
    return call.extra & ODD;
}
