//! Adds what tangent_laws listed to the matrix that gather_matrix filled, block by block and in the same order.
// use shared/grid
// use shared/modes

var<batch> members: array<Member>;
var<body> cells: array<Cell>;
var<matrices> elements: array<f32>;
var<storage, read> tangents: array<vec4<f32>>;
var<storage, read> law_modes: array<vec4<f32>>;
var<body> place_rows: array<u32>;
var<body> places: array<u32>;
var<storage, read_write> values: array<f32>;

// a bᵀ.
fn outer(a: vec3<f32>, b: vec3<f32>) -> mat3x3<f32> {
    return mat3x3(a * b.x, a * b.y, a * b.z);
}

// A block of a class's matrix.
fn element_block(slot: u32, kind: u32, within: u32) -> mat3x3<f32> {
    let a = (slot * 2u * shape.classes + kind) * 576u + within;
    return mat3x3(
        vec3(elements[a], elements[a + 1u], elements[a + 2u]),
        vec3(elements[a + 24u], elements[a + 25u], elements[a + 26u]),
        vec3(elements[a + 48u], elements[a + 49u], elements[a + 50u]),
    );
}

@compute @workgroup_size(64)
fn gather_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.blocks, 64u);
    if !p.live {
        return;
    }
    let n = (shape.fields >> 8u) & 15u;
    let slot = members[p.member].slot;
    let flow_slot = u32(members[p.member].flow.z);
    var sum = mat3x3<f32>();
    for (var k = place_rows[p.item]; k < place_rows[p.item + 1u]; k++) {
        let e = places[k] / 64u;
        let i = (places[k] / 8u) % 8u;
        let j = places[k] % 8u;
        let turn = (p.member * shape.cells + e) * TANGENT_VECTORS;
        let r = mat3x3(tangents[turn].xyz, tangents[turn + 1u].xyz, tangents[turn + 2u].xyz);
        let at = mode_at(p.member, e, n);
        let head = law_modes[at];
        let within = 72u * j + 3u * i;
        sum += (r * element_block(slot, cells[e].kind, within) * transpose(r)) * head.x;
        if head.y != 0.0 {
            sum += (r * element_block(flow_slot, cells[e].kind, within) * transpose(r)) * head.y;
        }
        let here = corner_mode(at, n, i);
        let there = corner_mode(at, n, j);
        sum += outer(law_modes[here + n].xyz, head.z * law_modes[there + n].xyz);
        sum += outer(law_modes[here + n + 1u].xyz, head.w * law_modes[there + n + 1u].xyz);
        for (var row = 0u; row < 7u; row++) {
            if row >= n {
                break;
            }
            var along = vec3(0.0);
            for (var l = 0u; l < 7u; l++) {
                if l >= n {
                    break;
                }
                along += law_modes[row_mode(at, n, row) + l / 4u][l % 4u] * law_modes[there + l].xyz;
            }
            sum += outer(law_modes[here + row].xyz, along);
        }
    }
    let at = (p.member * shape.blocks + p.item) * 9u;
    for (var row = 0u; row < 3u; row++) {
        for (var column = 0u; column < 3u; column++) {
            values[at + 3u * row + column] += sum[column][row];
        }
    }
}
