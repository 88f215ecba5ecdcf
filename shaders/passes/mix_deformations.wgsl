//! Adds the deformation of every cell in one of several past states, times its weight, which call.extra has the bits of.
// use shared/corner

var<storage, read> now: array<vec4<f32>>;
var<storage, read_write> old_q: array<vec4<f32>>;

@compute @workgroup_size(64)
fn mix_deformations(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                    @builtin(local_invocation_index) local: u32) {
    let c = find_corner(group, groups, local);
    let pose = pose_of((now[c.node].xyz - now[c.first].xyz) + (now[part(1u) + c.node].xyz - now[part(1u) + c.first].xyz), c.sign);
    if c.live {
        old_q[c.at] += vec4(bitcast<f32>(call.extra) * from_rest(pose.q, c.at), 0.0);
    }
}
