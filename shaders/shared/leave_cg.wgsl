//! Where a member goes from conjugate gradients: to the line search, to the convex tangent, to an error, or on with iterations. A
//! curvature that is not positive cuts a Newton direction short: what was gathered by then leads down (Dembo & Steihaug, Math.
//! Program. 26, 1983). Where that is nothing the convex tangent is asked for.
// use shared/newton_of
// use shared/accuracy

var<storage, read_write> solving: array<vec4<f32>>;
var<storage, read_write> health: array<Health>;

// What rounding may leave of a derivative's right-hand side, as begin_exact has measured it: derivatives are promised to a thousandth.
const ACCEPTABLE = 1e-3;
// At nodes that stiff springs hold, single precision leaves some 1e-7 of a load that they bear, most of which does not count there. Up to so many
// parts of that load it is acceptable.
const BORNE = 4e-7;

// What is left of a derivative's right-hand side.
fn rest_of(rests: vec3<f32>, of_rhs: f32, n: Newton) -> f32 {
    let whole = sqrt(max(of_rhs, NOTHING));
    let counted = whole * max(n.forcing / FINEST, BORNE);
    let left = sqrt(max(vec2(square_of(rests) - rests.z, rests.z) - NOTHING, vec2(0.0)));
    return max(left.x / counted, left.y / max(counted, (BORNE / ACCEPTABLE) * whole));
}

// `rests`: sums of the residual; `of_rhs`: rᵀ M⁻¹ r of the right-hand side; `along_rhs`: xᵀ times it, which is Σ α rᵀ M⁻¹ r over the iterations.
// `exact`: the solve is for a derivative; then a negative curvature is an error where much is left, and no line search follows.
fn leave_cg(local: u32, member: u32, found: Newton, rests: vec3<f32>, of_rhs: f32, along_rhs: f32, bent: bool, over: bool,
            exact: bool) {
    var n = found;
    var broken = 0u;
    // Of nothing nothing is left.
    var relative = sqrt(square_of(rests) / max(of_rhs, 1e-37));
    // A poor Newton direction is the line search's business.
    var enough = 0.5;
    if exact {
        relative = rest_of(rests, of_rhs, n);
        enough = ACCEPTABLE;
    }
    // Of a derivative whose load stiff springs bear but for rounding, that rounding is all that bends.
    let cut = bent && select(n.cg > 1u, relative <= enough, exact);
    let negative = bent && !cut;
    let ended = over || cut;
    if negative {
        n.total += n.cg;
        n.stage = WANTS_MATRIX;
        if exact || n.convex == 1u {
            broken = INDEFINITE;
        }
        n.convex = 1u;
    }
    if ended {
        n.total += n.cg;
        n.stage = select(WANTS_TRIAL, IDLE, exact);
        n.length = 1.0;
        let poor = relative > enough && !is_small(rests, of_rhs, n);
        if (poor || !is_finite(rests.x)) && !cut {
            broken = UNSOLVED;
        }
        if !exact {
            n.slope = -along_rhs;
        }
    }
    if local == 0u {
        if broken != 0u {
            n.stage = IDLE;
            health[member] = Health(broken, call.step + call.mode, vec2(relative, f32(n.cg)));
        }
        newton[member] = n;
    }
}
