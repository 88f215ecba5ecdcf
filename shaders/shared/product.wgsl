//! What both kinds of product add to the elastic part of q = A p at a node: inertia, point masses.
// use shared/inertia

fn heavy_row(m: Member, inertia: f32, p: Place) -> vec3<f32> {
    var q = (inertia * node_mass(m, p.home, p.item)) * cg_along[at_node(p.member, p.item)].xyz;
    for (var s = 0u; s < shape.masses; s++) {
        let corner = mass_corner(s, p.item);
        if corner < 8u {
            var x = vec3(0.0);
            for (var j = 0u; j < 8u; j++) {
                x += mass_sites[s].weights[j] * cg_along[at_node(p.member, mass_sites[s].nodes[j])].xyz;
            }
            q += (inertia * mass_values[p.home * shape.masses + s] * mass_sites[s].weights[corner]) * x;
        }
    }
    return q;
}
