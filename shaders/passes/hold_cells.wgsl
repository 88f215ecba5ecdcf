//! Forces of the clamps on the corners of their cells, with their energy, or what else call.extra asks for (shared/asks).
// use shared/holds
// use shared/asks

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> probe: array<vec4<f32>>;
var<storage, read_write> hold_forces: array<vec4<f32>>;

@compute @workgroup_size(64)
fn hold_cells(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    lanes_start(local);
    let p = find_place(group, groups, local / 8u, shape.holds, 8u);
    let hold = min(p.item, shape.holds - 1u);
    let corner = local % 8u;
    let m = members[p.member];
    let mix = mix_of(m);
    let site = holds[hold];
    let node = cells[site.x].nodes[corner];
    let a = at_node(p.member, node);
    let x = rest[node].xyz;
    let what = call.extra;
    let factor = young_at(m, p.member, site.x);
    let matrix = grip_at(m, p.member, 0u, hold);
    var total = vec3(0.0);
    var energy = 0.0;
    // New state, then old; the argument, which is the same for all lanes, may ask for one of them or none.
    let first = select(0u, 1u, what == HOLD_OLD || what == HOLD_PROBE);
    var end = select(2u, 1u, what == HOLD_NEW);
    if what == NO_HOLD {
        end = 0u;
    }
    for (var instant = first; instant < end; instant++) {
        let weight = select(mix.fresh, mix.old, instant == 1u);
        var at = 0u;
        if call.mode != 0u {
            at = call.step + 1u - instant;
        }
        let pose = pose_at(p.member, at, site.y);
        var u = next[a].xyz + next[part(1u) + a].xyz;
        if instant == 1u {
            u = now[a].xyz + now[part(1u) + a].xyz;
        }
        var d = deviation(pose, u, x);
        if has_rest() {
            d -= rests[a].xyz;
        }
        if what == HOLD_PROBE {
            d = transpose(pose.turn) * probe[a].xyz;
        }
        let f = hold_stiff(matrix, corner, d);
        if weight != 0.0 {
            total += (weight * factor) * (pose.turn * f);
            energy += 0.5 * weight * factor * dot(d, f);
        }
    }
    if p.live {
        hold_forces[(p.member * shape.holds + hold) * 8u + corner] = vec4(total, energy);
    }
}
