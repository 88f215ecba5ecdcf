//! Sums over a workgroup of 256, always in the same order.

const TEAM = 256u;

var<workgroup> shares: array<vec4<f32>, 256>;

fn total(local: u32, v: vec4<f32>) -> vec4<f32> {
    workgroupBarrier();
    shares[local] = v;
    workgroupBarrier();
    for (var s = 128u; s > 0u; s /= 2u) {
        if local < s {
            shares[local] += shares[local + s];
        }
        workgroupBarrier();
    }
    return workgroupUniformLoad(&shares[0]);
}
