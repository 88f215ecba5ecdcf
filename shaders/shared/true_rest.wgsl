//! What a derivative's solve makes of its true residual r = b − A x. The one that iterations carry along drifts from it as rounding adds up, and
//! gets as small as one likes (van der Vorst & Ye, SIAM J. Sci. Comput. 22, 2000). So r is computed anew where it is said to be small, and where it is
//! not the solve begins anew with what is left.
// use shared/iteration

// The true one counts as small up to so many times what was asked for: below, rounding of A itself decides.
const NEAR = 10.0;

// Instead of rᵀ z: the next iteration is a first one.
const ANEW = -1.0;

// Whether a solve that claims to have ended has; `n.trial` counts the claims, for no trial follows a derivative.
fn is_true(rests: vec3<f32>, of_rhs: f32, n: Newton) -> bool {
    return is_within(NEAR, rests, of_rhs, n) || n.trial >= MOST_CLAIMS || n.cg >= shape.most;
}
