//! Cells, their element matrices, and how their corners read a state.
// use shared/pose
// use shared/fields

var<body> cells: array<Cell>;
var<matrices> elements: array<f32>;

// Where the matrix of a cell starts: [slot][K, dK/dν][class][24 · 24], for Young's modulus 1.
fn matrix_at(slot: u32, which: u32, kind: u32) -> u32 {
    return ((slot * 2u + which) * shape.classes + kind) * 576u;
}

// This corner's three rows of K v, v offered by all lanes.
fn stiff(at: u32, corner: u32, v: vec3<f32>) -> vec3<f32> {
    publish(v);
    var sum = vec3(0.0);
    for (var j = 0u; j < 8u; j++) {
        sum += block_at(at, corner, j) * published(j);
    }
    return sum;
}

// Block (i, j) of a symmetric 24 × 24 matrix; entry (row, column) is read as (column, row), so that lanes read side by side.
fn block_at(at: u32, i: u32, j: u32) -> mat3x3<f32> {
    let a = at + 72u * j + 3u * i;
    return mat3x3(
        vec3(elements[a], elements[a + 1u], elements[a + 2u]),
        vec3(elements[a + 24u], elements[a + 25u], elements[a + 26u]),
        vec3(elements[a + 48u], elements[a + 49u], elements[a + 50u]),
    );
}
