//! Place, distance and gradient of every point in the cell that it belongs to; of the front, where that is what the camera saw.
// use shared/candidates
// use shared/front
// use shared/found
// use costs/depth

var<storage, read> owners: array<u32>;
var<storage, read> keys: array<u32>;
// Lines of sight as the recording has them, in the order of `points`; where no reading is moved they are those of the points.
var<shots> recorded_lines: array<vec4<f32>>;

@compute @workgroup_size(64)
fn place_points(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let index = s.first + local;
    let shot = shots[s.look.shot];
    if !s.runs || index >= shot.point_count {
        return;
    }
    let at = s.slot * sight.points + index;
    var f: Found;
    f.cell = owners[at];
    var row = vec2(0.0, -1.0);
    if f.cell != NONE {
        let e = load_hexahedron(s.slot, f.cell, shot);
        let point = points[shot.point_start + index];
        let y = point.xyz + e.offset;
        // The cell was found to hold the point; more slack, should a compiler round differently here.
        var p = pull_back(e, f.cell, y, 10.0 * SLACK);
        if p.holds && (keys[at] & HIDDEN) != 0u {
            var line = line_of_sight(point, shot);
            if sight.readings > 0u {
                line = recorded_lines[shot.point_start + index].xyz;
            }
            p = side_of(e, f.cell, y, p, line, shot.reach);
        }
        if p.holds {
            f.xi = p.xi;
            f.phi = p.phi;
            f.gradient = p.gradient;
            row = vec2(p.phi, s.look.weights.x * depth_weight(p.phi, sight.band));
        } else {
            f.cell = NONE;
        }
    }
    found[at] = f;
    rows[s.slot * sight.rows + index] = row;
}
