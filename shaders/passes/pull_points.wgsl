//! Gradient of the depth cost by the corners of every cell: each goes through its candidates again, in their order, and takes those
//! that it won. One lane a corner.
// use shared/candidates
// use shared/found

// [slots][stripes][cells][8]
var<storage, read_write> corner_pulls: array<vec4<f32>>;

@compute @workgroup_size(64)
fn pull_points(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let index = s.first + local;
    let corner = index & 7u;
    let stripe = (index >> 3u) % sight.stripes;
    let cell = (index >> 3u) / sight.stripes;
    if !s.runs || cell >= sight.cells {
        return;
    }
    let shot = shots[s.look.shot];
    var sum = vec3(0.0);
    if shot.point_count != 0u {
        let e = load_hexahedron(s.slot, cell, shot);
        let c = cubes_of(e, shot);
        for (var z = c.low.z; z <= c.high.z; z++) {
            for (var y = c.low.y; y <= c.high.y; y++) {
                let row = row_of(c, shot, y, z);
                for (var i = row.x + stripe; i < row.y; i += sight.stripes) {
                    let n = i - shot.point_start;
                    let f = found[s.slot * sight.points + n];
                    if f.cell == cell {
                        let w = rows[s.slot * sight.rows + n];
                        sum -= (shape_at(f.xi, corner) * w.x * w.y) * f.gradient;
                    }
                }
            }
        }
    }
    corner_pulls[((s.slot * sight.stripes + stripe) * sight.cells + cell) * 8u + corner] = vec4(sum, 0.0);
}
