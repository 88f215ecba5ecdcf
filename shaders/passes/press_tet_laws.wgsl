//! Adds the stress of laws of cells to that of every element's mean, which press_elastic left, and their energy: of the new state, or of the
//! old one, which call.extra says as there.
// use shared/tet_question
// use shared/still_numbers
// use shared/elastic_asks

var<storage, read_write> elastic_stress: array<vec4<f32>>;

@compute @workgroup_size(64)
fn press_tet_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elements, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    let point = mean_point(p.item);
    let old = call.extra == STRESS_OLD;
    let a = stretch_at(gradient_of(p.member, point, old));
    let q = question_of(p.member, p.item, mix, a, old);
    let said = ask_laws(m, p.member, q);
    let scale = young_at(m, p.member, p.item) * volume_at(p.member, point);
    let stress = stress_back(a, said.t) * scale;
    let at = stress_place(p.member, point);
    // Of the old state's force the potential is linear; gather_residual knows it.
    elastic_stress[at] += vec4(stress[0], select(scale * said.value, 0.0, old));
    elastic_stress[at + 1u] += vec4(stress[1], 0.0);
    elastic_stress[at + 2u] += vec4(stress[2], 0.0);
}
