//! Adds what elastic points and patches give to every 3 × 3 block of the matrix of a body without cells, in a fixed order, and mass damping.
// use shared/mix
// use shared/inertia
// use shared/elastic_asks
// use shared/unstrained
// use shared/braces

struct Pair { // mirrored
    // Both entries of a stencil that make the block.
    stencil: u32,
    row: u32,
    column: u32,
}

var<body> pair_rows: array<u32>;
var<body> pairs: array<Pair>;
var<storage, read> elastic_tangents: array<f32>;
var<storage, read> supports: array<vec4<f32>>;
var<storage, read_write> values: array<f32>;

// Σ_kl ∂P_ik/∂F_jl g_k g'_l.
fn elastic_block(member: u32, pair: Pair) -> mat3x3<f32> {
    let point = member * shape.elastic + pair.stencil;
    let here = weight_unstrained(point, stencil_gradients[pair.row].xyz);
    let there = weight_unstrained(point, stencil_gradients[pair.column].xyz);
    let start = point * TANGENT_NUMBERS;
    var block = mat3x3<f32>();
    for (var c = 0u; c < 9u; c++) {
        let at = start + 9u * c;
        let along = vec3(
            dot(vec3(elastic_tangents[at], elastic_tangents[at + 1u], elastic_tangents[at + 2u]), here),
            dot(vec3(elastic_tangents[at + 3u], elastic_tangents[at + 4u], elastic_tangents[at + 5u]), here),
            dot(vec3(elastic_tangents[at + 6u], elastic_tangents[at + 7u], elastic_tangents[at + 8u]), here),
        );
        block[c / 3u] += along * there[c % 3u];
    }
    return block;
}

@compute @workgroup_size(64)
fn gather_elastic(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.blocks, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    var sum = mat3x3<f32>();
    var braced = 0.0;
    for (var k = pair_rows[p.item]; k < pair_rows[p.item + 1u]; k++) {
        let pair = pairs[k];
        if pair.stencil < shape.elastic {
            sum += elastic_block(p.member, pair);
            if has_stars() {
                braced += young_at(m, p.member, pair.stencil) * m.lame.y * brace_at(pair.stencil, pair.row, pair.column);
            }
        } else {
            let w = stencil_entries[pair.row].weight * stencil_entries[pair.column].weight;
            let s = 3u * (p.member * shape.patches + pair.stencil - shape.first_patch);
            let d = supports[s + 1u].xyz * w;
            let o = supports[s + 2u].xyz * w;
            sum += mat3x3(vec3(d.x, o.x, o.y), vec3(o.x, d.y, o.z), vec3(o.y, o.z, d.z));
        }
    }
    let diagonal = mix.drag * block_mass(m, p.member, p.item) + mix.fresh * braced;
    let at = (p.member * shape.blocks + p.item) * 9u;
    for (var row = 0u; row < 3u; row++) {
        for (var column = 0u; column < 3u; column++) {
            values[at + 3u * row + column] += sum[column][row] + select(0.0, diagonal, row == column);
        }
    }
}
