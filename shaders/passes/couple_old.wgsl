//! Derivative of the cells' force by the old state, times the vector `probe` (ALONG), or its transpose; with what the
//! clamps' pass and the effects' left for the old state. Twin of `by_old` and `by_old_transposed` of the CPU backend.
// use shared/corner
// use shared/asks
// use shared/patches

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> probe: array<vec4<f32>>;
var<storage, read> old_stress: array<vec4<f32>>;
var<storage, read> supports: array<vec4<f32>>;
var<storage, read_write> cell_force: array<vec4<f32>>;

@compute @workgroup_size(64)
fn couple_old(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let c = find_corner(group, groups, local);
    let u0 = (now[c.node].xyz - now[c.first].xyz) + (now[part(1u) + c.node].xyz - now[part(1u) + c.first].xyz);
    let u1 = (next[c.node].xyz - next[c.first].xyz) + (next[part(1u) + c.node].xyz - next[part(1u) + c.first].xyz);
    // Taken from corner 0 as well: rigid translation of the probe costs no digits.
    let d = probe[c.node].xyz - probe[c.first].xyz;
    let matrix = matrix_at(c.m.slot, 0u, cells[c.cell].kind);
    let before = old_stress[c.at].xyz;
    let turning = pose_of(u0, c.sign);
    let fresh = pose_of(u1, c.sign);
    var f = vec3(0.0);
    if call.extra == ALONG {
        f = force(fresh, (c.mix.on_old * c.young) * stiff(matrix, c.number, strain_rate(turning, d, c.sign)), c.sign);
    } else {
        f = force(turning, (c.mix.on_old * c.young) * stiff(matrix, c.number, strain_rate(fresh, d, c.sign)), c.sign);
    }
    // The old state's own force, whose derivative is symmetric.
    let body = centred(transpose(turning.r) * d);
    let dq = body - cross(spin_body(turning, body, c.sign), turning.z);
    let own = force_body(turning, centred(c.young * stiff(matrix, c.number, dq)), c.sign)
        + second_body(turning, centred(before), body, c.sign);
    f += turning.r * (c.mix.old * own);
    for (var k = cells[c.cell].hold_start; k < cells[c.cell].hold_end; k++) {
        f += supports[hold_part() + (c.member * shape.holds + k) * 8u + c.number].xyz;
    }
    // Contact and effects on patches leave their share where contact has its force.
    if (shape.fields & FIELD_COUPLED) != 0u {
        for (var k = cells[c.cell].patch_start; k < cells[c.cell].patch_end; k++) {
            f -= corner_weight(k, c.number) * supports[3u * (c.member * shape.patches + k)].xyz;
        }
    }
    if c.live {
        cell_force[c.at] = vec4(f, 0.0);
    }
}
