//! Corner forces of ∂r/∂p for the parameters that act in cells: Young's modulus, Poisson's ratio, stiffness damping, and, through
//! the passes of clamps and planes, time and planes; of stiffness that varies, and of the stress-free shape. call.extra is the kind of the parameter, plus
//! KEYS times the row of a field's slopes.
// use shared/corner
// use shared/guard
// use shared/slopes
// use shared/supports
// use shared/keys

var<storage, read> now: array<vec4<f32>>;
var<storage, read> next: array<vec4<f32>>;
var<storage, read_write> cell_force: array<vec4<f32>>;

// By the stress-free shape, whose derivative stands in this row. Damping does not see it: both states shift alike.
fn by_rest(c: Corner, row: u32) -> vec3<f32> {
    let u0 = (now[c.node].xyz - now[c.first].xyz) + (now[part(1u) + c.node].xyz - now[part(1u) + c.first].xyz);
    let u1 = (next[c.node].xyz - next[c.first].xyz) + (next[part(1u) + c.node].xyz - next[part(1u) + c.first].xyz);
    let shifted = pose_of(rests[c.node].xyz - rests[c.first].xyz, c.sign);
    let dq = strain_rate(shifted, rest_slope(row, c.node) - rest_slope(row, c.first), c.sign);
    let y = -c.young * stiff(matrix_at(c.m.slot, 0u, cells[c.cell].kind), c.number, dq);
    return force(pose_of(u1, c.sign), c.mix.fresh * y, c.sign) + force(pose_of(u0, c.sign), c.mix.old * y, c.sign);
}

@compute @workgroup_size(64)
fn press_column(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let c = find_corner(group, groups, local);
    let kind = call.extra % KEYS;
    var f = vec3(0.0);
    if kind == YOUNGS_MODULUS || kind == POISSON_RATIO || kind == STIFFNESS_DAMPING || kind == MODULUS_SLOPE || kind == AGING_SLOPE {
        let u0 = (now[c.node].xyz - now[c.first].xyz) + (now[part(1u) + c.node].xyz - now[part(1u) + c.first].xyz);
        let u1 = (next[c.node].xyz - next[c.first].xyz) + (next[part(1u) + c.node].xyz - next[part(1u) + c.first].xyz);
        let matrix = matrix_at(c.m.slot, select(0u, 1u, kind == POISSON_RATIO), cells[c.cell].kind);
        var factor = select(c.young, c.young / c.m.young, kind == YOUNGS_MODULUS);
        if kind == MODULUS_SLOPE {
            factor = modulus_slope(c.m, c.member, c.cell, call.extra / KEYS);
        }
        if kind == AGING_SLOPE {
            factor = aging_slope(c.m, c.member, c.cell, call.extra / KEYS);
        }
        var on_new = c.mix.on_new;
        var on_old = c.mix.on_old;
        var own = c.mix.old;
        if kind == STIFFNESS_DAMPING {
            on_new = 1.0 / shape.dt;
            on_old = -on_new;
            own = 0.0;
        }
        if call.mode == 0u {
            on_old = 0.0;
            own = 0.0;
        }
        var old = pose_of(u0, c.sign);
        var fresh = pose_of(u1, c.sign);
        old.q = from_rest(old.q, c.at);
        fresh.q = from_rest(fresh.q, c.at);
        f = force(fresh, factor * stiff(matrix, c.number, on_new * fresh.q + on_old * old.q), c.sign);
        f += force(old, (factor * own) * stiff(matrix, c.number, old.q), c.sign);
        // The guard is a multiple of the modulus, at the new state only, and damps nothing.
        if kind != POISSON_RATIO && kind != STIFFNESS_DAMPING && is_guarded(fresh.s) {
            f += fresh.r * guard_force(fresh.s, c.sign, guard_unit(factor * c.mix.fresh, cells[c.cell])).xyz;
        }
    }
    if kind == REST_SLOPE {
        f = by_rest(c, call.extra / KEYS);
    }
    if kind != STIFFNESS_DAMPING {
        f += support_of(cells[c.cell], c.member, c.number).xyz;
    }
    if c.live {
        cell_force[c.at] = vec4(f, 0.0);
    }
}
