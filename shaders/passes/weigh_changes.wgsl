//! Puts the change of every residual along the only direction in the residual's place, so that what pulls on the residuals next makes of it the
//! product with the Gauss–Newton matrix. Items are points, then markers, then observed nodes.
// use costs/markers
// use shared/found

// [slots][most rows]
var<storage, read> slopes: array<f32>;

@compute @workgroup_size(64)
fn weigh_changes(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let index = s.first + local;
    let shot = shots[s.look.shot];
    if !s.runs || index >= shot.point_count + shot.marker_count + shot.node_count {
        return;
    }
    let base = s.slot * sight.rows;
    if index < shot.point_count {
        rows[base + index].x = slopes[base + index];
        return;
    }
    let vector = index - shot.point_count;
    let row = base + shot.point_count + 3u * vector;
    for (var k = 0u; k < 3u; k++) {
        rows[row + k].x = slopes[row + k];
    }
    if vector < shot.marker_count {
        let mark = marks[shot.marker_start + vector];
        let at = s.slot * sight.markers + vector;
        carried[at] = pulled(carried[at], vec3(slopes[row], slopes[row + 1u], slopes[row + 2u]), s.look, shot.first_site, mark.site);
    }
}
