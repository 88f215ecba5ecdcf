//! No point has met a cell yet.
// use shared/look

var<storage, read_write> keys: array<u32>;
var<storage, read_write> owners: array<u32>;

@compute @workgroup_size(64)
fn forget_matches(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local: u32) {
    let s = find_seat(group, groups, 64u);
    let index = s.first + local;
    if !s.runs || index >= shots[s.look.shot].point_count {
        return;
    }
    keys[s.slot * sight.points + index] = NONE;
    owners[s.slot * sight.points + index] = NONE;
}
