//! Second half: −T du, `probe` holds du; and the column −∂r/∂p, unless call.extra is 1: of several past states the first brings it. In a static
//! problem there is the column alone.
// use shared/old_row

var<storage, read> column: array<vec4<f32>>;
var<storage, read_write> rhs: array<vec4<f32>>;

@compute @workgroup_size(64)
fn sum_old(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
           @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let a = at_node(p.member, p.item);
    var r = select(-column[a], vec4(0.0), call.extra != 0u);
    if call.mode != 0u {
        let m = members[p.member];
        r += rhs[a] - vec4(old_row(p.member, p.item, m, mix_of(m)), 0.0);
    }
    rhs[a] = r;
}
