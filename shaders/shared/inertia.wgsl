//! Lumped mass of the nodes, and point masses, each a stencil.
// use shared/stencil

var<storage, read> rest: array<vec4<f32>>;
// [B][masses] in kg.
var<storage, read> mass_values: array<f32>;
// [B][N], times the density; read only where effects vary it over the body.
var<storage, read> densities: array<f32>;

// Mass of the body's own node [kg]; the fourth component of a rest position is ∫ N.
fn node_mass(m: Member, member: u32, node: u32) -> f32 {
    if (shape.fields & FIELD_DENSITY) != 0u {
        return m.density * rest[node].w * densities[at_node(member, node)];
    }
    return m.density * rest[node].w;
}

fn mass_stencil(which: u32) -> u32 {
    return shape.first_mass + which;
}
