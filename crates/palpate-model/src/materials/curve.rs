//! Factors on a stiffness that depend on the deformation: piecewise linear in the logarithm of a stretch, 1 at rest, constant beyond the last
//! corners. Integrals are in closed form, so stresses and energies follow exactly.

/// Most corners of a curve beside the one at rest.
pub const MOST_CORNERS: usize = 16;

/// A curve by its corners; the one at rest is left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// Stretches of the corners, increasing, > 0, none of them 1.
    pub stretches: Vec<f64>,
    /// Factors at the corners, > 0.
    pub factors: Vec<f64>,
}

/// Integrals of a curve v from rest to x, the logarithm of a stretch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Integrals {
    /// v(x).
    pub value: f64,
    /// a(x) = ∫ e^t v dt.
    pub up: f64,
    /// ∫ a e^t dt.
    pub up_up: f64,
    /// b(x) = ∫ e^−t v dt.
    pub down: f64,
    /// ∫ b e^t dt.
    pub down_up: f64,
}

impl Curve {
    /// 1 everywhere.
    pub const FLAT: Curve = Curve { stretches: Vec::new(), factors: Vec::new() };

    /// A curve through corners.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn new(stretches: Vec<f64>, factors: Vec<f64>) -> Result<Curve, String> {
        if stretches.len() > MOST_CORNERS {
            return Err(format!("has {} corners, at most {MOST_CORNERS} are allowed", stretches.len()));
        }
        if stretches.len() != factors.len() {
            return Err(format!("has {} corners and {} factors", stretches.len(), factors.len()));
        }
        if stretches.iter().chain(&factors).any(|v| !(*v > 0.0 && v.is_finite())) {
            return Err("must have numbers > 0".into());
        }
        if stretches.windows(2).any(|w| w[0] >= w[1]) {
            return Err("must have increasing corners".into());
        }
        if stretches.contains(&1.0) {
            return Err("has a corner at 1, where the factor is 1 by definition: the moduli are those at rest".into());
        }
        Ok(Curve { stretches, factors })
    }

    /// All corners as logarithms with their values; `rest` at 0.
    fn table(&self, rest: f64, factors: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
        let mut table: Vec<(f64, f64)> = self.stretches.iter().enumerate().map(|(k, s)| (s.ln(), factors(k))).collect();
        let at = table.partition_point(|c| c.0 < 0.0);
        table.insert(at, (0.0, rest));
        table
    }

    /// Integrals up to x.
    pub fn integrals(&self, x: f64) -> Integrals {
        walk(&self.table(1.0, |k| self.factors[k]), x)
    }

    /// Their derivative by factor k, which they are linear in.
    pub fn by_factor(&self, k: usize, x: f64) -> Integrals {
        walk(&self.table(0.0, |other| f64::from(u8::from(other == k))), x)
    }

    /// Mean of v e^t over stretches between e^p and e^q with respect to the stretch, also where these are equal: (a(q) − a(p))/(e^q − e^p).
    pub fn mean_up(&self, p: f64, q: f64) -> f64 {
        let table = self.table(1.0, |k| self.factors[k]);
        let (lo, hi) = (p.min(q), p.max(q));
        // From here on a difference of integrals has more digits than the rule needs points.
        if hi - lo > 1e-2 {
            return (walk(&table, hi).up - walk(&table, lo).up) / (hi.exp() - lo.exp());
        }
        let inner = table.iter().map(|c| c.0).filter(|c| *c > lo && *c < hi);
        let ends: Vec<f64> = std::iter::once(lo).chain(inner).chain(std::iter::once(hi)).collect();
        let (mut sum, mut length) = (0.0, 0.0);
        for w in ends.windows(2) {
            // Gauss's rule of three points, in the stretch: of a linear function of its logarithm right to 1e-15 on so short a piece.
            let (a, b) = (w[0].exp(), w[1].exp());
            let half = 0.5 * (b - a);
            let at = |z: f64| value(&table, (0.5 * (a + b) + half * z).ln());
            let z = 0.6f64.sqrt();
            sum += half * (5.0 * at(-z) + 8.0 * at(0.0) + 5.0 * at(z)) / 9.0;
            length += b - a;
        }
        if length > 0.0 { sum / length } else { value(&table, lo) }
    }
}

/// v at x.
fn value(table: &[(f64, f64)], x: f64) -> f64 {
    let next = table.partition_point(|c| c.0 <= x);
    match (next.checked_sub(1).and_then(|k| table.get(k)), table.get(next)) {
        (Some(a), Some(b)) => a.1 + (b.1 - a.1) * (x - a.0) / (b.0 - a.0),
        (Some(end), None) | (None, Some(end)) => end.1,
        (None, None) => 1.0,
    }
}

/// Integrals from 0 to x, piece by piece.
fn walk(table: &[(f64, f64)], x: f64) -> Integrals {
    let mut corners: Vec<f64> = table.iter().map(|c| c.0).filter(|c| (*c > 0.0 && *c < x) || (*c < 0.0 && *c > x)).collect();
    if x < 0.0 {
        corners.reverse();
    }
    corners.push(x);
    let mut sum = Integrals { value: value(table, x), ..Integrals::default() };
    let mut from = 0.0;
    for to in corners {
        // v = α + β t between the two.
        let middle = 0.5 * (from + to);
        let next = table.partition_point(|c| c.0 <= middle);
        let slope = match (next.checked_sub(1).and_then(|k| table.get(k)), table.get(next)) {
            (Some(a), Some(b)) => (b.1 - a.1) / (b.0 - a.0),
            _ => 0.0,
        };
        let level = value(table, middle) - slope * middle;
        sum.add(level, slope, from, to);
        from = to;
    }
    sum
}

