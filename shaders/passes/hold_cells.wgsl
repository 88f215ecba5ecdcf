//! Forces of the clamps on the corners of their cells, with their energy. call.extra: 0 = of the new state, weighted with θ;
//! 1 = of the old state, weighted with 1 − θ; 2, 3, 4 = derivative of both by Young's modulus, Poisson's ratio, time;
//! 5 = the old state's matrix times the vector `probe`; 6 = nothing; 7, 8 + 256 · row = derivative by a parameter of a
//! stiffness that varies over the body, in time, with its slopes in that row.
// use shared/holds
// use shared/slopes

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
    var total = vec3(0.0);
    var energy = 0.0;
    // New state, then old.
    for (var instant = 0u; instant < 2u; instant++) {
        let weight = select(mix.fresh, mix.old, instant == 1u);
        let skipped = weight == 0.0 || what == 6u || (what == 0u && instant == 1u) || ((what == 1u || what == 5u) && instant == 0u);
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
        if what == 5u {
            d = transpose(pose.turn) * probe[a].xyz;
        }
        let f = hold_stiff(m.slot, which, hold, corner, d);
        var g = pose.turn * f;
        if what == 4u {
            let rate = transpose(pose.turn_rate) * (u + x - pose.shift.xyz) - transpose(pose.turn) * pose.shift_rate.xyz;
            g = pose.turn_rate * f + pose.turn * hold_stiff(m.slot, which, hold, corner, rate);
        }
        if !skipped {
            total += (weight * factor) * g;
            energy += 0.5 * weight * factor * dot(d, f);
        }
    }
    if p.live {
        hold_forces[(p.member * shape.holds + hold) * 8u + corner] = vec4(total, energy);
    }
}
