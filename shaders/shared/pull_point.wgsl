//! Derivatives of a law of points by all its inputs: its own numbers, gravity, stiffness and time, and the numbers of a plane. One call of the law
//! serves them all, and the host adds the points up: with calls and barriers by the dozen, software adapters compile for minutes.
// use shared/points
// use shared/pulls

// [rows][B][points]: own numbers, gravity, stiffness and time of every effect, then height and angles at every plane.
var<storage, read_write> point_sums: array<f32>;

// As press_nodes has them.
var<batch> effect_measures: array<f32>;

fn is_sought(what: u32) -> bool {
    return (call.extra & (what << SEEK_AT)) != 0u;
}

// The vector that derivatives are taken along, in place of all changes of the input.
fn aim(weight: vec3<f32>) {
    for (var i = 0u; i < inputs; i++) {
        z[i] = vec4(z[i].x, 0.0, 0.0, 0.0);
    }
    for (var i = 0u; i < 3u; i++) {
        z[i].y = weight[i];
    }
}

// What inputs change beside themselves: a node's measure with an own number, a plane's stiffness with Young's modulus, its normal with its angles.
struct Beside {
    measures: u32,
    stiffness: f32,
    by_theta: vec3<f32>,
    by_phi: vec3<f32>,
}

// Whether input i is sought: own numbers, then gravity, stiffness, time, then a plane's height and angles.
fn wants(effect: EffectSite, i: u32) -> bool {
    if i < effect.count {
        return is_sought(SEEK_OWN);
    }
    switch i - effect.count {
        case 0u, 1u, 2u: { return is_sought(SEEK_GRAVITY); }
        case 3u: { return is_sought(SEEK_STIFFNESS); }
        case 4u: { return is_sought(SEEK_TIME); }
        default: { return effect.site == AT_CONTACT && is_sought(SEEK_PLANES); }
    }
}

// Changes the input, and what goes with it, with number i at this rate.
fn vary(effect: EffectSite, beside: Beside, i: u32, rate: f32) {
    if i < effect.count {
        z[COMMON + i].z = rate;
        if beside.measures != NONE {
            measure.z = rate * effect_measures[beside.measures + i * shape.nodes];
        }
        return;
    }
    let k = i - effect.count;
    switch k {
        case 0u, 1u, 2u: { z[GRAVITY_AT + k].z = rate; }
        case 3u: {
            z[STIFFNESS_AT].z = rate * DEFAULT_STIFFNESS / shape.element_size;
            z[PLANE_AT + 4u].z = rate * beside.stiffness;
        }
        case 4u: { z[TIME_AT].z = rate; }
        case 5u: { z[PLANE_AT + 3u].z = rate; }
        default: {
            let turned = select(beside.by_phi, beside.by_theta, k == POINT_ROWS + 1u);
            for (var axis = 0u; axis < 3u; axis++) {
                z[PLANE_AT + axis].z = rate * turned[axis];
            }
        }
    }
}

// Takes off what a point says at plane `plane`.
fn take_inputs(effect: EffectSite, beside: Beside, plane: u32, member: u32, point: u32) {
    for (var i = 0u; i < effect.count + POINT_ROWS + PLANE_ROWS; i++) {
        if wants(effect, i) {
            vary(effect, beside, i, 1.0);
            let by = potential(effect.law).w;
            vary(effect, beside, i, 0.0);
            let row = (call.extra >> ROW_AT) + i + select(0u, PLANE_ROWS * plane, i >= effect.count + POINT_ROWS);
            point_sums[(row * shape.members + member) * shape.point_items + point] -= by;
        }
    }
}
