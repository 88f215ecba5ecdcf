//! Displacements that were observed directly: simulated minus measured.
// use shared/seen
// use costs/displacements

// Measured displacements of frames that have them: a float [m] with 1 where the node was seen and 0 where not, and what the float leaves.
var<storage, read> measured: array<vec4<f32>>;

@compute @workgroup_size(64)
fn compare_nodes(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let index = s.first + local;
    let shot = shots[s.look.shot];
    if !s.runs || index >= shot.node_count {
        return;
    }
    let k = 2u * (shot.node_start + index);
    let at = seen_at(s.slot, index);
    let known = measured[k].w;
    let weight = s.look.weights.w * known;
    let r = known * ((seen[at].xyz - measured[k].xyz) + (seen[rest_part() + at].xyz - measured[k + 1u].xyz));
    let row = displacement_row(s.slot, shot, index);
    rows[row] = vec2(r.x, weight);
    rows[row + 1u] = vec2(r.y, weight);
    rows[row + 2u] = vec2(r.z, weight);
}
