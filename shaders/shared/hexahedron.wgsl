//! A deformed band cell and the place in it where an observed point lies. Positions count from the cell's first corner, so that
//! single precision is relative to the cell and not to the world. Twin of palpate-model/src/cutcells/pullback.rs.
// use shared/seen

struct BandCell { // mirrored
    nodes: array<u32, 8>,
    lattice: vec3<u32>,
    pad: u32,
    // Rest position of the first corner, from the body's origin [m].
    corner: vec4<f32>,
}

var<body> band_cells: array<BandCell>;
var<body> band_sdf: array<f32>;

// Quadratic pieces per axis of a cell's distances, and samples: every piece has three, neighbours share one.
override sdf_pieces: u32;
// Most steps of Newton's method for a place.
override place_iterations: u32;

// Relative rounding of a position is 6e-8 of the cell; so much slack in ξ leaves no gap between neighbours, and a point that two
// of them hold has the same distance in both up to that slack.
const SLACK = 4e-6;
// Boxes are widened by so many cells: rounding here and on the host never hides a candidate.
const BOX_SLACK = 1e-4;

// x(ξ) = aξ + bη + cζ + ab ξη + bc ηζ + ca ζξ + abc ξηζ, from the first corner.
struct Hexahedron {
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
    ab: vec3<f32>,
    bc: vec3<f32>,
    ca: vec3<f32>,
    abc: vec3<f32>,
    low: vec3<f32>,
    high: vec3<f32>,
    // Largest extent, for what counts as flat.
    size: f32,
    // Adds up with a point of the frame to its place from the first corner.
    offset: vec3<f32>,
}

fn corner_from(slot: u32, cell: u32, origin: u32, corner: u32) -> vec3<f32> {
    let rest = vec3(f32(corner & 1u), f32((corner >> 1u) & 1u), f32(corner >> 2u)) * sight.h;
    return rest + between(origin, seen_at(slot, band_cells[cell].nodes[corner]));
}

fn load_hexahedron(slot: u32, cell: u32, shot: Shot) -> Hexahedron {
    let origin = seen_at(slot, band_cells[cell].nodes[0]);
    let x1 = corner_from(slot, cell, origin, 1u);
    let x2 = corner_from(slot, cell, origin, 2u);
    let x3 = corner_from(slot, cell, origin, 3u);
    let x4 = corner_from(slot, cell, origin, 4u);
    let x5 = corner_from(slot, cell, origin, 5u);
    let x6 = corner_from(slot, cell, origin, 6u);
    let x7 = corner_from(slot, cell, origin, 7u);
    var e: Hexahedron;
    e.a = x1;
    e.b = x2;
    e.c = x4;
    e.ab = x3 - x1 - x2;
    e.bc = x6 - x2 - x4;
    e.ca = x5 - x1 - x4;
    e.abc = (x7 - x6) - (x5 - x4) - (x3 - x2) + x1;
    let slack = vec3(BOX_SLACK * sight.h);
    e.low = min(min(min(vec3(0.0), x1), min(x2, x3)), min(min(x4, x5), min(x6, x7))) - slack;
    e.high = max(max(max(vec3(0.0), x1), max(x2, x3)), max(max(x4, x5), max(x6, x7))) + slack;
    let one = abs(x7);
    let two = abs(x6 - x1);
    e.size = max(max(max(one.x, one.y), one.z), max(max(two.x, two.y), two.z));
    e.offset = ((shot.shift.xyz - seen[origin].xyz) + (shot.shift_rest.xyz - seen[rest_part() + origin].xyz))
        - band_cells[cell].corner.xyz;
    return e;
}

fn position_in(e: Hexahedron, xi: vec3<f32>) -> vec3<f32> {
    return (e.a + e.ab * xi.y + (e.ca + e.abc * xi.y) * xi.z) * xi.x + (e.b + e.bc * xi.z) * xi.y + e.c * xi.z;
}

// ∂x/∂ξ.
fn jacobian_in(e: Hexahedron, xi: vec3<f32>) -> mat3x3<f32> {
    return mat3x3(
        e.a + e.ab * xi.y + (e.ca + e.abc * xi.y) * xi.z,
        e.b + e.ab * xi.x + (e.bc + e.abc * xi.x) * xi.z,
        e.c + e.ca * xi.x + (e.bc + e.abc * xi.x) * xi.y,
    );
}

fn inverse_of(m: mat3x3<f32>, det: f32) -> mat3x3<f32> {
    return transpose(mat3x3(cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1]))) * (1.0 / det);
}

struct Pulled {
    holds: bool,
    xi: vec3<f32>,
    phi: f32,
    gradient: vec3<f32>,
    inverse: mat3x3<f32>,
}

