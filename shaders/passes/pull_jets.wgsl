//! Derivatives by a jet's numbers and by the start's time, patch by patch.
// use shared/jet
// use shared/probed

var<storage, read> jet_seen: array<u32>;
// As pull_obstacles has them.
var<storage, read_write> moving_sums: array<f32>;

@compute @workgroup_size(64)
fn pull_jets(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    if !p.live {
        return;
    }
    let f = frame_of(p.member, p.item);
    let z = probe_at(p.member, patch_stencil(p.item));
    for (var k = 0u; k < shape.jets; k++) {
        if jet_seen[jet_at(k, p.member, p.item)] == 0u {
            continue;
        }
        let by = blown_pull(blow(meeting(k, p.member, p.item, f)), z);
        let pose = jet_pose(p.member, k);
        let later = meets_later(k, pose);
        let offset = -(transpose(pose.turn) * by.way);
        let each = shape.members * shape.patches;
        let at = jets[k].row * each + p.member * shape.patches + p.item;
        moving_sums[at] += by.thrust;
        moving_sums[at + each] += by.spread;
        moving_sums[at + 2u * each] += offset.x;
        moving_sums[at + 3u * each] += offset.y;
        moving_sums[at + 4u * each] += offset.z;
        moving_sums[at + 5u * each] += dot(by.way, later.way) + dot(by.axis, later.axis);
    }
}
