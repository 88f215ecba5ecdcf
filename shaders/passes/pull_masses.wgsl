//! Derivatives by the point masses of every member.
// use shared/mix
// use shared/inertia
// use shared/motion
// use shared/probed

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
        let z = probe_at(p.member, mass_stencil(s));
        let pull = acceleration_at(p.member, mass_stencil(s), m);
        mass_pulls[p.member * shape.masses + s] -= dot(z, pull);
    }
}
