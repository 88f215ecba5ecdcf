//! Adds what a past state sees of a change of the stress-free shape, which couple_elastic left, to what shape_elastic made; call.extra has the bits of the
//! state's weight.
// use shared/elastic

var<storage, read> elastic_stress: array<vec4<f32>>;
var<storage, read_write> shape_stress: array<vec4<f32>>;

@compute @workgroup_size(64)
fn shape_past(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elastic, 64u);
    if !p.live {
        return;
    }
    let at = stress_place(p.member, p.item);
    for (var c = 0u; c < 3u; c++) {
        shape_stress[at + c] += vec4(elastic_stress[at + c].xyz * bitcast<f32>(call.extra), 0.0);
    }
}
