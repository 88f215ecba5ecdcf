//! Symmetric rules on triangles and tetrahedra in barycentric coordinates; weights sum to one.

/// A rule's point: barycentric coordinates and weight.
pub type Point<const N: usize> = ([f64; N], f64);

const fn tri3(a: f64, w: f64) -> [Point<3>; 3] {
    let b = 1.0 - 2.0 * a;
    [([b, a, a], w), ([a, b, a], w), ([a, a, b], w)]
}

/// Exact to degree 4 on a triangle, 6 points (Dunavant 1985).
pub const TRIANGLE4: [Point<3>; 6] = {
    let p = tri3(0.4459484909159649, 0.22338158967801147);
    let q = tri3(0.09157621350977074, 0.10995174365532187);
    [p[0], p[1], p[2], q[0], q[1], q[2]]
};

/// Exact to degree 6 on a triangle, 12 points (Dunavant 1985).
pub const TRIANGLE6: [Point<3>; 12] = {
    let p = tri3(0.24928674517091043, 0.11678627572637937);
    let q = tri3(0.06308901449150223, 0.05084490637020682);
    let (a, b, w) = (0.053145049844816945, 0.3103524510337844, 0.08285107561837357);
    let c = 1.0 - a - b;
    [
        p[0],
        p[1],
        p[2],
        q[0],
        q[1],
        q[2],
        ([a, b, c], w),
        ([a, c, b], w),
        ([b, a, c], w),
        ([b, c, a], w),
        ([c, a, b], w),
        ([c, b, a], w),
    ]
};

const fn tet4(a: f64, w: f64) -> [Point<4>; 4] {
    let b = 1.0 - 3.0 * a;
    [([b, a, a, a], w), ([a, b, a, a], w), ([a, a, b, a], w), ([a, a, a, b], w)]
}

/// Exact to degree 6 on a tetrahedron, 24 points (Keast 1986).
pub const TETRA: [Point<4>; 24] = {
    let p = tet4(0.21460287125915167, 6.0 * 0.006653791709694645);
    let q = tet4(0.04067395853461134, 6.0 * 0.0016795351758867763);
    let r = tet4(0.32233789014227565, 6.0 * 0.009226196923942399);
    let (a, b) = (0.06366100187501753, 0.2696723314583159);
    let (c, w) = (1.0 - 2.0 * a - b, 27.0 / 560.0);
    [
        p[0],
        p[1],
        p[2],
        p[3],
        q[0],
        q[1],
        q[2],
        q[3],
        r[0],
        r[1],
        r[2],
        r[3],
        ([a, a, b, c], w),
        ([a, a, c, b], w),
        ([a, b, a, c], w),
        ([a, c, a, b], w),
        ([a, b, c, a], w),
        ([a, c, b, a], w),
        ([b, a, a, c], w),
        ([c, a, a, b], w),
        ([b, a, c, a], w),
        ([c, a, b, a], w),
        ([b, c, a, a], w),
        ([c, b, a, a], w),
    ]
};

#[cfg(test)]
mod tests {
    use super::*;

    fn factorial(n: usize) -> f64 {
        (1..=n).map(|i| i as f64).product()
    }

    /// Mean of Π λ_i^{p_i} over a simplex: d! Π p_i! / (d + Σ p_i)!.
    fn mean<const N: usize>(p: [usize; N]) -> f64 {
        factorial(N - 1) * p.iter().map(|&p| factorial(p)).product::<f64>() / factorial(N - 1 + p.iter().sum::<usize>())
    }

    fn check<const N: usize>(rule: &[Point<N>], degree: usize) {
        for code in 0..(degree + 1).pow(N as u32) {
            let p: [usize; N] = std::array::from_fn(|i| code / (degree + 1).pow(i as u32) % (degree + 1));
            if p.iter().sum::<usize>() <= degree {
                let s: f64 = rule.iter().map(|(b, w)| w * (0..N).map(|i| b[i].powi(p[i] as i32)).product::<f64>()).sum();
                // The tabulated constants have 15 to 18 digits.
                assert!((s - mean(p)).abs() < 1e-14, "{p:?}: {s} {}", mean(p));
            }
        }
    }

    #[test]
    fn rules_are_exact_to_their_degree() {
        check(&TRIANGLE4, 4);
        check(&TRIANGLE6, 6);
        check(&TETRA, 6);
    }
}
