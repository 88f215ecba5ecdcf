//! Twin of palpate-model/src/effects/transverse_anisotropy.rs.

fn transverse_anisotropy(which: u32) -> Dual {
    if which != ENERGY_PART {
        return number(0.0);
    }
    let f = Three(param(1u), param(2u), param(3u));
    let image = Three(
        dot3(Three(strain(0u), strain(5u), strain(4u)), f),
        dot3(Three(strain(5u), strain(1u), strain(3u)), f),
        dot3(Three(strain(4u), strain(3u), strain(2u)), f),
    );
    let stretch = mul(dot3(f, image), reciprocal(dot3(f, f)));
    return 0.5 * mul(param(0u), mul(stretch, stretch));
}
