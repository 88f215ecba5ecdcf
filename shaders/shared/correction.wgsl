//! What the second level of the preconditioner answers to forces and torques on groups.
// use shared/coarse

// [kinds of stages][B]: which C, and a factor.
var<batch> coarse_choices: array<vec2<f32>>;
// Blocks of C as [which][source][9][target], so that neighbouring lanes read neighbouring numbers: the columns of a block without their last two
// numbers, then these.
var<storage, read> coarse: array<vec4<f32>>;

// Adds what a wrench on group `source` does to group `target_group`.
fn add_motion(sum: Motion, which: u32, source: u32, target_group: u32, w: Wrench) -> Motion {
    let at = (which * shape.groups + source) * 9u * shape.groups + target_group;
    let g = shape.groups;
    var m = sum;
    m.upper += coarse[at] * w.force.x + coarse[at + g] * w.force.y + coarse[at + 2u * g] * w.force.z
        + coarse[at + 3u * g] * w.torque.x + coarse[at + 4u * g] * w.torque.y + coarse[at + 5u * g] * w.torque.z;
    let first = coarse[at + 6u * g];
    let second = coarse[at + 7u * g];
    let third = coarse[at + 8u * g];
    m.lower += vec4(first.xy * w.force.x + first.zw * w.force.y + second.xy * w.force.z
        + second.zw * w.torque.x + third.xy * w.torque.y + third.zw * w.torque.z, 0.0, 0.0);
    return m;
}

fn motion_of(sum: Motion, factor: f32) -> Wrench {
    return Wrench(factor * sum.upper.xyz, factor * vec3(sum.upper.w, sum.lower.xy));
}

fn coarse_choice(home: u32) -> vec2<f32> {
    return coarse_choices[shape.coarse_kind * shape.members + home];
}
