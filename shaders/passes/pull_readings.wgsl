//! dJ/dp of numbers that move depth readings: one workgroup a look and number.
// use shared/look
// use shared/found
// use shared/reduce

// Places of the numbers in θ.
var<body> reading_places: array<u32>;
// [points][readings]: derivatives of the true points.
var<shots> reading_slopes: array<vec4<f32>>;
// [B][P]
var<storage, read_write> gradient: array<f32>;

@compute @workgroup_size(64)
fn pull_readings(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    if !s.runs {
        return;
    }
    let shot = shots[s.look.shot];
    var sum = 0.0;
    for (var i = local; i < shot.point_count; i += 64u) {
        let f = found[s.slot * sight.points + i];
        if f.cell != NONE {
            let row = rows[s.slot * sight.rows + i];
            sum += row.x * row.y * dot(f.gradient, reading_slopes[(shot.point_start + i) * sight.readings + s.group].xyz);
        }
    }
    let total = tree(local, vec4(sum, 0.0, 0.0, 0.0)).x;
    if local == 0u {
        gradient[s.look.member * sight.parameters + reading_places[s.group]] += total;
    }
}
