//! Product of the assembled matrix (inertia left out) with the vector `probe` at one node.

var<body> block_rows: array<u32>;
var<body> columns: array<u32>;
var<storage, read> values: array<f32>;
var<storage, read> probe: array<vec4<f32>>;

fn stiffness_row(member: u32, node: u32) -> vec3<f32> {
    var q = vec3(0.0);
    for (var k = block_rows[node]; k < block_rows[node + 1u]; k++) {
        let x = probe[at_node(member, columns[k])].xyz;
        let v = (member * shape.blocks + k) * 9u;
        q += vec3(
            values[v] * x.x + values[v + 1u] * x.y + values[v + 2u] * x.z,
            values[v + 3u] * x.x + values[v + 4u] * x.y + values[v + 5u] * x.z,
            values[v + 6u] * x.x + values[v + 7u] * x.y + values[v + 8u] * x.z,
        );
    }
    return q;
}
