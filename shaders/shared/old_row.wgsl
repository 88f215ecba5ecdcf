//! Derivative of the balance by the old displacement, inertia left out, times the vector `probe`, at one node: cells and clamps
//! from couple_old, the ghost penalty, mass damping.
// use shared/mix
// use shared/inertia
// use shared/stiffness

var<storage, read> cell_force: array<vec4<f32>>;
var<body> node_rows: array<u32>;
var<body> node_list: array<u32>;
var<body> ghosts: array<f32>;

fn old_row(member: u32, node: u32, m: Member, mix: Mix) -> vec3<f32> {
    var f = vec3(0.0);
    for (var k = node_rows[node]; k < node_rows[node + 1u]; k++) {
        f += cell_force[member * shape.cells * 8u + node_list[k]].xyz;
    }
    let z = probe[at_node(member, node)].xyz;
    if shape.ghosts != 0u {
        let scale = m.young * m.ghost.x * (mix.old - mix.rate);
        for (var k = block_rows[node]; k < block_rows[node + 1u]; k++) {
            f += (scale * ghosts[k]) * (probe[at_node(member, columns[k])].xyz - z);
        }
    }
    if has_mass_matrix() {
        for (var k = block_rows[node]; k < block_rows[node + 1u]; k++) {
            f -= (mix.drag * block_mass(m, member, k)) * probe[at_node(member, columns[k])].xyz;
        }
        return f;
    }
    return f - (mix.drag * node_mass(m, member, node)) * z;
}
