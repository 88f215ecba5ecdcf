//! Mass of the body, and point masses, each a stencil. Cells have a lumped mass on each node; tetrahedra have the whole matrix, entry by entry of
//! the pattern of blocks.
// use shared/stencil

var<body> rest: array<vec4<f32>>;
// [B][masses] in kg.
var<batch> mass_values: array<f32>;
// Of cells [B][N], times the density; read only where effects vary it over the body. Of tetrahedra [B][blocks]: entries of the mass matrix over
// the density.
var<batch> densities: array<f32>;

fn has_mass_matrix() -> bool {
    return shape.elastic != 0u;
}

// Entry of the mass matrix [kg] at a block of the pattern.
fn block_mass(m: Member, member: u32, block: u32) -> f32 {
    return m.density * densities[member * shape.blocks + block];
}

// Mass of the body's own node [kg]; the fourth component of a rest position is its volume. Where there is a mass matrix, a measure of how heavy
// it is and no more.
fn node_mass(m: Member, member: u32, node: u32) -> f32 {
    if (shape.fields & FIELD_DENSITY) != 0u && !has_mass_matrix() {
        return m.density * rest[node].w * densities[at_node(member, node)];
    }
    return m.density * rest[node].w;
}

fn mass_stencil(which: u32) -> u32 {
    return shape.first_mass + which;
}
