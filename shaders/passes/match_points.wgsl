//! Which cell each observed point lies in: of all cells that hold it, those whose surface faces the camera come first, then the
//! smallest |φ|, then the lowest number. Every cell goes through its candidates, eight lanes a cell and stripe. In mode 0 the best
//! key is found (minima of integers do not depend on their order), in mode 1 the lowest cell that has it. Both are one kernel, so that
//! both compute the same bits.
// use shared/candidates

var<storage, read_write> keys: array<atomic<u32>>;
var<storage, read_write> owners: array<atomic<u32>>;

// Order of a place: the smaller the better. A non-negative float's bits grow with it.
fn key_of(found: Pulled, line: vec3<f32>) -> u32 {
    let size = bitcast<u32>(abs(found.phi)) & 0x7fffffffu;
    let faces = dot(found.gradient, line) <= sight.turned_away * length(found.gradient);
    return select(size | HIDDEN, size, faces);
}

@compute @workgroup_size(64)
fn match_points(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let index = s.first + local;
    let lane = index & 7u;
    let stripe = (index >> 3u) % sight.stripes;
    let cell = (index >> 3u) / sight.stripes;
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
                let key = key_of(found, line_of_sight(p, shot));
                let at = s.slot * sight.points + (i - shot.point_start);
                if call.mode == 0u {
                    atomicMin(&keys[at], key);
                } else if atomicLoad(&keys[at]) == key {
                    atomicMin(&owners[at], cell);
                }
            }
        }
    }
}
