//! Sums over a workgroup of 64, always in the same order.

const TEAM = 64u;

var<workgroup> shares: array<vec4<f32>, 64>;

fn total(local: u32, v: vec4<f32>) -> vec4<f32> {
    workgroupBarrier();
    shares[local] = v;
    workgroupBarrier();
    for (var s = 32u; s > 0u; s /= 2u) {
        if local < s {
            shares[local] += shares[local + s];
        }
        workgroupBarrier();
    }
    return workgroupUniformLoad(&shares[0]);
}
