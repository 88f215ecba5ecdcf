//! A product with the assembled matrix by one workgroup of 256.
// use shared/mix
// use shared/product

var<body> block_rows: array<u32>;
var<body> columns: array<u32>;
var<storage, read> values: array<f32>;

// A times the vector that was set; returns the one along the other.
fn multiply_alone(local: u32, p: Share) -> f32 {
    storageBarrier();
    workgroupBarrier();
    let m = members[p.home];
    let inertia = mix_of(m).inertia;
    var bend = vec4(0.0);
    for (var i = local; i < shape.nodes; i += 256u) {
        let a = at_node(p.member, i);
        var q = heavy_row(m, inertia, Place(p.member, p.home, i, true, true));
        for (var k = block_rows[i]; k < block_rows[i + 1u]; k++) {
            let x = operand_at(at_node(p.member, columns[k]));
            let v = (p.home * shape.blocks + k) * 9u;
            q += vec3(
                values[v] * x.x + values[v + 1u] * x.y + values[v + 2u] * x.z,
                values[v + 3u] * x.x + values[v + 4u] * x.y + values[v + 5u] * x.z,
                values[v + 6u] * x.x + values[v + 7u] * x.y + values[v + 8u] * x.z,
            );
            if has_mass_matrix() {
                q += (inertia * block_mass(m, p.home, k)) * x;
            }
        }
        solving[solving_part(IMAGE) + a] = vec4(q, 0.0);
        bend.x += dot(operand_at(a), q);
    }
    return total(local, bend).x;
}
