//! Where every patch stands in the picture of every nozzle, at the state that a step starts from.
// use shared/jet
// use shared/sight

// [jets][B][patches]: place in the picture, depth [m], zero where it is not drawn, and the edge that it is drawn with [m].
var<storage, read_write> jet_sights: array<vec4<f32>>;

@compute @workgroup_size(64)
fn aim_jets(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
            @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    if !p.live {
        return;
    }
    let f = frame_of(p.member, p.item);
    for (var k = 0u; k < shape.jets; k++) {
        let at = meeting(k, p.member, p.item, f);
        let pose = jet_pose(p.member, k);
        let s = dot(at.way, at.axis);
        var sight = vec4(0.0, 0.0, 0.0, max(sqrt(length(at.area)), shape.patch_size));
        if s > 0.0 {
            let place = vec2(dot(at.way, pose.first.xyz), dot(at.way, pose.second.xyz)) / s;
            if length(place) <= jet_reach * at.spread {
                sight = vec4(place, s, sight.w);
            }
        }
        jet_sights[jet_at(k, p.member, p.item)] = sight;
    }
}
