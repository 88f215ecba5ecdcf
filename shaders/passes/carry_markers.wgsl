//! Where the markers of a frame are, how far from where they were seen, and what pulls them there.
// use costs/markers
// use shared/found

@compute @workgroup_size(64)
fn carry_markers(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let index = s.first + local;
    let shot = shots[s.look.shot];
    if !s.runs || index >= shot.marker_count {
        return;
    }
    let mark = marks[shot.marker_start + index];
    let number = shot.first_site + mark.site;
    let site = sites[number];
    let first = stencil_rows[number];
    let origin = seen_at(s.slot, stencil_entries[first].node);
    var moved = vec3(0.0);
    var h = site.excess;
    for (var k = first; k < stencil_rows[number + 1u]; k++) {
        let d = between(origin, seen_at(s.slot, stencil_entries[k].node));
        moved += stencil_entries[k].weight * d;
        h += outer(d, stencil_gradients[k].xyz);
    }
    let stalk = stalk_of(s.look.member, shot.first_site, mark.site);
    let excess = excess_of(rotation_of(h));
    var c: Carried;
    c.turn = identity3() + excess;
    c.pair = pair_inverse(stretch_of(excess, h));
    let far = (seen[origin].xyz - mark.goal) + (seen[rest_part() + origin].xyz - mark.goal_rest);
    // The measured place is counted from the stated one: the offset itself comes on top of its turning.
    let r = far + (moved + excess * stalk + (stalk - site.stalk));
    carried[s.slot * sight.markers + index] = pulled(c, r, s.look, shot.first_site, mark.site);
    let row = s.slot * sight.rows + shot.point_count + 3u * index;
    let weight = site_weight(s.look, site);
    rows[row] = vec2(r.x, weight);
    rows[row + 1u] = vec2(r.y, weight);
    rows[row + 2u] = vec2(r.z, weight);
}
