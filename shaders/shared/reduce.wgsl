//! Sums over a look in a fixed order: every lane over its items, then a tree over the 64 lanes, then over the workgroups' parts.

// Most workgroups that share a sum.
const PARTS = 256u;
// [slots][PARTS]
var<storage, read_write> partials: array<vec4<f32>>;
var<workgroup> parts: array<vec4<f32>, 64>;

// Sum over the workgroup, in lane 0. Every lane must call it.
fn tree(local: u32, v: vec4<f32>) -> vec4<f32> {
    parts[local] = v;
    workgroupBarrier();
    for (var step = 32u; step > 0u; step >>= 1u) {
        if local < step {
            parts[local] += parts[local + step];
        }
        workgroupBarrier();
    }
    return parts[0];
}
