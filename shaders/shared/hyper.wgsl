//! Hyper-dual numbers (Fike & Alonso, AIAA 2011-886): value, two first derivatives and the mixed second one, exact to rounding.

alias Dual = vec4<f32>;
alias Three = array<vec4<f32>, 3>;

fn number(x: f32) -> Dual {
    return vec4(x, 0.0, 0.0, 0.0);
}

fn mul(a: Dual, b: Dual) -> Dual {
    return vec4(a.x * b.x, a.x * b.y + a.y * b.x, a.x * b.z + a.z * b.x, a.x * b.w + a.y * b.z + a.z * b.y + a.w * b.x);
}

// f(a), from the value and both derivatives of f.
fn chain(f: f32, d: f32, dd: f32, a: Dual) -> Dual {
    return vec4(f, d * a.y, d * a.z, d * a.w + dd * a.y * a.z);
}

fn reciprocal(a: Dual) -> Dual {
    let f = 1.0 / a.x;
    return chain(f, -f * f, 2.0 * f * f * f, a);
}

fn root(a: Dual) -> Dual {
    let f = sqrt(a.x);
    return chain(f, 0.5 / f, -0.25 / (f * a.x), a);
}

fn logarithm(a: Dual) -> Dual {
    let d = 1.0 / a.x;
    return chain(log(a.x), d, -d * d, a);
}

fn exponential(a: Dual) -> Dual {
    let f = exp(a.x);
    return chain(f, f, f, a);
}

fn sine(a: Dual) -> Dual {
    return chain(sin(a.x), cos(a.x), -sin(a.x), a);
}

fn cosine(a: Dual) -> Dual {
    return chain(cos(a.x), -sin(a.x), -cos(a.x), a);
}

fn add3(a: Three, b: Three) -> Three {
    return Three(a[0] + b[0], a[1] + b[1], a[2] + b[2]);
}

fn sub3(a: Three, b: Three) -> Three {
    return Three(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

fn mul3(s: Dual, a: Three) -> Three {
    return Three(mul(s, a[0]), mul(s, a[1]), mul(s, a[2]));
}

fn dot3(a: Three, b: Three) -> Dual {
    return mul(a[0], b[0]) + mul(a[1], b[1]) + mul(a[2], b[2]);
}
