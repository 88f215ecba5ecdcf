//! Right-hand side of an adjoint solve: dJ/du + dJ/dv/(θΔt) at the new state; dJ/du alone in a static problem.
// use shared/grid

var<storage, read> adj: array<vec4<f32>>;
var<storage, read_write> rhs: array<vec4<f32>>;

@compute @workgroup_size(64)
fn form_rhs(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
            @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let a = at_node(p.member, p.item);
    var r = adj[a];
    if call.mode != 0u {
        r += adj[part(1u) + a] / (shape.theta * shape.dt);
    }
    rhs[a] = r;
}
