//! What a change of the stress-free shape does to the forces of elastic points. With L the gradient of that change and Z that of an adjoint, both by places
//! of that shape, the stress P times its volume changes by tr(L) P + T (−F L) − P Lᵀ, T the tangent, and transposed Z gives
//! (P : Z) I − Zᵀ P − Fᵀ T Z (palpate-cpu/src/terms/unstrained.rs). call.extra says which and what part of it; `probe` has the change or the adjoint.
// use shared/elastic
// use shared/elastic_asks

var<storage, read> elastic_stress: array<vec4<f32>>;
var<storage, read> elastic_tangents: array<f32>;
// [B][points][3]: the sum of all parts, by columns.
var<storage, read_write> shape_stress: array<vec4<f32>>;

fn tangent_times(member: u32, point: u32, d: mat3x3<f32>) -> mat3x3<f32> {
    var sum = mat3x3<f32>();
    for (var column = 0u; column < 9u; column++) {
        let at = (member * shape.elastic + point) * TANGENT_NUMBERS + 9u * column;
        for (var row = 0u; row < 9u; row++) {
            sum[row % 3u][row / 3u] += elastic_tangents[at + row] * component(d, column);
        }
    }
    return sum;
}

@compute @workgroup_size(64)
fn shape_elastic(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.elastic, 64u);
    if !p.live {
        return;
    }
    let at = stress_place(p.member, p.item);
    let d = gradient_probe(p.member, p.item);
    let pulls = (call.extra & SHAPE_PULLS) != 0u;
    var sum = mat3x3<f32>();
    if (call.extra & SHAPE_TANGENT) != 0u {
        let f = identity3() + gradient_next(p.member, p.item);
        if pulls {
            sum = transpose(f) * tangent_times(p.member, p.item, d) * -1.0;
        } else {
            sum = tangent_times(p.member, p.item, f * d) * -1.0;
        }
    } else {
        let stress = mat3x3(elastic_stress[at].xyz, elastic_stress[at + 1u].xyz, elastic_stress[at + 2u].xyz);
        if pulls {
            sum = identity3() * contract(stress, d) - transpose(d) * stress;
        } else {
            sum = stress * trace3(d) - stress * transpose(d);
        }
    }
    for (var c = 0u; c < 3u; c++) {
        shape_stress[at + c] += vec4(sum[c], 0.0);
    }
}
