//! What follows a product in an iteration: x ← x + α p, r ← r − α A p; and of the residual z = M⁻¹ r: the nodes' own blocks, and the groups' motion
//! from force and torque on all groups, which follow from those before without waiting for the others.
// use shared/precondition
// use shared/iteration
// use shared/correction
// use shared/held

// First slice of each group.
var<body> group_slices: array<u32>;

fn wrench_at(place: u32) -> Wrench {
    return Wrench(cg_sums[place].xyz, cg_sums[place + 1u].xyz);
}

fn added(a: Wrench, times: f32, b: Wrench) -> Wrench {
    return Wrench(a.force + times * b.force, a.torque + times * b.torque);
}

// Force and torque that A p is to a group.
fn image_wrench(system: u32, g: u32) -> Wrench {
    var sum = Wrench(vec3(0.0), vec3(0.0));
    for (var k = group_slices[g]; k < group_slices[g + 1u]; k++) {
        sum = added(sum, 1.0, wrench_at(slices_at(system) + OF_SLICE * k));
    }
    return sum;
}

// pᵀ A p from the slices' parts.
fn sum_bends(local: u32, system: u32) -> f32 {
    var sum = vec4(0.0);
    for (var i = local; i < shape.slices; i += TEAM) {
        sum.x += cg_sums[slices_at(system) + OF_SLICE * i].w;
    }
    return total(local, sum).x;
}

// α of an iteration that goes on, 0 where A is not positive along the way; one workgroup `speaks` for all and keeps what comes of it.
fn length_of(local: u32, system: u32, rz: f32, speaks: bool) -> f32 {
    let update = scalars_of(local, scalars_at(system) + 3u - parity());
    let curvature = sum_bends(local, system);
    let curved = is_curved(curvature);
    let alpha = select(0.0, rz / curvature, curved);
    if speaks && local == 0u {
        cg_sums[scalars_at(system) + 2u + parity()] = vec4(select(1.0, 0.0, curved), update.y + alpha * rz, 0.0, 0.0);
    }
    return alpha;
}

// A group's share of it by a workgroup. `begins`: only z, of the residual as it is.
fn advance_group(local: u32, system: u32, home: u32, own: u32, alpha: f32, begins: bool) {
    let choice = coarse_choice(home);
    let turn = turn_of_group(home, own);
    var sum: Motion;
    for (var g = local; g < shape.groups; g += TEAM) {
        var rest = wrench_at(wrenches_at(system, select(1u - parity(), parity(), begins)) + 2u * g);
        if !begins {
            rest = added(rest, -alpha, image_wrench(system, g));
        }
        sum = add_motion(sum, u32(choice.x), g, own, rest);
    }
    let motion = motion_of(Motion(total(local, sum.upper), total(local, sum.lower)), choice.y);
    let way = solving_part(select(EVEN_WAY, ODD_WAY, parity() == 1u));
    var force = vec4(0.0);
    var torque = vec4(0.0);
    var borne = 0.0;
    for (var k = group_rows[own] + local; k < group_rows[own + 1u]; k += TEAM) {
        let node = group_nodes[k];
        let a = at_node(system, node);
        var r = solving[solving_part(REST) + a].xyz;
        if !begins {
            solving[a] += alpha * solving[way + a];
            r -= alpha * solving[solving_part(IMAGE) + a].xyz;
            solving[solving_part(REST) + a] = vec4(r, 0.0);
            let w = wrench_of(turn, arms[node], r);
            force += vec4(w.force, 0.0);
            torque += vec4(w.torque, 0.0);
        }
        let first = scaled(at_node(home, node), r);
        let z = first + carried(turn, arms[node], motion);
        solving[solving_part(SCALED) + a] = vec4(z, 0.0);
        force.w += dot(r, z);
        torque.w += dot(r, first);
        if shape.held != 0u && is_held(home, node) {
            borne += dot(r, first);
        }
    }
    let whole_force = total(local, force);
    let whole_torque = total(local, torque);
    if shape.held != 0u {
        borne = total(local, vec4(borne, 0.0, 0.0, 0.0)).x;
    }
    if local == 0u {
        cg_sums[rests_at(system) + own] = vec4(whole_force.w, whole_torque.w, borne, 0.0);
        // Of the residual itself: what is added up iteration by iteration would drift from it.
        if !begins {
            let at = wrenches_at(system, parity()) + 2u * own;
            cg_sums[at] = whole_force;
            cg_sums[at + 1u] = whole_torque;
        }
    }
}
