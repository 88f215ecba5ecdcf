//! Corner forces of ∂r/∂p for the parameters that act in cells: Young's modulus, Poisson's ratio, stiffness damping, and, through
//! the passes of clamps and planes, time and planes; and of stiffness that varies. call.extra is the kind of the parameter, plus 16
//! times the row of a field's slopes.
// use shared/cells
// use shared/slopes
// use shared/supports
// use shared/keys

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read_write> cell_force: array<vec4<f32>>;

@compute @workgroup_size(64)
fn press_column(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    lanes_start(local);
    let p = find_place(group, groups, local / 8u, shape.cells, 8u);
    let e = min(p.item, shape.cells - 1u);
    let corner = local % 8u;
    let sign = sign_of(corner);
    let cell = cells[e];
    let m = members[p.member];
    let mix = mix_of(m);
    let young = young_at(m, p.member, e);
    let a = at_node(p.member, cell.nodes[corner]);
    let o = at_node(p.member, cell.nodes[0]);
    let kind = call.extra % 16u;
    var f = vec3(0.0);
    if kind == YOUNGS_MODULUS || kind == POISSON_RATIO || kind == STIFFNESS_DAMPING || kind == MODULUS_SLOPE || kind == AGING_SLOPE {
        let u0 = (now[a].xyz - now[o].xyz) + (now[part(1u) + a].xyz - now[part(1u) + o].xyz);
        let u1 = (next[a].xyz - next[o].xyz) + (next[part(1u) + a].xyz - next[part(1u) + o].xyz);
        let matrix = matrix_at(m.slot, select(0u, 1u, kind == POISSON_RATIO), cell.kind);
        var factor = select(young, young / m.young, kind == YOUNGS_MODULUS);
        if kind == MODULUS_SLOPE {
            factor = modulus_slope(m, p.member, e, call.extra / 16u);
        }
        if kind == AGING_SLOPE {
            factor = aging_slope(m, p.member, e, call.extra / 16u);
        }
        var on_new = mix.on_new;
        var on_old = mix.on_old;
        var own = mix.old;
        if kind == STIFFNESS_DAMPING {
            on_new = 1.0 / shape.dt;
            on_old = -on_new;
            own = 0.0;
        }
        if call.mode == 0u {
            on_old = 0.0;
            own = 0.0;
        }
        let old = free_pose(u0, sign);
        var fresh: Pose;
        if is_lagged() {
            fresh = held_pose(old.turn, u1, sign);
        } else {
            fresh = free_pose(u1, sign);
        }
        f = force(fresh, factor * stiff(matrix, corner, on_new * fresh.q + on_old * old.q), sign);
        if !is_lagged() {
            f += force(old, (factor * own) * stiff(matrix, corner, old.q), sign);
        }
    }
    if kind != STIFFNESS_DAMPING {
        f += support_of(cell, p.member, corner).xyz;
    }
    if p.live {
        cell_force[(p.member * shape.cells + e) * 8u + corner] = vec4(f, 0.0);
    }
}
