//! Asks one law of cells about given inputs, for its comparison with its twin: probe k of `probes` has 1/Δt, the input, and a change of
//! it, and gets value, derivatives by the scalars and the change of these. call.extra is the law, call.roster 0 for its energy and 1
//! for its dissipation, call.step the number of probes.
// use effects/cells

var<storage, read> probes: array<f32>;
// [probes][4].
var<storage, read_write> answers: array<vec4<f32>>;

@compute @workgroup_size(64)
fn probe_cell_law(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= call.step {
        return;
    }
    let at = id.x * (1u + 2u * CELL_INPUTS);
    step_rate = probes[at];
    for (var k = 0u; k < CELL_INPUTS; k++) {
        input[k] = number(probes[at + 1u + k]);
        along[k] = probes[at + 1u + CELL_INPUTS + k];
    }
    let r = ask_law(call.extra, call.roster, select(SCALARS, 1u, call.roster == LOSS_PART));
    let f = r.first;
    let b = r.bend;
    answers[4u * id.x] = vec4(r.value, f[0], f[1], f[2]);
    answers[4u * id.x + 1u] = vec4(f[3], f[4], f[5], f[6]);
    answers[4u * id.x + 2u] = vec4(b[0], b[1], b[2], b[3]);
    answers[4u * id.x + 3u] = vec4(b[4], b[5], b[6], 0.0);
}
