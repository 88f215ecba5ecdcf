//! Adds the change of the stress of laws of cells along a direction to what push_elastic left.
// use shared/tet_question
// use shared/rates

var<storage, read_write> elastic_stress: array<vec4<f32>>;

fn number_along(member: u32, effect: EffectSite, i: u32) -> f32 {
    return rate_numbers[numbers_at(member) + shape.rate_effects + effect.first + i];
}

@compute @workgroup_size(64)
fn push_tet_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elements, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    let point = mean_point(p.item);
    let young = young_at(m, p.member, p.item);
    let rate = young_rate(m, p.member, p.item);
    var stress = mat3x3<f32>();
    for (var instant = 0u; instant < 2u; instant++) {
        let old = instant == 1u;
        let a = stretch_at(gradient_of(p.member, point, old));
        var q = question_of(p.member, p.item, mix, a, old);
        if with_rate(WITH_POISSON) {
            q.poisson = rates[p.member].poisson;
        }
        let said = ask_laws(m, p.member, q);
        stress += stress_back(a, said.t * rate + said.change * young);
    }
    let at = stress_place(p.member, point);
    for (var c = 0u; c < 3u; c++) {
        elastic_stress[at + c] += vec4(volume_at(p.member, point) * stress[c], 0.0);
    }
}
