//! The vector that a product multiplies: the preconditioned residual, or the solution where the true residual is asked for.
// use shared/iteration

// Where it starts.
var<private> operand: u32;

fn operand_at(a: u32) -> vec3<f32> {
    return solving[operand + a].xyz;
}

// Whether a system's residual is said to be small, after an odd iteration.
fn claims(local: u32, system: u32) -> bool {
    return scalars_of(local, scalars_at(system) + 1u).z == 1.0;
}

fn choose_operand() {
    operand = solving_part(select(SCALED, SOLUTION, (call.extra & OF_SOLUTION) != 0u));
}

// Whether the second pass of a product takes part, as the first has found.
fn goes_on(local: u32, share: Share) -> bool {
    choose_operand();
    if (call.extra & OF_SOLUTION) != 0u {
        return claims(local, share.member);
    }
    return scalars_of(local, scalars_at(share.member) + parity()).z == 0.0;
}
