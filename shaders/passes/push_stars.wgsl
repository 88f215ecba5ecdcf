//! Change of the residual penalty's force along a direction: by the modulus of each star and Poisson's ratio.
// use shared/braces
// use shared/rates
// use shared/grid

// Elastic points, then patches, that have the node: stencil and entry; and where the points end.
var<body> elastic_rows: array<u32>;
var<body> elastic_list: array<vec2<u32>>;
var<body> star_ends: array<u32>;
var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read_write> forces: array<vec4<f32>>;

// How far apart two nodes have moved, in the mean of both states.
fn apart(mix: Mix, a: u32, b: u32) -> vec3<f32> {
    let fresh = (next[a].xyz - next[b].xyz) + (next[part(1u) + a].xyz - next[part(1u) + b].xyz);
    let old = (now[a].xyz - now[b].xyz) + (now[part(1u) + a].xyz - now[part(1u) + b].xyz);
    return mix.fresh * fresh + mix.old * old;
}

@compute @workgroup_size(64)
fn push_stars(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    let a = at_node(p.member, p.item);
    var force = vec3(0.0);
    for (var k = elastic_rows[p.item]; k < star_ends[p.item]; k++) {
        let at = elastic_list[k];
        var sum = vec3(0.0);
        for (var c = stencil_rows[at.x]; c < end_of_star(at.x); c++) {
            sum += brace_at(at.x, at.y, c) * apart(mix, at_node(p.member, stencil_entries[c].node), a);
        }
        var scale = young_rate(m, p.member, at.x) * m.lame.y;
        if with_rate(WITH_POISSON) {
            scale += young_at(m, p.member, at.x) * m.lame.w * rates[p.member].poisson;
        }
        force += scale * sum;
    }
    forces[a] += vec4(force, 0.0);
}