// Newton's method for x(ξ) = y, then the rest distance there; `slack` in units of the cell.
fn pull_back(e: Hexahedron, cell: u32, y: vec3<f32>, slack: f32) -> Pulled {
    var p: Pulled;
    var xi = vec3(0.5);
    // Rounding of a determinant is some 1e-7 of the cell's cube.
    let flat = 1e-6 * e.size * e.size * e.size;
    var lost = false;
    for (var i = 0u; i < place_iterations; i++) {
        let j = jacobian_in(e, xi);
        let det = determinant(j);
        if !(abs(det) > flat) {
            lost = true;
            break;
        }
        let step = inverse_of(j, det) * (position_in(e, xi) - y);
        xi -= step;
        let away = abs(xi - 0.5);
        if max(max(away.x, away.y), away.z) > 1.5 {
            lost = true;
            break;
        }
        let size = abs(step);
        // Quadratic convergence: after a step of 1e-4 the error is 1e-8, less than rounding.
        if max(max(size.x, size.y), size.z) < 1e-4 {
            break;
        }
    }
    let j = jacobian_in(e, xi);
    let det = determinant(j);
    let inside = all(xi >= vec3(-slack)) && all(xi <= vec3(1.0 + slack));
    // A folded cell maps several places to one point; only the unfolded part means something.
    p.holds = !lost && inside && det > 0.0;
    p.xi = xi;
    if p.holds {
        p.inverse = inverse_of(j, det);
        let d = distance_at(cell, xi);
        p.phi = d.w;
        p.gradient = transpose(p.inverse) * d.xyz;
    }
    return p;
}

fn quadratic_basis(t: f32) -> vec3<f32> {
    return vec3((1.0 - t) * (1.0 - 2.0 * t), 4.0 * t * (1.0 - t), t * (2.0 * t - 1.0));
}

fn quadratic_slope(t: f32) -> vec3<f32> {
    return vec3(4.0 * t - 3.0, 4.0 - 8.0 * t, 4.0 * t - 1.0);
}

fn sdf_samples() -> u32 {
    return 2u * sdf_pieces + 1u;
}

// (∂/∂ξ, value) along one row of three.
fn sdf_row(at: u32, b: vec3<f32>, s: vec3<f32>) -> vec2<f32> {
    let v = vec3(band_sdf[at], band_sdf[at + 1u], band_sdf[at + 2u]);
    return vec2(dot(s, v), dot(b, v));
}

// (∂/∂ξ, ∂/∂η, value) in one plane of nine.
fn sdf_plane(at: u32, bx: vec3<f32>, sx: vec3<f32>, by: vec3<f32>, sy: vec3<f32>) -> vec3<f32> {
    let r0 = sdf_row(at, bx, sx);
    let r1 = sdf_row(at + sdf_samples(), bx, sx);
    let r2 = sdf_row(at + 2u * sdf_samples(), bx, sx);
    let v = vec3(r0.y, r1.y, r2.y);
    return vec3(dot(by, vec3(r0.x, r1.x, r2.x)), dot(sy, v), dot(by, v));
}

// Gradient by ξ and, last, the value of a cell's distances: a quadratic in each of its pieces.
fn distance_at(cell: u32, xi: vec3<f32>) -> vec4<f32> {
    let pieces = f32(sdf_pieces);
    let piece = clamp(floor(pieces * xi), vec3(0.0), vec3(pieces - 1.0));
    let x = pieces * xi - piece;
    let bx = quadratic_basis(x.x);
    let by = quadratic_basis(x.y);
    let bz = quadratic_basis(x.z);
    let sx = pieces * quadratic_slope(x.x);
    let sy = pieces * quadratic_slope(x.y);
    let sz = pieces * quadratic_slope(x.z);
    let n = sdf_samples();
    let k = 2u * vec3<u32>(piece);
    let at = n * n * n * cell + k.x + n * (k.y + n * k.z);
    let p0 = sdf_plane(at, bx, sx, by, sy);
    let p1 = sdf_plane(at + n * n, bx, sx, by, sy);
    let p2 = sdf_plane(at + 2u * n * n, bx, sx, by, sy);
    let v = vec3(p0.z, p1.z, p2.z);
    return vec4(dot(bz, vec3(p0.x, p1.x, p2.x)), dot(bz, vec3(p0.y, p1.y, p2.y)), dot(sz, v), dot(bz, v));
}

// Shape function of a corner.
fn shape_at(xi: vec3<f32>, corner: u32) -> f32 {
    let x = select(1.0 - xi.x, xi.x, (corner & 1u) != 0u);
    let y = select(1.0 - xi.y, xi.y, (corner & 2u) != 0u);
    let z = select(1.0 - xi.z, xi.z, (corner & 4u) != 0u);
    return x * y * z;
}
