//! Asks one material about given inputs, for its comparison with its twin: probe k of `probes` has H row by row, λ and μ, and a change of them
//! all, and gets value, derivatives by H and the change of these. call.extra is the material, call.step the number of probes.
// use shared/grid
// use materials/all

var<storage, read> probes: array<f32>;
// [probes][5].
var<storage, read_write> answers: array<vec4<f32>>;

const MATERIAL_INPUTS = 11u;

@compute @workgroup_size(64)
fn probe_material(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= call.step {
        return;
    }
    let at = id.x * 2u * MATERIAL_INPUTS;
    var found: array<f32, 20>;
    for (var k = 0u; k < 9u; k++) {
        var z: array<vec4<f32>, MATERIAL_INPUTS>;
        for (var i = 0u; i < MATERIAL_INPUTS; i++) {
            z[i] = vec4(probes[at + i], f32(i == k), probes[at + MATERIAL_INPUTS + i], 0.0);
        }
        let h = Gradient(Three(z[0], z[1], z[2]), Three(z[3], z[4], z[5]), Three(z[6], z[7], z[8]));
        let v = material_energy(call.extra, h, z[9], z[10]);
        found[0] = v.x;
        found[1u + k] = v.y;
        found[10u + k] = v.w;
    }
    for (var k = 0u; k < 5u; k++) {
        answers[5u * id.x + k] = vec4(found[4u * k], found[4u * k + 1u], found[4u * k + 2u], found[4u * k + 3u]);
    }
}
