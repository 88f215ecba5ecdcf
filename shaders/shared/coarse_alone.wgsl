//! The second level by one workgroup of 256: four lanes a group, 64 groups at a time.
// use shared/team_256
// use shared/totals
// use shared/precondition
// use shared/solving
// use shared/coarse

var<workgroup> more_shares: array<vec4<f32>, 256>;

// Sums over the four lanes of a group, for the first of them.
fn total_of_four(local: u32, first: vec4<f32>, second: vec4<f32>) -> Motion {
    workgroupBarrier();
    shares[local] = first;
    more_shares[local] = second;
    workgroupBarrier();
    let a = local - local % 4u;
    return Motion(shares[a] + shares[a + 1u] + shares[a + 2u] + shares[a + 3u],
                  more_shares[a] + more_shares[a + 1u] + more_shares[a + 2u] + more_shares[a + 3u]);
}

// Force and torque that the residual is to each group, as before the first iteration.
fn restrict_alone(local: u32, system: u32, home: u32) {
    storageBarrier();
    workgroupBarrier();
    for (var first = 0u; first < shape.groups; first += 64u) {
        let g = first + local / 4u;
        var force = vec4(0.0);
        var torque = vec4(0.0);
        if g < shape.groups {
            let turn = turn_of_group(home, g);
            for (var k = group_rows[g] + local % 4u; k < group_rows[g + 1u]; k += 4u) {
                let node = group_nodes[k];
                let w = wrench_of(turn, arms[node], solving[solving_part(REST) + at_node(system, node)].xyz);
                force += vec4(w.force, 0.0);
                torque += vec4(w.torque, 0.0);
            }
        }
        let sum = total_of_four(local, force, torque);
        if g < shape.groups && local % 4u == 0u {
            cg_sums[wrenches_at(system, 1u) + 2u * g] = sum.upper;
            cg_sums[wrenches_at(system, 1u) + 2u * g + 1u] = sum.lower;
        }
    }
    storageBarrier();
    workgroupBarrier();
}
