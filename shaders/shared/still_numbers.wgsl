//! For passes in which the numbers of laws do not change.

fn number_along(member: u32, effect: EffectSite, i: u32) -> f32 {
    return 0.0;
}
