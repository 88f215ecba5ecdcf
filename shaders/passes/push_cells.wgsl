//! Change of the cells' force along a direction: by the modulus of every cell, Poisson's ratio, stiffness damping and the stress-free shape;
//! with what the passes of clamps and planes left.
// use shared/past
// use shared/guard
// use shared/rates
// use shared/supports

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
// [B][N]
var<rates> rate_rests: array<vec4<f32>>;
var<storage, read_write> cell_force: array<vec4<f32>>;

@compute @workgroup_size(64)
fn push_cells(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let c = find_corner(group, groups, local);
    let u0 = (now[c.node].xyz - now[c.first].xyz) + (now[part(1u) + c.node].xyz - now[part(1u) + c.first].xyz);
    let u1 = (next[c.node].xyz - next[c.first].xyz) + (next[part(1u) + c.node].xyz - next[part(1u) + c.first].xyz);
    let old = pose_of(u0, c.sign);
    let fresh = pose_of(u1, c.sign);
    let q0 = past_q(c, old.q);
    let q1 = from_rest(fresh.q, c.at);
    let matrix = matrix_at(c.m.slot, 0u, cells[c.cell].kind);
    let young = young_rate(c.m, c.member, c.cell);
    let way = c.mix.on_new * q1 + c.mix.on_old * q0;
    // What the stiffness is multiplied with in the forces of the two poses.
    var v1 = young * way;
    var v0 = (young * c.mix.old) * q0;
    if call.mode != 0u {
        v1 += (c.young * rates[c.member].stiffness_damping / shape.dt) * (q1 - q0);
    }
    if with_rate(WITH_RESTS) {
        // Damping does not see it: both states shift alike.
        let dq = c.young * strain_rate(rest_pose(c), rate_rests[c.node].xyz - rate_rests[c.first].xyz, c.sign);
        v1 -= c.mix.fresh * dq;
        v0 -= c.mix.old * dq;
    }
    var y1 = stiff(matrix, c.number, v1);
    var y0 = stiff(matrix, c.number, v0);
    if with_rate(WITH_POISSON) {
        let by_nu = matrix_at(c.m.slot, 1u, cells[c.cell].kind);
        let rate = c.young * rates[c.member].poisson;
        y1 += rate * stiff(by_nu, c.number, way);
        y0 += (rate * c.mix.old) * stiff(by_nu, c.number, q0);
    }
    var f = force(fresh, y1, c.sign) + force(old, y0, c.sign);
    // The guard is a multiple of the modulus, at the new state only, and damps nothing.
    if is_guarded(fresh.s) {
        f += fresh.r * guard_force(fresh.s, c.sign, guard_unit(young * c.mix.fresh, cells[c.cell])).xyz;
    }
    f += support_of(cells[c.cell], c.member, c.number).xyz;
    if c.live {
        cell_force[c.at] = vec4(f, 0.0);
    }
}
