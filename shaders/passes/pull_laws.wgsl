//! The same of the laws of cells, added to what pull_cells left: by the modulus, Poisson's ratio, the viscosity, changes in time, the stress-free shape, and
//! the laws' own numbers, one a lane.
// use effects/cells
// use shared/pulls

var<storage, read> probe: array<vec4<f32>>;
// Behind the rows of pull_cells: CELL_SLOTS of each law.
var<storage, read_write> cell_sums: array<f32>;
var<storage, read_write> cell_force: array<vec4<f32>>;

// Second derivative of a law's function at scalars `s`, along a change `ds` of them and by this lane's number of the law.
fn by_number(c: Corner, k: u32, which: u32, s: array<f32, SCALARS>, ds: array<f32, SCALARS>) -> f32 {
    let effect = cell_effects[k];
    var values = s;
    var changes = ds;
    for (var i = 0u; i < CELL_INPUTS; i++) {
        if i < SCALARS {
            input[i] = vec4(values[min(i, SCALARS - 1u)], changes[min(i, SCALARS - 1u)], 0.0, 0.0);
        } else {
            let p = i - SCALARS;
            var value = 0.0;
            if p < effect.count {
                value = effect_values[c.member * effect.stride + effect.first + p];
            }
            input[i] = vec4(value, 0.0, f32(p == c.number), 0.0);
        }
    }
    return cell_law(effect.law, which).w;
}

// Second derivative of the material's energy by Poisson's ratio and along a change of the scalars.
fn material_by_poisson(c: Corner, s: array<f32, SCALARS>, ds: array<f32, SCALARS>) -> f32 {
    strain_input(s, ds, nowhere());
    return material_beyond(vec4(c.m.lame.x, 0.0, c.m.lame.z, 0.0), vec4(c.m.lame.y, 0.0, c.m.lame.w, 0.0)).w;
}

fn contract(a: array<f32, SCALARS>, b: array<f32, SCALARS>) -> f32 {
    var x = a;
    var y = b;
    var sum = 0.0;
    for (var i = 0u; i < SCALARS; i++) {
        sum += x[i] * y[i];
    }
    return sum;
}

@compute @workgroup_size(64)
fn pull_laws(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let c = find_corner(group, groups, local);
    let z = probe[c.node].xyz - probe[c.first].xyz;
    let fresh = new_side(c);
    let old = old_side(c);
    let w = way_of(c, fresh, old);
    let dq1 = strain_rate(fresh.pose, z, c.sign);
    let dq0 = strain_rate(old.pose, z, c.sign);
    let ds1 = scalar_rates(c, fresh, dq1);
    let ds0 = scalar_rates(c, old, dq0);
    let dd = mean(c, w.kd, dq1);
    let r = ask_energy(c, fresh.s, ds1);
    let before = ask_energy(c, old.s, ds0);
    let by_old = loss_of(c, w, old, vec2(0.0, 1.0));
    let unit = c.young * volume_of(c);
    // The force is proportional to the modulus.
    let own = c.mix.fresh * contract(r.first, ds1) + c.mix.old * contract(before.first, ds0) + by_old.y * dd;
    var poisson = 0.0;
    if seeks(SEEK_POISSON) {
        let by_nu = matrix_at(c.m.slot, 1u, cells[c.cell].kind);
        let k1 = stiff(by_nu, c.number, fresh.q);
        let k0 = stiff(by_nu, c.number, old.q);
        let by_d = loss_of(c, w, old, vec2(1.0, 0.0)).z;
        let dn0 = 0.5 * mean(c, old.q, k0);
        poisson = c.mix.fresh * (0.5 * mean(c, fresh.q, k1) * r.bend[0] + r.first[0] * mean(c, dq1, k1))
            + c.mix.old * (dn0 * before.bend[0] + before.first[0] * mean(c, dq0, k0))
            + (by_d * 0.5 * mean(c, fresh.q - old.q, k1 - k0) + by_old.z * dn0) * dd + by_old.y * mean(c, dq1, k1 - k0);
    }
    if seeks(SEEK_POISSON) && material() != 0u {
        poisson += c.mix.fresh * material_by_poisson(c, fresh.s, ds1) + c.mix.old * material_by_poisson(c, old.s, ds0);
    }
    var by_flow = vec2(0.0);
    if seeks(SEEK_VISCOSITY) {
        let flow = flow_way(c, fresh, old);
        by_flow = (2.0 * volume_of(c) * mean(c, flow.kd, dq1)) * flow_by_numbers(c.m, flow.squared);
    }
    let first = c.live && c.number == 0u;
    let total = sum64(local, select(vec4(0.0), vec4(unit * vec2(own, poisson), by_flow), first));
    if first {
        cell_sums[c.member * shape.cells + c.cell] -= unvaried(c.m, c.member) * volume_of(c) * own;
    }
    if local == 0u && c.live {
        cell_sums[shape.members * shape.cells + row_at(0u, c.member, c.cell, shape.cells, 8u)] -= total.y;
        cell_sums[shape.members * shape.cells + row_at(2u, c.member, c.cell, shape.cells, 8u)] -= total.z;
        cell_sums[shape.members * shape.cells + row_at(3u, c.member, c.cell, shape.cells, 8u)] -= total.w;
        for (var row = 0u; row < shape.aging_rows; row++) {
            let slope = aging_at(c.member, 1u + row) / aging_at(c.member, 0u);
            cell_sums[shape.members * shape.cells + row_at(CELL_ROWS + row, c.member, c.cell, shape.cells, 8u)] -= slope * total.x;
        }
    }
    var increment = nowhere();
    increment[0] = w.d;
    increment[1] = old.s[0];
    var along_way = nowhere();
    along_way[0] = dd;
    for (var k = 0u; k < MOST_LAWS; k++) {
        if k >= law_count() {
            break;
        }
        var by = c.mix.fresh * by_number(c, k, ENERGY_PART, fresh.s, ds1) + c.mix.old * by_number(c, k, ENERGY_PART, old.s, ds0);
        if call.mode != 0u {
            by += by_number(c, k, LOSS_PART, increment, along_way);
        }
        let sum = sum_cells(local, select(0.0, unit * by, c.live));
        if local < 8u && c.live {
            cell_sums[shape.members * shape.cells + row_at(CELL_ROWS + shape.aging_rows + CELL_SLOTS * k + local, c.member, c.cell, shape.cells, 8u)] -= sum;
        }
    }
    if seeks(SEEK_REST) {
        // The increment does not see it: both states shift alike.
        let matrix = stiffness_of(c);
        let y = c.mix.fresh * (stress(c, fresh, r.bend) + r.first[0] * stiff(matrix, c.number, dq1))
            + c.mix.old * (stress(c, old, before.bend) + before.first[0] * stiff(matrix, c.number, dq0))
            + by_old.z * dd * old.kq;
        let f = force(rest_pose(c), -c.young * y, c.sign);
        if c.live {
            cell_force[c.at] += vec4(f, 0.0);
        }
    }
}
