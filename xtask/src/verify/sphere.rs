//! Exact elasticity of a ball that two rigid plates press without friction, by Legendre series, with E = R = 1.
//!
//! A pressure −σ_rr = Σ s_n P_n(cos θ) on the surface displaces it by Σ c_n s_n P_n radially and Σ t_n s_n dP_n/dθ along θ (Lur'e,
//! *Three-Dimensional Problems of the Theory of Elasticity*, 1964, chapter 8). Rings of constant pressure are made to lie in a plane.

use std::f64::consts::PI;

/// Rings of pressure.
const RINGS: usize = 32;
/// Terms of the series; the sums are smoothed by Lanczos' factors.
const TERMS: usize = 4000;

/// A squeezed ball.
#[derive(Clone, Copy, Debug)]
pub struct Squeezed {
    /// Force [E R²].
    pub force: f64,
    /// Way of a plate [R].
    pub approach: f64,
    /// √(5/2) of the root mean square distance from the axis, weighted by pressure: the radius of the contact if the pressure were Hertz's [R].
    pub radius: f64,
}

/// (c_n, t_n) for Poisson's ratio ν.
fn compliances(n: usize, nu: f64) -> [f64; 2] {
    if n == 0 {
        return [1.0 - 2.0 * nu, 0.0];
    }
    let n = n as f64;
    // 2G (a (n+1)(n²−n−2−2ν) + b n(n−1)) = 1 for σ_rr, a (n²+2n−1+2ν) + b (n−1) = 0 for no shear; 2G = 1/(1 + ν).
    let a = -0.5 / (n * n + n * (1.0 + 2.0 * nu) + 1.0 + nu);
    let b = -a * (n * n + 2.0 * n - 1.0 + 2.0 * nu) / (n - 1.0);
    [(a * (n + 1.0) * (n - 2.0 + 4.0 * nu) + b * n) * (1.0 + nu), (a * (n + 5.0 - 4.0 * nu) + b) * (1.0 + nu)]
}

/// P_0 to P_{TERMS + 1} at x.
fn legendre(x: f64) -> Vec<f64> {
    let mut p = vec![1.0, x];
    for n in 1..=TERMS {
        let k = n as f64;
        p.push(((2.0 * k + 1.0) * x * p[n] - k * p[n - 1]) / (k + 1.0));
    }
    p
}

/// The ball whose contacts have this radius [R].
pub fn squeeze(nu: f64, contact: f64) -> Squeezed {
    let edge = |i: usize| contact * i as f64 / RINGS as f64;
    let middle = |i: usize| contact * (i as f64 + 0.5) / RINGS as f64;
    let cosine = |r: f64| (1.0 - r * r).sqrt();
    let edges: Vec<Vec<f64>> = (0..=RINGS).map(|i| legendre(cosine(edge(i)))).collect();
    let middles: Vec<Vec<f64>> = (0..RINGS).map(|i| legendre(cosine(middle(i)))).collect();
    // Heights of the rings' middles, x + Σ_j h_ij p_j = 1 − approach, and no pressure on the last ring: its column is the approach's.
    let mut system = vec![vec![0.0; RINGS + 1]; RINGS];
    for j in 0..RINGS {
        for n in (0..TERMS).step_by(2) {
            let [c, t] = compliances(n, nu);
            // (2n+1)/2 ∫ P_n over both caps: (2n+1) P_n is the derivative of P_{n+1} − P_{n−1}.
            let whole = |i: usize| if n == 0 { edges[i][1] } else { edges[i][n + 1] - edges[i][n - 1] };
            let part = if n == 0 { 0.0 } else { PI * n as f64 / TERMS as f64 };
            let smooth = if n == 0 { 1.0 } else { part.sin() / part };
            let s = (whole(j + 1) - whole(j)) * smooth;
            for (i, row) in system.iter_mut().enumerate() {
                let (x, y) = (cosine(middle(i)), middle(i));
                let slope = if n == 0 { 0.0 } else { n as f64 / y * (x * middles[i][n] - middles[i][n - 1]) };
                row[j] += s * (c * middles[i][n] * x - t * slope * y);
            }
        }
    }
    for (i, row) in system.iter_mut().enumerate() {
        row[RINGS - 1] = 1.0;
        row[RINGS] = 1.0 - cosine(middle(i));
    }
    let solution = solve(system);
    let pressures = &solution[..RINGS - 1];
    let area = |j: usize| PI * (edge(j + 1).powi(2) - edge(j).powi(2));
    let force: f64 = pressures.iter().enumerate().map(|(j, p)| p * area(j)).sum();
    let second: f64 =
        pressures.iter().enumerate().map(|(j, p)| p * area(j) * 0.5 * (edge(j + 1).powi(2) + edge(j).powi(2))).sum();
    Squeezed { force, approach: solution[RINGS - 1], radius: (2.5 * second / force).sqrt() }
}

/// Gaussian elimination with pivots of rows `[N, N + 1]`.
fn solve(mut rows: Vec<Vec<f64>>) -> Vec<f64> {
    let n = rows.len();
    for k in 0..n {
        let best = (k..n).max_by(|a, b| rows[*a][k].abs().total_cmp(&rows[*b][k].abs())).unwrap_or(k);
        rows.swap(k, best);
        let (done, below) = rows.split_at_mut(k + 1);
        for row in below {
            let f = row[k] / done[k][k];
            (k..=n).for_each(|c| row[c] -= f * done[k][c]);
        }
    }
    let mut x = vec![0.0; n];
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|c| rows[k][c] * x[c]).sum();
        x[k] = (rows[k][n] - known) / rows[k][k];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn high_orders_feel_a_half_space() {
        let (nu, n) = (0.3, 2000);
        // (1 − ν)/(G n).
        let half_space = (1.0 - nu) * 2.0 * (1.0 + nu) / n as f64;
        assert!((compliances(n, nu)[0] / half_space - 1.0).abs() < 2e-3);
    }

    #[test]
    fn small_contacts_are_those_of_hertz() {
        let s = squeeze(0.3, 0.02);
        let hertz = (0.75 * 0.91 * s.force).powf(2.0 / 3.0);
        assert!((s.approach / hertz - 1.0).abs() < 0.02, "{s:?}, {hertz}");
        assert!((s.radius / (0.75 * 0.91 * s.force).cbrt() - 1.0).abs() < 0.02, "{s:?}");
    }
}
