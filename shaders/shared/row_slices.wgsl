//! A p with the assembled matrix of a slice by a workgroup of 256, eight lanes a row so that neighbouring lanes read neighbouring blocks.
// use shared/blocks
// use shared/slices

fn multiply_slice(local: u32, share: Share) {
    let p = node_of_slice(share, local);
    let m = members[p.home];
    let inertia = mix_of(m).inertia;
    var own = vec3(0.0);
    var q = vec3(0.0);
    if p.live {
        if local % 8u == 0u {
            own = heavy_row(m, inertia, p);
        }
        let end = block_rows[p.item + 1u];
        for (var k = block_rows[p.item] + local % 8u; k < end; k += 8u) {
            q = with_block(q, m, p, inertia, k);
        }
    }
    keep_product(local, share, p, own, q);
}
