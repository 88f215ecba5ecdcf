//! Rotation of a deformation gradient F = I + H in single precision, as a unit quaternion: (R − I) is then free of cancellation
//! for small rotations. Twin of palpate-model/src/mechanics/rotation.rs.

override newton_determinant: f32;
override smallest_pair: f32;

// d ⊗ g, by columns.
fn outer(d: vec3<f32>, g: vec3<f32>) -> mat3x3<f32> {
    return mat3x3(d * g.x, d * g.y, d * g.z);
}

fn identity3() -> mat3x3<f32> {
    return mat3x3(vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(0.0, 0.0, 1.0));
}

fn norm2(m: mat3x3<f32>) -> f32 {
    return dot(m[0], m[0]) + dot(m[1], m[1]) + dot(m[2], m[2]);
}

fn cofactors(m: mat3x3<f32>) -> mat3x3<f32> {
    return mat3x3(cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1]));
}

fn trace3(m: mat3x3<f32>) -> f32 {
    return m[0].x + m[1].y + m[2].z;
}

// w with [w]× = A − Aᵀ.
fn axial(a: mat3x3<f32>) -> vec3<f32> {
    return vec3(a[1].z - a[2].y, a[2].x - a[0].z, a[0].y - a[1].x);
}

// [w]×, by columns.
fn cross_matrix(w: vec3<f32>) -> mat3x3<f32> {
    return mat3x3(vec3(0.0, w.z, -w.y), vec3(-w.z, 0.0, w.x), vec3(w.y, -w.x, 0.0));
}

fn inverse3(m: mat3x3<f32>) -> mat3x3<f32> {
    let c = cofactors(m);
    return transpose(c) * (1.0 / dot(m[0], c[0]));
}

// R − I of a unit quaternion (x, y, z, w).
fn excess_of(q: vec4<f32>) -> mat3x3<f32> {
    let v = q.xyz;
    let n = dot(v, v);
    let s = cross_matrix(v) * q.w;
    return (mat3x3(v * v.x - vec3(n, 0.0, 0.0), v * v.y - vec3(0.0, n, 0.0), v * v.z - vec3(0.0, 0.0, n)) + s) * 2.0;
}

fn quaternion_product(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
    return vec4(a.w * b.xyz + b.w * a.xyz + cross(a.xyz, b.xyz), a.w * b.w - dot(a.xyz, b.xyz));
}

// Unit quaternion of a rotation matrix, from its largest component (Shepperd 1978).
fn quaternion_of(r: mat3x3<f32>) -> vec4<f32> {
    let t = trace3(r);
    let w = axial(r);
    var q: vec4<f32>;
    if t >= max(r[0].x, max(r[1].y, r[2].z)) {
        q = vec4(w, 1.0 + t);
    } else if r[0].x >= max(r[1].y, r[2].z) {
        q = vec4(1.0 + r[0].x - r[1].y - r[2].z, r[1].x + r[0].y, r[2].x + r[0].z, w.x);
    } else if r[1].y >= r[2].z {
        q = vec4(r[1].x + r[0].y, 1.0 + r[1].y - r[0].x - r[2].z, r[2].y + r[1].z, w.y);
    } else {
        q = vec4(r[2].x + r[0].z, r[2].y + r[1].z, 1.0 + r[2].z - r[0].x - r[1].y, w.z);
    }
    return normalize(q);
}

// Scaled Newton iteration (Higham 1986) for a positive determinant.
fn newton_rotation(f: mat3x3<f32>) -> vec4<f32> {
    var x = f;
    var far = true;
    for (var i = 0; i < 12; i++) {
        let c = cofactors(x);
        let det = dot(x[0], c[0]);
        var gamma = 1.0;
        if far {
            gamma = sqrt(sqrt(norm2(c) / (norm2(x) * det * det)));
        }
        let next = x * (0.5 * gamma) + c * (0.5 / (gamma * det));
        let moved = norm2(next - x);
        x = next;
        // The error after a step is about half the step squared: 1e-10 here leaves rounding alone.
        if moved < 1e-10 {
            break;
        }
        far = moved > 1e-2;
    }
    return quaternion_of(x);
}

