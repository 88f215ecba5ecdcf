//! Derivatives of a law of points by all its inputs: its own numbers, gravity, stiffness and time, and the numbers of a plane.
// use effects/points
// use shared/pulls

// [rows][B][workgroups]: own numbers, gravity, stiffness and time of every effect, then height and angles at every plane.
var<storage, read_write> point_sums: array<f32>;
// By own numbers, gravity, stiffness, time; all planes together.
var<private> by_input: array<f32, MOST + POINT_ROWS>;

fn is_sought(what: u32) -> bool {
    return (call.extra & (what << SEEK_AT)) != 0u;
}

// The second derivative of the potential along z in place and along a change of one input.
fn by_one(law: u32, at: u32, rate: f32) -> f32 {
    z[at].z = rate;
    let v = potential(law).w;
    z[at].z = 0.0;
    return v;
}

// The same along a change of the plane's normal.
fn by_normal(law: u32, rate: vec3<f32>) -> f32 {
    for (var i = 0u; i < 3u; i++) {
        z[PLANE_AT + i].z = rate[i];
    }
    let v = potential(law).w;
    for (var i = 0u; i < 3u; i++) {
        z[PLANE_AT + i].z = 0.0;
    }
    return v;
}

// The vector that derivatives are taken along, in place of all changes of the input.
fn aim(weight: vec3<f32>) {
    for (var i = 0u; i < INPUTS; i++) {
        z[i] = vec4(z[i].x, 0.0, 0.0, 0.0);
    }
    for (var i = 0u; i < 3u; i++) {
        z[i].y = weight[i];
    }
}

// Adds a point's derivatives by all but a plane's height and angles; `stiffness` is how a plane's own stiffness follows Young's modulus.
fn add_inputs(effect: EffectSite, stiffness: f32) {
    let slope = measure.z;
    measure = vec4(measure.x, 0.0, 0.0, 0.0);
    if is_sought(SEEK_OWN) {
        for (var i = 0u; i < MOST; i++) {
            if i < effect.count {
                by_input[i] += by_one(effect.law, COMMON + i, 1.0);
            }
        }
    }
    if is_sought(SEEK_GRAVITY) {
        for (var i = 0u; i < 3u; i++) {
            by_input[MOST + i] += by_one(effect.law, GRAVITY_AT + i, 1.0);
        }
    }
    if is_sought(SEEK_STIFFNESS) {
        z[PLANE_AT + 4u].z = stiffness;
        by_input[MOST + 3u] += by_one(effect.law, STIFFNESS_AT, DEFAULT_STIFFNESS / shape.element_size);
        z[PLANE_AT + 4u].z = 0.0;
    }
    if is_sought(SEEK_TIME) {
        by_input[MOST + 4u] += by_one(effect.law, TIME_AT, 1.0);
    }
    measure.z = slope;
}

// Takes a row's sum over the workgroup off.
fn take(local: u32, row: u32, live: bool, member: u32, group: u32, v: f32) {
    let sum = sum64(local, vec4(select(0.0, v, live), 0.0, 0.0, 0.0)).x;
    if local == 0u && live {
        point_sums[(((call.extra >> ROW_AT) + row) * shape.members + member) * shape.point_groups + group] -= sum;
    }
}

// Takes everything off that add_inputs left.
fn take_inputs(local: u32, effect: EffectSite, live: bool, member: u32, group: u32) {
    for (var i = 0u; i < MOST + POINT_ROWS; i++) {
        if i < effect.count || i >= MOST {
            let row = select(effect.count + i - MOST, i, i < effect.count);
            take(local, row, live, member, group, by_input[i]);
        }
    }
}
