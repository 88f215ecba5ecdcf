//! Adds the change of the forces of the laws of cells along a direction to what push_cells left.
// use effects/cells
// use shared/rates

// [B][N]
var<rates> rate_rests: array<vec4<f32>>;
var<storage, read_write> cell_force: array<vec4<f32>>;

// As `ask`, with numbers of the laws that change as well.
fn ask_along(c: Corner, which: u32, s: array<f32, SCALARS>, ds: array<f32, SCALARS>) -> Answer {
    var sum: Answer;
    let count = select(scalars(), 1u, which == LOSS_PART);
    for (var k = 0u; k < MOST_LAWS; k++) {
        if k >= law_count() {
            break;
        }
        let effect = cell_effects[k];
        fill(c, effect, s, ds);
        for (var i = SCALARS; i < CELL_INPUTS; i++) {
            if i - SCALARS < effect.count {
                along[i] = rate_numbers[numbers_at(c.member) + shape.rate_effects + effect.first + i - SCALARS];
            }
        }
        add_answer(&sum, ask_law(effect.law, which, count));
    }
    return sum;
}

// As `ask_energy`, likewise.
fn ask_energy_along(c: Corner, s: array<f32, SCALARS>, ds: array<f32, SCALARS>) -> Answer {
    var sum = ask_along(c, ENERGY_PART, s, ds);
    if material() != 0u {
        add_answer(&sum, ask_material(c, s, ds, rates[c.member].poisson));
    }
    return sum;
}

@compute @workgroup_size(64)
fn push_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let c = find_corner(group, groups, local);
    let fresh = new_side(c);
    let old = old_side(c);
    let w = way_of(c, fresh, old);
    let young = young_rate(c.m, c.member, c.cell);
    // Change of the scalars, of K q at both states, and of K times the increment.
    var ds = nowhere();
    var ds_old = nowhere();
    var by_d = 0.0;
    var kq = vec3(0.0);
    var kq_old = vec3(0.0);
    var kd = vec3(0.0);
    if with_rate(WITH_POISSON) {
        let by_nu = matrix_at(c.m.slot, 1u, cells[c.cell].kind);
        let rate = rates[c.member].poisson;
        kq = rate * stiff(by_nu, c.number, fresh.q);
        kq_old = rate * stiff(by_nu, c.number, old.q);
        kd = rate * stiff(by_nu, c.number, fresh.q - old.q);
        ds[0] = 0.5 * mean(c, fresh.q, kq);
        ds_old[0] = 0.5 * mean(c, old.q, kq_old);
        by_d = 0.5 * mean(c, fresh.q - old.q, kd);
    }
    if with_rate(WITH_RESTS) {
        // The increment does not see it: both states shift alike.
        let dq = -strain_rate(rest_pose(c), rate_rests[c.node].xyz - rate_rests[c.first].xyz, c.sign);
        let moved = stiff(stiffness_of(c), c.number, dq);
        kq += moved;
        kq_old += moved;
        var more = scalar_rates(c, fresh, dq);
        var more_old = scalar_rates(c, old, dq);
        for (var i = 0u; i < SCALARS; i++) {
            ds[i] += more[i];
            ds_old[i] += more_old[i];
        }
    }
    let r = ask_energy_along(c, fresh.s, ds);
    let before = ask_energy_along(c, old.s, ds_old);
    var loss = vec2(0.0);
    if call.mode != 0u {
        var s = nowhere();
        var change = nowhere();
        s[0] = w.d;
        s[1] = old.s[0];
        change[0] = by_d;
        change[1] = ds_old[0];
        let l = ask_along(c, LOSS_PART, s, change);
        loss = vec2(l.first[0], l.bend[0]);
    }
    let flow = flow_way(c, fresh, old);
    // Body-frame forces of the two poses; they are proportional to the modulus.
    let y1 = c.young * (c.mix.fresh * (stress(c, fresh, r.bend) + r.first[0] * kq) + loss.x * kd + loss.y * w.kd)
        + young * (c.mix.fresh * stress(c, fresh, r.first) + loss.x * w.kd)
        + 2.0 * dot(flow_by_numbers(c.m, flow.squared), rates[c.member].viscosity) * flow.kd;
    let y0 = c.young * (stress(c, old, before.bend) + before.first[0] * kq_old) + young * stress(c, old, before.first);
    let f = force(fresh.pose, y1, c.sign) + force(old.pose, c.mix.old * y0, c.sign);
    if c.live {
        cell_force[c.at] += vec4(f, 0.0);
    }
}
