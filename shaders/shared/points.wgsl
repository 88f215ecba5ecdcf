//! A point that an effect acts on (a node, or the middle of a surface patch), and the responses of the effect's potential. Twin of
//! palpate-model/src/effects/law.rs; the names and the order of the input are the same. Laws are the files of `effects/`; the
//! build script links them with `potential`, which calls the one of a number, and with the constants of the input.
// use shared/mix
// use shared/contact
// use shared/hyper
// use shared/asks
// use shared/effect_site
// use shared/rates

// Sites of an effect; laws of cells have tables of their own.
const AT_NODES = 0u;
const AT_SURFACE = 1u;
const AT_CONTACT = 2u;
const AT_CELLS = 3u;

// What is asked of a law: force and energy; its second derivative by x; the force's derivative along a change of the old state;
// the transpose of that; the force's change along a direction of parameters.
const FORCE = 0u;
const STIFFNESS = 1u;
const BY_OLD = 2u;
const BACK = 3u;
const COLUMN = 4u;

// In call.extra: number of the effect, and from this bit on the question.
const QUESTION_AT = 8u;

fn asked_effect() -> u32 {
    return extractBits(call.extra, 0u, QUESTION_AT);
}

fn asked_question() -> u32 {
    return call.extra >> QUESTION_AT;
}

var<body> effects: array<EffectSite>;

// The point, the same for all number types. Displacements are given as states have them: a large part and the rest.
struct Spot {
    origin: vec3<f32>,
    whole: vec3<f32>,
    rest: vec3<f32>,
    old_whole: vec3<f32>,
    old_rest: vec3<f32>,
    width: f32,
    rate: f32,
    inertia: f32,
    momentum: f32,
}

var<private> spot: Spot;
// The input, and the change of it that derivatives are taken along.
var<private> z: array<vec4<f32>, INPUTS>;
var<private> change: array<f32, INPUTS>;
// Volume, area or share.
var<private> measure: vec4<f32>;
// Entries of the input that the law at hand has. Loops over inputs go as far and no farther, which also keeps compilers from unrolling them.
var<private> inputs: u32;

fn three_of(at: u32) -> Three {
    return Three(z[at], z[at + 1u], z[at + 2u]);
}

// Parameter i, and three from i on.
fn param(i: u32) -> Dual {
    return z[COMMON + i];
}

fn vector(i: u32) -> Three {
    return three_of(COMMON + i);
}

fn velocity() -> Three {
    return three_of(VELOCITY_AT);
}

fn gravity() -> Three {
    return three_of(GRAVITY_AT);
}

fn normal() -> Three {
    return three_of(PLANE_AT);
}

fn with_value(a: Three, v: vec3<f32>) -> Three {
    return Three(vec4(v.x, a[0].yzw), vec4(v.y, a[1].yzw), vec4(v.z, a[2].yzw));
}

// Way of this step, x − old, without the cancellation of positions far from the origin.
fn way() -> Three {
    return with_value(sub3(three_of(0u), three_of(OLD_AT)), (spot.whole - spot.old_whole) + (spot.rest - spot.old_rest));
}

// Displacement of x and of the old position.
fn moved() -> Three {
    return with_value(three_of(0u), spot.whole + spot.rest);
}

fn old_moved() -> Three {
    return with_value(three_of(OLD_AT), spot.old_whole + spot.old_rest);
}

// Rest position minus a place.
fn origin_from(place: Three) -> Three {
    let o = spot.origin;
    return sub3(Three(number(o.x), number(o.y), number(o.z)), place);
}

// x − place.
fn x_from(place: Three) -> Three {
    let p = vec3(place[0].x, place[1].x, place[2].x);
    return with_value(sub3(three_of(0u), place), ((spot.origin - p) + spot.whole) + spot.rest);
}

// Old position − place.
fn old_from(place: Three) -> Three {
    let p = vec3(place[0].x, place[1].x, place[2].x);
    return with_value(sub3(three_of(OLD_AT), place), ((spot.origin - p) + spot.old_whole) + spot.old_rest);
}