// Leading eigenvector of Davenport's matrix (Horn 1987) by Jacobi rotations, for flat and inverted F.
fn davenport_rotation(f: mat3x3<f32>) -> vec4<f32> {
    let t = trace3(f);
    let k = axial(f);
    // Quaternion order (w, x, y, z).
    var n = array<array<f32, 4>, 4>(
        array<f32, 4>(t, k.x, k.y, k.z),
        array<f32, 4>(k.x, 2.0 * f[0].x - t, f[0].y + f[1].x, f[0].z + f[2].x),
        array<f32, 4>(k.y, f[0].y + f[1].x, 2.0 * f[1].y - t, f[1].z + f[2].y),
        array<f32, 4>(k.z, f[0].z + f[2].x, f[1].z + f[2].y, 2.0 * f[2].z - t),
    );
    var v = array<array<f32, 4>, 4>(
        array<f32, 4>(1.0, 0.0, 0.0, 0.0),
        array<f32, 4>(0.0, 1.0, 0.0, 0.0),
        array<f32, 4>(0.0, 0.0, 1.0, 0.0),
        array<f32, 4>(0.0, 0.0, 0.0, 1.0),
    );
    for (var sweep = 0; sweep < 6; sweep++) {
        for (var p = 0; p < 3; p++) {
            for (var q = p + 1; q < 4; q++) {
                if n[p][q] == 0.0 {
                    continue;
                }
                let tau = (n[q][q] - n[p][p]) / (2.0 * n[p][q]);
                var tangent = 1.0 / (abs(tau) + sqrt(1.0 + tau * tau));
                if tau < 0.0 {
                    tangent = -tangent;
                }
                let c = inverseSqrt(1.0 + tangent * tangent);
                let s = tangent * c;
                for (var i = 0; i < 4; i++) {
                    let x = n[i][p];
                    let y = n[i][q];
                    n[i][p] = c * x - s * y;
                    n[i][q] = s * x + c * y;
                    let a = v[i][p];
                    let b = v[i][q];
                    v[i][p] = c * a - s * b;
                    v[i][q] = s * a + c * b;
                }
                for (var i = 0; i < 4; i++) {
                    let x = n[p][i];
                    let y = n[q][i];
                    n[p][i] = c * x - s * y;
                    n[q][i] = s * x + c * y;
                }
            }
        }
    }
    var best = 0;
    for (var i = 1; i < 4; i++) {
        if n[i][i] > n[best][best] {
            best = i;
        }
    }
    return normalize(vec4(v[1][best], v[2][best], v[3][best], v[0][best]));
}

fn smallest_eigenvalue(a: mat3x3<f32>) -> f32 {
    let mean = trace3(a) / 3.0;
    let b = a - identity3() * mean;
    let p = sqrt(norm2(b) / 6.0);
    if p == 0.0 {
        return mean;
    }
    let angle = acos(clamp(determinant(b) / (2.0 * p * p * p), -1.0, 1.0)) / 3.0;
    return mean + 2.0 * p * cos(angle + 2.0943951);
}

// Inverse of G = tr(S) I − S, shifted where its smallest eigenvalue is too small.
fn pair_inverse(s: mat3x3<f32>) -> mat3x3<f32> {
    let t = trace3(s);
    var g = identity3() * t - s;
    if determinant(g) <= smallest_pair * t * t {
        let smallest = smallest_eigenvalue(g);
        if smallest < smallest_pair {
            g += identity3() * (smallest_pair - smallest);
        }
    }
    return inverse3(g);
}

// S = sym(RᵀF) of F = I + H, from R − I.
fn stretch_of(excess: mat3x3<f32>, h: mat3x3<f32>) -> mat3x3<f32> {
    let m = transpose(excess) + transpose(identity3() + excess) * h;
    return identity3() + (m + transpose(m)) * 0.5;
}

// Unit quaternion (x, y, z, w) of the rotation of F = I + H.
fn rotation_of(h: mat3x3<f32>) -> vec4<f32> {
    let f = identity3() + h;
    let size = norm2(f) / 3.0;
    var q: vec4<f32>;
    if determinant(f) > newton_determinant * size * sqrt(size) {
        q = newton_rotation(f);
        // One more correction with small numbers only: what is left of the skew part of RᵀF.
        let e = excess_of(q);
        let m = transpose(e) + transpose(identity3() + e) * h;
        let turn = 0.5 * (pair_inverse(stretch_of(e, h)) * axial(m));
        if dot(turn, turn) < 1e-6 {
            q = normalize(quaternion_product(q, vec4(turn, 1.0)));
        }
    } else {
        q = davenport_rotation(f);
    }
    return q;
}
