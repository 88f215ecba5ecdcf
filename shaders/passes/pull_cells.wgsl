//! Derivatives by what acts in cells: the modulus of each, Poisson's ratio, stiffness damping, numbers of changes in time; and what the
//! stress-free shape gets through the cells' corners, for pull_rest.
// use shared/past
// use shared/guard
// use shared/pulls

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read> probe: array<vec4<f32>>;
// [B][cells]: by the factor on the cell's modulus.
// [CELL_ROWS + rows of aging …][B][workgroups]: by Poisson's ratio and stiffness damping first; two of the viscosity follow.
var<storage, read_write> cell_sums: array<f32>;
var<storage, read_write> cell_force: array<vec4<f32>>;

@compute @workgroup_size(64)
fn pull_cells(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let c = find_corner(group, groups, local);
    // Taken from corner 0: rigid translation of z costs no digits.
    let z = probe[c.node].xyz - probe[c.first].xyz;
    let u0 = (now[c.node].xyz - now[c.first].xyz) + (now[part(1u) + c.node].xyz - now[part(1u) + c.first].xyz);
    let u1 = (next[c.node].xyz - next[c.first].xyz) + (next[part(1u) + c.node].xyz - next[part(1u) + c.first].xyz);
    let old = pose_of(u0, c.sign);
    let fresh = pose_of(u1, c.sign);
    let q0 = past_q(c, old.q);
    let q1 = from_rest(fresh.q, c.at);
    // z · ∇(y · q) is y · dq with dq the change of q along z.
    let dq0 = strain_rate(old, z, c.sign);
    let dq1 = strain_rate(fresh, z, c.sign);
    let matrix = matrix_at(c.m.slot, 0u, cells[c.cell].kind);
    let f0 = stiff(matrix, c.number, q0);
    let f1 = stiff(matrix, c.number, q1);
    var by = vec3(0.0);
    by.x = dot(dq1, c.mix.on_new * f1 + c.mix.on_old * f0) + c.mix.old * dot(dq0, f0);
    if is_guarded(fresh.s) {
        by.x += dot(z, fresh.r * guard_force(fresh.s, c.sign, guard_unit(c.mix.fresh, cells[c.cell])).xyz);
    }
    if seeks(SEEK_POISSON) {
        let by_nu = matrix_at(c.m.slot, 1u, cells[c.cell].kind);
        let g0 = stiff(by_nu, c.number, q0);
        by.y = dot(dq1, c.mix.on_new * stiff(by_nu, c.number, q1) + c.mix.on_old * g0) + c.mix.old * dot(dq0, g0);
    }
    by.z = dot(dq1, f1 - f0) / shape.dt;
    let s = sum8(by);
    let first = c.live && c.number == 0u;
    let total = sum64(local, select(vec4(0.0), vec4(c.young * s, 0.0), first));
    if first {
        cell_sums[c.member * shape.cells + c.cell] -= unvaried(c.m, c.member) * s.x;
    }
    if local == 0u && c.live {
        cell_sums[shape.members * shape.cells + row_at(0u, c.member, c.cell, shape.cells, 8u)] -= total.y;
        if call.mode != 0u {
            cell_sums[shape.members * shape.cells + row_at(1u, c.member, c.cell, shape.cells, 8u)] -= total.z;
        }
        for (var row = 0u; row < shape.aging_rows; row++) {
            let slope = aging_at(c.member, 1u + row) / aging_at(c.member, 0u);
            cell_sums[shape.members * shape.cells + row_at(CELL_ROWS + row, c.member, c.cell, shape.cells, 8u)] -= slope * total.x;
        }
    }
    if seeks(SEEK_REST) {
        let y = -c.young * stiff(matrix, c.number, c.mix.fresh * dq1 + c.mix.old * dq0);
        let f = force(rest_pose(c), y, c.sign);
        if c.live {
            cell_force[c.at] = vec4(f, 0.0);
        }
    }
}
