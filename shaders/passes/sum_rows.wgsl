//! Cost, number of residuals that met something, Σ r² and Σ φ of a look, in parts.
// use shared/look
// use shared/found
// use shared/reduce
// use costs/depth

@compute @workgroup_size(64)
fn sum_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
            @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let index = s.first + local;
    if !s.runs {
        return;
    }
    let shot = shots[s.look.shot];
    var sum = vec4(0.0);
    for (var i = index; i < rows_of(shot); i += 64u * call.roster) {
        let row = rows[s.slot * sight.rows + i];
        let r = row.x;
        if i >= shot.point_count {
            sum += vec4(0.5 * row.y * r * r, select(0.0, 1.0, row.y > 0.0), r * r, 0.0);
        } else if row.y < 0.0 {
            // A point without a match costs what one at the edge of the band costs.
            sum.x += s.look.weights.x * depth_unmatched(sight.band);
        } else {
            sum += vec4(s.look.weights.x * depth_cost(r, sight.band), 1.0, r * r, r);
        }
    }
    let total = tree(local, sum);
    if local == 0u {
        partials[s.slot * PARTS + s.group] = total;
    }
}
