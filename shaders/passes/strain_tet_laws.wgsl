//! Adds the mean strain of every element in one of the past states, times its weight, which call.extra has the bits of.
// use effects/tets

var<storage, read_write> stretches: array<vec4<f32>>;

@compute @workgroup_size(64)
fn strain_tet_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elements, 64u);
    if !p.live {
        return;
    }
    let e = stretch_at(gradient_now(p.member, mean_point(p.item))).strain * bitcast<f32>(call.extra);
    let at = 2u * (p.member * shape.elements + p.item);
    stretches[at] += vec4(e[0].x, e[1].y, e[2].z, 0.0);
    stretches[at + 1u] += vec4(e[1].z, e[2].x, e[0].y, 0.0);
}
