//! The force of all jets on every patch and its potential, added to what touch_patches left: a load that a step does not change.
// use shared/grid
// use shared/patch_way

var<storage, read> jet_forces: array<vec4<f32>>;
var<storage, read_write> supports: array<vec4<f32>>;

@compute @workgroup_size(64)
fn load_jets(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    if !p.live {
        return;
    }
    let at = p.member * shape.patches + p.item;
    let force = jet_forces[at].xyz;
    let way = patch_way(p.member, p.item, vec3(0.0), true);
    // Counted from the old state, so that the potential of a long way costs no digits.
    let moved = (way.whole - way.old_whole) + (way.rest - way.old_rest);
    supports[3u * at] += vec4(force, -dot(force, moved));
}
