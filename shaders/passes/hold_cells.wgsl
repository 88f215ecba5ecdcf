//! Forces of the clamps on the corners of their cells, with their energy, or what else call.extra asks for (shared/asks).
// use shared/holds
// use shared/asks

var<storage, read> probe: array<vec4<f32>>;
var<storage, read_write> supports: array<vec4<f32>>;

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
        let h = held_at(p.member, site.y, a, x, mix, instant);
        var d = h.deviation;
        if what == HOLD_PROBE {
            d = transpose(h.pose.turn) * probe[a].xyz;
        }
        let f = hold_stiff(matrix, corner, d);
        if h.weight != 0.0 {
            total += (h.weight * factor) * (h.pose.turn * f);
            energy += 0.5 * h.weight * factor * dot(d, f);
        }
    }
    if p.live {
        supports[hold_part() + (p.member * shape.holds + hold) * 8u + corner] = vec4(total, energy);
    }
}
