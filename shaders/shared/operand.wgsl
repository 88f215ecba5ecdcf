//! The vector that a product multiplies: the way z + β p of an iteration, made where it is needed, so that no dispatch has to come before; or the
//! solution, where the true residual is asked for.
// use shared/iteration

// What makes the way of the one before, and where that lies and this one goes. Whoever multiplies has set it.
var<private> way_factor: f32;
var<private> way_before: u32;
var<private> way_at: u32;
// Where the vector starts that the way before is added to.
var<private> operand: u32;

fn operand_at(a: u32) -> vec3<f32> {
    return solving[operand + a].xyz + way_factor * solving[way_before + a].xyz;
}

// Says which iteration is asked for its way.
fn set_way(odd: u32, factor: f32) {
    operand = solving_part(SCALED);
    way_factor = factor;
    way_before = solving_part(select(ODD_WAY, EVEN_WAY, odd == 1u));
    way_at = solving_part(select(EVEN_WAY, ODD_WAY, odd == 1u));
}

// The solution itself.
fn set_solution() {
    operand = solving_part(SOLUTION);
    way_factor = 0.0;
    way_before = solving_part(ODD_WAY);
}

// Whether a system's residual is said to be small, after an odd iteration.
fn claims(local: u32, system: u32) -> bool {
    return scalars_of(local, scalars_at(system) + 1u).z == 1.0;
}

// Whether the second pass of a product takes part, as the first has found.
fn goes_on(local: u32, share: Share) -> bool {
    if (call.extra & OF_SOLUTION) != 0u {
        set_solution();
        return claims(local, share.member);
    }
    let now = scalars_of(local, scalars_at(share.member) + parity());
    let before = scalars_of(local, scalars_at(share.member) + 1u - parity());
    set_way(parity(), way_factor_of(now.x, before.x));
    return now.z == 0.0;
}
