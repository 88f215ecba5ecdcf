//! Force of the residual penalty on every node of a body of stars, added to what is there: call.extra as shared/brace_asks says.
// use shared/braces
// use shared/brace_asks
// use shared/grid

// Elastic points, then patches, that have the node: stencil and entry; and where the points end.
var<body> elastic_rows: array<u32>;
var<body> elastic_list: array<vec2<u32>>;
var<body> star_ends: array<u32>;
var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> probe: array<vec4<f32>>;
var<storage, read_write> forces: array<vec4<f32>>;

// How far apart two nodes have moved.
fn apart(a: u32, b: u32) -> vec3<f32> {
    switch call.extra & BRACE_OF {
        case BRACE_NEW: {
            return (next[a].xyz - next[b].xyz) + (next[part(1u) + a].xyz - next[part(1u) + b].xyz);
        }
        case BRACE_OLD: {
            return (now[a].xyz - now[b].xyz) + (now[part(1u) + a].xyz - now[part(1u) + b].xyz);
        }
        default: {
            return probe[a].xyz - probe[b].xyz;
        }
    }
}

@compute @workgroup_size(64)
fn brace_stars(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    let a = at_node(p.member, p.item);
    let share = select(mix.old, mix.fresh, (call.extra & BRACE_OF) == BRACE_NEW);
    var force = vec3(0.0);
    var energy = 0.0;
    for (var k = elastic_rows[p.item]; k < star_ends[p.item]; k++) {
        let at = elastic_list[k];
        var sum = vec3(0.0);
        for (var c = stencil_rows[at.x]; c < end_of_star(at.x); c++) {
            sum += brace_at(at.x, at.y, c) * apart(at_node(p.member, stencil_entries[c].node), a);
        }
        let star = at_node(p.member, stencil_entries[stencil_rows[at.x]].node);
        let scale = share * young_at(m, p.member, at.x) * m.lame.y;
        force += scale * sum;
        // Σ_a u_a · (A u)_a, counted from the star's own node.
        energy += 0.5 * scale * dot(apart(a, star), sum);
    }
    if (call.extra & BRACE_RESIDUAL) == 0u {
        forces[a] += vec4(select(1.0, -1.0, (call.extra & BRACE_MINUS) != 0u) * force, 0.0);
        return;
    }
    forces[a] += vec4(force, energy);
    forces[part(1u) + a] += vec4(force, abs(energy));
}
