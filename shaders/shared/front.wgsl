//! The side that a camera saw: where the line of sight towards it leaves the deformed body. Twin of palpate-model/src/cutcells/front.rs, where the
//! formulas stand; one loop marches and then finds the root, so that what it calls is compiled once.
// use shared/hexahedron

// Numbers of the band cells by lattice place.
var<body> band_lookup: array<u32>;

// Steps of the march per cell, most of them, and most of the root's.
override front_per_cell: f32;
override front_most: u32;
override front_root: u32;
// A cell continued so far (in its own size) means nothing any more.
override front_far: f32;
// Newton's steps of a place (in cells) and of the root (in h) that are the last: both converge quadratically, so that what is left is below
// rounding, some 5e-7 of a cell.
const PLACED = 1e-4;
const SETTLED = 1e-5;

struct Rest {
    // Gradient by ξ and, last, distance from the rest surface.
    d: vec4<f32>,
    known: bool,
}

// The rest shape at a place given in units of a cell's ξ; known in the band.
fn rest_at(cell: u32, xi: vec3<f32>) -> Rest {
    var r: Rest;
    // Whole cells are counted apart, so that places far from the lattice's first node lose nothing.
    let own = vec3<i32>(band_cells[cell].lattice);
    let last = vec3(i32(sight.lattice[0]), i32(sight.lattice[1]), i32(sight.lattice[2])) - vec3(2);
    let ijk = clamp(own + vec3<i32>(floor(xi)), vec3(0), last);
    let local = xi - vec3<f32>(ijk - own);
    if !(all(local >= vec3(0.0)) && all(local <= vec3(1.0))) {
        return r;
    }
    let other = band_lookup[u32(ijk.x) + sight.lattice[0] * (u32(ijk.y) + sight.lattice[1] * u32(ijk.z))];
    r.known = other != NONE;
    if r.known {
        r.d = distance_at(other, local);
    }
    return r;
}

struct Continued {
    xi: vec3<f32>,
    lost: bool,
}

// Where the continued cell is at y, from a place nearby; lost where it folds.
fn continue_to(e: Hexahedron, y: vec3<f32>, nearby: vec3<f32>) -> Continued {
    var c: Continued;
    c.xi = nearby;
    let flat = 1e-6 * e.size * e.size * e.size;
    for (var i = 0u; i < place_iterations; i++) {
        let j = jacobian_in(e, c.xi);
        let det = determinant(j);
        if !(det > flat) {
            c.lost = true;
            break;
        }
        let step = inverse_of(j, det) * (position_in(e, c.xi) - y);
        c.xi -= step;
        let away = abs(c.xi - 0.5);
        if !(max(max(away.x, away.y), away.z) < front_far) {
            c.lost = true;
            break;
        }
        let size = abs(step);
        if max(max(size.x, size.y), size.z) < PLACED {
            break;
        }
    }
    return c;
}

// The side of the point at y that lies nearest to a hidden one, at p: that one where a visible one is near; else the front, which holds
// nothing where it lies beyond the band or cannot be told. `line` is the recorded line of sight, `reach` how far noise makes it look.
fn side_of(e: Hexahedron, cell: u32, y: vec3<f32>, p: Pulled, line: vec3<f32>, reach: f32) -> Pulled {
    var front = p;
    front.holds = false;
    var xi = p.xi;
    var t = 1.5 * abs(p.phi) + reach;
    var inside = t;
    var beyond = 0.0;
    var marches = true;
    // One look whether this is the front, the march, the root.
    for (var i = 0u; i < 1u + front_most + front_root; i++) {
        let c = continue_to(e, y - t * line, xi);
        let r = rest_at(cell, c.xi);
        let known = r.known && !c.lost;
        if i == 0u && !(known && r.d.w < 0.0) {
            return p;
        }
        if !known || (marches && i > front_most) {
            break;
        }
        xi = c.xi;
        if marches && r.d.w < 0.0 {
            if i > 0u && t >= sight.band {
                break;
            }
            inside = t;
            t += sight.h / front_per_cell;
            continue;
        }
        if marches {
            marches = false;
            beyond = t;
            t = 0.5 * (inside + beyond);
            continue;
        }
        if r.d.w < 0.0 {
            inside = t;
        } else {
            beyond = t;
        }
        let j = jacobian_in(e, xi);
        let gradient = transpose(inverse_of(j, determinant(j))) * r.d.xyz;
        let slope = dot(gradient, line);
        let newton = t + r.d.w / slope;
        if abs(newton - t) < SETTLED * sight.h || beyond - inside < SETTLED * sight.h {
            t = clamp(newton, inside, beyond);
            if !(slope < 0.0 && t < sight.band) {
                break;
            }
            // At a grazing angle a small error of the body is a long way.
            if -slope < sight.turned_away * length(gradient) {
                return p;
            }
            front.holds = true;
            front.xi = xi;
            front.phi = -t;
            front.gradient = gradient / -slope;
            break;
        }
        t = select(0.5 * (inside + beyond), newton, newton > inside && newton < beyond);
    }
    return front;
}
