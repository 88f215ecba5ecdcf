//! Derivatives by the density of every tetrahedron or star: z · M a over the density, M its mass matrix. The point that has the element's mean knows its nodes.
// use shared/mix
// use shared/stencil
// use shared/motion
// use shared/braces

// [m³]
var<body> elastic_volumes: array<f32>;
// [n][n]: entries of an element's mass matrix over its mass.
var<body> mass_shares: array<f32>;
var<storage, read> probe: array<vec4<f32>>;
// [B][points]; zero but for means.
var<storage, read_write> density_pulls: array<f32>;

@compute @workgroup_size(64)
fn pull_densities(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elastic, 64u);
    if !p.live || p.item % shape.per_element != shape.per_element - 1u {
        return;
    }
    let m = members[p.member];
    let first = stencil_rows[p.item];
    // A star's own node, which is its first, has all of its mass.
    let count = select(stencil_rows[p.item + 1u] - first, 1u, has_stars());
    var by = 0.0;
    for (var j = stencil_rows[p.item]; j < stencil_rows[p.item + 1u]; j++) {
        if j - first >= count {
            break;
        }
        let node = stencil_entries[j].node;
        var pull = acceleration(p.member, node, m);
        if call.mode != 0u {
            pull += m.mass_damping * speed(p.member, node);
        }
        for (var i = stencil_rows[p.item]; i < stencil_rows[p.item + 1u]; i++) {
            if i - first >= count {
                break;
            }
            let z = probe[at_node(p.member, stencil_entries[i].node)].xyz;
            by += mass_shares[(i - first) * count + j - first] * dot(z, pull);
        }
    }
    density_pulls[p.member * shape.elastic + p.item] -= elastic_volumes[p.item] * by;
}
