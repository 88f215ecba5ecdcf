//! The new tangent from the solved increment δ, column call.extra of the solve: du₁ = du + Δt dv + δ, dv₁ = dv + δ/(θΔt).
// use shared/grid

var<storage, read> tangent: array<vec4<f32>>;
// The solution of a solve comes first.
var<storage, read> solving: array<vec4<f32>>;
var<storage, read_write> tangent_next: array<vec4<f32>>;

@compute @workgroup_size(64)
fn land_tangent(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let a = at_node(p.member, p.item);
    let v = part(1u) + a;
    let solved = solving[at_node(call.extra * shape.members + p.member, p.item)];
    tangent_next[a] = tangent[a] + shape.dt * tangent[v] + solved;
    tangent_next[v] = tangent[v] + solved / (shape.theta * shape.dt);
}
