//! Derivatives by the point masses of every member.
// use shared/mix
// use shared/inertia
// use shared/motion

var<storage, read> probe: array<vec4<f32>>;
// [B][masses]
var<storage, read_write> mass_pulls: array<f32>;

@compute @workgroup_size(64)
fn pull_masses(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, 0u, 1u, 1u);
    if !p.runs {
        return;
    }
    let m = members[p.member];
    for (var s = local; s < shape.masses; s += 64u) {
        var z = vec3(0.0);
        var pull = vec3(0.0);
        for (var i = 0u; i < 8u; i++) {
            let node = mass_sites[s].nodes[i];
            z += mass_sites[s].weights[i] * probe[at_node(p.member, node)].xyz;
            pull += mass_sites[s].weights[i] * acceleration(p.member, node, m);
        }
        mass_pulls[p.member * shape.masses + s] -= dot(z, pull);
    }
}
