//! Derivatives by an obstacle's numbers and by the start's time, patch by patch.
// use shared/obstacle
// use shared/probed

// [rows][B][patches]: of every thing its numbers, then the start's time.
var<storage, read_write> moving_sums: array<f32>;

@compute @workgroup_size(64)
fn pull_obstacles(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                  @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    if !p.live {
        return;
    }
    let site = patches[p.item];
    let theta = select(1.0, shape.theta, call.mode != 0u);
    let way = patch_way(p.member, p.item, vec3(0.0), acts_along(theta));
    let z = site.w * probe_at(p.member, patch_stencil(p.item));
    for (var k = 0u; k < shape.obstacles; k++) {
        let t = touch_obstacle(k, p.member, site.xyz, way, theta);
        if !t.felt {
            continue;
        }
        let stiffness = effect_values[p.member * obstacles[k].stride + obstacles[k].value];
        // Forces are the pressure's opposite.
        let each = shape.members * shape.patches;
        let at = obstacles[k].row * each + p.member * shape.patches + p.item;
        moving_sums[at] += t.pressure * dot(t.fresh.normal, z);
        moving_sums[at + each] += stiffness * dot(shifted(t, vec3(1.0, 0.0, 0.0)), z);
        moving_sums[at + 2u * each] += stiffness * dot(shifted(t, vec3(0.0, 1.0, 0.0)), z);
        moving_sums[at + 3u * each] += stiffness * dot(shifted(t, vec3(0.0, 0.0, 1.0)), z);
        moving_sums[at + 4u * each] += stiffness * dot(later(t), z);
    }
}
