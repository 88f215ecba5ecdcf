//! Sums the parts that `shared/node_parts` tells of, by a workgroup of 256.
// use shared/team_256
// use shared/totals
// use shared/node_parts

fn sum_nodes(local: u32, member: u32, which: u32) -> vec4<f32> {
    var sum = vec4(0.0);
    for (var i = local; i < node_shares(); i += 256u) {
        sum += node_parts[node_parts_at(member) + 2u * i + which];
    }
    return total(local, sum);
}
