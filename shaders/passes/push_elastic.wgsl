//! Change of the stress of elastic points along a direction: by the modulus of each, Poisson's ratio, stiffness damping and viscosity.
// use shared/elastic_way
// use shared/rates

var<storage, read_write> elastic_stress: array<vec4<f32>>;

@compute @workgroup_size(64)
fn push_elastic(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elastic, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let way = elastic_way(p.member, p.item, m, mix_of(m));
    let young = young_at(m, p.member, element_of(p.item));
    var stress = way.stress * young_rate(m, p.member, element_of(p.item));
    if with_rate(WITH_POISSON) {
        stress += way.by_poisson * (young * rates[p.member].poisson);
    }
    if call.mode != 0u {
        stress += way.viscous * (young * rates[p.member].stiffness_damping / shape.dt);
    }
    let flow = rates[p.member].viscosity;
    stress += way.by_coefficient * flow.x + way.by_exponent * flow.y;
    let at = stress_place(p.member, p.item);
    for (var c = 0u; c < 3u; c++) {
        elastic_stress[at + c] = vec4(volume_at(p.member, p.item) * stress[c], 0.0);
    }
}