impl Integrals {
    /// Goes on from p to q, between which v = α + β t.
    fn add(&mut self, level: f64, slope: f64, p: f64, q: f64) {
        let (ep, eq) = (p.exp(), q.exp());
        // Antiderivatives of e^t v and e^−t v.
        let up = |t: f64, e: f64| e * (level + slope * (t - 1.0));
        let down = |t: f64, e: f64| -(level + slope * (t + 1.0)) / e;
        // Those of e^t times them.
        let up_up = |t: f64, e: f64| e * e * (0.5 * (level + slope * (t - 1.0)) - 0.25 * slope);
        let down_up = |t: f64| -t * (level + slope * (0.5 * t + 1.0));
        self.up_up += (self.up - up(p, ep)) * (eq - ep) + up_up(q, eq) - up_up(p, ep);
        self.down_up += (self.down - down(p, ep)) * (eq - ep) + down_up(q) - down_up(p);
        self.up += up(q, eq) - up(p, ep);
        self.down += down(q, eq) - down(p, ep);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve() -> Curve {
        Curve::new(vec![0.5, 0.8, 1.3, 1.9], vec![3.0, 0.7, 1.6, 0.4]).unwrap()
    }

    /// Simpson's rule on pieces that no corner falls into.
    fn integral(f: impl Fn(f64) -> f64, x: f64) -> f64 {
        let mut ends: Vec<f64> =
            [0.5f64, 0.8, 1.3, 1.9].iter().map(|s| s.ln()).filter(|c| c * x > 0.0 && c.abs() < x.abs()).collect();
        ends.extend([0.0, x]);
        ends.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let piece = |w: &[f64]| {
            let n = 200;
            let d = (w[1] - w[0]) / n as f64;
            (0..n).map(|i| w[0] + d * i as f64).map(|t| d / 6.0 * (f(t) + 4.0 * f(t + 0.5 * d) + f(t + d))).sum::<f64>()
        };
        ends.windows(2).map(piece).sum()
    }

    #[test]
    fn integrals_are_those_of_the_curve() {
        let c = curve();
        for x in [-1.5, -0.4, -0.1, 0.0, 0.05, 0.3, 0.9] {
            let found = c.integrals(x);
            let right = Integrals {
                value: found.value,
                up: integral(|t| t.exp() * c.integrals(t).value, x),
                up_up: integral(|t| t.exp() * c.integrals(t).up, x),
                down: integral(|t| (-t).exp() * c.integrals(t).value, x),
                down_up: integral(|t| t.exp() * c.integrals(t).down, x),
            };
            let all = |i: Integrals| [i.up, i.up_up, i.down, i.down_up];
            // Simpson's error on 200 pieces, and rounding.
            assert!(all(found).iter().zip(all(right)).all(|(a, b)| (a - b).abs() < 1e-11), "{x}: {found:?} {right:?}");
        }
        let at = |x: f64| c.integrals(x).value;
        assert!([(0.8f64, 0.7), (1.9, 0.4), (0.1, 3.0), (5.0, 0.4)].iter().all(|(s, v)| (at(s.ln()) - v).abs() < 1e-14));
        assert_eq!(at(0.0), 1.0);
    }

    #[test]
    fn integrals_are_linear_in_the_factors() {
        let c = curve();
        for x in [-1.0, -0.15, 0.1, 0.5] {
            let flat = Curve { factors: vec![0.0; 4], ..c.clone() };
            let sum: f64 = (0..4).map(|k| c.factors[k] * c.by_factor(k, x).up_up).sum();
            assert!((flat.integrals(x).up_up + sum - c.integrals(x).up_up).abs() < 1e-13);
        }
    }

    #[test]
    fn means_are_continuous_where_stretches_meet() {
        let c = curve();
        for p in [-0.9, 0.2, 1.3f64.ln(), 1.3f64.ln() - 0.004] {
            let exact = |q: f64| (c.integrals(q).up - c.integrals(p).up) / (q.exp() - p.exp());
            assert!((c.mean_up(p, p + 9e-3) - exact(p + 9e-3)).abs() < 1e-12);
            assert!((c.mean_up(p + 2e-2, p) - exact(p + 2e-2)).abs() < 1e-13);
            assert_eq!(c.mean_up(p, p), c.integrals(p).value);
        }
    }

    #[test]
    fn corners_that_are_none_are_refused() {
        for (s, f, message) in [
            (vec![0.5, 0.4], vec![1.0, 1.0], "increasing"),
            (vec![0.5], vec![1.0, 1.0], "1 corners and 2 factors"),
            (vec![1.0], vec![1.0], "corner at 1"),
            (vec![-1.0], vec![1.0], "> 0"),
            (vec![2.0], vec![0.0], "> 0"),
            ((2..20).map(f64::from).collect(), vec![1.0; 18], "at most 16"),
        ] {
            let error = Curve::new(s, f).unwrap_err();
            assert!(error.contains(message), "{error}");
        }
    }
}
