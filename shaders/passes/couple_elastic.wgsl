//! Derivative of the stress of elastic points by a past state, times the vector `probe` (ALONG), or its transpose; `now` is that state. Or, as that
//! state sees it, the stress-free shape in its place.
// use shared/elastic
// use shared/viscous
// use shared/asks

var<storage, read_write> elastic_stress: array<vec4<f32>>;

@compute @workgroup_size(64)
fn couple_elastic(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elastic, 64u);
    if !p.live {
        return;
    }
    let m = members[p.member];
    let mix = mix_of(m);
    let lame = lame_at(m, p.item).xy;
    var d = gradient_probe(p.member, p.item);
    let h0 = gradient_now(p.member, p.item);
    let f0 = identity3() + h0;
    let transposed = (call.extra & TRANSPOSED) != 0u;
    let of_shape = (call.extra & OF_SHAPE) != 0u;
    if of_shape && !transposed {
        d = f0 * d * -1.0;
    }
    let h1 = gradient_next(p.member, p.item);
    let f1 = identity3() + h1;
    let flow = flow_at(m, p.member, p.item, h1);
    var stress = mat3x3<f32>();
    var flowing = mat3x3<f32>();
    if !transposed {
        let dg = green_rate(f0, d);
        stress = f1 * linear_stress(dg, lame);
        flowing = f1 * flow_rate(flow, dg);
    } else {
        let dg = green_rate(f1, d);
        stress = f0 * linear_stress(dg, lame);
        flowing = f0 * flow_rate(flow, dg);
    }
    stress *= -mix.rate;
    if mix.old != 0.0 {
        stress += respond_at(h0, d, lame, vec2(0.0)).change * mix.old;
    }
    let scale = young_at(m, p.member, element_of(p.item)) * volume_at(p.member, p.item);
    var change = stress * scale - flowing * volume_at(p.member, p.item);
    if of_shape && transposed {
        change = transpose(f0) * change * -1.0;
    }
    let at = stress_place(p.member, p.item);
    for (var c = 0u; c < 3u; c++) {
        elastic_stress[at + c] = vec4(change[c], 0.0);
    }
}
