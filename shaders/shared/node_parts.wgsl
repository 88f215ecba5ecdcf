//! Sums over the nodes of a member that one workgroup decides by: 64 nodes a workgroup leave their parts, two vectors each.

// [B][⌈N/64⌉][2].
var<storage, read_write> node_parts: array<vec4<f32>>;

fn node_shares() -> u32 {
    return (shape.nodes + 63u) / 64u;
}

// Where the parts of a member start.
fn node_parts_at(member: u32) -> u32 {
    return 2u * member * node_shares();
}

// Leaves one of the two vectors of a workgroup of 64 nodes.
fn keep_part(local: u32, share: Share, which: u32, whole: vec4<f32>) {
    if local == 0u {
        node_parts[node_parts_at(share.member) + 2u * (share.first / 64u) + which] = whole;
    }
}
