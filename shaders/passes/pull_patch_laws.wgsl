//! The same of an effect on patches, at every plane where it is one of contact.
// use shared/pull_point
// use shared/patch_way
// use shared/probed

var<storage, read> planes: array<Plane>;

@compute @workgroup_size(64)
fn pull_patch_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                   @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    let effect = effects[asked_effect()];
    let m = members[p.member];
    let which = min(p.item, shape.patches - 1u);
    let site = patches[which];
    let way = patch_way(p.member, which, vec3(0.0), true);
    let mean = probe_at(p.member, patch_stencil(which));
    prepare(effect, p.member, m, mix_of(m));
    place_point(site.xyz, way.whole, way.rest, way.old_whole, way.old_rest, vec3(0.0));
    measure = number(site.w);
    aim(mean);
    let at_planes = effect.site == AT_CONTACT;
    for (var k = 0u; k < max(shape.planes, 1u); k++) {
        var by = vec3(0.0);
        if at_planes && k < shape.planes {
            let plane = planes[p.member * shape.planes + k];
            for (var i = 0u; i < 4u; i++) {
                z[PLANE_AT + i] = number(plane.normal[i]);
            }
            z[PLANE_AT + 4u] = number(plane.stiffness);
            add_inputs(effect, plane.scales * DEFAULT_STIFFNESS / shape.element_size);
            if is_sought(SEEK_PLANES) {
                by = vec3(by_one(effect.law, PLANE_AT + 3u, 1.0), by_normal(effect.law, plane.by_theta.xyz),
                          by_normal(effect.law, plane.by_phi.xyz));
            }
        } else if !at_planes && k == 0u {
            add_inputs(effect, 0.0);
        }
        for (var i = 0u; i < PLANE_ROWS; i++) {
            take(local, effect.count + POINT_ROWS + PLANE_ROWS * k + i, p.live, p.member, p.item / 64u, by[i]);
        }
    }
    take_inputs(local, effect, p.live, p.member, p.item / 64u);
}
