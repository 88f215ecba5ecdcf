//! Forces of the clamps on the corners of their cells, with their energy, or what else call.extra asks for (shared/asks): by the
//! effects' parameters with the row of their slopes, and of the matrices' slopes.
// use shared/holds
// use shared/slopes
// use shared/asks

// [rows][B][steps + 1][clamps].
var<storage, read> hold_slopes: array<HoldSlope>;
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
    let what = call.extra % HOLD_ROW;
    var which = 0u;
    var factor = young_at(m, p.member, site.x);
    if what == HOLD_YOUNG {
        factor /= m.young;
    }
    if what == HOLD_SLOPE {
        factor = modulus_slope(m, p.member, site.x, call.extra / HOLD_ROW);
    }
    if what == HOLD_AGING {
        factor = aging_slope(m, p.member, site.x, call.extra / HOLD_ROW);
    }
    if what == HOLD_POISSON {
        which = 1u;
    }
    let matrix = grip_at(m, p.member, which, hold);
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
        if what == HOLD_REST {
            d = -rest_slope(call.extra / HOLD_ROW, a);
        }
        let f = hold_stiff(matrix, corner, d);
        var g = pose.turn * f;
        if what == HOLD_TIME || what == HOLD_GRIP {
            var turn = pose.turn_rate;
            var shift = pose.shift_rate.xyz;
            if what == HOLD_GRIP {
                let row = (call.extra % HOLD_MATRIX) / HOLD_ROW;
                let slope = hold_slopes[((row * shape.members + p.member) * (shape.steps + 1u) + at) * shape.clamps + site.y];
                turn = slope.turn;
                shift = slope.shift.xyz;
            }
            let rate = transpose(turn) * (u + x - pose.shift.xyz) - transpose(pose.turn) * shift;
            g = turn * f + pose.turn * hold_stiff(matrix, corner, rate);
            if call.extra >= HOLD_MATRIX {
                // The matrix itself: rows of slopes follow the members' own two matrices.
                let row = 2u + call.extra / HOLD_MATRIX - 1u;
                g += pose.turn * hold_stiff(((row * shape.members + p.member) * shape.holds + hold) * 576u, corner, d);
            }
        }
        if weight != 0.0 {
            total += (weight * factor) * g;
            energy += 0.5 * weight * factor * dot(d, f);
        }
    }
    if p.live {
        hold_forces[(p.member * shape.holds + hold) * 8u + corner] = vec4(total, energy);
    }
}
