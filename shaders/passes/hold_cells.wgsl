//! Forces of the clamps on the corners of their cells, with their energy. call.extra: 0 = of the new state, weighted with θ;
//! 1 = of the old state, weighted with 1 − θ; 2, 3, 4 = derivative of both by Young's modulus, Poisson's ratio, time;
//! 5 = the old state's matrix times the vector `probe`; 6 = nothing; 7, 8 + 256 · row = derivative by a parameter of a
//! stiffness that varies over the body, in time, with its slopes in that row; 9 + 256 · row = by the stress-free shape; 10 + 256 · row
//! + 2¹⁶ · matrix = by how effects hold the clamps, with the poses' slopes in that row, and the matrices' slopes in row matrix − 1.
// use shared/holds
// use shared/slopes

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
    let what = call.extra % 256u;
    var which = 0u;
    var factor = young_at(m, p.member, site.x);
    if what == 2u {
        factor /= m.young;
    }
    if what == 7u {
        factor = modulus_slope(m, p.member, site.x, call.extra / 256u);
    }
    if what == 8u {
        factor = aging_slope(m, p.member, site.x, call.extra / 256u);
    }
    if what == 3u {
        which = 1u;
    }
    let matrix = grip_at(m, p.member, which, hold);
    var total = vec3(0.0);
    var energy = 0.0;
    // New state, then old; the argument, which is the same for all lanes, may ask for one of them or none.
    let first = select(0u, 1u, what == 1u || what == 5u);
    var end = select(2u, 1u, what == 0u);
    if what == 6u {
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
        if what == 5u {
            d = transpose(pose.turn) * probe[a].xyz;
        }
        if what == 9u {
            d = -rest_slope(call.extra / 256u, a);
        }
        let f = hold_stiff(matrix, corner, d);
        var g = pose.turn * f;
        if what == 4u || what == 10u {
            var turn = pose.turn_rate;
            var shift = pose.shift_rate.xyz;
            if what == 10u {
                let row = (call.extra / 256u) % 256u;
                let slope = hold_slopes[((row * shape.members + p.member) * (shape.steps + 1u) + at) * shape.clamps + site.y];
                turn = slope.turn;
                shift = slope.shift.xyz;
            }
            let rate = transpose(turn) * (u + x - pose.shift.xyz) - transpose(pose.turn) * shift;
            g = turn * f + pose.turn * hold_stiff(matrix, corner, rate);
            if call.extra >= 65536u {
                // The matrix itself: rows of slopes follow the members' own two matrices.
                let row = 2u + call.extra / 65536u - 1u;
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
