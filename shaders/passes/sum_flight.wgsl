//! Right-hand side of a tangent's increment beyond free flight, first half: −S (du + Δt dv). `probe` holds du + Δt dv.
// use shared/grid
// use shared/stiffness

var<storage, read_write> rhs: array<vec4<f32>>;

@compute @workgroup_size(64)
fn sum_flight(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    rhs[at_node(p.member, p.item)] = vec4(-stiffness_row(p.member, p.item), 0.0);
}
