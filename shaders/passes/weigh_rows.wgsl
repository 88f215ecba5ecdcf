//! Adds a look's Gauss–Newton gradient Σ w r ∂r and matrix Σ w ∂r ∂rᵀ along `mode` directions: one workgroup an entry.
// use shared/look
// use shared/found
// use shared/reduce

var<storage, read> slopes: array<f32>;
// [B][Q + Q²]
var<storage, read_write> curvature: array<f32>;

@compute @workgroup_size(64)
fn weigh_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    if !s.runs {
        return;
    }
    let count = call.mode;
    // Entries: the gradient, then the lower triangle row by row.
    var a = s.group;
    var b = count;
    if a >= count {
        var left = a - count;
        a = 0u;
        while left > a {
            left -= a + 1u;
            a++;
        }
        b = left;
    }
    let base = s.slot * count * sight.rows;
    var sum = 0.0;
    for (var i = local; i < rows_of(shots[s.look.shot]); i += 64u) {
        let row = rows[s.slot * sight.rows + i];
        var other = row.x;
        if b < count {
            other = slopes[base + b * sight.rows + i];
        }
        sum += max(row.y, 0.0) * slopes[base + a * sight.rows + i] * other;
    }
    let total = tree(local, vec4(sum, 0.0, 0.0, 0.0)).x;
    if local == 0u {
        let out = s.look.member * (count + count * count);
        if b == count {
            curvature[out + a] += total;
        } else {
            curvature[out + count + a * count + b] += total;
            if a != b {
                curvature[out + count + b * count + a] += total;
            }
        }
    }
}
