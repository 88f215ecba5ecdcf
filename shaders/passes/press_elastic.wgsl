//! Stress of every elastic point times its volume, by columns, with its energy; of the new state, damping included, or of the old one
//! (shared/elastic_asks).
// use shared/elastic
// use shared/viscous
// use shared/elastic_asks

var<storage, read_write> elastic_stress: array<vec4<f32>>;

@compute @workgroup_size(64)
fn press_elastic(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elastic, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    let lame = lame_at(m, p.item).xy;
    // One call of the material for both states: kernels compile as long as materials take.
    let old = call.extra == STRESS_OLD;
    let h = gradient_of(p.member, p.item, old);
    let weight = select(mix.fresh, mix.old, old);
    var stress = mat3x3<f32>();
    var energy = 0.0;
    if weight != 0.0 {
        let r = stress_at(h, lame);
        stress = r.stress * weight;
        energy = r.energy * weight;
    }
    // What no modulus scales.
    var flow: Flow;
    var flowing = mat3x3<f32>();
    if old {
        energy = 0.0;
    } else {
        stress += viscous(p.member, p.item, h, lame) * mix.rate;
        if mix.rate != 0.0 {
            let g = strained(p.member, p.item, h);
            energy += 0.5 * mix.rate * contract(g, linear_stress(g, lame));
        }
        flow = flow_at(m, p.member, p.item, h);
        flowing = (identity3() + h) * flow.stress * volume_at(p.member, p.item);
    }
    let scale = young_at(m, p.member, element_of(p.item)) * volume_at(p.member, p.item);
    let at = stress_place(p.member, p.item);
    elastic_stress[at] = vec4(scale * stress[0] + flowing[0], scale * energy + volume_at(p.member, p.item) * flow.energy);
    elastic_stress[at + 1u] = vec4(scale * stress[1] + flowing[1], 0.0);
    elastic_stress[at + 2u] = vec4(scale * stress[2] + flowing[2], 0.0);
}
