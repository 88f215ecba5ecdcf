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

// Value of x − ln(1 + x) at x ≤ −1, where it does not exist: finite, and larger than anything that does. From a part of it on a value says so.
const NOWHERE = 1e30;
const NOWHERE_FROM = 1e25;

// x − ln(1 + x), to rounding of itself also where x is small: with s = x/(2 + x), ln(1 + x) is 2 artanh s and x is 2s + s x.
fn minus_ln1p(x: Dual) -> Dual {
    if x.x <= -1.0 {
        return number(NOWHERE);
    }
    let s = x.x / (2.0 + x.x);
    var f = x.x - log(1.0 + x.x);
    if abs(s) < 0.34 {
        let t = s * s;
        let series = 1.0 / 3.0 + t * (1.0 / 5.0 + t * (1.0 / 7.0 + t * (1.0 / 9.0 + t * (1.0 / 11.0 + t / 13.0))));
        f = s * (x.x - 2.0 * t * series);
    }
    let d = 1.0 / (1.0 + x.x);
    return chain(f, d * x.x, d * d, x);
}

// ln(1 + x) likewise; zero where it does not exist.
fn ln1p(x: Dual) -> Dual {
    if x.x <= -1.0 {
        return number(0.0);
    }
    let d = 1.0 / (1.0 + x.x);
    return chain(x.x - minus_ln1p(number(x.x)).x, d, -d * d, x);
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
