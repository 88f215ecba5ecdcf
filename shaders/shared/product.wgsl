//! What both kinds of product add to the elastic part of q = A p at a node: inertia, point masses.
// use shared/inertia

fn heavy_row(m: Member, inertia: f32, member: u32, node: u32) -> vec3<f32> {
    var q = (inertia * node_mass(m, member, node)) * cg_along[at_node(member, node)].xyz;
    for (var s = 0u; s < shape.masses; s++) {
        let corner = mass_corner(s, node);
        if corner < 8u {
            var x = vec3(0.0);
            for (var j = 0u; j < 8u; j++) {
                x += mass_sites[s].weights[j] * cg_along[at_node(member, mass_sites[s].nodes[j])].xyz;
            }
            q += (inertia * mass_values[member * shape.masses + s] * mass_sites[s].weights[corner]) * x;
        }
    }
    return q;
}
