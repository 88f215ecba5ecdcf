//! Asks one law about given points, for its comparison with its twin: probe k of `probes` has its place (measure, width, rate,
//! inertia, momentum, rest position), input, a change of the input and a vector, and gets force, energy, second derivative,
//! derivative along the change and the transpose. call.extra is the law, call.roster the number of its parameters, call.step the
//! number of probes.
// use effects/points

var<storage, read> probes: array<f32>;
// [probes][6].
var<storage, read_write> answers: array<vec4<f32>>;

@compute @workgroup_size(64)
fn probe_law(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= call.step {
        return;
    }
    let at = id.x * (11u + 2u * INPUTS);
    spot.width = probes[at + 1u];
    spot.rate = probes[at + 2u];
    spot.inertia = probes[at + 3u];
    spot.momentum = probes[at + 4u];
    let origin = vec3(probes[at + 5u], probes[at + 6u], probes[at + 7u]);
    let input = at + 11u;
    let x = vec3(probes[input], probes[input + 1u], probes[input + 2u]);
    let old = vec3(probes[input + OLD_AT], probes[input + OLD_AT + 1u], probes[input + OLD_AT + 2u]);
    place_point(origin, x - origin, vec3(0.0), old - origin, vec3(0.0), vec3(0.0));
    inputs = INPUTS;
    for (var i = 0u; i < inputs; i++) {
        z[i] = number(probes[input + i]);
        change[i] = probes[input + INPUTS + i];
    }
    let weight = vec3(probes[at + 8u], probes[at + 9u], probes[at + 10u]);
    measure = number(probes[at]);
    for (var what = FORCE; what < 4u; what++) {
        let r = respond(call.extra, what, weight);
        switch what {
            case FORCE: { answers[6u * id.x] = r.a; }
            case STIFFNESS: {
                answers[6u * id.x + 1u] = vec4(r.b.xyz, r.c.x);
                answers[6u * id.x + 2u] = vec4(r.c.yz, 0.0, 0.0);
            }
            case BY_OLD: { answers[6u * id.x + 3u] = r.a; }
            default: {
                answers[6u * id.x + 4u] = r.a;
                answers[6u * id.x + 5u] = r.b;
            }
        }
    }
}
