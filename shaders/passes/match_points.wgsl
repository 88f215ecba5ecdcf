//! Which cell each observed point lies in: of all cells that hold it, those whose surface faces the camera come first, then the
//! smallest |φ|, then the lowest number. Every cell goes through its candidates, eight lanes a cell and stripe. In mode 0 the best
//! key is found (minima of integers do not depend on their order), in mode 1 the lowest cell that has it. Both are one kernel, so that
//! both compute the same bits.
// use shared/candidates

var<storage, read> cameras: array<vec4<f32>>;
// Numbers of the band cells by lattice place.
var<storage, read> band_lookup: array<u32>;
var<storage, read_write> keys: array<atomic<u32>>;
var<storage, read_write> owners: array<atomic<u32>>;

const HIDDEN = 0x80000000u;
const NOBODY = 0xffffffffu;

// True when a place of the rest shape, in units of a cell's ξ, lies in the body.
fn in_body(cell: u32, xi: vec3<f32>) -> bool {
    let last = vec3(f32(sight.lattice[0]), f32(sight.lattice[1]), f32(sight.lattice[2])) - vec3(1.0);
    let place = vec3<f32>(band_cells[cell].lattice) + xi;
    if !(all(place >= vec3(0.0)) && all(place <= last)) {
        return false;
    }
    let corner = min(floor(place), last - vec3(1.0));
    let ijk = vec3<u32>(corner);
    let other = band_lookup[ijk.x + sight.lattice[0] * (ijk.y + sight.lattice[1] * ijk.z)];
    if other == NOBODY {
        return false;
    }
    return triquadratic(other, place - corner).w < 0.0;
}

// Order of a place: the smaller the better; NOBODY when the camera cannot have seen it. A non-negative float's bits grow with it.
fn key_of(cell: u32, found: Pulled, sight_line: vec3<f32>) -> u32 {
    let size = bitcast<u32>(abs(found.phi)) & 0x7fffffffu;
    if dot(found.gradient, sight_line) <= sight.turned_away * length(found.gradient) {
        return size;
    }
    let way = 1.5 * abs(found.phi) + sight.reach;
    if in_body(cell, found.xi - way * (found.inverse * sight_line)) {
        return NOBODY;
    }
    return size | HIDDEN;
}

@compute @workgroup_size(64)
fn match_points(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, local, 64u);
    let lane = s.item & 7u;
    let stripe = (s.item >> 3u) % sight.stripes;
    let cell = (s.item >> 3u) / sight.stripes;
    if !s.runs || cell >= sight.cells {
        return;
    }
    let shot = shots[s.look.shot];
    if shot.point_count == 0u {
        return;
    }
    let e = load_hexahedron(s.slot, cell, shot);
    let c = cubes_of(e, shot);
    for (var z = c.low.z; z <= c.high.z; z++) {
        for (var y = c.low.y; y <= c.high.y; y++) {
            let row = row_of(c, shot, y, z);
            for (var i = row.x + 8u * stripe + lane; i < row.y; i += 8u * sight.stripes) {
                let p = points[i];
                let place = p.xyz + e.offset;
                if !in_box(e, place) {
                    continue;
                }
                let found = pull_back(e, cell, place, SLACK);
                if !found.holds {
                    continue;
                }
                // Cameras are counted from the body's origin, points from the frame's.
                let line = (p.xyz + shot.shift.xyz + shot.shift_rest.xyz) - cameras[u32(p.w)].xyz;
                let size = length(line);
                let key = key_of(cell, found, select(vec3(0.0), line / size, size > 0.0));
                let at = s.slot * sight.points + (i - shot.point_start);
                if call.mode == 0u {
                    atomicMin(&keys[at], key);
                } else if key != NOBODY && atomicLoad(&keys[at]) == key {
                    atomicMin(&owners[at], cell);
                }
            }
        }
    }
}
