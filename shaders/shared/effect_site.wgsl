//! An effect in the tables of kernels, and the parameters of all effects.

struct EffectSite { // mirrored
    // Number of the law, and where it acts.
    law: u32,
    site: u32,
    // Its parameters: the first of a member, and how many.
    first: u32,
    count: u32,
    // Rows of `effect_measures`: the nodes' measures, and their derivatives by the parameters (or NONE).
    measures: u32,
    slopes: u32,
    // Parameters of all effects, and rows of `effect_measures`, of a member.
    stride: u32,
    rows: u32,
}

// [B][stride].
var<batch> effect_values: array<f32>;
