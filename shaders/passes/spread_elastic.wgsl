//! What elastic points and surface patches do to every node of a body without cells, added to what the balance's other passes left there: bits
//! of call.extra as shared/elastic_asks says.
// use shared/grid
// use shared/stencil
// use shared/elastic_asks
// use shared/held
// use shared/unstrained

// Elastic points, then patches, that have the node: stencil and entry.
var<body> elastic_rows: array<u32>;
var<body> elastic_list: array<vec2<u32>>;
var<storage, read> elastic_stress: array<vec4<f32>>;
var<storage, read> supports: array<vec4<f32>>;
// A residual is as gather_residual has it.
var<storage, read_write> forces: array<vec4<f32>>;
// [B][N]: force of the clamps on nodes that they hold, where effects act on clamps.
var<storage, read_write> reactions: array<vec4<f32>>;

@compute @workgroup_size(64)
fn spread_elastic(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.nodes, 64u);
    if !p.live {
        return;
    }
    let a = at_node(p.member, p.item);
    var elastic = vec4(0.0);
    var support = vec4(0.0);
    for (var k = elastic_rows[p.item]; k < elastic_rows[p.item + 1u]; k++) {
        let at = elastic_list[k];
        let w = stencil_entries[at.y].weight;
        if at.x < shape.elastic {
            let s = 3u * (p.member * shape.elastic + at.x);
            let g = weight_unstrained(p.member * shape.elastic + at.x, stencil_gradients[at.y].xyz);
            let f = elastic_stress[s].xyz * g.x + elastic_stress[s + 1u].xyz * g.y + elastic_stress[s + 2u].xyz * g.z;
            elastic += vec4(f, w * elastic_stress[s].w);
        } else if (call.extra & SPREAD_PATCHES) != 0u {
            let t = supports[3u * (p.member * shape.patches + at.x - shape.first_patch)];
            support += vec4(-w * t.xyz, w * t.w);
        }
    }
    if (call.extra & SPREAD_RESIDUAL) == 0u {
        let sign = select(1.0, -1.0, (call.extra & SPREAD_MINUS) != 0u);
        forces[a] += vec4(sign * (elastic.xyz + support.xyz), 0.0);
        return;
    }
    let r = forces[a] + elastic + support;
    // A node that is held has no balance of its own: what is left is what its clamp bears.
    let held = is_held(p.member, p.item);
    if held && (shape.fields & FIELD_GRIPS) != 0u {
        reactions[a] = vec4(-r.xyz, 0.0);
    }
    forces[a] = vec4(select(r.xyz, vec3(0.0), held), r.w);
    forces[part(1u) + a] += vec4(elastic.xyz, abs(elastic.w) + abs(support.w));
    forces[part(2u) + a] += vec4(support.xyz, 0.0);
}
