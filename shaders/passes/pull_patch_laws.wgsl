//! The same of an effect on patches, at every plane where it is one of contact.
// use effects/patches
// use shared/pull_point
// use shared/patch_way
// use shared/probed

var<batch> planes: array<Plane>;

@compute @workgroup_size(64)
fn pull_patch_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    if !p.live {
        return;
    }
    let effect = effects[asked_effect()];
    let m = members[p.member];
    let site = patches[p.item];
    let way = patch_way(p.member, p.item, vec3(0.0), true);
    let mean = probe_at(p.member, patch_stencil(p.item));
    prepare(effect, p.member, m, mix_of(m));
    place_point(site.xyz, way.whole, way.rest, way.old_whole, way.old_rest, vec3(0.0));
    measure = number(site.w);
    aim(mean);
    for (var k = 0u; k < select(1u, shape.planes, effect.site == AT_CONTACT); k++) {
        var beside = Beside(NONE, 0.0, vec3(0.0), vec3(0.0));
        if effect.site == AT_CONTACT {
            let plane = planes[p.member * shape.planes + k];
            for (var i = 0u; i < 4u; i++) {
                z[PLANE_AT + i] = number(plane.normal[i]);
            }
            z[PLANE_AT + 4u] = number(plane.stiffness);
            beside = Beside(NONE, plane.scales * DEFAULT_STIFFNESS / shape.element_size, plane.by_theta.xyz, plane.by_phi.xyz);
        }
        take_inputs(effect, beside, k, p.member, p.item);
    }
}
