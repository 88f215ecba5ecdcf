//! A signed distance as a cubic B-spline through samples. Twin of palpate-model/src/mechanics/distance_grid.rs.

// Lattice of an obstacle's distance in its own coordinates, and where its numbers stand.
struct Obstacle { // mirrored
    // Place of the first sample [m], and their distance [m].
    low: vec3<f32>,
    spacing: f32,
    // Samples along the axes, and the first coefficient.
    counts: vec3<u32>,
    first: u32,
    // Its first number among those of all effects, how many of these a member has, and its first row of sums.
    value: u32,
    stride: u32,
    row: u32,
    pad: u32,
}

var<body> obstacles: array<Obstacle>;
// Coefficients of all obstacles [m].
var<body> distances: array<f32>;

struct Distance {
    value: f32,
    gradient: vec3<f32>,
    hessian: mat3x3<f32>,
}

// The four B-splines that do not vanish at t in [0, 1], and their first and second derivatives.
fn basis(t: f32) -> mat3x4<f32> {
    let r = 1.0 - t;
    let t2 = t * t;
    let t3 = t * t2;
    return mat3x4(
        vec4(r * r * r, 3.0 * t3 - 6.0 * t2 + 4.0, -3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0, t3) / 6.0,
        vec4(-0.5 * r * r, 1.5 * t2 - 2.0 * t, -1.5 * t2 + t + 0.5, 0.5 * t2),
        vec4(r, 3.0 * t - 2.0, 1.0 - 3.0 * t, t),
    );
}

// The spline in its domain.
fn distance_within(o: Obstacle, place: vec3<f32>) -> Distance {
    let there = (place - o.low) / o.spacing;
    let cell = clamp(vec3<u32>(max(there, vec3(0.0))), vec3(1u), o.counts - vec3(3u));
    let t = there - vec3<f32>(cell);
    let x = basis(t.x);
    var y = basis(t.y);
    var z = basis(t.z);
    var value = 0.0;
    var slope = vec3(0.0);
    var pure_part = vec3(0.0);
    // By y and z, z and x, x and y.
    var mixed = vec3(0.0);
    for (var k = 0u; k < 4u; k++) {
        for (var j = 0u; j < 4u; j++) {
            let row = o.first + cell.x - 1u + o.counts.x * (cell.y - 1u + j + o.counts.y * (cell.z - 1u + k));
            let s = vec4(distances[row], distances[row + 1u], distances[row + 2u], distances[row + 3u]) * x;
            let yj = vec3(y[0][j], y[1][j], y[2][j]);
            let zk = vec3(z[0][k], z[1][k], z[2][k]);
            value += zk.x * yj.x * s.x;
            slope += vec3(zk.x * yj.x * s.y, zk.x * yj.y * s.x, zk.y * yj.x * s.x);
            pure_part += vec3(zk.x * yj.x * s.z, zk.x * yj.z * s.x, zk.z * yj.x * s.x);
            mixed += vec3(zk.y * yj.y * s.x, zk.y * yj.x * s.y, zk.x * yj.y * s.y);
        }
    }
    let bend = mat3x3(
        vec3(pure_part.x, mixed.z, mixed.y),
        vec3(mixed.z, pure_part.y, mixed.x),
        vec3(mixed.y, mixed.x, pure_part.z),
    );
    return Distance(value, slope / o.spacing, bend * (1.0 / (o.spacing * o.spacing)));
}

// Distance and derivatives at a place in the obstacle's own coordinates; beyond the lattice the distance to it is added, and no curvature is known.
fn distance_at(o: Obstacle, place: vec3<f32>) -> Distance {
    let inside = clamp(place, o.low + vec3(o.spacing), o.low + o.spacing * vec3<f32>(o.counts - vec3(2u)));
    var d = distance_within(o, inside);
    let beyond = length(place - inside);
    if beyond > 0.0 {
        d = Distance(d.value + beyond, (place - inside) / beyond, mat3x3<f32>());
    }
    return d;
}
