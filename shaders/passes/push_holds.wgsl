//! Change of the clamps' forces along a direction: by the modulus of every cell, Poisson's ratio, the time of the start, the stress-free
//! shape, and how effects hold the clamps.
// use shared/holds
// use shared/rates
// use shared/pulls

// [rows][B][steps + 1][clamps].
var<batch> hold_slopes: array<HoldSlope>;
// [B][N]
var<rates> rate_rests: array<vec4<f32>>;
var<storage, read_write> supports: array<vec4<f32>>;

@compute @workgroup_size(64)
fn push_holds(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
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
    let young = young_at(m, p.member, site.x);
    let change = young_rate(m, p.member, site.x);
    let r = rates[p.member];
    let numbers = aging_numbers(p.member) + shape.aging_rows;
    let poses = extractBits(call.extra, POSES_AT, MATRICES_AT - POSES_AT);
    let matrices = call.extra >> MATRICES_AT;
    var total = vec3(0.0);
    for (var instant = 0u; instant < 2u; instant++) {
        let h = held_at(p.member, site.y, a, x, mix, instant);
        var turn = r.start * h.pose.turn_rate;
        var shift = r.start * h.pose.shift_rate.xyz;
        for (var row = 0u; row < poses; row++) {
            let slope = hold_slopes[((row * shape.members + p.member) * (shape.steps + 1u) + h.at) * shape.clamps + site.y];
            turn += rate_numbers[numbers + row] * slope.turn;
            shift += rate_numbers[numbers + row] * slope.shift.xyz;
        }
        var rate = transpose(turn) * (h.u + x - h.pose.shift.xyz) - transpose(h.pose.turn) * shift;
        if with_rate(WITH_RESTS) {
            rate -= rate_rests[a].xyz;
        }
        let matrix = grip_at(m, p.member, 0u, hold);
        var g = hold_stiff(matrix, corner, change * h.deviation + young * rate);
        if with_rate(WITH_POISSON) {
            g += (young * r.poisson) * hold_stiff(grip_at(m, p.member, 1u, hold), corner, h.deviation);
        }
        for (var row = 0u; row < matrices; row++) {
            // Rows of slopes follow the members' own two matrices.
            let slope = (((2u + row) * shape.members + p.member) * shape.holds + hold) * 576u;
            g += (young * rate_numbers[numbers + poses + row]) * hold_stiff(slope, corner, h.deviation);
        }
        let f = h.pose.turn * g + turn * (young * hold_stiff(matrix, corner, h.deviation));
        if h.weight != 0.0 {
            total += h.weight * f;
        }
    }
    if p.live {
        supports[hold_part() + (p.member * shape.holds + hold) * 8u + corner] = vec4(total, 0.0);
    }
}
