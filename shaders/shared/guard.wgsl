//! The guard against inversion beyond what corotation can follow, in the body frame, where F is the stretch S. Twin of
//! palpate-model/src/corotation/inversion.rs, where the formulas stand; names are the same.
// use shared/rotation
// use shared/grid

// Distance d below which the barrier acts, and factor of its energy.
override guard_start: f32;
override guard_strength: f32;

// Rounding of d: what is closer to the jump counts as so close, which no line search accepts.
const CLOSEST = 1e-6;

struct Guard {
    // Energy over E V, and its first and second derivative by d.
    energy: f32,
    slope: f32,
    bend: f32,
}

// Distance d of a cell from the jump of its rotation.
fn distance_of(s: mat3x3<f32>) -> f32 {
    let i = trace3(s);
    return 0.5 * (i - norm2(s) / i) - determinant(s) / (i * i);
}

fn is_guarded(s: mat3x3<f32>) -> bool {
    return distance_of(s) < guard_start;
}

fn guard_at(s: mat3x3<f32>) -> Guard {
    let d = max(distance_of(s), CLOSEST);
    let depth = log(guard_start / d);
    var g: Guard;
    g.energy = guard_strength * depth * depth * depth;
    g.slope = -3.0 * guard_strength * depth * depth / d;
    g.bend = 3.0 * guard_strength * depth * (2.0 + depth) / (d * d);
    return g;
}

// ∂d/∂F.
fn guard_gradient(s: mat3x3<f32>) -> mat3x3<f32> {
    let i = trace3(s);
    let onto = 0.5 * (1.0 + norm2(s) / (i * i)) + 2.0 * determinant(s) / (i * i * i);
    return identity3() * onto - s * (1.0 / i) - cofactors(s) * (1.0 / (i * i));
}

// Gradient of a corner's shape function at the cell's centre.
fn slope_of(sign: vec3<f32>) -> vec3<f32> {
    return sign * (0.25 / shape.h);
}

// E V of a cell for Young's modulus `young`.
fn guard_unit(young: f32, cell: Cell) -> f32 {
    return young * (cell.whole * shape.h * shape.h * shape.h);
}

// Body-frame force on a corner of a guarded cell, and its share of the energy, for E V = `unit`.
fn guard_force(s: mat3x3<f32>, sign: vec3<f32>, unit: f32) -> vec4<f32> {
    let g = guard_at(s);
    return unit * vec4(g.slope * (guard_gradient(s) * slope_of(sign)), 0.125 * g.energy);
}
