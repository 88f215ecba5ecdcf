//! Fills the blocked matrix by gathering: every 3 × 3 block sums what its cells, patches, clamps, ghost lines and mass damping
//! give it, in a fixed order. Inertia is left out: products add it, so that a heavy body does not hide its stiffness.
// use shared/mix
// use shared/fields
// use shared/inertia
// use shared/tangents
// use shared/patches

var<body> cells: array<Cell>;
var<matrices> elements: array<f32>;
var<storage, read> supports: array<vec4<f32>>;
var<body> holds: array<vec2<u32>>;
var<matrices> hold_elements: array<f32>;
var<batch> poses: array<ClampPose>;
var<body> place_rows: array<u32>;
// 64 · cell + 8 · i + j.
var<body> places: array<u32>;
var<body> ghosts: array<f32>;
var<storage, read_write> values: array<f32>;

// Column by column, as (column, row) of a symmetric matrix.
fn element_block(start: u32, i: u32, j: u32) -> mat3x3<f32> {
    let a = start + 72u * j + 3u * i;
    return mat3x3(
        vec3(elements[a], elements[a + 1u], elements[a + 2u]),
        vec3(elements[a + 24u], elements[a + 25u], elements[a + 26u]),
        vec3(elements[a + 48u], elements[a + 49u], elements[a + 50u]),
    );
}

fn hold_block(start: u32, i: u32, j: u32) -> mat3x3<f32> {
    let a = start + 72u * j + 3u * i;
    return mat3x3(
        vec3(hold_elements[a], hold_elements[a + 1u], hold_elements[a + 2u]),
        vec3(hold_elements[a + 24u], hold_elements[a + 25u], hold_elements[a + 26u]),
        vec3(hold_elements[a + 48u], hold_elements[a + 49u], hold_elements[a + 50u]),
    );
}

fn sign_of(corner: u32) -> vec3<f32> {
    return vec3(f32(corner & 1u), f32((corner >> 1u) & 1u), f32((corner >> 2u) & 1u)) * 2.0 - vec3(1.0);
}

// R Ω_i = −R [b_i]× G⁻¹.
fn turned_omega(r: mat3x3<f32>, g: mat3x3<f32>, corner: u32) -> mat3x3<f32> {
    let b = sign_of(corner) * (-0.25 / shape.h);
    return r * (mat3x3(vec3(0.0, b.z, -b.y), vec3(-b.z, 0.0, b.x), vec3(b.y, -b.x, 0.0)) * g);
}

@compute @workgroup_size(64)
fn gather_matrix(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.blocks, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    var sum = mat3x3<f32>();
    var diagonal = m.young * m.ghost.x * mix.on_ghost * ghosts[p.item];
    var damped = 0.0;
    for (var k = place_rows[p.item]; k < place_rows[p.item + 1u]; k++) {
        let e = places[k] / 64u;
        let young = young_at(m, p.member, e);
        let i = (places[k] / 8u) % 8u;
        let j = places[k] % 8u;
        let at = (p.member * shape.cells + e) * TANGENT_VECTORS;
        let r = three(at);
        let g = three(at + 3u);
        let block = element_block((m.slot * 2u * shape.classes + cells[e].kind) * 576u, i, j);
        sum += (r * block * transpose(r)) * (mix.on_new * young);
        sum += turned_omega(r, g, i) * transpose(three(at + 6u + 3u * j));
        sum += three(at + 6u + 3u * i) * transpose(turned_omega(r, g, j));
        if has_guard(at) {
            sum += r * guard_block(at, sign_of(i), sign_of(j)) * transpose(r);
        }
        for (var h = cells[e].hold_start; h < cells[e].hold_end; h++) {
            var instant = 0u;
            if call.mode != 0u {
                instant = call.step + 1u;
            }
            let turn = poses[(p.member * (shape.steps + 1u) + instant) * shape.clamps + holds[h].y].turn;
            sum += (turn * hold_block(grip_at(m, p.member, 0u, h), i, j) * transpose(turn)) * (mix.fresh * young);
        }
        if shape.patches != 0u {
            for (var t = cells[e].patch_start; t < cells[e].patch_end; t++) {
                let w = corner_weight(t, i) * corner_weight(t, j);
                let s = 3u * (p.member * shape.patches + t);
                let d = supports[s + 1u].xyz * w;
                let o = supports[s + 2u].xyz * w;
                sum += mat3x3(vec3(d.x, o.x, o.y), vec3(o.x, d.y, o.z), vec3(o.y, o.z, d.z));
            }
        }
        if i == j {
            damped = mix.drag * node_mass(m, p.member, cells[e].nodes[i]);
        }
    }
    diagonal += damped;
    let at = (p.member * shape.blocks + p.item) * 9u;
    for (var row = 0u; row < 3u; row++) {
        for (var column = 0u; column < 3u; column++) {
            values[at + 3u * row + column] = sum[column][row] + select(0.0, diagonal, row == column);
        }
    }
}
