//! Do so many workgroups run at the same time? They meet a few times; those that met every time say so.
// coherent
// use shared/meeting

var<storage, read_write> sums: array<u32>;

const MEETINGS = 8u;

@compute @workgroup_size(256)
fn probe_meeting(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    var all_came = true;
    for (var k = 1u; k <= MEETINGS; k++) {
        // Everybody leaves a number that the next one must see.
        if local == 0u {
            sums[group.x] = k;
        }
        if !meet(local, 0u, 2u * k * groups.x - groups.x) {
            all_came = false;
            break;
        }
        if local == 0u && sums[(group.x + 1u) % groups.x] != k {
            sums[groups.x + group.x] = 1u;
        }
        if !meet(local, 0u, 2u * k * groups.x) {
            all_came = false;
            break;
        }
    }
    if local == 0u {
        if !all_came {
            sums[groups.x + group.x] = 1u;
        }
        _ = leave(0u, groups.x);
    }
}
