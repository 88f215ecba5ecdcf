//! Adds the strain of every elastic point in one of the past states, times its weight, which call.extra has the bits of.
// use shared/elastic

var<storage, read_write> past_strains: array<vec4<f32>>;

@compute @workgroup_size(64)
fn strain_elastic(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elastic, 64u);
    if !p.live {
        return;
    }
    let g = green(gradient_now(p.member, p.item)) * bitcast<f32>(call.extra);
    let at = 2u * (p.member * shape.elastic + p.item);
    past_strains[at] += vec4(g[0].x, g[1].y, g[2].z, 0.0);
    past_strains[at + 1u] += vec4(g[1].z, g[2].x, g[0].y, 0.0);
}
