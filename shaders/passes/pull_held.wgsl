//! Derivatives by what acts through nodes that are held: the time of the start, the stiffness of the layers, changes of it in time, numbers of
//! effects on clamps.
// use shared/held_slopes

var<storage, read> probe: array<vec4<f32>>;
// [HELD_ROWS + aging + poses + layers][B][workgroups]: by the start, by the logarithm of the modulus and by Poisson's ratio first.
var<storage, read_write> held_sums: array<f32>;

// Takes what a row's coefficient changes of the balance from its sum.
fn take(local: u32, p: Place, row: u32, by: f32) {
    let sum = sum64(local, vec4(by, 0.0, 0.0, 0.0)).x;
    if local == 0u && p.live {
        held_sums[row_at(row, p.member, p.item, shape.nodes, 64u)] -= sum;
    }
}

@compute @workgroup_size(64)
fn pull_held(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    let node = min(p.item, shape.nodes - 1u);
    let m = members[p.member];
    var z = vec3(0.0);
    if p.live {
        z = probe[at_node(p.member, node)].xyz;
    }
    take(local, p, 0u, -dot(z, pull_rate(m, p.member, node)));
    if (shape.fields & FIELD_GRIPS) == 0u {
        return;
    }
    let by = by_layer(m, p.member, node);
    let firm = dot(z, by.firm);
    take(local, p, 1u, firm);
    take(local, p, 2u, firm_by_poisson(m) * firm);
    for (var row = 0u; row < shape.aging_rows; row++) {
        take(local, p, HELD_ROWS + row, firm * aging_at(p.member, 1u + row) / aging_at(p.member, 0u));
    }
    let poses = pose_rows();
    let matrices = layer_rows();
    for (var row = 0u; row < poses; row++) {
        take(local, p, HELD_ROWS + shape.aging_rows + row, dot(z, by_pose(m, p.member, node, row)));
    }
    for (var row = 0u; row < matrices; row++) {
        let slope = layers[(1u + row) * shape.members + p.member];
        take(local, p, HELD_ROWS + shape.aging_rows + poses + row, slope * dot(z, by.thickness));
    }
}
