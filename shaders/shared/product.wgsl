//! What products add to the elastic part of a row of A: inertia, point masses.
// use shared/inertia
// use shared/operand

fn along_at(member: u32, stencil: u32) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var k = stencil_rows[stencil]; k < stencil_rows[stencil + 1u]; k++) {
        sum += stencil_entries[k].weight * operand_at(at_node(member, stencil_entries[k].node));
    }
    return sum;
}

// Adds what point masses give to a node's row.
fn with_masses(row: vec3<f32>, inertia: f32, member: u32, home: u32, node: u32) -> vec3<f32> {
    var q = row;
    for (var s = 0u; s < shape.masses; s++) {
        let entry = entry_of(mass_stencil(s), node);
        if entry != NONE {
            let x = along_at(member, mass_stencil(s));
            q += (inertia * mass_values[home * shape.masses + s] * stencil_entries[entry].weight) * x;
        }
    }
    return q;
}

fn heavy_row(m: Member, inertia: f32, p: Place) -> vec3<f32> {
    var own = vec3(0.0);
    // Of a mass matrix, what multiplies blocks has added it.
    if !has_mass_matrix() {
        own = (inertia * node_mass(m, p.home, p.item)) * operand_at(at_node(p.member, p.item));
    }
    return with_masses(own, inertia, p.member, p.home, p.item);
}
