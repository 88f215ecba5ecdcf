//! What materials share: functions of the displacement gradient H, in an order that cancels nothing. Twin of
//! palpate-model/src/materials/mod.rs. Materials are the files of `materials/`; the build script links them with `material_energy`, which
//! calls the one of a number.
// use shared/hyper

// Rows of H.
alias Gradient = array<array<vec4<f32>, 3>, 3>;

fn trace(h: Gradient) -> Dual {
    return h[0][0] + h[1][1] + h[2][2];
}

// Σ H_ij².
fn squares(h: Gradient) -> Dual {
    return dot3(h[0], h[0]) + dot3(h[1], h[1]) + dot3(h[2], h[2]);
}

// ½λ tr²ε + μ ε:ε of a symmetric ε.
fn linear_energy(h: Gradient, lambda: Dual, mu: Dual) -> Dual {
    let t = trace(h);
    return 0.5 * mul(mul(t, t), lambda) + mul(squares(h), mu);
}

// Parts of J − 1 = tr H + c + det H: the trace, c = ½(tr²H − tr H²), and the determinant.
fn volume_parts(h: Gradient) -> Three {
    let minors = Three(
        mul(h[1][1], h[2][2]) - mul(h[1][2], h[2][1]),
        mul(h[1][0], h[2][2]) - mul(h[1][2], h[2][0]),
        mul(h[1][0], h[2][1]) - mul(h[1][1], h[2][0]),
    );
    let c = minors[0] + (mul(h[0][0], h[1][1]) - mul(h[0][1], h[1][0])) + (mul(h[0][0], h[2][2]) - mul(h[0][2], h[2][0]));
    return Three(trace(h), c, mul(h[0][0], minors[0]) - mul(h[0][1], minors[1]) + mul(h[0][2], minors[2]));
}

// Shear energy per μ of neo-Hookean materials: ½(|F|² − 3) − ln J.
fn shear_energy(h: Gradient, parts: Three, j: Dual) -> Dual {
    return 0.5 * squares(h) - parts[1] - parts[2] + minus_ln1p(j);
}