// Distance above the plane, now and before.
fn gap() -> Dual {
    let n = vec3(z[PLANE_AT].x, z[PLANE_AT + 1u].x, z[PLANE_AT + 2u].x);
    let g = dot3(normal(), three_of(0u)) - z[PLANE_AT + 3u];
    return vec4((dot(n, spot.origin + spot.whole) - z[PLANE_AT + 3u].x) + dot(n, spot.rest), g.yzw);
}

fn old_gap() -> Dual {
    let n = vec3(z[PLANE_AT].x, z[PLANE_AT + 1u].x, z[PLANE_AT + 2u].x);
    let g = dot3(normal(), three_of(OLD_AT)) - z[PLANE_AT + 3u];
    return vec4((dot(n, spot.origin + spot.old_whole) - z[PLANE_AT + 3u].x) + dot(n, spot.old_rest), g.yzw);
}

// Contact pressure and energy at a gap, with derivatives (shared/contact.wgsl, palpate-model/src/mechanics/contact.rs).
fn pressure_of(g: Dual, stiffness: Dual) -> Dual {
    let l = contact_law(g.x, spot.width);
    var bend = 0.0;
    if abs(g.x) < spot.width {
        let s = (spot.width - g.x) / (2.0 * spot.width);
        bend = 3.0 * s * (1.0 - s) / spot.width;
    }
    return mul(stiffness, chain(l.pressure, l.slope, bend, g));
}

fn energy_of(g: Dual, stiffness: Dual) -> Dual {
    let l = contact_law(g.x, spot.width);
    return mul(stiffness, chain(l.energy, -l.pressure, -l.slope, g));
}

struct Instant {
    weight: f32,
    gap: Dual,
}

fn old_pressure() -> Dual {
    return pressure_of(old_gap(), z[PLANE_AT + 4u]);
}

// Weight of term k of the potential of what acts along the way from the old gap to the new one as contact does, and the gap there.
fn along_way(k: u32, old: Dual, new_gap: Dual) -> Instant {
    let at = instant(k, select(1.0, spot.rate / spot.momentum, spot.rate > 0.0));
    return Instant(at.x / at.y, new_gap + (1.0 - at.y) * (old - new_gap));
}

// Potential of contact of this stiffness along that way.
fn energy_along_way(old: Dual, new_gap: Dual, stiffness: Dual) -> Dual {
    var energy = number(0.0);
    for (var k = 0u; k < instant_count; k++) {
        let at = along_way(k, old, new_gap);
        if at.weight == 0.0 {
            break;
        }
        energy += at.weight * energy_of(at.gap, stiffness);
    }
    return energy;
}

// Shares of nodes in one load do not change in time: the host computes them.

struct Response {
    // FORCE: gradient and value; BY_OLD, COLUMN: derivative of the gradient; BACK: by the old position.
    a: vec4<f32>,
    // STIFFNESS: xx, yy, zz; BACK: by the old velocity.
    b: vec4<f32>,
    // STIFFNESS: xy, xz, yz.
    c: vec4<f32>,
}

// Fills the input with what does not depend on the point, for a member's effect; the slope of the measure is what COLUMN needs.
fn prepare(effect: EffectSite, member: u32, m: Member, mix: Mix) {
    spot.width = shape.contact_width;
    spot.rate = 0.0;
    spot.inertia = 0.0;
    spot.momentum = 0.0;
    if call.mode != 0u {
        spot.rate = 1.0 / shape.dt;
        spot.inertia = mix.inertia;
        spot.momentum = 1.0 / (shape.theta * shape.dt);
    }
    inputs = COMMON + effect.count;
    for (var i = 0u; i < inputs; i++) {
        z[i] = vec4(0.0);
        change[i] = 0.0;
    }
    for (var i = 0u; i < effect.count; i++) {
        z[COMMON + i] = number(effect_values[member * effect.stride + effect.first + i]);
    }
    for (var i = 0u; i < 3u; i++) {
        z[GRAVITY_AT + i] = number(m.gravity[i]);
    }
    z[STIFFNESS_AT] = number(DEFAULT_STIFFNESS * m.young / shape.element_size);
    z[TIME_AT] = number(m.start + f32(call.mode) * shape.time);
}

