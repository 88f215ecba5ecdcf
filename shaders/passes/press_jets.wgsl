//! What jets do to every surface patch, added to what touch_patches left: their force, which a step does not change, or what else call.extra asks for
//! (shared/asks).
// use shared/jet
// use shared/probed
// use shared/rates
// use shared/asks

var<storage, read> jet_seen: array<u32>;
// [B][patches][3], columns of what TOUCH_BACK leaves for F at a patch.
var<storage, read_write> jet_turns: array<vec4<f32>>;
var<storage, read_write> supports: array<vec4<f32>>;

// Change of F at a patch along `probe`.
fn frame_along(member: u32, which: u32) -> mat3x3<f32> {
    let o = at_node(member, frame_nodes[frame_rows[which]]);
    var d = mat3x3<f32>();
    for (var k = frame_rows[which]; k < frame_rows[which + 1u]; k++) {
        let u = probe[at_node(member, frame_nodes[k])].xyz - probe[o].xyz;
        let g = frame_gradients[k].xyz;
        d += mat3x3(u * g.x, u * g.y, u * g.z);
    }
    return d;
}

@compute @workgroup_size(64)
fn press_jets(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let p = find_place(group, groups, local, shape.patches, 64u);
    if !p.live {
        return;
    }
    let f = frame_of(p.member, p.item);
    let n = patch_normals[p.item].xyz;
    let size = patches[p.item].w;
    var mean = vec3(0.0);
    var turn = mat3x3<f32>();
    if call.extra != TOUCH_ALONG {
        mean = probe_at(p.member, patch_stencil(p.item));
    }
    if call.extra == TOUCH_OLD {
        turn = frame_along(p.member, p.item);
    }
    var vector = vec3(0.0);
    var turned = mat3x3<f32>();
    for (var k = 0u; k < shape.jets; k++) {
        if jet_seen[jet_at(k, p.member, p.item)] == 0u {
            continue;
        }
        let blown = blow(meeting(k, p.member, p.item, f));
        switch call.extra {
            case TOUCH_OLD: {
                vector += blown_along(blown, Meeting(mean, size * carried_along(n, f, turn), vec3(0.0), 0.0, 0.0));
            }
            case TOUCH_BACK: {
                let by = blown_pull(blown, mean);
                vector += by.way;
                turned += carried_pull(n, f, size * by.area);
            }
            default: {
                let pose = jet_pose(p.member, k);
                var d = meets_later(k, pose);
                let at = numbers_at(p.member) + shape.rate_effects + jets[k].value;
                let offset = vec3(rate_numbers[at + 2u], rate_numbers[at + 3u], rate_numbers[at + 4u]);
                d.way = rates[p.member].start * d.way - pose.turn * offset;
                d.axis *= rates[p.member].start;
                d.thrust = rate_numbers[at];
                d.spread = rate_numbers[at + 1u];
                vector += blown_along(blown, d);
            }
        }
    }
    let at = p.member * shape.patches + p.item;
    // Corner forces take the vector with the minus sign, as a residual does a load.
    supports[3u * at] += vec4(vector, 0.0);
    if call.extra == TOUCH_BACK {
        for (var column = 0u; column < 3u; column++) {
            jet_turns[3u * at + column] = vec4(turned[column], 0.0);
        }
    }
}
