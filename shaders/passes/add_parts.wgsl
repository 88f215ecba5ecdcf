//! Adds up the parts of a look's sum, `mode` of them, and keeps it for its member and frame.
// use shared/look
// use shared/reduce

// [B][F]
var<storage, read_write> sums: array<vec4<f32>>;

@compute @workgroup_size(64)
fn add_parts(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    if !s.runs {
        return;
    }
    var sum = vec4(0.0);
    for (var i = local; i < call.mode; i += 64u) {
        sum += partials[s.slot * PARTS + i];
    }
    let total = tree(local, sum);
    if local == 0u {
        sums[s.look.member * sight.frames + s.look.frame] = total;
    }
}
