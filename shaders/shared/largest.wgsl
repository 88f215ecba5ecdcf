//! The largest number of a workgroup. Who asks has sums over it (`shared/totals`).

fn largest(local: u32, own: f32) -> f32 {
    workgroupBarrier();
    shares[local] = vec4(own);
    workgroupBarrier();
    for (var s = TEAM / 2u; s > 0u; s /= 2u) {
        if local < s {
            shares[local] = max(shares[local], shares[local + s]);
        }
        workgroupBarrier();
    }
    return workgroupUniformLoad(&shares[0]).x;
}
