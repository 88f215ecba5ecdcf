//! dJ/d(offset) of markers that sit off their stated places: one workgroup a look and parameter.
// use costs/markers
// use shared/reduce

// 3 · marker + axis of every such parameter, and its place in θ.
var<body> offset_places: array<vec2<u32>>;
// Markers of a frame by site: [F][most sites + 1].
var<body> mark_rows: array<u32>;
// [B][P]
var<storage, read_write> gradient: array<f32>;

@compute @workgroup_size(64)
fn pull_offsets(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    if !s.runs {
        return;
    }
    let own = offset_places[s.group];
    let shot = shots[s.look.shot];
    var sum = 0.0;
    let first = shot.mark_start + own.x / 3u;
    for (var m = mark_rows[first] + local; m < mark_rows[first + 1u]; m += 64u) {
        var c = carried[s.slot * sight.markers + m];
        sum += dot(c.pull.xyz, c.turn[own.x % 3u]);
    }
    let total = tree(local, vec4(sum, 0.0, 0.0, 0.0)).x;
    if local == 0u {
        gradient[s.look.member * sight.parameters + own.y] += total;
    }
}
