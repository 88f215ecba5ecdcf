//! Derivatives by what acts through clamps: the modulus of each clamp cell, Poisson's ratio, the time of the start, the stress-free shape
//! (for pull_rest), and how effects hold the clamps.
// use shared/holds
// use shared/pulls

// [rows][B][steps + 1][clamps].
var<batch> hold_slopes: array<HoldSlope>;
var<storage, read> probe: array<vec4<f32>>;
var<storage, read_write> supports: array<vec4<f32>>;
// [B][clamp cells]: by the factor on the cell's modulus.
var<storage, read_write> hold_pulls: array<f32>;
// [HOLD_ROWS + aging + poses + matrices][B][workgroups]: by Poisson's ratio and the start first.
var<storage, read_write> hold_sums: array<f32>;

// z · (pose and matrix force) along a change of the pose, at one instant; `kz` and `kd` are the matrix times z in the clamp's frame and times the
// deviation.
fn along_pose(turn: mat3x3<f32>, shift: vec3<f32>, pose: ClampPose, z: vec3<f32>, kz: vec3<f32>, kd: vec3<f32>, x: vec3<f32>) -> f32 {
    return dot(transpose(turn) * z, kd) + dot(kz, transpose(turn) * x - transpose(pose.turn) * shift);
}

@compute @workgroup_size(64)
fn pull_holds(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
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
    let z = probe[a].xyz;
    let young = young_at(m, p.member, site.x);
    let poses = extractBits(call.extra, POSES_AT, MATRICES_AT - POSES_AT);
    let matrices = call.extra >> MATRICES_AT;
    let alive = f32(p.live);
    var by = vec3(0.0);
    var corners = vec3(0.0);
    for (var instant = 0u; instant < 2u; instant++) {
        let h = held_at(p.member, site.y, a, x, mix, instant);
        let tz = transpose(h.pose.turn) * z;
        let matrix = grip_at(m, p.member, 0u, hold);
        let kz = hold_stiff(matrix, corner, tz);
        let kd = hold_stiff(matrix, corner, h.deviation);
        var own = vec3(dot(kz, h.deviation), 0.0, 0.0);
        if seeks(SEEK_POISSON) {
            own.y = dot(tz, hold_stiff(grip_at(m, p.member, 1u, hold), corner, h.deviation));
        }
        let place = h.u + x - h.pose.shift.xyz;
        own.z = along_pose(h.pose.turn_rate, h.pose.shift_rate.xyz, h.pose, z, kz, kd, place);
        by += h.weight * own;
        corners -= (h.weight * young) * kz;
        for (var row = 0u; row < poses; row++) {
            let slope = hold_slopes[((row * shape.members + p.member) * (shape.steps + 1u) + h.at) * shape.clamps + site.y];
            let along = (alive * h.weight * young) * along_pose(slope.turn, slope.shift.xyz, h.pose, z, kz, kd, place);
            let sum = sum64(local, vec4(along, 0.0, 0.0, 0.0)).x;
            if local == 0u && p.live {
                hold_sums[row_at(HOLD_ROWS + shape.aging_rows + row, p.member, hold, shape.holds, 8u)] -= sum;
            }
        }
        for (var row = 0u; row < matrices; row++) {
            // Rows of slopes follow the members' own two matrices.
            let slope = (((2u + row) * shape.members + p.member) * shape.holds + hold) * 576u;
            let along = (alive * h.weight * young) * dot(tz, hold_stiff(slope, corner, h.deviation));
            let sum = sum64(local, vec4(along, 0.0, 0.0, 0.0)).x;
            if local == 0u && p.live {
                hold_sums[row_at(HOLD_ROWS + shape.aging_rows + poses + row, p.member, hold, shape.holds, 8u)] -= sum;
            }
        }
    }
    let s = sum8(by);
    let first = p.live && corner == 0u;
    let total = sum64(local, select(vec4(0.0), vec4(young * s, 0.0), first));
    if first {
        hold_pulls[p.member * shape.holds + hold] -= unvaried(m, p.member) * s.x;
    }
    if local == 0u && p.live {
        hold_sums[row_at(0u, p.member, hold, shape.holds, 8u)] -= total.y;
        hold_sums[row_at(1u, p.member, hold, shape.holds, 8u)] -= total.z;
        for (var row = 0u; row < shape.aging_rows; row++) {
            let slope = aging_at(p.member, 1u + row) / aging_at(p.member, 0u);
            hold_sums[row_at(HOLD_ROWS + row, p.member, hold, shape.holds, 8u)] -= slope * total.x;
        }
    }
    if p.live && seeks(SEEK_REST) {
        supports[hold_part() + (p.member * shape.holds + hold) * 8u + corner] = vec4(corners, 0.0);
    }
}
