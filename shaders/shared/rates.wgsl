//! How the coefficients of the balance change along the direction of a tangent.
// use shared/fields

struct Rate { // mirrored
    young: f32,
    poisson: f32,
    density: f32,
    mass_damping: f32,
    stiffness_damping: f32,
    start: f32,
    viscosity: vec2<f32>,
    gravity: vec4<f32>,
    velocity: vec4<f32>,
    spin: vec4<f32>,
}

// Bits of call.extra: arrays that are not zero, Poisson's ratio, and whether forces on corners of cells take part.
const WITH_MODULI = 1u;
const WITH_DENSITIES = 2u;
const WITH_RESTS = 4u;
const WITH_POISSON = 8u;
const WITH_CELLS = 16u;
// Numbers of a plane among the rates: height and angles, and one to fill up.
const PLANE_NUMBERS = 4u;

// [B]
var<rates> rates: array<Rate>;
// [B]: of planes, point masses, changes in time, clamps (poses, then matrices), effects.
var<rates> rate_numbers: array<f32>;
// [B][elements]: of the factors on their moduli.
var<rates> rate_moduli: array<f32>;

fn with_rate(what: u32) -> bool {
    return (call.extra & what) != 0u;
}

fn numbers_at(member: u32) -> u32 {
    return member * shape.rate_numbers;
}

fn plane_rate(member: u32, plane: u32) -> vec3<f32> {
    let at = numbers_at(member) + PLANE_NUMBERS * plane;
    return vec3(rate_numbers[at], rate_numbers[at + 1u], rate_numbers[at + 2u]);
}

fn aging_numbers(member: u32) -> u32 {
    return numbers_at(member) + PLANE_NUMBERS * shape.planes + shape.masses;
}

// Of Young's modulus of an element.
fn young_rate(m: Member, member: u32, element: u32) -> f32 {
    var factor = 1.0;
    if (shape.fields & FIELD_MODULUS) != 0u {
        factor = moduli[member * shape.elements + element];
    }
    var rate = rates[member].young * factor;
    if with_rate(WITH_MODULI) {
        rate += m.young * rate_moduli[member * shape.elements + element];
    }
    if (shape.fields & FIELD_AGING) != 0u {
        rate *= aging_at(member, 0u);
        for (var row = 0u; row < shape.aging_rows; row++) {
            rate += m.young * factor * aging_at(member, 1u + row) * rate_numbers[aging_numbers(member) + row];
        }
    }
    return rate;
}
