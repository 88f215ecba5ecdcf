//! Sums over a workgroup, always in the same order. Who asks says how wide it is: `shared/team_64` or `shared/team_256`.

var<workgroup> shares: array<vec4<f32>, TEAM>;

fn total(local: u32, v: vec4<f32>) -> vec4<f32> {
    workgroupBarrier();
    shares[local] = v;
    workgroupBarrier();
    for (var s = TEAM / 2u; s > 0u; s /= 2u) {
        if local < s {
            shares[local] += shares[local + s];
        }
        workgroupBarrier();
    }
    return workgroupUniformLoad(&shares[0]);
}
