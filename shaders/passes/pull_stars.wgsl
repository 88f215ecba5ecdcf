//! Derivatives by what scales the residual penalty of every star: its modulus, Poisson's ratio, numbers of changes in time. Rows of sums are those of
//! pull_elastic.
// use shared/braces
// use shared/grid
// use shared/pulls

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> probe: array<vec4<f32>>;
var<storage, read_write> elastic_pulls: array<f32>;
var<storage, read_write> elastic_sums: array<f32>;

@compute @workgroup_size(64)
fn pull_stars(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elastic, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    let o = at_node(p.member, stencil_entries[stencil_rows[p.item]].node);
    var form = 0.0;
    for (var c = stencil_rows[p.item]; c < end_of_star(p.item); c++) {
        let b = at_node(p.member, stencil_entries[c].node);
        let fresh = (next[b].xyz - next[o].xyz) + (next[part(1u) + b].xyz - next[part(1u) + o].xyz);
        let old = (now[b].xyz - now[o].xyz) + (now[part(1u) + b].xyz - now[part(1u) + o].xyz);
        let moved = mix.fresh * fresh + mix.old * old;
        for (var r = stencil_rows[p.item]; r < end_of_star(p.item); r++) {
            let z = probe[at_node(p.member, stencil_entries[r].node)].xyz - probe[o].xyz;
            form += brace_at(p.item, r, c) * dot(z, moved);
        }
    }
    let young = young_at(m, p.member, p.item);
    elastic_pulls[p.member * shape.elastic + p.item] -= unvaried(m, p.member) * m.lame.y * form;
    elastic_sums[row_at(0u, p.member, p.item, shape.elastic, 1u)] -= young * m.lame.w * form;
    for (var row = 0u; row < shape.aging_rows; row++) {
        let slope = aging_at(p.member, 1u + row) / aging_at(p.member, 0u);
        elastic_sums[row_at(CELL_ROWS + row, p.member, p.item, shape.elastic, 1u)] -= slope * young * m.lame.y * form;
    }
}
