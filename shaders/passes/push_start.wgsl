//! Tangent of the start along a direction: of the velocity and the spin, and of the stress-free shape that a body starts in.
// use shared/mix
// use shared/rates
// use shared/unstrained

var<body> rest: array<vec4<f32>>;
// [B][N]
var<rates> rate_rests: array<vec4<f32>>;
var<storage, read_write> tangent: array<vec4<f32>>;

@compute @workgroup_size(64)
fn push_start(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let a = at_node(p.member, p.item);
    let r = rates[p.member];
    var arm = rest[p.item].xyz - shape.pivot;
    var moved = vec3(0.0);
    if starts_unstrained() {
        arm += rests[a].xyz;
        if with_rate(WITH_RESTS) {
            moved = rate_rests[a].xyz;
        }
    }
    let v = r.velocity.xyz + cross(r.spin.xyz, arm) + cross(members[p.member].spin.xyz, moved);
    tangent[a] = vec4(moved, 0.0);
    tangent[part(1u) + a] = vec4(v, 0.0);
}
