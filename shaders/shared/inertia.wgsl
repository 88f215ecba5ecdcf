//! Lumped mass of the nodes, and point masses spread over the nodes of their cells.

var<storage, read> rest: array<vec4<f32>>;
var<storage, read> mass_sites: array<Mass>;
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

// Corner of a point mass at a node, or 8.
fn mass_corner(site: u32, node: u32) -> u32 {
    for (var i = 0u; i < 8u; i++) {
        if mass_sites[site].nodes[i] == node {
            return i;
        }
    }
    return 8u;
}