fn place_point(origin: vec3<f32>, whole: vec3<f32>, rest: vec3<f32>, old_whole: vec3<f32>, old_rest: vec3<f32>, v: vec3<f32>) {
    spot.origin = origin;
    spot.whole = whole;
    spot.rest = rest;
    spot.old_whole = old_whole;
    spot.old_rest = old_rest;
    let x = origin + (whole + rest);
    let old = origin + (old_whole + old_rest);
    for (var i = 0u; i < 3u; i++) {
        z[i] = number(x[i]);
        z[OLD_AT + i] = number(old[i]);
        z[VELOCITY_AT + i] = number(v[i]);
    }
}

// Change of the input along a direction, but for a plane's part of it.
fn change_along(effect: EffectSite, member: u32) {
    let r = rates[member];
    for (var i = 0u; i < effect.count; i++) {
        change[COMMON + i] = rate_numbers[numbers_at(member) + shape.rate_effects + effect.first + i];
    }
    for (var i = 0u; i < 3u; i++) {
        change[GRAVITY_AT + i] = r.gravity[i];
    }
    change[STIFFNESS_AT] = r.young * DEFAULT_STIFFNESS / shape.element_size;
    change[TIME_AT] = r.start;
}

// Two derivatives of the potential at once, as often as the question needs. `weight` is the vector of BACK.
fn respond(law: u32, what: u32, weight: vec3<f32>) -> Response {
    var r: Response;
    let slope = measure.z;
    let pairs = select(select(3u, 6u, what == STIFFNESS || what == BACK), 2u, what == FORCE);
    for (var k = 0u; k < pairs; k++) {
        // Entries of x that ε₁ and ε₂ stand for: of STIFFNESS the pairs xx, yy, zz, xy, xz, yz.
        var first = k % 3u;
        var second = NONE;
        if what == FORCE {
            first = 2u * k;
            second = select(NONE, 1u, k == 0u);
        }
        if what == STIFFNESS {
            first = select(k, max(k, 4u) - 4u, k >= 3u);
            second = select(k, select(2u, 1u, k == 3u), k >= 3u);
        }
        for (var i = 0u; i < inputs; i++) {
            var e = vec2(0.0);
            if i < 3u {
                e.x = select(f32(i == first), weight[i], what == BACK);
                e.y = f32(i == second);
            }
            if what == BY_OLD || what == COLUMN {
                e.y = change[i];
            }
            if what == BACK {
                e.y = f32(i == OLD_AT + k);
            }
            z[i] = vec4(z[i].x, e, 0.0);
        }
        measure = vec4(measure.x, 0.0, select(0.0, slope, what == COLUMN), 0.0);
        let v = potential(law);
        switch what {
            case FORCE: {
                r.a[first] = v.y;
                if k == 0u {
                    r.a = vec4(v.y, v.z, r.a.z, v.x);
                }
            }
            case STIFFNESS: {
                if k < 3u {
                    r.b[k] = v.w;
                } else {
                    r.c[k - 3u] = v.w;
                }
            }
            case BACK: {
                if k < 3u {
                    r.a[k] = v.w;
                } else {
                    r.b[k - 3u] = v.w;
                }
            }
            default: { r.a[k] = v.w; }
        }
    }
    return r;
}

// True for a positive semi-definite matrix, with room for rounding.
fn positive(r: Response) -> bool {
    let size = max(max(abs(r.b.x), abs(r.b.y)), abs(r.b.z));
    let d = r.b.xyz / max(size, 1e-30);
    let o = r.c.xyz / max(size, 1e-30);
    let det = d.x * (d.y * d.z - o.z * o.z) - o.x * (o.x * d.z - o.z * o.y) + o.y * (o.x * o.z - d.y * o.y);
    return min(d.x, min(d.y, d.z)) >= -1e-6 && d.x * d.y - o.x * o.x >= -1e-6 && det >= -1e-6;
}
