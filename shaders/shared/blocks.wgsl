//! Blocks of the assembled matrix, inertia included where it is a matrix of its own.
// use shared/mix
// use shared/product

var<body> block_rows: array<u32>;
var<body> columns: array<u32>;
var<storage, read> values: array<f32>;

// A row of the product with what block k gives to it.
fn with_block(row: vec3<f32>, m: Member, p: Place, inertia: f32, k: u32) -> vec3<f32> {
    let x = operand_at(at_node(p.member, columns[k]));
    let v = (p.home * shape.blocks + k) * 9u;
    var q = row + vec3(
        values[v] * x.x + values[v + 1u] * x.y + values[v + 2u] * x.z,
        values[v + 3u] * x.x + values[v + 4u] * x.y + values[v + 5u] * x.z,
        values[v + 6u] * x.x + values[v + 7u] * x.y + values[v + 8u] * x.z,
    );
    if has_mass_matrix() {
        q += (inertia * block_mass(m, p.home, k)) * x;
    }
    return q;
}
