//! Beginning of an iteration by many workgroups: has the solve converged?
// use shared/operand

var<storage, read> newton: array<Newton>;

// Scalars of the iteration, the same in all workgroups of a system; one of them `speaks` for all and keeps them. Sets the way.
fn turn_cg(local: u32, system: u32, speaks: bool) -> vec4<f32> {
    let rests = sum_rests(local, system);
    let rz = rests.x;
    let before = scalars_of(local, scalars_at(system) + 1u - parity());
    let bad = scalars_of(local, scalars_at(system) + 3u - parity()).x;
    let of_rhs = select(before.w, rz, before.y == 0.0);
    var state = before.z;
    if state == 0.0 {
        if bad != 0.0 {
            state = 2.0;
        } else if is_small(rests, of_rhs, newton[system]) || before.y >= f32(shape.most) {
            state = 1.0;
        }
    }
    let now = vec4(rz, before.y + select(0.0, 1.0, state == 0.0), state, of_rhs);
    if speaks && local == 0u {
        cg_sums[scalars_at(system) + parity()] = now;
    }
    set_way(parity(), way_factor_of(rz, before.x));
    return now;
}

// Whether the first pass of a product takes part: one with the way of an iteration where the solve goes on, one with the solution where it claims
// to have ended.
fn multiplies(local: u32, share: Share) -> bool {
    if (call.extra & OF_SOLUTION) != 0u {
        set_solution();
        return claims(local, share.member);
    }
    return turn_cg(local, share.member, share.first == 0u).z == 0.0;
}
