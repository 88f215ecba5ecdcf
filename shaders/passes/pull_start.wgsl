//! Derivatives by the velocity and the spin of the start, and by the stress-free shape that a body starts in. `probe` is dJ/du and dJ/dv of the
//! start.
// use shared/mix
// use shared/unstrained
// use shared/pulls

var<body> rest: array<vec4<f32>>;
var<storage, read> probe: array<vec4<f32>>;
// [2][B][workgroups]: by velocity and by spin.
var<storage, read_write> velocity_sums: array<vec4<f32>>;
var<storage, read_write> rest_pulls: array<vec4<f32>>;

@compute @workgroup_size(64)
fn pull_start(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    var v = vec3(0.0);
    var spin = vec3(0.0);
    if p.live {
        let a = at_node(p.member, p.item);
        var arm = rest[p.item].xyz - shape.pivot;
        if starts_unstrained() {
            arm += rests[a].xyz;
        }
        v = probe[part(1u) + a].xyz;
        spin = cross(arm, v);
        if seeks(SEEK_REST) && starts_unstrained() {
            rest_pulls[a] += vec4(probe[a].xyz + cross(v, members[p.member].spin.xyz), 0.0);
        }
    }
    let by_velocity = sum64(local, vec4(v, 0.0));
    let by_spin = sum64(local, vec4(spin, 0.0));
    if local == 0u && p.live {
        velocity_sums[row_at(0u, p.member, p.item, shape.nodes, 64u)] += by_velocity;
        velocity_sums[row_at(1u, p.member, p.item, shape.nodes, 64u)] += by_spin;
    }
}
